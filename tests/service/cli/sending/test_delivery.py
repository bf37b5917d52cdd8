"""What becomes of each run that waits: stored, refused, or kept, by the answer."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx2
import pytest

from service.cli.sending.delivery import Sent, deliver
from service.cli.sending.spool import INSPECTIONS, Spool
from service.client.clutchlife import transport
from service.client.clutchlife.answers import RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service
from tests.service.cli.sending.stand_in_service import URL, Answer, StandInService, body, problem
from tests.service.cli.sending.test_spool import contents, set_aside, written
from tests.service.client.clutchlife.test_client import Clock


class Sender:
    """A sender with its files, its spool, a service, and what was reported."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.spool = Spool.of(folder / "spool", URL, "c1")
        self.service = StandInService()
        self.lines: list[str] = []
        self.clock = Clock()

    def push(self, content: bytes, name: str = "run.json") -> None:
        """Keep a run."""
        self.spool.add([(written(self.folder / name, content), None)])

    def send(self, patience: float = 2.0) -> Sent:
        """Send what waits."""
        sent = Sent()
        with self.spool.sending(0.0):
            service = Service(http=self.service.client(), patience=patience)
            deliver(service, self.spool, sent, self.lines.append, lambda: None)
        return sent

    @property
    def counts(self) -> tuple[int, int, int]:
        """Runs that are stored, that wait and that were refused."""
        return len(self.service.stored), len(self.spool.waiting()), len(self.spool.refused())


@pytest.fixture
def sender(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Sender:
    made = Sender(tmp_path)
    monkeypatch.setattr(transport, "time", made.clock)
    return made


def of_run(name: bytes, answer: Callable[[], httpx2.Response]) -> Answer:
    """That answer to posts of the run with this text in it."""
    return lambda request: answer() if request.method == "POST" and name in request.read() else None


@pytest.mark.parametrize("slug", [(422, "invalid-content"), (409, "conflict"), (413, "too-large")])
def test_a_run_that_the_service_refuses_is_set_aside_with_the_reason(sender: Sender, slug: tuple[int, str]) -> None:
    sender.service.instead = of_run(b'"bad"', lambda: problem(*slug))
    sender.push(body(1, "bad"), "1.json")
    sender.push(body(2, "good"), "2.json")
    assert str(sender.send()) == "1 stored now, 0 stored before, 1 refused"
    assert sender.counts == (1, 0, 1)
    assert sender.spool.refused()[0].problem["detail"] == "because"
    assert "because" in sender.lines[0]
    assert ("other content" in sender.lines[-1]) is (slug[1] == "conflict")


@pytest.mark.parametrize(
    "status", [400, 405, 406, 409, 410, 411, 413, 414, 415, 421, 422, 426, 428, 431, 451, 499, 500]
)
@pytest.mark.parametrize("body_of", [{"html": "<h1>no</h1>"}, {"json": {"detail": "no"}}], ids=["html", "json"])
def test_a_run_a_proxy_refuses_stays_and_the_next_is_sent(sender: Sender, status: int, body_of: dict[str, Any]) -> None:
    """An nginx with a bound of its own answers 413 in HTML: the run is not bad, and others may pass."""
    sender.service.instead = of_run(b'"bad"', lambda: httpx2.Response(status, **body_of))
    sender.push(body(1, "bad"), "1.json")
    sender.push(body(2, "good"), "2.json")
    assert sender.send().failed == 1
    assert sender.counts == (1, 1, 0)
    (entry,) = sender.spool.waiting()
    assert (entry.head.run_id, entry.tries, entry.failures) == ("bad", 1, 1)
    assert str(status) in str(entry.last_answer)


@pytest.mark.parametrize(
    "answer",
    [
        *(problem(*own) for own in ((401, "unauthorized"), (403, "forbidden"), (404, "not-found"), (409, "archived"))),
        httpx2.Response(407, text="because"),
    ],
    ids=lambda answer: f"{answer.status_code}",
)
def test_what_would_refuse_every_run_ends_the_sending_and_all_wait(sender: Sender, answer: httpx2.Response) -> None:
    sender.service.instead = lambda _request: answer
    for cycles in (1, 2):
        sender.push(body(cycles), f"{cycles}.json")
    with pytest.raises(RefusedError, match="because"):
        sender.send()
    assert sender.counts == (0, 2, 0)
    assert [entry.tries for entry in sender.spool.waiting()] == [1, 0]


@pytest.mark.parametrize(
    "answer",
    [
        httpx2.Response(200, html="<p>log in</p>"),
        httpx2.Response(200, json={"success": True}),
        httpx2.Response(200, json=["no object"]),
        httpx2.Response(204),
        *(httpx2.Response(status, headers={"Location": "https://login.test"}) for status in (301, 302, 303, 307, 308)),
        *(httpx2.Response(status) for status in (408, 425, 502, 503, 504, 511, 520)),
        httpx2.Response(429, headers={"Retry-After": "Fri, 01 Jan 2100 00:00:00 GMT"}),
        problem(503, "busy"),
    ],
    ids=lambda answer: f"{answer.status_code}",
)
def test_what_is_no_answer_of_the_service_stores_and_refuses_nothing(sender: Sender, answer: httpx2.Response) -> None:
    sender.service.instead = lambda _request: answer
    sender.push(body(1), "1.json")
    with pytest.raises(ServiceAwayError):
        sender.send()
    assert sender.counts == (0, 1, 0)
    sender.service.instead = lambda _request: None
    assert sender.send().stored == 1


def test_a_run_that_the_service_never_answers_holds_up_no_other(sender: Sender) -> None:
    """Sent again it comes last."""
    sender.service.instead = of_run(b'"bad"', lambda: httpx2.Response(504))
    for cycles, name in enumerate(("bad", "good", "better")):
        sender.push(body(cycles, name), f"{name}.json")
    sent = sender.send()
    assert (sent.stored, sent.failed) == (2, 1)
    sender.push(body(3, "best"), "best.json")
    assert [entry.head.run_id for entry in sender.spool.waiting()] == ["best", "bad"]


def test_a_service_that_answers_nothing_but_looks_is_left_alone_after_two_runs(sender: Sender) -> None:
    sender.service.instead = of_run(b"", lambda: httpx2.Response(503))
    for cycles in range(5):
        sender.push(body(cycles), f"{cycles}.json")
    with pytest.raises(ServiceAwayError):
        sender.send()
    assert [entry.tries for entry in sender.spool.waiting()].count(0) == 3


@pytest.mark.parametrize(
    ("known", "state", "words"),
    [
        (True, {"state": "withdrawn", "cycles": 70000, "sent_cycles": 70000}, "then withdrawn"),
        (True, {"state": "accepted", "cycles": 7000.0, "sent_cycles": 70000.0}, "from 70000 to 7000 cycles"),
        (False, {"state": "held", "doubts": [{"code": "cycles", "message": "is it 7000?"}]}, "r1 is held: is it 7000?"),
    ],
)
def test_a_run_that_was_changed_since_or_is_held_is_reported_and_waits_no_more(
    sender: Sender, known: bool, state: dict[str, object], words: str
) -> None:
    if known:
        sender.service.stored["r1"] = body(70000, "r1")
    sender.service.states["r1"] = state
    sender.push(body(70000, "r1"))
    assert str(sender.send()) == f"{1 - known} stored now, {1 * known} stored before, 0 refused"
    assert sender.counts == (1, 0, 0)
    assert [words in line for line in sender.lines] == [True]


def test_an_inspection_waits_while_the_service_is_away_and_is_sent_to_its_own_address(sender: Sender) -> None:
    content, asked = b'{"cycles": 0, "roughness_um": 9.52}', []
    sender.spool.add([(written(sender.folder / "i.json", content), None)], INSPECTIONS)
    sender.service.instead = lambda _request: httpx2.Response(503)
    with pytest.raises(ServiceAwayError):
        sender.send()
    assert sender.counts == (0, 1, 0)
    sender.service.instead = lambda request: asked.append(request.url.path)
    assert str(sender.send()) == "1 stored now, 0 stored before, 0 refused"
    assert (sender.counts, asked) == ((1, 0, 0), ["/v1/clutches/c1/inspections"])
    (name,) = sender.service.stored
    sender.service.states[name] = {"state": "withdrawn"}
    sender.spool.add([(sender.folder / "i.json", None)], INSPECTIONS)
    assert sender.send().duplicates == 1
    assert sender.lines[-1] == f"{name} was stored earlier and then withdrawn: it stays withdrawn and is not sent again"


def test_a_run_that_is_corrected_between_two_tries_is_not_tried_again(sender: Sender) -> None:
    """Another process pushes the correction while this one waits for the service."""
    older, newer = body(70000), body(7000)
    posted: list[bytes] = []

    def away_at_first(request: httpx2.Request) -> httpx2.Response | None:
        posted.append(request.read())
        return httpx2.Response(503) if len(posted) == 1 else None

    def correct(seconds: float) -> None:
        sender.clock.now += seconds
        sender.push(newer)

    sender.service.instead = away_at_first
    sender.clock.sleep = correct  # type: ignore[method-assign]  # what happens meanwhile
    sender.push(older)
    assert sender.send().stored == 0
    assert sender.send().stored == 1
    assert posted == [older, newer]
    assert set_aside(sender.spool) == [older]


def test_a_run_that_is_corrected_while_the_service_takes_it_is_named(sender: Sender) -> None:
    older, newer = body(70000), body(7000)

    def corrected_meanwhile(request: httpx2.Request) -> None:
        if request.read() == older:
            sender.push(newer)

    sender.service.instead = corrected_meanwhile
    sender.push(older)
    assert sender.send().stored == 1
    assert "stored while you pushed a newer version" in sender.lines[0]
    assert contents(sender.spool) == [newer]
    assert sender.spool.replaced() == []


def test_a_full_disk_keeps_no_run_from_being_sent(sender: Sender, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_arguments: object) -> None:
        raise OSError(28, "No space left on device")

    sender.push(body(1))
    monkeypatch.setattr("service.cli.sending.spool._put", full)
    assert sender.send().stored == 1
    assert sender.counts == (1, 0, 0)
