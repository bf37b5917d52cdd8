"""A file as it would be read, before anything is stored."""

import json
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.service.clients import csv_text
from tests.service.runs.test_upload import dynamic_record, raw_record
from tests.support import SPEEDS_RPM, stationary

ADDRESS = "/v1/import/preview"


def german(cycles: int, *, torque: str = "Mz", unit: str = "kNm") -> bytes:
    """A stationary test as a German program exports it: a title block, semicolons, decimal commas, Latin-1."""
    channels = stationary(cycles, pressures=(4.0, 5.0, 6.0), speeds=SPEEDS_RPM[::4])["channels"]
    rows = zip(channels["pressure_bar"], channels["speed_rpm"], channels["torque_nm"], strict=True)
    lines = [";".join(f"{value:.7g}".replace(".", ",") for value in (p, n, m / 1000)) + ";i.O." for p, n, m in rows]
    head = ["Prüfstand;3", "Prüfer;Müller", f"Lastspiele;{cycles}", "", f"Druck;Drehzahl;{torque};Bemerkung"]
    return "\r\n".join([*head, f"bar;1/min;{unit};", *lines]).encode("latin-1")


def preview(client: TestClient, content: bytes, profile: dict[str, Any] | None = None, **query: Any) -> dict[str, Any]:
    given = {"filename": "Stat_7000_a.csv"} | query
    if profile is None:
        answer = client.post(ADDRESS, params=given, content=content)
    else:
        files = {"file": (given["filename"], content)}
        answer = client.post(ADDRESS, params=given, data={"profile": json.dumps(profile)}, files=files)
    assert answer.status_code == 200, answer.text
    return answer.json()


def chosen(shown: dict[str, Any], title: str, **values: Any) -> dict[str, Any]:
    """The profile of a preview with other values of one column."""
    profile: dict[str, Any] = shown["profile"]
    columns = [each | values if each["title"].startswith(title) else each for each in profile["columns"]]
    return profile | {"columns": columns}


def test_a_first_file_becomes_a_profile_and_the_second_needs_no_answer(client: TestClient) -> None:
    first = preview(client, german(7000))
    assert first["above"][:3] == [["Prüfstand", "3"], ["Prüfer", "Müller"], ["Lastspiele", "7000"]]
    assert first["first_rows"][0][0].startswith("4")
    assert (first["rig"], first["missing"], first["problem"]) == (None, ["cycles"], None)
    assert first["suggestion"]["map"]["torque_nm"] == "Mz"
    profile = chosen(first, "Mz", channel="torque_nm")
    second = preview(client, german(7000), profile, kind="stationary_stribeck", cycles=7000)
    assert (second["missing"], second["problem"]) == ([], None)
    assert [round(fit["pressure_bar"], 3) for fit in second["fits"]] == [4, 5, 6]
    torque = second["channels"]["torque_nm"]
    sent = stationary(7000, pressures=(4.0, 5.0, 6.0), speeds=SPEEDS_RPM[::4])
    assert torque == pytest.approx(sent["channels"]["torque_nm"])
    assert second["profile"]["file_name"] == "Stat_{cycles}_a.csv"
    assert client.get("/v1/rigs").json()["items"] == []
    assert client.get("/v1/clutches/c1/runs").json()["items"] == []  # nothing was stored

    saved = second["profile"] | {"name": "bench-3", "file_name": "Stat_{cycles}_*.csv"}
    assert client.post("/v1/rigs", json=saved).status_code == 201
    third = preview(client, german(8000), filename="Stat_8000_b.csv")
    understood = {"rig": "bench-3", "kind": "stationary_stribeck", "cycles": 8000, "missing": []}
    assert understood.items() <= third.items()
    assert preview(client, german(8000, torque="Mx"), filename="Stat_8000_b.csv")["rig"] is None  # other columns
    receipt = client.post("/v1/clutches/c1/runs/file?rig=bench-3&filename=Stat_8000_b.csv", content=german(8000)).json()
    assert [fit["pressure_bar"] for fit in receipt["fits"]] == [fit["pressure_bar"] for fit in third["fits"]]
    assert receipt["fits"][0]["parameters"] == third["fits"][0]["parameters"]


FOREIGN = "Pression [bar];Vitesse [tr/min];Couple FZG [N.m];T_amb [°C]\n"


def foreign(torque: float = 20.5) -> bytes:
    return FOREIGN.encode() + b"".join(b"5;%d;%g;21\n" % (n, torque - n / 1000) for n in (20, 120, 520, 1020, 1970))


def as_arguments(suggestion: dict[str, Any]) -> dict[str, Any]:
    """A suggestion as the arguments that confirm it."""
    mapping = ",".join(f"{channel}:{title}" for channel, title in suggestion["map"].items())
    return {"map": mapping} | {
        name: suggestion[name] for name in ("table", "time", "decimal", "missing", "good", "kind")
    }


def test_a_file_of_unknown_titles_is_refused_with_a_complete_reading_and_nothing_is_stored(client: TestClient) -> None:
    refused = client.post("/v1/clutches/c1/runs/file", params={"filename": "KL-4712_01500.csv"}, content=foreign())
    problem = refused.json()
    assert (refused.status_code, "A reading is suggested" in problem["detail"]) == (422, True)
    suggestion = problem["suggestion"]
    assert suggestion["map"] == {"torque_nm": "Couple FZG", "speed_rpm": "Vitesse", "pressure_bar": "Pression"}
    assert (suggestion["kind"], suggestion["cycles"], suggestion["clutch_id"]) == (
        "stationary_stribeck",
        1500,
        "KL-4712",
    )
    assert suggestion["rows"][0] == {"pressure_bar": 5, "speed_rpm": 20, "torque_nm": pytest.approx(20.48)}
    assert len(suggestion["rows"]) == 2
    assert 0.6 < suggestion["confidence"] < 1
    assert client.get("/v1/clutches/c1/runs").json()["items"] == []
    assert client.get("/v1/rigs").json()["items"] == []


@pytest.mark.parametrize("way", ["arguments", "profile"])
def test_one_confirmation_keeps_the_reading_as_the_rig_s_profile_which_reads_the_next_file(
    client: TestClient, way: str
) -> None:
    address, name = "/v1/clutches/c1/runs/file", "KL-4712_01500.csv"
    suggestion = client.post(address, params={"filename": name}, content=foreign()).json()["suggestion"]
    asked = {"filename": name, "cycles": suggestion["cycles"], "rig": "bench-7"}
    assert (
        client.post(address, params=asked, content=foreign()).status_code == 404
    )  # nothing is confirmed by a name alone
    if way == "arguments":
        first = client.post(address, params=asked | as_arguments(suggestion), content=foreign())
    else:
        form = {"profile": json.dumps(suggestion["profile"])}
        first = client.post(address, params=asked, data=form, files={"file": (name, foreign())})
    assert first.status_code == 201, first.text
    receipt = first.json()
    assert (receipt["cycles"], receipt["file"]["rig"]) == (1500, "bench-7")
    (saved,) = client.get("/v1/rigs").json()["items"]
    assert (saved["name"], saved["file_name"], saved["kind"]) == (
        "bench-7",
        "{clutch_id}_{cycles}.csv",
        "stationary_stribeck",
    )
    assert [column["channel"] for column in saved["columns"] if column["title"] == "T_amb"] == [None]
    following = {"filename": "KL-4712_03000.csv", "rig": "bench-7"}
    second = client.post(address, params=following, content=foreign(19.5))
    assert (second.status_code, second.json()["cycles"]) == (201, 3000)
    assert "columns_left_out" not in {warning["code"] for warning in second.json()["warnings"]}  # left out on purpose
    shown = preview(client, foreign(18.5), filename="KL-4712_04500.csv")
    assert (shown["rig"], shown["suggestion"], shown["clutch_id"]) == ("bench-7", None, "KL-4712")


def test_a_refused_run_leaves_no_profile(client: TestClient) -> None:
    mapping = {
        "map": "torque_nm:Couple FZG,speed_rpm:Vitesse",
        "rig": "half",
        "cycles": 0,
        "kind": "stationary_stribeck",
    }
    assert client.post("/v1/clutches/c1/runs/file", params=mapping, content=foreign()).status_code == 422
    assert client.get("/v1/rigs").json()["items"] == []


def test_a_preview_shows_the_suggestion_and_what_all_names_say(client: TestClient) -> None:
    names = [f"bench_{number}_7{number:02d}_{cycles}.csv" for number, cycles in enumerate((0, 1500, 3000, 4500), 4)]
    shown = preview(client, foreign(), filename=names[1], together=[name for name in names if name != names[1]])
    assert shown["suggested_run"]["cycles"] == 1500  # the other numbers that change count files
    names = [f"KL_x_{cycles:05d}.csv" for cycles in (0, 1500, 3000, 4500)]
    shown = preview(client, foreign(), filename=names[1], together=names)
    assert shown["suggested_run"] == {"kind": None, "cycles": 1500, "clutch_id": None}
    assert [column["channel"] for column in shown["columns"]] == ["pressure_bar", "speed_rpm", "torque_nm", None]
    assert (shown["problem"], shown["missing"]) == (None, ["cycles"])
    assert shown["suggestion"]["cycles"] == 1500
    head = b"Kupplung;KL-4712\nSchaltungen;5000\n\n"
    shown = preview(client, head + foreign(), filename="x.csv")
    assert shown["suggested_run"] == {"kind": None, "cycles": 5000, "clutch_id": "KL-4712"}
    assert (shown["profile"]["cycles_cell"], shown["profile"]["clutch_cell"]) == ("Schaltungen", "Kupplung")


def test_cycles_stand_in_a_cell_above_the_table(client: TestClient) -> None:
    first = preview(client, german(7000))
    profile = chosen(first, "Mz", channel="torque_nm") | {"cycles_cell": "Lastspiele", "kind": "stationary_stribeck"}
    shown = preview(client, german(7000), profile, filename="run.csv")
    assert (shown["cycles"], shown["missing"]) == (7000, [])
    client.post("/v1/rigs", json=profile | {"name": "cell", "file_name": None})
    receipt = client.post("/v1/clutches/c1/runs/file?rig=cell&filename=run.csv", content=german(7500))
    assert receipt.json()["cycles"] == 7500


def test_a_unit_is_chosen_never_taken_for_granted_and_not_overruled_in_silence(client: TestClient) -> None:
    bare = german(0, torque="M", unit="")
    profile = chosen(preview(client, bare), "M", channel="torque_nm")
    profile = chosen({"profile": profile}, "M", unit=None)
    open_ = preview(client, bare, profile, kind="stationary_stribeck", cycles=0)
    assert open_["missing"] == ["unit of M"]
    given = chosen(open_, "M", unit="kNm")
    assert preview(client, bare, given, kind="stationary_stribeck", cycles=0)["missing"] == []
    client.post("/v1/rigs", json=given | {"name": "bare", "kind": "stationary_stribeck"})
    address = "/v1/clutches/c1/runs/file?rig=bare&cycles=0"
    other = client.post(address, content=german(0, torque="M", unit="Nm"))
    assert (other.status_code, other.json()["errors"][0]["code"]) == (422, "mixed_units")
    assert client.post(address, content=german(0, torque="M", unit="kNm")).status_code == 201


def test_a_column_is_scaled_and_left_out_as_the_profile_says_whatever_its_name(client: TestClient) -> None:
    first = preview(client, german(0))
    without = preview(client, german(0), chosen(first, "Drehzahl", channel=None))
    assert "speed_rpm" in without["missing"]
    assert "speed_rpm" not in without["channels"]
    plain = preview(client, german(0), chosen(first, "Mz", channel="torque_nm"))["channels"]["torque_nm"]
    scaled = preview(client, german(0), chosen(first, "Mz", channel="torque_nm", scale=2.0, offset=-1.5))
    assert scaled["channels"]["torque_nm"] == pytest.approx([2 * value - 1.5 for value in plain])


@pytest.mark.parametrize("kind", ["stationary_stribeck", "dynamic_stribeck"])
def test_what_is_cut_of_a_record_is_shown_before_it_is_sent(client: TestClient, kind: str) -> None:
    record = raw_record() if kind == "stationary_stribeck" else dynamic_record()
    content = csv_text(record).encode()
    assert preview(client, content)["kinds"] == ["stationary_stribeck", "dynamic_stribeck"]
    shown = preview(client, content, kind=kind, cycles=0)
    assert shown["missing"] == []
    assert len(shown["pieces"]) == (24 if kind == "stationary_stribeck" else 1)
    assert len(shown["fits"]) == (3 if kind == "stationary_stribeck" else 0)
    assert len(shown["channels"]["time_s"]) <= 2000 < len(record["time_s"]) or kind == "dynamic_stribeck"


def test_a_file_that_would_be_refused_says_why_and_one_that_is_no_table_is_422(client: TestClient) -> None:
    wrong = german(0).replace(b"i.O.", b"i.O.", 1).replace(b";20;", b";abc;", 1)
    profile = chosen(preview(client, german(0)), "Mz", channel="torque_nm")
    shown = preview(client, wrong, profile, kind="stationary_stribeck")
    assert "abc" in shown["problem"]
    assert client.post(ADDRESS, content=b"\x89PNG\r\n").status_code == 422
    assert client.post(ADDRESS, content=b"").status_code == 422
    assert client.post(f"{ADDRESS}?rig=none", content=german(0)).status_code == 404
