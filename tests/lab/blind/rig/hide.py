"""A campaign with something hidden in it, drawn from a seed: plan, clutch, sensor, effects at a loudness, readings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from tests.lab.blind.rig.clutch import Clutch, draw_clutch
from tests.lab.blind.rig.loudness import UnreachableError, listen
from tests.lab.blind.rig.makers import ALL
from tests.lab.blind.rig.plan import Plan, Wish, draw_plan
from tests.lab.blind.rig.sensor import Sensor, draw_sensor, measure
from tests.lab.blind.rig.world import Effect, read

#: So many campaigns are drawn before an effect is said to be never as loud as it should be.
DRAWS = 8


@dataclass(frozen=True)
class Hidden:
    """What was measured [a site each], and the secret: the effects with their amplitudes. `seed` makes it again."""

    seed: tuple[int, ...]
    plan: Plan
    clutch: Clutch
    sensor: Sensor
    effects: tuple[tuple[Effect, float], ...]
    measured: list[FloatArray]

    @property
    def slugs(self) -> frozenset[str]:
        return frozenset(effect.slug for effect, _ in self.effects)


def hide(seed: Sequence[int], slugs: Sequence[str] = (), lam: float = 0.0, **wanted: object) -> Hidden:
    """Hide effects by slug, each at loudness `lam` [nats] by itself; `wanted` overrides what they need of the protocol. Same
    seed, same data.

    Campaigns in which an effect cannot be as loud as that are drawn anew; raises UnreachableError after `DRAWS`.
    """
    needed = {name: value for slug in slugs for name, value in ALL[slug][1].items()}
    wish = Wish(**(needed | wanted))
    for attempt in range(DRAWS):
        rng = np.random.default_rng([*seed, attempt])
        plan = draw_plan(rng, wish)
        clutch = draw_clutch(rng, plan.pressures, plan.life.span)
        sensor = draw_sensor(rng, wish.noise)
        made = [ALL[slug][0](rng, plan) for slug in slugs]
        try:
            ear = listen(plan, clutch, sensor) if slugs else None
            effects = tuple((one, ear.amplitude_for(one, lam)) for one in made)
        except UnreachableError as error:
            failure = error
        else:
            truth = read(plan, clutch, effects)
            return Hidden(tuple(seed), plan, clutch, sensor, effects, measure(rng, plan, sensor, truth))
    raise failure
