"""What the prognosis says of real lives that are no eq. 6: each alone, and with three and with ten ended lives of its kind.

    python -m tests.real.lives [--half developing|judging] [--size small] [--store FILE]

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

import argparse
import csv
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import HORIZON
from models.prognosis.ended_lives import EndedLife, severity_exponent
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.scoring import crps_of_sample, measured_end
from models.prognosis.stated_end import stated_end
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.measuring import Lines
from tests.real.lag import Row, table
from tests.real.loaders import FOLDER
from tests.real.prognosis import BLOCKS, columns, laser_histories
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
    data = columns("filter_lives", "filters_odd.csv")
    for number in np.unique(data["life"]).tolist():
        here = data["life"] == number
        seconds, pressure = data["time_s"][here], data["differential_pressure_pa"][here]
        value = _folded(pressure - float(np.median(pressure[:3])), LIMIT - float(np.median(pressure[:3])))
        clogged = np.flatnonzero(value <= 0.05)
        end = float(seconds[clogged[0] if clogged.size else -1])
        moments = np.linspace(0.0, end, TESTS + 1)[:-1]
        near = np.abs(seconds[:, None] - moments) <= max(1.0, end / 200.0)
        values = np.array([np.median(value[each]) for each in near.T])
        yield f"feed {data['dust_feed'][here][0]:g}", _tests(moments, values), end


def cells() -> Iterator[Life]:
    """Every second of the cycles that are given."""
    found: dict[tuple[str, str], list[dict[str, str]]] = defaultdict(list)
    with (FOLDER / "battery_lives" / "battery_lives.csv").open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            found[row["group"], row["life"]].append(row)
    for (group, _), rows in found.items():
        cycles, capacity = (
            np.array([float(row[name]) for row in rows[::2]]) for name in ("cycle", "relative_capacity")
        )
        values = _folded(1.0 - capacity, 1.0 - float(rows[0]["threshold"]))
        yield group, _tests(cycles, values), float(rows[0]["end_cycle"])


def cells_of(maker: str) -> Iterator[Life]:
    """Those of one maker."""
    return (life for life in cells() if life[0].startswith(maker))


def cracks() -> Iterator[Life]:
    """In thousandths of the time given."""
    data = columns("crack_growth", "crack_growth.csv")
    for unit in range(1, 11):
        lengths = data[f"unit{unit}"]
        yield _ended(1_000.0 * data["time"], _folded(lengths - lengths[0], CRACK - lengths[0]))


def lasers() -> Iterator[Life]:
    """In hours."""
    for history in laser_histories():
        values = np.array([test.value for test in history])
        yield _ended(np.array([test.progress for test in history]), _folded(values[0] - values, RISE))


def running_in() -> Iterator[Life]:
    """In blocks of the record."""
    for name in ("bod_10000s", "bod_24x5min", "pod_7500s_a"):
        course = columns("tribometer_running_in", f"{name}.csv")["Traction Coeff (-)"]
        friction = np.array([block.mean() for block in np.array_split(course, BLOCKS)])
        yield _ended(np.arange(BLOCKS) + 1.0, _folded(friction - friction[0], DONE * (friction[-1] - friction[0])))


def _folded(change: FloatArray, whole: float) -> FloatArray:
    return np.asarray(0.1 * (1.0 - 0.5 * change / whole))


def _tests(progress: FloatArray, values: FloatArray) -> list[Measurement]:
    return [
        Measurement(progress=x, value=y, variance=0.0) for x, y in zip(progress.tolist(), values.tolist(), strict=True)
    ]


def _ended(progress: FloatArray, values: FloatArray) -> Life:
    end = measured_end(progress, values, 0.05)
    assert end is not None
    return "", _tests(progress, values), end


#: By row.
WORLDS: dict[str, Callable[[], Iterator[Life]]] = {
    "filters": filters,
    "cells, MIT": lambda: cells_of("MIT"),
    "cells, TJU 1": lambda: cells_of("TJU_1"),
    "cells, TJU 2": lambda: cells_of("TJU_2"),
    "cells, TJU 3": lambda: cells_of("TJU_3"),
    "cracks": cracks,
    "lasers": lasers,
    "running-in": running_in,
}

#: Held, late, and CRPS in shares of life.
Outcome = tuple[bool, bool, float]


def alone(tests: Sequence[Measurement], end: float, number: int) -> dict[str, list[float]]:
    """By stage: held, late and width in lives, as the exact filter has it; the same as it is stated after earlier
    forecasts; how many tests these held, and of how many."""
    told = forecast(tests, end, np.random.default_rng([SEED, number]))
    return {f"{stage:g}": [float(x) for x in found] for stage, found in told.items() if stage in STAGES}


def with_ended(
    tests: Sequence[Measurement], end: float, by_count: Mapping[int, Sequence[EndedLife]], rng: np.random.Generator
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
            stated = stated_end(drawn, fraction=0.5, as_of=now, horizon=HORIZON, ended=kin, tests=seen)
            slid = now + np.array([_left(life, seen) for life in kin])
            rivals = ((each, np.ones(each.size)) for each in (alive, slid))
            found[str(count)][f"{stage:g}"] = [
                list(_outcome(ends, weight, end)) for ends, weight in ((stated.ends, stated.weight), *rivals)
            ]
    return found


def _left(life: EndedLife, seen: Sequence[Measurement]) -> float:
    """What was left of an ended life when it had come as far as the last three tests of another have."""
    first = seen[0].value
    damage = float(np.median([(1.0 - test.value / first) / 0.5 for test in seen[-3:]]))
    course = np.maximum.accumulate(np.append(life.damage, 1.0))
    return max(life.end - float(np.interp(damage, course, np.append(life.progress, life.end))), 1e-3 * life.end)


def _outcome(ends: FloatArray, weight: FloatArray, end: float) -> Outcome:
    capped = np.minimum(ends, HORIZON)
    low, high = weighted_quantiles(capped, weight, (0.05, 0.95))
    return bool(low <= end <= high), bool(low > end), crps_of_sample(capped, weight, end) / end


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


def forecasts(lives: Sequence[Life], ended: Sequence[EndedLife], number: int) -> dict[str, Any]:
    """What is said of one of a kind's lives, alone and with others of them."""
    _, tests, end = lives[number]
    rng = np.random.default_rng([SEED, number])
    order = [index for index in rng.permutation(len(lives)).tolist() if index != number]
    kin = {count: [ended[k] for k in order[:count]] for count, least in OTHERS.items() if len(order) >= least}
    return {"alone": alone(tests, end, number)} | with_ended(tests, end, kin, rng)


def rows_alone(found: Sequence[tuple[str, dict[str, dict[str, list[float]]]]]) -> list[Row]:
    """A row a kind and stage."""
    rows: list[Row] = []
    for name in WORLDS:
        for stage in STAGES:
            every = [one["alone"][f"{stage:g}"] for row, one in found if row == name and f"{stage:g}" in one["alone"]]
            if every:
                held, late, width, held_wide, late_wide, wide, within, of = np.array(every, dtype=float).T
                rows.append(
                    {
                        "what": name,
                        "of life": f"{stage:.0%}",
                        "lives": str(len(every)),
                        "held": f"{held.mean():.0%}",
                        "begins after the end": f"{late.mean():.0%}",
                        "width, lives": f"{np.median(width):.2g}",
                        "as stated: held": f"{held_wide.mean():.0%}",
                        "begins after it": f"{late_wide.mean():.0%}",
                        "width": f"{np.median(wide):.2g}",
                        "tests within earlier forecasts": f"{within.sum() / of.sum():.0%}" if of.sum() else "-",
                    }
                )
    return rows


def rows_with_ended(found: Sequence[tuple[str, dict[str, dict[str, list[float]]]]], count: int) -> list[Row]:
    """A row a kind and stage, with so many ended lives."""
    rows: list[Row] = []
    for name in WORLDS:
        for stage in STAGES:
            mine = [one.get(str(count), {}).get(f"{stage:g}") for row, one in found if row == name]
            every = [each for each in mine if each is not None]
            if every:
                ours, ends, curves = np.array(every, dtype=float).mean(axis=0)
                rows.append(
                    {
                        "what": name,
                        "of life": f"{stage:.0%}",
                        "lives": str(len(every)),
                        "held": f"{ours[0]:.0%}",
                        "begins after the end": f"{ours[1]:.0%}",
                        "CRPS, % of life": f"{100 * ours[2]:.2f}",
                        "of the ends alone": f"{100 * ends[2]:.2f}",
                        "of their curves": f"{100 * curves[2]:.2f}",
                        "curves hold": f"{curves[0]:.0%}",
                    }
                )
    return rows


def main(arguments: Sequence[str] = ()) -> None:
    """The tables."""
    parser = argparse.ArgumentParser(prog="python -m tests.real.lives")
    parser.add_argument("--half", choices=HALVES, default="judging")
    parser.add_argument("--size", choices=("small", "full"), default="full")
    parser.add_argument("--store", type=Path, default=None)
    chosen = parser.parse_args(arguments)
    store = chosen.store or Path(f"real-lives-{chosen.half}.jsonl")
    found = list(judged(chosen.half, SMALL if chosen.size == "small" else 1, store))
    print("### Real lives, each alone: the exact filter, and as it is stated after earlier forecasts\n")
    print(table(rows_alone(found)))
    for count in OTHERS:
        print(f"\n### With {count} ended lives of the kind\n\n{table(rows_with_ended(found, count))}")
    clogged = list(filters())
    ends, feeds = np.array([end for *_, end in clogged]), np.array([float(kind.split()[1]) for kind, *_ in clogged])
    exponent, deviation = severity_exponent(ends, feeds)
    print(f"\nThe feed as severity: exponent {-exponent:.3f} ± {deviation:.3f} of {ends.size} lives")


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
