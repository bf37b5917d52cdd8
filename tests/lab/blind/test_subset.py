"""Numbers taken for others, and two ways to decide, on the fixed set of campaigns: counted campaign by campaign."""

from dataclasses import replace

import pytest

from models.diagnosis import criteria
from tests.lab.blind import ablations, subset
from tests.lab.blind.trials import Outcome, Trial, nothing


def said(row: str, truth: str, verdict: str, cause: str = "", number: int = 0) -> Outcome:
    trial = Trial(row, (number,), (truth,) if truth else ())
    return replace(nothing(trial, verdict, ""), causes=frozenset({cause} if cause else ()))


def right(count: int, of: int) -> list[Outcome]:
    """So many of these campaigns named right, the others adequate."""
    row = "fifty/oil_change", "oil_change"
    named = [said(*row, "cause_named", "oil_change", k) for k in range(count)]
    return named + [said(*row, "model_adequate", number=k) for k in range(count, of)]


@pytest.mark.parametrize(
    ("first", "second", "row"),
    [
        (right(12, 12), right(2, 12), "| 12 | 12 | 2 | 10 / 0 | worse |"),
        (right(12, 12), right(9, 12), "| 12 | 12 | 9 | 3 / 0 |  |"),
        (right(2, 12), right(12, 12), "| 12 | 2 | 12 | 0 / 10 |  |"),
        (right(12, 12), right(5, 5), "| 5 | 5 | 5 | 0 / 0 |  |"),
    ],
    ids=["worse", "within two standard errors", "better", "only campaigns that both have"],
)
def test_a_row_is_worse_where_the_pairs_differ_by_more_than_two_standard_errors(first, second, row) -> None:
    lines = subset.table(first, second, ("today", "next"))
    assert row in next(line for line in lines if "loops: named right" in line)


def test_a_seed_has_its_campaigns_and_no_two_are_alike() -> None:
    first, again, other = ([trial.seed for trial in subset.trials(seed)] for seed in (1, 1, 2))
    assert first == again
    assert len(set(first)) == len(first)
    assert not {*first} & {*other}


def test_a_number_is_asked_for_by_name() -> None:
    assert all(hasattr(criteria, number) for number in ablations.asked("each"))
    assert ablations.asked("SLACK=0.0") == {"SLACK": (0.0,)}
    with pytest.raises(ValueError, match="have no number NOT_THERE"):
        ablations.asked("NOT_THERE=1")


def test_a_row_counts_what_changed_for_better_and_worse_and_wrong_names() -> None:
    as_it_is, other = ablations.AS_IT_IS, "SLACK = 0.0"
    row = "fifty/oil_change", "oil_change", "cause_named"
    lost = {as_it_is: said(*row, "oil_change"), other: said(*row, "running_in")}
    won = {as_it_is: said("none", "", "unexplained_structure"), other: said("none", "", "model_adequate")}
    same = dict.fromkeys((as_it_is, other), said("left/oil_change", "oil_change", "unexplained_structure"))
    rows = ablations.table([lost, won, same])
    assert rows[2].startswith(f"| {as_it_is} | 0 | 0 | 0 | 0 (0) |")
    assert rows[3].startswith(f"| {other} | 2 | 1 | 1 | 1 (0) |")
