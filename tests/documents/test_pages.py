"""The tutorial and the how-to pages, done: their shell blocks run in order against one service, their Python too; and the
figures of the gallery, drawn by the lines that stand above them."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documents import gallery
from tests.lab.measuring import ROOT, blocks
from tests.support import serving

DOCS = ROOT / "docs"
#: The tutorial first: later pages go on with its clutches. An end comes last.
PAGES = (
    "tutorial/first-life.md",
    "how-to/send-files.md",
    "how-to/read-remaining-life.md",
    "how-to/be-called.md",
    "how-to/rehearse-a-diagnosis.md",
    "how-to/mend-a-run.md",
    "how-to/run-a-fleet.md",
    "how-to/back-up.md",
    "how-to/declare-an-end.md",
)
#: Blocks that are read, not run: what must be installed first, or answers of the service.
READ_ONLY = {"console", "json", "matlab", "nginx", "caddy", "text"}


def test_every_page_of_both_rooms_is_run_or_has_nothing_to_run() -> None:
    """Scripts have a test of their own: tests/journeys/test_scripts.py."""
    for room in ("tutorial", "how-to"):
        for path in (DOCS / room).glob("*.md"):
            name = path.relative_to(DOCS).as_posix()
            if name not in (*PAGES, "how-to/scripts.md"):
                assert {language for language, _ in blocks(path)} <= READ_ONLY, name


@pytest.mark.slow
def test_the_tutorial_and_the_tasks_run(tmp_path: Path) -> None:
    (tmp_path / "clutchlife").write_text(
        f'#!/bin/sh\nexec {sys.executable} -m service.cli.main "$@"\n', encoding="utf-8"
    )
    (tmp_path / "clutchlife").chmod(0o755)
    database = tmp_path / "pages.db"
    with serving(database) as server:
        surroundings = os.environ | {
            "PATH": f"{tmp_path}:{os.environ['PATH']}",
            "PYTHONPATH": f"{ROOT}:{ROOT / 'service' / 'client'}",
            "CLUTCHLIFE_URL": server.url,
            "DATABASE": f"sqlite:///{database}",
        }
        said = {}
        for name in PAGES:
            found = blocks(DOCS / name)
            assert found, name
            assert {language for language, _ in found} <= READ_ONLY | {"sh", "python"}, name
            shell = "\n".join(["set -eu", *(text for language, text in found if language == "sh")])
            python = "\n".join([f"URL = {server.url!r}", *(text for language, text in found if language == "python")])
            outputs = [
                subprocess.run(command, env=surroundings, cwd=tmp_path, capture_output=True, text=True, check=False)
                for command in (["bash", "-c", shell], [sys.executable, "-c", python])
            ]
            for done in outputs:
                assert done.returncode == 0, f"{name}:\n{done.stdout[-1500:]}\n{done.stderr[-1500:]}"
            said[name] = outputs[0].stdout + outputs[1].stdout
    tutorial = said["tutorial/first-life.md"]
    assert "more cycles (95 %)" in tutorial
    assert "Cause named: oil temperature" in tutorial
    assert "extended (oil_temperature)" in tutorial
    assert '"order a set"' in tutorial


def test_a_figure_stands_below_each_block() -> None:
    shown = re.findall(r"\(figures/gallery/(\d+)\.svg\)", gallery.PAGE.read_text(encoding="utf-8"))
    assert shown == [str(number) for number in range(1, len(blocks(gallery.PAGE, "python")))]
    assert all((gallery.FIGURES / f"{number}.svg").is_file() for number in shown)


@pytest.mark.slow
def test_the_figures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(gallery.ROOT / "service" / "client")
    with serving(tmp_path / "gallery.db") as server:
        gallery.simulated(server.url, tmp_path)
        drawn = gallery.draw(server.url, tmp_path)
    assert len(drawn) == len(blocks(gallery.PAGE, "python")) - 1
    assert min(path.stat().st_size for path in drawn) > 10_000, "each has axes and lines"
