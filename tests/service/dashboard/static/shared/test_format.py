"""Numbers as a person reads them: ordinary values, none at all, and the edges of each rule."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from tests.browser.modules import Module

pytestmark = pytest.mark.browser

NONE = "–"
#: What is no number to show.
NOTHING = (None, math.nan, math.inf, -math.inf)


@pytest.fixture(scope="module")
def shown(loaded: Callable[[str], Module]) -> Module:
    return loaded("shared/format.js")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("oil_temperature_c", "Oil temperature, °C"),
        ("pressure_bar", "Pressure, bar"),
        ("speed_rpm", "Speed, rpm"),
        ("torque_nm", "Torque, Nm"),
        ("time_s", "Time, s"),
        ("frequency_hz", "Frequency, Hz"),
        ("cycles", "Cycles"),
        ("mean_cof", "Mean cof"),  # no unit that is known
        ("_c", ", °C"),
        ("", ""),
    ],
)
def test_quantity_reads_the_unit_off_the_name(shown: Module, name: str, text: str) -> None:
    assert shown("quantity", name) == text


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (0, 0, "0"),
        (1234567, 0, "1,234,567"),
        (1234.5678, 2, "1,234.57"),
        (0.5, 0, "1"),
        (-3.14159, 3, "−3.142"),
        (-0.0004, 2, "0.00"),  # no minus before nothing but zeros
        (-0.006, 2, "−0.01"),
        (2, 4, "2.0000"),
        (-0.0, 1, "0.0"),
    ],
)
def test_fixed_has_the_decimals_and_groups_thousands(shown: Module, value: float, decimals: int, text: str) -> None:
    assert shown("fixed", value, decimals) == text


def test_fixed_rounds_to_whole_numbers_by_itself(shown: Module) -> None:
    assert shown("fixed", 2.4) == "2"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0, 3, "0"),
        (1, 3, "1.00"),
        (3.14159, 3, "3.14"),
        (-3.14159, 2, "−3.1"),
        (31415.9, 3, "31,400"),
        (999.6, 3, "1,000"),
        (0.0012345, 3, "0.00123"),
        (0.0001, 1, "0.0001"),
        (0.000099, 2, "9.9e−5"),
        (-0.00002, 2, "−2.0e−5"),
        (999_999, 2, "1,000,000"),
        (1e6, 3, "1.00e+6"),
        (7.2346e9, 4, "7.235e+9"),
    ],
)
def test_significant_has_the_digits(shown: Module, value: float, digits: int, text: str) -> None:
    assert shown("significant", value, digits) == text


def test_significant_has_three_digits_by_itself(shown: Module) -> None:
    assert shown("significant", 2 / 3) == "0.667"


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (21.23456, 0.34, "21.2 ± 0.3"),
        (21.23456, 0.14, "21.23 ± 0.14"),  # a first digit of 1 is followed by a second one
        (21.23456, 0.19999, "21.23 ± 0.20"),
        (0.13412, 0.00112, "0.1341 ± 0.0011"),
        (1234.5, 25, "1,235 ± 25"),
        (-0.2, 0.05, "−0.20 ± 0.05"),
        (5, 0, "5.000"),
        (5, None, "5.000"),
        (5, math.nan, "5.000"),
        (5, math.inf, "5.000"),
        (1, 3e-12, "1.00000000 ± 0.00000000"),  # no more than eight decimals
        (None, 1, NONE),
        (math.nan, 1, NONE),
    ],
)
def test_with_sd_shows_the_value_to_the_place_of_its_deviation(shown: Module, value: Any, sd: Any, text: str) -> None:
    assert shown("withSd", value, sd) == text


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((0,), "0"),
        ((7,), "7"),
        ((7000.4,), "7,000"),
        ((12345, 10000, 15000), "12,300"),
        ((12345, 12000, 12150), "12,350"),
        ((12345, 0, 20), "12,345"),  # as narrow as this, nothing is rounded off
        ((12345, 0, 1e9), "12,000"),  # but two digits stay, however wide it is
        ((123_456,), "123,500"),
        ((3, 0, 1e6), "3"),
        ((12345, 10000, None), "12,350"),
        ((-4321, 0, 1e6), "−4,300"),
    ],
)
def test_cycles_are_rounded_to_what_their_interval_allows(shown: Module, values: tuple[Any, ...], text: str) -> None:
    assert shown("cycles", *values) == text


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (1234, 5678, "1,200 to 5,700"),
        (0, 400, "0 to 400"),
        (1234, None, "over 1,200"),
        (12_345, None, "over 12,000"),
        (None, None, NONE),
        (None, 5678, "– to 5,680"),
        (100, 100, "100 to 100"),
    ],
)
def test_interval_names_both_ends(shown: Module, low: Any, high: Any, text: str) -> None:
    assert shown("interval", {"0.05": low, "0.5": 3, "0.95": high}) == text


@pytest.mark.parametrize(
    ("share", "decimals", "text"),
    [(0.123, 0, "12 %"), (0.123, 1, "12.3 %"), (0, 0, "0 %"), (1, 0, "100 %"), (-0.2, 0, "−20 %"), (1.5, 1, "150.0 %")],
)
def test_percent(shown: Module, share: float, decimals: int, text: str) -> None:
    assert shown("percent", share, decimals) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0 %"),
        (1e-9, "< 1 %"),
        (0.00499, "< 1 %"),
        (0.005, "1 %"),
        (0.5, "50 %"),
        (0.995, "100 %"),
        (0.9951, "> 99 %"),
        (0.999999, "> 99 %"),
        (1, "100 %"),
    ],
)
def test_a_probability_is_never_rounded_to_certainty(shown: Module, value: float, text: str) -> None:
    assert shown("probability", value) == text


SECOND, MINUTE, HOUR, DAY = 1000, 60_000, 3_600_000, 86_400_000


@pytest.mark.parametrize(
    ("ms", "text"),
    [
        (0, "just now"),
        (4999, "just now"),
        (-HOUR, "just now"),  # a clock that is ahead
        (5 * SECOND, "5 s ago"),
        (59_999, "59 s ago"),
        (MINUTE, "1 min ago"),
        (59 * MINUTE, "59 min ago"),
        (HOUR, "1 h ago"),
        (23 * HOUR, "23 h ago"),
        (DAY, "1 day ago"),
        (2 * DAY, "2 days ago"),
        (364 * DAY, "364 days ago"),
        (365 * DAY, "1 year ago"),
        (800 * DAY, "2 years ago"),
    ],
)
def test_age_is_in_one_unit(shown: Module, ms: int, text: str) -> None:
    now = 1_800_000_000_000
    assert shown("age", now - ms, now) == text


def test_age_is_counted_from_now(shown: Module) -> None:
    assert shown.evaluate("m => m.age(Date.now() - 3 * 60_000)") == "3 min ago"


@pytest.mark.parametrize(
    ("text", "shown_as"),
    [
        ("2026-11-02T08:00:00+01:00", "2 Nov 2026, 08:00"),
        ("2026-07-02T22:30:00Z", "3 Jul 2026, 00:30"),  # on the reader's clock, two hours ahead in summer
        ("", NONE),
        (None, NONE),
    ],
)
def test_a_moment_is_on_the_reader_s_clock(shown: Module, text: str | None, shown_as: str) -> None:
    assert shown("moment", text) == shown_as


def test_clock(shown: Module) -> None:
    assert shown.evaluate("m => m.clock(new Date('2026-11-02T08:05:09+01:00'))") == "08:05:09"


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("stationary_stribeck", "Stationary Stribeck test"),
        ("dynamic_stribeck", "Dynamic Stribeck test"),
        ("duty_cycles", "Duty cycles"),
        ("run_in", "Run-in"),
        ("maintenance", "Maintenance"),
        ("another_kind", "Another kind"),
    ],
)
def test_kind_name(shown: Module, kind: str, text: str) -> None:
    assert shown("kindName", kind) == text


@pytest.mark.parametrize(("name", "text"), [("oil_change", "Oil change"), ("x", "X"), ("", ""), (7, "7")])
def test_words(shown: Module, name: object, text: str) -> None:
    assert shown("words", name) == text


@pytest.mark.parametrize(
    ("ms", "text"),
    [(0, "1 s"), (400, "1 s"), (1499, "1 s"), (1500, "2 s"), (59_999, "60 s"), (60_000, "1 min"), (95_000, "2 min")],
)
def test_seconds(shown: Module, ms: int, text: str) -> None:
    assert shown("seconds", ms) == text


@pytest.mark.parametrize("name", ["fixed", "significant", "withSd", "cycles", "percent", "probability"])
def test_what_is_no_number_is_a_dash(shown: Module, name: str) -> None:
    assert [shown(name, value, *([1] if name == "withSd" else [])) for value in NOTHING] == [NONE] * len(NOTHING)
    assert shown.evaluate(f"m => m.{name}(undefined)") == NONE
