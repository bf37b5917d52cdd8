"""The table as Markdown: counts, Wilson's intervals, targets."""

import statistics
from collections import Counter
from collections.abc import Sequence

from tests.blind.rig.hide import DRAWS
from tests.blind.rig.makers import CATALOGUED, OUTSIDE
from tests.blind.rows import HALVED, LOUDNESSES, calibration, counts
from tests.blind.trials import Outcome
from tests.measuring import wilson


def _share(hits: int, count: int) -> str:
    low, high = wilson(hits, count)
    return f"{hits}/{count} = {100 * hits / count:.1f} % [{100 * low:.0f}, {100 * high:.0f}]" if count else "–"


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """What the targets are about, line by line."""
    lines = ["| what | found, with 95 % interval | target | |", "|---|---|---|---|"]
    for line in counts():
        hits, count = line.of(outcomes)
        if count:
            mark = {True: "met", False: "missed", None: ""}[line.holds(hits, count)]
            lines.append(f"| {line.title} | {_share(hits, count)} | {line.target} | {mark} |")
    return lines


def by_effect(outcomes: Sequence[Outcome], row: str = "one") -> list[str]:
    """Each of the seventeen by itself, at λ = 20 and 6 states."""
    lines = [
        "| effect, λ = 20 | campaigns | detected | truth in set | top candidate | named | named and wrong | unexplained |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for slug in CATALOGUED:
        mine = [one for one in outcomes if one.trial.row == f"{row}/{slug}"]
        seen = [one for one in mine if one.detected]
        if mine:
            cells = (
                f"{sum(one.detected for one in mine)}/{len(mine)}",
                f"{sum(one.in_set for one in seen)}/{len(seen)}",
                f"{sum(one.top for one in seen)}/{len(seen)}",
                f"{sum(one.named and one.causes == one.truth for one in mine)}/{len(mine)}",
                f"{sum(one.wrong for one in mine)}/{len(mine)}",
                f"{sum(one.verdict == 'unexplained_structure' for one in mine)}/{len(mine)}",
            )
            lines.append(f"| `{slug}` | {len(mine)} | " + " | ".join(cells) + " |")
    return lines


def by_loudness(outcomes: Sequence[Outcome]) -> list[str]:
    """The same at every loudness: named rightly, and named wrongly, of how many."""
    titles = [f"λ = {lam:.0f}: named rightly, wrongly" for lam in LOUDNESSES]
    lines = ["| effect | " + " | ".join(titles) + " |", "|---|" + len(titles) * "---|"]
    for slug in CATALOGUED:
        cells = []
        for lam in LOUDNESSES:
            mine = [one for one in outcomes if one.trial.row == f"loud/{lam:.0f}/{slug}"]
            right = sum(one.named and one.causes == one.truth for one in mine)
            cells.append(f"{right}, {sum(one.wrong for one in mine)} of {len(mine)}" if mine else "–")
        lines += [f"| `{slug}` | " + " | ".join(cells) + " |"] if set(cells) != {"–"} else []
    return lines


def outside(outcomes: Sequence[Outcome]) -> list[str]:
    """Each effect from outside the catalogue by itself."""
    lines = [
        "| outside the catalogue | campaigns | detected | `unexplained_structure` | right axis first | named |",
        "|---|---|---|---|---|---|",
    ]
    for slug in OUTSIDE:
        mine = [one for one in outcomes if one.trial.row == f"outside/{slug}"]
        if mine:
            open_ = [one for one in mine if one.verdict == "unexplained_structure"]
            right = sum(bool(one.where) and one.where[0] in one.axes for one in open_)
            cells = f"{sum(o.detected for o in mine)} | {len(open_)} | {right} | {sum(o.named for o in mine)}"
            lines.append(f"| {slug.replace('_', ' ')} | {len(mine)} | {cells} |")
    return lines


def reliability(outcomes: Sequence[Outcome]) -> list[str]:
    """Of the candidates given a probability, how many were true."""
    lines = ["| probability given | true, with 95 % interval |", "|---|---|"]
    return lines + [f"| {label} | {_share(hits, count)} |" for label, hits, count in calibration(outcomes) if count]


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
    lines = [
        "| held-out error after/before | campaigns | median | worst | target | | median beyond noise | target | |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    rows = [(f"`{slug}`, λ = 20", f"one/{slug}", False) for slug in CATALOGUED]
    rows += [(f"`{slug}`, λ = 50, 12 states", f"twelve/{slug}", False) for slug in CATALOGUED]
    rows += [(f"`{slug}`, λ = 60", f"gain/{slug}", True) for slug in HALVED]
    for title, row, halved in rows:
        mine = [one for one in outcomes if one.gain and one.trial.row == row]
        ratio = [one.gain.rmse_after / one.gain.rmse_before for one in mine if one.gain]
        if ratio:
            middle, left = statistics.median(ratio), [found for one in mine if (found := beyond(one)) is not None]
            cells = [str(len(ratio)), f"{middle:.3f}", f"{max(ratio):.3f}", "≤ 1.02", _mark(middle <= 1.02)]
            cells += [f"{statistics.median(left):.2f} of {len(left)}" if left else "–"]
            cells += ["≤ 0.5", _mark(bool(left) and statistics.median(left) <= 0.5)] if halved else ["", ""]
            lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return lines


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
    """How to make again what went wrong: named and wrong, false alarms, crashes, the truth not in the set, missed."""
    lines = []
    for one in outcomes:
        reason = ""
        if one.verdict == "crashed":
            reason = f"crashed: {one.error[:120]}"
        elif one.wrong:
            reason = "named and wrong"
        elif not one.truth and one.verdict != "model_adequate":
            reason = "false alarm"
        elif one.trial.row.startswith("one/") and one.detected and not one.in_set:
            reason = "truth not in set"
        elif one.made and one.truth and not one.detected and one.trial.lam >= 20:
            reason = "missed"
        if reason:
            candidates = ", ".join(f"{slug} {share:.2f}" for slug, share in one.candidates[:3])
            lines.append(f"{reason:16} {one.trial}  -> {one.verdict} {sorted(one.causes)} [{candidates}]")
    return sorted(lines)[:most]
