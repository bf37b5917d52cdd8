"""docs/paper.md names, for each part of the paper, files that are there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROWS = [line for line in (ROOT / "docs" / "paper.md").read_text().splitlines() if line.startswith("| ")][1:]


@pytest.mark.parametrize("row", ROWS)
def test_what_stands_in_the_table_is_there(row: str) -> None:
    what, files, address, section, test = (cell.strip() for cell in row.strip("|").split(" | "))
    if files == "**not built**":
        assert (address, section, test) == ("-", "-", "-")
        return
    named = re.findall(r"`([^`]+)`", f"{files} {test}")
    assert len(named) >= 2, what
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_all_equations_and_figures_are_in_it() -> None:
    first = " ".join(row.split(" | ")[0] for row in ROWS)
    equations = {
        int(number) for part in re.findall(r"eq\. ([\d, ]+)", first) for number in part.split(",") if number.strip()
    }
    assert equations == set(range(1, 9))
    figures = {int(number) for part in re.findall(r"figs?\. ([\d, ab]+)", first) for number in re.findall(r"\d+", part)}
    assert figures == set(range(1, 18))
