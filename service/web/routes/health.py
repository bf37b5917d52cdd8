"""Whether the service lives, whether it can work, and its metrics."""

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response

from service.settings import CODE_VERSION
from service.web.auth import Reader, context_of
from service.web.metrics import MEDIA_TYPE
from service.web.problems import described
from service.web.readiness import PARTS

router = APIRouter(tags=["health"])


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive", "version": CODE_VERSION}


@router.get("/readyz", responses={503: {"description": "The service cannot work: `checks` says why"}})
async def readyz(request: Request) -> Response:
    """The database can be read and written, its disk and the machine have room, and the workers work.

    `oldest_call`: the call of a worker that has run longest.
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
