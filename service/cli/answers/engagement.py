"""`clutchlife engagement`: the engagement that the tracked clutch would give, in a few numbers, and the measured ones."""

from collections.abc import Mapping
from typing import Any

from service.cli.answers.request import Arguments, AtCycles, answered, arguments_of
from service.cli.answers.tables import number, show_table, with_deviation
from service.cli.options import URL, ClutchId, Json, Key, Patience, Url, out

#: Lines of the course that are shown. Chosen: with the head they fit a terminal of 24 lines.
_MAX_LINES = 16
#: The indicators of measured engagements that fit beside each other; `--json` has all of them.
_INDICATORS = (
    "stop_time_s",
    "engagement_energy_kj",
    "midpoint_cof",
    "initial_cof_ratio",
    "endpoint_cof_ratio",
    "breakaway_cof_ratio",
)


def engagement(
    clutch: ClutchId,
    at_cycles: AtCycles = None,
    query: Arguments = None,
    as_json: Json = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Show an engagement simulated with the tracked Stribeck parameters, now or at any cycles, and the measured ones."""
    address = f"/v1/clutches/{clutch}/engagement"
    arguments = arguments_of(query, at_cycles=at_cycles)
    answer = answered(address, arguments, as_json=as_json, url=url, key=key, patience=patience)
    if answer is not None:
        show(answer)


def show(answer: Mapping[str, Any]) -> None:
    """The engagement's outcome, and its course at evenly spaced samples."""
    end = f"engaged after {answer['duration_s']:.3g} s" if answer["engaged"] else "still slipping at the end"
    out.print(
        f"{answer['clutch_id']} at {answer['at_cycles']:,.0f} cycles, simulated: {end}, {number(answer['energy_kj'])} kJ",
        markup=False,
        style="bold",
    )
    out.print(
        f"from {answer['initial_speed_rpm']:.0f} rpm, up to {answer['maximum_pressure_bar']:g} bar, "
        f"motor up to {answer['motor_torque_limit_nm']:g} Nm, model {answer['model']['name']}",
        markup=False,
    )
    columns = list(answer["channels"].values())
    step = max(1, -(-len(columns[0]) // _MAX_LINES))
    rows = [[number(value) for value in row] for row in list(zip(*columns, strict=True))[::step]]
    show_table(list(answer["channels"]), rows, left=0)
    if answer["measured"]:
        out.print("measured engagements", style="bold")
        show_table(["run", "cycles", *_INDICATORS], map(_measured, answer["measured"]))


def _measured(item: Mapping[str, Any]) -> list[str]:
    """A measured engagement: its indicators with their standard errors."""
    estimates = [item["indicators"][name] for name in _INDICATORS]
    shown = ["-" if part is None else with_deviation(part["value"], part["sd"]) for part in estimates]
    return [item["run_id"], number(item["cycles"]), *shown]
