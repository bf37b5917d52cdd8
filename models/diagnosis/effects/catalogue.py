"""The catalogue: every effect that the diagnosis can name, in the contract's order, and the shape grids of all effects as
columns: the change of torque of a small amplitude, for every shape that is tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import Design
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Effect, Shape, with_onset
from models.diagnosis.effects.history import ACCELERATED_WEAR, LOAD_SEVERITY, OIL_CHANGE, REST_RECOVERY, RUNNING_IN
from models.diagnosis.effects.moving import INERTIA_TORQUE, SHAFT_RIPPLE, SQUEEZE_FILM, STICK_SLIP
from models.diagnosis.effects.readings import CHANNEL_DELAY, PRESSURE_OFFSET, TORQUE_ZERO_SHIFT, UNSETTLED_DWELL
from models.diagnosis.effects.thermal import HYDRODYNAMIC_DRAG, INTERFACE_HEATING, OIL_TEMPERATURE, VISCOUS_EXPONENT

CATALOGUE: tuple[Effect, ...] = (
    with_onset(OIL_TEMPERATURE),
    with_onset(INTERFACE_HEATING),
    with_onset(HYDRODYNAMIC_DRAG),
    TORQUE_ZERO_SHIFT,
    PRESSURE_OFFSET,
    with_onset(UNSETTLED_DWELL),
    with_onset(CHANNEL_DELAY),
    with_onset(INERTIA_TORQUE),
    with_onset(SQUEEZE_FILM),
    SHAFT_RIPPLE,
    STICK_SLIP,
    RUNNING_IN,
    OIL_CHANGE,
    ACCELERATED_WEAR,
    LOAD_SEVERITY,
    REST_RECOVERY,
)

#: No causes any more, for nothing tells them from the form of the friction curve; reports that are stored name them.
RETIRED: tuple[Effect, ...] = (with_onset(VISCOUS_EXPONENT),)

BY_SLUG = {effect.slug: effect for effect in (*CATALOGUE, *RETIRED)}


def effects_for(facts: Facts, without: frozenset[str] = frozenset()) -> list[Effect]:
    """The catalogue's effects with priors for this campaign's clutch; effects whose slugs are in `without` are left
    out."""
    return [effect.sized(facts) for effect in CATALOGUE if effect.slug not in without]


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One point of an effect's shape grid, with its log prior weight."""

    effect: Effect
    shape: Shape
    log_weight: float  # its prior weight, normalised over the effect's grid
    log_weight_around: float  # that of all points that differ from it in smooth shapes only


def columns_of(effects: Sequence[Effect], facts: Facts) -> list[Column]:
    """The points of all effects' shape grids, concatenated."""
    columns = []
    for effect in effects:
        grid = effect.grid(facts)
        if grid:
            total = float(logsumexp([tried.log_weight for tried in grid]))
            kinds: dict[Shape, list[float]] = {}
            for tried in grid:
                kinds.setdefault(effect.stiff(tried.shape), []).append(tried.log_weight - total)
            around = {kind: float(logsumexp(logs)) for kind, logs in kinds.items()}
            columns += [
                Column(
                    effect=effect,
                    shape=tried.shape,
                    log_weight=tried.log_weight - total,
                    log_weight_around=around[effect.stiff(tried.shape)],
                )
                for tried in grid
            ]
    return columns


def columns_at_rows(design: Design, prediction: Prediction, columns: Sequence[Column]) -> FloatArray:
    """Changes of torque [N, m] Nm at the rows, per unit of a small amplitude, one column for each grid point. After its
    onset a change equals one that was there from the start: no lag goes from one test to the next."""
    starts: dict[tuple[str, Shape], tuple[int, Effect]] = {}
    places = [
        starts.setdefault((c.effect.slug, c.effect.from_the_start(c.shape)), (len(starts), c.effect))[0]
        for c in columns
    ]
    changes = list[tuple[FloatArray, bool]]()
    for _, alike in groupby(starts.items(), key=lambda start: start[0][0]):
        group = [(effect, shape) for (_, shape), (_, effect) in alike]
        unit = group[0][0].unit_changes(prediction.scene, [shape for _, shape in group])
        changes += [(unit[:, i], effect.lags(shape)) for i, (effect, shape) in enumerate(group)]
    onsets = np.array([column.effect.onset(column.shape) for column in columns])
    at_rows = change_columns(design, prediction, changes)[:, places]
    return np.where(design.rows.cycles[:, None] > onsets, at_rows, 0.0)


def change_columns(design: Design, prediction: Prediction, changes: list[tuple[FloatArray, bool]]) -> FloatArray:
    """Changes of torque [N, m] Nm at the rows, from changes [P] Nm at the points, each with whether it comes before the
    loops' lag."""
    out = np.zeros((design.torque.size, len(changes)))
    for before in (True, False):
        chosen = [i for i, (_, flag) in enumerate(changes) if flag is before]
        if chosen:
            stacked = np.stack([changes[i][0] for i in chosen], axis=1)
            out[:, chosen] = prediction.change_at_rows(design, stacked, before_lag=before)
    return out
