"""`make visible`: what a report calls visible is hidden at twice that amplitude and must raise an alarm nine times in ten.

SEED=  another seed       COUNT=  so many hidden effects (200)       STORE=  a file of results, from which a run goes on
"""

import json
import os
import sys
from pathlib import Path

from tests.blind.rows import wilson
from tests.visible.trial import SLUGS, Shown, shown


def report(results: list[Shown], left_out: dict[str, int]) -> list[str]:
    """The table, effect by effect."""
    lines = [
        "| hidden at twice the stated amplitude | effects | raised an alarm | 95 % interval |",
        "|---|---|---|---|",
    ]
    for slug in (*SLUGS, ""):
        mine = [each for each in results if slug in {"", each.slug}]
        if mine:
            hits = sum(each.seen for each in mine)
            low, high = wilson(hits, len(mine))
            name = f"`{slug}`" if slug else "all"
            lines.append(f"| {name} | {len(mine)} | {hits / len(mine):.0%} | {low:.0%} to {high:.0%} |")
    lines += ["", f"Not tried: {', '.join(f'{why} ({count})' for why, count in left_out.items()) or 'none'}."]
    return lines


def main() -> None:
    """Hide, print what was seen; results are kept as lines of JSON."""
    seed, count = int(os.environ.get("SEED") or 1), int(os.environ.get("COUNT") or 200)
    store = Path(os.environ.get("STORE") or f"visible-{seed}.jsonl")
    known = [json.loads(line) for line in store.read_text().splitlines()] if store.exists() else []
    k = len(known)
    while sum("seen" in line for line in known) < count and k < 10 * count:
        slug = SLUGS[k % len(SLUGS)]
        found = shown((seed, 7, k), slug)
        line = {"slug": slug, "not": found} if isinstance(found, str) else {**vars(found), "seed": list(found.seed)}
        known.append(line)
        with store.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(line, file=sys.stderr, flush=True)
        k += 1
    results = [Shown(**line) for line in known if "seen" in line]
    left_out: dict[str, int] = {}
    for line in known:
        if "not" in line:
            left_out[line["slug"]] = left_out.get(line["slug"], 0) + 1
    print(f"`make visible SEED={seed} COUNT={count}`\n")
    print("\n".join(report(results, left_out)))


if __name__ == "__main__":
    main()
