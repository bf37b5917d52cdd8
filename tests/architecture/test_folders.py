"""A folder is a chapter: an introduction, and tests in the folder of the same name."""

import re
from collections import Counter

import pytest

from tests.architecture.source import PACKAGES, ROOT, modules, none_of

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
    """No re-exports, no code: a name has one place. The client's are public: scripts import them from the package."""
    folder_modules = [
        module
        for module in modules()
        if module.is_package and module.name.split(".")[0] == package and module.name != "service.client.clutchlife"
    ]
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


def test_tests_stand_where_their_subject_stands() -> None:
    """tests/<folder>/test_x.py tests what is in <folder>; the dashboard is tested in a browser, by journeys."""
    tests = [path for package in PACKAGES for path in (ROOT / "tests" / package).rglob("test_*.py")]
    subjects = Counter(path.parent.relative_to(ROOT / "tests") for path in tests)
    none_of(
        [str(subject) for subject in subjects if not (ROOT / subject).is_dir()], "folders of tests without a subject:"
    )
