"""docs/appendix/diagnosis.md holds exactly the tables that the catalogue gives."""

from tests.measuring import APPENDIX, parts
from tests.models.diagnosis.tables import TABLES


def test_the_document_holds_the_tables() -> None:
    held = parts((APPENDIX / "diagnosis.md").read_text(encoding="utf-8"))
    for name, make in TABLES.items():
        assert held[name] == make(), "run python -m tests.models.diagnosis.tables"
