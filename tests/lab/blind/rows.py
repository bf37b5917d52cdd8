"""The rows of the table: which trials each takes, and what is counted in them against which target."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from tests.lab.blind.rig.makers import CATALOGUED, HISTORY, LAWS, OUTSIDE
from tests.lab.blind.trials import RECORDS, Outcome, Trial, trial
from tests.lab.measuring import Asked

Test = Callable[[Outcome], bool]
LOUDNESSES = (20.0, 50.0, 80.0, 300.0)
#: Noise of the sensor, in percent of the torque.
NOISES = (1.0, 0.3, 0.1)
#: Effects that only loops show.
LOOPS = {"channel_delay", "inertia_torque", "squeeze_film"}
#: So many advised tests are made one after the other, each chosen by the report before it.
MOST_ADVISED = 3
#: Whose error beyond noise an extension has to halve.
HALVED = ("oil_temperature", "oil_change")
#: What a campaign of one to three speeds can show.
FEW_SPEEDS = ("oil_temperature", "torque_zero_shift", "pressure_offset", "accelerated_wear", "oil_change")


@dataclass(frozen=True)
class Count:
    """A counted line of the table: how often `met` among the outcomes that `among` lets in, and the target, at `least` or at
    `most`."""

    title: str
    prefix: str
    met: Test
    least: float | None = None
    most: float | None = None
    among: Test = lambda _: True

    def of(self, outcomes: Iterable[Outcome]) -> tuple[int, int]:
        mine = (one for one in outcomes if one.made and one.trial.row.startswith(self.prefix))
        found = [self.met(one) for one in mine if self.among(one)]
        return sum(found), len(found)

    def holds(self, hits: int, count: int) -> bool | None:
        if count == 0 or (self.least is None and self.most is None):
            return None
        share = hits / count
        return share <= self.most if self.least is None else share >= self.least

    @property
    def target(self) -> str:
        if self.least is not None:
            return f"≥ {100 * self.least:g} %"
        return f"≤ {100 * self.most:g} %" if self.most is not None else ""


def trials(seed: int, size: float = 1.0) -> list[Trial]:
    """All trials of the table; `size` 1 is the whole, smaller takes that share of each row, at least one."""
    made: list[Trial] = []

    def some(count: float) -> int:
        return max(1, round(size * count))

    def add(row: str, count: int, *slugs: str, mixed: bool = False, **wanted: Any) -> None:
        """So many campaigns of a row; mixed ones have loops every second time."""
        for k in range(count):
            made.append(trial(row, seed, k, *slugs, **wanted | ({"loops": k % 2 == 0} if mixed else {})))

    for noise in NOISES:
        add(f"none/{noise:g}", some(130), noise=noise, mixed=True)
    for slug in CATALOGUED:
        add(f"one/{slug}", some(40), slug, lam=20.0, follow=MOST_ADVISED)
        add(f"twelve/{slug}", some(12), slug, lam=50.0, states=12)
        add(f"left/{slug}", some(12), slug, lam=50.0, left=True)
    for slug in CATALOGUED:
        loops = {"loops": True} if slug in LOOPS | RECORDS else {"mixed": True}
        for lam in LOUDNESSES:
            add(f"loud/{lam:.0f}/{slug}", some(20), slug, lam=lam, **loops)
    for slug in OUTSIDE:
        add(f"outside/{slug}", some(20), slug, lam=50.0)
    for slug in LAWS:
        add(f"law/{slug}", some(40), slug, lam=80.0, mixed=True)
    made += [trial("two", seed, k, *pair, lam=50.0) for k, pair in enumerate(drawn_pairs(seed, some(100)))]
    many, few = some(30), some(30) // 3 or 1
    for lam in (50.0, 200.0):
        add(f"blindfold/{lam:.0f}", many, "oil_temperature", lam=lam, oil=False, moments=True)
    for slug in HALVED:
        add(f"gain/{slug}", many, slug, lam=60.0)
    add("film", many, "squeeze_film", lam=2000.0, full=True)
    for slug in ("unsettled_dwell", "shaft_ripple", "stick_slip"):
        add(f"raw/{slug}", few, slug, lam=20.0, raw=True, loops=False, rate=100.0)
    for speeds in (1, 2, 3):
        add(f"few/none/{speeds}", many, speeds=speeds, loops=False, states=12)
        for slug in FEW_SPEEDS:
            add(f"few/{slug}/{speeds}", few, slug, lam=80.0, speeds=speeds, loops=False, states=12)
    add("raw/none", many, raw=True, loops=False)
    return made


def asked_for(asked: Asked) -> list[Trial]:
    """Those that `make` asks for."""
    every = (trial for seed in asked.seeds for trial in trials(seed, asked.size))
    return [trial for trial in every if trial.row.startswith(asked.only)]


def drawn_pairs(seed: int, count: int) -> list[tuple[str, str]]:
    """Two effects of different families that do not undo each other's protocol, so many times."""
    able = [pair for pair in combinations(CATALOGUED, 2) if not set(pair) <= HISTORY]
    dice = np.random.default_rng([seed, 2])
    return [able[int(k)] for k in dice.integers(len(able), size=count)]


def _alarm(one: Outcome) -> bool:
    return one.verdict != "model_adequate"


def _hidden(one: Outcome) -> bool:
    return bool(one.truth)


def _is(family: bool) -> Test:
    return lambda one: one.detected and ((one.trial.slugs[0] in HISTORY) is family)


def _resolved(tests: int | None = None) -> Test:
    return lambda one: any(after.right for after in one.advised[:tests])


def counts() -> list[Count]:
    """The lines of the table in its order."""
    alarm, few = "any verdict but `model_adequate`", "one to three speeds"
    lines = [
        *(
            Count(f"no effect, noise of {noise:g} %: {alarm}", f"none/{noise:g}", _alarm, most=0.015)
            for noise in NOISES
        ),
        Count("one effect, λ = 20: detected", "one/", lambda o: o.detected, 0.90),
        Count(
            "… true cause in the set, of those detected", "one/", lambda o: o.in_set, 0.97, among=lambda o: o.detected
        ),
        Count("… top candidate, outside the history family", "one/", lambda o: o.top, 0.95, among=_is(False)),
        Count("… top candidate, history family", "one/", lambda o: o.top, 0.60, among=_is(True)),
        Count("… named and wrong", "one/", lambda o: o.wrong, most=0.02),
    ]
    ambiguous = (
        ("and named rightly after the first advised test", _resolved(1), None),
        (f"and named rightly after {MOST_ADVISED} advised tests at most, one by one", _resolved(), 0.80),
        ("and named wrongly after one of them", lambda o: any(after.wrong for after in o.advised), None),
    )
    lines += [
        *(
            Count(f"… ambiguous, {what}", "one/", met, least, among=lambda o: o.ambiguous)
            for what, met, least in ambiguous
        ),
        Count("… ambiguous without any advice", "one/", lambda o: not o.advice, among=lambda o: o.ambiguous),
        Count("λ = 50, 12 states: top candidate", "twelve/", lambda o: o.top, 0.95),
        Count("… named and wrong", "twelve/", lambda o: o.wrong, most=0.02),
    ]
    for lam in LOUDNESSES:
        title, row = f"λ = {lam:.0f}", f"loud/{lam:.0f}/"
        lines += [
            Count(f"{title}: detected", row, lambda o: o.detected),
            Count(f"{title}: true cause in the set", row, lambda o: o.in_set, 0.97 if lam >= 50 else None),
            Count(f"{title}: named rightly", row, lambda o: o.right),
            Count(
                "… of those with an isolability of 0.5 or more",
                row,
                lambda o: o.right,
                0.90 if lam >= 80 else None,
                among=lambda o: o.isolable,
            ),
            Count(f"{title}: named and wrong", row, lambda o: o.wrong, most=0.015),
        ]
    lines += [
        Count("outside the catalogue, λ = 50: `unexplained_structure`", "outside/", lambda o: o.unexplained, 0.80),
        Count("… with the right axis first", "outside/", lambda o: o.right_axis, 0.80, among=lambda o: o.unexplained),
        Count("… named", "outside/", lambda o: o.named, most=0.02),
        Count("another friction law, λ = 80 beside eq. 3: `model_adequate`", "law/", lambda o: not _alarm(o), 0.85),
        Count("… named", "law/", lambda o: o.named, most=0.03),
        Count("left out of the catalogue, λ = 50: named as something else", "left/", lambda o: o.named, most=0.10),
        Count("… unexplained or ambiguous", "left/", lambda o: o.unexplained or o.ambiguous, 0.80),
        Count("two effects, λ = 50 each: both in the set", "two", lambda o: o.in_set, 0.85),
        Count("… the exact pair named", "two", lambda o: o.right, 0.75),
        Count("… a wrong name", "two", lambda o: o.wrong, most=0.05),
        Count("temperature effect without oil temperature: `torque_zero_shift` named", "blindfold/", _zero, most=0.0),
        Count("… anything but `oil_temperature` named", "blindfold/", lambda o: o.wrong, most=0.02),
        Count("squeeze film against the GMS baseline: named", "film", lambda o: o.right, 0.95),
        Count("raw stationary records, λ = 20: detected", "raw/", lambda o: o.detected, 0.9, among=_hidden),
        Count("… named and wrong", "raw/", lambda o: o.wrong, most=0.02, among=_hidden),
        Count(f"… nothing hidden: {alarm}", "raw/none", _alarm, most=0.02),
        Count(f"{few}, nothing hidden: {alarm}", "few/none", _alarm, most=0.02),
        Count(f"{few}, λ = 80: in the set", "few/", lambda o: o.in_set, among=_hidden),
        Count("… named and wrong", "few/", lambda o: o.wrong, most=0.02, among=_hidden),
        Count("crashed", "", lambda o: o.verdict == "crashed", most=0.0),
    ]
    return lines


def _zero(one: Outcome) -> bool:
    return one.named and "torque_zero_shift" in one.causes


def calibration(outcomes: Sequence[Outcome]) -> list[tuple[str, int, int]]:
    """Candidates by the probability they were given: label, how many were true, how many there were.

    Single effects of the catalogue only, at every loudness; what was left out of the catalogue is left out here.
    """
    given = [
        (share, slug in one.truth)
        for one in outcomes
        if len(one.truth) == 1 and one.truth <= CATALOGUED.keys() and not one.trial.without
        for slug, share in one.candidates
    ]
    edges = ((0.05, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 0.85), (0.85, 0.95), (0.95, 1.0001))
    return [
        (
            f"{low:.2f} to {min(high, 1.0):.2f}",
            sum(true for p, true in given if low <= p < high),
            sum(low <= p < high for p, _ in given),
        )
        for low, high in edges
    ]
