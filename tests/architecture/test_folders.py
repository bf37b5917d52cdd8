"""A folder is a chapter: few files, an introduction, and tests in the folder of the same name."""

import re
from collections import Counter
from pathlib import Path

import pytest

from tests.architecture.source import PACKAGES, ROOT, Module, modules, none_of

MOST_MODULES = 14
MOST_LINES = 300
#: One file an effect: these two grow with what is known of clutches.
CATALOGUES = ("models/diagnosis/effects/catalogued", "models/diagnosis/effects/uncatalogued")

#: An introduction says what goes in, what comes out, and which file of the folder to open first, as in "In: arrays. Out:
#: bytes. Open `codec.py` first." or "Arrays go in, bytes come out: `codec` first, then the others."
GOES_IN = re.compile(r"\bin:|\bgo(?:es)?\s+in\b|\bin\s+go(?:es)?\b|\bin,.*\bout\b", flags=re.IGNORECASE | re.DOTALL)
COMES_OUT = re.compile(r"\bout:|\bcomes?\s+out\b|\bout\s+comes?\b|\bin,.*\bout\b", flags=re.IGNORECASE | re.DOTALL)
OPEN_FIRST = re.compile(
    r"\bOpen\s+`?([\w/]+)"
    r"|`([\w/]+)(?:\.py)?`(?:\s+\([^)]*\))?\s+first\b"
    r"|\breading order:\s+`([\w/]+)",
)
SENTENCE = re.compile(r"[.!?](?:\s|$)")


def folders(*places: str) -> list[Path]:
    """All folders below those places that hold Python modules or scripts."""
    files = [path for place in places for suffix in ("py", "js") for path in (ROOT / place).rglob(f"*.{suffix}")]
    return sorted({path.parent for path in files if "node_modules" not in path.parts})


def test_a_folder_holds_few_modules() -> None:
    wrong = []
    for folder in folders(*PACKAGES, "tests"):
        shown = folder.relative_to(ROOT).as_posix()
        names = [path.name for path in folder.iterdir() if path.suffix in {".py", ".js"} and path.name != "__init__.py"]
        if len(names) > MOST_MODULES and shown not in CATALOGUES:
            wrong.append(f"{shown}: {len(names)} modules, at most {MOST_MODULES}")
    none_of(wrong, "folders with too many modules:")


def lacks(introduction: str, files: set[str]) -> list[str]:
    """What the docstring of a folder with those files lacks, in words; empty where it lacks nothing."""
    opened = OPEN_FIRST.search(introduction)
    first = "" if opened is None else next(filter(None, opened.groups())).split("/")[0]
    lacking = [
        (len(SENTENCE.findall(introduction)) >= 2, "two sentences"),
        (GOES_IN.search(introduction) is not None, '"In: ..."'),
        (COMES_OUT.search(introduction) is not None, '"Out: ..."'),
        (opened is not None, '"Open `file.py` first"'),
        (opened is None or first in files, f"the file {first!r} that it names"),
    ]
    return [description for holds, description in lacking if not holds]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_folder_introduces_itself(package: str) -> None:
    wrong = []
    for module in modules():
        if module.is_package and module.name.split(".")[0] == package:
            files = {path.stem for path in module.path.parent.iterdir()} - {"__init__"}
            wrong += [f"{module.shown} lacks {description}" for description in lacks(module.docstring, files)]
    none_of(wrong, "things lacking in introductions:")


@pytest.mark.parametrize("package", PACKAGES)
def test_an_introduction_is_all_that_a_folder_says(package: str) -> None:
    """No re-exports, no code: a name has one place."""
    folder_modules = [module for module in modules() if module.is_package and module.name.split(".")[0] == package]
    none_of([module.shown for module in folder_modules if len(module.tree.body) > 1], "introductions that hold code:")


def test_what_an_introduction_lacks_is_noticed() -> None:
    files = {"codec", "engine"}
    whole = "Bytes and arrays.\n\nIn: arrays. Out: bytes. Open `codec.py` first, then the others."
    assert lacks(whole, files) == []
    assert lacks("Arrays go in; bytes come out. Open codec.py first: it is short.", files) == []
    assert lacks("Bytes: `codec` first.\n\nIn go arrays (any); out come bytes.", files) == []
    assert lacks("Arrays in, bytes out. In reading order: `codec` (bytes), `engine`.", files) == []
    assert lacks("Bytes and arrays.\n\nIn: arrays. Out: bytes. Open `other.py` first.", files) == [
        "the file 'other' that it names"
    ]
    assert len(lacks("", files)) == 4


def too_long(module: Module) -> bool:
    """Whether a module is more than a reader holds in mind."""
    return module.text.count("\n") >= MOST_LINES


def test_a_module_is_short() -> None:
    long = [f"{module.shown}: {module.text.count(chr(10))} lines" for module in modules() if too_long(module)]
    scripts = [path for package in PACKAGES for path in (ROOT / package).rglob("*.js")]
    long += [
        str(path.relative_to(ROOT)) for path in scripts if path.read_text(encoding="utf-8").count("\n") >= MOST_LINES
    ]
    none_of(long, f"files that are not under {MOST_LINES} lines:")


def test_tests_stand_where_their_subject_stands() -> None:
    """tests/<folder>/test_x.py tests what is in <folder>; the dashboard is tested in a browser, by journeys."""
    tests = [path for package in PACKAGES for path in (ROOT / "tests" / package).rglob("test_*.py")]
    subjects = Counter(path.parent.relative_to(ROOT / "tests") for path in tests)
    none_of(
        [str(subject) for subject in subjects if not (ROOT / subject).is_dir()], "folders of tests without a subject:"
    )
