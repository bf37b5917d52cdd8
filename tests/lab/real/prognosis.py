"""What the prognosis says of real wear and ageing, each with measurements that it has not seen.

Nothing of it is a clutch; eq. 6 and its filters are asked about what they were not made for:

- **Lasers** (`laser_degradation`): the operating current of 15 lasers over 4,000 h, failed at +10 %; 12 never fail within
  the test. What falls is 1 - increase, the threshold 0.9. Each laser is predicted with the weak prior, and with one
  learned from the other 14.
- **Pins** (`sliding_wear`): the wear scar of 12 pins under 10, 50 and 100 g. Each pin is predicted from the others: by one
  law over load times cycles (the dissipated energy up to a factor), by one law a load over cycles, and, to be compared
  with, by one law over cycles whatever the load.
- **Running-in** (`tribometer_running_in`): friction of one contact from the first second, in blocks of time; the last
  block is predicted from the first ones.
"""

import math
from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray
from models.prognosis.first_passage import ends_of_life, weighted_quantiles
from models.prognosis.fleet import FleetPrior, population, taught
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior, weak
from tests.lab.measuring import show
from tests.lab.real import loaders
from tests.lab.real.lag import Row
from tests.models.prognosis.sample_scores import crps_of_sample
from tests.models.tracking.tracked_series import sent

SEED, DRAWS = 2013, 1_000
GRID = Grid()
#: A laser has failed where its current has risen by a tenth.
LASER_FRACTION, LASER_END = 0.9, 4_000.0
BLOCKS = 50


def drawn(prior: TrackPrior, seen: Sequence[Measurement], rng: np.random.Generator) -> TrackPosterior:
    return GRID.posterior(GRID.from_history(prior, seen), DRAWS, rng)


def next_values(posterior: TrackPosterior, progress: float, rng: np.random.Generator) -> FloatArray:
    """What a measurement at `progress` may be: the course of every draw and its scatter."""
    course = posterior.values(np.array([progress]))[0]
    return course + posterior.scatter * rng.standard_normal(course.size)


def lasers() -> list[Row]:
    """By the hours seen and the prior: what of 15 left-out lasers is held."""
    histories = [sent(hours, 1.0 - rise) for hours, rise in loaders.lasers().values()]
    lessons = [taught(history) for history in histories]
    failed = [history[-1].value <= LASER_FRACTION for history in histories]
    rows = []
    for hours in (1_000.0, 2_000.0, 3_000.0):
        found: dict[str, list[tuple[bool, bool, float]]] = {"weak": [], "of the other 14": []}
        for index, history in enumerate(histories):
            rng = np.random.default_rng([SEED, index, int(hours)])
            fleet = population(lessons[:index] + lessons[index + 1 :])
            for name, posterior in _believed(history, hours, fleet, rng).items():
                found[name].append(_laser(posterior, history, rng))
        for name, outcomes in found.items():
            value_held, end_held, chance = (list(column) for column in zip(*outcomes, strict=True))
            brier = float(np.mean([(p - f) ** 2 for p, f in zip(chance, failed, strict=True)]))
            rows.append(
                {
                    "hours seen": int(hours),
                    "prior": name,
                    "current at 4,000 h held": f"{sum(value_held)} of {len(outcomes)}",
                    "failure held, or not contradicted": f"{sum(end_held)} of {len(outcomes)}",
                    "failures by 4,000 h predicted": round(sum(chance), 1),
                    "came": sum(failed),
                    "Brier score": round(brier, 3),
                }
            )
    return rows


def wandering() -> tuple[float, float]:
    """Mean autocorrelation from one inspection to the next of the lasers about a parabola each; and that of independent
    scatter in their place."""
    rng = np.random.default_rng(SEED)
    found = []
    for hours, rise in loaders.lasers().values():
        pair = np.column_stack([1.0 - rise, rng.standard_normal(hours.size)])
        off = pair - np.vander(hours, 3) @ np.linalg.lstsq(np.vander(hours, 3), pair, rcond=None)[0]
        found.append((off[1:] * off[:-1]).sum(axis=0) / np.square(off).sum(axis=0))
    ours, independent = np.mean(found, axis=0).tolist()
    return ours, independent


def _believed(
    history: list[Measurement], hours: float, fleet: FleetPrior, rng: np.random.Generator
) -> dict[str, TrackPosterior]:
    seen = [m for m in history if m.progress <= hours]
    plain = drawn(weak(seen[0], falling=True), seen, rng)
    learned = drawn(fleet.prior_for(seen[0]), seen, rng)
    return {"weak": plain, "of the other 14": fleet.together(plain, learned, seen[0])}


def _laser(posterior: TrackPosterior, history: list[Measurement], rng: np.random.Generator) -> tuple[bool, bool, float]:
    """Whether the 90 % interval holds the last value, whether that of the failure holds it (between two inspections, or
    beyond the test), and the stated probability of failing within the test."""
    low, high = weighted_quantiles(next_values(posterior, LASER_END, rng), posterior.weight, (0.05, 0.95))
    ends = np.minimum(ends_of_life(posterior, LASER_FRACTION), 1e6)
    first, last = weighted_quantiles(ends, posterior.weight, (0.05, 0.95))
    passed = [m.progress for m in history if m.value <= LASER_FRACTION]
    came = passed[0] if passed else 1e6
    before = max(m.progress for m in history if m.progress < came)
    return (
        bool(low <= history[-1].value <= high),
        bool(first <= came and last >= before),
        float(posterior.weight[ends <= LASER_END].sum()),
    )


def pins() -> list[Row]:
    """By law: CRPS of the scar of a left-out pin, and how often the 90 % interval holds it."""
    data = loaders.columns("sliding_wear", "metalwear.csv")
    laws = {
        "one, over load times cycles": (data["grams"] * data["cycles"], np.zeros(data["unit"].size)),
        "one a load, over cycles": (data["cycles"], data["grams"]),
        "one, over cycles whatever the load": (data["cycles"], np.zeros(data["unit"].size)),
    }
    rows = []
    for name, (progress, group) in laws.items():
        scores, held = [], []
        for unit in np.unique(data["unit"]):
            out = data["unit"] == unit
            others = ~out & (group == group[out][0])
            rng = np.random.default_rng([SEED, int(unit)])
            posterior = drawn(_scar_prior(data["microns"]), sent(progress[others], data["microns"][others]), rng)
            for at, scar in zip(progress[out].tolist(), data["microns"][out].tolist(), strict=True):
                sample = next_values(posterior, at, rng)
                low, high = weighted_quantiles(sample, posterior.weight, (0.05, 0.95))
                scores.append(crps_of_sample(sample, posterior.weight, scar))
                held.append(low <= scar <= high)
        rows.append({"law": name, "CRPS [µm]": float(np.mean(scores)), "held, %": round(100 * float(np.mean(held)))})
    return rows


def _scar_prior(scars: FloatArray) -> TrackPrior:
    """A prior that knows the size of the scars, and of the scatter from pin to pin that it may be a tenth of it."""
    size = float(scars.mean())
    return TrackPrior(
        initial_mean=0.0,
        initial_sd=size,
        change_mean=size,
        change_sd=2.0 * size,
        log_scale_mean=math.log(1_000.0),
        log_scale_sd=2.5,
        log_exponent_mean=math.log(0.5),
        log_exponent_sd=1.0,
        log_scatter_mean=math.log(0.1 * size),
        log_scatter_sd=1.0,
    )


def running_in() -> list[Row]:
    """By contact and share seen: the last block's friction, predicted and measured."""
    rows = []
    for name in ("bod_10000s", "pod_7500s_a"):
        data = loaders.columns("tribometer_running_in", f"{name}.csv")
        blocks = np.array_split(np.arange(data["Traction Coeff (-)"].size), BLOCKS)
        time = np.array([data["Step Time (s)"][each].mean() for each in blocks])
        friction = np.array([data["Traction Coeff (-)"][each].mean() for each in blocks])
        history = sent(time, friction)
        for share in (0.2, 0.5, 0.8):
            rng = np.random.default_rng([SEED, int(10 * share)])
            seen = history[: round(share * BLOCKS)]
            posterior = drawn(weak(seen[0], falling=False), seen, rng)
            sample = next_values(posterior, history[-1].progress, rng)
            low, median, high = weighted_quantiles(sample, posterior.weight, (0.05, 0.5, 0.95)).tolist()
            last, beside = history[-1].value, posterior.discrepancy
            rows.append(
                {
                    "contact": name,
                    "blocks seen": f"{len(seen)} of {BLOCKS}",
                    "5 %": low,
                    "median": median,
                    "95 %": high,
                    "measured": last,
                    "held": "yes" if low <= last <= high else "no",
                    "beside eq. 6, %": 0 if beside is None else round(100 * posterior.weight[beside.present].sum()),
                }
            )
    return rows


def main() -> None:
    show("### Lasers: failure at +10 %, each left out", lasers())
    print("Autocorrelation between inspections {:.2f}, of independent scatter {:.2f}.\n".format(*wandering()))
    show("### Pins: the wear scar of each from the others", pins())
    show("### Running-in: the last block from the first ones", running_in())


if __name__ == "__main__":
    main()
