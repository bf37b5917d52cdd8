"""docs/appendix/diagnosis.md holds exactly the tables that the catalogue gives."""

from pathlib import Path

import pytest

from tests.models.diagnosis.tables import catalogue_table, trials_table

DOCUMENT = (Path(__file__).parents[3] / "docs" / "appendix" / "diagnosis.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("mark", "table"), [("catalogue", catalogue_table), ("trials", trials_table)])
def test_the_document_holds_the_table(mark, table):
    _, _, rest = DOCUMENT.partition(f"<!-- {mark} -->\n\n")
    held, _, _ = rest.partition(f"\n\n<!-- /{mark} -->")
    assert held == table(), "run python -m tests.models.diagnosis.tables"
