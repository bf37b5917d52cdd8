"""`make gallery`: the figures of docs/gallery.md, by its own lines from a simulated clutch, into docs/figures/gallery."""

import tempfile
from functools import partial
from pathlib import Path
from typing import Any

from service.cli.main import app
from tests.lab.measuring import ROOT, blocks
from tests.support import serving

PAGE = ROOT / "docs" / "gallery.md"
FIGURES = ROOT / "docs" / "figures" / "gallery"


def draw(url: str, folder: Path) -> list[Path]:
    """Every figure from the clutch sim-7 of a service, by a block of Python each after one that all need; the same clutch
    gives the same bytes."""
    import matplotlib as mpl  # 0.4 s for whoever draws, not for every collection

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "clutchlife"
    (_, preamble), *figures = blocks(PAGE, "python")
    names: dict[str, Any] = {"URL": url}
    exec(compile(preamble, "the first block", "exec"), names)  # noqa: S102  (the page's own lines)
    drawn = []
    for number, (_, block) in enumerate(figures, start=1):
        exec(compile(block, f"figure {number}", "exec"), names)  # noqa: S102
        path = folder / f"{number}.svg"
        names["fig"].savefig(path, metadata={"Date": None})
        names["plt"].close(names["fig"])
        drawn.append(path)
    names["rig"].close()
    return drawn


def simulated(url: str, folder: Path) -> None:
    """Simulate the clutch of the page and send it."""
    campaign = str(folder / "campaign")
    options = ["--seed", "7", "--tests", "6", "--frequency", "0.1", "--film"]
    called = partial(app, standalone_mode=False)
    called(["simulate", *options, "--out", campaign])
    called(["push", campaign, "--clutch", "sim-7", "--url", url, "--spool", str(folder / "spool")])


def main() -> None:
    FIGURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder) / "gallery.db") as server:
        simulated(server.url, Path(folder))
        for path in draw(server.url, FIGURES):
            print(path.relative_to(ROOT), path.stat().st_size)


if __name__ == "__main__":
    main()
