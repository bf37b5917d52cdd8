"""What the rig sends of a hidden campaign: the contract's runs as JSON, and the same as the diagnosis takes it."""

from datetime import UTC, datetime
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, MaintenanceEvent, StationaryRun
from models.records.plateaus import cut_plateaus
from models.records.runs import Plateaus, Record
from tests.blind.rig.hide import Hidden
from tests.blind.rig.plan import RPM, Site

LONG_PAUSE = 4 * 3600.0
KELVIN = 273.15


def runs(hidden: Hidden) -> list[dict[str, Any]]:
    """The runs as they would be posted, ordered by cycles."""
    sent = [*_duty(hidden), *_events(hidden)]
    dice = np.random.default_rng([*hidden.seed, 77])
    for number, (site, torque) in enumerate(zip(hidden.plan.sites, hidden.measured, strict=True)):
        for k in range(hidden.plan.life.cycles.size):
            rows = np.flatnonzero(site.state == k)
            if rows.size:
                sent.append(_test(hidden, site, torque, rows, k, number, dice))
    return sorted(sent, key=lambda run: (run["cycles"], run["kind"] != "duty_cycles", run["kind"] != "maintenance"))


def _test(
    hidden: Hidden, site: Site, torque: FloatArray, rows: np.ndarray, k: int, number: int, dice: np.random.Generator
) -> dict[str, Any]:
    loop = site.kind == "loop"
    channels = {
        "pressure_bar": _listed(site.bar[rows], 4),
        "speed_rpm": _listed(site.rpm[rows], 2),
        "torque_nm": _listed(torque[rows], 4),
    }
    if site.kind != "stationary":
        channels["time_s"] = _listed(site.clock[rows], 4)
    elif hidden.sensor.misjudged is not None:
        channels["torque_sd_nm"] = _listed(hidden.sensor.misjudged * hidden.sensor.sigma(site, torque[rows]), 5)
    if hidden.plan.tells_oil:
        oil = site.oil[rows]
        channels["oil_temperature_c"] = _listed(oil + 0.1 * dice.standard_normal(oil.shape), 1)
    return {
        "run_id": f"{site.kind}-{number}-{k}",
        "kind": "dynamic_stribeck" if loop else "stationary_stribeck",
        "cycles": float(hidden.plan.life.cycles[k]),
        "channels": channels,
        **_started(hidden, float(hidden.plan.life.moment[k]) + 1500.0 * number),
    }


def _duty(hidden: Hidden) -> list[dict[str, Any]]:
    life = hidden.plan.life
    blocks = []
    for k in 1 + np.flatnonzero(np.diff(life.cycles) > 0):
        duty = {"cycles": float(life.cycles[k] - life.cycles[k - 1]), "initial_speed_rpm": 2000.0}
        duty["maximum_pressure_bar"] = 8.0
        if hidden.plan.tells_energy:
            duty["energy_per_cycle_kj"] = round(float(life.energy[k]), 3)
        begun = float(life.moment[k] - life.pause[k] - 20.0 * duty["cycles"])
        block = {"run_id": f"duty-{k}", "kind": "duty_cycles", "cycles": float(life.cycles[k]), "duty": duty}
        blocks.append(block | _started(hidden, begun))
    return blocks


def _events(hidden: Hidden) -> list[dict[str, Any]]:
    life = hidden.plan.life
    sent: list[dict[str, Any]] = []
    for i, (kind, at) in enumerate(life.events):
        k = int(np.searchsorted(life.cycles, at))
        moment = _started(hidden, float(life.moment[k] - life.pause[k]))
        sent.append({"run_id": f"event-{i}", "kind": "maintenance", "cycles": at, "event": kind, "note": ""} | moment)
    for k in np.flatnonzero(life.pause > LONG_PAUSE):
        moment = _started(hidden, float(life.moment[k] - life.pause[k]))
        rest = {"run_id": f"rest-{k}", "kind": "maintenance", "cycles": float(life.cycles[k]), "event": "rest"}
        sent.append(rest | {"note": f"{life.pause[k] / 3600:.0f} h"} | moment)
    return sent


def _started(hidden: Hidden, moment: float) -> dict[str, str]:
    return {"started_at": datetime.fromtimestamp(moment, UTC).isoformat()} if hidden.plan.tells_moments else {}


def _listed(values: FloatArray, digits: int) -> list[float]:
    return [float(x) for x in np.round(values.ravel(), digits)]


def campaign(hidden: Hidden) -> Campaign:
    """The same runs in SI units, raw stationary records cut into plateaus as the service cuts them."""
    sent = runs(hidden)
    stationary = [_stationary(run) for run in sent if run["kind"] == "stationary_stribeck"]
    dynamic = [
        DynamicRun(run_id=run["run_id"], cycles=run["cycles"], record=_record(run), moment=_moment(run))
        for run in sent
        if run["kind"] == "dynamic_stribeck"
    ]
    duty = [
        DutyRun(
            cycles=run["cycles"],
            engagements=run["duty"]["cycles"],
            energy=1e3 * run["duty"]["energy_per_cycle_kj"] if "energy_per_cycle_kj" in run["duty"] else None,
            moment=_moment(run),
        )
        for run in sent
        if run["kind"] == "duty_cycles"
    ]
    maintenance = [
        MaintenanceEvent(cycles=run["cycles"], event=EventKind(run["event"]), moment=_moment(run))
        for run in sent
        if run["kind"] == "maintenance"
    ]
    return Campaign(
        stationary=tuple(stationary), dynamic=tuple(dynamic), duty=tuple(duty), maintenance=tuple(maintenance)
    )


def _moment(run: dict[str, Any]) -> float | None:
    return datetime.fromisoformat(run["started_at"]).timestamp() if "started_at" in run else None


def _columns(run: dict[str, Any]) -> dict[str, FloatArray]:
    channels = {name: np.array(values) for name, values in run["channels"].items()}
    columns = {
        "pressure": channels["pressure_bar"] * 1e5,
        "speed": channels["speed_rpm"] * RPM,
        "torque": channels["torque_nm"],
    }
    if "oil_temperature_c" in channels:
        columns["oil_temperature"] = channels["oil_temperature_c"] + KELVIN
    if "torque_sd_nm" in channels:
        columns["torque_sd"] = channels["torque_sd_nm"]
    return columns


def _record(run: dict[str, Any]) -> Record:
    return Record(time=np.array(run["channels"]["time_s"]), **_columns(run))


def _stationary(run: dict[str, Any]) -> StationaryRun:
    if "time_s" not in run["channels"]:
        plateaus = Plateaus(**_columns(run))
        return StationaryRun(run_id=run["run_id"], cycles=run["cycles"], plateaus=plateaus, moment=_moment(run))
    record = _record(run)
    cut = cut_plateaus(record)
    middle = tuple(float(t) for t in 0.5 * (cut.start + cut.stop))
    return StationaryRun(
        run_id=run["run_id"],
        cycles=run["cycles"],
        plateaus=cut.plateaus,
        moment=_moment(run),
        time=middle,
        record=record,
    )
