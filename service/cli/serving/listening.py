"""The port that the service listens at: taken before anything is made, and how its page is addressed."""

import errno
import socket
from contextlib import ExitStack

from service.defaults import LOOPBACK

#: How an address says that it is every one of the machine.
_EVERY = ("0.0.0.0", "::", "")  # noqa: S104  (compared, not bound)


def bound(host: str, port: int) -> list[socket.socket]:
    """Sockets at the port, one for each address that the host's name has; port 0 takes a free one.

    Raises OSError, a line that says what to do, where the port is not free or is none of this machine's to take.
    """
    with ExitStack() as open_sockets:
        sockets: list[socket.socket] = []
        for family, kind, protocol, _, address in _addresses(host, port):
            # where asyncio knows the protocol it sends at once: else a body waits 40 ms for the receipt of its head
            at = open_sockets.enter_context(socket.socket(family, kind, protocol))
            at.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                at.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            try:
                at.bind((address[0], port_of(sockets) if sockets else port, *address[2:]))
            except OSError as error:
                if error.errno == errno.EADDRNOTAVAIL and sockets:  # a name with an address that this machine lacks
                    continue
                raise OSError(_why(error, host, port)) from None
            at.set_inheritable(True)
            sockets.append(at)
        open_sockets.pop_all()
        return sockets


def port_of(taken: list[socket.socket]) -> int:
    return int(taken[0].getsockname()[1])


def page(host: str, port: int, root: str) -> str:
    """The address of the fleet's page for a browser on this machine; `root` is the path that a proxy adds."""
    name = LOOPBACK if host in _EVERY else f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}{root}/"


def _addresses(host: str, port: int) -> list[tuple[int, int, int, str, tuple[str, ...]]]:
    try:
        addresses: list[tuple[int, int, int, str, tuple[str, ...]]] = socket.getaddrinfo(  # type: ignore[assignment]
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
    except OSError as error:
        raise OSError(f"--host {host}: this name has no known address ({error.strerror})") from None
    return list(dict.fromkeys(addresses))


def _why(error: OSError, host: str, port: int) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} at {host} is in use, perhaps by another service: stop it, or give another port with --port"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"--host {host} is no address of this machine"
    return f"cannot listen at port {port} of {host}: {error.strerror}"
