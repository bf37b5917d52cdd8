"""Friction that steps at once: the second test that shows it makes it the present, whatever is known of why."""

from collections.abc import Iterable
from contextlib import closing
from typing import Any

import pytest
from fastapi.testclient import TestClient

from models.plausibility import criteria
from service.answers.verification import check_results
from storage.engine.opening import open_database
from tests.lab.plausibility.bench import with_gain
from tests.service.clients import post_run
from tests.support import one_quick, stationary

CLUTCH = "/v1/clutches/c1"
#: The tests before friction falls by a fifth, and after.
BEFORE, AFTER = range(0, 9000, 1000), (9000, 10_000, 11_000)
OIL_CHANGE = {"run_id": "m", "kind": "maintenance", "cycles": 8500, "event": "oil_change"}


def sent(client: TestClient, cycles: Iterable[int], share: float = 1.0) -> list[str]:
    """Posts tests whose torque is a share of what it was; how each was taken."""
    runs = (with_gain(stationary(at, run_id=f"s{at}", noise=0.002), share) for at in cycles)
    return [post_run(client, run)["state"] for run in runs]


def life(client: TestClient, method: str = "particle") -> dict[str, Any]:
    return client.get(f"{CLUTCH}/remaining-useful-life", params={"method": method}).json()


def warned(answer: dict[str, Any]) -> list[str]:
    return [warning["message"] for warning in answer["warnings"] if warning["code"] == "new_level"]


@pytest.mark.parametrize("share", one_quick([0.8, 0.5, 1.5]))
def test_the_second_test_of_a_new_level_is_the_present(client: TestClient, share: float) -> None:
    """One may be another clutch's and is held; with two the forecast goes on from there, and says so. Friction that falls by
    half and one that rises by half, as that of a clutch that was rebuilt and nobody said so, are levels as any other."""
    assert set(sent(client, BEFORE)) == {"accepted"}
    assert warned(life(client)) == []
    before = life(client)["current"]["fraction_of_initial"]
    assert sent(client, AFTER[:2], share) == ["held", "accepted"]
    for method in ("particle", "ukf", "grid"):
        after = life(client, method)
        assert after["held_runs"] is None
        wear = before * share - after["current"]["fraction_of_initial"]
        assert 0.0 < wear < 0.1 * before, method
        assert "since the test at 9,000 cycles" in warned(after)[0]
    assert sent(client, AFTER[2:], share) == ["accepted"]
    assert "since the test at 9,000 cycles" in warned(life(client))[0]


@pytest.mark.slow
def test_the_order_of_arrival_does_not_matter_to_a_new_level(client: TestClient) -> None:
    sent(client, reversed(AFTER), 0.8)
    sent(client, BEFORE)
    assert "since the test at 9,000 cycles" in warned(life(client))[0]


def test_a_level_begins_with_a_test_that_comes_in_before_it_and_with_the_next_where_that_is_withdrawn(
    client: TestClient,
) -> None:
    sent(client, BEFORE)
    sent(client, AFTER[1:], 0.8)
    assert "since the test at 10,000 cycles" in warned(life(client))[0]
    assert sent(client, AFTER[:1], 0.8) == ["accepted"]
    assert "since the test at 9,000 cycles" in warned(life(client))[0]
    for at, begins in (("s9000", 10_000), ("s10000", None)):
        withdrawn = client.post(f"{CLUTCH}/runs/{at}/withdraw", json={"reason": "another clutch's"})
        assert withdrawn.status_code == 200
        found = warned(life(client))
        assert (f"since the test at {begins:,} cycles" in found[0]) if begins else found == []


def test_the_first_test_after_a_declared_event_is_the_present(client: TestClient) -> None:
    """However far it is from those before: it is accepted, so it counts. The threshold that it has passed is passed."""
    sent(client, BEFORE)
    post_run(client, OIL_CHANGE)
    before = life(client)["current"]["fraction_of_initial"]
    assert sent(client, AFTER[:1], 0.6) == ["accepted"]
    for method in ("particle", "ukf", "grid"):
        after = life(client, method)
        assert 0.5 * before < after["current"]["fraction_of_initial"] < 0.6 * before, method
        assert warned(after) == []


@pytest.mark.parametrize("declared_first", [True, False])
def test_no_level_is_unexplained_once_an_event_is_declared(client: TestClient, *, declared_first: bool) -> None:
    """The advice of the warning is to send maintenance: then it must end."""
    sent(client, BEFORE)
    if declared_first:
        post_run(client, OIL_CHANGE)
    sent(client, AFTER, 0.8)
    assert bool(warned(life(client))) is not declared_first
    if not declared_first:
        post_run(client, OIL_CHANGE)
    assert warned(life(client)) == []


def test_a_run_that_another_sets_aside_is_stored_as_if_it_had_never_counted(
    client: TestClient, database_url: str
) -> None:
    """It came late, of which its receipt warns only while it is one of the history."""
    sent(client, [1000])
    assert sent(client, [0], 0.5) == ["accepted"]
    assert "late_arrival" in {warning["code"] for warning in client.get(f"{CLUTCH}/runs/s0").json()["warnings"]}
    sent(client, [2000])
    aside = client.get(f"{CLUTCH}/runs/s0").json()
    assert (aside["state"], aside["warnings"]) == ("held", [])
    client.__exit__(None, None, None)
    with closing(open_database(database_url)) as database:
        assert check_results(database, "c1").findings == ()


def test_what_is_computed_again_is_judged_again(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """A clutch stored by a release that knew no levels, so that nothing was stepped, has them as soon as its history is
    computed again: what the tests above show is the judgement's doing."""
    with monkeypatch.context() as unknown:
        unknown.setattr(criteria, "LEVEL_UNDECLARED", 1e-300)
        sent(client, BEFORE)
        sent(client, AFTER, 0.8)
    assert warned(life(client)) == []
    assert client.patch(CLUTCH, json={"torque_filter_ms": 1.0, "reason": "its amplifier"}).status_code == 200
    assert "since the test at 9,000 cycles" in warned(life(client))[0]
