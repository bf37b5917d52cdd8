"""`clutchlife export`: everything known of a clutch, raw data included, in files that `push` takes again."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, get_args

import typer
from rich.progress import Progress

from service.cli.options import EX_DATAERR, EX_TEMPFAIL, URL, Key, Patience, Url, err, fail, out, told
from service.cli.sending.client import RefusedError, Service, ServiceAwayError, connect
from service.run_files import manifest

_SENT = ("run_id", "kind", "cycles", "started_at", "origin", "duty", "event", "note", "channels")


def export(
    clutch: Annotated[str, typer.Argument(metavar="ID")],
    out_folder: Annotated[Path, typer.Option("--out", help="The folder to write to")],
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Write a clutch's record, its runs with their raw channels, and all results."""
    from service.schemas.clutch import ClutchIn  # what only this command needs is loaded by it alone

    with told():
        results = out_folder / "results"
        results.mkdir(parents=True, exist_ok=True)
        with connect(url, key=key) as http, Progress(console=err, transient=True) as progress:
            service = Service(http=http, patience=patience)
            task = progress.add_task("exporting", total=None)
            try:
                found = service.get(f"/v1/clutches/{clutch}")
                record = {name: value for name, value in found.items() if name in ClutchIn.model_fields}
                manifest.write(out_folder / manifest.CLUTCH_FILE, record)
                count = 0
                for receipt in _pages(service, f"/v1/clutches/{clutch}/runs"):
                    run = service.get(f"/v1/clutches/{clutch}/runs/{receipt['run_id']}")
                    manifest.write(out_folder / f"{count:05d}-{_safe(receipt['run_id'])}.json", _as_sent(run))
                    count += 1
                    progress.advance(task)
                _results(service, clutch, results)
            except ServiceAwayError as error:
                fail(str(error), EX_TEMPFAIL)
            except RefusedError as error:
                fail(str(error), EX_DATAERR)
        out.print(f"{count} runs of {clutch} in {out_folder}, results in {results}", markup=False, soft_wrap=True)


def _as_sent(run: dict[str, Any]) -> dict[str, Any]:
    return {name: run[name] for name in _SENT if run[name] is not None and run[name] != {}}


def _safe(name: str) -> str:
    return "".join(each if each.isalnum() or each in "-_.+@" else "_" for each in name)


def _pages(service: Service, path: str, **params: Any) -> Iterator[dict[str, Any]]:
    cursor: dict[str, str] = {}
    while True:
        page = service.get(path, **params, **cursor)
        yield from page["items"]
        if page["next"] is None:
            return
        cursor = {"cursor": page["next"]}


def _results(service: Service, clutch: str, folder: Path) -> None:
    from service.schemas.life import Method

    base = f"/v1/clutches/{clutch}"
    for method in get_args(Method):
        _write(
            folder / f"remaining-useful-life-{method}.json", service.get(f"{base}/remaining-useful-life", method=method)
        )
    for name in ("degradation", "loops", "series"):
        _write(folder / f"{name}.json", service.get(f"{base}/{name}"))
    diagnoses = [each["diagnosis_id"] for each in _pages(service, f"{base}/diagnoses")]
    _write(folder / "diagnoses.json", [service.get(f"{base}/diagnoses/{each}") for each in diagnoses])
    _write(folder / "model.json", service.get(f"{base}/model"))
    _write(folder / "runs.json", list(_pages(service, f"{base}/runs")))
    _write(folder / "stribeck.json", list(_pages(service, f"{base}/stribeck")))


def _write(path: Path, content: object) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
