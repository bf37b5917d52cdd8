"""The fixed set of campaigns: the same for a seed, and a table that says where one way to decide is worse than another."""

from tests.blind.subset import Judged, table, trials


def right(count: int, of: int) -> dict[str, Judged]:
    """So many of these campaigns named right, the others adequate."""
    hidden = frozenset({"oil_change"})
    return {
        f"campaign-{k:02d}": Judged(
            "fifty/oil_change",
            hidden,
            "cause_named" if k < count else "model_adequate",
            hidden if k < count else frozenset(),
            1.0,
        )
        for k in range(of)
    }


def row(lines: list[str]) -> str:
    return next(line for line in lines if "loops: named right" in line)


def test_a_row_is_worse_where_the_pairs_differ_by_more_than_two_standard_errors() -> None:
    assert "| 12 | 12 | 2 | 10 / 0 | worse |" in row(table(right(12, 12), right(2, 12), ("today", "next")))
    assert "| 12 | 12 | 9 | 3 / 0 |  |" in row(table(right(12, 12), right(9, 12), ("today", "next")))
    assert "| 12 | 2 | 12 | 0 / 10 |  |" in row(table(right(2, 12), right(12, 12), ("today", "next")))


def test_only_campaigns_that_both_have_are_compared() -> None:
    assert "| 5 | 5 | 5 | 0 / 0 |  |" in row(table(right(12, 12), right(5, 5), ("today", "next")))


def test_a_seed_has_its_campaigns_and_no_two_are_alike() -> None:
    first, other = trials(1), trials(2)
    assert list(first) == list(trials(1))
    assert not first.keys() & other.keys()
    assert len({trial.seed for trial in first.values()}) == len(first)
