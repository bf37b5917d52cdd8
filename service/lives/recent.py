"""What a list shows of a clutch's latest past: its last run, and mean COF as a short line."""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from service.lives.history import Event, Series
from service.schemas.base import whole

#: A line in a list has room for no more points.
MOST_POINTS = 32


def recent(events: Sequence[Event], series: Series) -> dict[str, Any]:
    """The run that was made last, and mean COF [-] of the present life, thinned evenly, its last value kept.

    `events` is not empty; `series` is mean COF over the reference pressures, ordered by cycles.
    """
    last = max(events, key=lambda event: event.moment)
    values = [each.value for each in series.measurements]
    step = -(-len(values) // MOST_POINTS)  # rounded up
    return {
        "last_run": {
            "run_id": last.run_id,
            "kind": last.kind,
            "cycles": whole(last.cycles),
            "at": datetime.fromtimestamp(last.moment, UTC).isoformat(timespec="seconds"),
        },
        "mean_cof": [round(value, 6) for value in values[::-1][:: step or 1]][::-1],
    }
