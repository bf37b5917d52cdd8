"""What the prognosis says of real lives that are no eq. 6: each alone, and with three and with ten ended lives of its kind.

    HALF=developing|judging SIZE=small|full STORE=FILE python -m tests.lab.real.lives

What is measured is folded so that its value falls from 0.1 to a half at the end of life:

- **Filters** (`filter_lives`; half of the 50 are here) on one rig until their pressure reached 600 Pa: it accelerates, and
  from some seven tenths of a life on grows in a straight line. 30 tests in a life; a kind is a dust feed.
- **Cells** (`battery_lives`) until their capacity reached a threshold: many end in a knee. 30 tests; a kind is a maker's
  cell under one protocol, and a row a maker.
- **Cracks** (`crack_growth`): ten, at nine times, until a length of 0.25.
- **Lasers** (`laser_degradation`): 15, every 250 h, until their current has risen by 5 %, which all of them reach.
- **Running-in** (`tribometer_running_in`): friction of three contacts in 50 blocks, until nine tenths of its change.

Every second life of a kind is for developing, the others for judging; ended lives are taken from both. The rivals are what
one knows without any model: the ends of the same ended lives that were later than now, each as probable, and the remaining
lives that these had when they had come as far (their curves, slid over the new one). Results are kept in the store by life,
and the next run goes on where this one ended; delete it after a change of the numerics.
"""

import itertools
import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import HORIZON
from models.prognosis.ended_lives import ObservedLife, severity_exponent
from models.prognosis.scoring import measured_end
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.lab.measuring import Asked, Lines, show
from tests.lab.real import loaders
from tests.lab.real.lag import Row
from tests.lab.real.prognosis import BLOCKS
from tests.lab.score.table import score, score_of_stated
from tests.models.tracking.tracked_series import sent
from tests.statistical.forecasts import DRAWS, GRID, forecast
from tests.statistical.lives import taught

SEED, TESTS, LIMIT, CRACK, RISE, DONE = 2026, 30, 600.0, 0.25, 0.05, 0.9
STAGES = (0.4, 0.6, 0.8)
#: By how many ended lives a life is judged, and how many there must be: of a kind there may be fewer than ten others.
OTHERS = {3: 3, 10: 6}
#: Every so many'th life of a kind in the small table.
SMALL = 5
HALVES = ("developing", "judging")

#: Its kind, its tests, and its end.
Life = tuple[str, list[Measurement], float]


def filters() -> Iterator[Life]:
    """The medians of pressure about evenly spaced moments [s]."""
    data = loaders.columns("filter_lives", "filters_odd.csv")
    for number in np.unique(data["life"]).tolist():
        here = data["life"] == number
        seconds, pressure = data["time_s"][here], data["differential_pressure_pa"][here]
        value = _folded(pressure - float(np.median(pressure[:3])), LIMIT - float(np.median(pressure[:3])))
        clogged = np.flatnonzero(value <= 0.05)
        end = float(seconds[clogged[0] if clogged.size else -1])
        moments = np.linspace(0.0, end, TESTS + 1)[:-1]
        near = np.abs(seconds[:, None] - moments) <= max(1.0, end / 200.0)
        values = np.array([np.median(value[each]) for each in near.T])
        yield f"feed {data['dust_feed'][here][0]:g}", sent(moments, values), end


def cells(maker: str) -> Iterator[Life]:
    """Every second of the cycles that are given, of one maker's cells."""
    for (group, _), rows in loaders.cells().items():
        if group.startswith(maker):
            cycles, capacity = np.array([(float(row["cycle"]), float(row["relative_capacity"])) for row in rows[::2]]).T
            values = _folded(1.0 - capacity, 1.0 - float(rows[0]["threshold"]))
            yield group, sent(cycles, values), float(rows[0]["end_cycle"])


def cracks() -> Iterator[Life]:
    """In thousandths of the time given."""
    data = loaders.columns("crack_growth", "crack_growth.csv")
    for unit in range(1, 11):
        lengths = data[f"unit{unit}"]
        yield _ended(1_000.0 * data["time"], _folded(lengths - lengths[0], CRACK - lengths[0]))


def lasers() -> Iterator[Life]:
    """In hours."""
    for hours, rise in loaders.lasers().values():
        yield _ended(hours, _folded(rise - rise[0], RISE))


def running_in() -> Iterator[Life]:
    """In blocks of the record."""
    for name in ("bod_10000s", "bod_24x5min", "pod_7500s_a"):
        course = loaders.columns("tribometer_running_in", f"{name}.csv")["Traction Coeff (-)"]
        friction = np.array([block.mean() for block in np.array_split(course, BLOCKS)])
        yield _ended(np.arange(BLOCKS) + 1.0, _folded(friction - friction[0], DONE * (friction[-1] - friction[0])))


def _folded(change: FloatArray, whole: float) -> FloatArray:
    return 0.1 * (1.0 - 0.5 * change / whole)


def _ended(progress: FloatArray, values: FloatArray) -> Life:
    end = measured_end(progress, values, 0.05)
    return "", sent(progress, values), end


#: By row.
WORLDS: dict[str, Callable[[], Iterator[Life]]] = {
    "filters": filters,
    "cells, MIT": partial(cells, "MIT"),
    "cells, TJU 1": partial(cells, "TJU_1"),
    "cells, TJU 2": partial(cells, "TJU_2"),
    "cells, TJU 3": partial(cells, "TJU_3"),
    "cracks": cracks,
    "lasers": lasers,
    "running-in": running_in,
}


def with_ended(
    tests: Sequence[Measurement], end: float, by_count: Mapping[int, Sequence[ObservedLife]], rng: np.random.Generator
) -> dict[str, dict[str, list[list[float]]]]:
    """By count of ended lives and stage: the outcomes as it is stated, by their ends alone, and by their curves."""
    found: dict[str, dict[str, list[list[float]]]] = {str(count): {} for count in by_count}
    for stage in STAGES:
        seen = [test for test in tests if test.progress <= (stage + 1e-3) * end]
        if len(seen) < 3:
            continue
        now = seen[-1].progress
        drawn = GRID.posterior(GRID.from_history(weak(seen[0], falling=True), seen), DRAWS, rng)
        for count, kin in by_count.items():
            alive = np.array([life.end for life in kin if life.end > now])
            if alive.size == 0:
                continue
            slid = now + np.array([_left(life, seen) for life in kin])
            rivals = (score(np.minimum(ends, HORIZON), np.ones(ends.size), end) for ends in (alive, slid))
            scores = (score_of_stated(drawn, seen, kin, end), *rivals)
            found[str(count)][f"{stage:g}"] = [[each.held, each.late, each.crps] for each in scores]
    return found


def _left(life: ObservedLife, seen: Sequence[Measurement]) -> float:
    """What was left of an ended life when it had come as far as the last three tests of another have."""
    first = seen[0].value
    damage = float(np.median([(1.0 - test.value / first) / 0.5 for test in seen[-3:]]))
    course = np.maximum.accumulate(np.append(life.damage, 1.0))
    return max(life.end - float(np.interp(damage, course, np.append(life.progress, life.end))), 1e-3 * life.end)


def judged(half: str, every: int, store: Path) -> Iterator[tuple[str, dict[str, dict[str, list[float]]]]]:
    """The row and the outcomes of every life of a half, from the store where they are there."""
    known = Lines(store)
    for name, world in WORLDS.items():
        kinds: dict[str, list[Life]] = defaultdict(list)
        for life in world():
            kinds[life[0]].append(life)
        for kind, lives in kinds.items():
            ended = [taught(tests, end) for _, tests, end in lives]
            for number in range(HALVES.index(half), len(lives), 2):
                if every > 1 and len(lives) > every and number // 2 % every:
                    continue
                yield name, known.get(f"{name}/{kind}/{number}", partial(forecasts, lives, ended, number))


def forecasts(lives: Sequence[Life], ended: Sequence[ObservedLife], number: int) -> dict[str, Any]:
    """What is said of one of a kind's lives, alone and with others of them."""
    _, tests, end = lives[number]
    rng = np.random.default_rng([SEED, number])
    order = [index for index in rng.permutation(len(lives)).tolist() if index != number]
    kin = {count: [ended[k] for k in order[:count]] for count, least in OTHERS.items() if len(order) >= least}
    told = forecast(tests, end, np.random.default_rng([SEED, number]))
    alone = {f"{stage:g}": [float(x) for x in found] for stage, found in told.items() if stage in STAGES}
    return {"alone": alone} | with_ended(tests, end, kin, rng)


Found = Sequence[tuple[str, Mapping[str, Mapping[str, Any]]]]


def rows_of(found: Found, judged: str, cells: Callable[[FloatArray], Row]) -> list[Row]:
    """A row a kind and stage, of what was found alone or with so many ended lives."""
    rows: list[Row] = []
    for name, stage in itertools.product(WORLDS, STAGES):
        mine = (one.get(judged, {}).get(f"{stage:g}") for row, one in found if row == name)
        every = np.array([each for each in mine if each is not None], dtype=float)
        if every.size:
            rows.append({"what": name, "of life": f"{stage:.0%}", "lives": str(len(every))} | cells(every))
    return rows


def alone(every: FloatArray) -> Row:
    """Held, late and width in lives, as the exact filter has it; the same as it is stated after earlier forecasts; how many
    tests these held, and of how many."""
    held, late, _, held_wide, late_wide, *_ = every.mean(axis=0)
    *_, within, of = every.sum(axis=0)
    return {
        "held": f"{held:.0%}",
        "begins after the end": f"{late:.0%}",
        "width, lives": f"{np.median(every[:, 2]):.2g}",
        "as stated: held": f"{held_wide:.0%}",
        "begins after it": f"{late_wide:.0%}",
        "width": f"{np.median(every[:, 5]):.2g}",
        "tests within earlier forecasts": f"{within / of:.0%}" if of else "-",
    }


def beside(every: FloatArray) -> Row:
    """The outcomes as it is stated with ended lives, by their ends alone, and by their curves."""
    ours, ends, curves = every.mean(axis=0)
    return {
        "held": f"{ours[0]:.0%}",
        "begins after the end": f"{ours[1]:.0%}",
        "CRPS, % of life": f"{100 * ours[2]:.2f}",
        "of the ends alone": f"{100 * ends[2]:.2f}",
        "of their curves": f"{100 * curves[2]:.2f}",
        "curves hold": f"{curves[0]:.0%}",
    }


def main() -> None:
    half, asked = os.environ.get("HALF") or "judging", Asked.here("full")
    store = Path(os.environ.get("STORE") or f"real-lives-{half}.jsonl")
    found = list(judged(half, SMALL if asked.size < 1.0 else 1, store))
    title = "### Real lives, each alone: the exact filter, and as it is stated after earlier forecasts"
    show(title, rows_of(found, "alone", alone))
    for count in OTHERS:
        show(f"### With {count} ended lives of the kind", rows_of(found, str(count), beside))
    clogged = list(filters())
    ends, feeds = np.array([end for *_, end in clogged]), np.array([float(kind.split()[1]) for kind, *_ in clogged])
    exponent, deviation = severity_exponent(ends, feeds)
    print(f"The feed as severity: exponent {-exponent:.3f} ± {deviation:.3f} of {ends.size} lives")


if __name__ == "__main__":
    main()
