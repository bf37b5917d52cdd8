"""Whether the service lives and can work, its metrics; and `/docs`, the API's description for people.

The page of `/docs` works without the internet and runs no inline script: the dashboard keeps the reader's key in the storage
of this origin. Swagger UI is that of the package fastapi-offline.
"""

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response

from service.settings import CODE_VERSION
from service.web.auth import Reader, context_of
from service.web.metrics import MEDIA_TYPE
from service.web.middleware import POLICY
from service.web.problems import described
from service.web.readiness import PARTS

router = APIRouter(tags=["health"])


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive", "version": CODE_VERSION}


@router.get("/readyz", responses={503: {"description": "The service cannot work: `checks` says why"}})
async def readyz(request: Request) -> Response:
    """Whether the service can work: database, disk, memory and workers. `oldest_call`: the worker call that has run
    longest.
    """
    context = context_of(request)
    faults, oldest = await context.readiness.faults(), context.workers.oldest()
    content = {
        "status": "not ready" if faults else "ready",
        "journal_mode": context.database.journal_mode,
        "checks": dict.fromkeys(PARTS, "ok") | faults,
        "oldest_call": None if oldest is None else {"lane": oldest[0].name.lower(), "seconds": round(oldest[1], 3)},
    }
    headers = {"Cache-Control": "no-store"} | ({"Retry-After": "1"} if faults else {})
    return JSONResponse(content, status_code=503 if faults else 200, headers=headers)


@router.get("/metrics", response_class=Response, responses=described())
def metrics(context: Reader) -> Response:
    """Metrics for Prometheus: requests by route, what waits, and how many clutches stand where."""
    content = context.metrics.exposition(context.database)
    return Response(content=content, media_type=MEDIA_TYPE)


description_router = APIRouter(include_in_schema=False)

#: Addresses are relative, so that the page works below a proxy's path too.
_PAGE = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
    <meta name="viewport" content="width=device-width, initial-scale=1" />
    <title>Clutchlife: the API</title>
    <link rel="icon" href="static-offline-docs/favicon.png" />
    <link rel="stylesheet" href="static-offline-docs/swagger-ui.css" />
  </head>
  <body>
    <div id="swagger-ui"></div>
    <script src="static-offline-docs/swagger-ui-bundle.js"></script>
    <script src="docs/start.js"></script>
  </body>
</html>
"""
_START = """SwaggerUIBundle({
  url: "openapi.json",
  dom_id: "#swagger-ui",
  layout: "BaseLayout",
  presets: [SwaggerUIBundle.presets.apis],
  deepLinking: true,
  validatorUrl: null,
});
"""


@description_router.get("/docs")
async def description() -> Response:
    """The page; the icons of Swagger UI are written into its own styles."""
    headers = {"Cache-Control": "no-cache", "Content-Security-Policy": f"{POLICY}; img-src 'self' data:"}
    return Response(content=_PAGE, media_type="text/html; charset=utf-8", headers=headers)


@description_router.get("/docs/start.js")
async def start() -> Response:
    """The script that starts it."""
    return Response(content=_START, media_type="text/javascript; charset=utf-8", headers={"Cache-Control": "no-cache"})
