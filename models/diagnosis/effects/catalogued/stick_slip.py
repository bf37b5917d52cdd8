"""Self-excited vibration of the driveline at low speed; it is in raw records."""

from models.diagnosis.effects.effect import Effect, Family, Kind, unchanged, untried

EFFECT = Effect(
    slug="stick_slip",
    title="Stick-slip or shudder",
    physics="Where friction falls with speed the driveline vibrates by itself, at its own frequency and at low speed.",
    formula="a cos(2π f t + φ) with f that does not follow the speed",
    source="Ompusunggu et al. 2013, section 3.1.1: positive slope is anti-shudder",
    family=Family.VIBRATION,
    kind=Kind.VIBRATION,
    channels=("time_s",),
    amplitude="amplitude of the vibration",
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
