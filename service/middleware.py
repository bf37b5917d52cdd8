"""What stands before every address: a bound on the body, and headers that browsers heed."""

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.errors import TooLargeError
from service.problems import problem


class BodyLimit:
    """Refuses a body over `most` bytes (a file over `most_file`) with 413, announced or grown so far."""

    def __init__(self, app: ASGIApp, most: int, most_file: int) -> None:
        self.app = app
        self.most = most
        self.most_file = most_file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        most = self.most_file if scope["path"].endswith("/runs/file") else self.most
        announced = dict(scope["headers"]).get(b"content-length", b"0")
        if announced.isdigit() and int(announced) > most:
            await self._refuse(most, scope, receive, send)
            return
        taken = 0

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > most:
                raise TooLargeError(_detail(most))
            return message

        await self.app(scope, counted, send)

    async def _refuse(self, most: int, scope: Scope, receive: Receive, send: Send) -> None:
        response = problem(TooLargeError.status, TooLargeError.slug, TooLargeError.title, _detail(most))
        response.headers["Connection"] = "close"
        await response(scope, receive, send)


def _detail(most: int) -> str:
    return f"a request may hold at most {most} bytes here"


class SafeHeaders:
    """Nothing is sniffed, framed or told to other hosts; pages may load from this host only."""

    policy = (
        "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; script-src 'self' 'unsafe-inline'; "
        "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    )

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Referrer-Policy"] = "no-referrer"
                headers["Content-Security-Policy"] = self.policy
            await send(message)

        await self.app(scope, receive, with_headers)
