"""Torque that swings with the shaft's angle; it is in raw records and averages out of plateaus."""

from models.diagnosis.effects.effect import Effect, Family, Kind, unchanged, untried

EFFECT = Effect(
    slug="shaft_ripple",
    title="Torque swings with the shaft's turns",
    physics="Misalignment, run-out or a coupling: torque swings once or a few times a turn, at a frequency that follows "
    "the speed.",
    formula="a cos(k ∫ω dt + φ), k = 1, 2, ...",
    source="order analysis of rotating machinery",
    family=Family.VIBRATION,
    kind=Kind.VIBRATION,
    channels=("time_s",),
    amplitude="amplitude of the ripple",
    unit="Nm",
    prior_sd=0.5,
    positive=True,
    scale=1.0,
    shapes=(),
    grid=untried,
    change=unchanged,
    before_lag=False,
    discrepancies=(),
)
