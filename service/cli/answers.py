"""`clutchlife life`, `degradation`, `loops`, `engagement`: the answers about a clutch as tables, and as JSON or CSV."""

import json
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlencode

import typer

from service.cli.options import EX_USAGE, ClutchId, Json, asking, fail, out, print_line
from service.cli.tables import chance, coefficient, cycles, model_name, number, show_table, warn, with_deviation
from service.client.clutchlife.answers import JsonObject
from service.client.clutchlife.transport import Service

Method = Annotated[str | None, typer.Option(help="The filter: particle, ukf or grid")]
AtCycles = Annotated[float | None, typer.Option(help="Use only the runs up to these duty cycles")]
Arguments = Annotated[
    list[str] | None,
    typer.Option(
        "--query",
        metavar="NAME=VALUE",
        help="Any other query parameter of the API's request, as NAME=VALUE; may be repeated",
    ),
]
Csv = Annotated[bool, typer.Option("--csv", help="Print the answer as CSV")]


def _arguments(given: list[str] | None, **named: Any) -> JsonObject:
    """The route's arguments: the options given, and those of `--query`."""
    arguments = {name: value for name, value in named.items() if value is not None}
    for assignment in given or []:
        name, equals, value = assignment.partition("=")
        if not equals or not name:
            fail(f"--query takes NAME=VALUE, got {assignment!r}", EX_USAGE)
        arguments[name] = value
    return arguments


def _answer(
    service: Service,
    address: str,
    arguments: Mapping[str, Any],
    show: Callable[[JsonObject], object],
    *,
    as_json: bool,
    as_csv: bool = False,
) -> None:
    """Print the answer of an address as a table, as JSON or as CSV."""
    if as_json and as_csv:
        fail("use --json or --csv, not both", EX_USAGE)
    if as_csv:
        typer.echo(service.table(f"{address}.csv", **arguments), nl=False)
    elif as_json:
        out.print_json(json.dumps(service.get(address, **arguments)))
    else:
        show(service.get(address, **arguments))


#: Quantiles that fit a line; `--json` has all of them.
_SHOWN = ("0.05", "0.25", "0.5", "0.75", "0.95")
_BLOCK = "CYCLES:KJ[:SD]"
_CRITERIA = ("criterion", "bar", "rpm", "Hz", "now", "limit", "end, 5 %", "50 %", "95 %", "is the first")


@asking
def life(
    service: Service,
    clutch: ClutchId,
    method: Method = None,
    pressure: Annotated[
        float | None, typer.Option(help="Line pressure, bar; default: the mean over the pressures")
    ] = None,
    at_cycles: AtCycles = None,
    quantity: Annotated[
        str | None,
        typer.Option(help="Remaining life by this quantity, such as `slope`; default: by the clutch's own criteria"),
    ] = None,
    life_number: Annotated[
        int | None, typer.Option("--life", help="An earlier life of a rebuilt clutch: 1 is the first")
    ] = None,
    query: Arguments = None,
    plan: Annotated[
        Path | None, typer.Option(help="Planned duty: a JSON file with the body of the forecast request")
    ] = None,
    block: Annotated[
        list[str] | None,
        typer.Option(
            metavar=_BLOCK,
            help="Planned duty: cycles, energy per cycle in kJ, standard deviation of the energy; may be repeated",
        ),
    ] = None,
    pace: Annotated[
        float | None,
        typer.Option(
            help="Planned duty cycles per hour, averaged over all hours, idle ones too. With it, the answer also gives dates"
        ),
    ] = None,
    as_json: Json = False,
    as_csv: Csv = False,
) -> None:
    """Show the remaining duty cycles until the end of life; with --plan or --block under planned duty."""
    arguments = _arguments(
        query, method=method, pressure_bar=pressure, at_cycles=at_cycles, quantity=quantity, life=life_number
    )
    address = f"/v1/clutches/{clutch}/remaining-useful-life"
    if plan is None and not block:
        if pace is not None:
            fail("use --pace only with --plan or --block", EX_USAGE)
        _answer(service, address, arguments, _show_life, as_json=as_json, as_csv=as_csv)
        return
    if as_csv:
        fail("--csv is not available for planned duty; use --json", EX_USAGE)
    answer = service.post(f"{address}/forecast?{urlencode(arguments)}", _programme(plan, block or [], pace))
    if as_json:
        out.print_json(json.dumps(answer))
    else:
        _show_life(answer)


def _show_life(answer: Mapping[str, Any]) -> None:
    """A prediction as a table: the clutch's present state, and quantiles of the remaining life."""
    at = "" if answer["as_of_cycles"] is None else f" at {answer['as_of_cycles']:,.0f} cycles"
    out.print(f"{answer['clutch_id']}{at}: {answer['statement']}", markup=False, style="bold")
    for text in _lines(answer):
        print_line(text)
    with_quantiles = [row for row in _quantiles(answer) if any(row[1].get(q) is not None for q in _SHOWN)]
    if with_quantiles:
        rows = [(name, *(shown(quantity.get(q)) for q in _SHOWN)) for name, quantity, shown in with_quantiles]
        show_table(["probability", *(f"{100 * float(q):g} %" for q in _SHOWN)], rows)
    criteria = answer.get("criteria", [])
    if len(criteria) > 1 or any(end["quantity"] != "mean_cof" for end in criteria):
        show_table(_CRITERIA, map(_criterion, criteria))
    warn(answer["warnings"])


def _lines(answer: Mapping[str, Any]) -> Iterator[str]:
    """The lines that `clutchlife rul` prints below the first: mean COF, days, method, pace and severity."""
    current, criterion = answer["current"], answer["criterion"]
    if current.get("mean_cof") is not None:
        cof, fraction = with_deviation(current["mean_cof"], current["mean_cof_sd"]), current["fraction_of_initial"]
        if fraction is None:
            yield f"mean COF {cof} as measured at {current['measured_at_cycles']:,.0f} cycles"
        elif criterion["threshold_mean_cof"] is None or criterion["fraction"] is None:
            yield f"mean COF {cof}, {100 * fraction:.0f} % of new"
        else:
            end = f"the end of life is at {100 * criterion['fraction']:g} %"
            yield f"mean COF {cof}, {100 * fraction:.0f} % of new; {end}"
    if answer["at_least_at"] is not None and answer["at_least"] >= 1.0:
        pace = "planned pace" if answer.get("pace_from") == "request" else "pace so far"
        since = answer["counted_from"]
        days = (datetime.fromisoformat(answer["at_least_at"]) - datetime.fromisoformat(since)).days
        shown = "less than a day" if days < 1 else "1 day" if days == 1 else f"{days:,} days"
        yield f"safe for {shown} at the {pace}, counted from the last run on {since[:10]}"
    course = answer.get("course")
    described = "" if course is None else f", {_COURSES[course['name']]} ({chance(course['probability'])} sure)"
    tests = "1 test" if answer["runs_used"] == 1 else f"{answer['runs_used']} tests"
    yield f"{tests}, method {answer['method']}, model {model_name(answer['model'])}{described}"
    if (lives := answer.get("ended_lives", 0)) > 0:
        yield f"calibrated on {lives} ended {'life' if lives == 1 else 'lives'}"
    if answer.get("pace_cycles_per_hour") is not None:
        source = {"request": "as planned", "runs": "as of the dated runs"}[answer["pace_from"]]
        yield f"{number(answer['pace_cycles_per_hour'])} cycles an hour, {source}"
    severity = [value for value in answer.get("block_severity", ()) if value is not None]
    if severity:
        worth = ", ".join(number(value) for value in severity)
        yield f"one cycle of each block wears like {worth} cycles of recent duty"


#: How a clutch ages, by the name of its course.
_COURSES = {"eq6": "ages as expected", "slowing": "ages slower and slower", "accelerating": "ages faster and faster"}


def _criterion(end: Mapping[str, Any]) -> list[str]:
    """The row of a criterion: present value, limit, when it is reached, and the probability that it is the first."""
    current = end["current"]
    return [
        *_quantity(end),
        with_deviation(current["value"], current["sd"]),
        number(end["limit"]),
        *(cycles(end["end_of_life_cycles"][q]) for q in ("0.05", "0.5", "0.95")),
        chance(end["probability_first"]),
    ]


def _quantity(item: Mapping[str, Any]) -> Iterator[str]:
    """The name of a quantity with its pressure (or the mean over pressures), and its speed or frequency if any."""
    yield item["quantity"]
    yield "mean" if item["pressure_bar"] is None else f"{item['pressure_bar']:g}"
    for name in ("speed_rpm", "frequency_hz"):
        yield "" if item[name] is None else f"{item[name]:g}"


def _quantiles(answer: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any], Any]]:
    """Rows of quantiles: (name, quantiles, format)."""
    yield "remaining cycles", answer["remaining_cycles"], cycles
    yield "end of life, cycles", answer["end_of_life_cycles"], cycles
    held_runs = answer.get("held_runs")
    if held_runs is not None:
        yield f"with {held_runs['count']} held", held_runs["remaining_cycles"], cycles
    if "remaining_blocks" in answer:
        yield "remaining blocks", answer["remaining_blocks"], number
        yield "under recent duty", answer["recent_duty_cycles"], cycles
    if answer.get("end_of_life_at") is not None and answer["counted_from"] is not None:
        name = f"date, counted from {answer['counted_from'][:10]}"
        yield name, answer["end_of_life_at"], lambda date: "-" if date is None else date[:10]


def _programme(plan: Path | None, blocks: list[str], pace: float | None) -> JsonObject:
    """The request body for a planned programme; its content is checked by the service. A given pace replaces the
    file's."""
    if plan is not None and blocks:
        fail("use --plan or --block, not both", EX_USAGE)
    body = {"programme": [_block(text) for text in blocks]} if plan is None else json.loads(plan.read_bytes())
    if not isinstance(body, dict):
        fail(f'{plan} must hold an object, {{"programme": [...]}}', EX_USAGE)
    return body if pace is None else body | {"pace_cycles_per_hour": pace}


def _block(text: str) -> dict[str, float]:
    """A planned block from the text of `--block`; the command ends if it cannot be read."""
    names = ("cycles", "energy_per_cycle_kj", "sd")
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if not 2 <= len(values) <= len(names):
        fail(f"--block takes {_BLOCK}, got {text!r}", EX_USAGE)
    return dict(zip(names, values, strict=False))


_TRACKED = (
    "quantity", "bar", "rpm", "Hz", "last", "90 % band there", "initial", "change", "scale, cycles", "exponent",
    "as expected",
)  # fmt: skip
_COEFFICIENTS = ("initial", "change", "scale_cycles", "exponent")


@asking
def degradation(
    service: Service,
    clutch: ClutchId,
    quantity: Annotated[str | None, typer.Option(help="Only this quantity, such as `slope`")] = None,
    method: Method = None,
    at_cycles: AtCycles = None,
    query: Arguments = None,
    as_json: Json = False,
    as_csv: Csv = False,
) -> None:
    """Show how mean COF and the Stribeck parameters change over life: the coefficients of eq. 6."""
    arguments = _arguments(query, quantity=quantity, method=method, at_cycles=at_cycles)

    def show(answer: Mapping[str, Any]) -> None:
        if answer["items"]:
            show_table(_TRACKED, map(_tracked, answer["items"]))
        else:
            print_line(f"{clutch} has no tracked quantity yet")
        warn(answer["warnings"])

    _answer(service, f"/v1/clutches/{clutch}/degradation", arguments, show, as_json=as_json, as_csv=as_csv)


def _tracked(item: Mapping[str, Any]) -> list[str]:
    coefficients = item["coefficients"]
    estimates = [None if coefficients is None else coefficients[name] for name in _COEFFICIENTS]
    shown = ["-" if part is None else coefficient(part["value"], part["sd"]) for part in estimates]
    return [*_quantity(item), *_last(item), *shown, number(item["eq6_probability"], 2)]


def _last(item: Mapping[str, Any]) -> tuple[str, str]:
    """The track at the last measurement: median and 90 % band."""
    measured, band = item["measured"]["cycles"], item["trajectory"]
    if not measured or band is None or not band["cycles"]:
        return "-", "-"
    near = min(range(len(band["cycles"])), key=lambda index: abs(band["cycles"][index] - measured[-1]))
    return number(band["median"][near]), f"{number(band['lower'][near])} to {number(band['upper'][near])}"


_LOOPS = ("run", "law", "cycles", "bar", "Hz", "area, Nm·m/s", "attractor, Nm/s", "film time, s")


@asking
def loops(
    service: Service, clutch: ClutchId, query: Arguments = None, as_json: Json = False, as_csv: Csv = False
) -> None:
    """Show the friction loops of the dynamic tests: area, attractor and film time."""

    def show(answer: Mapping[str, Any]) -> None:
        if answer["items"]:
            show_table(_LOOPS, map(_loop, answer["items"]), left=2)
        else:
            print_line(f"{clutch} has no loops")
        warn(answer["warnings"])

    _answer(service, f"/v1/clutches/{clutch}/loops", _arguments(query), show, as_json=as_json, as_csv=as_csv)


def _loop(item: Mapping[str, Any]) -> list[str]:
    """A friction loop as a row of the printed table."""
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


#: Lines of the course that are shown. Chosen: with the head they fit a terminal of 24 lines.
_MAX_LINES = 16
#: The indicators of measured engagements that fit beside each other; `--json` has all of them.
_INDICATORS = (
    "stop_time_s", "engagement_energy_kj", "midpoint_cof", "initial_cof_ratio", "endpoint_cof_ratio", "breakaway_cof_ratio",
)  # fmt: skip


@asking
def engagement(
    service: Service, clutch: ClutchId, at_cycles: AtCycles = None, query: Arguments = None, as_json: Json = False
) -> None:
    """Show a simulated engagement, with the Stribeck parameters of now or of --at-cycles, and the measured
    engagements."""
    arguments = _arguments(query, at_cycles=at_cycles)
    _answer(service, f"/v1/clutches/{clutch}/engagement", arguments, _show_engagement, as_json=as_json)


def _show_engagement(answer: Mapping[str, Any]) -> None:
    """The engagement's result, and its course at evenly spaced samples."""
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
    warn(answer["warnings"])


def _measured(item: Mapping[str, Any]) -> list[str]:
    """The rows of a measured engagement: its indicators with their standard errors."""
    estimates = [item["indicators"][name] for name in _INDICATORS]
    shown = ["-" if part is None else with_deviation(part["value"], part["sd"]) for part in estimates]
    return [item["run_id"], number(item["cycles"]), *shown]
