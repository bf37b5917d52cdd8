"""`make figures`: the figures of the documentation, into docs/figures; those of measurements where the files are there."""

import sys
from pathlib import Path

from tests.figures import measured, simulated
from tests.real.loaders import FOLDER

FIGURES = Path(__file__).parents[2] / "docs" / "figures"


def main() -> int:
    """Write them all, or those that can be made."""
    made = {"loop-signs": simulated.signs, "loop-area-over-life": simulated.life}
    if FOLDER.is_dir():
        made |= {
            "measured-loops": measured.loops,
            "measured-transient": measured.transient,
            "measured-branches": measured.branches,
        }
    else:
        print(f"the real measurements are not at {FOLDER}: their figures stay as they are", file=sys.stderr)
    FIGURES.mkdir(exist_ok=True)
    for name, draw in made.items():
        path = FIGURES / f"{name}.svg"
        path.write_text(draw(), encoding="utf-8")
        print(f"{path.name}: {path.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
