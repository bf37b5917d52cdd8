"""The stored state of a clutch is that which follows from all its rows, whatever was written in which order."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
import pytest

from service.answers import clutch_list
from service.answers.remaining_life import remaining_life
from service.changes import run_diagnosis
from service.changes.edit_clutch import edit
from storage import clutches, diagnoses, jobs
from storage.clutches import ClutchSelection
from storage.diagnoses import FINISHED
from tests.service.changes.benches import AT, CLUTCH, EXTENSION, WHO, Bench, body
from tests.service.clients import as_answered
from tests.service.jobs.replaying import replay_clutch
from tests.storage.samples import read_from, write_to
from tests.support import one_quick

#: Sequences, the tests that each begins with, and its writes: with them all states are met, and each kind of write.
SEEDS, FIRST, WRITES = range(3), 4, 16
VERDICTS = ("cause_named", "cause_ambiguous", "unexplained_structure", "model_adequate", "insufficient_data")
DISAGREE = VERDICTS[:3]
Item = TypeVar("Item")


class Written:
    """A bench that is written to at random; `did` says what."""

    def __init__(self, bench: Bench, seed: int) -> None:
        self.bench = bench
        self.rng = np.random.default_rng(seed)
        self.cycles = 0.0
        self.made = 0
        self.did: list[str] = []

    def once(self) -> None:
        """One write."""
        often = (self.test, self.diagnose, self.adopt, self.baseline) * 2
        write = self.one_of(
            (*often, self.confirm, self.rebuild, self.withdraw, self.restore, self.correct, self.replay, self.edit)
        )
        self.did.append(write.__name__)
        write()

    def one_of(self, items: Sequence[Item]) -> Item:
        return items[int(self.rng.integers(len(items)))]

    def name(self) -> str:
        self.made += 1
        return f"n{self.made}"

    def test(self) -> None:
        self.cycles += 2000.0
        wear = min(0.9, self.cycles / self.one_of((15_000, 60_000)))
        self.bench.send(body("test", self.name(), self.cycles, wear=wear, odd=self.rng.random() < 0.1))

    def rebuild(self) -> None:
        self.bench.send(body("rebuild", self.name(), self.cycles + 1.0))

    def diagnose(self) -> None:
        """A diagnosis that was asked for before the writes to come, or now, and ends now."""
        database = self.bench.database
        run_diagnosis.ask(database, CLUTCH, by="local", adopt=False, request="", most=1, created_at=AT)
        job = write_to(database, jobs.claim, "one", [jobs.DIAGNOSIS], at=AT)
        assert job is not None
        report = {"verdict": self.one_of(VERDICTS), "causes": []}
        ended = {"report": report, "extension": EXTENSION}
        if self.rng.random() < 0.2:
            ended = {"problem": "it failed"}
        run_diagnosis.finish(database, job, ended, at=AT, adopt=lambda *_: False)

    def adopt(self) -> None:
        rows = read_from(self.bench.database, diagnoses.page, CLUTCH, limit=9)
        for row in rows:
            if row.status == FINISHED and row.life == self.rows()[0].summary.get("life", ""):
                self.bench.adopt(row.diagnosis_id)
                return

    def baseline(self) -> None:
        self.bench.adopt(None)

    def change(self, state: str, change: Callable[[str], object]) -> None:
        """A change of one of the runs in that state, if there is any."""
        if runs := [run_id for run_id, receipt in self.bench.receipts().items() if receipt["state"] == state]:
            change(self.one_of(runs))

    def confirm(self) -> None:
        self.change("held", self.bench.confirm)

    def withdraw(self) -> None:
        self.change("accepted", self.bench.withdraw)

    def restore(self) -> None:
        self.change("withdrawn", self.bench.restore)

    def correct(self) -> None:
        self.change("accepted", lambda run_id: self.bench.correct(run_id, float(self.rng.integers(40) * 500)))

    def replay(self) -> None:
        replay_clutch(self.bench.database, CLUTCH)

    def edit(self) -> None:
        end = {"cof_fraction": self.one_of((0.5, 0.7, 0.95)), "criteria": []}
        edit(self.bench.database, CLUTCH, {"end_of_life": end}, archived=None, reason="another limit", **WHO)

    def rows(self) -> list[clutches.ClutchRow]:
        return read_from(self.bench.database, clutches.page, limit=2)


def stated_anew(bench: Bench) -> str:
    """The state by the rules of the docs, from what the API says of the clutch."""
    item = as_answered(clutch_list.look_up(bench.database, CLUTCH))
    life = as_answered(remaining_life(bench.database, CLUTCH, "particle", None, None))
    if life["status"] == "reached":
        return "failure"
    if life["status"] != "insufficient_data":
        accepted = [run for run in bench.receipts().values() if run["state"] == "accepted"]
        rebuilds = [run["cycles"] for run in accepted if run["event"] == "rebuild"]
        left, age = life["remaining_cycles"]["0.05"], life["as_of_cycles"] - max(rebuilds, default=0)
        if (left is not None and left < 0.2 * (age + left)) or life["current"]["health"] < 0.1:
            return "maintenance"
    if item["held"] or life["status"] == "insufficient_data":
        return "check"
    found = item["diagnosis"]
    if found and not found["adopted"] and not found["earlier_life"] and found["verdict"] in DISAGREE:
        return "out_of_specification"
    return "normal"


@pytest.mark.parametrize("seed", one_quick(SEEDS))
def test_the_stored_state_follows_from_all_rows(bench: Bench, seed: int) -> None:
    written, met = Written(bench, seed), set[str]()
    for _ in range(FIRST):
        written.test()
    for _ in range(WRITES):
        written.once()
        expected = stated_anew(bench)
        (row,) = written.rows()
        met.add(row.state)
        shown = clutch_list.look_up(bench.database, CLUTCH).state.name
        assert row.state == shown == expected, written.did
        totals = as_answered(clutch_list.totals(bench.database, ClutchSelection()))
        assert totals["states"] == {name: int(name == expected) for name in totals["states"]}
    print(seed, met, written.did)
    assert len(met) > 1, "the state never changed: nothing was tested"
