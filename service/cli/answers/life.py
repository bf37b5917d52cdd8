"""`clutchlife life`: the remaining useful life of a clutch, under recent or under planned duty."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlencode

import typer

from service.cli.answers import planned_duty
from service.cli.answers.request import Arguments, AtCycles, Csv, Method, answered, arguments_of
from service.cli.answers.tables import cycles, number, place, show_table, warn, with_deviation
from service.cli.answers.tables import pressure as pressure_of
from service.cli.connection import service_at
from service.cli.options import EX_USAGE, URL, ClutchId, Json, Key, Patience, Url, fail, out

#: Quantiles that fit a line; `--json` has all of them.
_SHOWN = ("0.05", "0.25", "0.5", "0.75", "0.95")
_CRITERIA = ("criterion", "bar", "rpm", "Hz", "now", "limit", "end, 5 %", "50 %", "95 %", "is the first")


def life(
    clutch: ClutchId,
    method: Method = None,
    pressure: Annotated[
        float | None, typer.Option(help="Line pressure, bar; left out, the mean over the pressures")
    ] = None,
    at_cycles: AtCycles = None,
    quantity: Annotated[
        str | None, typer.Option(help="By this quantity, as `slope`; left out, by what ends the clutch's life")
    ] = None,
    life_number: Annotated[
        int | None, typer.Option("--life", help="Of an earlier life of a clutch that was rebuilt: 1 is the first")
    ] = None,
    query: Arguments = None,
    plan: Annotated[Path | None, typer.Option(help="Planned duty: the forecast's request body as a JSON file")] = None,
    block: Annotated[
        list[str] | None,
        typer.Option(
            metavar=planned_duty.BLOCK,
            help="Planned duty: cycles, energy of each in kJ, its deviation; may be repeated",
        ),
    ] = None,
    pace: Annotated[
        float | None, typer.Option(help="Duty cycles an hour of the planned duty, idle hours included, for dates")
    ] = None,
    as_json: Json = False,
    as_csv: Csv = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Show the duty cycles that remain until the end of life; with --plan or --block those under planned duty."""
    arguments = arguments_of(
        query, method=method, pressure_bar=pressure, at_cycles=at_cycles, quantity=quantity, life=life_number
    )
    address = f"/v1/clutches/{clutch}/remaining-useful-life"
    answer: dict[str, Any] | None
    if plan is None and not block:
        if pace is not None:
            fail("--pace goes with --plan or --block", EX_USAGE)
        answer = answered(address, arguments, as_json=as_json, as_csv=as_csv, url=url, key=key, patience=patience)
    elif as_csv:
        fail("planned duty is answered as a table or with --json, not as --csv", EX_USAGE)
    else:
        body = json.dumps(planned_duty.programme(plan, block or [], pace)).encode()
        with service_at(url, key, patience) as service:
            answer = service.post(f"{address}/forecast?{urlencode(arguments)}", body)
        if as_json:
            out.print_json(json.dumps(answer))
            return
    if answer is not None:
        show(answer)


def show(answer: Mapping[str, Any]) -> None:
    """A prediction as a table: where the clutch stands, and the quantiles of what remains."""
    at = "" if answer["as_of_cycles"] is None else f" at {answer['as_of_cycles']:,.0f} cycles"
    out.print(f"{answer['clutch_id']}{at}: {answer['statement']}", markup=False, style="bold")
    for line in _lines(answer):
        out.print(line, markup=False, soft_wrap=True)
    with_quantiles = [row for row in _rows(answer) if any(row[1].get(q) is not None for q in _SHOWN)]
    if with_quantiles:
        rows = [(name, *(shown(quantity.get(q)) for q in _SHOWN)) for name, quantity, shown in with_quantiles]
        show_table(["probability", *(f"{100 * float(q):g} %" for q in _SHOWN)], rows)
    criteria = answer.get("criteria", [])
    if len(criteria) > 1 or any(end["quantity"] != "mean_cof" for end in criteria):
        show_table(_CRITERIA, map(_criterion, criteria))
    warn(answer["warnings"])


def _lines(answer: Mapping[str, Any]) -> Iterator[str]:
    current, criterion = answer["current"], answer["criterion"]
    if current.get("mean_cof") is not None:
        cof, fraction = with_deviation(current["mean_cof"], current["mean_cof_sd"]), current["fraction_of_initial"]
        if fraction is None:
            yield f"mean COF {cof} as measured at {current['measured_at_cycles']:,.0f} cycles"
        else:
            yield f"mean COF {cof}, {100 * fraction:.0f} % of new{_threshold(criterion)}"
    if answer["at_least_at"] is not None:
        yield f"at the pace of the runs until {answer['at_least_at'][:10]} at least"
    course = answer.get("course")
    described = "" if course is None else f", course {course['name']} (probability {number(course['probability'], 2)})"
    effects = ", ".join(answer["model"]["effects"])
    model = f"{answer['model']['name']} ({effects})" if effects else answer["model"]["name"]
    yield f"{answer['runs_used']} tests, method {answer['method']}, model {model}{described}"
    if answer.get("pace_cycles_per_hour") is not None:
        source = {"request": "as planned", "runs": "as of the dated runs"}[answer["pace_from"]]
        yield f"{number(answer['pace_cycles_per_hour'])} cycles an hour, {source}"
    severity = [value for value in answer.get("block_severity", ()) if value is not None]
    if severity:
        worth = ", ".join(number(value) for value in severity)
        yield f"a cycle of each block is worth {worth} cycles of recent duty"


def _threshold(criterion: Mapping[str, Any]) -> str:
    """Where the end of life is, of mean COF alone: others have a table of their own."""
    if criterion["threshold_mean_cof"] is None or criterion["fraction"] is None:
        return ""
    return f"; the end of life is at {100 * criterion['fraction']:g} %"


def _criterion(end: Mapping[str, Any]) -> list[str]:
    """A criterion: what it is now, its limit, when that is reached, and how probably it is the first."""
    first, current = end["probability_first"], end["current"]
    return [
        end["quantity"],
        pressure_of(end["pressure_bar"]),
        place(end["speed_rpm"]),
        place(end["frequency_hz"]),
        with_deviation(current["value"], current["sd"]),
        number(end["limit"]),
        *(cycles(end["end_of_life_cycles"][q]) for q in ("0.05", "0.5", "0.95")),
        "-" if first is None else f"{100 * first:.0f} %",
    ]


def _rows(answer: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any], Any]]:
    """(name, quantiles, how one is written) of each row."""
    yield "remaining cycles", answer["remaining_cycles"], cycles
    yield "end of life, cycles", answer["end_of_life_cycles"], cycles
    held = answer.get("held_runs")
    if held is not None:
        yield f"with {held['count']} held", held["remaining_cycles"], cycles
    if "remaining_blocks" in answer:
        yield "remaining blocks", answer["remaining_blocks"], number
        yield "under recent duty", answer["recent_duty_cycles"], cycles
    if answer.get("end_of_life_at") is not None:
        yield "date (UTC)", answer["end_of_life_at"], lambda date: "-" if date is None else date[:10]
