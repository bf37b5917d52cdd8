"""Imports stand at the top of a file, and go one way. An independent witness of what import-linter holds."""

import tomllib

from tests.architecture.source import CHAPTERS, ROOT, Module, imports, imports_of, none_of

DIAGNOSIS = "models.diagnosis"


def test_an_import_inside_a_function_says_why() -> None:
    wrong = sorted(
        {
            f"{statement.shown}:{statement.line}: {statement.imported}"
            for statement in imports()
            if statement.in_function and not statement.for_types and len(statement.reason.split()) < 2
        }
    )
    none_of(wrong, "imports inside a function without a reason on their line:")


def test_import_linter_holds_the_same_order() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    (contract,) = [
        entry for entry in settings["contracts"] if entry["name"] == "the chapters of the diagnosis in order"
    ]
    layers = [layer.strip("()").strip().removeprefix(f"{DIAGNOSIS}.") for layer in contract["layers"]]
    assert layers == list(reversed(CHAPTERS))


def test_imports_are_read_wherever_they_stand() -> None:
    """The negative control: a module made up of every kind of import."""
    module = Module("service.made_up", ROOT / "service" / "made_up.py")
    module.__dict__["text"] = (
        "import numpy as np\n"
        "from storage import runs, tables\n"
        "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n"
        "    from storage.engine.database import Database\n"
        "def f() -> None:\n"
        "    import plotly  # noqa: PLC0415\n"
        "    from storage.engine.sqlite import backup  # most starts make no copy\n"
        "    from . import settings\n"
    )
    read = {statement.imported: statement for statement in imports_of(module)}
    assert set(read) == {
        "numpy",
        "storage.runs",
        "storage.tables",
        "typing",
        "storage.engine.database",
        "plotly",
        "storage.engine.sqlite.backup",
        "service.settings",
    }
    assert [statement.imported for statement in read.values() if statement.in_function] == [
        "plotly",
        "storage.engine.sqlite.backup",
        "service.settings",
    ]
    assert [statement.imported for statement in read.values() if statement.for_types] == ["storage.engine.database"]
    assert read["plotly"].reason == ""
    assert read["storage.engine.sqlite.backup"].reason == "most starts make no copy"
