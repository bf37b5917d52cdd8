"""What the clutches say together: the fleet's priors, and how right the predictions of all were."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.queries import scores
from service.schemas.fleet import FleetPriorPage, FleetScores
from service.schemas.life import Method
from service.web.context import Cursor, Reader, Whole
from service.web.pages import answer, from_cursor, sliced, table
from service.web.problems import READING
from service.workflows import learn_fleet

router = APIRouter(prefix="/v1/fleet", tags=["fleet"])
twins = APIRouter(prefix="/v1/fleet", tags=["spreadsheets"])


@router.get("/priors", response_model=FleetPriorPage, responses=READING)
def priors(request: Request, context: Reader, limit: Whole = 1_000_000, cursor: Cursor = None) -> Response:
    """What the clutches of every kind have taught, for the next of their kind."""
    return answer(request, sliced(learn_fleet.current(context.database), limit, from_cursor(cursor)))


@router.get("/scores", response_model=FleetScores, responses=READING)
def fleet_scores(request: Request, context: Reader, method: Method = "particle") -> Response:
    """How right the predictions of all lives were that came to their end."""
    return answer(request, scores.of_fleet(context.database, context.remembered, method=method))


@twins.get("/scores.csv", response_class=Response, responses=READING)
def fleet_scores_csv(request: Request, context: Reader, method: Method = "particle") -> Response:
    """The same, a row a stage of life, the last one all of them."""
    said = scores.of_fleet(context.database, context.remembered, method=method)
    rows = [*said["stages"], {"share_of_life": None} | said["overall"]]
    return table(request, tuple(rows[0]), rows)


@twins.get("/priors.csv", response_class=Response, responses=READING)
def priors_csv(request: Request, context: Reader) -> Response:
    """The fleet's priors, a row each."""
    kinds = ("friction_material", "reaction_plate", "fluid", "origin")
    own = ("version", "created_at", "clutches")
    rows = [
        {name: item["kind"][name] for name in kinds}
        | {"severity": item["kind"]["severity"]["basis"]}
        | {name: item[name] for name in own}
        | {f"{name}_median": told["median"] for name, told in item["population"].items()}
        | {f"{name}_sd": told.get("sd", told.get("log_sd")) for name, told in item["population"].items()}
        for item in learn_fleet.current(context.database)
    ]
    return table(request, tuple(rows[0]) if rows else (*kinds, "severity", *own), rows)
