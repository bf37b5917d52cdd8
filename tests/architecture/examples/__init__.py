"""Examples of what is added most often, each the size of a commit, carried out by a test on a copy of the product.

A folder holds `edits.toml` (the new files, what is appended, and the lines that change), the new files' text, and
`check.py`, which runs against the copy and fails where the addition does not work.
"""

import shutil
import tomllib
from pathlib import Path
from typing import Any

from tests.architecture.source import PACKAGES, ROOT

FOLDER = Path(__file__).parent
NAMES = ("effect", "filter", "file-format", "criterion")


def folder_of(name: str) -> Path:
    """The folder of an example."""
    return FOLDER / name.replace("-", "_")


def edits_of(name: str) -> dict[str, Any]:
    """The new files (`new`: path in the product -> file of the example) and the edits of an example."""
    return tomllib.loads((folder_of(name) / "edits.toml").read_text(encoding="utf-8"))


def applied(name: str, target: Path) -> None:
    """Copy the product to `target` and add the example. Raises ValueError where a line that an edit names has changed."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, target / package, ignore=shutil.ignore_patterns("__pycache__"))
    edits = edits_of(name)
    for path, source in edits.get("new", {}).items():
        (target / path).write_text((folder_of(name) / source).read_text(encoding="utf-8"), encoding="utf-8")
    for addition in edits.get("append", ()):
        with (target / addition["file"]).open("a", encoding="utf-8") as file:
            file.write(addition["new"])
    for edit in edits["edit"]:
        path = target / edit["file"]
        text = path.read_text(encoding="utf-8")
        if text.count(edit["old"]) != 1:
            raise ValueError(f"{edit['file']} must hold {edit['old']!r} once, got {text.count(edit['old'])} times")
        path.write_text(text.replace(edit["old"], edit["new"].removeprefix("\n")), encoding="utf-8")


def shown(name: str) -> str:
    """An example as the document shows it: the new files whole, the edits as removed and added lines."""
    edits = edits_of(name)
    parts: list[str] = []
    for path, source in edits.get("new", {}).items():
        text = (folder_of(name) / source).read_text(encoding="utf-8").strip("\n")
        parts.append(f"New file `{path}`:\n\n```python\n{text}\n```")
    for addition in edits.get("append", ()):
        added = addition["new"].strip("\n")
        parts.append(f"At the end of `{addition['file']}`:\n\n```python\n{added}\n```")
    for edit in edits["edit"]:
        new = edit["new"].removeprefix("\n")
        kept = new.startswith(edit["old"])
        lines = [f"  {line}" if kept else f"- {line}" for line in edit["old"].strip("\n").splitlines()]
        added = new.removeprefix(edit["old"]) if kept else new
        lines += [f"+ {line}" for line in added.strip("\n").splitlines()]
        parts.append(f"In `{edit['file']}`:\n\n```diff\n" + "\n".join(lines) + "\n```")
    return "\n\n".join(parts)
