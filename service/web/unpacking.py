"""A request's body that was packed by gzip, unpacked piece by piece as it comes, so that a small one that unpacks to a large
one meets the bound on bodies before it is in memory."""

import zlib

from starlette.types import Message, Receive

from service.errors import InvalidError

#: Bytes that are unpacked at once. Chosen: a few of a socket's reads.
_PIECE = 1 << 18
#: zlib's word for the format: gzip, with the largest window.
_GZIP = 16 + zlib.MAX_WBITS


class Unpacked:
    """Receives in place of `receive`. Raises InvalidError where it is no gzip, is cut off or goes on after its end."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._unpacker = zlib.decompressobj(_GZIP)
        self._packed = b""
        self._more = True
        self._ended = False

    async def __call__(self) -> Message:
        """The next piece of the body, unpacked; then what follows a body."""
        while not self._ended:
            if not self._packed and self._more:
                message = await self._receive()
                if message["type"] != "http.request":
                    return message
                self._packed, self._more = message.get("body", b""), message.get("more_body", False)
            piece = self._piece()
            if piece or self._ended:
                return {"type": "http.request", "body": piece, "more_body": not self._ended}
        return await self._receive()

    def _piece(self) -> bytes:
        try:
            piece = self._unpacker.decompress(self._packed, _PIECE)
        except zlib.error as error:
            raise InvalidError(f"the body is said to be packed by gzip and is not: {error}") from error
        self._packed = self._unpacker.unconsumed_tail
        if self._unpacker.unused_data:
            raise InvalidError("the body goes on after the end of what was packed by gzip")
        if not piece and not self._packed and not self._more:
            if not self._unpacker.eof:
                raise InvalidError("the body was packed by gzip and is cut off")
            self._ended = True
        return piece
