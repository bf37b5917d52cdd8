"""The tree of the pages' files reads as chapters: imports that lead to a file, and one way only."""

import re
from pathlib import PurePosixPath

import pytest

from service.dashboard import assets

#: In reading order: a chapter imports itself and chapters before it; the two pages know nothing of each other.
CHAPTERS = (
    "shared",
    "charts",
    "quantities",
    "sending",
    "alarms",
    "diagnosis",
    "engagements",
    "inspections",
    "clutch",
    "fleet",
    "compare",
)
TEXTS = {name: asset.body.decode() for name, asset in assets.load(assets.STATIC).by_name.items() if "/" in name}
MODULES = {name: text for name, text in TEXTS.items() if name.endswith(".js")}


def imported(name: str) -> list[str]:
    """The modules that a module imports, by their names in the tree."""
    paths = re.findall(r'^(?:import|export)\b[^;]*?from "([^"]+)";', MODULES[name], re.MULTILINE)
    assert all(path.startswith(("./", "../")) for path in paths), "only relative imports are found below a content hash"
    return [resolved(name, path) for path in paths]


def resolved(name: str, path: str) -> str:
    """A relative path, seen from a module, as a name in the tree."""
    parts: list[str] = list(PurePosixPath(name).parent.parts)
    for part in PurePosixPath(path).parts:
        if part == "..":
            parts.pop()
        elif part != ".":
            parts.append(part)
    return "/".join(parts)


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_is_checked(name: str) -> None:
    assert MODULES[name].splitlines()[0] == "// @ts-check"


@pytest.mark.parametrize("name", sorted(MODULES))
def test_imports_lead_to_modules_and_never_to_a_later_chapter(name: str) -> None:
    own = CHAPTERS.index(name.split("/")[0])
    for target in imported(name):
        assert target in MODULES
        assert CHAPTERS.index(target.split("/")[0]) <= own
        assert not (name.startswith("fleet/") and target.startswith("clutch/"))


def test_no_module_imports_itself_by_a_circle() -> None:
    done: set[str] = set()

    def walk(name: str, way: tuple[str, ...]) -> None:
        assert name not in way, " -> ".join((*way, name))
        if name not in done:
            for target in imported(name):
                walk(target, (*way, name))
            done.add(name)

    for name in MODULES:
        walk(name, ())


def test_every_module_is_loaded_by_a_page() -> None:
    loaded = assets.load(assets.STATIC)
    html = [asset.body.decode() for name, asset in loaded.by_name.items() if name.endswith(".html")]
    named = {name for text in html for name in re.findall(r'"\{assets\}/([^"]+)"', text)}
    assert named <= set(loaded.by_name)
    reached, waiting = set[str](), [name for name in named if name in MODULES]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += imported(name)
    assert reached == set(MODULES)
