"""Kind, cycles and clutch from the names of files and the cells above tables."""

import pytest

from service.runs.file_names import cycles_in, kind_in, suggested


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
        ("bench3_7000.csv", None, 7000),
        ("stationary-0.csv", "stationary_stribeck", 0),
    ],
)
def test_a_name_that_says_it(name: str, kind: str | None, cycles: float) -> None:
    assert (kind_in(name), cycles_in(name)) == (kind, cycles)


def test_a_name_that_leaves_a_doubt() -> None:
    for name in (
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
    ):
        assert cycles_in(name) is None, name
    for name in ("a.csv", "stationary_and_dynamic.csv", "7000.tdms"):
        assert kind_in(name) is None, name


@pytest.mark.parametrize(
    "form", ["KL-4712_{:05d}.xlsx", "{:d}-KL-4712.csv", "KL-4712 Stribeck {:d}.tdms", "2026-11-02_KL-4712_{:d}.mf4"]
)
def test_what_changes_in_all_names_is_the_cycles_and_what_stays_the_clutch(form: str) -> None:
    counts = (0, 1500, 3000, 6000)
    names = [form.format(cycles) for cycles in counts]
    for name, cycles in zip(names, counts, strict=True):
        found = suggested(name, names, {})
        assert (found.named.cycles, found.named.clutch_id) == (cycles, "KL-4712"), name
        assert found.file_name is not None
        assert "{clutch_id}" in found.file_name
        assert "{cycles}" in found.file_name


def test_numbers_that_count_files_are_no_cycles() -> None:
    names = [f"log_{number:03d}.csv" for number in range(101, 109)]
    assert suggested(names[0], names, {}).named.cycles is None


def test_cells_above_the_table_say_more_than_a_name() -> None:
    found = suggested("a_7000.csv", [], {"Schaltungen:": "5.000", "Kupplung": "KL-4712"})
    assert (found.named.cycles, found.named.clutch_id) == (5000, "KL-4712")
    assert (found.cycles_cell, found.clutch_cell, found.file_name) == ("Schaltungen:", "Kupplung", None)
