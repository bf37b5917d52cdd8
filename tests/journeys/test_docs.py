"""The documents against the project: examples run, and commands, paths, addresses and settings that they name exist."""

import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tests.lab.measuring import ROOT, blocks
from tests.support import Server

DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])


@pytest.mark.slow
def test_the_examples_of_the_api_run(server: Server) -> None:
    script = "\n".join(["set -eu", *(text for _, text in blocks(ROOT / "docs" / "reference" / "api.md", "sh"))])
    done = subprocess.run(
        ["bash", "-c", script], env=os.environ | {"URL": server.url}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr + done.stdout[-2000:]
    assert '"duplicate":false' in done.stdout
    assert '"status":"insufficient_data"' in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_commands_that_are_named_are_there(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    shown = "\n".join(text for _, text in blocks(path, "console", "sh"))
    commands = set(re.findall(r"\bclutchlife ((?:key )?[a-z]+)\b", shown))
    for command in commands - {"clutchlife"}:
        called = [sys.executable, "-m", "service.cli.main", *command.split(), "--help"]
        done = subprocess.run(called, capture_output=True, text=True, check=False)
        assert done.returncode == 0, command
    targets = set(re.findall(r"(?:`|^)make ([a-z]+)\b", text, flags=re.MULTILINE))
    rules = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert targets <= rules
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (path.parent / link).exists(), link


PATH = re.compile(r"(?<![\w/.])((?:models|service|storage|tests|docker|docs)/[\w./-]*\w)")
MODULE = re.compile(r"\bpython -m ((?:models|service|tests)[\w.]*)")


def own_words(path: Path) -> str:
    """A document without architecture.md's examples, which name files that they add; another test carries them out."""
    return re.sub(r"<!-- example-[a-z-]+ -->.*?<!-- end -->", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)


#: `name.py` or `folder/name.py` in backticks, from wherever the page is at home.
SHORT = re.compile(r"`((?:[\w-]+/)*\w+\.py)`")


@cache
def ends() -> set[str]:
    """The ends of the paths of all Python files: `decide.py`, `explanations/decide.py`."""
    folders = ("docs", "models", "service", "storage", "tests")
    files = [path.relative_to(ROOT).parts for folder in folders for path in (ROOT / folder).rglob("*.py")]
    return {"/".join(parts[-n:]) for parts in files for n in range(1, len(parts) + 1)}


@pytest.mark.parametrize("path", [*DOCUMENTS, ROOT / "CHANGELOG.md"], ids=lambda path: str(path.relative_to(ROOT)))
def test_paths_exist(path: Path) -> None:
    """Every file, folder and module that a document names, from the top of the repository or by the end of its path."""
    text = own_words(path)
    assert [name for name in PATH.findall(text) if not (ROOT / name).exists()] == []
    modules = [name.replace(".", "/") for name in MODULE.findall(text)]
    assert [name for name in modules if not ((ROOT / name).is_dir() or (ROOT / f"{name}.py").is_file())] == []
    assert missing(text) == []


def missing(text: str) -> list[str]:
    """The Python files that a text names in backticks and that are nowhere."""
    return [name for name in SHORT.findall(text) if name not in ends()]


def test_a_file_that_is_gone_is_noticed() -> None:
    assert missing("`decide.py` and `explanations/decide.py`, `models/diagnosis/explanations/decide.py`") == []
    assert missing("`repeats.py`, `detection/decide.py`, `cide.py`") == ["repeats.py", "detection/decide.py", "cide.py"]


OF_THE_PAPER = [line for line in (ROOT / "docs" / "paper.md").read_text().splitlines() if line.startswith("| ")][1:]


@pytest.mark.parametrize("row", OF_THE_PAPER)
def test_what_stands_in_the_table_is_there(row: str) -> None:
    what, files, address, section, test = (cell.strip() for cell in row.strip("|").split(" | "))
    if files == "**not built**":
        assert (address, section, test) == ("-", "-", "-")
        return
    named = re.findall(r"`([^`]+)`", f"{files} {test}")
    assert len(named) >= 2, what
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_all_equations_and_figures_are_in_it() -> None:
    first = " ".join(row.split(" | ")[0] for row in OF_THE_PAPER)
    equations = {
        int(number) for part in re.findall(r"eq\. ([\d, ]+)", first) for number in part.split(",") if number.strip()
    }
    assert equations == set(range(1, 9))
    figures = {int(number) for part in re.findall(r"figs?\. ([\d, ab]+)", first) for number in re.findall(r"\d+", part)}
    assert figures == set(range(1, 18))
