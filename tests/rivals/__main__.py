"""`make rivals`: the same lives foretold by other packages, in one run: CRPS and time beside ours.

Every rival is given what it needs and our filters must find out: the scatter, exactly. All start from the same prior.
"""

import argparse
import math
import time
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from progpy import PrognosticsModel, state_estimators
from progpy.uncertain_data import MultivariateNormalDist
from scipy.optimize import curve_fit

from models.degradation import Degradation, first_passage, progress_fraction
from models.scoring import crps_of_sample
from models.tracking.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.particle import Particle
from models.tracking.prior import Prior, weak
from models.tracking.ukf import Ukf
from tests.statistical.lives import CAP, STAGES, ends, typical

Sample = tuple[np.ndarray, np.ndarray]
DRAWS = 1_000
NAMES = ("initial", "change", "log_scale", "log_exponent")


def ends_of(coefficients: np.ndarray) -> Sample:
    """End of life, equally weighted, of rows of (ξ0, Δ, log φ, log ε)."""
    initial, change, log_scale, log_exponent = np.clip(coefficients, -50.0, 50.0).T
    law = Degradation(initial=initial, change=change, scale=np.exp(log_scale), exponent=np.exp(log_exponent))
    found = np.where(initial <= 0.0, 0.0, first_passage(0.5 * initial, law))
    return np.minimum(found, CAP), np.full(initial.size, 1.0 / initial.size)


def prior_moments(prior: Prior) -> tuple[np.ndarray, np.ndarray]:
    mean = np.array([prior.initial_mean, prior.change_mean, prior.log_scale_mean, prior.log_exponent_mean])
    return mean, np.array([prior.initial_sd, prior.change_sd, prior.log_scale_sd, prior.log_exponent_sd]) ** 2


class PlainUkf:
    """filterpy's unscented Kalman filter in (ξ0, Δ, log φ, log ε), started at the prior."""

    def __init__(self, prior: Prior, scatter: float) -> None:
        mean, variance = prior_moments(prior)
        points = MerweScaledSigmaPoints(n=4, alpha=1.0, beta=0.0, kappa=0.0)
        self.filter = UnscentedKalmanFilter(4, 1, 1.0, hx=self.expected, fx=lambda x, _: x, points=points)
        self.filter.x, self.filter.P = mean, np.diag(variance)
        self.filter.Q, self.filter.R = 1e-9 * np.diag(variance), np.array([[scatter**2]])
        self.progress = 0.0

    def expected(self, x: np.ndarray) -> np.ndarray:
        scale, exponent = np.exp(np.clip(x[2:], -50.0, 50.0))
        return np.array([x[0] + x[1] * float(progress_fraction(self.progress, scale, exponent))])

    def update(self, measurement: Measurement, _: int) -> None:
        self.progress = measurement.progress
        self.filter.predict()
        self.filter.update(np.array([measurement.value]))
        self.filter.P = 0.5 * (self.filter.P + self.filter.P.T) + 1e-14 * np.eye(4)

    def sample(self, rng: np.random.Generator) -> Sample:
        return ends_of(rng.multivariate_normal(self.filter.x, self.filter.P, DRAWS, check_valid="ignore"))


class Law(PrognosticsModel):  # type: ignore[misc]
    """Eq. 6 as a model of progpy: its coefficients do not move, progress goes on by `gap` in a unit of time."""

    inputs: ClassVar[list[str]] = []
    states: ClassVar[list[str]] = [*NAMES, "progress"]
    outputs: ClassVar[list[str]] = ["value"]
    events: ClassVar[list[str]] = ["end"]
    default_parameters: ClassVar[dict[str, Any]] = {"gap": 1.0, "x0": dict.fromkeys([*NAMES, "progress"], 0.0)}

    def dx(self, x: Any, u: Any) -> Any:  # noqa: ARG002
        return self.StateContainer(
            {**{name: 0.0 * x[name] for name in NAMES}, "progress": 0.0 * x["progress"] + self["gap"]}
        )

    def output(self, x: Any) -> Any:
        scale, exponent = (np.exp(np.clip(x[name], -50.0, 50.0)) for name in ("log_scale", "log_exponent"))
        share = progress_fraction(np.maximum(x["progress"], 0.0), scale, exponent)
        return self.OutputContainer({"value": x["initial"] + x["change"] * share})

    def event_state(self, x: Any) -> Any:
        return {"end": self.output(x)["value"] / x["initial"] - 0.5}


class Progpy:
    """NASA's progpy: its unscented Kalman filter, or its particle filter with a hundredth of the prior's deviations as
    process noise, without which it keeps a single particle."""

    def __init__(self, kind: str, prior: Prior, scatter: float, gap: float) -> None:
        mean, variance = prior_moments(prior)
        self.model = Law(gap=gap, process_noise=0.0, measurement_noise=scatter)
        start = MultivariateNormalDist(
            [*NAMES, "progress"], [*mean.tolist(), -gap], np.diag([*variance.tolist(), 1e-6])
        )
        if kind == "UnscentedKalmanFilter":
            noise = np.diag([*(1e-9 * variance).tolist(), 1e-9])
            self.filter = state_estimators.UnscentedKalmanFilter(self.model, start, Q=noise, R=np.array([[scatter**2]]))
        else:
            self.model.parameters["process_noise"] = dict(
                zip([*NAMES, "progress"], [*(0.01 * np.sqrt(variance)).tolist(), 0.0], strict=True)
            )
            noise = {"value": scatter}
            self.filter = state_estimators.ParticleFilter(
                self.model, start, num_particles=DRAWS, measurement_noise=noise
            )
        self.filter.t = -1.0

    def update(self, measurement: Measurement, index: int) -> None:
        found = self.model.OutputContainer({"value": measurement.value})
        self.filter.estimate(float(index), self.model.InputContainer({}), found, dt=1.0)

    def sample(self, rng: np.random.Generator) -> Sample:  # noqa: ARG002
        drawn = self.filter.x.sample(DRAWS)
        return ends_of(np.array([[float(each[name]) for name in NAMES] for each in drawn]))


def fitted(measurements: list[Measurement], prior: Prior, rng: np.random.Generator) -> Sample:
    """scipy's `curve_fit` of eq. 6 with a delta-method normal of the end of life."""
    zeta, value = (np.array([getattr(m, name) for m in measurements]) for name in ("progress", "value"))

    def law(z: np.ndarray, initial: float, change: float, log_scale: float, log_exponent: float) -> np.ndarray:
        return initial + change * progress_fraction(z, math.exp(log_scale), math.exp(log_exponent))

    start, variance = prior_moments(prior)
    reach = 4.0 * np.sqrt(variance)
    best, covariance = curve_fit(law, zeta, value, p0=start, bounds=(start - reach, start + reach))
    end = float(ends_of(best[None])[0][0])
    slope = np.zeros(4)
    for index, step in enumerate(1e-4 * np.sqrt(variance)):
        moved = best.copy()
        moved[index] += step
        slope[index] = (float(ends_of(moved[None])[0][0]) - end) / step
    spread = slope @ covariance @ slope
    sd = math.sqrt(spread) if math.isfinite(spread) and spread >= 0.0 else CAP
    return np.clip(rng.normal(end, min(sd, CAP), DRAWS), 0.0, CAP), np.full(DRAWS, 1.0 / DRAWS)


def sampled(tracker: Any, state: Any, rng: np.random.Generator) -> Sample:
    posterior = tracker.posterior(state, DRAWS, rng)
    return ends(posterior), posterior.weight


def main() -> None:
    parser = argparse.ArgumentParser(prog="make rivals")
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=2026)
    chosen = parser.parse_args()
    np.random.seed(chosen.seed)  # noqa: NPY002 # progpy draws from the global generator
    crps: dict[str, list[float]] = defaultdict(list)
    update: dict[str, list[float]] = defaultdict(list)
    whole: dict[str, list[float]] = defaultdict(list)
    failed: dict[str, int] = defaultdict(int)

    def scored(name: str, sample: Callable[[], Sample], end: float) -> None:
        begun = time.process_time()
        try:
            found, weight = sample()
        except (ValueError, RuntimeError, np.linalg.LinAlgError):
            failed[name] += 1
            found, weight = np.array([CAP]), np.ones(1)
        whole[name].append(time.process_time() - begun)
        crps[name].append(crps_of_sample(np.nan_to_num(found, nan=CAP), weight, end) / end)

    for life, rng in typical(max(4, round(40 * chosen.size)), chosen.seed):
        measurements = life.measured(0.8, 25, rng)
        prior = weak(measurements[0], falling=True)
        gap = measurements[1].progress
        ours = {tracker.name: (tracker, tracker.start(prior)) for tracker in (Grid(), Particle(), Ukf())}
        theirs = {
            "filterpy `UnscentedKalmanFilter`": PlainUkf(prior, life.scatter),
            "progpy `UnscentedKalmanFilter`": Progpy("UnscentedKalmanFilter", prior, life.scatter, gap),
            "progpy `ParticleFilter`": Progpy("ParticleFilter", prior, life.scatter, gap),
        }
        for index, measurement in enumerate(measurements):
            for name, (tracker, state) in ours.items():
                begun = time.process_time()
                ours[name] = (tracker, tracker.update(state, measurement, rng))  # type: ignore[arg-type]
                update[f"`{name}`"].append(time.process_time() - begun)
            for name, rival in theirs.items():
                begun = time.process_time()
                try:
                    rival.update(measurement, index)
                except (ValueError, np.linalg.LinAlgError):
                    failed[name] += 1
                update[name].append(time.process_time() - begun)
            if index + 1 not in [round(stage * 30) + 1 for stage in STAGES[1:]]:
                continue
            for name, (tracker, state) in ours.items():
                scored(f"`{name}`", partial(sampled, tracker, state, rng), life.end)
            for name, rival in theirs.items():
                scored(name, partial(rival.sample, rng), life.end)
            fit = partial(fitted, measurements[: index + 1], prior, rng)
            scored("scipy `curve_fit`, delta method", fit, life.end)
    base = float(np.mean(crps["`grid`"]))
    print(f"seed {chosen.seed}, {len(crps['`grid`']) // 3} lives like the reference's at 40, 60 and 80 % of life\n")
    print("| method | CRPS, mean, lives | over `grid` | median over `grid` | update, ms | distribution, ms | failed |")
    print("|---|---|---|---|---|---|---|")
    middle = float(np.median(crps["`grid`"]))
    for name, column in crps.items():
        taken = f"{1e3 * np.median(update[name]):.2f}" if name in update else "-"
        print(
            f"| {name} | {np.mean(column):.3f} | {np.mean(column) / base:.2f} | {np.median(column) / middle:.2f} | {taken} "
            f"| {1e3 * np.median(whole[name]):.1f} | {failed[name]} |"
        )


if __name__ == "__main__":
    main()
