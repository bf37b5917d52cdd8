"""The newest finished diagnosis of each clutch of a list, in short: its verdict, its causes, whether it is adopted."""

from collections.abc import Sequence
from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, bindparam, select

from storage.diagnoses import FINISHED
from storage.dialects import json_fields
from storage.encoding.json_text import Json, to_object
from storage.tables import adopted_model, diagnosis


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictRow:
    """A finished diagnosis' verdict, causes and advised tests, the best first; `adoptable` where it has an extended model,
    `adopted` where the model adopted last came from it.

    `life` is the run_id of the rebuild with which the diagnosed life began, "" for the first life.
    """

    diagnosis_id: str
    life: str
    verdict: str | None
    causes: tuple[str, ...]
    advice: tuple[Json, ...]
    adoptable: bool
    adopted: bool


_later = diagnosis.alias("later")
_newest = (
    select(sa.func.max(_later.c.diagnosis_key))
    .where(_later.c.clutch_id == diagnosis.c.clutch_id, _later.c.status == FINISHED)
    .scalar_subquery()
)
_in_force = (
    select(adopted_model.c.diagnosis_id)
    .where(adopted_model.c.clutch_id == diagnosis.c.clutch_id)
    .order_by(adopted_model.c.version.desc())
    .limit(1)
    .scalar_subquery()
)
_short = json_fields(diagnosis.c.report, "verdict", "causes", "advice")
_verdicts = select(
    diagnosis.c.clutch_id,
    diagnosis.c.diagnosis_id,
    diagnosis.c.life,
    _short.label("short"),
    diagnosis.c.extension.is_not(None).label("adoptable"),
    (_in_force == diagnosis.c.diagnosis_id).label("adopted"),
).where(diagnosis.c.clutch_id.in_(bindparam("wanted", expanding=True)), diagnosis.c.diagnosis_key == _newest)


def newest(connection: Connection, clutch_ids: Sequence[str]) -> dict[str, VerdictRow]:
    """clutch_id -> its newest finished diagnosis, where it has one."""
    verdicts: dict[str, VerdictRow] = {}
    for clutch_id, diagnosis_id, life, short, adoptable, adopted in connection.execute(
        _verdicts, {"wanted": list(clutch_ids)}
    ):
        summary = to_object(short)
        verdicts[clutch_id] = VerdictRow(
            diagnosis_id=diagnosis_id,
            life=life,
            verdict=summary["verdict"],
            causes=tuple(summary["causes"] or ()),
            advice=tuple(summary["advice"] or ()),
            adoptable=bool(adoptable),
            adopted=bool(adopted),
        )
    return verdicts
