"""What a file's name says of its run, and where it leaves a doubt."""

from collections.abc import Callable

import pytest

from tests.browser.modules import Module

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def file_name(loaded: Callable[[str], Module]) -> Module:
    return loaded("sending/file_name.js")


@pytest.mark.parametrize(
    ("name", "kind", "cycles"),
    [
        ("stationary-7000.csv", "stationary_stribeck", 7000),
        ("2026-11-02-stationary-7000.tdms", "stationary_stribeck", 7000),
        ("20261102_081500_dyn_4000_5bar.mf4", "dynamic_stribeck", 4000),
        ("bench3-017_stationary_007000.csv", "stationary_stribeck", 7000),
        ("0012000-loops.parquet", "dynamic_stribeck", 12000),
        ("stribeck 7.5k.csv.gz", "stationary_stribeck", 7500),
        ("run-0012 after 250 cycles.csv", None, 250),
        ("cycles=3_sweep.csv", "stationary_stribeck", 3),
        ("7000.csv", None, 7000),
        ("stationary-0.csv", "stationary_stribeck", 0),
    ],
)
def test_a_name_that_says_it(file_name: Module, name: str, kind: str | None, cycles: float) -> None:
    assert file_name("guess", name) == {"kind": kind, "cycles": cycles}


@pytest.mark.parametrize(
    "name",
    [
        "run-0012.csv",  # a number of the file
        "0012.csv",
        "12.csv",
        "stationary-2.csv",  # the second one, or two cycles
        "bench3.csv",
        "stationary_7000_dyn_8000.csv",  # two numbers of cycles
        "after 100 cycles to 200 cycles.csv",
        "stationary_5bar.csv",
        "stationary_2026-11-02.csv",
        "2026-11-02-1200.csv",  # a time of day, it may be
        "clutch 7000.csv",
        "measurement.csv",
    ],
)
def test_a_name_that_leaves_a_doubt_about_cycles(file_name: Module, name: str) -> None:
    assert file_name("guess", name)["cycles"] is None


@pytest.mark.parametrize("name", ["a.csv", "stationary_and_dynamic.csv", "7000.tdms"])
def test_a_name_that_leaves_a_doubt_about_the_kind(file_name: Module, name: str) -> None:
    assert file_name("guess", name)["kind"] is None
