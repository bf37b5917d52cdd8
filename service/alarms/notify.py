"""Receivers by whatever way: a web address is asked by the service itself, all others by Apprise in a process of its own.

    python -m service.alarms.notify     reads one message as JSON, sends it, answers in a line

Apprise knows mail, Teams, Slack, ntfy and a hundred others, and opens connections itself. The process may connect to
addresses that alarms may go to, start nothing, and read no file but those of the installation; it is ended after a while.
"""

import importlib.util
import ipaddress
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from service.alarms import receivers

_WEB = ("http", "https")
#: Addresses of Apprise that stay on this machine, or that say where else to read.
_LOCAL = {"dbus", "file", "gio", "glib", "gnome", "growl", "kde", "macosx", "qt", "syslog", "windows"}
#: [s] The process may take in all: it loads a large library first.
_SECONDS = 3 * receivers.ATTEMPT_SECONDS
#: What a process that sends must not do: start others, or load code that no hook sees.
_FORBIDDEN = ("subprocess.", "os.exec", "os.fork", "os.posix_spawn", "os.spawn", "os.system", "os.startfile", "ctypes.")
#: Files that a connection needs, beside those of the installation.
_SYSTEM_FILES = (
    "/etc/ssl/", "/etc/pki/", "/etc/mime.types", "/etc/localtime", "/etc/os-release",
    "/usr/share/", "/usr/lib/ssl", "/dev/null", "/dev/urandom", "/var/lib/ca-certificates",
)  # fmt: skip
#: How the process is begun: the folder that the service runs in is none of the installation's.
PYTHON = (sys.executable, "-P")


def require_address(url: str, *, private: bool) -> None:
    """Raise InvalidError if a receiver cannot have this address, because it is no valid address or may not be called."""
    scheme = receivers.scheme_of(url)
    if scheme not in _WEB:
        _require_apprise(url, scheme)
        return
    parts = receivers.require_web_address(url)
    try:
        receivers.allowed(parts, private=private)
    except receivers.NotAllowedError as error:
        raise receivers.wrong_address(f"url is not allowed: {error}") from error
    except OSError:
        return  # it may be known later; each attempt asks again


def _require_apprise(url: str, scheme: str) -> None:
    """Raise InvalidError unless Apprise is installed and understands the address."""
    if not scheme or scheme in _LOCAL or receivers.has_controls(url):
        raise receivers.wrong_address(
            "url must be a web address such as https://example.org/hook, or an address of Apprise"
        )
    if importlib.util.find_spec("apprise") is None:
        raise receivers.wrong_address(
            f"url begins with {scheme[:20]}://, which needs the extra `notify`: pip install 'clutchlife[notify]'"
        )
    reply = _exchange({"url": url, "private": False})
    if not reply.get("understood"):
        raise receivers.wrong_address(
            f"url is not an address that Apprise can send to: see Apprise's documentation of {scheme[:20]}://"
        )


def send(url: str, body: bytes, *, secret: str, delivery_id: str, private: bool) -> receivers.Attempt:
    """Send a notification to a receiver, by HTTP with a signature or through Apprise; the outcome of the attempt."""
    if receivers.scheme_of(url) in _WEB:
        return receivers.post(url, body, secret=secret, delivery_id=delivery_id, private=private)
    content = json.loads(body)
    event = content["event"]
    over = content["type"] == "alarm.cleared"
    title = f"Clutchlife: {event['name'] or event['quantity'].replace('_', ' ')}" + (" is over" if over else "")
    task = {"url": url, "title": title, "body": event["message"], "private": private}
    reply = _exchange(task)
    return receivers.Attempt() if reply.get("sent") else receivers.Attempt(problem=reply["problem"])


def _exchange(task: Mapping[str, object]) -> Mapping[str, Any]:
    """The answer of a separate process that sends the task's message through Apprise; without a message it only checks
    the address."""
    command = [*PYTHON, "-m", "service.alarms.notify"]
    try:
        done = subprocess.run(  # noqa: S603  (our own module)
            command, input=json.dumps(task), capture_output=True, text=True, timeout=_SECONDS, check=False
        )
        reply: dict[str, Any] = json.loads(done.stdout)
    except subprocess.TimeoutExpired:
        return {"problem": f"the message was not sent within {_SECONDS:g} s"}
    except ValueError:
        return {
            "problem": "not sent: the program that sends through Apprise ended without an answer. Send a test again; if "
            "this repeats, tell the operator of the service"
        }
    return reply


def confine(private: bool) -> None:
    """Forbid this process, until it ends, every operation that sending does not need: other connections, files and
    commands."""
    places = tuple({sys.prefix, sys.base_prefix, *(path for path in sys.path if path)}) + _SYSTEM_FILES

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        """Python's audit hook: refuses connections to forbidden addresses, files outside the allowed places, and new
        processes."""
        if event in ("socket.connect", "socket.sendto"):
            _require_connectable(arguments[-1], private=private)
        elif event == "open":
            path = arguments[0]
            if isinstance(path, (str, bytes)) and not os.path.normpath(Path.cwd() / os.fsdecode(path)).startswith(
                places
            ):
                raise PermissionError("the sender tried to read a file that it does not need")
        elif event.startswith(_FORBIDDEN):
            raise PermissionError(event)

    sys.addaudithook(watch)


def _require_connectable(address: Any, *, private: bool) -> None:
    """Raise PermissionError or NotAllowedError if the sending process must not connect to an address."""
    if not isinstance(address, tuple):
        raise PermissionError("the sender tried to use a local socket")
    try:
        reason = receivers.why_not(ipaddress.ip_address(str(address[0]).partition("%")[0]), private=private)
    except ValueError:
        reason = "the sender used a name in place of an address"
    if reason is not None:
        raise receivers.NotAllowedError(reason)


def main() -> None:
    """Check the address of the task on standard input, send its message if it has one, and write the answer."""
    import apprise  # an extra, and of this process alone

    task = json.load(sys.stdin)
    with redirect_stdout(sys.stderr):
        receiver = apprise.Apprise.instantiate(task["url"], suppress_exceptions=True)
        answer: dict[str, Any] = {
            "understood": receiver is not None,
            "problem": "not sent: Apprise does not understand the address",
        }
        if receiver is not None and "body" in task:
            confine(private=task["private"])
            try:
                answer["sent"] = bool(receiver.notify(body=task["body"], title=task["title"]))
                answer["problem"] = "the receiver did not accept it"
            except (receivers.NotAllowedError, PermissionError) as error:
                answer["problem"] = f"not sent: {error}"
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    main()
