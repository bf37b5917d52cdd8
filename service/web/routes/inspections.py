"""Inspections of a clutch's friction surface: posted, listed, withdrawn; and photographs as their files."""

from functools import partial

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response, StreamingResponse

from service.answers import inspections
from service.api.base import MAX_PHOTOGRAPH_BYTES
from service.api.inspection import InspectionIn, InspectionOut, InspectionPage, MediaType, PhotographOut
from service.api.parameters import ClutchId, InspectionId, PhotographId
from service.api.run import Withdrawal
from service.changes import inspect_clutch
from service.errors import TooLargeError, UnsupportedMediaTypeError
from service.web import responses
from service.web.auth import Ingester, Reader, grant_of
from service.web.bodies import Takes, takes
from service.web.files import PACKED
from service.web.limits import PIECE_BYTES
from service.web.problems import CHANGING, READING, SENDING
from storage.runs import ACCEPTED, WITHDRAWN

router = APIRouter(prefix="/v1/clutches/{clutch_id}/inspections", tags=["inspections"])

#: The types of a photograph's file by what a request calls them.
_MEDIA_TYPES: dict[str, MediaType] = {"image/png": "image/png", "image/jpeg": "image/jpeg", "image/webp": "image/webp"}
_FILES = {name: {"schema": {"type": "string", "format": "binary"}} for name in _MEDIA_TYPES}
#: What a photograph is served with: it is never another, and whatever is in it, a browser runs nothing of it.
_OF_A_FILE = {
    "Cache-Control": "private, no-cache",  # the key is looked at each time; the tag makes it a 304
    "Content-Security-Policy": "default-src 'none'; sandbox",
}
_KEPT = {
    "description": "The photograph of an address never changes; keep your copy, and ask each time whether you may use it",
    "schema": {"type": "string"},
}
_READING_FILE = READING | {
    200: {"content": _FILES, "headers": {"Cache-Control": _KEPT}, "description": "The file as it was sent"}
}
_SENDING_FILE = CHANGING | {200: {"model": PhotographOut, "description": "The inspection had this photograph before"}}

EXAMPLE = {
    "cycles": 11000,
    "performed_at": "2026-11-02T08:00:00+01:00",
    "lining": "disc 2, side A",
    "roughness_um": 1.94,
    "skewness": -3.4,
    "note": "smooth and flat, pores closed",
}


@router.post(
    "",
    status_code=201,
    **responses.taking(
        InspectionIn,
        InspectionOut,
        EXAMPLE,
        SENDING,
        {200: "The inspection was stored before; its `state` may be `withdrawn`"},
    ),
)
async def post_inspection(request: Request, context: Ingester, clutch_id: ClutchId) -> Response:
    """Post an inspection of the friction surface: roughness R_a, skewness R_sk, a note."""
    sent = await responses.sent(request, InspectionIn)
    store = partial(inspect_clutch.inspect, context.database, clutch_id, sent)
    inspection, new = await run_in_threadpool(store, by=grant_of(request).name, at=responses.now())
    address = f"/v1/clutches/{clutch_id}/inspections/{inspection.inspection_id}"
    return responses.json_answer(inspection, 201 if new else 200, Location=address)


@router.get("", response_model=InspectionPage, responses=READING)
async def list_inspections(of: responses.PageOf) -> Response:
    """Inspections by cycles."""
    return await responses.answer(of.request, inspections.page, of.database, of.clutch_id, of.part)


@router.get("/{inspection_id}", response_model=InspectionOut, responses=READING)
async def read_inspection(of: responses.Of, inspection_id: InspectionId) -> Response:
    """One inspection."""
    return await responses.answer(of.request, inspections.look_up, of.database, of.clutch_id, inspection_id)


@router.post(
    "/{inspection_id}/withdraw",
    **responses.taking(Withdrawal, InspectionOut, {"reason": "it was the disc of the bench beside it"}),
)
async def withdraw_inspection(of: responses.ChangeOf, inspection_id: InspectionId) -> Response:
    """Withdraw an inspection. It stays stored and listed, with its photographs."""
    return await _changed(WITHDRAWN, of, inspection_id)


@router.post(
    "/{inspection_id}/restore", **responses.taking(Withdrawal, InspectionOut, {"reason": "it was this disc after all"})
)
async def restore_inspection(of: responses.ChangeOf, inspection_id: InspectionId) -> Response:
    """Undo a withdrawal."""
    return await _changed(ACCEPTED, of, inspection_id)


@router.post(
    "/{inspection_id}/photographs",
    status_code=201,
    response_model=PhotographOut,
    responses=_SENDING_FILE,
    openapi_extra={"requestBody": {"required": True, "content": _FILES}},
)
@takes(Takes.PHOTOGRAPH)
async def post_photograph(
    request: Request, context: Ingester, clutch_id: ClutchId, inspection_id: InspectionId
) -> Response:
    """Add a photograph to an inspection: the file itself as the body, PNG, JPEG or WebP, 16 MiB at most."""
    media_type = _media_type(request)
    add = partial(inspect_clutch.add_photograph, context.database, clutch_id, inspection_id, await _file(request))
    photograph, new = await run_in_threadpool(add, media_type, by=grant_of(request).name, at=responses.now())
    address = f"/v1/clutches/{clutch_id}/inspections/{inspection_id}/photographs/{photograph.photograph_id}"
    return responses.json_answer(photograph, 201 if new else 200, Location=address)


@router.get("/{inspection_id}/photographs/{photograph_id}", response_class=Response, responses=_READING_FILE)
async def read_photograph(
    request: Request, context: Reader, clutch_id: ClutchId, inspection_id: InspectionId, photograph_id: PhotographId
) -> Response:
    """The file of a photograph, as it was sent."""
    photograph = await run_in_threadpool(
        inspections.photograph, context.database, clutch_id, inspection_id, photograph_id
    )
    headers = _OF_A_FILE | {"ETag": f'"{photograph_id}"'}
    if held := responses.unchanged(request, headers):
        return held
    headers |= PACKED | {"Content-Length": str(photograph.row.bytes)}
    return StreamingResponse(photograph.pieces(PIECE_BYTES), media_type=photograph.row.media_type, headers=headers)


def _media_type(request: Request) -> MediaType:
    """The type of the body. Raises UnsupportedMediaTypeError on any but a photograph's."""
    sent = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if sent not in _MEDIA_TYPES:
        raise UnsupportedMediaTypeError(f"send a photograph as {', '.join(_MEDIA_TYPES)}, not as {sent[:80]!r}")
    return _MEDIA_TYPES[sent]


async def _file(request: Request) -> bytes:
    """The body; no more of it is kept than a photograph may have. Raises TooLargeError."""
    content = bytearray()
    async for piece in request.stream():
        content += piece
        if len(content) > MAX_PHOTOGRAPH_BYTES:
            raise TooLargeError(f"a photograph may have at most {MAX_PHOTOGRAPH_BYTES} bytes")
    return bytes(content)


async def _changed(state: str, of: responses.OfClutch, inspection_id: str) -> Response:
    """The inspection in its new state."""
    reason, by = (await responses.sent(of.request, Withdrawal)).reason, grant_of(of.request).name
    change = partial(inspect_clutch.change, reason=reason, by=by, at=responses.now())
    return responses.json_answer(await run_in_threadpool(change, of.database, of.clutch_id, inspection_id, state))
