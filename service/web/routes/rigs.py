"""Rig profiles, and the preview of a file before it is sent."""

import asyncio
from functools import partial
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.answers import rigs
from service.api import parameters
from service.api.rig import Preview, RigIn, RigOut, RigPage
from service.changes.save_rig import save
from service.errors import InvalidError
from service.jobs.workers import Lane
from service.readers.read_file import reading_of
from service.runs.rig_profile import require_usable
from service.web.auth import Admin, Ingester, OwnIngester, OwnReader, grant_of, require_clutch
from service.web.bodies import Takes, takes
from service.web.context import Context
from service.web.files import FILE_BODY, received, temporary_folder
from service.web.problems import CHANGING, READING, SENDING
from service.web.responses import Paged, answer, json_answer, now, sent, taking

router = APIRouter(prefix="/v1/rigs", tags=["rigs"])
import_router = APIRouter(prefix="/v1/import", tags=["rigs"])

EXAMPLE = {
    "name": "bench-3",
    "columns": [
        {"title": "Zeit", "channel": "time_s", "unit": "s"},
        {"title": "Druck", "channel": "pressure_bar", "unit": "bar"},
        {"title": "Drehzahl", "channel": "speed_rpm", "unit": "rpm"},
        {"title": "Mz", "channel": "torque_nm", "unit": "Nm", "scale": -1},
        {"title": "Bemerkung"},
    ],
    "decimal": ",",
    "kind": "stationary_stribeck",
    "file_name": "bench3_{cycles}_*.csv",
}


@router.get("", response_model=RigPage, responses=READING)
async def list_rigs(request: Request, context: OwnReader, part: Paged) -> Response:
    """Rig profiles by name."""
    return await answer(request, rigs.page, context.database, part)


@router.get("/{name}", response_model=RigOut, responses=READING)
async def read_rig(request: Request, context: OwnReader, name: parameters.RigName) -> Response:
    """A saved rig profile."""
    return await answer(request, rigs.rig_profile, context.database, name)


@router.post("", status_code=201, **taking(RigIn, RigOut, EXAMPLE, SENDING, {200: "The profile existed before"}))
async def post_rig(request: Request, context: Ingester) -> Response:
    """Save a new rig profile: how the files of a rig are read."""
    return await _saved(request, context, None)


@router.put("/{name}", **taking(RigIn, RigOut, EXAMPLE, CHANGING, {201: "The profile is new"}))
async def put_rig(request: Request, context: Admin, name: parameters.RigName) -> Response:
    """Replace a rig profile. Runs that were read with the former profile stay unchanged until they are read again."""
    return await _saved(request, context, name)


async def _saved(request: Request, context: Context, name: str | None) -> Response:
    """Save the body's profile, or replace the one named in the path with it."""
    rig = await sent(request, RigIn)
    require_usable(rig)
    if name not in (None, rig.name):
        message = f"name must be that of the address, {name!r}, got {rig.name!r}"
        raise InvalidError.of(message, code="other_name", pointer="/name")
    by, replacing = grant_of(request).name, name is not None
    saved, new = await run_in_threadpool(save, context.database, rig, by=by, at=now(), replacing=replacing)
    return json_answer(saved, 201 if new else 200, Location=f"/v1/rigs/{saved.name}")


@import_router.post("/preview", response_model=Preview, responses=CHANGING, openapi_extra=FILE_BODY)
@takes(Takes.FILE)
async def preview_file(
    request: Request,
    context: OwnIngester,
    filename: parameters.FileName = "upload",
    rig: parameters.FileRig = None,
    kind: parameters.FileKind = None,
    cycles: parameters.FileCycles = None,
    clutch_id: parameters.OfClutch = None,
    map: parameters.FileMap = None,  # noqa: A002
    decimal: parameters.FileDecimal = "",
    missing: parameters.FileMissing = "",
    good: parameters.FileGood = "",
    time: parameters.FileTime = "",
    together: Annotated[parameters.FilesTogether, Query()] = [],  # noqa: B006 (FastAPI copies it)
) -> Response:
    """A preview of a file: its first rows, the channel and unit of each column, what would be cut and fitted. Nothing
    is stored. Without `rig` or a `profile` in the form, the saved profile that has the file's columns is used, else
    the titles of the columns, else a suggestion.
    """
    if clutch_id is not None:
        require_clutch(grant_of(request), clutch_id)
    async with temporary_folder(context.folder) as folder:
        path = Path(folder) / "run"
        filename, profile = await received(request, path, filename)
        computing = partial(
            rigs.preview,
            filename=filename,
            rig=rig,
            profile=profile,
            kind=kind,
            cycles=cycles,
            clutch_id=clutch_id,
            reading=reading_of(map, decimal=decimal, missing=missing, good=good, time=time),
            beside=together,
        )
        shown = await asyncio.wrap_future(context.workers.submit(Lane.FILES, computing, path))
    return json_answer(shown)
