"""docs/appendix/diagnosis.md holds exactly the tables that the catalogue gives."""

from pathlib import Path

import pytest

from models.diagnosis.effects.catalogue import CATALOGUE
from models.diagnosis.experiments.candidates import TRIALS
from tests.models.diagnosis.tables import catalogue_table, trials_table

DOCUMENT = (Path(__file__).parents[3] / "docs" / "appendix" / "diagnosis.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("mark", "table"), [("catalogue", catalogue_table), ("trials", trials_table)])
def test_the_document_holds_the_table(mark, table):
    _, _, rest = DOCUMENT.partition(f"<!-- {mark} -->\n\n")
    held, _, _ = rest.partition(f"\n\n<!-- /{mark} -->")
    assert held == table(), "run python -m tests.models.diagnosis.tables"


def test_the_tables_are_whole():
    lines = catalogue_table().splitlines()
    assert len(lines) == 2 + len(CATALOGUE) == 19
    for effect, line in zip(CATALOGUE, lines[2:], strict=True):
        assert line.startswith(f"| `{effect.slug}` |")
        cells = line.replace("\\|", "").strip("| ").split(" | ")
        assert len(cells) == 6
        assert all(cell.strip() for cell in cells)
    assert len(trials_table().splitlines()) == 2 + sum(bool(trial.text) for trial in TRIALS.values())
