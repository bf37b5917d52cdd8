"""The table as Markdown: counts, Wilson's intervals, targets."""

import statistics
from collections.abc import Sequence

from tests.blind.rig.makers import CATALOGUED, OUTSIDE
from tests.blind.rows import calibration, counts, wilson
from tests.blind.trials import Outcome


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
    """Each of the seventeen by itself."""
    lines = [
        "| effect | campaigns | detected | truth in set | top candidate | named | named and wrong | unexplained |",
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


def _beyond_noise(one: Outcome) -> float:
    """Held-out error after over before, each with the noise taken off in squares."""
    before, after, noise = one.gain or (1.0, 1.0, 0.0)
    return (max(after**2 - noise**2, 0.0) / max(before**2 - noise**2, 1e-12)) ** 0.5


def gains(outcomes: Sequence[Outcome]) -> list[str]:
    """Held-out error after over before, where an extension is proposed: as measured, and beyond the noise."""
    lines = [
        "| held-out error after/before | campaigns | median | worst | median beyond noise |",
        "|---|---|---|---|---|",
    ]
    rows = [("one effect, λ = 20", "one/"), ("λ = 50, 12 states", "twelve/")]
    rows += [(f"`{slug}`, λ = 60", f"gain/{slug}") for slug in ("oil_temperature", "oil_change")]
    for title, prefix in rows:
        mine = [one for one in outcomes if one.gain and one.trial.row.startswith(prefix)]
        ratio = [one.gain[1] / one.gain[0] for one in mine if one.gain]
        if ratio:
            beyond = statistics.median(map(_beyond_noise, mine))
            lines.append(
                f"| {title} | {len(ratio)} | {statistics.median(ratio):.3f} | {max(ratio):.3f} | {beyond:.2f} |"
            )
    return lines


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
    told = []
    for one in outcomes:
        reason = ""
        if one.error:
            reason = f"crashed: {one.error[:120]}"
        elif one.wrong:
            reason = "named and wrong"
        elif not one.truth and one.verdict != "model_adequate":
            reason = "false alarm"
        elif one.trial.row.startswith("one/") and one.detected and not one.in_set:
            reason = "truth not in set"
        elif one.truth and not one.detected and one.trial.lam >= 20:
            reason = "missed"
        if reason:
            said = ", ".join(f"{slug} {share:.2f}" for slug, share in one.candidates[:3])
            told.append(f"{reason:16} {one.trial}  -> {one.verdict} {sorted(one.causes)} [{said}]")
    return sorted(told)[:most]
