"""What every request asks, without a transaction: whether anything was committed, a clutch's revision, a key's scope."""

import json
from abc import ABC, abstractmethod
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


class Watch(ABC):
    """The questions; threads share it."""

    @abstractmethod
    def version(self) -> int:
        """A number that changes with every commit, whichever process made it. Compare it only within this object.

        Read before a query, it shows later whether the query would still give the same rows.
        """

    @abstractmethod
    def revision(self, clutch_id: str) -> int | None:
        """The clutch's revision, or None."""

    @abstractmethod
    def key(self, secret_sha256: str) -> GrantedKey | None:
        """What the key with this hash grants; None where there is none or it was revoked. Whether it has expired the caller
        looks at."""

    @abstractmethod
    def keys_are_needed(self) -> bool:
        """Whether a key was ever made: revoking the last one opens nothing."""


@lru_cache(maxsize=256)
def granted(row: tuple[Any, ...]) -> GrantedKey:
    """What a row of a key grants: its id, scope, note, clutches (JSON) and end."""
    key_id, scope, note, clutches, expires_at = row
    return GrantedKey(key_id, scope, note, None if clutches is None else frozenset(json.loads(clutches)), expires_at)
