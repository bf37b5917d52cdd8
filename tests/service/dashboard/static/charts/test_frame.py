"""Where a light chart has its axes, ticks and legend."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from tests.browser.modules import Module

pytestmark = pytest.mark.browser

FONT = {"family": "monospace", "size": 12, "color": "#000"}
SIZE = {"width": 600, "height": 400}


@pytest.fixture(scope="module")
def frame(loaded: Callable[[str], Module]) -> Module:
    return loaded("charts/frame.js")


def trace(x: list[Any], y: list[Any], mode: str = "lines", **more: Any) -> dict[str, Any]:
    return {"mode": mode, "x": x, "y": y} | more


def figure(*data: dict[str, Any], **layout: Any) -> dict[str, Any]:
    own = {"font": FONT, "margin": {"l": 56, "r": 16, "t": 12, "b": 48}, "legend": {"font": {"size": 11}}}
    return {"data": list(data), "layout": own | {"xaxis": {}, "yaxis": {}} | layout}


def settled(frame: Module, *data: dict[str, Any], **layout: Any) -> dict[str, Any]:
    result: dict[str, Any] = frame("settled", figure(*data, **layout), SIZE)
    return result


@pytest.mark.parametrize(
    ("span", "length", "least", "texts"),
    [
        ((0, 100), 400, 80, ["0", "20", "40", "60", "80", "100"]),
        ((0, 9), 800, 80, ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"]),
        ((0, 100), 8000, 80, ["0", "20", "40", "60", "80", "100"]),  # never more than about nine
        ((0, 1), 160, 40, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        ((0.12, 0.14), 160, 40, ["0.120", "0.125", "0.130", "0.135", "0.140"]),
        ((-10, 10), 160, 40, ["−10", "−5", "0", "5", "10"]),
        ((3, 17), 160, 40, ["5", "10", "15"]),
        ((0, 12_000), 400, 80, ["0", "2,000", "4,000", "6,000", "8,000", "10,000", "12,000"]),
    ],
)
def test_ticks_are_one_two_or_five_times_a_power_of_ten(
    frame: Module, span: tuple[float, float], length: float, least: float, texts: list[str]
) -> None:
    ticks = frame("ticksOf", list(span), length, least)
    assert [tick["text"] for tick in ticks] == texts
    for tick in ticks:
        assert float(tick["text"].replace(",", "").replace("−", "-")) == pytest.approx(tick["at"])
        assert span[0] - 1e-9 <= tick["at"] <= span[1] + 1e-9


def test_a_range_leaves_room_about_what_is_drawn(frame: Module) -> None:
    layout = settled(frame, trace([0, 10], [1, 3]))["layout"]
    assert layout["xaxis"]["range"] == pytest.approx([-0.2, 10.2])
    assert layout["yaxis"]["range"] == pytest.approx([0.9, 3.1])
    marked = settled(frame, trace([0, 10], [1, 3], "lines+markers"))["layout"]
    assert marked["xaxis"]["range"] == pytest.approx([-0.5, 10.5])  # points would be cut at the edge


@pytest.mark.parametrize(
    ("values", "mode", "expected"),
    [
        ([0, 10], "tozero", [0, 10.2]),
        ([4, 10], "tozero", [0, 10.2]),
        ([-5, 5], "tozero", [-5.2, 5.2]),  # below zero it starts where the values start
        ([None, 2, 4, None], None, [1.96, 4.04]),
        ([None, None], None, [0, 1]),
        ([], None, [0, 1]),
        ([5, 5], None, [4.5, 5.5]),
        ([0, 0], None, [-1, 1]),
        ([float("nan"), 1, 2], None, [0.98, 2.02]),
    ],
)
def test_ranges_at_their_edges(frame: Module, values: list[Any], mode: str | None, expected: list[float]) -> None:
    axis = {} if mode is None else {"rangemode": mode}
    layout = settled(frame, trace(values, [1] * len(values)), xaxis=axis)["layout"]
    assert layout["xaxis"]["range"] == pytest.approx(expected)


def test_error_bars_are_in_the_range(frame: Module) -> None:
    bars = {"array": [1, 2, 5], "color": "#000", "thickness": 1, "width": 3}
    layout = settled(frame, trace([0, 1, 2], [10, 20, None], error_y=bars))["layout"]
    assert layout["yaxis"]["range"] == pytest.approx([9 - 0.65, 22 + 0.65])


def test_a_legend_fits_beside_itself_or_breaks_into_rows(frame: Module) -> None:
    named = [trace([0, 1], [0, 1], name=name) for name in ("a", "bb", "ccc")]
    short = settled(frame, *named, trace([0], [0]), trace([0], [0], name="hidden", showlegend=False))
    entries = short["legend"]["entries"]
    assert [entry["trace"]["name"] for entry in entries] == ["a", "bb", "ccc"]
    assert entries[0]["x"] == 0
    for before, entry in pairwise(entries):
        assert entry["x"] == pytest.approx(before["x"] + before["width"] + 5)
        assert entry["y"] == before["y"]
    long = settled(frame, *(trace([0, 1], [0, 1], name="n" * 40) for _ in range(3)))
    rows = [entry["y"] for entry in long["legend"]["entries"]]
    assert rows == sorted(set(rows))
    assert {entry["x"] for entry in long["legend"]["entries"]} == {0}
    assert long["layout"]["margin"]["b"] > short["layout"]["margin"]["b"]


def test_margins_hold_labels_titles_and_legend(frame: Module) -> None:
    small = settled(frame, trace([0, 1], [0, 1]), yaxis={"range": [0, 9]})["layout"]
    assert small["margin"] == {"l": 56, "r": 16, "t": 12, "b": 49}  # b: two lines of 1.3 x 12 px and 18 px between
    big = settled(frame, trace([0, 1], [0, 12_345_678]))
    widest = max(frame("widthOf", tick["text"], FONT) for tick in big["ticks"]["y"])
    assert big["layout"]["margin"]["l"] == round(max(56, widest + 1.3 * 12 + 24)) > 56
