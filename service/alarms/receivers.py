"""To whom alarms go: which addresses are allowed, and how one is asked.

Nobody may have the service ask the inside of a network for them. A receiver's name is resolved once, and the address that
was checked is the one that is connected to; redirects are not followed, and of an answer its status alone is kept.
"""

import base64
import hashlib
import hmac
import http.client
import ipaddress
import re
import socket
import ssl
import threading
import time
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Any
from urllib.parse import SplitResult, unquote, urlsplit

from service.errors import InvalidError
from service.settings import CODE_VERSION

#: [s] An attempt may take in all. Chosen: a receiver answers in a second; one that does not is tried again.
ATTEMPT_SECONDS = 10.0
_PORTS = {"http": 80, "https": 443}
_TIMED_OUT = f"the receiver did not answer within {ATTEMPT_SECONDS:g} s"
#: Parts of a path that look like a token: that long, and with a digit.
_TOKEN = re.compile(r"(?=[^/]*\d)[^/]{16,}")

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """The result of an attempt: the response status, None without a response; `problem` says why the receiver did not
    accept it, None if it did."""

    status: int | None = None
    problem: str | None = None


class NotAllowedError(Exception):
    """The service may not send to this address."""


def require_web_address(url: str) -> SplitResult:
    """The parts of a web address. Raises InvalidError."""
    try:
        parts = urlsplit(url)
        usable = parts.scheme in _PORTS and bool(parts.hostname) and (parts.port is None or parts.port > 0)
        (parts.hostname or "").encode("idna")
        usable = usable and (parts.path + parts.query).isascii()
    except ValueError:
        usable = False
    if not usable or has_controls(url):
        raise wrong_address("url must be a web address such as https://example.org/hook")
    return parts


def has_controls(url: str) -> bool:
    """Whether an address holds blanks or control characters, which no valid address has."""
    return any(ord(sign) <= 32 or ord(sign) == 127 for sign in url)


def scheme_of(url: str) -> str:
    """The scheme of an address (before `://`), in lower case; empty if it has none."""
    scheme, mark, _ = url.partition("://")
    return scheme.lower() if mark else ""


def wrong_address(message: str) -> InvalidError:
    """The error for an unusable receiver address; the address is not quoted, because it may hold a password."""
    return InvalidError.of(message, code="address", pointer="/url")


def shown(url: str) -> str:
    """An address with possible secrets masked: password, query, and parts of the path that look like tokens."""
    if scheme_of(url) not in _PORTS:
        return f"{scheme_of(url)}://***"
    parts = urlsplit(url)
    host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname or ""
    user = "" if parts.username is None else f"{parts.username}:***@" if parts.password is not None else "***@"
    port = "" if parts.port is None else f":{parts.port}"
    query = "?***" if parts.query else ""
    return f"{parts.scheme}://{user}{host}{port}{_TOKEN.sub('***', parts.path)}{query}"


def allowed(parts: SplitResult, *, private: bool) -> tuple[Any, ...]:
    """The socket address of a web address's host, resolved now; `private`: it may be of this machine or a private network.

    Raises NotAllowedError where none of its addresses may be asked, and OSError where the name is not known.
    """
    port = parts.port or _PORTS[parts.scheme]
    resolved = socket.getaddrinfo(parts.hostname or "", port, type=socket.SOCK_STREAM)
    reasons = []
    for *_, address in resolved:
        reason = why_not(ipaddress.ip_address(str(address[0]).partition("%")[0]), private=private)
        if reason is None:
            return address
        reasons.append(reason)
    raise NotAllowedError(reasons[0] if reasons else "the host name in url has no network address: check its spelling")


def why_not(address: Address, *, private: bool) -> str | None:
    """Why the service may not call an address; None if it may. An IPv4 address within an IPv6 one counts as itself."""
    inner = _embedded_ipv4(address)
    if inner is not None:
        return why_not(inner, private=private)
    if address.is_multicast or address.is_unspecified or address.is_link_local:
        return f"{address} is a {'link-local' if address.is_link_local else 'multicast or unspecified'} address"
    if address.is_global and not address.is_reserved and not (address.version == 6 and address.is_site_local):
        return None
    if private and (address.is_loopback or address.is_private):
        return None
    return f"{address} is on this machine or in a private network: to allow this, set CLUTCHLIFE_PRIVATE_RECEIVERS=true"


def _embedded_ipv4(address: Address) -> ipaddress.IPv4Address | None:
    """The IPv4 address that an IPv6 address stands for: mapped, compatible, 6to4, Teredo, NAT64 (RFC 4291, 3056, 4380,
    6052)."""
    if isinstance(address, ipaddress.IPv4Address):
        return None
    if address.ipv4_mapped is not None:
        return address.ipv4_mapped
    if address.sixtofour is not None:
        return address.sixtofour
    if address.teredo is not None:
        return address.teredo[1]
    number = int(address)
    if number >> 32 == 0x64FF9B << 64 or (number >> 32 == 0 and number > 1):
        return ipaddress.IPv4Address(number & 0xFFFFFFFF)
    return None


def signature(secret: str, body: bytes, at: int) -> str:
    """The signature header `t=UNIX,v1=HEX`: HMAC-SHA256 of `t.body` under the secret."""
    signed = hmac.new(secret.encode(), f"{at}.".encode() + body, hashlib.sha256).hexdigest()
    return f"t={at},v1={signed}"


def post(url: str, body: bytes, *, secret: str, delivery_id: str, private: bool) -> Attempt:
    """Make one attempt to send a signed body."""
    deadline = time.monotonic() + ATTEMPT_SECONDS
    try:
        parts = require_web_address(url)
        address = allowed(parts, private=private)
        headers = {
            "Content-Type": "application/json",
            "User-Agent": f"clutchlife/{CODE_VERSION}",
            "Clutchlife-Delivery": delivery_id,
            "Clutchlife-Signature": signature(secret, body, int(time.time())),
            "Connection": "close",
        }
        if parts.username is not None:
            user = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
            headers["Authorization"] = f"Basic {base64.b64encode(user.encode()).decode()}"
        status = _status(parts, address, body, headers, deadline)
    except NotAllowedError as error:
        return Attempt(problem=f"not sent: {error}")
    except InvalidError as error:
        return Attempt(problem=error.detail)
    except (OSError, http.client.HTTPException, ValueError) as error:
        late = time.monotonic() >= deadline or isinstance(error, TimeoutError)
        return Attempt(problem=_TIMED_OUT if late else _in_words(error))
    if 200 <= status < 300:
        return Attempt(status=status)
    redirect = ", a redirect: give the address that it leads to" if 300 <= status < 400 else ""
    return Attempt(status=status, problem=f"the receiver answered {status}{redirect}")


def _status(parts: SplitResult, address: tuple[Any, ...], body: bytes, headers: dict[str, str], deadline: float) -> int:
    """The response's status; its body is not read. The connection is closed at the deadline, even while data still
    arrive slowly."""
    host, port = parts.hostname or "", parts.port or _PORTS[parts.scheme]
    path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
    connection = http.client.HTTPConnection(host, port)
    with closing(socket.create_connection((address[0], port), max(0.1, deadline - time.monotonic()))) as raw:
        cut = threading.Timer(max(0.0, deadline - time.monotonic()), _cut, (raw,))
        cut.daemon = True
        cut.start()
        try:
            context = ssl.create_default_context() if parts.scheme == "https" else None
            with closing(raw if context is None else context.wrap_socket(raw, server_hostname=host)) as opened:
                connection.sock = opened
                connection.request("POST", path, body, headers)
                with closing(connection.getresponse()) as answer:
                    return answer.status
        finally:
            cut.cancel()


def _cut(raw: socket.socket) -> None:
    """End a connection that takes too long, from another thread."""
    with suppress(OSError):
        raw.shutdown(socket.SHUT_RDWR)


def _in_words(error: Exception) -> str:
    """A sentence for an error, without any text that may quote the address."""
    if isinstance(error, socket.gaierror):
        return "the host name of the receiver is not known: check its address"
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"the certificate of the receiver is not valid: {error.verify_message}"
    if isinstance(error, OSError) and error.strerror:
        return f"no connection: {error.strerror}"
    return f"the receiver gave no valid answer ({type(error).__name__})"
