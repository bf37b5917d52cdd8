"""The page of a clutch whose runs are long raw records: what it loads in all, on the wire, and that it shows them."""

import csv
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from storage import raw_columns, runs
from storage.engine.opening import open_database
from tests.browser.driving import Watched, Wire
from tests.browser.lives import loops, post
from tests.support import Server, serving, stationary, torque_nm

pytestmark = pytest.mark.browser

#: Of each kind of test, and samples of each record with four channels.
TESTS, SAMPLES = 10, 200_000
#: Bytes that opening the page may load, files and answers together, nothing of it in the browser's cache.
MOST_BYTES = 1_500_000
#: Rows of a chart's table that are shown.
MOST_ROWS = 400
#: A peak that only one sample of a record has, Nm.
PEAK = 61.8


def record(cycles: float, rng: np.random.Generator, *, swept: bool) -> dict[str, np.ndarray[Any, Any]]:
    """Three pressures, at each the speeds stepped through or swept to and fro; full doubles, as no recorder rounds them."""
    wear = 0.9 * (1 - (1 + cycles / 6000) ** -0.9)
    level = np.repeat((4.0, 5.0, 6.0), -(-SAMPLES // 3))[:SAMPLES]
    phase = np.arange(SAMPLES) % (SAMPLES // 3) / (SAMPLES // 3)
    speed = 1000 - 980 * np.cos(12 * np.pi * phase) if swept else 20 + 100 * np.floor(19 * phase)
    grid = np.linspace(0, 2000, 400)
    torque = np.choose(
        np.searchsorted((4.5, 5.5), level),
        [np.interp(speed, grid, [torque_nm(each, n, wear) for n in grid]) for each in (4.0, 5.0, 6.0)],
    )
    found = {
        "time_s": np.arange(SAMPLES) * 0.001 + 1e-5 * rng.random(SAMPLES),
        "pressure_bar": level + 0.005 * rng.standard_normal(SAMPLES),
        "speed_rpm": speed + 0.5 * rng.standard_normal(SAMPLES),
        "torque_nm": torque + 0.1 * rng.standard_normal(SAMPLES),
    }
    found["torque_nm"][SAMPLES // 2 + 1234] = PEAK
    return found


@pytest.fixture(scope="module")
def life(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Tests that were posted as plateaus and short loops, so that they are evaluated at once, and are then made raw."""
    path = tmp_path_factory.mktemp("raw") / "clutchlife.db"
    with serving(path, loaded=True) as server:
        server.http.post("/v1/clutches", json={"clutch_id": "bench"}).raise_for_status()
        for number in range(TESTS):
            post(server.http, "bench", stationary(1000.0 * number, pressures=(4.0, 5.0, 6.0)))
            post(server.http, "bench", loops(1000.0 * number + 1))
        database, rng = open_database(f"sqlite:///{path}"), np.random.default_rng(8)
        with database.writing() as connection:
            connection.exec_driver_sql("DELETE FROM channel")
            for row in runs.in_order(connection, "bench"):
                columns = record(row.cycles, rng, swept=row.kind == "dynamic_stribeck")
                raw_columns.write(connection, row.run_key, raw_columns.encoded(columns))
        database.close()
        yield server


def runs_read(page: Page, wire: Wire, count: int) -> None:
    """Wait for the channels of that many runs."""
    for _ in range(400):
        if len(wire.of("?points=")) == count:
            return
        page.wait_for_timeout(50)
    raise AssertionError(wire.loaded)


@pytest.mark.slow
@pytest.mark.parametrize("tab", ["overview", "curves", "loops", "runs", "history"])
def test_a_tab_of_a_clutch_of_raw_runs_is_light(browser: Browser, life: Server, tab: str) -> None:
    watched = Watched(browser, life.url)
    page, wire = watched.page, Wire(watched.page)
    watched.open(f"/clutches/bench#/{tab}")
    runs_read(page, wire, {"curves": 6, "loops": 6}.get(tab, 0))
    page.get_by_text("Live, as of").wait_for()
    # nothing has been overlooked: page, files, answers and runs are among it
    assert len(wire.loaded) > 50
    assert min(len(wire.of(part)) for part in ("/clutches/bench", "clutch.js")) >= 1
    assert [url for url, _ in wire.loaded if "/runs/" in url and "?points=" not in url] == []
    if tab == "loops":  # the charts show the records with their peaks
        page.locator("#chart-loop-curves[data-drawn]").wait_for()
        page.locator("#chart-loop-curves summary").click()
        expect(page.locator("#chart-loop-curves tbody tr")).to_have_count(MOST_ROWS)
        assert page.locator("#chart-loop-curves").get_by_text(f"The first {MOST_ROWS} of").is_visible()
        with page.expect_download() as saved:
            page.get_by_role("button", name="Loops: torque over speed: save data as CSV").click()
        rows = list(csv.DictReader(saved.value.path().read_text(encoding="utf-8").splitlines()))
        assert sum(float(row["friction torque, Nm"]) == PEAK for row in rows) == 6  # one a record that is drawn
    everything = sum(wire.of(""))
    print(f"{tab}: {everything} bytes, of which runs {sum(wire.of('?points='))}")
    assert everything < MOST_BYTES
    watched.close()
