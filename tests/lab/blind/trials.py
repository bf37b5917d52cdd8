"""One trial: hide, let the diagnosis look, note what it said beside what was true."""

import pickle
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from models.diagnosis.diagnose import diagnose
from models.diagnosis.validation.held_out import Gain
from tests.lab.blind.rig.hide import Hidden, hide
from tests.lab.blind.rig.loudness import UnreachableError
from tests.lab.blind.rig.more import with_test
from tests.lab.blind.rig.sent import campaign
from tests.lab.measuring import ROOT, kept

#: The verdict on a campaign that could not be made: no draw in which the effect was as loud as it should be.
UNREACHABLE = "unreachable"
#: Effects that only raw records show, and the isolability from which a cause is to be named.
RECORDS, ISOLABLE = frozenset({"shaft_ripple", "stick_slip"}), 0.5
#: Outcomes, a file each: of `make blind` those in `table`, of its fixed set in a folder of the name that was given.
STORE = ROOT / ".blind"


@dataclass(frozen=True)
class Trial:
    """What to hide and what to take out of the catalogue; `row` is the table's row, the seed makes it again."""

    row: str
    seed: tuple[int, ...]
    slugs: tuple[str, ...] = ()
    lam: float = 0.0
    without: frozenset[str] = frozenset()
    wanted: dict[str, Any] = field(default_factory=dict)
    follow: int = 0  # so many advised tests at most are made, one after the other, while the verdict is ambiguous

    def hidden(self) -> Hidden:
        return hide(self.seed, self.slugs, self.lam, **self.wanted)

    def __str__(self) -> str:
        more = "".join(f", {name}={value!r}" for name, value in self.wanted.items())
        less = f"  without={sorted(self.without)}" if self.without else ""
        return f"hide({self.seed}, {self.slugs}, {self.lam}{more}){less}"


def trial(
    row: str, seed: int, number: int, *slugs: str, lam: float = 0.0, left: bool = False, follow: int = 0, **wanted: Any
) -> Trial:
    """The campaign of that number in a row; `left`: what is hidden is left out of the catalogue."""
    without = frozenset(slugs if left else ())
    return Trial(row, (seed, zlib.crc32(row.encode()), number), slugs, lam, without, wanted, follow)


@dataclass(frozen=True)
class Outcome:
    """What was said in a trial; `axes` are those of the truth, `where` those that the report names, strongest first."""

    trial: Trial
    verdict: str
    causes: frozenset[str]
    candidates: tuple[tuple[str, float], ...]
    where: tuple[str, ...]
    axes: frozenset[str]
    gain: Gain | None
    advice: tuple[str, ...]  # keys of the advised tests, best first
    seconds: float  # of one core
    error: str = ""
    isolability: tuple[tuple[str, float], ...] = ()  # ι of each effect that these tests show
    advised: tuple["Outcome", ...] = ()  # what was said after each advised test that was made

    @property
    def truth(self) -> frozenset[str]:
        return frozenset(self.trial.slugs)

    @property
    def detected(self) -> bool:
        return self.verdict not in {"model_adequate", "insufficient_data", "crashed", UNREACHABLE}

    @property
    def made(self) -> bool:
        """Whether there was a campaign at all; where there was none, nothing is counted."""
        return self.verdict != UNREACHABLE

    @property
    def named(self) -> bool:
        return self.verdict == "cause_named"

    @property
    def right(self) -> bool:
        return self.named and self.causes == self.truth

    @property
    def wrong(self) -> bool:
        """Named, and something named that is not there."""
        return self.named and not self.causes <= self.truth

    @property
    def in_set(self) -> bool:
        """Something is reported, and all that is true stands in it."""
        return self.verdict in {"cause_named", "cause_ambiguous"} and self.truth <= self.causes

    @property
    def top(self) -> bool:
        return bool(self.candidates) and self.candidates[0][0] in self.truth

    @property
    def ambiguous(self) -> bool:
        return self.verdict == "cause_ambiguous"

    @property
    def unexplained(self) -> bool:
        return self.verdict == "unexplained_structure"

    @property
    def isolable(self) -> bool:
        """Whether the law's own doubt leaves half or more of what the data say of all that was hidden; vibrations are seen
        in raw records, where there is no law."""
        shares = dict.fromkeys(RECORDS, 1.0) | dict(self.isolability)
        return all(shares.get(slug, 0.0) >= ISOLABLE for slug in self.truth)

    @property
    def right_axis(self) -> bool:
        return bool(self.where) and self.where[0] in self.axes


def judge(trial: Trial) -> Outcome:
    """Hide, diagnose, and hold what was said beside what was true. A crash is an outcome, and never a good one."""
    try:
        hidden = trial.hidden()
    except UnreachableError as failure:
        return nothing(trial, UNREACHABLE, str(failure))
    first = last = judged(trial, hidden)
    advised: list[Outcome] = []
    while len(advised) < trial.follow and last.verdict == "cause_ambiguous" and last.advice:
        hidden = with_test(hidden, last.advice[0])
        last = judged(trial, hidden)
        advised.append(last)
    return replace(first, advised=tuple(advised))


def file_of(trial: Trial, folder: str = "table") -> Path:
    seed = "-".join(str(part) for part in trial.seed)
    return STORE / folder / f"{trial.row.replace('/', '-')}-{seed}.pickle"


def stored(trial: Trial, folder: str = "table") -> Outcome:
    """The outcome of a trial, judged or read from where an earlier run left it."""
    known = kept(file_of(trial, folder), lambda: pickle.dumps(judge(trial)))
    return pickle.loads(known)  # noqa: S301 -- of this program


def nothing(trial: Trial, verdict: str, error: str, axes: frozenset[str] = frozenset()) -> Outcome:
    """The outcome where no report came."""
    return Outcome(trial, verdict, frozenset(), (), (), axes, None, (), 0.0, error)


def judged(trial: Trial, hidden: Hidden) -> Outcome:
    """The same where the campaign is made."""
    axes = frozenset().union(*(effect.axes for effect, _ in hidden.effects))
    seen, began = campaign(hidden), process_time()
    try:
        report = diagnose(seen, rng=np.random.default_rng(11), without=trial.without)
    except Exception as failure:  # noqa: BLE001 -- one crash must not end a night of trials; it fails its row instead
        return nothing(trial, "crashed", repr(failure), axes)
    seconds = process_time() - began
    where = sorted(report.baseline.where, key=lambda one: -one.strength) if report.baseline else []
    return Outcome(
        trial=trial,
        verdict=str(report.verdict),
        causes=frozenset(report.causes),
        candidates=tuple((one.effect, one.probability) for one in report.candidates),
        where=tuple(one.axis for one in where),
        axes=axes,
        gain=report.gain,
        advice=tuple(one.key for one in report.advice),
        seconds=seconds,
        isolability=tuple((one.effect, one.isolability) for one in report.visible),
    )
