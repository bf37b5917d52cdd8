"""`make oracle`: of the campaigns in which a diagnosis fell short, how many an oracle could have named.

SEED=, SIZE=, ONLY= as for `make blind`, whose stored outcomes are read     PROCESSES= how many at once (2)

The oracle knows the clutch, the sensor and the forms from which the rig draws. It asks how much of the hidden change no
other cause can imitate: over every rival of the catalogue, `FORMS` drawn forms each, its amplitude and the refitted baseline

    m = min over rivals r, amplitudes a, θ of  ½ ‖W (Δ - Δ_r(a) - (f(θ) - f(θ₀)))‖² + ½ Σ ((θ - θ₀)/s)²   [nats]

The log likelihood of the truth exceeds that of the best rival by m on average, with deviation √(2m). Below `BLIND` nobody
can name the cause with 95 %; above `CLEAR` noise hides it in 1 of 300 campaigns. Causes that swing from sample to sample
are not asked about: no baseline takes anything of them up.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from models.arrays import FloatArray
from tests.lab.blind.rig.hide import Hidden
from tests.lab.blind.rig.loudness import Ear, listen
from tests.lab.blind.rig.makers import CATALOGUED
from tests.lab.blind.rig.refit import Refitted
from tests.lab.blind.rig.world import Effect
from tests.lab.blind.rows import asked_for
from tests.lab.blind.trials import Outcome, stored
from tests.lab.measuring import Asked, each, publish, table, where

#: Drawn forms of every rival, and how many rivals are refitted beyond the linear prediction.
FORMS, REFITTED = 6, 3
#: Bounds of m [nats]: odds of 19 need ln 19 = 2.9; √(m/2) = 2.7 deviations at 15.
BLIND, CLEAR = 3.0, 15.0
#: A rival's direction is taken at this share of its ordinary amplitude.
SMALL = 0.1


@dataclass(frozen=True)
class Seen:
    """An outcome and m [nats] with the rival that comes nearest."""

    outcome: Outcome
    left: float
    rival: str


def falls_short(one: Outcome) -> bool:
    """Whether the table of `make blind` counts it against the diagnosis."""
    if len(one.truth) != 1 or not one.made or one.truth & {"stick_slip", "shaft_ripple"}:
        return False
    if one.trial.without:
        return one.named
    return one.wrong or (one.trial.lam >= 80 and not one.right)


def look(outcome: Outcome) -> Seen:
    """The oracle's margin in one campaign."""
    hidden = outcome.trial.hidden()
    ((effect, amplitude),) = hidden.effects
    ear = listen(hidden.plan, hidden.clutch, hidden.sensor)
    wanted = ear.changed(effect, amplitude)
    chosen = sorted(_linear(ear, hidden, wanted), key=lambda one: one[0])[:REFITTED]
    alone = ear.refit.lower(wanted, ear.refit.to(wanted)).left
    found = [(alone, "none"), *((_refitted(ear, rival, start, wanted), rival.slug) for _, start, rival in chosen)]
    return Seen(outcome, *min(found))


def _linear(ear: Ear, hidden: Hidden, wanted: FloatArray) -> Iterator[tuple[float, float, Effect]]:
    """Of every rival that helps what is left [nats] and its amplitude, if baseline and rival were linear."""
    rng = np.random.default_rng([*hidden.seed, FORMS])
    basis = np.linalg.qr(ear.refit.jacobian)[0]

    def beyond(change: FloatArray) -> FloatArray:
        """A change less what the baseline takes up, with the prior's rows."""
        rows = np.concatenate([change, np.zeros(len(basis) - len(change))])
        return np.asarray(rows - basis @ (basis.T @ rows))

    target = beyond(wanted)
    for slug in sorted(CATALOGUED.keys() - hidden.slugs):
        for _ in range(FORMS):
            rival = CATALOGUED[slug][0](rng, hidden.plan)
            small = SMALL * rival.unit
            change = None if rival.fast else ear.changed(rival, small)
            if change is None:
                continue
            column = beyond(change)
            overlap, square = float(column @ target), float(column @ column)
            if overlap > 0:
                left = 0.5 * (float(target @ target) - overlap**2 / square)
                yield left, min(small * overlap / square, rival.most), rival


def _refitted(ear: Ear, rival: Effect, start: float, wanted: FloatArray) -> float:
    """What the rival leaves [nats] at its best amplitude, the baseline refitted each time from where it was."""
    last: Refitted | None = None

    def left(amplitude: float) -> float:
        nonlocal last
        change = ear.changed(rival, amplitude)
        if change is None:
            return np.inf
        last = ear.refit.to(wanted - change, last)
        return last.left

    bounds = (start / 4, min(4 * start, rival.most))
    best = minimize_scalar(left, bounds=bounds, method="bounded", options={"xatol": 0.02 * start, "maxiter": 12})
    return float(best.fun)


def document(seen: Sequence[Seen], command: str) -> list[str]:
    """How far the nearest rival is in the campaigns of each kind that fell short."""
    kinds: dict[str, list[Seen]] = {}
    for one in seen:
        kinds.setdefault(_kind(one.outcome), []).append(one)
    rows = []
    for kind, mine in sorted(kinds.items()):
        left = np.array([one.left for one in mine])
        counts = [int(np.sum(left < BLIND)), int(np.sum((left >= BLIND) & (left < CLEAR))), int(np.sum(left >= CLEAR))]
        rivals = ", ".join(f"{name} {count}" for name, count in Counter(one.rival for one in mine).most_common(3))
        rows.append([kind, len(mine), *counts, rivals])
    titles = ["fell short", "campaigns", f"m < {BLIND:g}", f"{BLIND:g} to {CLEAR:g}", f"≥ {CLEAR:g}", "nearest rivals"]
    return [f"`{command}`", "", *table(titles, rows)]


def _kind(one: Outcome) -> str:
    what = (
        "left out and named as something else" if one.trial.without else "named wrongly" if one.wrong else "not named"
    )
    return f"λ = {one.trial.lam:.0f}: {what}"


def main() -> None:
    """Print the table, and with ARGS=--write put it into the appendix."""
    asked = Asked.here()
    outcomes = map(stored, asked_for(asked))
    seen = list(each(look, filter(falls_short, outcomes), where(2)))
    publish("diagnosis.md", "oracle", document(seen, f"make oracle {asked}"))
    for one in seen:
        said = one.outcome
        print(f"{one.left:8.1f} {one.rival:20} {said.trial} -> {said.verdict} {sorted(said.causes)}")


if __name__ == "__main__":
    main()
