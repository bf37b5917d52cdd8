"""What the list holds: an alternative is a set of catalogued causes, and at most one thing beside them that has no name."""

from typing import NamedTuple

from models.diagnosis.design.axes import CLOCK, CYCLES, FREQUENCY
from models.diagnosis.effects.faults import FAULT_BY_SLUG
from models.diagnosis.raw_records.evidence import FIXED_LINE

#: A line over the tests' clock; lines, with the axes on which they lie. One run that is not like the others.
LINE = "line"
LINES = {LINE: CLOCK, FIXED_LINE: FREQUENCY}
OUTLIER = "outlying run"
_AXES = {**LINES, OUTLIER: CYCLES}


class Alternative(NamedTuple):
    """The causes, by slug in order, and what is unknown beside them: an axis of structure (`design.axes`), the slug of an
    uncatalogued fault, a line, an outlying run, or nothing (empty)."""

    causes: tuple[str, ...] = ()
    unknown: str = ""

    def and_effect(self, slug: str) -> "Alternative | None":
        """With one thing more, a cause or an uncatalogued fault; None where that is not on the list."""
        if len(self.causes) > 1 or self.unknown or slug in self.causes:
            return None
        if slug in FAULT_BY_SLUG:
            return Alternative(self.causes, slug)
        return Alternative(tuple(sorted((*self.causes, slug))))

    def without(self, slug: str) -> "Alternative":
        """With one thing less."""
        return Alternative(tuple(c for c in self.causes if c != slug), "" if self.unknown == slug else self.unknown)


NOTHING = Alternative()


def is_axis(unknown: str) -> bool:
    """Whether what is unknown is smooth structure on an axis."""
    return bool(axis_of(unknown)) and axis_of(unknown) == unknown


def axis_of(unknown: str) -> str:
    """The axis on which something unknown lies; of nothing unknown none (empty)."""
    if unknown in FAULT_BY_SLUG:
        return FAULT_BY_SLUG[unknown].axis
    return _AXES.get(unknown, unknown)
