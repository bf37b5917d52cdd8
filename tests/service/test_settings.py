"""Settings: by the environment, each named where it is wrong, each documented, and shown without secrets."""

import json
import os
import subprocess
import sys
from typing import Any

import pytest

from service.settings import PREFIX, Settings, redacted


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"raw": "folder:///raw", "workers": 0, "clutch_metrics": True, "log_format": "json", "root_path": "/a/clutch"},
    ],
)
def test_what_further_processes_find_in_the_environment_are_the_same_settings(
    given: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in Settings.model_fields:  # so that all are taken back afterwards
        monkeypatch.setenv(f"{PREFIX}{name.upper()}", "of another service")
    defaults = {name: field.default for name, field in Settings.model_fields.items()}
    settings = Settings.model_construct(**defaults | given)
    settings.to_environment()
    assert Settings.from_environment() == settings


def test_every_wrong_variable_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, text in (("WORKERS", "-1"), ("MAX_BODY_MB", "many"), ("LOG_FORMAT", "xml"), ("BODY_SECONDS", "")):
        monkeypatch.setenv(f"CLUTCHLIFE_{name}", text)
    with pytest.raises(ValueError, match="CLUTCHLIFE_WORKERS must be a whole number of at least 0, got '-1'") as caught:
        Settings.from_environment()
    said = str(caught.value)
    assert "\n" not in said
    assert "CLUTCHLIFE_MAX_BODY_MB must be a whole number, got 'many'" in said
    assert "CLUTCHLIFE_LOG_FORMAT must be 'auto', 'json' or 'text', got 'xml'" in said
    assert "CLUTCHLIFE_BODY_SECONDS must be a whole number, got ''" in said


SLIPS = {
    "LOG_LEVLE": "LOG_LEVEL",
    "WORKER": "WORKERS",
    "LOGLEVEL": "LOG_LEVEL",
    "ENIGNE": "ENGINE",
    "MAX_BODY": "MAX_BODY_MB",
    "LEAST_FREE": "LEAST_FREE_MB",
    "MAX_FILES_MB": "MAX_FILE_MB",
}
#: Of the commands, and of an orchestrator that has a service called clutchlife.
NO_SLIPS = ("URL", "KEY", "KEY_FILE", "PORT", "SERVICE_HOST", "SERVICE_PORT", "PORT_8000_TCP", "PORT_8000_TCP_ADDR")


def test_a_misspelt_variable_is_told_from_others(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*SLIPS, *NO_SLIPS, "WORKERS"):
        monkeypatch.setenv(f"{PREFIX}{name}", "1")
    told = f"{PREFIX}{{}} is no setting and has no effect; is {PREFIX}{{}} meant?"
    assert list(Settings.misspelt()) == [told.format(*slip) for slip in sorted(SLIPS.items())]


@pytest.mark.parametrize(
    ("address", "shown"),
    [
        ("sqlite:///clutchlife.db", "sqlite:///clutchlife.db"),
        ("sqlite:////data/a:b@c.db", "sqlite:////data/a:b@c.db"),
        ("postgresql://rig:s3cr3t@host/db", "postgresql://rig:***@host/db"),
        ("postgresql://rig:s3/cr@3t@host/db", "postgresql://rig:***@host/db"),
        ("sqlite:///a.db?key=s3cr3t", "sqlite:///a.db?***"),
    ],
)
def test_passwords_are_not_shown(address: str, shown: str) -> None:
    assert redacted(address) == shown
    assert Settings(database=address).shown()["database"] == shown


def test_a_start_prints_the_settings_without_the_password() -> None:
    command = [sys.executable, "-m", "service.cli.main", "serve", "--port", "0"]
    command += ["--database", "postgresql://rig:s3cr3t@host/db"]
    environment = os.environ | {"CLUTCHLIFE_LOG_FORMAT": "json", "CLUTCHLIFE_WORKERS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 64
    line = json.loads(done.stderr.splitlines()[0])
    assert (line["message"], line["workers"], line["database"]) == ("settings", 1, "postgresql://rig:***@host/db")
    assert "s3cr3t" not in done.stdout + done.stderr


#: Each setting's variable, a text, the attribute and its value: renamed, a deployed limit would silently be off.
VARIABLES = {
    "CLUTCHLIFE_DATABASE": ("sqlite:///other.db", "database", "sqlite:///other.db"),
    "CLUTCHLIFE_ROOT_PATH": ("a/clutch/", "root_path", "/a/clutch"),
    "CLUTCHLIFE_WORKERS": ("0", "workers", 0),
    "CLUTCHLIFE_MAX_BODY_MB": ("3", "max_body_mb", 3),
    "CLUTCHLIFE_BODY_SECONDS": ("7", "body_seconds", 7),
    "CLUTCHLIFE_REQUESTS_PER_SECOND": ("8", "requests_per_second", 8),
    "CLUTCHLIFE_REQUESTS_AT_ONCE": ("9", "requests_at_once", 9),
    "CLUTCHLIFE_CONNECTIONS_AT_ONCE": ("9", "connections_at_once", 9),
    "CLUTCHLIFE_DIAGNOSIS_SECONDS": ("10", "diagnosis_seconds", 10),
    "CLUTCHLIFE_DIAGNOSIS_MEMORY_MB": ("11", "diagnosis_memory_mb", 11),
}


@pytest.mark.parametrize("name", VARIABLES)
def test_every_limit_is_set_by_its_variable_unless_it_is_given(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text, attribute, value = VARIABLES[name]
    assert getattr(Settings.from_environment(), attribute) != value
    monkeypatch.setenv(name, text)
    assert getattr(Settings.from_environment(), attribute) == value
    assert Settings.from_environment(database="sqlite:///own.db").database == "sqlite:///own.db"
