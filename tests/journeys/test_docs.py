"""What the documents show is run: the API's examples against a service, the commands they name against the command line."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import ONCE, Server

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


def blocks(path: Path, language: str) -> list[str]:
    """The fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def test_the_examples_of_the_api_run(server: Server) -> None:
    script = "\n".join(["set -eu", *blocks(ROOT / "docs" / "api.md", "sh")])
    done = subprocess.run(
        ["bash", "-c", script], env=os.environ | {"URL": server.url}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr + done.stdout[-2000:]
    assert '"duplicate":false' in done.stdout
    assert '"status":"insufficient_data"' in done.stdout


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_that_are_named_are_there(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    commands = set(
        re.findall(r"\bclutchlife ((?:key )?[a-z]+)\b", "\n".join(blocks(path, "console") + blocks(path, "sh")))
    )
    for command in commands - {"clutchlife"}:
        called = [sys.executable, "-m", "service.cli.main", *command.split(), "--help"]
        done = subprocess.run(called, capture_output=True, text=True, check=False)
        assert done.returncode == 0, command
    targets = set(re.findall(r"(?:`|^)make ([a-z]+)\b", text, flags=re.MULTILINE))
    rules = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert targets <= rules
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (path.parent / link).exists(), link


def test_every_address_is_documented(server: Server) -> None:
    described = ONCE.get(f"{server.url}/openapi.json").json()
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8") + (ROOT / "docs" / "operations.md").read_text(
        encoding="utf-8"
    )
    for address in described["paths"]:
        name = address.rstrip("/").rsplit("/", 1)[-1].removesuffix(".csv")
        assert name.startswith("{") or name in text, address
