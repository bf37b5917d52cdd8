"""Lives with all that was measured in them, out of the rows: curves, loops and engagements."""

import itertools
from typing import Any

from sqlalchemy import Connection

from service import records
from service.columns import whole
from service.lives.engagements.evaluation import DUTY_KINDS
from service.lives.engagements.over_life import engagements_over_life, stored_engagement
from service.lives.history import lives_of
from service.lives.quantities.chosen_life import ChosenLife
from service.lives.quantities.measured import MeasuredLife
from service.lives.recomputation import ClutchState
from storage import runs


def measured_life(connection: Connection, state: ClutchState, chosen: ChosenLife) -> MeasuredLife | None:
    """A life of a clutch with all that was measured in it, None where nothing was yet."""
    if chosen.life is None:
        return None
    return MeasuredLife(
        clutch_id=state.clutch_id,
        life=chosen.life,
        assumptions=chosen.assumptions,
        geometry=state.geometry,
        fraction=state.fraction,
        levels=records.levels(connection, state.clutch_id),
        receipts=records.receipts(connection, state.clutch_id),
        engagements=engagements(connection, state.clutch_id),
    )


def engagements(connection: Connection, clutch_id: str) -> list[dict[str, Any]]:
    """The accepted engagements of a clutch with all indicators, by life and cycles."""
    rows = [row for kind in DUTY_KINDS for row in runs.page(connection, clutch_id, kind=kind, state=runs.ACCEPTED)]
    stored = [stored_engagement(row.receipt | {"cycles": whole(row.cycles)}, row.details) for row in rows]
    measured = [engagement for engagement in stored if engagement is not None]
    if not measured:
        return []
    names = [[event.run_id for event in life.events] for life in lives_of(records.events(connection, clutch_id))]
    places = {run_id: place for place, run_id in enumerate(itertools.chain.from_iterable(names))}
    return engagements_over_life(sorted(measured, key=lambda engagement: places[engagement.run_id]), names)
