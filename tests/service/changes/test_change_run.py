"""After a slip is mended, every answer is that of a clutch that was sent the right things from the start."""

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from service.answers import diagnoses as diagnosis_answers
from service.answers import runs as run_answers
from service.answers.raw_run import write_run
from service.changes import change_run, ingest_run, run_diagnosis
from service.changes.adopt_model import finish_and_adopt
from service.clutch.plausibility import doubts as rules
from service.clutch.plausibility.doubts import Judged
from service.errors import ConflictError, NotFoundError, NotPossibleNowError
from service.paging import WHOLE
from storage import assumptions, changes, clutches, jobs
from tests.service.changes.benches import (
    AT,
    CLUTCH,
    EXTENSION,
    Bench,
    assert_same,
    assert_same_but_for_held,
    body,
    overtaken,
    send_to,
    stood_in,
)
from tests.service.clients import as_answered
from tests.service.jobs.replaying import replay_clutch
from tests.storage.samples import read_from, write_to
from tests.support import one_quick


def test_the_reference_test_is_withdrawn_and_comes_back(benches: tuple[Bench, Bench]) -> None:
    """At first it is the only one."""
    slipped, right = benches
    slipped.send(body("few", "a", 0.0))
    slipped.withdraw("a")
    assert_same(slipped, right)
    assert slipped.answers()["clutch"]["summary"] is None
    slipped.restore("a")
    for number, (name, kind) in enumerate({"b": "test", "c": "test", "l": "loop"}.items(), start=1):
        for bench in benches:
            bench.send(body(kind, name, 1000.0 * number))
    whole = slipped.answers()
    slipped.withdraw("a")
    assert_same(slipped, right)
    assert slipped.answers()["runs"] != whole["runs"]  # other speeds, other means
    slipped.restore("a")
    assert slipped.answers() == whole


@pytest.mark.slow
def test_a_late_arrival_is_none_once_the_run_that_made_it_late_is_gone(bench: Bench) -> None:
    bench.send(body("test", "first", 0.0))
    bench.send(body("test", "slip", 70_000.0, wear=0.05))
    late = bench.send(body("test", "late", 1000.0))
    assert "late_arrival" in {warning["code"] for warning in late["warnings"]}
    bench.correct("slip", 700.0)
    codes = {warning["code"] for receipt in bench.receipts().values() for warning in receipt["warnings"]}
    assert codes <= {"undetermined"}  # what the curves themselves leave open
    bench.correct("slip", 70_000.0)
    assert bench.receipts()["late"]["warnings"] == late["warnings"]
    assert bench.receipts()["slip"]["sent_cycles"] == 70_000


@pytest.mark.slow
def test_a_rebuild_that_was_none_takes_its_adoption_along(benches: tuple[Bench, Bench]) -> None:
    """What was adopted before it is in force again, and again what was adopted after it where it comes back."""
    slipped, right = benches
    for bench in benches:
        bench.send_tests(0, 1000, 2000)
        bench.diagnose("of-the-first", "")
        bench.adopt("of-the-first")
    slipped.send(body("rebuild", "new-lining", 2500.0))
    for bench in benches:
        bench.send_tests(3000, 4000)
    slipped.diagnose("of-the-second", "new-lining")
    slipped.adopt("of-the-second")
    whole = slipped.answers()
    assert whole["particle"]["model"]["name"] == "extended"
    slipped.withdraw("new-lining")
    ours, theirs = slipped.answers(), right.answers()
    for answer in (ours, theirs):
        del answer["clutch"]["diagnosis"]  # the newest one is another
    assert ours == theirs
    assert ours["particle"]["model"]["name"] == "extended"
    slipped.restore("new-lining")
    assert slipped.answers() == whole


@pytest.mark.slow
def test_a_run_of_an_earlier_life_is_corrected(benches: tuple[Bench, Bench]) -> None:
    slipped, right = benches
    for bench, cycles in ((slipped, 100.0), (right, 1000.0)):
        bench.send_tests(0, 2000)
        bench.send(body("test", "b", 1000.0) | {"cycles": cycles})
        bench.send(body("rebuild", "new-lining", 3000.0))
        bench.send_tests(3000, 4000)
    slipped.correct("b", 1000.0)
    assert_same(slipped, right)
    slipped.correct("b", 3500.0)  # into the present life
    assert slipped.receipts()["b"]["state"] == "accepted"
    assert slipped.answers()["clutch"]["summary"] != right.answers()["clutch"]["summary"]


@pytest.mark.parametrize("kind", one_quick(["test", "loop", "duty", "oil_change", "rebuild"]))
def test_what_is_held_changes_no_answer_but_is_said_beside_it(benches: tuple[Bench, Bench], kind: str) -> None:
    held, never = benches
    for bench in benches:
        bench.send_tests(0, 1000, 2000)
    receipt = held.send(body(kind, "odd", 1500.0, odd=True))
    assert (receipt["state"], receipt["doubts"]) == ("held", [{"code": "odd", "message": "it carries the mark"}])
    assert held.receipts()["odd"] == receipt
    assert bool(receipt["fits"]) == (kind == "test")
    assert_same_but_for_held(held, never)
    for bench in benches:
        bench.send(body("test", "next", 3000.0))
    assert_same_but_for_held(held, never)
    replay_clutch(held.database, CLUTCH)
    assert_same_but_for_held(held, never)
    assert held.receipts()["odd"]["state"] == "held"
    assert held.receipts()["odd"]["doubts"] == receipt["doubts"]


def test_states_and_what_changes_nothing(bench: Bench) -> None:
    bench.send(body("test", "a", 0.0))
    held = bench.send(body("test", "odd", 1000.0, odd=True))

    def unchanged(change: Callable[[], dict[str, Any]], expected: dict[str, Any]) -> None:
        revision, trail = revision_of(bench), trail_of(bench)
        assert change() == expected
        assert (revision_of(bench), trail_of(bench)) == (revision, trail)

    unchanged(lambda: bench.restore("odd"), held)
    unchanged(lambda: bench.correct("odd", 1000.0), held)
    withdrawn = bench.withdraw("odd")
    assert withdrawn == held | {"state": "withdrawn"}
    unchanged(lambda: bench.withdraw("odd"), withdrawn)
    unchanged(lambda: bench.confirm("odd"), withdrawn)
    with pytest.raises(NotPossibleNowError, match="restore it"):
        bench.correct("odd", 2000.0)
    assert bench.restore("odd") == held  # as it was before
    accepted = bench.confirm("odd")
    assert (accepted["state"], accepted["doubts"]) == ("accepted", held["doubts"])
    unchanged(lambda: bench.confirm("odd"), accepted)
    unchanged(lambda: bench.restore("odd"), accepted)
    assert bench.correct("odd", 2000.0)["state"] == "held"  # doubted there, too
    assert bench.correct("odd", 60_000.0)["doubts"] == []  # plausible there
    back = bench.correct("odd", 1000.0)
    assert (back["state"], back["cycles"], back["sent_cycles"]) == ("held", 1000, 1000)
    actions = [(each["action"], each["after"]["state"]) for each in trail_of(bench)]
    assert actions[::-1] == [
        ("hold", "held"), ("withdraw", "withdrawn"), ("restore", "held"), ("confirm", "accepted"),
        ("correct", "held"), ("correct", "accepted"), ("correct", "held"),
    ]  # fmt: skip
    with pytest.raises(NotFoundError, match="nobody"):
        bench.withdraw("nobody")


def test_several_held_runs_are_confirmed_in_one_step_or_none(benches: tuple[Bench, Bench]) -> None:
    together, one_by_one = benches
    for bench in benches:
        bench.send_tests(0, 1000)
        for name, cycles in (("odd-2", 3000.0), ("odd-1", 2000.0)):
            assert bench.send(body("test", name, cycles, odd=True))["state"] == "held"
    revision = revision_of(together)
    asked = ["odd-2", "a1000", "odd-1"]
    confirming = {"action": changes.CONFIRM, "reason": "a new lining", "by": "me", "at": AT}
    with pytest.raises(NotFoundError, match="nobody"):
        change_run.change(together.database, CLUTCH, [*asked, "nobody"], **confirming)
    assert revision_of(together) == revision
    receipts = list(map(as_answered, change_run.change(together.database, CLUTCH, asked, **confirming)))
    assert [(one["run_id"], one["state"]) for one in receipts] == [(name, "accepted") for name in asked]
    assert revision_of(together) == revision + 1
    confirmed = [each for each in trail_of(together) if each["action"] == "confirm"]
    assert sorted(each["run_id"] for each in confirmed) == ["odd-1", "odd-2"]
    assert {each["reason"] for each in confirmed} == {"a new lining"}
    for name in ("odd-1", "odd-2"):
        one_by_one.confirm(name)
    assert_same(together, one_by_one)


def test_runs_after_a_counter_restarted_are_asked_about_once_mended_in_one_step_and_undone(tmp_path: Path) -> None:
    """Tests every 500 cycles, two days apart; the counter is exchanged at 3,000 and begins at zero."""
    with closing(Bench(tmp_path / "bench.db")) as bench:
        _restarted(bench)


def _restarted(bench: Bench) -> None:
    for k in range(10):
        cycles = 500.0 * k
        sent = body("test", f"t{k}", cycles) | {"started_at": f"2026-03-{2 * k + 1:02d}T08:00:00+00:00"}
        bench.send(sent | {"cycles": cycles if k < 6 else cycles - 3000.0})
    before = bench.receipts()
    held = [name for name, receipt in before.items() if receipt["state"] == "held"]
    assert sorted(held) == ["t6", "t7", "t8", "t9"]
    (doubts,) = {receipt["doubts"][0]["message"].partition("?")[0] for name, receipt in before.items() if name in held}
    assert doubts == "Did the counter restart at zero by 13 Mar 2026"
    likely = {name: float(before[name]["doubts"][0]["likely_cycles"]) for name in held}
    assert likely == {f"t{k}": 500 * k for k in range(6, 10)}
    who = {"reason": "it was exchanged", "by": "me", "at": AT}
    revision = revision_of(bench)
    correcting = {"action": changes.CORRECT, **who}
    mended = map(as_answered, change_run.change(bench.database, CLUTCH, held, cycles=likely, **correcting))
    assert {one["run_id"]: (one["state"], one["cycles"]) for one in mended} == {
        name: ("accepted", cycles) for name, cycles in likely.items()
    }
    assert revision_of(bench) == revision + 1
    sent_cycles = {name: float(before[name]["cycles"]) for name in held}
    undone = map(as_answered, change_run.change(bench.database, CLUTCH, held, cycles=sent_cycles, **correcting))
    assert {one["run_id"]: (one["state"], one["doubts"]) for one in undone} == {
        name: ("held", before[name]["doubts"]) for name in held
    }
    # one question, one answer
    (question,) = {json.dumps([doubt["id"], doubt["hypothesis"]]) for name in held for doubt in before[name]["doubts"]}
    doubt_id, hypothesis = json.loads(question)
    proposal = {"cycles_offset": 3000}
    assert hypothesis == {"kind": "restart", "runs": [f"t{k}" for k in range(6, 10)], "proposal": proposal}
    said = {"by": "me", "at": AT, "reason": ""}
    accepted = change_run.answer_doubt(bench.database, CLUTCH, doubt_id, accept=True, **said)
    assert {one.run_id: (one.state, one.cycles) for one in accepted} == {
        name: ("accepted", cycles) for name, cycles in likely.items()
    }
    with pytest.raises(NotFoundError):  # it is answered
        change_run.answer_doubt(bench.database, CLUTCH, doubt_id, accept=True, **said)
    change_run.change(bench.database, CLUTCH, held, cycles=sent_cycles, **correcting)
    refused = change_run.answer_doubt(bench.database, CLUTCH, doubt_id, accept=False, **said)
    assert {one.run_id: (one.state, one.cycles) for one in refused} == {
        name: ("accepted", cycles) for name, cycles in sent_cycles.items()
    }


def test_runs_that_are_another_clutchs_are_withdrawn_by_one_answer(tmp_path: Path) -> None:
    own = [(f"t{k}", 500.0 * k, 2 * k + 1) for k in range(10)]
    others = [(f"u{k}", 700.0 + 900.0 * k, 20 + 2 * k) for k in range(3)]
    with closing(Bench(tmp_path / "bench.db")) as bench:
        for name, cycles, day in (*own, *others):
            bench.send(body("test", name, cycles) | {"started_at": f"2026-03-{day:02d}T18:00:00+00:00"})
        held = {name: receipt for name, receipt in bench.receipts().items() if receipt["state"] == "held"}
        names = [name for name, _, _ in others]
        assert sorted(held) == names
        (doubt,) = held["u0"]["doubts"]
        assert doubt["hypothesis"] == {"kind": "other_clutch", "runs": names, "proposal": {}}
        said = {"by": "me", "at": AT, "reason": "they are of bench 4"}
        out = change_run.answer_doubt(bench.database, CLUTCH, doubt["id"], accept=True, **said)
    assert {receipt.run_id: receipt.state for receipt in out} == dict.fromkeys(names, "withdrawn")


def test_several_runs_are_withdrawn_and_restored_in_one_step(bench: Bench) -> None:
    bench.send_tests(0, 1000, 2000)
    names, who = ["a1000", "a2000"], {"reason": "another clutch's", "by": "me", "at": AT}
    before = bench.receipts()
    out = change_run.change(bench.database, CLUTCH, names, action=changes.WITHDRAW, **who)
    assert [receipt.state for receipt in out] == ["withdrawn", "withdrawn"]
    back = change_run.change(bench.database, CLUTCH, names, action=changes.RESTORE, **who)
    assert [receipt.state for receipt in back] == ["accepted", "accepted"]
    assert bench.receipts() == before


def test_what_was_sent_stays_what_was_sent(bench: Bench, tmp_path: Path) -> None:
    """The hash is of what was sent: it is known again, and other content is refused, whatever was mended."""
    sent = body("test", "a", 7000.0)
    first = bench.send(sent)
    corrected = bench.correct("a", 700.0)
    assert corrected["content_sha256"] == first["content_sha256"]
    assert bench.send(sent) == corrected | {"duplicate": True}
    with pytest.raises(ConflictError):
        bench.send(sent | {"cycles": 700.0})
    withdrawn = bench.withdraw("a")
    assert bench.send(sent) == withdrawn | {"duplicate": True}
    write_run(bench.database, CLUTCH, "a", points=None, kind="json", path=tmp_path / "run")
    run = json.loads((tmp_path / "run").read_bytes())
    assert run["channels"] == {name: [float(x) for x in column] for name, column in sent["channels"].items()}
    assert [(each["action"], each["before"]["cycles"]) for each in run["changes"]] == [
        ("withdraw", 700), ("correct", 7000),
    ]  # fmt: skip


def test_two_corrections_at_once_end_as_one_after_the_other(
    benches: tuple[Bench, Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process changes another run between computing and storing: both changes hold."""
    slipped, right = benches
    for bench in benches:
        bench.send_tests(0, 1000, 2000)
    for name in ("a1000", "a2000"):
        right.withdraw(name)

    def change(other: Any) -> None:
        taking_out = {"action": changes.WITHDRAW, "reason": "meanwhile", "by": "local", "at": AT}
        change_run.change(other, CLUTCH, ["a2000"], **taking_out)
        send_to(other, body("test", "new", 3000.0))

    calls = overtaken(monkeypatch, change_run, "_computed", slipped.database, change)
    slipped.withdraw("a1000")
    right.send(body("test", "new", 3000.0))
    assert len(calls) == 3  # its own twice, the other's once
    assert_same(slipped, right)


def test_a_diagnosis_of_what_was_changed_meanwhile_is_stale_and_not_adopted(bench: Bench) -> None:
    bench.send_tests(0, 1000, 70_000)

    def ask(*, isolability: bool = False) -> tuple[str, bool]:
        return run_diagnosis.ask(
            bench.database, CLUTCH, by="local", adopt=False, isolability=isolability, request="", most=9, created_at=AT
        )

    asked_for, _ = ask()
    job = write_to(bench.database, jobs.claim, "one", [jobs.DIAGNOSIS], at=AT)
    bench.send(body("test", "odd", 1500.0, odd=True))  # held: the runs are the same
    assert ask() == (asked_for, False)
    apart, new = ask(isolability=True)  # the one that runs does not say it
    assert new
    assert ask(isolability=True) == (apart, False)
    bench.correct("a70000", 7000.0)
    fresh, new = ask()
    assert new
    before = bench.answers()
    ended = {"report": {"verdict": "cause_named", "causes": []}, "extension": EXTENSION}
    finished = finish_and_adopt(bench.database, CLUTCH, asked_for, ended, at=AT, claimer="one")
    assert not finished
    assert read_from(bench.database, assumptions.current_adoption, CLUTCH) is None
    assert bench.answers() == before
    run_diagnosis.finish(bench.database, job, ended, at=AT, adopt=lambda *_: pytest.fail("nobody wants it adopted"))
    stale = diagnosis_answers.diagnosis(bench.database, CLUTCH, asked_for)
    assert (stale.status, stale.stale) == ("finished", True)
    assert not diagnosis_answers.diagnosis(bench.database, CLUTCH, fresh).stale


def revision_of(bench: Bench) -> int:
    return read_from(bench.database, clutches.revision, CLUTCH)


def trail_of(bench: Bench) -> list[dict[str, Any]]:
    return as_answered(run_answers.trail(bench.database, CLUTCH, WHOLE))["items"]


@pytest.mark.slow
def test_a_zero_too_many_is_held_and_corrected_by_the_rules_in_force(
    benches: tuple[Bench, Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A test of 7,000 cycles that was sent as 70,000: nothing changes until it is corrected, and then all is right."""
    slipped, right = benches
    with monkeypatch.context() as in_force:  # taken back before the benches take back what they stand in for
        for change in (change_run, ingest_run):
            in_force.setattr(change, "doubts_alone", rules.doubts_alone)
            in_force.setattr(change, "doubts_together", rules.doubts_together)
        for cycles in range(0, 7000, 1000):
            for bench in benches:
                assert bench.send(body("test", f"r{cycles}", cycles))["state"] == "accepted"
        assert slipped.send(body("test", "last", 7000.0) | {"cycles": 70_000.0})["state"] == "held"
        assert_same_but_for_held(slipped, right)
        corrected = slipped.correct("last", 7000.0)
        assert (corrected["state"], corrected["doubts"]) == ("accepted", [])
        right.send(body("test", "last", 7000.0))
        assert_same(slipped, right)
        assert slipped.correct("last", 70_000.0)["state"] == "held"
        assert slipped.confirm("last")["state"] == "accepted"
        assert slipped.answers(degradation_too=False)["clutch"]["summary"]["as_of_cycles"] == 70_000
        slipped.correct("last", 7000.0)
        assert_same(slipped, right, degradation_too=False)


# --- Campaigns with slips, mended in any order: every answer is that of a clutch that was never sent them.

KINDS = ("test", "test", "test", "test", "few", "other", "loop", "duty", "oil_change", "rebuild")


@dataclass(frozen=True)
class Sent:
    """A run as it should have been sent, and what went wrong: how it is sent, and how it is mended."""

    run: dict[str, Any]
    slip: str
    wrong_cycles: float


@st.composite
def campaigns(draw: st.DrawFn) -> tuple[list[Sent], list[int]]:
    """Runs in the order in which they are sent, and after how many arrivals each slip is mended."""
    count = draw(st.integers(4, 7))
    sent = []
    for number in range(count):
        kind = draw(st.sampled_from(KINDS))
        cycles = draw(st.integers(0, 6)) * 1000.0
        slip = draw(st.sampled_from(["", "", "cycles", "held", "extra", "held extra", "restored", "odd cycles"]))
        run = body(kind, f"r{number}-{kind}", cycles, odd="held" in slip or "odd" in slip)
        sent.append(Sent(run=run, slip=slip, wrong_cycles=draw(st.sampled_from([100.0, 2500.0, 70_000.0]))))
    mended = [draw(st.integers(number + 1, count)) for number in range(count)]
    return sent, mended


def arrive(bench: Bench, sent: Sent) -> None:
    """Send a run with its slip."""
    wrong = {"cycles": sent.wrong_cycles} if "cycles" in sent.slip else {}
    receipt = bench.send(sent.run | wrong)
    odd = ("held" in sent.slip or "odd" in sent.slip) and receipt["cycles"] < 50_000
    assert receipt["state"] == ("held" if odd else "accepted")


def mend(bench: Bench, sent: Sent) -> None:
    """Mend a run's slip."""
    name = sent.run["run_id"]
    if "cycles" in sent.slip:
        bench.correct(name, sent.run["cycles"])
    if "extra" in sent.slip or sent.slip == "restored":
        bench.withdraw(name)
    if sent.slip == "restored":
        bench.restore(name)
    if sent.slip in ("held", "odd cycles"):
        bench.confirm(name)


@pytest.mark.slow
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(campaign=campaigns(), adopted=st.booleans(), severity=st.sampled_from(["cycles", "dissipated_energy"]))
def test_a_mended_clutch_answers_as_one_without_slips(
    monkeypatch: pytest.MonkeyPatch, campaign: tuple[list[Sent], list[int]], adopted: bool, severity: str
) -> None:
    sent, mended_after = campaign
    record = {"severity": {"basis": severity}}
    with stood_in(monkeypatch), TemporaryDirectory() as folder:
        slipped, right = Bench(Path(folder) / "slipped.db", record), Bench(Path(folder) / "right.db", record)
        for bench in (slipped, right):
            bench.diagnose("d1", "")
            if adopted:
                bench.adopt("d1")
        for number, one in enumerate(sent, start=1):
            arrive(slipped, one)
            for other, after in zip(sent, mended_after, strict=True):
                if after == number:
                    mend(slipped, other)
        with monkeypatch.context() as believed:
            believed.setattr("service.changes.ingest_run.doubts_together", lambda *_, **__: Judged())
            for one in sent:
                if "extra" not in one.slip:
                    right.send(one.run)
        assert_same(slipped, right)
        for bench in (slipped, right):  # what is carried on is as right as what is shown
            bench.send(body("test", "next", 6500.0))
        assert_same(slipped, right, degradation_too=False)
        replay_clutch(slipped.database, CLUTCH)
        assert_same(slipped, right, degradation_too=False)
        for bench in (slipped, right):
            bench.close()
