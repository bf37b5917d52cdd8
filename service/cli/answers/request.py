"""How the commands of this folder ask the service: the route's arguments as given, and the answer in the form wanted."""

import json
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from service.cli.connection import service_at
from service.cli.options import EX_USAGE, fail, out

Method = Annotated[str | None, typer.Option(help="The filter: particle, ukf or grid")]
AtCycles = Annotated[float | None, typer.Option(help="As it would have been answered at these duty cycles")]
Arguments = Annotated[
    list[str] | None,
    typer.Option("--query", metavar="NAME=VALUE", help="Any other argument of the route; may be repeated"),
]
Csv = Annotated[bool, typer.Option("--csv", help="As rows for a spreadsheet")]


def arguments_of(given: list[str] | None, **named: Any) -> dict[str, Any]:
    """The route's arguments: those with an option of their own, where they are given, and those of `--query`."""
    arguments = {name: value for name, value in named.items() if value is not None}
    for assignment in given or []:
        name, equals, value = assignment.partition("=")
        if not equals or not name:
            fail(f"--query takes NAME=VALUE, got {assignment!r}", EX_USAGE)
        arguments[name] = value
    return arguments


def answered(
    address: str,
    arguments: Mapping[str, Any],
    *,
    as_json: bool,
    as_csv: bool = False,
    url: str,
    key: str | None,
    patience: float,
) -> dict[str, Any] | None:
    """The answer at an address, to be shown as a table; None where it is printed already, as JSON or as CSV."""
    if as_json and as_csv:
        fail("use --json or --csv, not both", EX_USAGE)
    with service_at(url, key, patience) as service:
        if as_csv:
            typer.echo(service.table(f"{address}.csv", **arguments), nl=False)
            return None
        answer = service.get(address, **arguments)
    if as_json:
        out.print_json(json.dumps(answer))
        return None
    return answer
