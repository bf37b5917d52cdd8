"""The dashboard's pages and what they load. They hold no data: that comes from the API, with the reader's key."""

from fastapi import APIRouter, Request
from fastapi.responses import Response
from starlette.exceptions import HTTPException

from service.dashboard.assets import Asset, Assets

_FOR_GOOD = "public, max-age=31536000, immutable"
_ASK_FIRST = "no-cache"


def router(assets: Assets) -> APIRouter:
    """`/`, `/clutches/{clutch_id}` and `/assets/...`."""
    pages = {name: assets.page(name) for name in ("fleet.html", "clutch.html")}
    found = APIRouter(include_in_schema=False)

    @found.get("/")
    def fleet(request: Request) -> Response:
        """Every clutch, worst first."""
        return _answer(request, pages["fleet.html"], _ASK_FIRST)

    @found.get("/clutches/{clutch_id}")
    def clutch(request: Request, clutch_id: str) -> Response:  # noqa: ARG001  (the page reads its own address)
        """One clutch."""
        return _answer(request, pages["clutch.html"], _ASK_FIRST)

    @found.get("/assets/{digest}/{name}")
    def asset(request: Request, digest: str, name: str) -> Response:
        """A file that a page loads; a page of another version is told to ask for its own anew."""
        known = assets.by_name.get(name)
        if known is None or name in pages:
            raise HTTPException(404, f"no such file: {name[:80]}")
        return _answer(request, known, _FOR_GOOD if digest == assets.digest else "no-store")

    return found


def _answer(request: Request, asset: Asset, caching: str) -> Response:
    zipped = "gzip" in request.headers.get("accept-encoding", "")
    tag = f'"{asset.digest}{"-gz" if zipped else ""}"'
    headers = {"ETag": tag, "Cache-Control": caching, "Vary": "Accept-Encoding"}
    if tag in (each.strip() for each in request.headers.get("if-none-match", "").split(",")):
        return Response(status_code=304, headers=headers)
    if zipped:
        headers["Content-Encoding"] = "gzip"
    return Response(content=asset.compressed if zipped else asset.body, media_type=asset.media_type, headers=headers)
