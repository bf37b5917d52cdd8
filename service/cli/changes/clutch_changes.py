"""`clutchlife edit`, `archive`: a clutch's record changed, and a finished clutch put away."""

import json
from typing import Annotated, Any

import typer

from service.cli.connection import service_at
from service.cli.options import EX_USAGE, URL, ClutchId, Key, Patience, Url, fail, out

Reason = Annotated[str, typer.Option("--reason", help="Why; the audit trail keeps it")]


def edit(
    clutch: ClutchId,
    reason: Reason,
    set_fields: Annotated[
        list[str], typer.Option("--set", metavar="FIELD=VALUE", help="As end_of_life.cof_fraction=0.4; may be repeated")
    ],
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Change fields of a clutch's record; all results are computed again."""
    address = f"/v1/clutches/{clutch}"
    with service_at(url, key, patience) as service:
        record = service.get(address)
        fields: dict[str, Any] = {}
        for assignment in set_fields:
            assign(fields, record, assignment)
        changed = service.patch(address, json.dumps(fields | {"reason": reason}).encode())
    for name in fields:
        out.print(f"{clutch}: {name} = {json.dumps(changed[name])}", markup=False, soft_wrap=True)


def archive(
    clutch: ClutchId,
    undo: Annotated[bool, typer.Option("--undo", help="Bring it back")] = False,
    reason: Reason = "",
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Leave a finished clutch out of lists; it takes in no more runs, and fleets still learn from it."""
    body = json.dumps({"archived": not undo, "reason": reason}).encode()
    with service_at(url, key, patience) as service:
        changed = service.patch(f"/v1/clutches/{clutch}", body)
    out.print(f"{clutch} is {'archived' if changed['archived'] else 'in use'}", markup=False)


def assign(fields: dict[str, Any], record: dict[str, Any], assignment: str) -> None:
    """Put `geometry.friction_faces=4` into the field that is sent, whose other parts stay as they are in the record."""
    name, equals, text = assignment.partition("=")
    field, dot, part = name.strip().partition(".")
    if not equals or not field:
        fail(f"--set takes FIELD=VALUE, got {assignment!r}", EX_USAGE)
    try:
        value = json.loads(text)
    except ValueError:
        value = text
    if not dot:
        fields[field] = value
        return
    whole = fields.get(field, record.get(field, {}))
    if not isinstance(whole, dict):
        fail(f"{field} has no parts that could be set", EX_USAGE)
    fields[field] = whole | {part: value}
