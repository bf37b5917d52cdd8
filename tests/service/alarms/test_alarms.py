"""Rules and events as a script uses them: raised once, acknowledged, cleared by the hysteresis; receivers learn of it."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.alarms import outbox, raising, rules
from service.alarms.rules import Silence
from service.api.alarm import AlarmIn
from service.changes import change_alarms
from service.settings import Settings
from storage import alarms
from storage.engine.database import Database
from tests.service.alarms.receiving import SECRET, Receiver, receiving, signed_rightly
from tests.service.clients import filled_client, post_run
from tests.service.jobs.waiting import until
from tests.service.web.routes.granting import context_of
from tests.storage.samples import write_to
from tests.support import post_tests, stationary

CYCLES = (0.0, 1000.0, 2000.0, 3000.0)


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    with receiving() as made:
        yield made


@filled_client
def life(client: TestClient) -> None:
    """A clutch `e` with as many tests as a prognosis needs."""
    assert client.post("/v1/clutches", json={"clutch_id": "e"}).status_code == 201
    post_tests(client, *CYCLES, to="e")


def rule(client: TestClient, **fields: Any) -> dict[str, Any]:
    answer = client.post("/v1/alarms", json={"clutch_id": "e", **fields})
    assert answer.status_code == 201, answer.text
    return answer.json()


def events(client: TestClient, **arguments: str) -> list[dict[str, Any]]:
    answer = client.get("/v1/alarms/events", params=arguments)
    assert answer.status_code == 200, answer.text
    return answer.json()["items"]


def at_least(client: TestClient) -> float:
    return client.get("/v1/clutches/e/remaining-useful-life").json()["at_least"]


def test_a_posted_run_raises_an_alarm_once_and_not_again_when_it_is_acknowledged(life: TestClient) -> None:
    limit = at_least(life) - 1
    rule(life, quantity="remaining_cycles", probability=0.05, below=limit, median_within=None)
    assert events(life) == []
    for cycles in (3500, 4000):
        post_run(life, {"kind": "duty_cycles", "cycles": cycles, "duty": {"cycles": 500}}, "e")
    (raised,) = events(life)
    assert raised["state"] == "raised"
    assert raised["value"] < limit == raised["limit"]
    assert raised["message"].startswith("e: safe for ")
    listed = next(item for item in life.get("/v1/clutches").json()["items"] if item["clutch_id"] == "e")
    assert (listed["open_alarms"], listed["what_to_do"]) == (1, listed["action"])
    address = f"/v1/alarms/events/{raised['event_id']}"
    seen = life.post(f"{address}/acknowledge", json={"note": "ordered"})
    assert seen.status_code == 200
    assert life.get("/v1/clutches/e").json()["open_alarms"] == 0
    said = {"state": "acknowledged", "note": "ordered", "acknowledged_by": "local"}
    assert said.items() <= seen.json().items()
    post_run(life, {"kind": "duty_cycles", "cycles": 4500, "duty": {"cycles": 500}}, "e")
    (still,) = events(life, state="open")
    assert still == seen.json() == life.get(address).json()
    assert life.post(f"{address}/acknowledge").json() == still


def test_a_rule_is_made_once_and_a_clutch_has_so_many_and_no_more(
    life: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(change_alarms, "MAX_RULES", 2)
    body = {"clutch_id": "e", "quantity": "remaining_cycles", "probability": 0.05, "below": 4000}
    first, again = (life.post("/v1/alarms", json=body) for _ in range(2))
    assert (first.status_code, again.status_code) == (201, 200)
    assert again.json()["alarm_id"] == first.json()["alarm_id"]
    assert life.get(first.headers["Location"]).json() == first.json()
    other = rule(life, quantity="remaining_cycles", below=2.0)
    ids = [item["alarm_id"] for item in life.get("/v1/alarms").json()["items"]]
    assert sorted(ids) == sorted((first.json()["alarm_id"], other["alarm_id"]))
    refused = life.post("/v1/alarms", json=body | {"below": 3.0})
    assert refused.status_code == 409
    assert "there are 2 rules of clutch 'e', which is the maximum" in refused.json()["detail"]
    assert life.put(f"/v1/alarms/{ids[0]}", json=body | {"below": 3.0}).status_code == 200
    assert life.post("/v1/alarms", json=body | {"below": 3.0}).status_code == 200  # it is there already
    several = [life.post("/v1/alarms", json={"quantity": "held_runs", "above": n}).status_code for n in range(3)]
    assert several == [201, 201, 409]


def test_a_name_stands_in_one_line(client: TestClient) -> None:
    watched = {"quantity": "remaining_cycles", "below": 1.0}
    for name in ("a\x1b[31m", "two\nlines", "a\x00", "gpj.exe\u202e", "a\x85b"):
        for address, body in (
            ("alarms", watched | {"name": name}),
            ("alarms", watched | {"kind": {"fluid": name}}),
            ("webhooks", {"url": "http://127.0.0.1/x", "name": name}),
            ("clutches", {"clutch_id": "f", "fluid": name}),
        ):
            answer = client.post(f"/v1/{address}", json=body)
            assert answer.status_code == 422
            assert "must be one line of text without control characters" in answer.json()["detail"]
        assert AlarmIn.model_validate(watched | {"name": name}).name == name  # what is stored already stays readable
    assert client.post("/v1/alarms", json=watched | {"name": "Kühlöl 日本 🙂"}).status_code == 201


def test_an_acknowledged_alarm_goes_on_where_an_end_is_taken_back(life: TestClient) -> None:
    """It was raised again, and who had acknowledged it was called again."""
    rule(life, quantity="remaining_cycles", below=1e9)
    (raised,) = events(life)
    before = life.post(f"/v1/alarms/events/{raised['event_id']}/acknowledge").json()
    for cycles in (4000, 4100):
        end = {"kind": "maintenance", "event": "end_of_life", "cycles": cycles, "reason": "other"}
        run_id = life.post("/v1/clutches/e/runs", json=end).json()["run_id"]
        assert [event["state"] for event in events(life)] == ["cleared"]
        assert life.post(f"/v1/clutches/e/runs/{run_id}/withdraw", json={"reason": "too early"}).status_code == 200
        assert events(life) == [before]
    life.put(f"/v1/alarms/{raised['alarm_id']}", json={"clutch_id": "e", "quantity": "remaining_cycles", "below": 1.0})
    life.put(f"/v1/alarms/{raised['alarm_id']}", json={"clutch_id": "e", "quantity": "remaining_cycles", "below": 1e9})
    assert [event["state"] for event in events(life)] == ["raised", "cleared"]


def test_it_is_cleared_by_the_hysteresis_and_raised_again(life: TestClient) -> None:
    value = at_least(life)
    made = rule(life, quantity="remaining_cycles", below=value + 1, hysteresis=0.0, median_within=None)
    (raised,) = events(life, state="raised")
    address = f"/v1/alarms/{made['alarm_id']}"
    body = {name: made[name] for name in ("clutch_id", "quantity", "median_within")}
    # the value lies above the new limit, and within its hysteresis
    assert life.put(address, json=body | {"below": value - 1, "hysteresis": 0.5}).status_code == 200
    assert [event["event_id"] for event in events(life, state="raised")] == [raised["event_id"]]
    life.put(address, json=body | {"below": value - 1, "hysteresis": 0.0})
    assert events(life, state="open") == []
    life.put(address, json=body | {"below": value + 1})
    assert [event["state"] for event in events(life)] == ["raised", "cleared"]


def test_a_bound_calls_only_where_the_tests_show_the_end_and_again_on_the_way_to_it(
    client: TestClient, receiver: Receiver
) -> None:
    """A life that ends at 13,000 cycles, with a limit of 4,000. After three tests the safe bound alone is below it."""
    body = {"url": receiver.url, "secret": SECRET, "cleared": True}
    assert client.post("/v1/webhooks", json=body).status_code == 201
    client.post("/v1/clutches", json={"clutch_id": "e"})
    rule(client, quantity="remaining_cycles", below=4000)
    rule(client, quantity="remaining_cycles", below=4000, median_within=None, name="bound alone")
    called: dict[float, list[str]] = {}
    for cycles in range(0, 13_001, 1000):
        post_run(client, stationary(cycles, wear=cycles / 26_000), "e")
        called[cycles] = [event["message"] for event in events(client, state="raised") if event["name"] == ""]
        if cycles == 2000:
            assert [event["name"] for event in events(client)] == ["bound alone"]
        for event in events(client, state="raised"):
            client.post(f"/v1/alarms/events/{event['event_id']}/acknowledge", json={"note": "seen"})
    first, *others = raised_at = [cycles for cycles, messages in called.items() if messages]
    assert 5000 <= first <= 11_000, "not after three tests, and not late"
    assert 1 <= len(others) <= len(rules.STEPS)
    messages = [called[cycles][0] for cycles in raised_at]
    assert all("(95 %), 50 % chance of " in message or "no further cycle" in message for message in messages)
    assert [share for share in ("50 %", "25 %") if f"less than {share} of it is left" in "".join(messages)]
    raised = sorted(event["event_id"] for event in events(client))
    until(lambda: len(receiver.bodies) >= len(raised))
    assert sorted(sent["event"]["event_id"] for sent in receiver.bodies) == raised, "each of them once"
    assert {sent["type"] for sent in receiver.bodies} == {"alarm.raised"}, "what takes another's place is not over"


@pytest.mark.parametrize(
    ("limit", "value", "raised", "kept"),
    [
        ({"quantity": "health", "below": 0.5}, 0.49, True, True),
        ({"quantity": "health", "below": 0.5}, 0.54, False, True),
        ({"quantity": "health", "below": 0.5}, 0.56, False, False),
        ({"quantity": "silent_hours", "above": 10.0}, 10.1, True, True),
        ({"quantity": "silent_hours", "above": 10.0}, 9.1, False, True),
        ({"quantity": "silent_hours", "above": 10.0}, 8.9, False, False),
    ],
)
def test_an_alarm_stays_within_the_hysteresis_of_either_limit(
    limit: dict[str, Any], value: float, raised: bool, kept: bool
) -> None:
    rule_in_force = AlarmIn.model_validate(limit | {"hysteresis": 0.1})
    finding = rules.Finding(value=value, words="")
    assert rules.passes(rule_in_force, finding) is raised
    assert rules.passes(rule_in_force, finding, rule_in_force.hysteresis) is kept


def test_each_quantity_raises(life: TestClient) -> None:
    """A test whose torque has risen is held, and off the course of those before it; that no run is held clears one alarm."""
    said = {
        "remaining_cycles": ({"probability": 0.5, "below": 1e9}, "50 % chance of "),
        "health": ({"below": 1.0}, " % (limit: 100 %)"),
        "shudder_margin": ({"below": 100.0}, "slope of friction at 100 rpm"),
        "off_course": ({}, "off course"),
        "held_runs": ({}, "1 held run waits"),
        "state": ({}, "function check: 1 run is held and does not count; "),
    }
    for quantity, (limit, _) in said.items():
        rule(life, quantity=quantity, **limit)
    receipt = post_run(life, stationary(4000.0, wear=0.0), "e")
    assert receipt["state"] == "held"
    messages = {event["quantity"]: event["message"] for event in events(life, state="raised")}
    assert messages.keys() == said.keys()
    for quantity, (_, words) in said.items():
        assert words in messages[quantity]
    life.post(f"/v1/clutches/e/runs/{receipt['run_id']}/withdraw", json={"reason": "a slip"})
    assert "held_runs" in {event["quantity"] for event in events(life, state="cleared")}


def test_the_margin_to_shudder_is_that_of_the_newest_test(life: TestClient) -> None:
    """As of a clutch that has no other, though an older one comes in last."""
    life.post("/v1/clutches", json={"clutch_id": "f"})
    for name, cycles in (("e", 2500.0), ("f", CYCLES[-1])):
        rule(life, clutch_id=name, quantity="shudder_margin", below=100.0)
        post_run(life, stationary(cycles), name)
    one, other = (event["value"] for event in events(life))
    assert one == other


def test_days_are_counted_at_the_pace_of_the_runs(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "e"})
    for day, cycles in enumerate(CYCLES, start=1):
        client.post("/v1/clutches/e/runs", json=stationary(cycles) | {"started_at": f"2026-01-{day:02d}T08:00:00Z"})
    rule(client, quantity="remaining_days", below=1000)
    (raised,) = events(client)
    assert raised["value"] == pytest.approx(at_least(client) / 1000, rel=1e-6)
    last = f"{len(CYCLES)} Jan 2026"
    assert f"days at the pace so far, counted from the last run on {last} (limit: 1,000 days; less" in raised["message"]


def test_a_new_verdict_is_an_alarm(life: TestClient) -> None:
    rule(life, quantity="verdict", any_of=["model_adequate", "insufficient_data", "cause_named", "cause_ambiguous"])
    report = life.post("/v1/clutches/e/diagnoses", json={}, headers={"Prefer": "wait=120"}).json()
    (raised,) = events(life)
    assert report["verdict"].replace("_", " ") in raised["message"]


@pytest.mark.slow
def test_a_silent_rig_is_an_alarm_and_a_state(life: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outbox, "CLOCK_SECONDS", 0.1)
    rule(life, quantity="silent_hours", above=0.5 / 3600)
    (raised,) = until(lambda: events(life))
    clutch = life.get("/v1/clutches/e").json()
    assert clutch["state"]["name"] == "check"
    assert "the rig is silent" in clutch["state"]["why"]
    assert "the rig is silent" in clutch["headline"]
    assert "e" in [item["clutch_id"] for item in life.get("/v1/clutches?state=check").json()["items"]]
    made = life.put(f"/v1/alarms/{raised['alarm_id']}", json={"quantity": "silent_hours", "above": 1, "clutch_id": "e"})
    assert made.status_code == 200
    assert "silent" not in life.get("/v1/clutches/e").json()["state"]["why"]
    assert [event["state"] for event in events(life)] == ["cleared"]


def test_only_who_measures_raises_an_alarm_of_silence_and_only_a_run_ends_it(life: TestClient) -> None:
    """Whatever was stored meanwhile compared the wall clock: set forward it raised alarms, set back it cleared them."""
    database = context_of(life).database
    with database.reading() as connection:
        since = alarms.last_heard(connection, ["e"])["e"]
    made = rule(life, quantity="silent_hours", above=48)
    assert events(life) == []
    for silence in (None, Silence(since, 47.9), Silence("2020-01-01T00:00:00+00:00", 1e5)):
        write_to(database, raising.evaluate, "e", silence)
        assert events(life) == []
    for silence in (Silence(since, 50.0), None):
        write_to(database, raising.evaluate, "e", silence)
        (raised,) = events(life)
    assert (raised["value"], raised["state"]) == (50.0, "raised")
    for change in ({"archived": False, "reason": "none"}, {"fluid": "x"}):
        life.patch("/v1/clutches/e", json=change)
    assert events(life) == [raised]
    address, body = f"/v1/alarms/{made['alarm_id']}", {"clutch_id": "e", "quantity": "silent_hours", "hysteresis": 0.0}
    for limit, state in ((49, "raised"), (51, "cleared")):
        assert life.put(address, json=body | {"above": limit}).status_code == 200
        assert [event["state"] for event in events(life)] == [state]
    write_to(database, raising.evaluate, "e", Silence(since, 52.0))
    assert [event["state"] for event in events(life)] == ["raised", "cleared"]
    post_run(life, stationary(4000.0), "e")
    write_to(database, raising.evaluate, "e", Silence(since, 53.0))
    assert [event["state"] for event in events(life)] == ["cleared", "cleared"]


def test_a_wall_clock_that_is_set_makes_no_rig_silent_nor_hides_one(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall, passed = datetime(2026, 11, 2, 10, tzinfo=UTC), 1000.0
    box, stamps = outbox.Outbox(database, Settings()), {"a": wall.isoformat(), "b": wall.isoformat()}
    monkeypatch.setattr(outbox, "datetime", SimpleNamespace(now=lambda _: wall, fromisoformat=datetime.fromisoformat))
    monkeypatch.setattr(outbox, "time", SimpleNamespace(monotonic=lambda: passed))

    def hours() -> dict[str, float]:
        return {name: round(silence.hours, 6) for name, silence in box._silences(stamps).items()}

    wall += timedelta(hours=2)
    assert hours() == {"a": 2.0, "b": 2.0}, "what a start finds"
    for days in (10, -20):
        wall += timedelta(days=days)
        passed += 3600.0
        stamps["b"] = wall.isoformat()
        assert hours() == {"a": 3.0 if days > 0 else 4.0, "b": 0.0}
    stamps["c"] = (wall + timedelta(days=3)).isoformat()
    assert hours() == {"a": 4.0, "b": 0.0, "c": 0.0}
    passed += 3600.0
    assert hours() == {"a": 5.0, "b": 1.0, "c": 1.0}
    # its run came while the clock was ten days behind, and is seen first after the clock was set right
    stamps["d"] = (wall - timedelta(days=10)).isoformat()
    assert round(box._silences(stamps, timedelta(days=10).total_seconds())["d"].hours, 6) == 0.0


def test_a_kind_is_watched_as_a_whole_and_an_archived_clutch_is_not(client: TestClient) -> None:
    for name, fluid in (("a", "ATF"), ("b", "other")):
        client.post("/v1/clutches", json={"clutch_id": name, "fluid": fluid})
    answer = client.post("/v1/alarms", json={"quantity": "state", "kind": {"fluid": "other"}})
    assert answer.status_code == 201
    assert [event["clutch_id"] for event in events(client)] == ["b"]
    client.patch("/v1/clutches/b", json={"archived": True})
    assert [event["state"] for event in events(client)] == ["cleared"]
    client.patch("/v1/clutches/b", json={"archived": False})
    assert len(events(client, state="raised")) == 1


@pytest.mark.parametrize(
    "body",
    [
        {"quantity": "remaining_cycles"},
        {"quantity": "remaining_cycles", "above": 4},
        {"quantity": "remaining_cycles", "below": 4, "probability": 0.3},
        {"quantity": "held_runs", "below": 1},
        {"quantity": "silent_hours", "above": 0},
        {"quantity": "off_course", "above": 0},
        {"quantity": "held_runs", "any_of": ["failure"]},
        {"quantity": "held_runs", "clutch_id": "e", "kind": {}},
        {"quantity": "unheard_of"},
        {"quantity": "held_runs", "clutch_id": "nobody"},
    ],
    ids=str,
)
def test_a_rule_that_says_nothing_is_refused(shared_client: TestClient, body: dict[str, Any]) -> None:
    status = 404 if body.get("clutch_id") == "nobody" else 422
    assert shared_client.post("/v1/alarms", json=body).status_code == status
    assert shared_client.get("/v1/alarms").json()["items"] == []


def webhook(client: TestClient, receiver: Receiver, **more: Any) -> str:
    answer = client.post("/v1/webhooks", json={"url": receiver.url, "secret": SECRET, **more})
    assert answer.status_code == 201, answer.text
    assert SECRET not in answer.text
    return answer.json()["webhook_id"]


def test_a_receiver_is_sent_a_signed_request(life: TestClient, receiver: Receiver) -> None:
    name = webhook(life, receiver)
    rule(life, quantity="remaining_cycles", below=1e9)
    (body,) = receiver.await_requests(1)
    (path, headers, raw) = receiver.requests[0]
    assert path == "/hook"
    assert signed_rightly(headers, raw)
    (raised,) = events(life)
    assert body == {"type": "alarm.raised", "delivery_id": headers["Clutchlife-Delivery"], "event": raised}
    life.post("/v1/clutches/e/runs", json=stationary(4000.0))
    (item,) = deliveries(life, name)
    assert (item["state"], item["status"], item["event_id"]) == ("delivered", 200, raised["event_id"])
    assert len(receiver.requests) == 1


def deliveries(client: TestClient, webhook_id: str, state: str = "delivered") -> list[dict[str, Any]]:
    """A receiver's deliveries, once the newest is in that state."""

    def listed() -> list[dict[str, Any]]:
        return client.get(f"/v1/webhooks/{webhook_id}/deliveries").json()["items"]

    until(lambda: [item["state"] for item in listed()[:1]] == [state])
    return listed()


def test_a_receiver_that_fails_is_tried_again_with_the_same_body(life: TestClient, receiver: Receiver) -> None:
    name = webhook(life, receiver)
    receiver.status = 500
    rule(life, quantity="remaining_cycles", below=1e9)
    receiver.await_requests(1)
    receiver.status = 204
    receiver.await_requests(2)
    first, second = receiver.requests[:2]
    assert first[2] == second[2]
    assert first[1]["Clutchlife-Delivery"] == second[1]["Clutchlife-Delivery"]
    (item,) = deliveries(life, name)
    assert (item["state"], item["attempts"], item["problem"]) == ("delivered", 2, None)
    assert life.delete(f"/v1/webhooks/{name}").status_code == 204
    assert life.get(f"/v1/webhooks/{name}/deliveries").status_code == 404
    assert life.get("/v1/webhooks").json()["items"] == []


def test_a_deleted_rule_clears_its_alarm_and_that_is_sent_where_wanted(life: TestClient, receiver: Receiver) -> None:
    webhook(life, receiver, cleared=True)
    address = f"/v1/alarms/{rule(life, quantity='remaining_cycles', below=1e9)['alarm_id']}"
    receiver.await_requests(1)
    assert life.delete(address).status_code == 204
    assert [event["state"] for event in events(life)] == ["cleared"]
    assert life.get(address).status_code == 404
    bodies = receiver.await_requests(2)
    assert [body["type"] for body in bodies] == ["alarm.raised", "alarm.cleared"]


def test_the_test_button_says_how_it_went(life: TestClient, receiver: Receiver) -> None:
    made = rule(life, quantity="remaining_cycles", below=1)
    nobody = life.post(f"/v1/alarms/{made['alarm_id']}/test").json()
    assert nobody == {"deliveries": [], "message": "there is no receiver: add a webhook"}
    name = webhook(life, receiver)
    tested = life.post(f"/v1/alarms/{made['alarm_id']}/test").json()
    assert tested["message"] == "1 of 1 receivers took the test"
    assert receiver.bodies[0]["type"] == "alarm.test"
    assert events(life) == []
    receiver.status = 503
    failed = life.post(f"/v1/webhooks/{name}/test").json()
    assert failed["deliveries"][0]["state"] == "failed"
    assert failed["deliveries"][0]["problem"] == "the receiver answered 503"


def test_a_secret_that_the_service_makes_is_shown_once_and_a_receiver_of_one_clutch_learns_of_no_other(
    life: TestClient, receiver: Receiver
) -> None:
    made = life.post("/v1/webhooks", json={"url": receiver.url, "clutch_id": "c1"}).json()
    assert len(made["secret"]) >= 32
    assert life.get(f"/v1/webhooks/{made['webhook_id']}").json()["secret"] is None
    rule(life, quantity="remaining_cycles", below=1e9)
    life.post("/v1/alarms", json={"clutch_id": "c1", "quantity": "state"})
    (body,) = receiver.await_requests(1)
    assert body["event"]["clutch_id"] == "c1"
    assert signed_rightly(receiver.requests[0][1], receiver.requests[0][2], made["secret"])
