"""Pages printed as PDF by Chromium, which is asked over a pipe (Chrome DevTools Protocol); and files sent to a receiver."""

import base64
import fcntl
import importlib
import importlib.util
import json
import mimetypes
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from service.client.clutchlife.answers import JsonObject

if TYPE_CHECKING:
    import httpx2

#: Names of the program; $CHROMIUM goes before them.
_BROWSERS = ("chromium", "chromium-browser", "google-chrome-stable", "google-chrome", "chrome")
#: [s] What a page may take until all of its report is there, and how long that must then have stayed the same.
_PATIENCE, _STILL = 300.0, 2.0
#: How long the report is, null before what it needs is there.
_LENGTH = "document.querySelector({selector!r}) && document.getElementById('report').innerHTML.length"


class ReportError(ValueError):
    """A report cannot be printed or sent; the message says why."""


def print_pages(http: "httpx2.Client", pages: Mapping[Path, tuple[str, str]]) -> None:
    """Print pages of a service to files; `pages`: by file, the address, and the element that shows that the page is
    complete.

    Raises ReportError if there is no browser, or if a page is not complete after five minutes.
    """
    with _browser() as browser:
        for path, (address, selector) in pages.items():
            page = _Page(browser, http.headers.get("Authorization"))
            page.ask("Page.navigate", url=f"{str(http.base_url).rstrip('/')}{address}")
            page.wait(_LENGTH.format(selector=selector), address)
            printed = page.ask("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
            path.write_bytes(base64.b64decode(printed["data"]))
            page.close()


def sent(url: str, files: Sequence[Path]) -> None:
    """Send files to a web address, each by a POST, or by Apprise in one message. Raises ReportError if that fails."""
    if url.startswith(("http://", "https://")):
        import httpx2  # start-up time

        for path in files:
            kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
            headers = {"Content-Type": kind, "Content-Disposition": f'attachment; filename="{path.name}"'}
            try:
                answer = httpx2.post(url, content=path.read_bytes(), headers=headers, timeout=60)
            except httpx2.RequestError as error:
                raise ReportError(f"{path.name} was not sent: {error}") from error
            if answer.status_code >= 300:
                raise ReportError(f"{path.name} was not sent: the receiver answered {answer.status_code}")
        return
    if importlib.util.find_spec("apprise") is None:
        raise ReportError("this address needs the extra `notify`: pip install 'clutchlife[notify]'")
    apprise = importlib.import_module("apprise")
    receiver = apprise.Apprise()
    names = ", ".join(path.name for path in files)
    attached = [str(path) for path in files]
    if not receiver.add(url) or not receiver.notify(title="Clutchlife: report", body=names, attach=attached):
        raise ReportError("the receiver did not take the report: see Apprise's documentation of its address")


class _Browser:
    """A connection to a browser by two pipes: JSON messages, each followed by a zero byte."""

    def __init__(self, asked: BinaryIO, answers: BinaryIO) -> None:
        self._asked, self._answers, self._numbers = asked, answers, count(1)

    def ask(self, method: str, session: str | None = None, **parameters: Any) -> JsonObject:
        """The browser's result of a method of its DevTools protocol. Raises ReportError."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        self._asked.write(json.dumps(message).encode() + b"\0")
        self._asked.flush()
        while True:
            answer = self._next()
            if answer.get("id") != number:
                continue
            if "error" in answer:
                raise ReportError(f"the browser refused {method}: {answer['error'].get('message')}")
            found: JsonObject = answer["result"]
            return found

    def _next(self) -> JsonObject:
        """The browser's next message."""
        read = bytearray()
        while (byte := self._answers.read(1)) != b"\0":
            if not byte:
                raise ReportError("the browser ended unexpectedly")
            read += byte
        found: JsonObject = json.loads(read)
        return found


class _Page:
    """An empty page that sends a key with each request."""

    def __init__(self, browser: _Browser, authorization: str | None) -> None:
        self._browser = browser
        self._target = browser.ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.ask("Target.attachToTarget", targetId=self._target, flatten=True)["sessionId"]
        self.ask("Page.enable")
        self.ask("Network.enable")
        if authorization is not None:
            self.ask("Network.setExtraHTTPHeaders", headers={"Authorization": authorization})

    def ask(self, method: str, **parameters: Any) -> JsonObject:
        return self._browser.ask(method, self._session, **parameters)

    def wait(self, length: str, address: str) -> None:
        """Wait until an expression gives a number (a length) that stays the same for a while."""
        began = since = time.monotonic()
        before = None
        while before is None or time.monotonic() - since < _STILL:
            now = self.ask("Runtime.evaluate", expression=length)["result"].get("value")
            if now != before:
                before, since = now, time.monotonic()
            if time.monotonic() - began > _PATIENCE:
                raise ReportError(f"the page {address} was not whole after {_PATIENCE:.0f} s")
            time.sleep(0.1)

    def close(self) -> None:
        self._browser.ask("Target.closeTarget", targetId=self._target)


@contextmanager
def _browser() -> Iterator[_Browser]:
    """Context with a headless browser with its own profile, stopped at the end."""
    program = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _BROWSERS)), None)
    if program is None:
        raise ReportError("--pdf needs Chromium or Chrome on the path, or named by $CHROMIUM")
    to_read, to_ask = os.pipe()
    to_answer, answered = os.pipe()[::-1]
    ends = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (to_read, to_answer)]

    def as_three_and_four() -> None:  # where the browser looks for them
        os.dup2(ends[0], 3)
        os.dup2(ends[1], 4)

    with tempfile.TemporaryDirectory(prefix="clutchlife-report-", ignore_cleanup_errors=True) as profile:
        arguments = [
            "--headless",
            "--remote-debugging-pipe",
            f"--user-data-dir={profile}",
            "--no-first-run",
            "--disable-gpu",
        ]
        if os.geteuid() == 0:
            arguments.append("--no-sandbox")  # Chromium does not start as root with it
        process = subprocess.Popen(  # noqa: S603  (the browser of this machine)
            [program, *arguments], preexec_fn=as_three_and_four, close_fds=False, stderr=subprocess.DEVNULL
        )
        for end in (*ends, to_read, to_answer):
            os.close(end)
        try:
            with os.fdopen(to_ask, "wb") as asked, os.fdopen(answered, "rb") as answers:
                yield _Browser(asked, answers)
        finally:
            process.terminate()
            process.wait()
