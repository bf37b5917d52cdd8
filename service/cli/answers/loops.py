"""`clutchlife loops`: the friction loops of the dynamic tests, and the lag that explains them."""

from collections.abc import Mapping
from typing import Any

from service.cli.answers.request import Arguments, Csv, answered, arguments_of
from service.cli.answers.tables import number, show_table, with_deviation
from service.cli.options import URL, ClutchId, Json, Key, Patience, Url, out

_COLUMNS = ("run", "law", "cycles", "bar", "Hz", "area, Nm·m/s", "attractor, Nm/s", "film time, s")


def loops(
    clutch: ClutchId,
    query: Arguments = None,
    as_json: Json = False,
    as_csv: Csv = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Show the friction loops of the dynamic tests: their area and both laws of the lag."""
    address = f"/v1/clutches/{clutch}/loops"
    arguments = arguments_of(query)
    answer = answered(address, arguments, as_json=as_json, as_csv=as_csv, url=url, key=key, patience=patience)
    if answer is None:
        return
    if answer["items"]:
        show_table(_COLUMNS, map(_row, answer["items"]), left=2)
    else:
        out.print(f"{clutch} has no loops", markup=False)


def _row(item: Mapping[str, Any]) -> list[str]:
    return [
        item["run_id"],
        item["better_law"] or item["status"],
        number(item["cycles"]),
        f"{item['pressure_bar']:.3g}",
        number(item["frequency_hz"]),
        with_deviation(item["loop_area_nm_m_s"], item["loop_area_sd_nm_m_s"]),
        with_deviation(item["attractor_nm_s"], item["attractor_sd_nm_s"]),
        with_deviation(item["film_time_s"], item["film_time_sd_s"]),
    ]
