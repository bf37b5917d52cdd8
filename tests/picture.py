"""`make picture`: what `make demo` prints, as the picture in the README."""

import re
import subprocess
import sys
from pathlib import Path

from rich.console import Console

PICTURE = Path(__file__).parents[1] / "docs" / "figures" / "demo.svg"


def main() -> None:
    """Run the demo and draw what it printed."""
    command = [sys.executable, "-m", "service.cli.main", "demo", "--exit"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    text = re.sub(r"its database in \S+", "its database in a temporary folder", done.stdout.replace("\r", ""))
    console = Console(record=True, width=84, file=sys.stderr, highlight=False)
    console.print(text.strip("\n"), markup=False)
    drawn = console.export_svg(title="make demo")
    # a picture that asks no other host for its font
    PICTURE.write_text(re.sub(r"@font-face \{.*?\}\s*", "", drawn, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    main()
