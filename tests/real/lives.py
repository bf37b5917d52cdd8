"""What the prognosis says of real lives that are no eq. 6, each alone: with and without what earlier forecasts teach.

What is measured is folded so that its value falls from 0.1 to a half at the end of life:

- **Filters** (`filter_lives`; half of the 50 are here) on one rig until their pressure reached 600 Pa: it accelerates, and
  from some seven tenths of a life on grows in a straight line. 30 tests in a life.
- **Cracks** (`crack_growth`): ten, at nine times, until a length of 0.25.
- **Lasers** (`laser_degradation`): 15, every 250 h, until their current has risen by 5 %, which all of them reach.
- **Running-in** (`tribometer_running_in`): friction of three contacts in 50 blocks, until nine tenths of its change.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from models.arrays import FloatArray
from models.prognosis.scoring import measured_end
from models.tracking.measurement import Measurement
from tests.real.lag import Row, table
from tests.real.prognosis import BLOCKS, columns, laser_histories
from tests.statistical.forecasts import STAGES, forecast

SEED, TESTS, LIMIT, CRACK, RISE, DONE = 2026, 30, 600.0, 0.25, 0.05, 0.9

#: What tells kinds of a life apart (the dust feed of a filter), its tests, and its end.
Life = tuple[float, list[Measurement], float]


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
        yield float(data["dust_feed"][here][0]), _tests(moments, values), end


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
    return 0.0, _tests(progress, values), end


#: What `make real` shows, each alone.
WORLDS: dict[str, Callable[[], Iterator[Life]]] = {
    "filters": filters,
    "cracks": cracks,
    "lasers": lasers,
    "running-in": running_in,
}


def alone(name: str, lives: Sequence[Life]) -> list[Row]:
    """A row a stage: the filter, and as it is stated."""
    told = [forecast(tests, end, np.random.default_rng([SEED, number])) for number, (_, tests, end) in enumerate(lives)]
    rows: list[Row] = []
    for stage in STAGES:
        every = [by_stage[stage] for by_stage in told if stage in by_stage]
        if every:
            held, late, width, held_wide, late_wide, wide, within, judged = np.array(every).T
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
                    "tests within earlier forecasts": f"{within.sum() / judged.sum():.0%}" if judged.sum() else "-",
                }
            )
    return rows


def main() -> None:
    """The table."""
    print("### Real lives, each alone: the exact filter, and as it is stated after earlier forecasts\n")
    print(table([row for name, lives in WORLDS.items() for row in alone(name, list(lives()))]))


if __name__ == "__main__":
    main()
