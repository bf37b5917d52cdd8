"""A rig's first file is described once on the page; its second is taken without a question."""

import io
from typing import Any

import openpyxl
import pytest
from playwright.sync_api import Page, expect

from tests.browser.driving import Watched, drop, turned
from tests.journeys.dashboard.test_axe import violations
from tests.service.web.test_import_preview import german
from tests.support import ONCE, SPEEDS_RPM, Server, filled_service, stationary

pytestmark = pytest.mark.browser


@filled_service
def server(running: Server) -> None:
    running.http.post("/v1/clutches", json={"clutch_id": "bench3-017"}).raise_for_status()


def workbook(cycles: int) -> bytes:
    """A German workbook with a title block and a row of units, its torque Mx."""
    book = openpyxl.Workbook()
    sheet = book.active
    for line in german(cycles, torque="Mx").decode("latin-1").splitlines():
        cells = [cell.replace(",", ".") for cell in line.split(";")]
        sheet.append([float(cell) if cell.replace(".", "").isdigit() else cell for cell in cells])
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()


@pytest.mark.parametrize(
    ("ending", "content", "torque"),
    [("csv", german, "Mz"), pytest.param("xlsx", workbook, "Mx", marks=pytest.mark.slow)],
)
def test_the_second_file_of_a_rig_is_taken_without_a_question(
    watched: Watched, server: Server, ending: str, content: Any, torque: str
) -> None:
    rig = f"bench-3-{torque}"
    first, second = (1000, 2000) if ending == "csv" else (3000, 4000)
    page = opened(watched)
    drop(page, {f"Stat_{first}_a.{ending}": content(first)})
    dialog = page.get_by_role("dialog", name="Send a run")
    expect(dialog.get_by_text("Its reading is suggested")).to_be_visible()  # no title says which column is the torque
    expect(dialog.get_by_label(f"Channel of {torque}")).to_have_value("torque_nm")
    expect(dialog.get_by_label(f"Unit of {torque}")).to_have_value("kNm")
    expect(dialog.get_by_label("Kind of test")).to_have_value("stationary_stribeck")
    dialog.get_by_role("button", name="Send", exact=True).click()  # the browser asks for the confirmation
    expect(dialog.get_by_text("3 curves are fitted")).to_be_visible()
    expect(dialog.get_by_label("File names")).to_have_value(f"Stat_{{cycles}}_a.{ending}")
    assert server.http.get("/v1/clutches/bench3-017/runs").json()["items"] == [] or ending == "xlsx"
    dialog.get_by_label("Name of the rig").fill(rig)
    dialog.get_by_label("File names").fill(f"Stat_{{cycles}}_*.{ending}")
    dialog.get_by_role("button", name="Confirm and save as rig profile").click()
    expect(dialog.get_by_text(f"Read by the rig profile {rig}.")).to_be_visible()
    dialog.get_by_role("button", name="Send", exact=True).click()
    expect(dialog.get_by_text("Stored", exact=True)).to_be_visible()

    page = opened(watched)
    drop(page, {f"Stat_{second}_b.{ending}": content(second)})
    expect(page.get_by_role("dialog").get_by_text("Stored", exact=True)).to_be_visible()
    receipt = server.http.get("/v1/clutches/bench3-017/runs").json()["items"][-1]
    assert (receipt["cycles"], receipt["kind"], receipt["file"]["rig"]) == (second, "stationary_stribeck", rig)
    channels = server.http.get(f"/v1/clutches/bench3-017/runs/{receipt['run_id']}").json()["channels"]
    sent = stationary(second, pressures=(4.0, 5.0, 6.0), speeds=SPEEDS_RPM[::4])
    assert channels["torque_nm"] == pytest.approx(sent["channels"]["torque_nm"])


def test_one_confirmation_is_for_all_files_that_were_dropped_together(watched: Watched, server: Server) -> None:
    page = watched.open("/")
    page.get_by_text("Live, as of").wait_for()
    server.http.post("/v1/clutches", json={"clutch_id": "KL-4712"}).raise_for_status()
    counts = (0, 1500, 3000, 4500)
    drop(page, {f"KL-4712_{cycles:05d}.csv": german(cycles, torque="My") for cycles in counts})
    dialog = page.get_by_role("dialog", name="Send 4 runs")
    expect(dialog.get_by_label("Clutch", exact=True)).to_have_value("KL-4712")
    expect(dialog.get_by_text("suggested by the files’ names and title blocks")).to_have_count(5)
    for field, cycles in zip(dialog.get_by_label("Duty cycles since new").all(), counts, strict=True):
        expect(field).to_have_value(str(cycles))
    dialog.get_by_label("The channels, units and rows").first.check()
    for place in range(len(counts)):
        expect(dialog.get_by_text("Ready to send.").nth(place)).to_be_visible()
    dialog.get_by_role("button", name="Send 4 runs").click()
    dialog.get_by_text("All 4 stored.").wait_for()
    runs = server.http.get("/v1/clutches/KL-4712/runs").json()["items"]
    assert [run["cycles"] for run in runs] == [*counts]


def opened(watched: Watched) -> Page:
    page = watched.open("/clutches/bench3-017")
    page.get_by_text("Live, as of").wait_for()
    return page


def test_the_importer_is_used_by_keyboard_and_passes_axe(watched: Watched) -> None:
    page = opened(watched)
    drop(page, {"other.csv": german(5000).replace(b"Mz", b"Spur")})
    dialog = page.get_by_role("dialog", name="Send a run")
    expect(dialog.get_by_label("Channel of Spur")).to_be_visible()
    dialog.get_by_label("Channel of Spur").focus()
    page.keyboard.type("torque, nm")
    expect(dialog.get_by_label("Unit of Spur")).to_have_value("kNm")
    expect(dialog.get_by_label("Channel of Spur")).to_be_focused()
    expect(dialog.get_by_label("Channel of Spur")).to_have_value("torque_nm")
    assert violations(page) == []


@pytest.mark.slow
def test_a_file_is_read_again_by_the_mended_profile(watched: Watched, server: Server) -> None:
    columns = [{"title": "p", "channel": "pressure_bar"}, {"title": "n", "channel": "speed_rpm"}]
    torque = {"title": "Mz", "channel": "torque_nm", "unit": "Nm"}
    profile = {"name": "bench-4", "kind": "stationary_stribeck", "columns": [*columns, torque]}
    assert server.http.post("/v1/rigs", json=profile).status_code == 201
    rows = "p [bar],n [1/min],Mz\n5,20,209\n5,120,219\n5,520,214\n5,1020,207\n5,1970,199\n"
    run = f"{server.url}/v1/clutches/bench3-017/runs"
    sent = {"rig": "bench-4", "filename": "tenfold.csv", "run_id": "tenfold", "cycles": 6000}
    assert ONCE.post(f"{run}/file", params=sent, content=rows).status_code == 201
    mended = profile | {"columns": [*columns, torque | {"scale": 0.1}]}
    assert server.http.put("/v1/rigs/bench-4", json=mended).status_code == 200
    page = turned(opened(watched), "runs")
    shown = page.locator("#runs details[data-run='tenfold']")
    shown.locator("summary").first.click()
    shown.get_by_role("button", name="A column was read wrongly").click()
    dialog = page.get_by_role("dialog", name="Read its file again")
    dialog.get_by_label("Rig profile").select_option("bench-4")
    dialog.get_by_label("Reason").fill("the amplifier was set to ten times")
    dialog.get_by_role("button", name="Read again").click()
    page.get_by_text("is read by the rig profile bench-4").wait_for()
    assert ONCE.get(f"{run}/tenfold").json()["channels"]["torque_nm"] == pytest.approx([20.9, 21.9, 21.4, 20.7, 19.9])
