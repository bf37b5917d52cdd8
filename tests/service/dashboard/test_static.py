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
#: The file of each chapter to open first; it says what the chapter is in three lines.
FIRST = {
    "shared": "api.js",
    "charts": "chart.js",
    "quantities": "criteria.js",
    "sending": "sending.js",
    "alarms": "alarms.js",
    "diagnosis": "diagnosis.js",
    "engagements": "engagements.js",
    "inspections": "inspections.js",
    "clutch": "clutch.js",
    "fleet": "fleet.js",
    "compare": "compare.js",
}
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


def test_every_folder_is_a_chapter() -> None:
    counts = {chapter: sum(name.startswith(f"{chapter}/") for name in MODULES) for chapter in CHAPTERS}
    assert sum(counts.values()) == len(MODULES)
    assert min(counts.values()) > 0


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_the_first_file_of_a_chapter_says_what_it_is(chapter: str) -> None:
    lines = MODULES[f"{chapter}/{FIRST[chapter]}"].splitlines()
    assert lines[0] == "// @ts-check"
    head = [line for line in lines[1:4] if line.startswith("// ")]
    assert len(head) == 3
    assert lines[4] == ""


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
