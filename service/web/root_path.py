"""The path that a proxy adds: requests go in without it, addresses come out with it.

A proxy may take the path off (`proxy_pass http://host:8000/;` of nginx, `handle_path` of Caddy) or leave it: both are read.
Pages and their modules find each other by relative addresses; what is left are `Location` and `Link`, which are written as
if there were no proxy and get the path here.
"""

from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class RootPath:
    """Middleware outside of all others. `root` is the path as `/clutch`, or empty."""

    def __init__(self, app: ASGIApp, root: str) -> None:
        self.app = app
        self.root = root

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        host = Headers(scope=scope).get("host", "")
        path = scope["path"]

        async def addressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                if "location" in headers:
                    headers["location"] = self._below(_without_origin(headers["location"], host))
                if headers.get("link", "").startswith("<"):
                    headers["link"] = "<" + self._below(headers["link"].removeprefix("<"))
            await send(message)

        if self.root and path == self.root:  # relative addresses of a page need the slash
            await RedirectResponse("/", 308)(scope, receive, addressed)
            return
        if self.root and path.startswith(self.root + "/"):
            scope = {**scope, "path": path.removeprefix(self.root)}
        await self.app(scope, receive, addressed)

    def _below(self, address: str) -> str:
        return self.root + address if address.startswith("/") else address


def _without_origin(address: str, host: str) -> str:
    """An address of this service without scheme and host, which a proxy may have changed; others as they are."""
    parts = urlsplit(address)
    return parts._replace(scheme="", netloc="").geturl() if parts.netloc == host else address
