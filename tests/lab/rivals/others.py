"""Other packages, each given eq. 6, the prior that our filters start from, and the scatter, which ours must find out."""

import math
from typing import Any, ClassVar

import numpy as np
from progpy import PrognosticsModel, state_estimators
from progpy.predictors import MonteCarlo
from progpy.uncertain_data import MultivariateNormalDist
from surpyval import DegradationAnalysis
from surpyval.degradation import PathModel

from models.degradation.general_order import DegradationLaw, first_passage, progress_fraction
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior
from tests.lab.rivals.plain import DRAWS, FIRST, Sample, ends_of, mode_of, prior_moments

NAMES = ("initial", "change", "log_scale", "log_exponent")
#: How many inspections ahead progpy simulates, five lives; what has not come to its end by then counts as never.
AHEAD = 300


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
    """NASA's progpy, started at the mode of the first inspections: its unscented Kalman filter, or its particle filter with
    a hundredth of the prior's deviations as process noise, without which it keeps a single particle."""

    def __init__(self, kind: str, prior: TrackPrior, scatter: float, gap: float, rng: np.random.Generator) -> None:
        self.kind, self.prior, self.scatter, self.rng = kind, prior, scatter, rng
        self.model = Law(gap=gap, process_noise=0.0, measurement_noise=scatter)
        self.first: list[Measurement] = []

    def _start(self) -> None:
        (mean, covariance), sd = (
            mode_of(self.first, self.prior, self.scatter, self.rng),
            prior_moments(self.prior)[1][:4],
        )
        whole = np.diag([0.0] * 4 + [1e-6])
        whole[:4, :4] = covariance
        start = MultivariateNormalDist([*NAMES, "progress"], [*mean.tolist(), self.first[-1].progress], whole)
        if self.kind == "UnscentedKalmanFilter":
            noise = np.diag([*(1e-9 * sd**2).tolist(), 1e-9])
            self.filter = state_estimators.UnscentedKalmanFilter(
                self.model, start, Q=noise, R=np.array([[self.scatter**2]])
            )
        else:
            self.model.parameters["process_noise"] = dict(
                zip([*NAMES, "progress"], [*(0.01 * sd).tolist(), 0.0], strict=True)
            )
            self.filter = state_estimators.ParticleFilter(
                self.model, start, num_particles=DRAWS, measurement_noise={"value": self.scatter}
            )
        self.filter.t = FIRST - 1.0

    def update(self, measurement: Measurement, index: int) -> None:
        if index < FIRST:
            self.first.append(measurement)
            if len(self.first) == FIRST:
                self._start()
            return
        found = self.model.OutputContainer({"value": measurement.value})
        self.filter.estimate(float(index), self.model.InputContainer({}), found, dt=1.0)

    def sample(self, rng: np.random.Generator) -> Sample:  # noqa: ARG002
        """Ends by our closed form: of no use to progpy itself, but exact where its own simulation is cut off."""
        drawn = self.filter.x.sample(DRAWS)
        ends = ends_of(np.array([[float(each[name]) for name in NAMES] for each in drawn]))
        return ends, np.full(ends.size, 1.0 / ends.size)

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
        mean, sd = (moment[:4] for moment in prior_moments(prior))
        self.model.path_param_mean = mean
        self.model.path_param_cov, self.model.measurement_var = np.diag(sd**2), scatter**2

    def sample(self, measurements: list[Measurement], rng: np.random.Generator) -> Sample:
        zeta, value = ([getattr(m, name) for m in measurements] for name in ("progress", "value"))
        found = self.model.predict_rul(zeta, value, n_samples=DRAWS, random_state=rng)
        drawn = rng.multivariate_normal(found.posterior_mean, found.posterior_cov, DRAWS, check_valid="ignore")
        return ends_of(drawn), np.full(DRAWS, 1.0 / DRAWS)
