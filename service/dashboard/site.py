"""`/help`: the site of `docs/`, as `make docs` built it; where it was not built, a page that says how.

The wheel and the container's image have it built in. Its pages hold no data and no script, and load nothing from elsewhere.
"""

import posixpath
from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.dashboard.assets import TYPES, Asset, read
from service.dashboard.pages import REVALIDATE, answer

SITE = Path(__file__).parent / "help"
NOT_BUILT = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
    <meta name="viewport" content="width=device-width, initial-scale=1" />
    <title>Clutchlife: help</title>
  </head>
  <body>
    <main>
      <h1>The help is not built here</h1>
      <p>Run <code>make docs</code> in the checkout, and start the service again. Packages and images of a release have the
      help built in.</p>
      <p><a href="..">Back to the clutches</a></p>
    </main>
  </body>
</html>
"""


def router(folder: Path = SITE) -> APIRouter:
    """`/help/...` from a built site; names are looked up among the files that were there at the start."""
    paths = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.suffix in TYPES}
    kept: dict[str, Asset] = {}
    routes = APIRouter(include_in_schema=False)

    @routes.get("/help")
    def top() -> Response:
        """Relative addresses of a page need the slash."""
        return RedirectResponse("/help/", 308)

    @routes.get("/help/{name:path}")
    def page(request: Request, name: str) -> Response:
        """A page, a picture or what a page loads."""
        if not paths:
            return HTMLResponse(NOT_BUILT, status_code=404)
        if name.endswith("/") or not name:
            name = posixpath.join(name, "index.html")
        if name not in paths:
            raise HTTPException(404, f"no such page: {name[:80]}")
        if name not in kept:
            kept[name] = read(paths[name], name)
        return answer(kept[name], REVALIDATE, request)

    return routes
