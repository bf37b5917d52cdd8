"""What an operator may set, by environment or command line."""

import os
from dataclasses import dataclass
from importlib.metadata import version

#: Stored beside every result: which code made it.
CODE_VERSION = version("clutchlife")

DEFAULT_DATABASE = "sqlite:///clutchlife.db"
DEFAULT_URL = "http://127.0.0.1:8000"


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The service's settings; `from_environment` reads CLUTCHLIFE_DATABASE and CLUTCHLIFE_MAX_BODY_MB."""

    database: str = DEFAULT_DATABASE
    most_body_bytes: int = 64 * 2**20
    most_file_bytes: int = 2**30

    @classmethod
    def from_environment(cls, database: str | None = None) -> "Settings":
        """Settings from the environment; a database given here wins. Raises ValueError on a limit that is no number."""
        megabytes = os.environ.get("CLUTCHLIFE_MAX_BODY_MB", "64")
        if not megabytes.isdecimal() or int(megabytes) == 0:
            raise ValueError(f"CLUTCHLIFE_MAX_BODY_MB must be a whole number of megabytes, got {megabytes!r}")
        return cls(
            database=database or os.environ.get("CLUTCHLIFE_DATABASE", DEFAULT_DATABASE),
            most_body_bytes=int(megabytes) * 2**20,
        )
