"""`clutchlife degradation`: eq. 6's coefficients of every tracked quantity."""

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from service.cli.answers.request import Arguments, AtCycles, Csv, Method, answered, arguments_of
from service.cli.answers.tables import coefficient, number, place, pressure, show_table, warn
from service.cli.options import URL, ClutchId, Json, Key, Patience, Url, out

_COLUMNS = (
    "quantity",
    "bar",
    "rpm",
    "Hz",
    "last",
    "90 % band there",
    "initial",
    "change",
    "scale, cycles",
    "exponent",
    "P(eq. 6)",
)
_COEFFICIENTS = ("initial", "change", "scale_cycles", "exponent")


def degradation(
    clutch: ClutchId,
    quantity: Annotated[str | None, typer.Option(help="Only this quantity, as `slope`")] = None,
    method: Method = None,
    at_cycles: AtCycles = None,
    query: Arguments = None,
    as_json: Json = False,
    as_csv: Csv = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Show how mean COF and the Stribeck parameters change along a life: the coefficients of eq. 6."""
    arguments = arguments_of(query, quantity=quantity, method=method, at_cycles=at_cycles)
    address = f"/v1/clutches/{clutch}/degradation"
    answer = answered(address, arguments, as_json=as_json, as_csv=as_csv, url=url, key=key, patience=patience)
    if answer is None:
        return
    if not answer["items"]:
        out.print(f"{clutch} has no tracked quantity yet", markup=False)
    else:
        show_table(_COLUMNS, map(_row, answer["items"]))
    warn(answer["warnings"])


def _row(item: Mapping[str, Any]) -> list[str]:
    coefficients = item["coefficients"]
    estimates = [None if coefficients is None else coefficients[name] for name in _COEFFICIENTS]
    shown = ["-" if part is None else coefficient(part["value"], part["sd"]) for part in estimates]
    return [
        item["quantity"],
        pressure(item["pressure_bar"]),
        place(item["speed_rpm"]),
        place(item["frequency_hz"]),
        *_last(item),
        *shown,
        number(item["eq6_probability"], 2),
    ]


def _last(item: Mapping[str, Any]) -> tuple[str, str]:
    """The track at the last measurement: its median and its 90 % band."""
    measured, band = item["measured"]["cycles"], item["trajectory"]
    if not measured or band is None or not band["cycles"]:
        return "-", "-"
    near = min(range(len(band["cycles"])), key=lambda index: abs(band["cycles"][index] - measured[-1]))
    return number(band["median"][near]), f"{number(band['lower'][near])} to {number(band['upper'][near])}"
