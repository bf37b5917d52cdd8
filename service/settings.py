"""The settings of the service: each field of `Settings` is an environment variable `CLUTCHLIFE_...`."""

import os
import re
from collections.abc import Iterator
from difflib import get_close_matches
from importlib.metadata import version
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

from service.defaults import DEFAULT_DATABASE
from service.logging import LogFormat, LogLevel

#: Stored beside every result: which code made it.
CODE_VERSION = version("clutchlife")

PREFIX = "CLUTCHLIFE_"
DATABASE_VARIABLE = f"{PREFIX}DATABASE"
#: Bytes of what settings count by.
MIB = 2**20
#: How alike a name must be to that of a setting (2 x signs in common / signs of both) to be one misspelt. Tried: seven
#: slips are alike by 0.93 to 0.98, eight names of commands and orchestrators by at most 0.81. See its tests.
_ALIKE = 0.9
#: What the service's own addresses begin with: a path that a proxy adds and takes off again must be told from them.
_OWN = ("v1", "clutches", "assets", "docs", "help", "openapi.json", "static-offline-docs", "livez", "readyz", "metrics")
_SEGMENT = re.compile(r"[A-Za-z0-9._~-]+")


def _below(path: str) -> str:
    """The root path in the form `/clutch`, without a slash at its end; may be empty. Raises ValueError."""
    path = path.strip("/")
    segments = path.split("/")
    if (path and not all(map(_SEGMENT.fullmatch, segments))) or {".", ".."} & set(segments):
        raise ValueError("a path of letters, digits, -, ., _ and ~, such as /clutch")
    if segments[0] in _OWN:
        raise ValueError(f"a path that does not begin with an address of the service ({', '.join(_OWN)})")
    return path and f"/{path}"


class Settings(BaseSettings):
    """The service's settings, from the environment unless given. The defaults are chosen; those of limits have no table
    unless they name one."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="forbid")

    database: str = Field(
        default=DEFAULT_DATABASE,
        description="`sqlite:///relative/path`, `sqlite:////absolute/path` or `postgresql+psycopg://user@host/database`",
    )
    raw: str | None = Field(
        default=None,
        description="where new long raw records are stored: `database`, `folder:///path` or `s3://bucket/prefix`; "
        "if not set, the place last chosen, at first the database",
    )
    # as `make load` has it, on two cores
    workers: int = Field(
        default=2, ge=0, description="number of processes that take in runs; 0: no worker processes at all"
    )
    max_body_mb: int = Field(
        default=64, ge=1, description="largest run that is accepted as JSON [MiB]; send longer records as files"
    )
    max_file_mb: int = Field(default=1024, ge=1, description="largest file that is accepted [MiB]")
    # a rig's run arrives within one second, over a bad line within ten
    body_seconds: int = Field(
        default=30, ge=1, description="time in which a body must arrive [s], plus one second for each 64 KiB; else 408"
    )
    # eight rigs and twenty pages behind one address ask 100 times a second (`make load`), 30 at once
    requests_per_second: int = Field(
        default=1000,
        ge=1,
        description="requests per second of one key, or of one address without a key; bursts of twice as many; else 429",
    )
    requests_at_once: int = Field(
        default=128, ge=1, description="requests of one key or address at the same time; else 429"
    )
    # twice the requests of one caller at once; four such addresses fit in the 1,024 files that a system gives a process
    connections_at_once: int = Field(
        default=256, ge=1, description="open connections of one address; further ones get 429 and are closed"
    )
    # docs/appendix/benchmarks.md: the longest diagnosis takes 11 s
    diagnosis_seconds: int = Field(
        default=300,
        ge=1,
        description="processor time that a diagnosis may take [s]; it may take six times as long by the clock",
    )
    diagnosis_memory_mb: int = Field(
        default=4096, ge=1, description="address space of the process of a diagnosis [MiB]"
    )
    # an operator's restart of the database takes some seconds, and a lease is prolonged ten times before it runs out
    job_lease_seconds: int = Field(
        default=30, ge=1, description="time after which the job of a killed service is started again [s]"
    )
    most_diagnoses: int = Field(default=16, ge=1, description="diagnoses that may wait or run; further ones get 503")
    # docs/appendix/scale.md: 10,000 clutches of 16 tests take four hours of a core, of 200 tests over twelve times that
    replay_hours: int = Field(
        default=72, ge=1, description="time that a job of a replay or a fleet refresh may take [h]"
    )
    most_replays: int = Field(
        default=16, ge=1, description="replays that may wait or run as jobs; further ones get 503"
    )
    least_free_mb: int = Field(
        default=64, ge=0, description="free space on the database's disk below which `/readyz` answers 503 [MiB]"
    )
    least_memory_mb: int = Field(default=64, ge=0, description="free memory below which `/readyz` answers 503 [MiB]")
    clutch_metrics: bool = Field(
        default=False, description="whether `/metrics` has series of every clutch; Grafana's dashboard needs them"
    )
    log_format: Annotated[LogFormat, BeforeValidator(str.lower)] = Field(
        default="auto", description="`json`, `text`, or `auto` (text on a terminal, JSON elsewhere)"
    )
    log_level: Annotated[LogLevel, BeforeValidator(str.lower)] = Field(
        default="info", description="lowest level that is logged: `debug`, `info`, `warning`, `error` or `critical`"
    )
    root_path: Annotated[str, AfterValidator(_below)] = Field(
        default="", description="path that a proxy adds before all addresses of the service, such as `/clutch`"
    )
    private_receivers: bool | None = Field(
        default=None,
        description="whether alarms may go to this machine and to private networks; if not set, until the first key is made",
    )
    insecure_local: bool = Field(
        default=False, description="accept requests through a proxy on this machine although no key exists"
    )
    engine: str = Field(
        default="models.diagnosis.diagnose:diagnose",
        description="function that makes diagnoses, as `module:function`; for tests",
    )

    @classmethod
    def from_environment(cls, **given: Any) -> "Settings":
        """Settings from the environment; given values take precedence. Raises ValueError with one line that names all
        wrong settings."""
        try:
            return cls(**given)
        except ValidationError as error:
            wrong = "; ".join(map(_wrong, error.errors()))
        raise ValueError(wrong)

    def to_environment(self) -> None:
        """Set environment variables such that `from_environment` gives these settings, in this process and its
        children."""
        for name, value in self.model_dump().items():
            variable = f"{PREFIX}{name.upper()}"
            if value is None:
                os.environ.pop(variable, None)
            else:
                os.environ[variable] = str(value)

    @classmethod
    def misspelt(cls) -> Iterator[str]:
        """A line for each environment variable that resembles a setting but is none.

        Variables of the commands (`CLUTCHLIFE_URL`, ...) resemble none; names that an orchestrator makes of a service called
        clutchlife (`CLUTCHLIFE_PORT_8000_TCP`) do not either.
        """
        names = [f"{PREFIX}{name.upper()}" for name in cls.model_fields]
        for name in sorted(os.environ):
            if name.upper().startswith(PREFIX) and name.upper() not in names:
                for meant in get_close_matches(name.upper(), names, 1, cutoff=_ALIKE):
                    yield f"{name} is no setting and has no effect; is {meant} meant?"

    def shown(self) -> dict[str, object]:
        return self.model_dump() | {"database": redacted(self.database)}


def redacted(address: str) -> str:
    """An address without its password (which may hold an @) and its options (one of which may be a password)."""
    return re.sub(r"\?.*", "?***", re.sub(r"://([^:/@]*):.*@", r"://\1:***@", address))


def _wrong(details: Any) -> str:
    """A line on one wrong variable: its name, the rule and its value."""
    least = details.get("ctx", {}).get("ge")
    rules = {"int_parsing": "a whole number", "greater_than_equal": f"a whole number of at least {least}"}
    rule = rules.get(details["type"], details["msg"].removeprefix("Input should be ").removeprefix("Value error, "))
    return f"{PREFIX}{details['loc'][0].upper()} must be {rule}, got {details['input']!r}"
