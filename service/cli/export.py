"""`clutchlife export`: all that is stored of a clutch, raw data included, in files that `push` sends again.

What `push` sends are the runs that count, at the cycles that hold now: another service then gives the same answers. Runs
that are held, withdrawn or corrected are beside them as they were sent, and so are the files that runs were read from.
"""

import csv
import importlib
import importlib.util
import io
import json
import shutil
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, get_args

import typer
from rich.progress import Progress

from service.cli.options import ClutchId, asking, err, print_line
from service.client.clutchlife.answers import JsonObject, RefusedError
from service.client.clutchlife.transport import Service
from service.runs import manifest

#: The folders of what was sent and does not count so, and of the files that runs were read from.
AS_SENT, FILES = "as-sent", "files"
#: The tables of the API that have a CSV export.
TABLES = (
    "runs", "changes", "inspections", "remaining-useful-life", "degradation", "stribeck", "surfaces", "scores", "loops",
    "series",
)  # fmt: skip
_SENT = ("run_id", "kind", "cycles", "started_at", "origin", "duty", "event", "reason", "note", "channels")


@asking
def export(
    service: Service,
    clutch: ClutchId,
    out_folder: Annotated[Path, typer.Option("--out", help="The folder to write to, or with --archive the file")],
    archive: Annotated[bool, typer.Option("--archive", help="Write one ZIP archive in place of a folder")] = False,
) -> None:
    """Write a clutch's record, its runs with their raw channels, all results, and its inspections with their photographs."""
    if not archive:
        _export(service, clutch, out_folder)
        return
    with tempfile.TemporaryDirectory(prefix="clutchlife-export-") as place:
        folder = Path(place) / _safe(clutch)
        _export(service, clutch, folder)
        archive_path = Path(shutil.make_archive(str(Path(place) / "archive"), "zip", place, folder.name))
        out_folder.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(archive_path, out_folder)
    print_line(f"all of it is in {out_folder}")


def _export(service: Service, clutch: str, out_folder: Path) -> None:
    """Write a clutch's record, runs, files and results into a folder, from which `clutchlife push` can restore it."""
    from service.api.clutch import ClutchIn  # start-up time

    results = out_folder / "results"
    results.mkdir(parents=True, exist_ok=True)
    with Progress(console=err, transient=True) as progress:
        task = progress.add_task("exporting", total=None)
        clutch_out = service.get(f"/v1/clutches/{clutch}")
        record = {name: value for name, value in clutch_out.items() if name in ClutchIn.model_fields}
        manifest.write(out_folder / manifest.CLUTCH_FILE, record)
        count = 0
        for count, receipt in enumerate(service.pages(f"/v1/clutches/{clutch}/runs"), start=1):
            address = f"/v1/clutches/{clutch}/runs/{receipt['run_id']}"
            run = service.get(address)
            name = f"{count - 1:05d}-{_safe(receipt['run_id'])}.json"
            counts, corrected = run["state"] == "accepted", run["cycles"] != run["sent_cycles"]
            if counts:
                manifest.write(out_folder / name, _as_sent(run))
            if corrected or not counts:
                (out_folder / AS_SENT).mkdir(exist_ok=True)
                manifest.write(out_folder / AS_SENT / name, _as_sent(run | {"cycles": run["sent_cycles"]}))
            if run["file"] is not None:
                (out_folder / FILES).mkdir(exist_ok=True)
                name = f"{count - 1:05d}-{_safe(run['file']['filename'])}"
                (out_folder / FILES / name).write_bytes(service.file(f"{address}/file"))
            progress.advance(task)
        _results(service, clutch, results)
        _inspections(service, clutch, results)
        _tables(service, clutch, results)
        _write(results / "about.json", _description(service, clutch_out, record))
    print_line(f"{count} runs of {clutch} in {out_folder}, results in {results}")
    if not _parquet_can_be_written():
        print_line("tables are CSV and XLSX only: for Parquet too, install pyarrow (the extra `parquet`)")


def _tables(service: Service, clutch: str, folder: Path) -> None:
    """Write every table of the API as CSV, all of them as sheets of a workbook, and as Parquet if its library is
    installed. Answers that the clutch does not have yet, such as surfaces before its first stationary test, are left
    out."""
    from service.cli.workbook import write_workbook  # start-up time

    tables = dict[str, str]()
    for name in TABLES:
        try:
            tables[name] = service.table(f"/v1/clutches/{clutch}/{name}.csv")
        except RefusedError as refused:
            if not refused.unknown:
                raise
    (folder / "tables").mkdir(exist_ok=True)
    for name, text in tables.items():
        path = folder / "tables" / f"{name}.csv"
        path.write_text(text, encoding="utf-8", newline="")
        if _parquet_can_be_written():
            arrow_csv, parquet = (importlib.import_module(f"pyarrow.{module}") for module in ("csv", "parquet"))
            parquet.write_table(arrow_csv.read_csv(path), path.with_suffix(".parquet"))
    write_workbook(folder / "tables.xlsx", {name: csv.reader(io.StringIO(text)) for name, text in tables.items()})


def _parquet_can_be_written() -> bool:
    return importlib.util.find_spec("pyarrow") is not None  # an extra


def _description(service: Service, clutch: JsonObject, record: JsonObject) -> JsonObject:
    """The description of an export: the release, the settings of the clutch, and the hashes of its data."""
    from importlib.metadata import version  # start-up time

    runs = service.pages(f"/v1/clutches/{clutch['clutch_id']}/runs")
    return {
        "clutch_id": clutch["clutch_id"],
        "exported_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "release": version("clutchlife"),
        "revision": clutch["revision"],
        "settings": record,
        "model": service.get(f"/v1/clutches/{clutch['clutch_id']}/model"),
        "data": [{name: run[name] for name in ("run_id", "state", "cycles", "content_sha256")} for run in runs],
    }


def _as_sent(run: JsonObject) -> JsonObject:
    return {name: run[name] for name in _SENT if run[name] is not None and run[name] != {}}


def _safe(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_.+@" else "_" for letter in name)


def _results(service: Service, clutch: str, folder: Path) -> None:
    """Write the clutch's results as JSON files."""
    from service.api.life import MethodName  # start-up time

    base = f"/v1/clutches/{clutch}"
    for method in get_args(MethodName):
        answer = service.get(f"{base}/remaining-useful-life", method=method)
        _write(folder / f"remaining-useful-life-{method}.json", answer)
    for name in ("degradation", "loops", "series", "model"):
        _write(folder / f"{name}.json", service.get(f"{base}/{name}"))
    for name in ("runs", "stribeck", "changes"):
        _write(folder / f"{name}.json", list(service.pages(f"{base}/{name}")))
    diagnoses = service.pages(f"{base}/diagnoses")
    _write(folder / "diagnoses.json", [service.get(f"{base}/diagnoses/{item['diagnosis_id']}") for item in diagnoses])


def _inspections(service: Service, clutch: str, folder: Path) -> None:
    """Write the inspections, and each photograph once, as `photographs/HASH.png` or with the suffix of its type."""
    base = f"/v1/clutches/{clutch}/inspections"
    inspections = list(service.pages(base))
    _write(folder / "inspections.json", inspections)
    for inspection in inspections:
        for photograph in inspection["photographs"]:
            name, kind = photograph["photograph_id"], photograph["media_type"].partition("/")[2]
            (folder / "photographs").mkdir(exist_ok=True)
            file = service.file(f"{base}/{inspection['inspection_id']}/photographs/{name}")
            (folder / "photographs" / f"{name}.{kind}").write_bytes(file)


def _write(path: Path, content: object) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
