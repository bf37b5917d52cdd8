"""A receiver of alarms on this machine, which keeps what it was sent and answers as a test wants."""

import hashlib
import hmac
import json
import socketserver
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from tests.service.jobs.waiting import until

SECRET = "a-secret-of-tests"  # noqa: S105


class Receiver:
    """What arrived: paths, headers and bodies. `status` is what it answers, `before` is called first."""

    def __init__(self) -> None:
        self.requests: list[tuple[str, dict[str, str], bytes]] = []
        self.status = 200
        self.headers: dict[str, str] = {}
        self.before: Callable[[BaseHTTPRequestHandler], object] = lambda _handler: None
        self.port = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/hook"

    @property
    def bodies(self) -> list[dict[str, Any]]:
        return [json.loads(body) for _, _, body in self.requests]

    def await_requests(self, count: int) -> list[dict[str, Any]]:
        """The bodies, once there are so many."""
        until(lambda: len(self.requests) >= count, within=120)
        return self.bodies


@contextmanager
def in_thread(server: socketserver.BaseServer) -> Iterator[int]:
    """A server of this process, and its port."""
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


@contextmanager
def receiving() -> Iterator[Receiver]:
    receiver = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            receiver.requests.append((self.path, dict(self.headers.items()), body))
            receiver.before(self)
            self.send_response(receiver.status)
            for name, value in receiver.headers.items():
                self.send_header(name, value)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    with in_thread(ThreadingHTTPServer(("127.0.0.1", 0), Handler)) as receiver.port:
        yield receiver


def signed_rightly(headers: dict[str, str], body: bytes, secret: str = SECRET) -> bool:
    """Whether the signature is that of `t.body`, computed as a receiver does."""
    parts = dict(part.split("=", 1) for part in headers["Clutchlife-Signature"].split(","))
    expected = hmac.new(secret.encode(), parts["t"].encode() + b"." + body, hashlib.sha256).hexdigest()
    return hmac.compare_digest(parts["v1"], expected) and abs(time.time() - int(parts["t"])) < 60
