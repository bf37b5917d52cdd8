"""Answers that take long to compute, kept where several services share a database: each is computed once for all of them."""

from abc import ABC, abstractmethod
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedAnswer:
    """The answer of that name about a clutch, computed by that build of a release from that revision of the clutch."""

    clutch_id: str
    name: str
    release: str
    revision: int
    body: bytes


class SharedAnswers(ABC):
    """The last answer of each name about each clutch; threads share it."""

    @abstractmethod
    def newest(self, clutch_id: str, name: str, release: str) -> SharedAnswer | None:
        """The last one that a service of that build computed, None where there is none."""

    @abstractmethod
    def keep(self, answer: SharedAnswer) -> None:
        """Keep an answer, unless one of a later revision is kept."""
