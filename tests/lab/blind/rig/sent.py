"""What the rig sends of a hidden campaign: the contract's runs as JSON, and the same as the diagnosis takes it."""

from datetime import UTC, datetime
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, MaintenanceEvent, StationaryRun
from models.records.plateaus import cut_plateaus
from models.records.runs import Plateaus, Record
from tests.lab.blind.rig.hide import Hidden
from tests.lab.blind.rig.plan import RPM, Site

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
    stationary, dynamic, duty, maintenance = [], [], [], []
    for run in runs(hidden):
        cycles, begun = run["cycles"], run.get("started_at")
        moment = None if begun is None else datetime.fromisoformat(begun).timestamp()
        match run["kind"]:
            case "stationary_stribeck":
                stationary.append(_stationary(run, moment))
            case "dynamic_stribeck":
                record = Record(**in_si(run["channels"]))
                dynamic.append(DynamicRun(run_id=run["run_id"], cycles=cycles, record=record, moment=moment))
            case "duty_cycles":
                told = run["duty"].get("energy_per_cycle_kj")
                energy = None if told is None else 1e3 * told
                duty.append(DutyRun(cycles=cycles, engagements=run["duty"]["cycles"], energy=energy, moment=moment))
            case "maintenance":
                maintenance.append(MaintenanceEvent(cycles=cycles, event=EventKind(run["event"]), moment=moment))
    return Campaign(
        stationary=tuple(stationary), dynamic=tuple(dynamic), duty=tuple(duty), maintenance=tuple(maintenance)
    )


def _stationary(run: dict[str, Any], moment: float | None) -> StationaryRun:
    columns = in_si(run["channels"])
    if "time" not in columns:
        plateaus = Plateaus(**columns)
        return StationaryRun(run_id=run["run_id"], cycles=run["cycles"], plateaus=plateaus, moment=moment)
    record = Record(**columns)
    cut = cut_plateaus(record)
    middle = tuple(float(t) for t in 0.5 * (cut.start + cut.stop))
    return StationaryRun(
        run_id=run["run_id"],
        cycles=run["cycles"],
        plateaus=cut.plateaus,
        moment=moment,
        time=middle,
        record=record,
    )


#: A channel's name in SI units, its factor and what is added.
_SI = {
    "time_s": ("time", 1.0, 0.0),
    "pressure_bar": ("pressure", 1e5, 0.0),
    "speed_rpm": ("speed", RPM, 0.0),
    "torque_nm": ("torque", 1.0, 0.0),
    "oil_temperature_c": ("oil_temperature", 1.0, KELVIN),
    "torque_sd_nm": ("torque_sd", 1.0, 0.0),
}


def in_si(channels: dict[str, list[float]]) -> dict[str, FloatArray]:
    """A run's channels in SI units."""
    return {
        name: np.array(channels[channel], dtype=np.float64) * factor + added
        for channel, (name, factor, added) in _SI.items()
        if channel in channels
    }
