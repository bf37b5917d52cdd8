"""What filterpy declares for its plots, and no part of the product imports, is installed for the tests alone."""

import hashlib
import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture.source import ROOT

LOCKS = sorted(
    [
        *(ROOT / "docker").glob("requirements*.txt"),
        *(ROOT / "docs").glob("*.txt"),
        *(ROOT / "tests").glob("requirements-*.txt"),
    ]
)
UNUSED = ("matplotlib", "contourpy", "cycler", "fonttools", "kiwisolver", "pillow")


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_no_lock_installs_what_draws_plots(lock: Path) -> None:
    lines = lock.read_text(encoding="utf-8").splitlines()
    assert any("==" in line for line in lines), "nothing is locked"
    assert [line for line in lines if line.startswith(tuple(f"{name}==" for name in UNUSED))] == []


def test_the_oldest_releases_were_tried() -> None:
    """`make lowest` notes which lock it has passed on; another asks for another run of it."""
    tried = (ROOT / "tests" / "lowest.tried").read_text(encoding="utf-8").split()[0]
    lock = (ROOT / "tests" / "requirements-lowest.txt").read_bytes()
    assert tried == hashlib.sha256(lock).hexdigest(), "run make lowest"


def test_the_unscented_filter_is_imported_without_them() -> None:
    blocked = (
        f"import sys; sys.modules.update(dict.fromkeys({UNUSED!r} + ('PIL',))); import models.tracking.filters.ukf"
    )
    subprocess.run([sys.executable, "-c", blocked], cwd=ROOT, check=True)
