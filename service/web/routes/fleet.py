"""What the clutches show together: the fleet's priors, and how right the predictions of all were."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.lists import ALL_ITEMS, from_cursor, sliced
from service.queries import fleet_priors, scores
from service.schemas.fleet import FleetPriorPage, FleetScores
from service.schemas.life import Method
from service.web.answers import answer, computed_of_each
from service.web.auth import Reader
from service.web.context import Cursor, Whole
from service.web.problems import READING

router = APIRouter(prefix="/v1/fleet", tags=["fleet"])


@router.get("/priors", response_model=FleetPriorPage, responses=READING)
async def priors(request: Request, context: Reader, limit: Whole = ALL_ITEMS, cursor: Cursor = None) -> Response:
    """What the clutches of every kind have taught, for the next of their kind."""
    after = from_cursor(cursor)
    return await answer(request, lambda: sliced(fleet_priors.newest(context.database), limit, after))


@router.get("/scores", response_model=FleetScores, responses=READING)
async def fleet_scores(request: Request, context: Reader, method: Method = "particle") -> Response:
    """How right the predictions of all lives were that came to their end."""
    scored = await computed_of_each(request, context, scores.of_clutch, method)
    return await answer(request, lambda: scores.of_fleet(scored, method=method))
