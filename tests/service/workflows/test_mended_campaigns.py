"""Campaigns with slips, mended in any order: every answer is that of a clutch that was never sent them."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from service.lives.plausibility.doubts import Judged
from service.workflows.replay import replay_clutch
from tests.service.workflows.benches import CLUTCH, Bench, assert_same, body, stood_in

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
            believed.setattr("service.workflows.ingest_run.doubts_together", lambda *_, **__: Judged())
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
