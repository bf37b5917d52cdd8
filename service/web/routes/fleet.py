"""What the clutches show together: the fleet's priors, and how right the predictions of all were."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.queries import fleet_priors, scores
from service.schemas.fleet import FleetPriorPage, FleetScores
from service.schemas.life import Method
from service.web.answers import WholePaged, answer, computed_of_each
from service.web.auth import Reader
from service.web.problems import READING

router = APIRouter(prefix="/v1/fleet", tags=["fleet"])


@router.get("/priors", response_model=FleetPriorPage, responses=READING)
async def priors(request: Request, context: Reader, part: WholePaged) -> Response:
    """The priors learned from the clutches of each kind."""
    return await answer(request, lambda: part.sliced(fleet_priors.newest(context.database)))


@router.get("/scores", response_model=FleetScores, responses=READING)
async def fleet_scores(request: Request, context: Reader, method: Method = "particle") -> Response:
    """Scores of the predictions of all ended lives."""
    scored = await computed_of_each(request, context, scores.scores_of_clutch, method)
    return await answer(request, lambda: scores.scores_of_fleet(scored, method=method))
