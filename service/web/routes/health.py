"""Whether the service lives, whether it can work, and its metrics."""

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response

from service.settings import CODE_VERSION
from service.web.auth import Reader, context_of
from service.web.metrics import MEDIA_TYPE
from service.web.problems import described

router = APIRouter(tags=["health"])


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive", "version": CODE_VERSION}


@router.get("/readyz", responses={503: {"description": "The database cannot be used"}})
def readyz(request: Request) -> Response:
    """The database answers too."""
    database = context_of(request).database
    ready = database.ready()
    content = {"status": "ready" if ready else "not ready", "journal_mode": database.journal_mode}
    return JSONResponse(content, status_code=200 if ready else 503)


@router.get("/metrics", response_class=Response, responses=described())
def metrics(context: Reader) -> Response:
    """Metrics for Prometheus: requests by route, and every clutch's runs, health and remaining cycles."""
    return Response(content=context.metrics.exposition(context.database), media_type=MEDIA_TYPE)
