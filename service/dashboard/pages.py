"""The dashboard's pages and what they load. They hold no data: that comes from the API, with the reader's key."""

from functools import partial

from fastapi import APIRouter, Request
from fastapi.responses import Response
from starlette.exceptions import HTTPException

from service.dashboard.assets import Asset, Assets

_IMMUTABLE = "public, max-age=31536000, immutable"
REVALIDATE = "no-cache"


def router(assets: Assets) -> APIRouter:
    """`/`, `/compare`, `/clutches/{clutch_id}` and `/assets/...`."""
    pages = {
        "/": ("fleet.html", "./"),
        "/compare": ("compare.html", "./"),
        "/clutches/{clutch_id}": ("clutch.html", "../"),
    }
    routes = APIRouter(include_in_schema=False)
    for path, (name, root) in pages.items():  # a page reads its own address
        routes.add_api_route(path, partial(answer, assets.page(name, root), REVALIDATE))

    @routes.get("/assets/{digest}/{name:path}")
    def asset(request: Request, digest: str, name: str) -> Response:
        """A file that a page loads, by its path in the tree; one of another version must not be kept."""
        served = assets.by_name.get(name)
        if served is None or name.endswith(".html"):
            raise HTTPException(404, f"no such file: {name[:80]}")
        return answer(served, _IMMUTABLE if digest == assets.digest else "no-store", request)

    return routes


def answer(asset: Asset, caching: str, request: Request) -> Response:
    """The response with a file, gzipped if the browser accepts that; 304 if the browser has it already."""
    zipped = "gzip" in request.headers.get("accept-encoding", "")
    tag = f'"{asset.digest}{"-gz" if zipped else ""}"'
    headers = {"ETag": tag, "Cache-Control": caching, "Vary": "Accept-Encoding"}
    if tag in (held.strip() for held in request.headers.get("if-none-match", "").split(",")):
        return Response(status_code=304, headers=headers)
    if zipped:
        headers["Content-Encoding"] = "gzip"
    return Response(content=asset.compressed if zipped else asset.body, media_type=asset.media_type, headers=headers)
