"""Other packages, each given eq. 6, the prior that our filters start from, and the scatter, which ours must find out."""

import math
from typing import Any, ClassVar

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from progpy import PrognosticsModel, state_estimators
from progpy.predictors import MonteCarlo
from progpy.uncertain_data import MultivariateNormalDist
from scipy.optimize import curve_fit
from surpyval import DegradationAnalysis
from surpyval.degradation import PathModel

from models.degradation.general_order import DegradationLaw, first_passage, progress_fraction
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior
from tests.statistical.lives import CAP

Sample = tuple[np.ndarray, np.ndarray]
DRAWS = 1_000
NAMES = ("initial", "change", "log_scale", "log_exponent")
#: How many inspections ahead progpy simulates, five lives; what has not come to its end by then counts as never.
AHEAD = 300


def ends_of(coefficients: np.ndarray) -> Sample:
    """End of life, equally weighted, of rows of (ξ0, Δ, log φ, log ε)."""
    initial, change, log_scale, log_exponent = np.clip(coefficients, -50.0, 50.0).T
    law = DegradationLaw(initial=initial, change=change, scale=np.exp(log_scale), exponent=np.exp(log_exponent))
    found = np.where(initial <= 0.0, 0.0, first_passage(0.5 * initial, law))
    return np.minimum(found, CAP), np.full(initial.size, 1.0 / initial.size)


def prior_moments(prior: TrackPrior) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of (ξ0, Δ, log φ, log ε)."""
    mean = np.array([prior.initial_mean, prior.change_mean, prior.log_scale_mean, prior.log_exponent_mean])
    return mean, np.array([prior.initial_sd, prior.change_sd, prior.log_scale_sd, prior.log_exponent_sd]) ** 2


class PlainUkf:
    """filterpy's unscented Kalman filter in (ξ0, Δ, log φ, log ε), started at the prior."""

    def __init__(self, prior: TrackPrior, scatter: float) -> None:
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


class Law(PrognosticsModel):
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

    def __init__(self, kind: str, prior: TrackPrior, scatter: float, gap: float) -> None:
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
        """Ends by our closed form: of no use to progpy itself, but exact where its own simulation is cut off."""
        drawn = self.filter.x.sample(DRAWS)
        return ends_of(np.array([[float(each[name]) for name in NAMES] for each in drawn]))

    def simulated(self) -> np.ndarray:
        """The ends of as many draws, in inspections from now on, the way progpy itself predicts: every one simulated
        inspection by inspection."""
        self.model.parameters["process_noise"] = dict.fromkeys([*NAMES, "progress"], 0.0)
        found = MonteCarlo(self.model).predict(self.filter.x, n_samples=DRAWS, dt=1.0, horizon=float(AHEAD))
        return np.array([AHEAD if each["end"] is None else each["end"] for each in found.time_of_event], dtype=float)


class Path(PathModel):
    """Eq. 6 as a path of surpyval."""

    name = "Eq. 6"
    parameter_names: ClassVar[list[str]] = list(NAMES)

    def path(self, x: Any, *params: float) -> np.ndarray:
        initial, change, log_scale, log_exponent = np.clip(params, -50.0, 50.0)
        share = progress_fraction(np.asarray(x, dtype=float), np.exp(log_scale), np.exp(log_exponent))
        return np.asarray(initial + change * share)

    def inv_path(self, y: Any, *params: Any) -> np.ndarray:
        initial, change, log_scale, log_exponent = np.clip(np.array(params), -50.0, 50.0)
        law = DegradationLaw(initial=initial, change=change, scale=np.exp(log_scale), exponent=np.exp(log_exponent))
        return np.asarray(first_passage(y, law))

    def _initial_guess(self, x: np.ndarray, y: np.ndarray) -> list[float]:
        return [float(y[0]), float(1.5 * (y[-1] - y[0])), math.log(float(x.max())), 0.0]


class Surpyval:
    """surpyval's update of one unit from a population (a normal at the mode, linearised), our prior as the population.

    Its threshold is one for all draws; ours is half of each draw's ξ0, so the ends of its normal's draws are found by our
    closed form, as progpy's are.
    """

    def __init__(self, prior: TrackPrior, scatter: float) -> None:
        path, x = Path(), np.linspace(0.0, 1e4, 12)
        rng = np.random.default_rng(0)
        fleet = np.array([0.13, -0.09, 8.0, 0.0]) + np.array([0.01, 0.01, 0.3, 0.3]) * rng.standard_normal((12, 4))
        y = np.concatenate([path.path(x, *each) for each in fleet]) + 1e-6 * rng.standard_normal(144)
        threshold, units = 0.5 * prior.initial_mean, np.repeat(np.arange(12), 12)
        self.model = DegradationAnalysis.fit(np.tile(x, 12), y, units, threshold=threshold, path=path)
        self.model.path_param_mean, variance = prior_moments(prior)
        self.model.path_param_cov, self.model.measurement_var = np.diag(variance), scatter**2

    def sample(self, measurements: list[Measurement], rng: np.random.Generator) -> Sample:
        zeta, value = ([getattr(m, name) for m in measurements] for name in ("progress", "value"))
        found = self.model.predict_rul(zeta, value, n_samples=DRAWS, random_state=rng)
        return ends_of(rng.multivariate_normal(found.posterior_mean, found.posterior_cov, DRAWS, check_valid="ignore"))


def fitted(measurements: list[Measurement], prior: TrackPrior, rng: np.random.Generator) -> Sample:
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
