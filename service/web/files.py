"""Receives and sends files, which are kept on disk meanwhile; `Accept` chooses the form of an answer.

The disk is asked in threads alone: one that does not answer must not hold up the event loop.
"""

import asyncio
import os
import re
import shutil
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

from fastapi import Request
from fastapi.concurrency import contextmanager_in_threadpool, run_in_threadpool
from fastapi.responses import Response, StreamingResponse
from starlette.datastructures import FormData, UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.types import Receive, Scope, Send

from service.api.rig import RigProfile
from service.errors import BusyError, InvalidError, TooLargeError
from service.runs.rig_profile import require_usable
from service.web.bodies import Room, parsed, written
from service.web.limits import COPIES_SHARE, MAX_FORM_TEXT_BYTES, PIECE_BYTES

FILE_TYPE = "application/octet-stream"
#: A file of any format, as the API's description has it, and as the body of a request.
FILE_CONTENT = {FILE_TYPE: {"schema": {"type": "string", "format": "binary"}}}
FILE_BODY = {"requestBody": {"required": True, "content": FILE_CONTENT}}
PARQUET_TYPE = "application/vnd.apache.parquet"
#: Of an answer that is packed by itself: it goes out as it is. `middleware.Encodings` takes the header off.
PACKED = {"Content-Encoding": "identity"}


def emptied_folder(database: Path | None) -> Path:
    """An emptied folder for uploads and downloads: `FILE-files` beside the database file, on the disk that has room for
    them. If the database is on a server (None): a new temporary folder of the system, which the caller removes."""
    if database is None:
        return Path(tempfile.mkdtemp(prefix="clutchlife-"))
    folder = database.with_name(f"{database.name}-files")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def temporary_folder(folder: Path) -> AbstractAsyncContextManager[str]:
    """A subfolder that exists inside the context."""
    return contextmanager_in_threadpool(tempfile.TemporaryDirectory(dir=folder))


def is_form(request: Request) -> bool:
    """Whether a body is a form, which may hold a profile beside the file."""
    return request.headers.get("content-type", "").startswith("multipart/form-data")


async def received(request: Request, path: Path, filename: str) -> tuple[str, RigProfile | None]:
    """Write a body, or the file in a form, to disk as it arrives; returns its sender's name for it, and a form's `profile`.

    Raises InvalidError where the form has no file or its profile cannot be used.
    """
    if not is_form(request):
        async with opened(path, "wb") as file:
            await written(request.stream(), file)
        return filename, None
    async with opened(path, "wb") as file:
        form = await _UploadForm(request, file).parse()
    sent = next((part for part in form.values() if isinstance(part, UploadFile)), None)
    if sent is None:
        raise InvalidError("the form must have exactly one file, a field with a file name")
    text = form.get("profile")
    profile = await parsed(RigProfile, text.encode()) if isinstance(text, str) else None
    if profile is not None:
        require_usable(profile)
    return sent.filename or filename, profile


class _UploadForm(MultiPartParser):
    """A form of one file and of a few texts: the file is written as it arrives, the texts are in memory."""

    def __init__(self, request: Request, file: IO[bytes]) -> None:
        super().__init__(request.headers, request.stream(), max_files=1, max_fields=8)
        self._file = file
        self._text_bytes = 0

    def on_headers_finished(self) -> None:
        """Have a file's bytes go to the disk, where the parser would hold the first MiB and then use the system's folder."""
        super().on_headers_finished()
        if (sent := self._current_part.file) is not None:
            sent.file.close()
            sent.file = cast("BinaryIO", self._file)

    def on_part_data(self, data: bytes, start: int, end: int) -> None:
        """Take what has arrived of a part. Raises TooLargeError where the texts become too long."""
        if self._current_part.file is None:
            self._text_bytes += end - start
            if self._text_bytes > MAX_FORM_TEXT_BYTES:
                raise TooLargeError(
                    f"the texts of a form may have at most {MAX_FORM_TEXT_BYTES} bytes together; its file needs a file name"
                )
        super().on_part_data(data, start, end)

    async def parse(self) -> FormData:
        """What arrives until the form's end. Raises InvalidError where it is no form, or has a second file."""
        try:
            return await super().parse()
        except MultiPartException as error:
            raise InvalidError(f"the form cannot be read: {error.message}") from None


@asynccontextmanager
async def opened(path: Path, mode: str) -> AsyncIterator[IO[bytes]]:
    """Context with an opened file."""
    async with contextmanager_in_threadpool(await run_in_threadpool(path.open, mode)) as file:
        yield file


def preferred(request: Request, media_types: Sequence[str]) -> str:
    """The media type of ours that the `Accept` header ranks highest; the first of ours if it names none of them."""
    weights = {}
    for part in request.headers.get("accept", "").lower().split(","):
        name, *parameters = (word.strip() for word in part.split(";"))
        weight = next((word[2:] for word in parameters if word.startswith("q=")), "1")
        weights[name] = float(weight) if re.fullmatch(r"[01](\.\d{0,3})?", weight) else 0.0
    return max(media_types, key=lambda name: weights.get(name, 0.0))


@dataclass(slots=True)
class _SharedCopy:
    """A copy being made or sent, and the number of responses that use it."""

    making: "asyncio.Task[Copy]"
    users: int = 0


class Copies:
    """Temporary copies of runs and their files in a folder, to be sent as responses: at most `most` bytes together, and
    only a share of the free disk space. Requests for the same content share one copy."""

    def __init__(self, folder: Path, most: int) -> None:
        self._folder = folder
        self._most = most
        self._room = Room(most)
        self._made: dict[str, _SharedCopy] = {}
        self._ending: set[asyncio.Task[None]] = set()

    async def of(self, tag: str, make: Callable[[Path], "Future[Any]"]) -> "Copy":
        """The copy with this tag, written by `make` if there is none yet. Raises BusyError if the copies being sent
        leave no room."""
        made = self._made.get(tag)
        if made is None:
            made = self._made[tag] = _SharedCopy(asyncio.create_task(self._written(tag, make)))
        made.users += 1
        try:
            return await asyncio.shield(made.making)
        except BaseException:
            self.leave(tag)
            raise

    def leave(self, tag: str) -> None:
        """Note that one response no longer needs the copy; the last one closes it, in a thread."""
        made = self._made[tag]
        made.users -= 1
        if not made.users:
            del self._made[tag]
            ending = asyncio.create_task(self._end(made.making))
            self._ending.add(ending)
            ending.add_done_callback(self._ending.discard)

    async def _written(self, tag: str, make: Callable[[Path], "Future[Any]"]) -> "Copy":
        """A new copy, written by `make`. Raises BusyError if copies have no room left."""
        if self._room.left <= 0:
            raise BusyError(_NO_ROOM)
        async with temporary_folder(self._folder) as folder:
            path = Path(folder) / "copy"
            returned = await asyncio.wrap_future(make(path))
            file, size, free = await run_in_threadpool(_measured, path)
        held = self._most - self._room.left + size
        if held > COPIES_SHARE * (free + held) or not self._room.take(size):
            await run_in_threadpool(file.close)
            raise BusyError(_NO_ROOM)
        return Copy(self, tag, file, size, returned)

    async def _end(self, making: "asyncio.Task[Copy]") -> None:
        with suppress(Exception):  # who has asked for it was told
            copy = await making
            await run_in_threadpool(copy.file.close)
            self._room.take(-copy.size)


_NO_ROOM = "the copies of runs that are being sent use all available room on the disk: try again later"


def _measured(path: Path) -> tuple[BinaryIO, int, int]:
    """An opened file, its size and the free space on its disk [bytes]."""
    file = path.open("rb")
    return file, os.fstat(file.fileno()).st_size, shutil.disk_usage(path.parent).free


@dataclass(frozen=True, slots=True)
class Copy:
    """An open, already unlinked file, and the return value of the function that wrote it."""

    copies: Copies
    tag: str
    file: BinaryIO
    size: int
    returned: Any

    def answer(self, media_type: str, headers: Mapping[str, str]) -> Response:
        """A response that sends the file piece by piece, and releases the copy at the end or when the client
        disconnects."""
        headers = dict(headers) | {"Content-Length": str(self.size)}
        return _Sent(self, media_type=media_type, headers=headers)

    def pieces(self) -> Iterator[bytes]:
        for start in range(0, self.size, PIECE_BYTES):
            yield os.pread(self.file.fileno(), PIECE_BYTES, start)


class _Sent(StreamingResponse):
    """The response that sends a copy."""

    def __init__(self, copy: Copy, **more: Any) -> None:
        super().__init__(copy.pieces(), **more)
        self._copy = copy

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._copy.copies.leave(self._copy.tag)
