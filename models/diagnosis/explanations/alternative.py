"""What the list holds: an alternative is a set of catalogued causes, and at most one thing beside them that has no name."""

from typing import NamedTuple

from models.diagnosis.design.axes import CLOCK, FREQUENCY
from models.diagnosis.detection.raw_records.evidence import FIXED_LINE
from models.diagnosis.effects.faults import FAULT_BY_SLUG

#: A line over the tests' clock; lines, with the axes on which they lie.
LINE = "line"
LINES = {LINE: CLOCK, FIXED_LINE: FREQUENCY}
#: Begins the name of a neighbour: something of an effect's kind that no effect of the catalogue is.
_LIKE = "like "


class Alternative(NamedTuple):
    """The causes, by slug in order, and what is unknown beside them: an axis of structure (`design.axes`), the slug of an
    uncatalogued fault, a line, a neighbour of an effect, or nothing (empty)."""

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


def neighbour_of(slug: str) -> Alternative:
    """Something like an effect that is not in the catalogue."""
    return Alternative((), f"{_LIKE}{slug}")


def is_axis(unknown: str) -> bool:
    """Whether what is unknown is smooth structure on an axis."""
    return bool(axis_of(unknown)) and axis_of(unknown) == unknown


def axis_of(unknown: str) -> str:
    """The axis on which something unknown lies; a neighbour of an effect lies on none (empty)."""
    if unknown in FAULT_BY_SLUG:
        return FAULT_BY_SLUG[unknown].axis
    return LINES.get(unknown, "" if unknown.startswith(_LIKE) else unknown)
