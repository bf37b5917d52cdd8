"""A folder is a chapter: an introduction, and tests in the folder of the same name."""

import re
from collections import Counter

import pytest

from tests.architecture.source import PACKAGES, ROOT, modules, none_of

#: An introduction says which file of the folder to open first.
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


def test_tests_stand_where_their_subject_stands() -> None:
    """tests/<folder>/test_x.py tests what is in <folder>; the dashboard is tested in a browser, by journeys."""
    tests = [path for package in PACKAGES for path in (ROOT / "tests" / package).rglob("test_*.py")]
    subjects = Counter(path.parent.relative_to(ROOT / "tests") for path in tests)
    none_of(
        [str(subject) for subject in subjects if not (ROOT / subject).is_dir()], "folders of tests without a subject:"
    )
