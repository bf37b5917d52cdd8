"""The table itself: who knows the truth meets every target, who is given the wrong truth does not."""

from dataclasses import replace

import pytest

from models.diagnosis.validation.held_out import Gain
from tests.lab.blind import __main__ as blind
from tests.lab.blind import table
from tests.lab.blind.rig.loudness import UnreachableError
from tests.lab.blind.rig.makers import CATALOGUED, LAWS, OUTSIDE
from tests.lab.blind.rows import counts, trials
from tests.lab.blind.trials import Outcome, Trial, judge


def all_knowing(trial: Trial) -> Outcome:
    """What a perfect diagnosis says."""
    verdict, causes, where = "cause_named", frozenset(trial.slugs), ()
    if set(trial.slugs) <= LAWS.keys():  # or nothing
        verdict, causes = "model_adequate", frozenset()
    elif trial.without or not set(trial.slugs) <= CATALOGUED.keys():
        verdict, causes, where = "unexplained_structure", frozenset(), ("cycles",)
    elif "oil" in trial.wanted:
        verdict, causes = "cause_ambiguous", causes | {"torque_zero_shift"}
    candidates = tuple((slug, 0.9) for slug in sorted(causes, reverse=verdict == "cause_ambiguous"))
    if verdict == "cause_ambiguous":
        candidates = ((trial.slugs[0], 0.9), ("torque_zero_shift", 0.1))
    return Outcome(trial, verdict, causes, candidates, where, frozenset(where), None, (), 0.5)


def missed(outcomes: list[Outcome]) -> list[str]:
    return [line.title for line in counts() if line.holds(*line.of(outcomes)) is False]


def test_one_who_knows_meets_every_target_and_one_misled_does_not() -> None:
    made = trials(1, 0.1)
    outcomes = [all_knowing(trial) for trial in made]
    assert missed(outcomes) == []
    shifted = [*outcomes[41:], *outcomes[:41]]
    misled = [replace(one, trial=other.trial) for one, other in zip(outcomes, shifted, strict=True)]
    assert {"no effect, noise of 1 %: any verdict but `model_adequate`", "… named and wrong"} <= set(missed(misled))
    # every line of the table has its trials, every effect its rows, and no two campaigns are alike
    assert all(line.of(outcomes)[1] > 0 for line in counts() if "ambiguous" not in line.title)
    lines = blind.document(outcomes, "make blind")
    assert all(f"| `{slug}` | 4 | 4/4 | 4/4 | 4/4 | 4/4 | 0/4 | 0/4 |" in "\n".join(lines) for slug in CATALOGUED)
    assert all(f"| `{slug}` | 2, 0 of 2 | 2, 0 of 2 |" in "\n".join(lines) for slug in CATALOGUED)
    assert all(f"| {slug.replace('_', ' ')} | 2 | 2 | 2 | 2 | 0 |" in "\n".join(lines) for slug in OUTSIDE)
    whole = trials(1)
    assert sum(trial.row.startswith("none/") for trial in whole) == 390
    assert all(sum(trial.row == f"one/{slug}" for trial in whole) == 40 for slug in CATALOGUED)
    assert len({trial.seed for trial in whole}) == len(whole)
    assert {trial.seed for trial in whole}.isdisjoint(trial.seed for trial in trials(2))


def test_what_cannot_be_made_is_an_outcome_that_counts_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(_: Trial) -> None:
        raise UnreachableError("running_in: no amplitude up to 0.6 has λ = 300.0")

    monkeypatch.setattr(Trial, "hidden", never)
    trial = Trial("loud/300/running_in", (1, 2), ("running_in",), 300.0)
    unmade = judge(trial)
    assert unmade.verdict == "unreachable"
    assert not unmade.detected
    made = [all_knowing(replace(trial, seed=(1, 3))), all_knowing(Trial("none", (1, 4)))]
    line = next(line for line in counts() if line.title == "λ = 300: detected")
    assert (line.of([unmade]), line.of([*made, unmade])) == ((0, 0), (1, 1))
    lines = blind.document([*made, unmade], "make blind")
    assert any("1 of 3 trials could not be made" in row and "`running_in` at λ = 300 (1)" in row for row in lines)
    assert lines[4:] == blind.document(made, "make blind")[4:]
    assert table.unmade(made) == ["All 2 trials could be made."]
    assert table.failures([unmade]) == []


def test_gains_are_held_against_their_targets() -> None:
    good = Gain(
        held_out_runs=(), rmse_before=1.0, rmse_after=0.9, reduction_percent=10.0, reduction_sd=1.0, excess_before=0.5,
        excess_after=0.2, mse_percent_before=1.0, mse_percent_after=0.8, log_score_gain=1.0, forecast_log_score_gain=1.0,
    )  # fmt: skip
    trials_ = [Trial("gain/oil_change", (1, k), ("oil_change",), 60.0) for k in range(3)]
    row = "| `oil_change`, λ = 60 | 3 | 0.900 | 0.900 | ≤ 1.02 | met | 0.40 of 3 | ≤ 0.5 | met |"
    assert table.gains([replace(all_knowing(each), gain=good) for each in trials_])[2:] == [row]
    worse = replace(good, rmse_after=1.1, excess_after=0.4)
    (row,) = table.gains([replace(all_knowing(each), gain=worse) for each in trials_])[2:]
    assert row.count("missed") == 2
    assert table.beyond(replace(all_knowing(trials_[0]), gain=replace(good, excess_before=0.01))) is None


def test_failures_say_how_to_repeat_them() -> None:
    trial = Trial("one/oil_change", (1, 2, 3), ("oil_change",), 20.0)
    wrong = replace(all_knowing(trial), causes=frozenset({"running_in"}))
    assert "hide((1, 2, 3), ('oil_change',), 20.0)" in table.failures([wrong])[0]
    assert table.failures([all_knowing(trial)]) == []
