"""The harness of both tables: so many campaigns of each kind, asked one by one, kept in STORE, a row a kind."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Protocol, TypeVar

from tests.lab.law.worlds import FORMULAS, measured
from tests.lab.measuring import Asked, Lines, each, publish, table, where


class OfCampaign(Protocol):
    """What came of a campaign, by its kind and seed; a dataclass."""

    @property
    def kind(self) -> str: ...
    @property
    def seed(self) -> int: ...


Found = TypeVar("Found", bound=OfCampaign)


def tabulate(
    part: str,
    kinds: Mapping[str, int],
    ask: Callable[[tuple[str, int]], Found],
    again: Callable[..., Found],
    titles: Sequence[str],
    row: Callable[[str, Sequence[Found]], Sequence[str]],
) -> None:
    """Publish `make PART` with a row of each of the `kinds` that are asked for; `again` makes what was found of its stored
    fields."""
    asked, store, rows = Asked.here(), Lines(os.environ.get("STORE") or None), list[Sequence[str]]()
    for kind, count in kinds.items():
        if not kind.startswith(asked.only) or (kind not in FORMULAS and measured() is None):
            continue
        seeds = [asked.seed * 1000 + k for k in range(max(1, round(count * asked.size)))]
        left = [(kind, seed) for seed in seeds if f"{kind} {seed}" not in store.known]
        for found in each(ask, left, where(2)):
            store.get(f"{kind} {found.seed}", partial(asdict, found))
        rows.append(row(kind, [again(**store.known[f"{kind} {seed}"]) for seed in seeds]))
    publish("diagnosis.md", part, [f"`make {part} {asked}`:", "", *table(titles, rows)])
