"""`clutchlife demo`: a simulated life, posted run by run to a service of its own, with the prognosis as it sharpens."""

import os
import socket
import subprocess
import sys
import tempfile
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated

import typer

from service.cli.diagnose import shown
from service.cli.options import Seed, fail, out, print_line, spinning
from service.client.clutchlife.answers import JsonObject, ServiceAwayError
from service.client.clutchlife.client import diagnosed
from service.client.clutchlife.transport import Service, connect

_PORT = 8000
_START_SECONDS = 60.0
HIDDEN_EFFECT = "oil_temperature"
HIDDEN = "the oil temperature: a change of viscosity acts like a change of speed"
_HEADER = f"{'cycles':>7} {'mean COF':>16} {'of new':>7} {'remaining':>10} {'90 % interval':>17} {'truth':>7}"


def demo(
    seed: Seed = 1,
    exit_at_end: Annotated[bool, typer.Option("--exit", help="End instead of leaving the service open")] = False,
    browser: Annotated[
        bool, typer.Option(help="Open the dashboard in a browser at the end, where there is one")
    ] = True,
) -> None:
    """Simulate a clutch's life, send it to a service run by run, and watch the prediction of its remaining life."""
    with tempfile.TemporaryDirectory(prefix="clutchlife-demo-") as folder, _service(Path(folder)) as (url, process):
        print_line(f"Clutchlife at {url}, its database in {folder}")
        with connect(url) as http:
            _life(Service(http=http), seed)
            if exit_at_end:
                return
        page = f"{url}/clutches/sim-{seed}"
        with suppress(KeyboardInterrupt):
            print_line(f"\nThe dashboard stays open at {page} until Ctrl-C; all clutches: {url}")
            if browser and sys.stdout.isatty() and "CI" not in os.environ:
                webbrowser.open(page)
            process.wait()
        out.print("closing")


def _life(service: Service, seed: int) -> None:
    """Post the life with its inspections, and have it diagnosed at its end, so that the diagnosis sees all runs."""
    from models.rig import campaign  # start-up time
    from service.cli.demo import life  # start-up time
    from service.runs import simulated  # start-up time

    clutch_id, truth = f"sim-{seed}", campaign.simulated_clutch(seed)
    end = truth.end_of_life()
    service.post("/v1/clutches", simulated.simulated_clutch_body(clutch_id))
    out.print(f"\nA simulated clutch, {clutch_id}: 7 pressures x 40 speeds a test, 1 % noise.")
    out.print(f"Hidden in its torque: {HIDDEN}. The service does not know this effect.", markup=False)
    out.print("Remaining duty cycles until its mean COF has halved:\n")
    out.print(_HEADER, style="bold")
    inside: list[bool] = []
    with spinning(out) as progress:
        task = progress.add_task("run-in", total=end)
        for run in life.runs(seed):
            progress.update(task, description=f"{run.kind.value.replace('_', ' ')}, {run.cycles} cycles")
            service.post(f"/v1/clutches/{clutch_id}/runs", simulated.simulated_body(run))
            progress.update(task, completed=run.cycles)
            if run.plateaus is not None:
                prediction = service.get(f"/v1/clutches/{clutch_id}/remaining-useful-life")
                progress.console.print(_row(prediction, end), markup=False)
                inside += _inside(prediction, end)
    halved = "it never halves" if end is None else f"it halved at {end:.0f} cycles"
    out.print(
        f"The truth: {halved}.\nThe 90 % interval contained the true end {sum(inside)} times out of {len(inside)}.\n"
        "'-' means: too few tests yet, or the end may never come."
    )
    for cycles, surface in life.inspections(seed, run.cycles):
        service.post(f"/v1/clutches/{clutch_id}/inspections", simulated.simulated_inspection(surface, cycles))
    _diagnosed(service, clutch_id, end)


def _diagnosed(service: Service, clutch_id: str, end: float | None) -> None:
    """The diagnosis of the posted life, and the predictions at half of it before and after adoption."""
    out.print("\nWhat does the simulation get wrong?\n", style="bold")
    halfway = {} if end is None else {"at_cycles": round(end / 2)}
    before = service.get(f"/v1/clutches/{clutch_id}/remaining-useful-life", **halfway)
    with spinning(out) as progress:
        progress.add_task("diagnosing", total=None)
        report = diagnosed(service, clutch_id, adopt=True)
    if report["status"] != "finished":
        fail(f"the diagnosis failed: {report['problem']}")
    for part in shown(report):
        out.print(part)
    after = service.get(f"/v1/clutches/{clutch_id}/remaining-useful-life", **halfway)
    named = HIDDEN_EFFECT in report["causes"]
    out.print(
        f"\nThe hidden cause, {HIDDEN_EFFECT.replace('_', ' ')}, was {'found' if named else 'not found'}.",
        style="bold",
        markup=False,
    )
    if end is not None:
        out.print(f"The forecast at half of the life, with each model:\n{'':8} {_HEADER}")
        for name, prediction in (("before", before), ("after", after)):
            out.print(f"{name:8} {_row(prediction, end)}", markup=False)


def _row(prediction: JsonObject, end: float | None) -> str:
    """A prediction as a line of the demo's table, with the true remaining life beside it."""
    current, remaining = prediction["current"], prediction["remaining_cycles"]
    cof = f"{current['mean_cof']:.4f} ± {current['mean_cof_sd']:.4f}"
    interval = f"{_count(remaining['0.05'])} … {_count(remaining['0.95'])}"
    left = "-" if end is None else f"{max(0.0, end - prediction['as_of_cycles']):.0f}"
    fraction = current["fraction_of_initial"]
    share = "-" if fraction is None else f"{100 * fraction:.1f} %"
    if prediction["status"] == "reached":
        interval = "reached"
    return (
        f"{prediction['as_of_cycles']:>7} {cof:>16} {share:>7} {_count(remaining['0.5']):>10} {interval:>17} {left:>7}"
    )


def _inside(prediction: JsonObject, end: float | None) -> list[bool]:
    """Whether the interval contained the true end of life, if there was an interval and the end was still ahead."""
    low, high = (prediction["end_of_life_cycles"][quantile] for quantile in ("0.05", "0.95"))
    if low is None or end is None or prediction["as_of_cycles"] > end:
        return []
    return [low <= end and (high is None or end <= high)]


def _count(cycles: float | None) -> str:
    return "-" if cycles is None else f"{cycles:.0f}"


@contextmanager
def _service(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Context with a service in its own process and with its own database, stopped at the end."""
    port, log = _free_port(), folder / "service.log"
    command = [sys.executable, "-m", "service.cli.main", "serve", "--port", str(port), "--log-level", "warning"]
    with log.open("wb") as file:
        process = subprocess.Popen(  # noqa: S603  (our own command)
            [*command, "--database", f"sqlite:///{folder / 'clutchlife.db'}"], stdout=file, stderr=file
        )
    url = f"http://127.0.0.1:{port}"
    try:
        with connect(url, timeout=5.0) as http:
            _await_ready(Service(http=http, patience=0.0), process, log)
        yield url, process
    finally:
        process.terminate()
        process.wait(timeout=20)


def _await_ready(service: Service, process: subprocess.Popen[bytes], log: Path) -> None:
    """Wait until the demo's service answers; the command ends if the service does not start."""
    deadline = time.monotonic() + _START_SECONDS
    while time.monotonic() < deadline:
        if process.poll() is not None:
            fail(f"the service ended with {process.returncode}:\n{log.read_text(encoding='utf-8')}")
        try:
            service.get("/readyz")
        except ServiceAwayError:
            time.sleep(0.1)
        else:
            return
    fail(f"the service was not ready after {_START_SECONDS:.0f} s:\n{log.read_text(encoding='utf-8')}")


def _free_port() -> int:
    """The usual port if it is free, else any free port."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", _PORT))
        except OSError:
            probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
