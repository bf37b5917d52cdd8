"""The life that an answer is about: the present one, or an earlier one by its number, whole or as it was at some cycles."""

from dataclasses import dataclass
from typing import Any

from service.columns import whole
from service.errors import NotFoundError
from service.lives.assumptions import Assumptions
from service.lives.history import Life, lives_of
from service.lives.recomputation import ClutchState


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenLife:
    """A life (None: there was none yet), what it is tracked under, its number from 1 on and how many lives there are."""

    life: Life | None
    assumptions: Assumptions
    number: int
    of: int

    def item(self) -> dict[str, Any]:
        """As answers name it."""
        return {
            "number": self.number,
            "of": self.of,
            "from_cycles": None if self.life is None else whole(self.life.origin),
            "rebuild": None if self.life is None else self.life.name or None,
        }


def chosen_life(state: ClutchState, number: int | None = None, at_cycles: float | None = None) -> ChosenLife:
    """Life `number` of a clutch (None: the one that lasts at `at_cycles`, or at present), up to `at_cycles`.

    Each life is tracked under what was adopted for it. Raises NotFoundError where there is no such life.
    """
    lives = state.lives
    if number is not None and not 1 <= number <= len(lives):
        raise NotFoundError(f"the clutch has {len(lives)} lives, there is no life {number}")
    until = lives if at_cycles is None else lives_of([event for event in state.events if event.cycles <= at_cycles])
    index = len(until) if number is None else number
    if not 1 <= index <= len(until):
        return ChosenLife(life=None, assumptions=state.assumptions(), number=max(index, 1), of=len(lives))
    life = until[index - 1]
    adopted = next((a for a in state.adoptions if a is not None and a.life == lives[index - 1].name), None)
    under = state.extension if index == len(lives) else None if adopted is None else adopted.extension
    return ChosenLife(
        life=life, assumptions=state.assumptions_under(under, lives[index - 1]), number=index, of=len(lives)
    )
