"""`make visible`: what a report calls visible is hidden at twice that amplitude and must raise an alarm nine times in ten.

SEED=  another seed       COUNT=  so many hidden effects (200)       STORE=  a file of results, from which a run goes on
"""

import os
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.blind.rows import wilson
from tests.measuring import Asked, Lines, table
from tests.visible.trial import SLUGS, Shown, shown


def report(results: list[Shown], left_out: list[str]) -> list[str]:
    """The table, effect by effect."""
    rows = []
    for slug in (*SLUGS, ""):
        mine = [each for each in results if slug in {"", each.slug}]
        if mine:
            hits = sum(each.seen for each in mine)
            low, high = wilson(hits, len(mine))
            rows.append(
                (f"`{slug}`" if slug else "all", len(mine), f"{hits / len(mine):.0%}", f"{low:.0%} to {high:.0%}")
            )
    lines = table(("hidden at twice the stated amplitude", "effects", "raised an alarm", "95 % interval"), rows)
    return [*lines, "", f"Not tried: {', '.join(f'{slug} ({n})' for slug, n in Counter(left_out).items()) or 'none'}."]


def main() -> None:
    """Hide, print what was seen; results are kept as lines of JSON."""
    asked, count = Asked.here(), int(os.environ.get("COUNT") or 200)
    store = Lines(Path(os.environ.get("STORE") or f"visible-{asked.seed}.jsonl"))
    results, left_out = list[Shown](), list[str]()
    for k in range(10 * count):
        slug = SLUGS[k % len(SLUGS)]
        found = store.get(f"{k} {slug}", lambda k=k, slug=slug: _noted(shown((asked.seed, 7, k), slug)))  # type: ignore[misc]
        print(slug, found, file=sys.stderr, flush=True)
        if isinstance(found, str):
            left_out.append(slug)
        else:
            results.append(Shown(**found))
        if len(results) == count:
            break
    print(f"`make visible SEED={asked.seed} COUNT={count}`\n")
    print("\n".join(report(results, left_out)))


def _noted(found: Shown | str) -> dict[str, Any] | str:
    return found if isinstance(found, str) else asdict(found)


if __name__ == "__main__":
    main()
