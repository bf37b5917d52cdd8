"""What every request asks, without a transaction: whether anything was committed, a clutch's revision, what a key grants."""

import json
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any


@dataclass(frozen=True, slots=True)
class GrantedKey:
    """What an active key grants: `clutches` None where it is bound to none, `expires_at` None where it does not expire."""

    key_id: str
    scope: str
    note: str
    clutches: frozenset[str] | None
    expires_at: str | None


@dataclass(frozen=True, slots=True)
class Question:
    """The clutch that a request is about and the hash of its key, None where it names none."""

    clutch_id: str | None = None
    secret_sha256: str | None = None


@dataclass(frozen=True, slots=True)
class Glance:
    """What was so at one moment.

    `version`: a number that changes with every commit, whichever process made it; compare it only with those of the same
    watch. Read before a query, it shows later whether the query would still give the same rows.
    `keys_are_needed`: whether a key was ever made; revoking the last one opens nothing.
    `key`: what the key grants, None where there is none with that hash or it was revoked; whether it has expired the caller
    looks at. `revision`: the clutch's, None where there is no such clutch.
    """

    version: int
    keys_are_needed: bool
    key: GrantedKey | None
    revision: int | None


class Watch(ABC):
    """Answers the questions; threads share it."""

    @abstractmethod
    def glances(self, questions: Sequence[Question]) -> list[Glance]:
        """What is so now, question by question, all at the same moment."""

    @abstractmethod
    async def look(self, question: Question) -> Glance:
        """What is so now, for one who asks from the event loop, which does not wait for another process meanwhile."""

    @abstractmethod
    def close(self) -> None:
        """Ask nothing any more."""

    def glance(self, clutch_id: str | None = None, secret_sha256: str | None = None) -> Glance:
        """What is so now, of one clutch and one key."""
        return self.glances([Question(clutch_id, secret_sha256)])[0]


@lru_cache(maxsize=256)
def granted(row: tuple[Any, ...]) -> GrantedKey:
    """What a row of a key grants: its id, scope, note, clutches (JSON) and end."""
    key_id, scope, note, clutches, expires_at = row
    return GrantedKey(key_id, scope, note, None if clutches is None else frozenset(json.loads(clutches)), expires_at)
