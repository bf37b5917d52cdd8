"""Imports stand at the top of a file, and tests in the folder of their subject's name."""

import ast
from collections import Counter

from tests.architecture.source import PACKAGES, ROOT, modules, none_of


def test_an_import_inside_a_function_says_why() -> None:
    functions = (
        (module, node)
        for module in modules()
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
