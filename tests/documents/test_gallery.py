"""Every figure of the gallery is drawn by the lines that stand above it."""

import re
from pathlib import Path

import pytest

from tests.documents import gallery
from tests.support import serving


def test_a_figure_stands_below_each_block() -> None:
    shown = re.findall(r"\(figures/gallery/(\d+)\.svg\)", gallery.PAGE.read_text(encoding="utf-8"))
    figures = gallery.blocks()[1:]
    assert shown == [str(number) for number in range(1, 13)]
    assert len(figures) == 12
    assert all((gallery.FIGURES / f"{number}.svg").is_file() for number in shown)
    assert max(len(block.splitlines()) for block in figures) <= 10


@pytest.mark.slow
def test_the_figures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(gallery.ROOT / "service" / "client")
    with serving(tmp_path / "gallery.db") as server:
        gallery.simulated(server.url, tmp_path)
        drawn = gallery.draw(server.url, tmp_path)
    assert len(drawn) == 12
    assert min(path.stat().st_size for path in drawn) > 10_000, "each has axes and lines"
