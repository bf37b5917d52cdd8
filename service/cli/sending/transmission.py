"""Spools sent by a command: with a bar on the terminal, and with the lines and exit codes in which it ends."""

from collections.abc import Callable, Sequence

from rich.progress import Progress

from service.cli.options import EX_DATAERR, EX_TEMPFAIL, err, fail, out
from service.cli.sending.delivery import Sent, deliver
from service.cli.sending.folder_lock import HeldError
from service.cli.sending.spool import Spool
from service.client.clutchlife.answers import RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service, connect


def say(line: str) -> None:
    """A line on standard error, names of files as they are."""
    err.print(line, markup=False, soft_wrap=True)


def transmit(
    spools: Sequence[Spool],
    url: str,
    key: str | None,
    patience: float,
    prepare: Callable[[Service, Spool], object],
) -> None:
    """Send what waits in the spools of one service, after `prepare`; ends the command where any stays or is refused."""
    sent = Sent()
    with connect(url, key=key) as http, Progress(console=err, transient=True) as progress:
        task = progress.add_task("sending", total=sum(len(spool.waiting()) for spool in spools))

        def show_wait(reason: str, seconds: float) -> None:
            progress.update(task, description=f"{reason}; again in {seconds:.0f} s")

        def show_run() -> None:
            progress.update(task, description="sending", advance=1)

        service = Service(http=http, patience=patience, on_wait=show_wait)
        for spool in spools:
            try:
                with spool.sending(patience):
                    prepare(service, spool)
                    deliver(service, spool, sent, say, show_run)
            except HeldError:
                fail(f"another process is sending from the spool; {_left(spools)}", EX_TEMPFAIL)
            except ServiceAwayError as error:
                fail(f"{error}; {_left(spools)}: push again, or clutchlife spool send, to send them", EX_TEMPFAIL)
            except RefusedError as error:
                fail(f"{error}; {_left(spools)}", EX_DATAERR)
    out.print(str(sent))
    if sent.failed:
        fail(f"{sent.failed} runs were not taken and stay in the spool; {_left(spools)}", EX_TEMPFAIL)
    if sent.refused:
        places = ", ".join(str(spool.folder / "refused") for spool in spools if spool.refused())
        fail(f"refused runs and the reasons are in {places}", EX_DATAERR)


def _left(spools: Sequence[Spool]) -> str:
    """How many runs wait, and where."""
    left = [(len(spool.waiting()), spool.folder) for spool in spools]
    places = ", ".join(str(folder) for count, folder in left if count) or str(left[0][1])
    return f"{sum(count for count, _ in left)} runs wait in {places}"
