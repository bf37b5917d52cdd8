"""Remaining life before and after, on one scale."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from tests.browser.modules import Module

pytestmark = pytest.mark.browser

BEFORE = {"0.05": 1000, "0.25": 1500, "0.5": 2000, "0.75": 2500, "0.95": 3000}
AFTER = {"0.05": 3000, "0.25": 3500, "0.5": 4000, "0.75": 4500, "0.95": 5000}
#: Width of a bar's drawing, and where its right end is in cycles for AFTER: 5 % past the larger 95 % quantile.
WIDTH, SCALE = 120, 1.05 * 5000


@pytest.fixture(scope="module")
def bars(loaded: Callable[[str], Module]) -> Module:
    return loaded("diagnosis/lifebars.js")


def show(bars: Module, before: Any, after: Any, *names: Any) -> dict[str, str]:
    result: dict[str, str] = bars("lifeBars", {"before": before, "after": after}, *names)
    return result


def medians(html: str) -> list[float]:
    """Where the medians are, px."""
    return [float(x) for x in re.findall(r'class="median" x="([^"]+)"', html)]


def boxes(html: str, name: str) -> list[tuple[float, float]]:
    """Both ends of the bars of a kind, px."""
    found = re.findall(rf'class="{name}"[^>]*? x="([^"]+)" width="([^"]+)"', html)
    return [(float(x), float(x) + float(width)) for x, width in found]


def test_they_share_one_scale(bars: Module) -> None:
    html = show(bars, BEFORE, AFTER)["html"]
    assert medians(html) == pytest.approx([WIDTH * 2000 / SCALE, WIDTH * 4000 / SCALE], abs=0.06)
    wide, half = boxes(html, "wide"), boxes(html, "half")
    assert wide[0] == pytest.approx((WIDTH * 1000 / SCALE, WIDTH * 3000 / SCALE), abs=0.11)
    assert wide[1] == pytest.approx((WIDTH * 3000 / SCALE, WIDTH * 5000 / SCALE), abs=0.11)
    assert half[1] == pytest.approx((WIDTH * 3500 / SCALE, WIDTH * 4500 / SCALE), abs=0.11)
    assert 'class="beyond"' not in html


def test_an_end_that_is_not_in_sight_is_marked(bars: Module) -> None:
    result = show(bars, BEFORE, AFTER | {"0.75": None, "0.95": None})
    assert "(90 %: 3,000 to over 1,000,000)" in result["text"]
    assert result["html"].count('class="beyond"') == 1
    # the scale then goes 1.6 times as far as the median
    assert medians(result["html"])[1] == pytest.approx(WIDTH * 4000 / (1.05 * 1.6 * 4000), abs=0.06)
    never = show(bars, BEFORE, dict.fromkeys(AFTER))
    assert "After– (90 %: –)" in never["text"]
    assert len(medians(never["html"])) == 1


def test_quartiles_that_are_missing_are_taken_from_the_interval(bars: Module) -> None:
    ends = {name: AFTER[name] for name in ("0.05", "0.5", "0.95")}
    html = show(bars, BEFORE, ends)["html"]
    assert boxes(html, "half")[1] == boxes(html, "wide")[1]
    alone = show(bars, BEFORE, {"0.5": 4000})
    assert "After4,000 (90 %: –)" in alone["text"]


@pytest.mark.parametrize("nothing", [None, {}, {"remaining_cycles": {}}, {"status": "insufficient_data"}])
def test_without_quantiles_on_both_sides_there_is_nothing_to_compare(bars: Module, nothing: Any) -> None:
    assert show(bars, nothing, AFTER) is None
    assert show(bars, BEFORE, nothing) is None
