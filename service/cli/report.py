"""`clutchlife report`: the clutches as a workbook, and each one's page as a PDF by a browser, once or again and again."""

import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from service.cli import printing
from service.cli.options import asking, err, print_line
from service.client.clutchlife.answers import JsonObject, RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service

_CLUTCHES = (
    "Clutch",
    "State",
    "What to do",
    "Summary",
    "Safe for, cycles (95 %)",
    "Health",
    "Runs",
    "Held",
    "Last run",
)
_ALARMS = ("Clutch", "State", "Raised", "Alarm", "Note")


@asking
def report(
    service: Service,
    clutches: Annotated[list[str] | None, typer.Argument(help="Of these clutches; default: all")] = None,
    out_folder: Annotated[Path, typer.Option("--out", help="The folder to write to")] = Path(),
    pdf: Annotated[bool, typer.Option("--pdf", help="Print each clutch's page too, by Chromium or Chrome")] = False,
    to: Annotated[str | None, typer.Option(help="Send the files there: a web address, or one of Apprise")] = None,
    every: Annotated[float | None, typer.Option(min=0.001, help="Hours between two reports, until Ctrl-C")] = None,
    times: Annotated[int | None, typer.Option(min=1, help="With --every, end after this number of reports")] = None,
) -> None:
    """Write a report: clutches and alarms as XLSX, with --pdf a page for each clutch."""
    count, due = 0, time.monotonic()
    while True:
        try:
            files = _written(service, clutches or [], out_folder, pdf=pdf)
            if to is not None:
                printing.sent(to, files)
        except (RefusedError, ServiceAwayError, printing.ReportError, OSError) as error:
            if every is None:
                raise
            err.print(f"{datetime.now().astimezone():%Y-%m-%d %H:%M}  no report: {error}", markup=False, soft_wrap=True)
        else:
            for path in files:
                print_line(str(path))
        count, due = count + 1, due + 3600 * (every or 0.0)
        if every is None or count == times:
            return
        time.sleep(max(0.0, due - time.monotonic()))


def _written(service: Service, names: Sequence[str], folder: Path, *, pdf: bool) -> list[Path]:
    """Write the files of one report. Their names have the day, so a second report of a day replaces the first."""
    from service.cli.workbook import write_workbook  # start-up time

    clutches = [service.get(f"/v1/clutches/{name}") for name in names] or list(service.pages("/v1/clutches"))
    alarms = [event for event in service.pages("/v1/alarms/events") if not names or event["clutch_id"] in names]
    folder.mkdir(parents=True, exist_ok=True)
    day = f"{datetime.now().astimezone():%Y-%m-%d}"
    book = folder / f"clutchlife-{day}.xlsx"
    sheets = {
        "Clutches": [_CLUTCHES, *map(_clutch, clutches)],
        "Alarms": [_ALARMS, *([*map(_text, _alarm(event))] for event in alarms)],
    }
    write_workbook(book, sheets)
    if not pdf:
        return [book]
    pages = {
        folder / f"{item['clutch_id']}-{day}.pdf": (
            f"/clutches/{item['clutch_id']}",
            "#report .drawing" if item["runs"] > 2 else "#report .state",
        )
        for item in clutches
    }
    printing.print_pages(service.http, pages)
    return [book, *pages]


def _clutch(item: JsonObject) -> list[str]:
    summary = item["summary"] or {"at_least": None, "current": {"health": None}}
    cells = (
        item["clutch_id"], item["state"]["name"].replace("_", " "), item["action"], item["headline"], summary["at_least"],
        summary["current"]["health"], item["runs"], item["held"], item["recent"] and item["recent"]["last_run"]["at"],
    )  # fmt: skip
    return list(map(_text, cells))


def _alarm(event: JsonObject) -> tuple[Any, ...]:
    return event["clutch_id"], event["state"], event["raised_at"], event["message"], event["note"]


def _text(value: Any) -> str:
    return "" if value is None else str(value)
