"""The table of a load, and which demands it meets."""

import math
import statistics
from collections.abc import Sequence
from typing import NamedTuple

from tests.lab.load.field import LIVEZ, ROUTES, Counts
from tests.lab.measuring import table

#: The demands of docs/appendix/benchmarks.md: ms of 99 of 100 GETs and plain POSTs, posts a second without raw files, how
#: much more memory the last third of the time may take, on average, than the middle third. The first third fills caches.
MOST_GET_MS, MOST_POST_MS, LEAST_POSTS_A_SECOND, MOST_GROWTH = 50.0, 500.0, 15.0, 1.10


class Demand(NamedTuple):
    """What is demanded, what was found, and whether that will do."""

    name: str
    found: str
    met: bool


def quantile(values: Sequence[float], share: float) -> float:
    """The smallest of the values that at least this share of them do not exceed; infinite of none."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)] if ordered else math.inf


def growth(sizes: Sequence[int]) -> float:
    """The mean of the last third over that of the middle third; 1 of fewer than three."""
    third = len(sizes) // 3
    return statistics.mean(sizes[-third:]) / statistics.mean(sizes[-2 * third : -third]) if third else 1.0


def demands(counts: Counts) -> list[Demand]:
    """Each demand beside what was found."""
    slowest = max(ROUTES, key=lambda route: quantile(counts.gets[route], 0.99))
    get = 1e3 * quantile(counts.gets[slowest], 0.99)
    post = 1e3 * quantile(counts.posts["plain"], 0.99)
    errors = sum(counts.problems.values())
    alone, together = growth(counts.alone), growth(counts.together)
    found = [
        Demand("no error", str(errors), errors == 0),
        Demand("nothing lost, and the same as posted calmly", str(len(counts.losses)), not counts.losses),
    ]
    if counts.options.database:  # the others are those of one service on a file
        return found
    growths = f"{100 * (alone - 1):+.1f} % alone, {100 * (together - 1):+.1f} % with its processes"
    most = f"{100 * (MOST_GROWTH - 1):.0f} %"
    found += [
        Demand(f"GET 99 % < {MOST_GET_MS:.0f} ms, every route", f"{get:.0f} ms (`{slowest}`)", get < MOST_GET_MS),
        Demand(f"POST 99 % < {MOST_POST_MS:.0f} ms, but for sampled records", f"{post:.0f} ms", post < MOST_POST_MS),
        Demand(
            f"memory flat: the last third at most {most} above the middle third",
            growths,
            max(alone, together) <= MOST_GROWTH,
        ),
    ]
    if not counts.options.raw:
        least = LEAST_POSTS_A_SECOND
        found.append(Demand(f"at least {least:.0f} posts a second", f"{counts.pace:.1f}", counts.pace >= least))
    return found


def latencies(counts: Counts) -> list[str]:
    """Quantiles by route."""
    names = {"plain": "POST a run", "sampled": "POST a sampled record", "registration": "POST a clutch"}
    asked = [(f"GET {route}", counts.gets[route], str(counts.statuses[route, 304])) for route in (*ROUTES, LIVEZ)]
    asked += [(name, counts.posts[what], "") for what, name in names.items() if counts.posts[what]]
    rows = [
        (name, len(taken), unchanged, *(f"{1e3 * quantile(taken, share):.1f}" for share in (0.5, 0.9, 0.99, 1.0)))
        for name, taken, unchanged in asked
    ]
    return table(("request", "asked", "304", "median, ms", "90 %", "99 %", "longest"), rows)


def totals(counts: Counts) -> list[str]:
    """Everything that is no latency."""
    taken = counts.worked
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.kinds.most_common())
    half = len(counts.together) // 2
    rows = {
        "runs acknowledged": f"{counts.runs} of {len(counts.acknowledged)} clutches: {kinds}",
        "posts a second": f"{counts.pace:.1f}",
        "runs held": counts.held,
        "GETs not asked by the end": counts.unasked,
        "diagnoses finished, s": _spread(counts.diagnoses),
        "fleet refreshes, s": _spread(counts.refreshes),
        "answers to slow readers": ", ".join(f"{count} {began}" for began, count in counts.slow.most_common()) or "0",
        "memory at half and at the end, MB": (
            f"alone {_mb(counts.alone, half)} and {_mb(counts.alone, -1)}, "
            f"with its processes {_mb(counts.together, half)} and {_mb(counts.together, -1)}"
        ),
        "processor, s": (
            f"service {taken['service']:.0f}, generator {taken['generator']:.1f}, refreshes {taken['refreshes']:.0f}, "
            f"others on the machine {taken['others']:.0f}"
        ),
        "the generator's own delay at most, ms": f"{1e3 * counts.late:.0f}",
    }
    return table(("", ""), rows.items())


def paces(loads: Sequence[Counts]) -> str:
    """Posts a second of one service and of several, beside each other."""
    rows = [(each.options.services, f"{each.pace:.1f}", f"{each.pace / loads[0].pace:.2f}") for each in loads]
    return "\n".join(table(("services", "posts a second", "times one service"), rows))


def markdown(counts: Counts) -> str:
    """The whole report."""
    verdicts = [(each.name, each.found, "yes" if each.met else "**no**") for each in demands(counts)]
    parts = [table(("demand", "found", "met"), verdicts), latencies(counts), totals(counts)]
    if counts.problems:
        errors = ((count, problem) for problem, count in counts.problems.most_common(20))
        parts.append(table(("errors", ""), errors))
    if counts.losses:
        parts.append(table(("lost or different",), ((loss,) for loss in counts.losses[:20])))
    return "\n\n".join("\n".join(part) for part in parts)


def _spread(taken: Sequence[float]) -> str:
    if not taken:
        return "0"
    return f"{len(taken)}: median {statistics.median(taken):.1f}, longest {max(taken):.1f}"


def _mb(sizes: Sequence[int], index: int) -> str:
    return f"{sizes[index] / 2**20:.0f}" if sizes else "-"
