"""Points are taken, put together and marked open column by column."""

from dataclasses import fields

import numpy as np
import pytest

from models.diagnosis.design.design import Points, concatenate, mark_open
from models.records.criteria import UNLOADED

_INTEGERS = {"run", "loop", "previous"}


def numbered(first: int, count: int) -> Points:
    """Each column other numbers; the loops of all but the first point are -1."""
    columns = {
        each.name: (np.arange(first, first + count) + 100 * place).astype(np.intp if each.name in _INTEGERS else float)
        for place, each in enumerate(fields(Points))
    }
    columns["loop"] = np.where(np.arange(count) == 0, 0, -1).astype(np.intp)
    return Points(**columns)


def test_some_are_taken_and_lose_the_ones_before_them() -> None:
    points = numbered(0, 5)
    some = points.take(np.array([True, False, True, True, False]))
    assert some.run.tolist() == [0, 2, 3]
    assert some.previous.tolist() == [-1, -1, -1]
    for each in fields(Points):
        if each.name != "previous":
            assert getattr(some, each.name).tolist() == getattr(points, each.name)[[0, 2, 3]].tolist()


def test_blocks_stand_one_after_the_other() -> None:
    one, other = numbered(0, 2), numbered(7, 3)
    both = concatenate([one, other])
    for each in fields(Points):
        column = getattr(both, each.name)
        assert column.tolist() == [*getattr(one, each.name), *getattr(other, each.name)]
        assert column.dtype == (np.intp if each.name in _INTEGERS else np.float64)
    assert both.steady.tolist() == [False, True, False, True, True]


def test_no_blocks_are_no_points() -> None:
    none = concatenate([])
    assert {getattr(none, each.name).size for each in fields(Points)} == {0}


@pytest.mark.parametrize(
    ("pressure", "engaged", "expected"),
    [
        ([4 * UNLOADED, 0.0, 2 * UNLOADED], [1.0, 0.0, 1.0], [4 * UNLOADED, 2 * UNLOADED, 2 * UNLOADED]),
        ([0.0, 0.5 * UNLOADED], [0.0, 0.0], [1.0, 1.0]),
        ([UNLOADED], [1.0], [UNLOADED]),
    ],
)
def test_an_open_clutch_has_the_lowest_closed_pressure(
    pressure: list[float], engaged: list[float], expected: list[float]
) -> None:
    points = numbered(0, len(pressure))
    found = mark_open(
        Points(**{each.name: getattr(points, each.name) for each in fields(Points)} | {"pressure": np.array(pressure)})
    )
    assert found.engaged.tolist() == engaged
    assert found.pressure.tolist() == expected
