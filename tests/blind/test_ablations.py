"""A number taken for another: only while it is asked for, and counted campaign by campaign."""

import pytest

from models.diagnosis import criteria
from tests.blind.ablations import AS_IT_IS, EACH, asked, table, taken_for
from tests.blind.subset import Judged


def test_each_number_that_gates_a_verdict_is_one_of_the_criteria_and_they_are_twelve_at_most() -> None:
    assert all(hasattr(criteria, number) for number in EACH)
    assert len(EACH) <= 12


def test_one_number_is_asked_for_by_name() -> None:
    assert asked("each") is EACH
    assert asked("SLACK=0.0") == {"SLACK": (0.0,)}
    with pytest.raises(ValueError, match="have no number NOT_THERE"):
        asked("NOT_THERE=1")


def test_a_number_is_another_until_it_was_tried() -> None:
    usual = criteria.SLACK
    with taken_for("SLACK", 7.0):
        assert criteria.SLACK == 7.0
    assert usual == criteria.SLACK


def said(row: str, truth: str, verdict: str, *causes: str) -> Judged:
    return Judged(row, frozenset({truth} if truth else ()), verdict, frozenset(causes), 1.0)


def test_a_row_counts_what_changed_for_better_and_worse_and_wrong_names() -> None:
    other = "SLACK = 0.0"
    lost = {
        AS_IT_IS: said("fifty/oil_change", "oil_change", "cause_named", "oil_change"),
        other: said("fifty/oil_change", "oil_change", "cause_named", "running_in"),
    }
    won = {AS_IT_IS: said("none", "", "unexplained_structure"), other: said("none", "", "model_adequate")}
    same = dict.fromkeys((AS_IT_IS, other), said("left/oil_change", "oil_change", "unexplained_structure"))
    rows = table([lost, won, same])
    assert rows[0].startswith("| 3 campaigns ")
    assert rows[2].startswith(f"| {AS_IT_IS} | 0 | 0 | 0 | 0 (0) |")
    assert rows[3].startswith(f"| {other} | 2 | 1 | 1 | 1 (0) |")
