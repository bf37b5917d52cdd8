"""Two benches: one that was sent slips and mended, one that was sent the right things from the start; and all their answers.

Doubts are stood in for: a run is held where its start carries the mark of a second of 59, at cycles below 50,000. What is
tested is what happens to held runs, not which are.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from models.diagnosis.extension import Extension
from service.answers import clutch_list, degradation, remaining_life, runs, scores, series, stribeck
from service.api.clutch import ClutchIn
from service.changes import change_run, edit_clutch, ingest_run
from service.changes.adopt_model import adopt
from service.changes.ingest_run import ingest
from service.clutch.plausibility.doubts import Judged
from service.clutch.timeline import Shown
from service.errors import Notice
from service.paging import WHOLE
from service.runs.json_run import read_run
from storage import changes, diagnoses, results
from storage.diagnoses import DiagnosisRow
from storage.encoding import to_text
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.service.changes import stand_in_engine
from tests.service.clients import as_answered
from tests.support import stationary, torque_nm

CLUTCH = "c1"
AT = "2026-11-02T10:00:00+00:00"
WHO = {"by": "local", "at": AT}
PRESSURES, OTHER_PRESSURES, SPEEDS = (4.0, 6.0), (5.0, 7.0), tuple(range(20, 1971, 150))
REPORT = {"verdict": "cause_named", "causes": []}
EXTENSION = Extension(
    effects=("torque_zero_shift",),
    content={
        "shift_nm": 0.5,
        "course_nm": -0.2,
        "law": None,
        "draws": [{"weight": 1.0, "effects": [{"slug": "torque_zero_shift", "amplitude": 0.5}]}],
    },
).to_dict()
#: What only the audit knows of a run.
OF_THE_AUDIT = ("state", "doubts", "sent_cycles", "content_sha256")
#: The second of the start of a run that is doubted.
ODD = 59


def doubts_together(_: Any, __: Any, asked: Any, *___: Any, **____: Any) -> Judged:
    """A stand-in: what carries the mark is held, and no other run changes that."""
    odd = asked is not None and asked.moment % 60 == ODD and asked.cycles < 50_000
    notice = Notice(code="odd", message="it carries the mark")
    return Judged(doubts={asked.run_id: (notice,)} if odd else {})


def doubts_alone(*_: Any) -> tuple[Shown, tuple[Notice, ...]]:
    """A stand-in: nothing is odd about a run by itself."""
    return Shown(), ()


@contextmanager
def stood_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Doubts, and what an adopted extension does, are stood in for."""
    with monkeypatch.context() as patched:
        stand_in_engine.apply(patched.setattr)
        for change in (ingest_run, change_run):
            patched.setattr(change, "doubts_alone", doubts_alone)
            patched.setattr(change, "doubts_together", doubts_together)
        yield


def body(kind: str, run_id: str, cycles: float, *, wear: float | None = None, odd: bool = False) -> dict[str, Any]:
    """A run as it is sent: `test`, `other` (pressures), `few` (speeds), `loop`, `duty`, `rebuild`, `oil_change`."""
    started_at = f"2026-01-01T00:00:{ODD if odd else '00'}+00:00"
    head = {"run_id": run_id, "cycles": cycles, "started_at": started_at}
    if kind in ("test", "other", "few"):
        pressures = OTHER_PRESSURES if kind == "other" else PRESSURES
        speeds = SPEEDS[1:-1] if kind == "few" else SPEEDS
        return stationary(cycles, wear=wear, noise=0.02, pressures=pressures, speeds=speeds) | head
    if kind == "loop":
        return {"kind": "dynamic_stribeck", "channels": loop_channels()} | head
    if kind == "duty":
        duty = {"cycles": 400, "energy_per_cycle_kj": 18.0, "initial_speed_rpm": 2000}
        return {"kind": "duty_cycles", "duty": duty} | head
    return {"kind": "maintenance", "event": kind} | head


def loop_channels() -> dict[str, list[float]]:
    """Two periods of a dynamic test at 5 bar."""
    time = [0.25 * n for n in range(81)]
    speed = [1000.0 * (1 + math.sin(2 * math.pi * 0.1 * t)) for t in time]
    torque = [torque_nm(4.0, n, 0.1) + 0.3 * math.cos(2 * math.pi * 0.1 * t) for t, n in zip(time, speed, strict=True)]
    return {"time_s": time, "pressure_bar": [4.0] * len(time), "speed_rpm": speed, "torque_nm": torque}


def send_to(database: Database, run: Mapping[str, Any]) -> dict[str, Any]:
    """Post a run to a database; its receipt."""
    return as_answered(ingest(database, CLUTCH, read_run(to_text(run).encode()), received_at=AT)[0])


class Bench:
    """A service's database with one clutch, asked without HTTP."""

    def __init__(self, path: Path, record: Mapping[str, Any] | None = None) -> None:
        self.database: Database = open_database(f"sqlite:///{path}")
        record = {"clutch_id": CLUTCH} | dict(record or {})
        edit_clutch.register(self.database, ClutchIn.model_validate(record), created_at=AT)

    def send(self, run: Mapping[str, Any]) -> dict[str, Any]:
        return send_to(self.database, run)

    def send_tests(self, *cycles: float) -> None:
        """Tests that are named after their cycles: `a0`, `a1000`."""
        for each in cycles:
            self.send(body("test", f"a{each:g}", each))

    def diagnose(self, diagnosis_id: str, life: str, revision: int = 10**6) -> None:
        """Store a finished diagnosis of a life, whose extension the stand-in applies."""
        row = DiagnosisRow(
            clutch_id=CLUTCH, diagnosis_id=diagnosis_id, created_at=AT, revision=revision, last_run_key=0, life=life,
            as_of_cycles=None, code_version="0",
        )  # fmt: skip
        with self.database.writing() as connection:
            diagnoses.insert(connection, row)
            diagnoses.finish(connection, diagnosis_id, AT, REPORT, EXTENSION)

    def adopt(self, diagnosis_id: str | None) -> None:
        """Adopt a diagnosis, or return to the baseline."""
        adopt(self.database, CLUTCH, diagnosis_id, adopted_at=AT)

    def withdraw(self, run_id: str) -> dict[str, Any]:
        return self._changed(run_id, action=changes.WITHDRAW, reason="a slip")

    def restore(self, run_id: str) -> dict[str, Any]:
        return self._changed(run_id, action=changes.RESTORE, reason="no slip")

    def confirm(self, run_id: str) -> dict[str, Any]:
        return self._changed(run_id, action=changes.CONFIRM, reason="")

    def correct(self, run_id: str, cycles: float) -> dict[str, Any]:
        return self._changed(run_id, action=changes.CORRECT, reason="a slip", cycles={run_id: cycles})

    def _changed(self, run_id: str, **wanted: Any) -> dict[str, Any]:
        (receipt,) = change_run.change(self.database, CLUTCH, [run_id], **wanted, **WHO)
        return as_answered(receipt)

    def receipts(self) -> dict[str, dict[str, Any]]:
        page = json.loads(runs.page_as_json(self.database, CLUTCH, WHOLE))
        return {item["run_id"]: item for item in page["items"]}

    def answers(self, *, degradation_too: bool = True) -> dict[str, Any]:
        """Everything that follows from the history, revisions and what only the audit knows apart.

        `/degradation` is most of the work: it may be left out where it was looked at already.
        """
        database, life = self.database, remaining_life.remaining_life
        named: dict[str, Any] = {name: life(database, CLUTCH, name, None, None) for name in ("particle", "ukf", "grid")}
        named["earlier"] = life(database, CLUTCH, "particle", None, 2500.0)
        if degradation_too:
            named["degradation"] = degradation.degradation(database, CLUTCH)
        named["stribeck"] = stribeck.curves(database, CLUTCH, WHOLE)
        named["series"] = series.series(database, CLUTCH, WHOLE, None)
        named["loops"] = runs.loops(database, CLUTCH, WHOLE)
        named["scores"] = scores.scores_of_clutch(database, CLUTCH, method="particle")
        named["clutch"] = clutch_list.look_up(database, CLUTCH).model_copy(update={"held": 0})
        named = {name: as_answered(answer) for name, answer in named.items()}
        named["runs"] = [
            {name: value for name, value in receipt.items() if name not in OF_THE_AUDIT}
            for receipt in self.receipts().values()
            if receipt["state"] == "accepted"
        ]
        with database.reading() as connection:
            named["predictions"] = {
                method: results.predictions_of(connection, CLUTCH, method, 0.0) for method in ("particle", "ukf")
            }
        return {name: without_revision(answer) for name, answer in named.items()}

    def close(self) -> None:
        self.database.close()


def overtaken(
    monkeypatch: pytest.MonkeyPatch,
    module: Any,
    name: str,
    of: Database,
    meanwhile: Callable[[Any], object],
    at: int = 1,
) -> list[Any]:
    """Have another process do something with a database after so many calls of a function of a module; what calls gave."""
    computed, calls = getattr(module, name), list[Any]()

    def called(*arguments: Any) -> Any:
        outcome = computed(*arguments)
        calls.append(outcome)
        if len(calls) == at:
            with closing(open_database(of.url)) as other:
                meanwhile(other)
        return outcome

    monkeypatch.setattr(module, name, called)
    return calls


def without_revision(answer: Any) -> Any:
    """An answer without the revision that it names."""
    return {name: value for name, value in answer.items() if name != "revision"} if isinstance(answer, dict) else answer


def assert_same(mended: Bench, right: Bench, *, degradation_too: bool = True) -> None:
    """Every answer of the one is that of the other, to the last bit."""
    ours, theirs = (bench.answers(degradation_too=degradation_too) for bench in (mended, right))
    assert [name for name in theirs if ours[name] != theirs[name]] == []


def assert_same_but_for_held(held: Bench, never: Bench) -> None:
    """The same of a bench where runs are held, but for what its answers say of these."""
    ours, theirs = held.answers(), never.answers()
    assert [name for name in theirs if without_held(ours[name]) != without_held(theirs[name])] == []


def without_held(answer: Any) -> Any:
    """An answer without what it says of held runs."""
    if isinstance(answer, dict):
        said = ("held_runs", "at_least", "at_least_at", "counted_from", "statement", "state", "headline")
        said += ("action", "what_to_do")
        return {name: without_held(value) for name, value in answer.items() if name not in said}
    if isinstance(answer, list):
        spoken = [item for item in answer if not isinstance(item, dict) or "held_runs" not in item.values()]
        return [without_held(item) for item in spoken]
    return answer
