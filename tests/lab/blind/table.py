"""The table as Markdown: counts, Wilson's intervals, targets."""

import statistics
from collections import Counter
from collections.abc import Sequence

from tests.lab.blind.rig.hide import DRAWS
from tests.lab.blind.rig.makers import CATALOGUED, OUTSIDE
from tests.lab.blind.rows import HALVED, LOUDNESSES, calibration, counts
from tests.lab.blind.trials import Outcome
from tests.lab.measuring import table, wilson


def _share(hits: int, count: int) -> str:
    low, high = wilson(hits, count)
    return f"{hits}/{count} = {100 * hits / count:.1f} % [{100 * low:.0f}, {100 * high:.0f}]" if count else "–"


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """What the targets are about, line by line."""
    rows = []
    for line in counts():
        hits, count = line.of(outcomes)
        if count:
            mark = {True: "met", False: "missed", None: ""}[line.holds(hits, count)]
            rows.append((line.title, _share(hits, count), line.target, mark))
    return table(("what", "found, with 95 % interval", "target", ""), rows)


def _of(outcomes: Sequence[Outcome], row: str) -> list[Outcome]:
    return [one for one in outcomes if one.trial.row == row]


def _sum(outcomes: Sequence[Outcome], what: str) -> int:
    return sum(getattr(one, what) for one in outcomes)


def by_effect(outcomes: Sequence[Outcome]) -> list[str]:
    """Each of the seventeen by itself, at λ = 20 and 6 states."""
    rows = []
    for slug in CATALOGUED:
        if mine := _of(outcomes, f"one/{slug}"):
            seen = [one for one in mine if one.detected]
            counted = [(mine, "detected"), (seen, "in_set"), (seen, "top")]
            counted += [(mine, what) for what in ("right", "wrong", "unexplained")]
            rows.append((f"`{slug}`", len(mine), *(f"{_sum(some, what)}/{len(some)}" for some, what in counted)))
    titles = "campaigns", "detected", "truth in set", "top candidate", "named", "named and wrong", "unexplained"
    return table(("effect, λ = 20", *titles), rows)


def by_loudness(outcomes: Sequence[Outcome]) -> list[str]:
    """The same at every loudness: named rightly, and named wrongly, of how many."""
    rows = []
    for slug in CATALOGUED:
        each = [_of(outcomes, f"loud/{lam:.0f}/{slug}") for lam in LOUDNESSES]
        if any(each):
            cells = (f"{_sum(mine, 'right')}, {_sum(mine, 'wrong')} of {len(mine)}" for mine in each)
            rows.append((f"`{slug}`", *cells))
    return table(("effect", *(f"λ = {lam:.0f}: named rightly, wrongly" for lam in LOUDNESSES)), rows)


def outside(outcomes: Sequence[Outcome]) -> list[str]:
    """Each effect from outside the catalogue by itself."""
    rows = []
    for slug in OUTSIDE:
        if mine := _of(outcomes, f"outside/{slug}"):
            axis = _sum([one for one in mine if one.unexplained], "right_axis")
            counted = (_sum(mine, "detected"), _sum(mine, "unexplained"), axis, _sum(mine, "named"))
            rows.append((slug.replace("_", " "), len(mine), *counted))
    titles = "campaigns", "detected", "`unexplained_structure`", "right axis first", "named"
    return table(("outside the catalogue", *titles), rows)


def reliability(outcomes: Sequence[Outcome]) -> list[str]:
    """Of the candidates given a probability, how many were true."""
    rows = ((label, _share(hits, count)) for label, hits, count in calibration(outcomes) if count)
    return table(("probability given", "true, with 95 % interval"), rows)


#: Beyond noise, an error before that is below this share of the whole error is none that could be halved.
LEAST_EXCESS = 0.05


def beyond(one: Outcome) -> float | None:
    """Held-out error after over before, sensor noise and the scatter of gains taken off both in squares.

    None where there was next to nothing beyond them before.
    """
    gain = one.gain
    if gain is None or gain.excess_before < LEAST_EXCESS * gain.rmse_before:
        return None
    return gain.excess_after / gain.excess_before


def gains(outcomes: Sequence[Outcome]) -> list[str]:
    """Held-out error after over before, where an extension is proposed, effect by effect: as measured, and beyond noise."""
    cases = [(f"`{slug}`, λ = 20", f"one/{slug}", False) for slug in CATALOGUED]
    cases += [(f"`{slug}`, λ = 50, 12 states", f"twelve/{slug}", False) for slug in CATALOGUED]
    cases += [(f"`{slug}`, λ = 60", f"gain/{slug}", True) for slug in HALVED]
    rows = []
    for title, row, halved in cases:
        mine = [one for one in _of(outcomes, row) if one.gain]
        ratio = [one.gain.rmse_after / one.gain.rmse_before for one in mine if one.gain]
        if ratio:
            middle, left = statistics.median(ratio), [found for one in mine if (found := beyond(one)) is not None]
            rest = statistics.median(left) if left else None
            cells = (len(ratio), f"{middle:.3f}", f"{max(ratio):.3f}", "≤ 1.02", _mark(middle <= 1.02))
            target = ("≤ 0.5", _mark(rest is not None and rest <= 0.5)) if halved else ("", "")
            rows.append((title, *cells, "–" if rest is None else f"{rest:.2f} of {len(left)}", *target))
    titles = "campaigns", "median", "worst", "target", "", "median beyond noise", "target", ""
    return table(("held-out error after/before", *titles), rows)


def of_gains() -> list[str]:
    """What the columns of `gains` mean."""
    return [
        "Held-out error is the RMSE in states and pressures that were left out. Most of it is the sensor's noise and the "
        "gain that each run has of its own, which no model predicts; *beyond noise* both are taken off in squares, as the "
        "report estimates them, and the target of a half is about what is left. It is of the campaigns in which more "
        f"than {100 * LEAST_EXCESS:.0f} % of the error before was beyond noise."
    ]


def unmade(outcomes: Sequence[Outcome]) -> list[str]:
    """Of the trials those that could not be made, by what was to be hidden."""
    without = Counter((one.trial.slugs, one.trial.lam) for one in outcomes if not one.made)
    if not without:
        return [f"All {len(outcomes)} trials could be made."]
    named = ", ".join(
        f"{' and '.join(f'`{slug}`' for slug in slugs)} at λ = {lam:.0f} ({count})"
        for (slugs, lam), count in sorted(without.items())
    )
    return [
        f"{without.total()} of {len(outcomes)} trials could not be made and count nowhere: no sensible amplitude leaves "
        f"so much after a refit of the baseline in any of {DRAWS} campaigns drawn: {named}."
    ]


def _mark(met: bool) -> str:
    return "met" if met else "missed"


def speed(outcomes: Sequence[Outcome]) -> list[str]:
    """How long a verdict took in these trials."""
    taken = sorted(one.seconds for one in outcomes)
    if not taken:
        return []
    return [
        f"A verdict took {statistics.median(taken):.2f} s in the median, {taken[-1]:.2f} s at most, on this machine."
    ]


def failures(outcomes: Sequence[Outcome], most: int = 60) -> list[str]:
    """How to make again what went wrong: crashes, wrong names, false alarms, the truth not in the set, what was missed."""
    lines = []
    for one in outcomes:
        reasons = {
            f"crashed: {one.error[:120]}": one.verdict == "crashed",
            "named and wrong": one.wrong,
            "false alarm": not one.truth and one.verdict != "model_adequate",
            "truth not in set": one.trial.row.startswith("one/") and one.detected and not one.in_set,
            "missed": one.made and bool(one.truth) and not one.detected and one.trial.lam >= 20,
        }
        reason = next((reason for reason, holds in reasons.items() if holds), "")
        if reason:
            candidates = ", ".join(f"{slug} {share:.2f}" for slug, share in one.candidates[:3])
            lines.append(f"{reason:16} {one.trial}  -> {one.verdict} {sorted(one.causes)} [{candidates}]")
    return sorted(lines)[:most]
