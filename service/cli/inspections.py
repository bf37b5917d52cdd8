"""`clutchlife inspect`, `inspections`: what was found on a clutch's friction surface, sent and listed."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from service.cli.options import EX_USAGE, ClutchId, Json, asking, fail, listed, print_line
from service.cli.tables import number, show_table
from service.client.clutchlife.answers import JsonObject
from service.client.clutchlife.transport import Service

#: The media type of a photograph by its file's suffix.
MEDIA_TYPES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}
_COLUMNS = ("inspection", "lining", "state", "cycles", "R_a, µm", "R_sk", "photographs")


@asking
def inspect(
    service: Service,
    clutch: ClutchId,
    cycles: Annotated[float, typer.Option(min=0, help="Duty cycles since new when the surface was inspected")],
    ra: Annotated[float | None, typer.Option("--ra", help="Roughness R_a of the surface profile [µm]")] = None,
    rsk: Annotated[float | None, typer.Option("--rsk", help="Skewness R_sk of the surface profile")] = None,
    lining: Annotated[str, typer.Option(help="The disc, its side, or the place on its lining")] = "",
    note: Annotated[str, typer.Option(help="A remark")] = "",
    at: Annotated[datetime | None, typer.Option(help="When it was inspected, on this machine's clock")] = None,
    photo: Annotated[
        list[Path] | None, typer.Option("--photo", help="A photograph, PNG, JPEG or WebP; may be repeated")
    ] = None,
) -> None:
    """Send an inspection of a clutch's friction surface: roughness, skewness, a note, photographs. You may repeat it."""
    photographs = {path: _media_type(path) for path in photo or []}
    if not note and photographs and ra is None and rsk is None:
        note = "photographs"
    body = {"cycles": cycles, "roughness_um": ra, "skewness": rsk, "lining": lining, "note": note}
    if at is not None:
        body["performed_at"] = at.astimezone().isoformat()
    address = f"/v1/clutches/{clutch}/inspections"
    inspection = service.post(address, body)
    address += f"/{inspection['inspection_id']}"
    for path, media_type in photographs.items():
        service.post_photograph(f"{address}/photographs", path, media_type)
    inspection = service.get(address)
    _show([inspection])
    if inspection["state"] == "withdrawn":
        text = "was stored earlier and then withdrawn: it stays withdrawn until you restore it on the clutch's page"
        print_line(f"{inspection['inspection_id']} {text}")


@asking
def inspections(service: Service, clutch: ClutchId, as_json: Json = False) -> None:
    """List a clutch's inspections by cycles."""
    items = service.pages(f"/v1/clutches/{clutch}/inspections")
    listed(items, as_json, _show, f"{clutch} has no inspections")


def _media_type(path: Path) -> str:
    if path.suffix.lower() not in MEDIA_TYPES:
        fail(f"the name of a photograph must end in {', '.join(MEDIA_TYPES)}, got {path.name!r}", EX_USAGE)
    if not path.is_file():
        fail(f"the photograph {path} does not exist", EX_USAGE)
    return MEDIA_TYPES[path.suffix.lower()]


def _show(items: list[JsonObject]) -> None:
    show_table(_COLUMNS, map(_row, items), left=3)


def _row(item: Mapping[str, Any]) -> list[str]:
    """An inspection as a row of the printed table."""
    return [
        item["inspection_id"],
        item["lining"] or "-",
        item["state"],
        f"{item['cycles']:,.0f}",
        number(item["roughness_um"]),
        number(item["skewness"]),
        str(len(item["photographs"])),
    ]
