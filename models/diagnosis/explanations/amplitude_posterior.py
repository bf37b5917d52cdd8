"""The amplitudes of effects whose shapes and templates' errors act in proportion to them,

    change = a φ + (a/a_f) Σ_k c_k φ_k,     c_k ~ N(0, sd_k²) a shape's or an error's, a_f the fitted amplitude

Given the amplitudes the c are normal. Along an amplitude the density is that of the likeliest c there, with I, s the
information and the score of (a, c) at the fit, δ = a - a_f and r = a/a_f:

    ln p(a) = s_a δ - I_aa δ²/2 + max_c (r (s_c - I_ca δ)ᵀ c - r² cᵀ I_cc c/2 - Σ c²/(2 sd²))

Were all jointly normal, an effect might vanish, or turn its sign, while its shapes' part explains the data; integrated over
the c instead, an effect with many that are determined is pulled towards nothing (docs/appendix/diagnosis.md).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.design.design import IntArray
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.gaussian_evidence import independent, log_sum

#: Nodes along an amplitude [-]: over all amplitudes that are likely, and about that of the exact template; deviations that
#: either reaches.
_WIDE, _NEAR, _REACH = 401, 49, 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportional:
    """Normal approximation, at the fit, of the likelihood in all amplitudes, shapes and template errors [m], amplitudes
    first."""

    info: FloatArray  # [m, m], without their priors
    score: FloatArray  # [m] likewise
    sd: FloatArray  # [m] their deviations, infinite for an amplitude and 0 for what is not at work
    of: IntArray  # [m] the place of their effect
    effects: tuple[FittedEffect, ...]

    def log_integral(self) -> float:
        """ln of the integral of likelihood times priors over amplitudes, shapes and errors [nats], divided by √2π for
        each amplitude. Of two amplitudes the second is integrated as if all were jointly normal."""
        return log_sum(self._along(np.full(len(self.effects), np.nan))[1])

    def amplitudes(self, count: int, rng: np.random.Generator) -> Iterator[FloatArray]:
        """Draws of the amplitudes' deviations [e] from the fitted ones: `count` values of each amplitude given the ones
        before it, from equally probable strata, count^e draws in all."""
        open_ = [np.full(len(self.effects), np.nan)]
        for place in range(len(self.effects)):
            further = []
            for condition in open_:
                steps, logs = self._along(condition)
                gone = np.cumsum(np.exp(logs - logs.max()))
                shares = (np.arange(count) + rng.random(count)) / count
                for step in np.interp(shares, (gone - 0.5 * np.diff(gone, prepend=0.0)) / gone[-1], steps).tolist():
                    more = condition.copy()
                    more[place] = step
                    further.append(more)
            open_ = further
        return iter(open_)

    def ratio(self, given: FloatArray) -> FloatArray:
        """Ratio a/a_f [m] of each parameter's effect, a the fitted amplitude a_f plus `given`; 1 for the amplitudes
        themselves and where `given` is NaN (not known)."""
        fitted = np.array([effect.amplitude for effect in self.effects])
        return np.where(np.isinf(self.sd), 1.0, np.where(np.isnan(given), 1.0, 1.0 + given / fitted)[self.of])

    def normal(self, given: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Conditional mean [m] and root [m, m] of the covariance of all parameters, given the deviations of the
        amplitudes from the fitted ones."""
        info, score = self._beside(given)
        mean, root = np.zeros(score.size), np.zeros(info.shape)
        mean[np.isinf(self.sd)] = given
        finite = np.flatnonzero(np.isfinite(self.sd) & (self.sd > 0))
        sd = self.sd[finite]
        values, vectors = independent(sd[:, None] * info[np.ix_(finite, finite)] * sd)
        root[np.ix_(finite, finite)] = sd[:, None] * vectors / np.sqrt(1.0 + values)
        mean[finite] = root[np.ix_(finite, finite)] @ root[np.ix_(finite, finite)].T @ score[finite]
        return mean, root

    def _beside(self, given: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Information [m, m] and score [m] of all parameters, given the deviations of the amplitudes from the fitted
        ones (NaN: not known)."""
        ratio, step = self.ratio(given), np.zeros(self.sd.size)
        step[np.isinf(self.sd)] = np.nan_to_num(given)
        return self.info * ratio[:, None] * ratio, (self.score - self.info @ step) * ratio

    def _along(self, given: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deviations [n] of the first amplitude that is not `given`, as nodes of a quadrature, and the log of the
        integral's part at each node [n] [nats]."""
        place = int(np.flatnonzero(np.isnan(given))[0])
        info, score = self._beside(given)
        at_work = self.sd > 0
        at_work[np.flatnonzero(np.isinf(self.sd))[~np.isnan(given)]] = False
        of_place, elsewhere = np.flatnonzero(at_work & (self.of == place)), np.flatnonzero(at_work & (self.of != place))
        known = info[np.ix_(elsewhere, elsewhere)] + np.diag(self.sd[elsewhere] ** -2.0)
        known[np.diag_indices(elsewhere.size)] *= 1.0 + 1e-12  # two that are one have no inverse
        absorbed = np.linalg.solve(known, np.column_stack([info[np.ix_(elsewhere, of_place)], score[elsewhere]]))
        across = info[np.ix_(of_place, elsewhere)]
        information, along = (
            info[np.ix_(of_place, of_place)] - across @ absorbed[:, :-1],
            score[of_place] - across @ absorbed[:, -1],
        )
        beyond = 0.5 * float(score[elsewhere] @ absorbed[:, -1] - np.linalg.slogdet(known)[1])
        beyond -= float(np.log(self.sd[elsewhere][np.isfinite(self.sd[elsewhere])]).sum())
        steps, logs = _along_amplitude(information, along, self.sd[of_place[1:]], self.effects[place])
        return steps, logs + beyond


def _quadrature_nodes(middle: FloatArray, precision: FloatArray, bounds: tuple[float, float]) -> FloatArray:
    """Nodes [n], ascending within the bounds, that cover two normal densities of these means and precisions [2], closer
    about the second one and inwards of a bound beyond which a mean lies."""
    low, high = middle - _REACH * precision**-0.5, middle + _REACH * precision**-0.5
    steps = np.unique([*np.linspace(low.min(), high.max(), _WIDE), *np.linspace(low[1], high[1], _NEAR)])
    for bound, inwards in zip(bounds, (1.0, -1.0), strict=True):
        falls = inwards * precision * (bound - middle)  # how fast both densities fall off inwards
        if np.isfinite(bound) and (falls.max() > 0.0 or steps[0] < bound < steps[-1]):
            ends = inwards * _REACH / np.maximum(falls, np.sqrt(precision)) * np.linspace(0.0, 1.0, _NEAR)[1:, None]
            steps = np.concatenate([steps, [bound], (bound + ends[:, falls > 0.0]).ravel()])
    return np.unique(steps[(steps >= bounds[0]) & (steps <= bounds[1])])


def _along_amplitude(
    info: FloatArray, score: FloatArray, sd: FloatArray, fitted: FittedEffect
) -> tuple[FloatArray, FloatArray]:
    """Deviations [n] from the fitted amplitude, as nodes of a quadrature, and the log of the integral's part at each
    node [n] [nats]; info and score are those of (a, c), sd > 0 those of c."""
    values, vectors = independent(sd[:, None] * info[1:, 1:] * sd)
    fixed, sloped = vectors.T @ (sd * score[1:]), vectors.T @ (sd * info[1:, 0])
    # a jointly normal (a, c), and the exact template beside it; rounding aside no less than the amplitude's own prior
    left = np.array([info[0, 0] - (sloped**2 / (1 + values)).sum(), info[0, 0]])
    left = np.maximum(left, fitted.effect.amplitude_precision(fitted.amplitude))
    middle = (score[0] - np.array([(sloped * fixed / (1 + values)).sum(), 0.0])) / left
    bounds = fitted.effect.lowest - fitted.amplitude, fitted.effect.highest - fitted.amplitude
    steps = _quadrature_nodes(middle, left, bounds)
    squared = np.square(1.0 + steps / fitted.amplitude)[:, None]
    gain = squared * np.square(fixed - sloped * steps[:, None]) / (1 + squared * values) - np.log1p(values)
    logs = score[0] * steps - 0.5 * info[0, 0] * np.square(steps) + 0.5 * gain.sum(axis=1)
    return steps, np.asarray(logs + np.log(np.gradient(steps)) - 0.5 * np.log(2 * np.pi))
