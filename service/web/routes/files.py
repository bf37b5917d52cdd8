"""Runs as files: the body itself, or a form with a `file` part; kept on disk while they are read, never in memory whole."""

import asyncio
import tempfile
from functools import partial
from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.errors import NoRoomError
from service.queries import rigs
from service.queries.raw_run import copy_file, file_sha256
from service.readers.read_file import reading_of
from service.run_files.upload import read_file_run
from service.schemas import parameters
from service.schemas.base import Origin
from service.schemas.run import Receipt
from service.web.answers import JSON_TYPE, Of, now, unchanged
from service.web.auth import Ingester, name_of_caller
from service.web.files import FILE_BODY, FILE_CONTENT, FILE_TYPE, received, streamed
from service.web.problems import READING, SENDING, described
from service.work.workers import Lane
from service.workflows.ingest_run import ingest_posted
from storage.encoding import to_text

router = APIRouter(prefix="/v1/clutches/{clutch_id}/runs", tags=["runs"])

SENDING_FILE = SENDING | described(NoRoomError)


@router.post(
    "/file",
    status_code=201,
    response_model=Receipt,
    responses=SENDING_FILE
    | {200: {"model": Receipt, "description": "The run was stored before; the answer is its receipt"}},
    openapi_extra=FILE_BODY,
)
async def post_run_file(
    request: Request,
    context: Ingester,
    clutch_id: parameters.ClutchId,
    kind: parameters.FileKind = None,
    cycles: parameters.FileCycles = None,
    rig: parameters.FileRig = None,
    map: parameters.FileMap = None,  # noqa: A002
    table: parameters.FileTable = "",
    time: parameters.FileTime = "",
    decimal: parameters.FileDecimal = "",
    skip_rows: parameters.FileSkipRows = 0,
    missing: parameters.FileMissing = "",
    filename: parameters.FileName = "upload",
    run_id: parameters.FileRunId = None,
    started_at: parameters.FileStartedAt = None,
    origin: Origin = "measured",
) -> Response:
    """Post a run as CSV, XLSX, ODS, TDMS, MDF4, MATLAB, HDF5 or Parquet, plain, gzipped or in a ZIP archive. The file
    is kept as sent. A form may also hold a `profile` to read this file with.
    """
    profile = None if rig is None else await run_in_threadpool(rigs.rig_profile, context.database, rig)
    with tempfile.TemporaryDirectory(dir=context.folder) as folder:
        path = Path(folder) / "run"
        filename, content = await received(request, path, filename)
        read = partial(
            read_file_run,
            path,
            filename=filename,
            kind=kind,
            cycles=cycles,
            reading=reading_of(map, table=table, time=time, decimal=decimal, skip_rows=skip_rows, missing=missing),
            profile=content or profile,
            rig=None if content else rig,
            run_id=run_id,
            started_at=started_at,
            origin=origin,
        )
        by = name_of_caller(request)
        # without a turn: a file that takes long to read would have the clutch's other runs wait
        taken_in = context.workers.submit(Lane.FILES, ingest_posted, clutch_id, read, now(), by, path)
        receipt, new = await asyncio.wrap_future(taken_in)
    headers = {"Location": f"/v1/clutches/{clutch_id}/runs/{receipt['run_id']}"}
    return Response(content=to_text(receipt), status_code=201 if new else 200, media_type=JSON_TYPE, headers=headers)


_READING_FILE = READING | {200: {"content": FILE_CONTENT, "description": "The file as it was sent"}}


@router.get("/{run_id}/file", response_class=Response, responses=_READING_FILE)
async def read_run_file(of: Of, run_id: parameters.RunId) -> Response:
    """The file that a run was read from, as it was sent."""
    sha256 = await run_in_threadpool(file_sha256, of.database, of.clutch_id, run_id)
    headers = {"Cache-Control": "no-cache", "ETag": f'"{sha256}"', "Content-Disposition": "attachment"}
    if held := unchanged(of.request, headers):
        return held
    with tempfile.TemporaryDirectory(dir=of.context.folder) as folder:
        path = Path(folder) / "file"
        await asyncio.wrap_future(of.context.workers.submit(Lane.RECORDS, copy_file, of.clutch_id, run_id, path))
        body = path.open("rb")  # its name goes with the folder, its content when it is closed
    return streamed(body, FILE_TYPE, headers)
