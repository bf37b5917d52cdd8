"""Nobody has the service ask the inside of a network for them, wait for ever, read without end, or say a secret."""

import ipaddress
import logging
import socket
import socketserver
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.alarms import notify, receivers
from service.alarms.receivers import post, shown, why_not
from tests.service.alarms.receiving import SECRET, in_thread, receiving
from tests.service.jobs.waiting import until
from tests.service.web.routes.granting import granted

BODY = b'{"type": "alarm.test"}'
RAISED = b'{"type": "alarm.raised", "event": {"name": "n", "quantity": "state", "message": "m"}}'
INSIDE = [
    "127.0.0.1", "10.0.0.1", "172.16.3.4", "192.168.1.1", "100.64.0.1", "169.254.169.254", "0.0.0.0",  # noqa: S104
    "224.0.0.1", "240.0.0.1", "255.255.255.255", "::1", "::", "fe80::1", "fc00::1", "ff02::1", "::ffff:127.0.0.1",
    "::127.0.0.1", "::ffff:169.254.169.254", "2002:7f00:1::", "64:ff9b::7f00:1", "64:ff9b::a9fe:a9fe",
    "2001:0:4136:e378:8000:63bf:80ff:fffe", "fec0::1",
]  # fmt: skip
SECRETS = ["169.254.169.254", "0.0.0.0", "224.0.0.1", "fe80::1", "::ffff:169.254.169.254"]  # noqa: S104
OUTSIDE = ["93.184.216.34", "2606:2800:220:1:248:1893:25c8:1946", "64:ff9b::5db8:d822"]


def send(url: str, *, private: bool = True) -> receivers.Attempt:
    return post(url, BODY, secret=SECRET, delivery_id="d", private=private)


@pytest.mark.parametrize(
    ("addresses", "private", "refused"),
    [(INSIDE, False, True), (SECRETS, True, True), (OUTSIDE, False, False)],
    ids=["inside", "where a cloud keeps its secrets", "outside"],
)
def test_only_the_outside_is_asked(addresses: list[str], private: bool, refused: bool) -> None:
    for address in addresses:
        assert bool(why_not(ipaddress.ip_address(address), private=private)) is refused, address


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "localhost", "2130706433", "0x7f.1", "127.1", "[::1]", "[::ffff:127.0.0.1]"]
)
def test_no_way_of_writing_an_address_leads_inside(host: str) -> None:
    with receiving() as receiver:
        ended = send(f"http://{host}:{receiver.port}/hook", private=False)
    assert receiver.requests == []
    assert ended.problem is not None


def test_a_name_that_is_rebound_after_it_was_checked_is_not_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first answer of the name's server lies outside, every later one inside: it is asked once, and that is connected
    to."""
    connected: list[Any] = []
    answers = iter(["93.184.216.34", "127.0.0.1", "127.0.0.1"])

    def resolved(_host: str, port: int, **_: object) -> list[Any]:
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (next(answers), port))]

    def connect(address: Any, timeout: float) -> socket.socket:  # noqa: ARG001
        connected.append(address)
        raise ConnectionRefusedError(111, "refused")

    monkeypatch.setattr(socket, "getaddrinfo", resolved)
    monkeypatch.setattr(socket, "create_connection", connect)
    send("http://rebound.test/hook", private=False)
    assert connected == [("93.184.216.34", 80)]
    assert "not sent" in str(send("http://rebound.test/hook", private=False).problem), "asked again, it is inside"
    assert len(connected) == 1


def test_a_redirect_is_not_followed() -> None:
    with receiving() as inner, receiving() as outer:
        outer.status, outer.headers = 307, {"Location": inner.url}
        ended = send(outer.url)
    assert (ended.status, inner.requests) == (307, [])
    assert "a redirect: give the address that it leads to" in str(ended.problem)


class Server(socketserver.ThreadingTCPServer):
    daemon_threads = True


@contextmanager
def answering(write: Callable[[socket.socket], object]) -> Iterator[str]:
    """A receiver that reads what comes and then writes as a test wants."""

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            self.request.recv(65536)
            with suppress(OSError):
                write(self.request)

    with in_thread(Server(("127.0.0.1", 0), Handler)) as port:
        yield f"http://127.0.0.1:{port}/"


def drip(connection: socket.socket) -> None:
    for sign in b"HTTP/1.1 200 OK\r\n" + b"X: 1\r\n" * 1000:
        connection.sendall(bytes([sign]))
        time.sleep(0.1)


def endless_headers(connection: socket.socket) -> None:
    connection.sendall(b"HTTP/1.1 200 OK\r\n")
    while True:
        connection.sendall(b"X: " + b"a" * 60000 + b"\r\n")


def endless_continues(connection: socket.socket) -> None:
    while True:
        connection.sendall(b"HTTP/1.1 100 Continue\r\n\r\n")


def endless_body(connection: socket.socket) -> None:
    """Nothing that is read: the head is the answer."""
    connection.sendall(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n")
    while True:
        connection.sendall(b"10000\r\n" + b"a" * 65536 + b"\r\n")


@pytest.mark.parametrize(
    "write",
    [drip, endless_headers, endless_continues, endless_body, lambda _: time.sleep(600)],
    ids=["drip", "headers", "continues", "body", "silence"],
)
def test_a_receiver_that_never_ends_is_cut_off(write: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(receivers, "ATTEMPT_SECONDS", 1.0)
    with answering(write) as url:
        ended = send(url)
    if write is endless_body:
        assert ended.problem is None
    else:
        assert (ended.problem == receivers._TIMED_OUT) is (write is not endless_headers), "these are too many at once"


NO_ADDRESSES = (
    "ftp://example.org/", "file:///etc/passwd", "gopher://x/", "http://", "http:///hook", "example.org", "syslog://",
    "http://exa mple.org/", "http://example.org/\r\nX: 1", "http://example.org:99999/", "http://example.org:0/", "unheard://x",
    "http://[", "http://a..b/", "json://[\x01", "https://example.org/é",
)  # fmt: skip


def test_what_is_no_address_is_refused(client: TestClient) -> None:
    for url in NO_ADDRESSES:
        answer = client.post("/v1/webhooks", json={"url": url})
        assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, "/url"), url


def test_names_that_do_not_resolve_hold_up_nobody_else(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forty such requests held all threads, and nobody was answered who needed one."""
    ended, resolve = threading.Event(), socket.getaddrinfo

    def hanging(host: str, *arguments: Any, **more: Any) -> Any:
        if host == "slow.example.org":
            ended.wait(60)
            raise socket.gaierror
        return resolve(host, *arguments, **more)

    monkeypatch.setattr(socket, "getaddrinfo", hanging)
    with ThreadPoolExecutor(44) as pool:
        asked = [pool.submit(client.post, "/v1/webhooks", json={"url": "http://slow.example.org/"}) for _ in range(44)]
        until(lambda: sum(answer.done() for answer in asked) == 40)
        assert client.get("/v1/webhooks").json()["items"] == []
        ended.set()
        statuses = Counter(answer.result().status_code for answer in asked)
    assert statuses == {201: 4, 503: 40}
    assert all(answer.result().headers["Retry-After"] for answer in asked if answer.result().status_code == 503)


@pytest.mark.parametrize(
    ("url", "public"),
    [
        ("https://user:pass-word@example.org/hook", "https://user:***@example.org/hook"),
        ("https://example.org/services/T0123456/B0123456/abcdefghijklmnop1234?sig=geheim", "https://example.org/services/T0123456/B0123456/***?***"),
        ("http://127.0.0.1:9000/hook", "http://127.0.0.1:9000/hook"),
        ("mailtos://user:pass-word@example.org", "mailtos://***"),
    ],
)  # fmt: skip
def test_addresses_are_shown_without_what_is_secret(url: str, public: str) -> None:
    assert shown(url) == public


def test_no_answer_or_log_has_secrets(client: TestClient, caplog: pytest.LogCaptureFixture, database_url: str) -> None:
    """The database holds them, or nothing could be signed."""
    caplog.set_level(logging.DEBUG)
    secret, password = "signs-everything", "pass-word"
    with receiving() as receiver:
        receiver.status = 500
        url = receiver.url.replace("http://", f"http://user:{password}@") + "?token=geheim"
        name = client.post("/v1/webhooks", json={"url": url, "secret": secret}).json()["webhook_id"]
        client.post(f"/v1/webhooks/{name}/test")
        assert receiver.requests[0][1]["Authorization"].startswith("Basic ")
    client.post(f"/v1/webhooks/{name}/test")
    answers = [
        client.get(address).text
        for address in ("/v1/webhooks", f"/v1/webhooks/{name}", f"/v1/webhooks/{name}/deliveries", "/v1/clutches/c1")
    ]
    text = "\n".join([*answers, caplog.text])
    for hidden in (secret, password, "geheim"):
        assert hidden not in text
    file = Path(database_url.removeprefix("sqlite:///"))
    assert secret.encode() in file.read_bytes() + file.with_name(f"{file.name}-wal").read_bytes()


def test_with_keys_the_inside_needs_a_setting_and_a_key_made_later_stops_deliveries(client: TestClient) -> None:
    with receiving() as receiver:
        name = client.post("/v1/webhooks", json={"url": receiver.url}).json()["webhook_id"]
        headers = granted(client, "admin")
        tested = client.post(f"/v1/webhooks/{name}/test", headers=headers).json()
        refused = client.post("/v1/webhooks", json={"url": receiver.url}, headers=headers)
    assert receiver.requests == []
    assert "not sent" in tested["deliveries"][0]["problem"]
    assert refused.status_code == 422
    assert "CLUTCHLIFE_PRIVATE_RECEIVERS" in refused.json()["detail"]


@contextmanager
def mailbox() -> Iterator[tuple[int, list[bytes]]]:
    """As much of an SMTP server as a client needs, and the mails that it was sent."""
    mails: list[bytes] = []

    class Mailbox(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self.wfile.write(b"220 test\r\n")
            while line := self.rfile.readline():
                word = line[:4].upper()
                if word == b"DATA":
                    self.wfile.write(b"354 go\r\n")
                    mails.append(b"".join(iter(self.rfile.readline, b".\r\n")))
                if word == b"QUIT":
                    self.wfile.write(b"221 bye\r\n")
                    return
                self.wfile.write(b"250 ok\r\n")

    with in_thread(Server(("127.0.0.1", 0), Mailbox)) as port:
        yield port, mails


def test_an_alarm_arrives_as_a_mail(client: TestClient) -> None:
    pytest.importorskip("apprise")
    with mailbox() as (port, mails):
        url = f"mailto://127.0.0.1:{port}/?from=rig@example.org&to=engineer@example.org"
        made = client.post("/v1/webhooks", json={"url": url})
        assert made.status_code == 201, made.text
        assert "example.org" not in made.text
        client.post("/v1/alarms", json={"clutch_id": "c1", "quantity": "state", "name": "look at it"})
        (mail,) = until(lambda: mails)
    assert b"look at it" in mail


def test_apprise_does_not_lead_inside_either() -> None:
    pytest.importorskip("apprise")
    with mailbox() as (port, mails), receiving() as receiver:
        for url in (
            f"mailto://127.0.0.1:{port}/?from=rig@example.org&to=engineer@example.org",
            f"json://127.0.0.1:{receiver.port}/hook",
        ):
            ended = notify.send(url, RAISED, secret=SECRET, delivery_id="d", private=False)
            assert ended.problem is not None, url
    assert (mails, receiver.requests) == ([], [])


def test_a_sender_that_gives_no_answer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notify, "PYTHON", (sys.executable, "-c", "", "--"))
    ended = notify.send("mailto://a@example.org", RAISED, secret=SECRET, delivery_id="d", private=False)
    assert "ended without an answer" in (ended.problem or "")


def test_a_sender_reads_no_file_of_this_machine(tmp_path: Path) -> None:
    """An address may name a file, such as a template of Teams: not one of the folder that the service runs in, either."""
    (tmp_path / "clutches.db").write_text("secret", encoding="utf-8")
    script = tmp_path / "sender.py"
    script.write_text(
        "import sys\nfrom service.alarms.notify import confine\nconfine(True)\n"
        "for path in sys.argv[1:]:\n"
        "    try:\n        open(path).close()\n        print(path)\n    except PermissionError:\n        pass\n",
        encoding="utf-8",
    )
    files = ["clutches.db", str(tmp_path / "clutches.db"), "/etc/passwd", f"/usr/share/../..{tmp_path}/clutches.db"]
    command = [*notify.PYTHON, str(script), *files, notify.__file__]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [notify.__file__]
