"""The examples of docs/explanation/architecture.md are carried out: added to a copy of the product, they work end to end."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture import examples
from tests.architecture.source import ROOT


@pytest.mark.slow
@pytest.mark.parametrize("name", examples.NAMES)
def test_an_example_works_once_it_is_added(name: str, tmp_path: Path) -> None:
    """The negative control: without the edits, the same check fails."""
    examples.applied(name, tmp_path)
    assert run_check(name, tmp_path) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["filter", "file-format", "criterion"])
def test_the_check_fails_where_nothing_is_added(name: str) -> None:
    assert "Error" in run_check(name, ROOT)


def run_check(name: str, product: Path) -> str:
    """What the check of an example prints on a product, "" where it passes."""
    script = examples.folder_of(name) / "check.py"
    environment = os.environ | {"PYTHONPATH": f"{product}{os.pathsep}{ROOT}", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-P", str(script)], env=environment, cwd=product, capture_output=True, text=True, check=False
    )
    return "" if done.returncode == 0 else done.stderr or "failed without a word"
