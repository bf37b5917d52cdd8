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
    """The service's settings; `from_environment` reads CLUTCHLIFE_DATABASE, CLUTCHLIFE_MAX_BODY_MB,
    CLUTCHLIFE_DIAGNOSIS_SECONDS and CLUTCHLIFE_DIAGNOSIS_MEMORY_MB.

    A diagnosis may take `diagnosis_seconds` and `diagnosis_bytes` of address space, `most_diagnoses` may be asked for at
    once; `engine` names what makes them, module:function.
    """

    database: str = DEFAULT_DATABASE
    most_body_bytes: int = 64 * 2**20
    most_file_bytes: int = 2**30
    diagnosis_seconds: int = 300
    diagnosis_bytes: int = 4 * 2**30
    most_diagnoses: int = 16
    engine: str = "models.diagnosis.diagnose:diagnose"

    @classmethod
    def from_environment(cls, database: str | None = None) -> "Settings":
        """Settings from the environment; a database given here wins. Raises ValueError on a limit that is no number."""
        return cls(
            database=database or os.environ.get("CLUTCHLIFE_DATABASE", DEFAULT_DATABASE),
            most_body_bytes=_whole("CLUTCHLIFE_MAX_BODY_MB", 64, "megabytes") * 2**20,
            diagnosis_seconds=_whole("CLUTCHLIFE_DIAGNOSIS_SECONDS", 300, "seconds"),
            diagnosis_bytes=_whole("CLUTCHLIFE_DIAGNOSIS_MEMORY_MB", 4096, "megabytes") * 2**20,
        )


def _whole(name: str, default: int, unit: str) -> int:
    said = os.environ.get(name, str(default))
    if not said.isdecimal() or int(said) == 0:
        raise ValueError(f"{name} must be a whole number of {unit}, got {said!r}")
    return int(said)
