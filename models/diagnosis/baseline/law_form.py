"""How a friction law may differ from eq. 3: smooth functions over speed, pressure and life, as a sum of cosines.

    δ(v, p, ζ) = h(x) + q(p) h'(x) + z h''(x) + f(p) + g(z),     x = ln v or ln v/V_S(p, ζ),  z = √(share of the life)

    h(x) = (v_max/v)^0.2 Σ_k c_k √2 cos(kπ u),   u = (x - x_min)/(x_max - x_min),   c_k ~ N(0, τ_h² w_k),
    w_k ∝ e^{-½ (kπ ℓ/(x_max - x_min))²},   Σ w_k = 1

the covariance of the coefficients being that of a squared-exponential process of length ℓ. So τ_h is the relative rms of the
form at the highest speed. Where the fall e^{-V_S/v} has another form, that moves along the speed as V_S does over pressure
and life; where so many rpm have another torque, it does not. Beyond what was measured the value at the end is kept.

Source: M. C. Kennedy and A. O'Hagan, Bayesian calibration of computer models, J. R. Stat. Soc. B 63 (2001) 425-464; lengths
and the envelope are those of measured friction curves (docs/appendix/diagnosis.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray, Same

#: Waves over speed, the fewer that change with pressure and with life, waves over pressure and over life, at most. Of the
#: highest the weight is below 1e-4 on ranges up to six in ln v.
_SPEEDS, _CHANGING, _PRESSURES, _LIVES = 16, 8, 5, 4
#: Waves over pressure with which the form over speed changes, at most.
_CHANGING_PRESSURES = 2
#: Correlation lengths: in ln v (of 15 measured surfaces .36 to .71), and as shares of the range of pressures and of √life.
_LENGTH, _LAW_LENGTH = 0.4, 0.2
#: The waves over pressure reach so far beyond the range of pressures, a share of it: within it they may have any slope at
#: its ends, which an offset of the pressure shows.
MARGIN = 0.25
#: (v_max/v) to this power: what measured curves do otherwise is 1.5 to 4 times as large at the lowest speeds.
_ENVELOPE = 0.2
#: How far the form over speed changes with pressure and with life, a share of the form: measured curves' misfits at the
#: lowest and the highest pressure correlate by .63 to 1.
_CHANGES = 0.5


#: Nodes of tables along ln v, pressure and √life.
_NODES = np.linspace(0.0, 1.0, 401)


class LawSizes(NamedTuple):
    """Relative deviations τ [-] of the law: of its form over speed, over pressure and over life."""

    form: float
    pressure: float
    life: float


#: Eq. 3 and its laws as they are.
EXACT = LawSizes(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LawForm:
    """The cosine functions whose sum is δ, on the ranges that a campaign measured."""

    slowest: float  # [m/s], as the next at the V_S of the middle pressure and the first state
    fastest: float
    lowest: float  # [Pa]
    highest: float
    first: float  # state [cycles]
    last: float
    pressures: int  # distinct ones
    states: int
    # ln of the Stribeck velocity with which the form moves along the speed, over that of the middle pressure at the first
    # state: at nodes over the places of pressure, and over those of √life
    moved_by_pressure: tuple[float, ...] = (0.0,)
    moved_by_life: tuple[float, ...] = (0.0,)

    def deviations(self, sizes: LawSizes) -> FloatArray:
        """The prior deviations [k] of the coefficients [-]."""
        changing = (_CHANGING + 1) * (min(self._of_pressure, _CHANGING_PRESSURES) + min(self._of_life, 1))
        return np.repeat(np.array(sizes), (_SPEEDS + 1 + changing, self._of_pressure, self._of_life))

    def shares(self, velocity: FloatArray, pressure: FloatArray, cycles: FloatArray) -> FloatArray:
        """∂δ/∂coefficient [n, k] at velocity [n] m/s, pressure [n] Pa and cycles [n]."""
        moved, high, gone = self._places(Same(pressure), Same(cycles))
        form = self._form(self._speed_position(velocity, moved))
        over_pressure = _waves(high, self._of_pressure, _LAW_LENGTH)[:, 1:]
        over_life = _waves(gone, self._of_life, _LAW_LENGTH)[:, 1:]
        changing = form[:, : _CHANGING + 1]
        factors = [*self._pressure_factors(high), *([_CHANGES * gone] if self._of_life else [])]
        blocks = [form, *(changing * factor[:, None] for factor in factors)]
        return np.concatenate([*blocks, over_pressure, over_life], axis=1)

    def share(
        self, coefficients: FloatArray, velocity: FloatArray, pressure: FloatArray, cycles: FloatArray
    ) -> FloatArray:
        """δ [n] for coefficients [k], by interpolation in tables of the functions of `shares` (error below 0.2 % of the
        highest wave)."""
        return self._share(coefficients.tobytes(), Same(velocity), Same(pressure), Same(cycles))

    @lru_cache(maxsize=8)  # noqa: B019 - as below; effects ask for it at a campaign's own speeds over and over
    def _share(
        self, coefficients: bytes, velocity: Same[FloatArray], pressure: Same[FloatArray], cycles: Same[FloatArray]
    ) -> FloatArray:
        """`share`, with the coefficients as bytes and the arrays compared by identity, so that it can be cached."""
        moved, alone, factors = self._beside_speed(coefficients, pressure, cycles)
        over_speed = _interpolated_columns(self._tables(coefficients)[0], self._speed_position(velocity.value, moved))
        return np.asarray(alone + np.einsum("nk,nk->n", over_speed, factors), dtype=np.float64)

    @lru_cache(maxsize=8)  # noqa: B019 - as below
    def _beside_speed(
        self, coefficients: bytes, pressure: Same[FloatArray], cycles: Same[FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Parts of δ that pressure and cycles alone determine: the factor [n] by which velocity is scaled (V_S moves),
        f + g [n], and the multipliers [n, m] of the functions of speed: 1 for h, waves over pressure for h', life for
        h''."""
        moved, high, gone = self._places(pressure, cycles)
        _, over_pressure, over_life = self._tables(coefficients)
        of_pressure = _interpolated_columns(over_pressure, high)
        by_life = [_CHANGES * gone] if self._of_life else []
        factors = np.stack([np.ones_like(gone), *of_pressure[:, 1:].T, *by_life], axis=1)
        return moved, of_pressure[:, 0] + _interpolated(gone, over_life), factors

    @lru_cache(maxsize=8)  # noqa: B019 - the few points of a campaign, at which effects are tried over and over
    def _places(
        self, pressure: Same[FloatArray], cycles: Same[FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The factor [n] by which velocity is scaled (V_S moves), and positions [n] within 0 ... 1 along pressure and
        along √life."""
        high = (pressure.value - self.lowest) / max(self.highest - self.lowest, 1e-300)
        high = np.clip((high + MARGIN) / (1.0 + 2.0 * MARGIN), 0.0, 1.0)
        gone = np.sqrt(np.clip((cycles.value - self.first) / max(self.last - self.first, 1.0), 0.0, 1.0))
        return (
            np.exp(-_interpolated(high, self.moved_by_pressure) - _interpolated(gone, self.moved_by_life)),
            high,
            gone,
        )

    def _speed_position(self, velocity: FloatArray, moved: FloatArray) -> FloatArray:
        """Positions [n] of velocities [n] m/s along ln v: 0 at the slowest, 1 at the fastest that was measured, after
        scaling by `moved` [n], with which the form follows V_S."""
        return np.log(np.clip(velocity * moved, self.slowest, self.fastest) / self.slowest) / self._width

    def _form(self, speed: FloatArray) -> FloatArray:
        """Waves [n, 1 + _SPEEDS] of h over speed, with the envelope."""
        envelope = np.exp(_ENVELOPE * self._width * (1.0 - speed))
        return _waves(speed, _SPEEDS, _LENGTH / self._width) * envelope[:, None]

    def _pressure_factors(self, high: FloatArray) -> FloatArray:
        """Waves over pressure [m, n] by which the form over speed changes."""
        return np.asarray(_CHANGES * _waves(high, self._of_pressure, _LAW_LENGTH)[:, 1 : 1 + _CHANGING_PRESSURES].T)

    @property
    def _width(self) -> float:
        """Width of the range of ln v."""
        return max(float(np.log(self.fastest / self.slowest)), 1e-3)

    @lru_cache(maxsize=8)  # noqa: B019 - a few forms, and small tables
    def _tables(self, coefficients: bytes) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Tables of δ's functions at the nodes: over speed h and its changes with each wave over pressure and with
        life; over pressure f and those waves; over life g."""
        known = np.frombuffer(coefficients)
        form, at = self._form(_NODES), _SPEEDS + 1
        over_speed = [form @ known[:at]]
        for _ in range(min(self._of_pressure, _CHANGING_PRESSURES) + min(self._of_life, 1)):
            over_speed.append(form[:, : _CHANGING + 1] @ known[at : at + _CHANGING + 1])
            at += _CHANGING + 1
        over_pressure = _waves(_NODES, self._of_pressure, _LAW_LENGTH)[:, 1:] @ known[at : at + self._of_pressure]
        over_life = _waves(_NODES, self._of_life, _LAW_LENGTH)[:, 1:] @ known[at + self._of_pressure :]
        with_pressure = [over_pressure, *self._pressure_factors(_NODES)]
        return np.stack(over_speed, axis=1), np.stack(with_pressure, axis=1), over_life

    @property
    def _of_pressure(self) -> int:
        """Number of waves over pressure."""
        return min(self.pressures - 1, _PRESSURES)

    @property
    def _of_life(self) -> int:
        """Number of waves over life."""
        return min(self.states - 1, _LIVES)


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedLaw:
    """The posterior mean of the law's discrepancy δ in a campaign."""

    form: LawForm
    coefficients: FloatArray  # [k]

    def share(self, velocity: FloatArray, pressure: FloatArray, cycles: FloatArray) -> FloatArray:
        """δ [n] at velocity [n] m/s, pressure [n] Pa and cycles [n]."""
        return self.form.share(self.coefficients, velocity, pressure, cycles)


def _interpolated_columns(table: FloatArray, unit: FloatArray) -> FloatArray:
    """Columns [n, m] of a table at positions within 0 ... 1, by linear interpolation between its nodes."""
    place = unit * (_NODES.size - 1)
    before = np.minimum(place.astype(np.intp), _NODES.size - 2)
    left = (place - before)[:, None]
    return np.asarray(table[before] * (1.0 - left) + table[before + 1] * left)


def _interpolated(unit: FloatArray, nodes: Sequence[float] | FloatArray) -> FloatArray:
    """Linear interpolation [n], at positions within 0 ... 1, of values at evenly spaced nodes over 0 ... 1."""
    return np.interp(unit, np.linspace(0.0, 1.0, len(nodes)), nodes)


def _waves(unit: FloatArray, orders: int, length: float) -> FloatArray:
    """Cosines [n, 1 + orders] over 0 ... 1, scaled by the standard deviations that a squared-exponential covariance of
    a length gives their coefficients; the variances sum to one."""
    order: NDArray[np.int64] = np.arange(orders + 1)
    weight = np.exp(-0.5 * (np.pi * order * length) ** 2) * np.where(order > 0, 1.0, 0.5)
    scale = np.sqrt(weight / weight.sum() * np.where(order > 0, 2.0, 1.0))
    return np.asarray(np.cos(np.pi * unit[:, None] * order) * scale, dtype=np.float64)
