"""Receives and sends files, which are kept on disk meanwhile; `Accept` chooses the form of an answer."""

import os
import re
import shutil
import tempfile
from collections.abc import AsyncIterable, AsyncIterator, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import IO, BinaryIO

from fastapi import Request
from fastapi.responses import Response, StreamingResponse
from starlette.datastructures import UploadFile

from service.api.rig import RigProfile
from service.errors import InvalidError
from service.runs.json_run import checked
from service.runs.rig_profile import require_usable
from service.web.limits import MAX_BYTES_IN_MEMORY

FILE_TYPE = "application/octet-stream"
#: A file of any format, as the API's description has it, and as the body of a request.
FILE_CONTENT = {FILE_TYPE: {"schema": {"type": "string", "format": "binary"}}}
FILE_BODY = {"requestBody": {"required": True, "content": FILE_CONTENT}}
PARQUET_TYPE = "application/vnd.apache.parquet"
#: Bytes of a file that are sent at once. Chosen: a few writes to the socket.
_PIECE = 1 << 18
#: Bytes of a form's file that are written at once.
_CHUNK = 1 << 20


def emptied_folder(database: Path | None) -> Path:
    """An empty folder `FILE-files` beside the database, where there is room for what is to be stored, for files that come in
    and go out; where the database is on a server (None) a new one of the system's, which the caller removes."""
    if database is None:
        return Path(tempfile.mkdtemp(prefix="clutchlife-"))
    folder = database.with_name(f"{database.name}-files")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


@asynccontextmanager
async def body_or_file(request: Request, folder: Path) -> AsyncIterator[bytes | Path]:
    """A request's body: in memory where it is short, else as a file in the folder, which is removed in the end."""
    pieces, received = request.stream(), bytearray()
    async for piece in pieces:
        received += piece
        if len(received) > MAX_BYTES_IN_MEMORY:
            break
    else:
        yield bytes(received)
        return
    with tempfile.NamedTemporaryFile(dir=folder) as file:
        file.write(received)
        received.clear()
        await written(pieces, file)
        yield Path(file.name)


async def written(pieces: AsyncIterable[bytes], file: IO[bytes]) -> None:
    """Write what arrives to a file as it does."""
    async for piece in pieces:
        file.write(piece)
    file.flush()


async def received(request: Request, path: Path, filename: str) -> tuple[str, RigProfile | None]:
    """Write a body, or the file in a form, to disk as it arrives; returns its sender's name for it, and a form's `profile`.

    Raises InvalidError where the form has no file or its profile cannot be used.
    """
    if not request.headers.get("content-type", "").startswith("multipart/form-data"):
        with path.open("wb") as file:
            await written(request.stream(), file)
        return filename, None
    async with request.form(max_files=1, max_fields=8) as form:
        sent = next((part for part in form.values() if isinstance(part, UploadFile)), None)
        if sent is None:
            raise InvalidError("the form must have exactly one file")
        with path.open("wb") as file:
            while chunk := await sent.read(_CHUNK):
                file.write(chunk)
        text = form.get("profile")
        profile = checked(RigProfile, text.encode()) if isinstance(text, str) else None
    if profile is not None:
        require_usable(profile)
    return sent.filename or filename, profile


def preferred(request: Request, media_types: Sequence[str]) -> str:
    """The one of our media types that `Accept` weighs most, the first of them where none is named."""
    weights = {}
    for part in request.headers.get("accept", "").lower().split(","):
        name, *parameters = (word.strip() for word in part.split(";"))
        weight = next((word[2:] for word in parameters if word.startswith("q=")), "1")
        weights[name] = float(weight) if re.fullmatch(r"[01](\.\d{0,3})?", weight) else 0.0
    return max(media_types, key=lambda name: weights.get(name, 0.0))


def streamed(body: BinaryIO, media_type: str, headers: Mapping[str, str]) -> Response:
    """An open file as an answer, sent piece by piece and closed at its end."""
    size = {"Content-Length": str(os.fstat(body.fileno()).st_size)}

    def pieces() -> Iterator[bytes]:
        with body:
            while piece := body.read(_PIECE):
                yield piece

    return StreamingResponse(pieces(), media_type=media_type, headers=dict(headers) | size)
