"""`make adoption`: hide artefacts, adopt what the diagnosis offers, and hold remaining life against the truth.

SEED= other campaigns (1)    SIZE= small, full, or a share of the full table    PROCESSES= how many at once (1)
ONLY= trials whose names begin with these    ARGS="--scheduler WHERE" as in `make blind`
ARGS=--write puts the table into docs/appendix/diagnosis.md, ARGS=--list lists every trial, ARGS=--stored what is stored

Campaigns and results are stored in .adoption, a file each: the next run goes on where this one ended. After a change of
code remove .adoption/results.
"""

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from models.diagnosis.effects.catalogue import BY_SLUG
from models.prognosis.criteria import HORIZON
from service.work.executor import executor_of
from tests.adoption.trials import LOUD, STORE, Adopted, Trial, adopted, trials
from tests.blind.__main__ import run, scheduler
from tests.blind.lives import ARTEFACTS

SIZES = {"small": 0.1, "full": 1.0}
DOCUMENT = Path(__file__).parents[2] / "docs" / "appendix" / "diagnosis.md"
BEGIN, END = "<!-- adoption: begin -->", "<!-- adoption: end -->"
#: A median further from the truth than before by more than this share of life is worse [-].
WORSE = 0.02


def held(quantiles: dict[str, float | None], truth: float) -> bool:
    """Whether the 90 % interval of the end holds it."""
    low, high = (HORIZON if quantiles[q] is None else float(quantiles[q] or 0.0) for q in ("0.05", "0.95"))
    return low <= truth <= high


def off(quantiles: dict[str, float | None], truth: float) -> float:
    """How far the median is from the end, in lives."""
    median = quantiles["0.5"]
    return abs((HORIZON if median is None else median) - truth) / truth


def _estimated(one: Adopted) -> list[float]:
    return one.estimates[one.trial.slug]


def _share(of: Sequence[Adopted], what: Callable[[Adopted], bool]) -> str:
    count = sum(what(one) for one in of)
    return f"{100 * count / len(of):.0f} % ({count} of {len(of)})" if of else "–"


def nearer(one: Adopted) -> bool:
    return off(one.after, one.end) < off(one.before, one.end)


def worse(one: Adopted) -> bool:
    return off(one.after, one.end) > off(one.before, one.end) + WORSE


def worse_than_clean(one: Adopted) -> bool:
    """Further than before, and further than where the artefact was never there."""
    return worse(one) and off(one.after, one.end) > off(one.clean, one.end) + WORSE


def wrong_sign(one: Adopted) -> bool:
    return _estimated(one)[0] * one.size < 0


def size_held(one: Adopted) -> bool:
    low, high = _estimated(one)[2:]
    return low <= one.size <= high


def table(results: Sequence[Adopted]) -> list[str]:
    """A row an artefact and loudness, and all."""
    lines = [
        "| hidden | made | named right | offered of these | adopted | end held before | end held after | nothing hidden | "
        "nearer | further by 2 % of life | than nothing hidden too | wrong sign | size held |",
        "|---" * 13 + "|",
    ]
    rows = [(f"`{slug}`, λ = {lam:.0f}", slug, lam) for slug in ARTEFACTS for lam in LOUD]
    for title, slug, lam in [*rows, ("all", None, None)]:
        mine = [one for one in results if one.made and slug in {one.trial.slug, None} and lam in {one.trial.lam, None}]
        right = [one for one in mine if one.named_right]
        offered = [one for one in mine if one.adoptable]
        ours = [one for one in offered if one.trial.slug in one.estimates and one.trial.slug in one.causes]
        cells = [
            str(len(mine)),
            str(len(right)),
            _share(right, lambda one: one.adoptable),
            str(len(offered)),
            _share(offered, lambda one: held(one.before, one.end)),
            _share(offered, lambda one: held(one.after, one.end)),
            _share(offered, lambda one: held(one.clean, one.end)),
            _share(offered, nearer),
            _share(offered, worse),
            _share(offered, worse_than_clean),
            str(sum(wrong_sign(one) for one in ours)),
            _share(right, size_held),
        ]
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return lines


def meaning(results: Sequence[Adopted], command: str) -> list[str]:
    """What the table shows."""
    commits = sorted({one.commit for one in results})
    unmade = sum(not one.made for one in results)
    wanted = (
        "Wanted: after adoption the 90 % interval of the end holds it in 85 to 95 %; the median is nearer to the truth than "
        "before in 90 % and further by 2 % of life in 3 % at most; no wrong sign of the named size among those offered; its "
        "90 % interval holds what was hidden in 85 to 95 %; offered in 80 % of those named right at λ = 300, of each "
        "artefact in half. *Nothing hidden* is the same interval of the same runs with the same noise and no artefact in "
        "them: adoption cannot do better than that, and where that is further from the truth than before, before was luck."
    )
    return [
        f"`{command}`, at {', '.join(commits)}; {unmade} of {len(results)} campaigns could not be made.",
        "",
        wanted,
        "",
    ]


def listed(one: Adopted) -> str:
    """A line a trial."""
    if not one.made:
        return f"{one.trial.name:44s} unreachable"
    estimate = one.estimates.get(one.trial.slug)
    unit = BY_SLUG[one.trial.slug].unit
    size = "–" if estimate is None else "{:+.3f} ± {:.3f} [{:+.3f}, {:+.3f}]".format(*estimate)
    ends = [
        " ".join("never" if forecast[q] is None else f"{forecast[q]:,.0f}" for q in ("0.05", "0.5", "0.95"))
        for forecast in (one.before, one.after, one.clean)
    ]
    signs = f"{'offered' if one.adoptable else 'no offer':9s}{'held' if held(one.after, one.end) else 'MISSED':7s}"
    signs += "nearer " if nearer(one) else "FURTHER" if worse(one) else "as far "
    return (
        f"{one.trial.name:44s} {one.verdict:20s} {signs} hidden {one.size:+.3f} {unit}: {size}; end {one.end:,.0f}: "
        f"{ends[0]} | {ends[1]} | clean {ends[2]}; {','.join(one.causes)}; {one.seconds:.0f} s; {one.reason}"
    )


def write(lines: Sequence[str]) -> None:
    """Between the markers of docs/appendix/diagnosis.md."""
    text = DOCUMENT.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    DOCUMENT.write_text(f"{before}{BEGIN}\n\n" + "\n".join(lines) + f"\n\n{END}{rest.split(END)[1]}", encoding="utf-8")


def main() -> None:
    """Print the table."""
    seed, chosen_size = int(os.environ.get("SEED") or 1), os.environ.get("SIZE") or "small"
    only = tuple((os.environ.get("ONLY") or "").split(","))
    size = SIZES[chosen_size] if chosen_size in SIZES else float(chosen_size)
    chosen: list[Trial] = [trial for trial in trials(seed, size) if trial.name.startswith(only)]
    if "--stored" in sys.argv:
        chosen = [trial for trial in chosen if (STORE / "results" / f"{trial.name}.json").exists()]
    with executor_of(scheduler(sys.argv) or f"processes:{os.environ.get('PROCESSES') or '1'}") as executor:
        results = run(adopted, chosen, executor)
    if "--list" in sys.argv:
        print("\n".join(listed(one) for one in results))
    lines = [*meaning(results, f"make adoption SEED={seed} SIZE={chosen_size}"), *table(results)]
    print("\n".join(lines))
    print(f"median {np.median([one.seconds for one in results if one.made] or [0.0]):.1f} s a campaign")
    if "--write" in sys.argv:
        write(lines)


if __name__ == "__main__":
    main()
