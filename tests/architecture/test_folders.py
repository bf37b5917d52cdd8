"""Imports stand at the top of a file, tests in the folder of their subject's name, and a folder holds what it says."""

import ast
import re
from collections import Counter
from pathlib import Path

from tests.architecture.source import PACKAGES, ROOT, by_name, none_of


def test_an_import_inside_a_function_says_why() -> None:
    functions = (
        (module, node)
        for module in by_name().values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    )
    wrong = {
        f"{module.shown}:{line.lineno}"
        for module, function in functions
        for line in ast.walk(function)
        if isinstance(line, ast.Import | ast.ImportFrom)
        and "#" not in "".join(module.text.splitlines()[line.lineno - 1 : line.end_lineno])
    }
    none_of(sorted(wrong), "imports inside a function without a reason on their line:")


def test_tests_stand_where_their_subject_stands() -> None:
    """tests/<folder>/test_x.py tests what is in <folder>; the dashboard is tested in a browser, by journeys."""
    tests = [path for package in PACKAGES for path in (ROOT / "tests" / package).rglob("test_*.py")]
    subjects = Counter(path.parent.relative_to(ROOT / "tests") for path in tests)
    none_of(
        [str(subject) for subject in subjects if not (ROOT / subject).is_dir()], "folders of tests without a subject:"
    )


def test_what_a_folder_says_it_holds_is_there() -> None:
    """Names in its docstring that end in .py, and those in backticks after "Open": modules and folders."""
    wrong = [
        f"{module.shown}: {name}"
        for module in by_name().values()
        if module.is_package
        for name in re.findall(r"[\w/]+\.py\b|`[a-z_/]+`", module.docstring.partition("Open ")[2])
        + re.findall(r"[\w/]+\.py\b", module.docstring.partition("Open ")[0])
        if not _is_there(module.path.parent, name.strip("`/").removesuffix(".py"))
    ]
    none_of(wrong, "names in folders' docstrings of what is not there:")


def _is_there(folder: Path, name: str) -> bool:
    """A module or a folder: from the root, or anywhere below the folder."""
    return (ROOT / f"{name}.py").is_file() or any(any(folder.rglob(f"{name}{end}")) for end in (".py", ""))
