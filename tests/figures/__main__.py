"""`make figures`: the figures of the documentation, into docs/figures; those of measurements where the files are there."""

import sys

from tests.figures import measured, simulated
from tests.measuring import ROOT
from tests.real.loaders import FOLDER


def main() -> None:
    made = {"loop-signs": simulated.signs, "loop-area-over-life": simulated.life}
    if FOLDER.is_dir():
        made |= {
            "measured-loops": measured.loops,
            "measured-transient": measured.transient,
            "measured-branches": measured.branches,
        }
    else:
        print(f"the real measurements are not at {FOLDER}: their figures stay as they are", file=sys.stderr)
    for name, draw in made.items():
        path = ROOT / "docs" / "figures" / f"{name}.svg"
        path.write_text(draw(), encoding="utf-8")
        print(f"{path.name}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
