"""What an operator may set, by environment or command line."""

import os
from dataclasses import dataclass
from importlib.metadata import version

#: Stored beside every result: which code made it.
CODE_VERSION = version("clutchlife")

DEFAULT_DATABASE = "sqlite:///clutchlife.db"
DEFAULT_URL = "http://127.0.0.1:8000"

#: Processes that take in runs. Chosen: as `make load` has it, on two cores.
DEFAULT_WORKERS = 2
#: Limits, in the units of their environment variables.
DEFAULT_BODY_MB = 64  # MiB of JSON. Chosen; longer records are posted as files
DEFAULT_BODY_SECONDS = 30  # s. Chosen: a rig's run arrives within one, over a bad line within ten
#: Chosen: eight rigs and twenty pages behind one address ask 100 times a second (`make load`), 30 at once.
DEFAULT_REQUESTS_PER_SECOND = 1000
DEFAULT_REQUESTS_AT_ONCE = 128
DEFAULT_DIAGNOSIS_SECONDS = 300  # s of processor time. Chosen; docs/benchmarks.md: the longest diagnosis takes 11 s
DEFAULT_DIAGNOSIS_MEMORY_MB = 4096  # MiB of address space. Chosen; no table


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The service's settings; `from_environment` reads CLUTCHLIFE_DATABASE, CLUTCHLIFE_WORKERS,
    CLUTCHLIFE_MAX_BODY_MB, CLUTCHLIFE_BODY_SECONDS, CLUTCHLIFE_REQUESTS_PER_SECOND, CLUTCHLIFE_REQUESTS_AT_ONCE,
    CLUTCHLIFE_DIAGNOSIS_SECONDS and CLUTCHLIFE_DIAGNOSIS_MEMORY_MB.
    """

    database: str = DEFAULT_DATABASE
    #: The function that makes diagnoses, module:function.
    engine: str = "models.diagnosis.diagnose:diagnose"

    #: Processes that take in runs, beside one for files and one for answers; 0: threads of the service itself.
    workers: int = 0

    #: Without keys, answer also what a proxy on this machine passes on: `serve --insecure-local`.
    insecure_local: bool = False

    #: Bytes of a request's body, and of a posted file (chosen: 1 GiB, as `readers.limits` has it unpacked).
    most_body_bytes: int = DEFAULT_BODY_MB * 2**20
    most_file_bytes: int = 2**30

    #: Seconds that a body may take to arrive, and longer the more has arrived.
    body_seconds: int = DEFAULT_BODY_SECONDS

    #: Requests of one key, or of one address without one: a second, and at once.
    requests_per_second: int = DEFAULT_REQUESTS_PER_SECOND
    requests_at_once: int = DEFAULT_REQUESTS_AT_ONCE

    #: Seconds of processor time and bytes of address space of one diagnosis; diagnoses that wait or run (chosen; no table).
    diagnosis_seconds: int = DEFAULT_DIAGNOSIS_SECONDS
    diagnosis_bytes: int = DEFAULT_DIAGNOSIS_MEMORY_MB * 2**20
    most_diagnoses: int = 16

    @classmethod
    def from_environment(cls, database: str | None = None) -> "Settings":
        """Settings from the environment; a database given here wins. Raises ValueError on a limit that is no number."""
        return cls(
            database=database or os.environ.get("CLUTCHLIFE_DATABASE", DEFAULT_DATABASE),
            workers=_whole("CLUTCHLIFE_WORKERS", DEFAULT_WORKERS, "processes", least=0),
            most_body_bytes=_whole("CLUTCHLIFE_MAX_BODY_MB", DEFAULT_BODY_MB, "megabytes") * 2**20,
            body_seconds=_whole("CLUTCHLIFE_BODY_SECONDS", DEFAULT_BODY_SECONDS, "seconds"),
            requests_per_second=_whole("CLUTCHLIFE_REQUESTS_PER_SECOND", DEFAULT_REQUESTS_PER_SECOND, "requests"),
            requests_at_once=_whole("CLUTCHLIFE_REQUESTS_AT_ONCE", DEFAULT_REQUESTS_AT_ONCE, "requests"),
            diagnosis_seconds=_whole("CLUTCHLIFE_DIAGNOSIS_SECONDS", DEFAULT_DIAGNOSIS_SECONDS, "seconds"),
            diagnosis_bytes=_whole("CLUTCHLIFE_DIAGNOSIS_MEMORY_MB", DEFAULT_DIAGNOSIS_MEMORY_MB, "megabytes") * 2**20,
        )


def _whole(name: str, default: int, unit: str, *, least: int = 1) -> int:
    text = os.environ.get(name, str(default))
    if not text.isdecimal() or int(text) < least:
        raise ValueError(f"{name} must be a whole number of {unit}, got {text!r}")
    return int(text)
