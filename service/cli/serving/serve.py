"""`clutchlife serve`: what is checked and said before the service runs, and the port that it listens at."""

import errno
import gc
import signal
import socket
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, get_args

import typer

from service.cli.options import DATABASE, EX_USAGE, Database, errors_in_a_line, fail
from service.defaults import LOOPBACK
from service.logging import LogLevel, configure, start

if TYPE_CHECKING:
    from service.settings import Settings

#: Seconds that requests on their way have once the service is to stop. Chosen: less than `docker stop` waits.
STOP_SECONDS = 10
LOG_LEVELS = get_args(LogLevel)
#: How an address says that it is every one of the machine.
_EVERY = ("0.0.0.0", "::", "")  # noqa: S104  (compared, not bound)


def serve(
    host: Annotated[str, typer.Option(help="The address to listen at; without keys only this machine")] = LOOPBACK,
    port: Annotated[int, typer.Option(min=0, max=65535)] = 8000,
    database: Database = DATABASE,
    processes: Annotated[
        int, typer.Option(min=1, help="Number of services behind this port; needs a PostgreSQL database")
    ] = 1,
    raw: Annotated[
        str | None,
        typer.Option(
            envvar="CLUTCHLIFE_RAW",
            help="Where new raw records go: database, folder:///path or s3://bucket/prefix; default: the last choice",
        ),
    ] = None,
    root_path: Annotated[
        str | None,
        typer.Option(
            envvar="CLUTCHLIFE_ROOT_PATH", help="Path that a proxy adds before all addresses, such as /clutch"
        ),
    ] = None,
    insecure_local: Annotated[
        bool,
        typer.Option("--insecure-local", help="Accept requests through a proxy on this machine although no key exists"),
    ] = False,
    log_level: Annotated[
        str | None, typer.Option(help="critical, error, warning, info or debug; default: CLUTCHLIFE_LOG_LEVEL, or info")
    ] = None,
) -> None:
    """Run the service."""
    if log_level is not None and log_level.lower() not in LOG_LEVELS:
        fail(f"log-level must be one of {', '.join(LOG_LEVELS)}, got {log_level!r}", EX_USAGE)
    # what a stop finds before the server listens for it, and what the server leaves it to once all is finished
    signal.signal(signal.SIGTERM, _end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})  # whoever has started it may be deaf to it
    gc.disable()  # what is loaded stays: to walk through it again and again takes a sixth of the time
    from service.settings import Settings, redacted  # start-up time
    from service.web.auth import is_loopback  # start-up time
    from storage.engine.opening import database_exists  # start-up time
    from storage.engine.postgresql.connect import is_on_server  # start-up time
    from storage.engine.sqlite.connect import path_of  # start-up time

    named = {"insecure_local": insecure_local, "log_level": log_level, "raw": raw, "root_path": root_path}
    with errors_in_a_line(), ExitStack() as resources:
        settings = Settings.from_environment(
            database=database, **{name: value for name, value in named.items() if value}
        )
        configure(settings.log_format, settings.log_level)
        if processes > 1 and not is_on_server(settings.database):
            raise ValueError(
                f"--processes {processes} needs a database on a PostgreSQL server: only one service can use "
                "an SQLite file. To give this service more processes, set CLUTCHLIFE_WORKERS"
            )
        # a port that is not free ends the start before anything is made; without a database there are no keys
        first = host if is_loopback(host) or database_exists(settings.database) else LOOPBACK
        sockets = [resources.enter_context(at_address) for at_address in bound(first, port)]
        start.info("settings", extra={"fields": settings.shown()})
        for line in Settings.misspelt():
            start.warning(line)
        host = _allowed(host, settings)
        if host != first:
            resources.close()
            sockets = [resources.enter_context(at_address) for at_address in bound(host, port)]
        # the file's whole path, or the server's address without its password
        on_server = is_on_server(settings.database)
        place = redacted(settings.database) if on_server else str(path_of(settings.database).absolute())
        address = page(host, port_of(sockets), settings.root_path)
        resources.pop_all()
    from service.cli.serving import services  # start-up time

    gc.enable()

    def announce() -> None:
        start.info("the page is at %s, the database at %s", address, place)

    options: dict[str, Any] = {
        "log_config": None,
        "log_level": settings.log_level,
        "access_log": False,
        "server_header": False,
        "timeout_graceful_shutdown": STOP_SECONDS,
    }
    if processes > 1:
        announce()
        if not services.serve_several(settings, processes, sockets, options):
            fail("a process could not start: see the log")
    elif not services.serve_one(settings, sockets, options, announce):
        fail("the service could not start: see the log")


def _allowed(host: str, settings: "Settings") -> str:
    """The address to listen at; this machine's own if no key exists. Logs warnings about missing or expired keys.

    Raises ServiceRuns if another service uses the database, and the errors of `open_database`.
    """
    from service.changes import raw_records  # start-up time
    from service.readers.confinement import missing  # start-up time
    from service.web.auth import is_loopback  # start-up time
    from storage import keys  # start-up time
    from storage.engine.opening import open_database, service_lock  # start-up time

    with service_lock(settings.database):
        pass  # a second service ends here with a line; the application holds the lock from its start to its end
    with closing(open_database(settings.database)) as opened:
        raw_records.use(opened, settings.raw)
        with opened.reading() as connection:
            has_keys = keys.any_ever(connection)
            opens = keys.any_active(connection, datetime.now(UTC).isoformat(timespec="seconds"))
    make = "Make one: clutchlife key create --scope admin"
    if has_keys and not opens:
        start.warning("all keys are revoked or expired, so the service refuses every request. %s", make)
    elif not has_keys and not is_loopback(host):
        start.warning(
            "no key exists, so the service listens at %s and not at %s. %s. Then start the service again",
            LOOPBACK,
            host,
            make,
        )
        host = LOOPBACK
    elif not has_keys:
        through = "accepted" if settings.insecure_local else "refused"
        start.warning(
            "no key exists: everybody on this machine may do everything, and requests through a proxy are %s. %s",
            through,
            make,
        )
    if open_to_readers := missing():
        unkept = " and ".join(open_to_readers)
        start.warning("on this system, the process that reads the files of recorders still has access to %s", unkept)
    return host


def _end(*_: object) -> NoReturn:
    raise SystemExit(0)


def bound(host: str, port: int) -> list[socket.socket]:
    """Sockets bound to the port, one for each address of the host's name; port 0 takes a free one.

    Raises OSError with a line of advice if the port is taken or this machine may not use it.
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
    """The socket addresses of a host's name, without duplicates. Raises OSError."""
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
