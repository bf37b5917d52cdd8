"""What waits in a spool, sent: each run or inspection is stored, refused, or stays; and spools sent by a command, with a bar
on the terminal, and with the lines and exit codes in which it ends.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.progress import Progress

from service.cli.options import EX_DATAERR, EX_TEMPFAIL, err, fail, out, say
from service.cli.sending import spool as entries
from service.cli.sending.spool import INSPECTIONS, RUNS, Entry, HeldError, Spool
from service.client.clutchlife.answers import JsonObject, RefusedError, ServiceAwayError, suggested
from service.client.clutchlife.transport import NoLongerWantedError, Service, connect


def transmit(
    spools: Sequence[Spool], url: str, key: str | None, patience: float, prepare: Callable[[Service, Spool], object]
) -> None:
    """Send all waiting runs of one service's spools, after `prepare`; ends the command with an error if any stays or is
    refused."""
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
                fail(f"{error}; {_left(spools)}. Send them with: clutchlife spool send", EX_TEMPFAIL)
            except RefusedError as error:
                fail(f"{error}; {_left(spools)}", EX_DATAERR)
    out.print(str(sent))
    if sent.failed:
        fail(
            f"the service did not accept {sent.failed} {'run' if sent.failed == 1 else 'runs'}; {_left(spools)}",
            EX_TEMPFAIL,
        )
    if sent.refused:
        fail(f"the service refused runs, which stay in {spools[0].folder}. Reasons: clutchlife spool list", EX_DATAERR)


def _left(spools: Sequence[Spool]) -> str:
    """The number of waiting runs, and the folder that holds them."""
    count = sum(len(spool.waiting()) for spool in spools)
    return f"{'1 run waits' if count == 1 else f'{count} runs wait'} in {spools[0].folder}"


#: Runs in a row that an otherwise present service does not answer, after which it is taken to be away. Chosen: one run that
#: it cannot take must not hold up the others; two cost twice the patience.
_MAX_UNANSWERED = 2

#: What receipts call the name of a run and of an inspection.
_NAMES = {RUNS: "run_id", INSPECTIONS: "inspection_id"}

ShowLine = Callable[[str], None]


@dataclass(slots=True)
class Sent:
    """Counts of runs: newly stored, stored already, refused, and left in the spool because the service accepted others
    but not them."""

    stored: int = 0
    duplicates: int = 0
    refused: int = 0
    failed: int = 0
    #: Runs in a row that were not answered.
    unanswered: int = 0

    def __str__(self) -> str:
        return f"{self.stored} stored now, {self.duplicates} stored before, {self.refused} refused"


def deliver(service: Service, spool: Spool, sent: Sent, report: ShowLine, on_run: Callable[[], None]) -> None:
    """Send all waiting entries of a spool and count them in `sent`; the caller holds `spool.sending`. `on_run` is
    called after each entry that still waited.

    Raises ServiceAwayError where the service is away, RefusedError where it would refuse every run.
    """
    spool.begin()
    for entry in spool.waiting():
        try:
            _send(service, spool, entry, sent, report)
        except NoLongerWantedError:
            continue
        except ServiceAwayError as error:
            spool.note(entry, last_answer=str(error), perhaps_stored=entry.perhaps_stored or error.perhaps_stored)
            sent.unanswered += 1
            if sent.unanswered >= _MAX_UNANSWERED or not _present(service, spool):
                raise
            _stays(spool, entry, sent, report, str(error))
        on_run()


def _present(service: Service, spool: Spool) -> bool:
    """Whether the service answers at all, so that only this run gets no answer."""
    at_once = Service(http=service.http, patience=0.0)
    try:
        return at_once.get(f"/v1/clutches/{spool.clutch_id}").get("clutch_id") == spool.clutch_id
    except (ServiceAwayError, RefusedError):
        return False


def _send(service: Service, spool: Spool, entry: Entry, sent: Sent, report: ShowLine) -> None:
    """Send one entry; raises NoLongerWantedError if it no longer waits, and the errors of `deliver`."""
    answer = "sent, but no answer was received"
    spool.note(entry, tries=entry.tries + 1, last_try=entries.stamp(), last_answer=answer, perhaps_stored=True)
    address = f"/v1/clutches/{spool.clutch_id}/{entry.resource}" + ("" if entry.parameters is None else "/file")
    try:
        receipt = service.post_file(address, spool.body(entry), entry.parameters, lambda: spool.awaits(entry))
    except FileNotFoundError as error:
        raise NoLongerWantedError from error
    except RefusedError as error:
        sent.unanswered = 0
        spool.note(entry, last_answer=str(error), perhaps_stored=entry.perhaps_stored or error.status >= 500)
        if error.of_all_runs:
            raise
        if error.of_the_run:
            sent.refused += 1
            _refused(spool, entry, error, report)
        else:
            _stays(spool, entry, sent, report, str(error))
        return
    if not {_NAMES[entry.resource], "duplicate"} <= receipt.keys():
        raise ServiceAwayError(
            f"{service.http.base_url}: the answer is not a receipt, so it does not come from the service"
        )
    sent.unanswered = 0
    sent.duplicates += bool(receipt["duplicate"])
    sent.stored += not receipt["duplicate"]
    for line in _remarks(receipt, receipt[_NAMES[entry.resource]], spool, waited=spool.done(entry)):
        report(line)


def _stays(spool: Spool, entry: Entry, sent: Sent, report: ShowLine, reason: str) -> None:
    """Count and report a failed attempt; the file stays in the spool."""
    sent.failed += 1
    spool.note(entry, failures=entry.failures + 1)
    report(f"not accepted, {reason}: {entry.label} stays in the spool, {spool.body(entry)}")


def _refused(spool: Spool, entry: Entry, error: RefusedError, report: ShowLine) -> None:
    """Set a refused file aside, and report why and what to do."""
    aside = spool.refuse(entry, error.problem)
    place = "a newer version has replaced it" if aside is None else str(aside)
    report(f"{entry.label} is refused, {error}; kept: {place}")
    if error.suggestion is not None:
        report(f"{entry.label}: {suggested(error.suggestion)}")
        report(
            f"{entry.label}: to confirm it, and keep it for the rig: clutchlife import FILE --clutch {spool.clutch_id}"
        )
    if error.other_content:
        report(
            f"{entry.label}: the service has other content under this run_id: the stored run was corrected later, or "
            "another run has this name. The file is not sent again. To see the stored run: "
            f"clutchlife runs {spool.clutch_id}"
        )


def _remarks(receipt: JsonObject, name: str, spool: Spool, *, waited: bool) -> list[str]:
    """Remarks for the sender on a stored run: doubts about it, or later changes to it."""
    cycles = receipt.get("cycles")
    sent_cycles = receipt.get("sent_cycles", cycles)
    lines = []
    if receipt.get("state") == "withdrawn":
        lines.append(f"{name} was stored earlier and then withdrawn: it stays withdrawn and is not sent again")
    if receipt.get("state") == "held":
        doubts = "; ".join(str(doubt.get("message")) for doubt in receipt.get("doubts", ()))
        lines.append(f"{name} is held: {doubts}")
    if receipt["duplicate"] and cycles != sent_cycles:
        lines.append(
            f"{name} was stored earlier and then corrected from {sent_cycles:g} to {cycles:g} cycles: it stays "
            "corrected and is not sent again"
        )
    if not waited:
        lines.append(
            f"{name} was stored while you pushed a newer version: if both are stored, withdraw the old one. For a run: "
            f"clutchlife withdraw {spool.clutch_id} {name}"
        )
    return lines
