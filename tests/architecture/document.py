"""The parts of docs/explanation/architecture.md made from the code: the ways of the common errands, and the examples.

A part stands between `<!-- name -->` and `<!-- end -->`. `python -m tests.architecture` writes all of them again.
"""

import re
from collections.abc import Iterable

from tests.architecture import examples, rooms
from tests.architecture.source import CHAPTERS, ROOT, by_name, first_sentence

DOCUMENT = ROOT / "docs" / "explanation" / "architecture.md"
DIAGNOSIS = "models.diagnosis"


def way(paths: Iterable[str]) -> str:
    """A numbered list of files, each with the first sentence of its docstring."""
    modules = {module.shown: module for module in by_name().values()}
    return "\n".join(
        f"{number}. `{path}`: {first_sentence(modules[path].docstring)}" for number, path in enumerate(paths, start=1)
    )


def paths_of(body: str) -> list[str]:
    """The files of a list that `way` wrote."""
    return re.findall(r"^\d+\. `([^`]+)`", body, flags=re.MULTILINE)


def chapters() -> str:
    """The chapters of the diagnosis in reading order, each with its introduction's first sentence."""
    present = [by_name()[name] for chapter in CHAPTERS if (name := f"{DIAGNOSIS}.{chapter}") in by_name()]
    return "\n".join(
        f"{number}. `{(module.path.parent if module.is_package else module.path).relative_to(ROOT).as_posix()}`: "
        f"{first_sentence(module.docstring) or 'no introduction yet'}"
        for number, module in enumerate(present, start=1)
    )


def written() -> dict[str, str]:
    return {"chapters": chapters()} | {f"example-{name}": examples.shown(name) for name in examples.NAMES}


def measured() -> dict[str, str]:
    """The parts that are taken down from a running service."""
    errands = {
        "get": rooms.entered(rooms.get_life),
        "post": rooms.entered(rooms.post_run),
        "diagnosis": rooms.entered(rooms.diagnose, warm=False, jobs=True),
    }
    return {name: way(paths) for name, paths in errands.items()}
