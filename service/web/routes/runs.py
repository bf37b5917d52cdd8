"""The routes of runs: post, as JSON or as a file, list, look up and change.

A file is the body itself, or a form with a `file` part; it is kept on disk while it is read, never in memory whole.
"""

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.answers import rigs, runs
from service.answers.raw_run import RawFormat, copy_file, entity_tag, file_sha256, write_run
from service.api import parameters
from service.api.base import Origin
from service.api.run import (
    RUN_IN,
    Confirmation,
    Confirmations,
    Correction,
    Corrections,
    DoubtAnswer,
    Receipt,
    RunOut,
    RunPage,
    Withdrawal,
    Withdrawals,
)
from service.changes import change_run
from service.changes.ingest_run import ingest_posted
from service.changes.save_rig import save_confirmed
from service.errors import NoRoomError, NotAcceptableError, NotFoundError
from service.jobs.workers import Lane
from service.readers.read_file import reading_of
from service.runs.json_run import read_run, read_run_on_disk
from service.runs.suggestion import confirmed_profile
from service.runs.upload import read_file_run
from service.web import files, responses
from service.web.auth import Ingester, Reader, grant_of
from service.web.bodies import Takes, body_or_file, takes
from service.web.context import Context
from service.web.limits import LARGE_BODY_BYTES
from service.web.problems import READING, SENDING, described
from storage import changes

router = APIRouter(prefix="/v1/clutches/{clutch_id}/runs", tags=["runs"])
doubt_router = APIRouter(prefix="/v1/clutches/{clutch_id}/doubts", tags=["runs"])

SENDING_FILE = SENDING | described(NoRoomError)


@router.post(
    "/file",
    status_code=201,
    response_model=Receipt,
    responses=SENDING_FILE
    | {200: {"model": Receipt, "description": "The run was stored before; the answer is its receipt"}},
    openapi_extra=files.FILE_BODY,
)
@takes(Takes.FILE)
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
    good: parameters.FileGood = "",
    filename: parameters.FileName = "upload",
    run_id: parameters.FileRunId = None,
    started_at: parameters.FileStartedAt = None,
    origin: Origin = "measured",
) -> Response:
    """Post a run as CSV, XLSX, ODS, TDMS, MDF4, MATLAB, HDF5 or Parquet, plain, gzipped or in a ZIP archive. The file
    is kept as sent. A form may also hold a `profile` to read this file with. A file that is not read without a question is
    refused with a `suggestion`: to confirm it, send the file again with its arguments or its `profile`. If `rig` is a new
    name then, what was confirmed is saved as that rig's profile.
    """
    form = files.is_form(request)
    known = rig is None or await run_in_threadpool(rigs.is_saved, context.database, rig)
    # raises where the rig is not known and nothing is confirmed
    saved = rig is not None and (known or not (form or map))
    profile = await run_in_threadpool(rigs.rig_profile, context.database, rig) if rig and saved else None
    async with files.temporary_folder(context.folder) as folder:
        path = Path(folder) / "run"
        filename, content = await files.received(request, path, filename)
        reading = reading_of(
            map, table=table, time=time, decimal=decimal, skip_rows=skip_rows, missing=missing, good=good
        )
        read = partial(
            read_file_run,
            path,
            filename=filename,
            kind=kind,
            cycles=cycles,
            reading=reading,
            profile=content or profile,
            rig=None if content and saved else rig,
            run_id=run_id,
            started_at=started_at,
            origin=origin,
        )
        by = grant_of(request).name
        # without a turn: a file that takes long to read would have the clutch's other runs wait
        at = responses.now()
        taken_in = context.workers.submit(Lane.FILES, ingest_posted, clutch_id, read, at, by, path)
        receipt, new = await asyncio.wrap_future(taken_in)
        if rig is not None and not saved:  # a run that is refused leaves no profile
            confirmed = partial(
                confirmed_profile, path, rig, content, filename=filename, kind=kind, cycles=cycles, reading=reading
            )
            await asyncio.wrap_future(context.workers.submit(Lane.FILES, save_confirmed, confirmed, by, at))
    return responses.json_answer(
        receipt, 201 if new else 200, Location=f"/v1/clutches/{clutch_id}/runs/{receipt.run_id}"
    )


_READING_FILE = READING | {200: {"content": files.FILE_CONTENT, "description": "The file as it was sent"}}


@router.get("/{run_id}/file", response_class=Response, responses=_READING_FILE)
async def read_run_file(of: responses.Of, run_id: parameters.RunId) -> Response:
    """The file that a run was read from, as it was sent."""
    sha256 = await run_in_threadpool(file_sha256, of.database, of.clutch_id, run_id)
    headers = {"Cache-Control": "no-cache", "ETag": f'"{sha256}"', "Content-Disposition": "attachment"}
    if held := responses.unchanged(of.request, headers):
        return held
    copy = await _copy(of.request, of.context, headers["ETag"], copy_file, of.clutch_id, run_id)
    return copy.answer(files.FILE_TYPE, headers)


async def _copy(
    request: Request, context: Context, tag: str, write: Callable[..., object], clutch_id: str, run_id: str
) -> files.Copy:
    """A copy of a run, written by `write`. The copies of one caller are made one after the other, so that other callers
    need not wait for its long records."""

    def make(path: Path) -> "Future[object]":
        turn = f"copies for {grant_of(request).name}"
        return context.workers.submit(Lane.RECORDS, partial(write, path=path), clutch_id, run_id, turn=turn)

    return await context.copies.of(tag, make)


_PARQUET = {"schema": {"type": "string", "format": "binary"}}
READING_RUN = described(NotFoundError, NotAcceptableError) | {
    200: {"model": RunOut, "content": {files.PARQUET_TYPE: _PARQUET}, "description": "The run; all samples as Parquet"}
}

EXAMPLE = {
    "run_id": "2026-11-02-stationary-7000",
    "kind": "stationary_stribeck",
    "cycles": 7000,
    "started_at": "2026-11-02T08:00:00+01:00",
    "channels": {
        "pressure_bar": [5, 5, 5, 5, 5],
        "speed_rpm": [20, 120, 520, 1020, 1970],
        "torque_nm": [21.9, 22.8, 22.4, 21.5, 20.8],
        "oil_temperature_c": [84.1, 84.3, 84.9, 85.2, 85.6],
    },
}


@router.post(
    "",
    status_code=201,
    **responses.taking(
        RUN_IN.json_schema(), Receipt, EXAMPLE, SENDING, {200: "The run was stored before; the answer is its receipt"}
    ),
)
@takes(Takes.RUN)
async def post_run(request: Request, context: Ingester, clutch_id: parameters.ClutchId) -> Response:
    """Post a run, in any order of cycles. The receipt has the results. When you get it, the run is stored for good."""
    responses.require_json(request)
    by = grant_of(request).name
    async with body_or_file(request, context.folder) as body:
        is_short = isinstance(body, bytes) and len(body) <= LARGE_BODY_BYTES
        taken_in = context.workers.submit(
            Lane.RUNS if is_short else Lane.RECORDS,
            ingest_posted,
            clutch_id,
            partial(read_run, body) if isinstance(body, bytes) else partial(read_run_on_disk, body),
            responses.now(),
            by,
            turn=clutch_id,
        )
        receipt, new = await asyncio.wrap_future(taken_in)
    address = f"/v1/clutches/{clutch_id}/runs/{receipt.run_id}"
    return responses.json_answer(receipt, 201 if new else 200, Location=address)


@router.get("", response_model=RunPage, responses=READING)
async def list_runs(of: responses.PageOf, state: parameters.State = None, kind: parameters.RunKind = None) -> Response:
    """Receipts by cycles."""
    return await responses.clutch_answer(of, runs.page_as_json, of.part, state, kind)


@router.get("/{run_id}", response_model=RunOut, responses=READING_RUN)
async def read_run_with_channels(
    request: Request,
    context: Reader,
    clutch_id: parameters.ClutchId,
    run_id: parameters.RunId,
    points: parameters.Points = None,
) -> Response:
    """One receipt with the run's channels: as sent, or thinned for a plot, or as Parquet if `Accept` prefers it."""
    media_type = files.preferred(request, (responses.JSON_TYPE, files.PARQUET_TYPE))
    kind: RawFormat = "parquet" if media_type == files.PARQUET_TYPE else "json"
    packed = kind == "json" and points is not None and "gzip" in request.headers.get("accept-encoding", "")
    headers = {"Cache-Control": "no-cache", "Vary": "Accept, Accept-Encoding"}
    headers |= {"Content-Encoding": "gzip"} if packed else {}
    headers["ETag"] = await run_in_threadpool(
        entity_tag, context.database, clutch_id, run_id, points=points, kind=kind, compressed=packed
    )
    if held := responses.unchanged(request, headers):
        return held
    write = partial(write_run, points=points, kind=kind, compressed=packed)
    copy = await _copy(request, context, headers["ETag"], write, clutch_id, run_id)
    headers["ETag"] = copy.returned
    return copy.answer(media_type, headers | (files.PACKED if kind == "parquet" else {}))


@router.patch("/{run_id}", **responses.taking(Correction, Receipt, {"cycles": 7000, "reason": "typed a zero too many"}))
async def correct_run(of: responses.ChangeOf, run_id: parameters.RunId) -> Response:
    """Correct a run's cycles, or read its file again with a rig profile. If it is plausible then, it counts. What was
    sent stays stored.
    """
    correction = await responses.sent(of.request, Correction)
    if correction.rig is not None:
        by, at = grant_of(of.request).name, responses.now()
        reread = partial(change_run.read_again, rig=correction.rig, reason=correction.reason, by=by, at=at)
        return responses.json_answer(await responses.changed(of, reread, run_id, of.context.folder))
    return await _changed(of, changes.CORRECT, run_id, correction, cycles={run_id: correction.cycles})


@router.post(
    "/correct",
    **responses.taking(
        Corrections,
        RunPage,
        {"cycles": {"test-7000": 7000, "test-8000": 8000}, "reason": "the counter restarted at zero"},
    ),
)
async def correct_runs(of: responses.ChangeOf) -> Response:
    """Correct the cycles of several runs in one step. They are judged together: those that are plausible then count. If
    one does not exist, none is corrected. The same with the cycles as sent undoes it.
    """
    corrections = await responses.sent(of.request, Corrections)
    return await _changed(of, changes.CORRECT, list(corrections.cycles), corrections, cycles=corrections.cycles)


@router.post(
    "/withdraw",
    **responses.taking(
        Withdrawals, RunPage, {"run_ids": ["test-7000", "test-8000"], "reason": "they are another clutch's"}
    ),
)
async def withdraw_runs(of: responses.ChangeOf) -> Response:
    """Withdraw several runs in one step: they no longer count, but stay stored and listed."""
    withdrawals = await responses.sent(of.request, Withdrawals)
    return await _changed(of, changes.WITHDRAW, withdrawals.run_ids, withdrawals)


@router.post(
    "/restore",
    **responses.taking(
        Withdrawals, RunPage, {"run_ids": ["test-7000", "test-8000"], "reason": "they are this clutch's"}
    ),
)
async def restore_runs(of: responses.ChangeOf) -> Response:
    """Undo the withdrawal of several runs in one step: each is accepted or held again, as before."""
    withdrawals = await responses.sent(of.request, Withdrawals)
    return await _changed(of, changes.RESTORE, withdrawals.run_ids, withdrawals)


@router.post(
    "/{run_id}/withdraw", **responses.taking(Withdrawal, Receipt, {"reason": "the torque sensor was unplugged"})
)
async def withdraw_run(of: responses.ChangeOf, run_id: parameters.RunId) -> Response:
    """Withdraw a run: it no longer counts, but stays stored and listed."""
    return await _changed(of, changes.WITHDRAW, run_id, await responses.sent(of.request, Withdrawal))


@router.post("/{run_id}/restore", **responses.taking(Withdrawal, Receipt, {"reason": "it was the other sensor"}))
async def restore_run(of: responses.ChangeOf, run_id: parameters.RunId) -> Response:
    """Undo a withdrawal: the run is accepted or held again, as before."""
    return await _changed(of, changes.RESTORE, run_id, await responses.sent(of.request, Withdrawal))


@router.post(
    "/confirm",
    **responses.taking(
        Confirmations, RunPage, {"run_ids": ["test-7000", "test-8000"], "reason": "the clutch was run over the weekend"}
    ),
)
async def confirm_runs(of: responses.ChangeOf) -> Response:
    """Accept several held runs as they were sent, in one step. If one does not exist, none is accepted. Runs that are
    not held stay unchanged.
    """
    confirmations = await responses.sent(of.request, Confirmations)
    return await _changed(of, changes.CONFIRM, confirmations.run_ids, confirmations)


@router.post(
    "/{run_id}/confirm", **responses.taking(Confirmation, Receipt, {"reason": "the clutch was run over the weekend"})
)
async def confirm_run(of: responses.ChangeOf, run_id: parameters.RunId) -> Response:
    """Accept a held run as it was sent."""
    return await _changed(of, changes.CONFIRM, run_id, await responses.sent(of.request, Confirmation))


@doubt_router.post(
    "/{doubt_id}/answer",
    **responses.taking(DoubtAnswer, RunPage, {"accept": True, "reason": "the counter restarted at zero"}),
)
async def answer_doubt(of: responses.ChangeOf, doubt_id: parameters.DoubtId) -> Response:
    """Answer a doubt about several held runs (`id` and `hypothesis` in their `doubts`) in one step. If you accept it, all
    its runs get their likely cycles, or are withdrawn if they are another clutch's. If you do not, they are accepted as
    they were sent. `/runs/correct` and `/runs/restore` undo it.
    """
    answer = await responses.sent(of.request, DoubtAnswer)
    by, at = grant_of(of.request).name, responses.now()
    settle = partial(change_run.answer_doubt, accept=answer.accept, reason=answer.reason, by=by, at=at)
    return responses.json_answer(RunPage(items=await responses.changed(of, settle, doubt_id), next=None))


async def _changed(
    of: responses.OfClutch,
    action: str,
    run_id: str | Sequence[str],
    sent: Correction | Corrections | Withdrawal | Withdrawals | Confirmation | Confirmations,
    **more: Any,
) -> Response:
    """The receipt after a change; a list of receipts if a list of runs was changed."""
    by, reason, at = grant_of(of.request).name, sent.reason, responses.now()
    edit = partial(change_run.change, action=action, reason=reason, by=by, at=at, **more)
    if isinstance(run_id, str):
        return responses.json_answer((await responses.changed(of, edit, [run_id]))[0])
    return responses.json_answer(RunPage(items=await responses.changed(of, edit, run_id), next=None))
