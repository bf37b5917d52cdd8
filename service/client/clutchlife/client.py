"""The client for scripts: one method a question.

from clutchlife import Client

cycles = Client("http://127.0.0.1:8000").remaining_useful_life("e")["at_least"]
"""

import json
import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote

from .answers import DiagnosisFailedError, JsonObject, RefusedError
from .tables import Frames, columns, table
from .transport import Service, connect

#: Seconds that the service may hold a request for a diagnosis, and seconds between two looks at it afterwards.
_WAIT, _LOOK = 10, 0.5
_JSON_SUFFIX = ".json"


class Client:
    """A client for a running service. A refused request raises RefusedError with the service's problem report; if the
    service is away for longer than `patience` [s], ServiceAwayError is raised.

    Lists are tables: frames of pandas, else of polars, else lists of dictionaries; `frames` selects one of them.
    Threads may share a client.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8000",
        key: str | None = None,
        *,
        patience: float = 10.0,
        timeout: float = 60.0,
        frames: Frames = "auto",
    ) -> None:
        self.service = Service(http=connect(url, key=key, timeout=timeout), patience=patience)
        self.frames: Frames = frames

    def __enter__(self) -> Self:
        """The client itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close its connections."""
        self.close()

    def close(self) -> None:
        """Close its connections."""
        self.service.http.close()

    # --- clutches ---

    def clutches(self, **arguments: Any) -> Any:
        """All clutches as a table, the most urgent first; `archived=True`: the archived ones."""
        return self._table("/v1/clutches", **arguments)

    def clutch(self, clutch_id: str) -> JsonObject:
        """One clutch: its record, its state, and a summary of its remaining life."""
        return self.service.get(_clutch(clutch_id))

    def register(self, clutch_id: str, **record: Any) -> JsonObject:
        """Register a clutch; omitted fields have the reference's values. Registering the same clutch again changes
        nothing."""
        return self.service.post("/v1/clutches", {"clutch_id": clutch_id, **record})

    # --- runs ---

    def runs(self, clutch_id: str, **arguments: Any) -> Any:
        """A clutch's runs as a table by cycles, one row per run; `state="held"`: those that wait to be confirmed. A
        frame leaves out fits and loops: `stribeck` and `loops` have them."""
        return self._table(f"{_clutch(clutch_id)}/runs", without=("fits", "loops"), **arguments)

    def run(self, clutch_id: str, run_id: str, **arguments: Any) -> JsonObject:
        """One run with its channels; `points=2000` thins them."""
        return self.service.get(f"{_clutch(clutch_id)}/runs/{quote(run_id, safe='')}", **arguments)

    def post_run(self, clutch_id: str, run: Mapping[str, Any] | str | Path | None = None, **fields: Any) -> JsonObject:
        """Send a run; returns its receipt. Safe to repeat.

        `run` is its content, or its file: JSON, or a recorder's file with `kind` and `cycles` or a `rig`. Instead of or
        beside a content its `fields` may be given, as `kind="maintenance", event="oil_change", cycles=7000`; `channels` may
        be a frame of pandas or polars, or arrays by name.
        """
        address = f"{_clutch(clutch_id)}/runs"
        if isinstance(run, (str, Path)):
            path = Path(run)
            if path.suffix == _JSON_SUFFIX:
                return self.service.post(address, json.loads(path.read_bytes()) | _content(fields))
            query = {"filename": path.name} | {name: value for name, value in fields.items() if value is not None}
            profile = query.pop("profile", None)
            parameters = {name: str(value) for name, value in query.items()}
            if profile is not None:
                return self.service.post_form(f"{address}/file", path, profile, parameters)
            return self.service.post_file(f"{address}/file", path, parameters)
        return self.service.post(address, _content({**({} if run is None else run), **fields}))

    def confirm_suggestion(
        self, clutch_id: str, run: str | Path, refused: RefusedError, rig: str | None = None, **fields: Any
    ) -> JsonObject:
        """Send a file again with the reading that its refusal suggested; returns its receipt. `rig`: a new name, under
        which the reading is kept for the next files. `fields`, such as `cycles`, come before what is suggested.

        Raises ValueError where nothing was suggested.
        """
        if refused.suggestion is None:
            raise ValueError("the refusal has no suggestion to confirm")
        said = {name: refused.suggestion[name] for name in ("profile", "time", "kind", "cycles")}
        return self.post_run(clutch_id, run, **{**said, "rig": rig, **fields})

    def confirm(self, clutch_id: str, *run_ids: str, reason: str = "") -> JsonObject:
        """Accept held runs as they were sent, in one step; their receipts are in `items`."""
        return self.service.post(f"{_clutch(clutch_id)}/runs/confirm", {"run_ids": run_ids, "reason": reason})

    # --- what is known ---

    def remaining_useful_life(self, clutch_id: str, **arguments: Any) -> JsonObject:
        """The remaining duty cycles with quantiles; arguments are those of the API: `method`, `at_cycles`, ..."""
        return self.service.get(f"{_clutch(clutch_id)}/remaining-useful-life", **arguments)

    def forecast(self, clutch_id: str, programme: Any, **fields: Any) -> JsonObject:
        """Remaining life under planned duty: `programme=[{"cycles": 5000, "energy_per_cycle_kj": 25}]`."""
        address = f"{_clutch(clutch_id)}/remaining-useful-life/forecast"
        return self.service.post(address, {"programme": list(programme), **fields})

    def degradation(self, clutch_id: str, **arguments: Any) -> JsonObject:
        """The coefficients of eq. 6 for every tracked quantity, with their uncertainty."""
        return self.service.get(f"{_clutch(clutch_id)}/degradation", **arguments)

    def stribeck(self, clutch_id: str, **arguments: Any) -> Any:
        """The fitted curves of all stationary tests as a table; a frame has one row per curve, by test and pressure."""
        return self._table(f"{_clutch(clutch_id)}/stribeck", row_of="fits", **arguments)

    def loops(self, clutch_id: str, **arguments: Any) -> Any:
        """The friction loops of all dynamic tests as a table."""
        return self._table(f"{_clutch(clutch_id)}/loops", **arguments)

    def series(self, clutch_id: str, **arguments: Any) -> Any:
        """Every quantity over cycles as flat rows; `source`: "run" for values of one run, "track" for values tracked
        over all runs up to it."""
        return self._table(f"{_clutch(clutch_id)}/series", **arguments)

    # --- diagnoses ---

    def diagnose(
        self, clutch_id: str, *, adopt: bool = False, isolability: bool = False, wait: float = 600.0
    ) -> JsonObject:
        """Diagnose a clutch and wait for the report. Raises DiagnosisFailedError where it failed, TimeoutError where it
        has not ended after `wait` [s]. `adopt`: the extended model is adopted if there is one; `isolability`: the
        report says which causes these tests could tell apart."""
        report = diagnosed(self.service, clutch_id, adopt=adopt, isolability=isolability, wait=wait)
        if report["status"] != "finished":
            raise DiagnosisFailedError(f"the diagnosis failed: {report['problem']}", {"detail": report["problem"]})
        return report

    def diagnoses(self, clutch_id: str, **arguments: Any) -> Any:
        """The diagnoses of a clutch as a table, newest first."""
        return self._table(f"{_clutch(clutch_id)}/diagnoses", **arguments)

    def adopt(self, clutch_id: str, diagnosis_id: str | None) -> JsonObject:
        """Track a clutch under a diagnosis's extended model; None: under the baseline again."""
        return self.service.put(f"{_clutch(clutch_id)}/model", {"diagnosis_id": diagnosis_id})

    # --- alarms ---

    def alarms(self, **arguments: Any) -> Any:
        """The alarm rules as a table."""
        return self._table("/v1/alarms", **arguments)

    def add_alarm(self, quantity: str, **rule: Any) -> JsonObject:
        """Create a rule: `add_alarm("remaining_cycles", clutch_id="e", below=4000)`."""
        return self.service.post("/v1/alarms", {"quantity": quantity, **rule})

    def events(self, **arguments: Any) -> Any:
        """Alarms as a table, newest first; `state="open"`: those not cleared."""
        return self._table("/v1/alarms/events", **arguments)

    def acknowledge(self, event_id: str, note: str = "") -> JsonObject:
        """Acknowledge an alarm."""
        return self.service.post(f"/v1/alarms/events/{quote(event_id, safe='')}/acknowledge", {"note": note})

    def _table(self, address: str, *, row_of: str | None = None, without: Sequence[str] = (), **arguments: Any) -> Any:
        return table(self.service.pages(address, **arguments), self.frames, row_of=row_of, without=without)


def diagnosed(
    service: Service,
    clutch_id: str,
    *,
    adopt: bool,
    isolability: bool = False,
    wait: float = math.inf,
) -> JsonObject:
    """Ask for a diagnosis and wait for its report. Raises TimeoutError after `wait` [s]."""
    address = f"{_clutch(clutch_id)}/diagnoses"
    deadline = time.monotonic() + wait
    report = service.post(
        address, {"adopt": adopt, "isolability": isolability}, prefer=f"wait={int(min(_WAIT, max(0.0, wait)))}"
    )
    while report["status"] == "running":
        if time.monotonic() > deadline:
            raise TimeoutError(
                f"diagnosis {report['diagnosis_id']} of {clutch_id} still runs after {wait:g} s: ask again"
            )
        time.sleep(_LOOK)
        report = service.get(f"{address}/{report['diagnosis_id']}")
    return report


def _clutch(clutch_id: str) -> str:
    if not clutch_id:
        raise RefusedError(0, {"detail": "a clutch's name must not be empty"})
    return f"/v1/clutches/{quote(clutch_id, safe='')}"


def _content(fields: Mapping[str, Any]) -> JsonObject:
    """A run's fields as JSON content; None values are left out."""
    stated = {name: value for name, value in fields.items() if value is not None}
    if "channels" in stated:
        stated["channels"] = columns(stated["channels"])
    return stated
