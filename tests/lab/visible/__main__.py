"""`make visible`: what a report calls visible is hidden at twice that amplitude and must raise an alarm nine times in ten.

SEED=  another seed       COUNT=  so many hidden effects (200)       STORE=  a file of results, from which a run goes on
"""

import itertools
import os
import sys
from collections import Counter
from functools import partial

from tests.lab.measuring import Asked, Lines, number, shared, table
from tests.lab.visible.trial import SLUGS, Shown, shown


def report(results: list[Shown], left_out: list[str]) -> list[str]:
    seen = {f"`{slug}`": [each.seen for each in results if each.slug == slug] for slug in SLUGS}
    seen["all"] = [each.seen for each in results]
    rows = [(name, len(mine), *shared(sum(mine), len(mine))) for name, mine in seen.items() if mine]
    lines = table(("hidden at twice the stated amplitude", "effects", "raised an alarm", "95 % interval"), rows)
    return [*lines, "", f"Not tried: {', '.join(f'{slug} ({n})' for slug, n in Counter(left_out).items()) or 'none'}."]


def main() -> None:
    seed, count = Asked.here().seed, number("COUNT", 200)
    store = Lines(os.environ.get("STORE") or f"visible-{seed}.jsonl")
    results, left_out = list[Shown](), list[str]()
    for k, slug in enumerate(itertools.islice(itertools.cycle(SLUGS), 10 * count)):
        found = store.get(f"{k} {slug}", partial(shown, (seed, 7, k), slug))
        print(slug, found, file=sys.stderr, flush=True)
        if isinstance(found, str):
            left_out.append(slug)
        else:
            results.append(Shown(**found))
        if len(results) == count:
            break
    print(f"`make visible SEED={seed} COUNT={count}`\n")
    print("\n".join(report(results, left_out)))


if __name__ == "__main__":
    main()
