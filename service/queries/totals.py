"""How many clutches, runs and ended lives there are: six numbers and a few, however many clutches are stored."""

from dataclasses import dataclass

from storage import assumptions, clutches, jobs, runs
from storage.engine.database import Database

#: Remaining cycles up to which clutches are counted, ascending; 0: at the end of life. Chosen: days and weeks of a rig.
WITHIN = (0.0, 1e3, 1e4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Totals:
    """Clutches, archived ones too; how many of those in use have at most so many remaining cycles (the median); runs, and
    how many of them are held; ended lives that the fleets' priors know of; diagnoses that wait or run."""

    clutches: int
    within: dict[float, int]
    runs: int
    held: int
    ended_lives: int
    diagnoses: int


def totals(database: Database) -> Totals:
    """The numbers as they are now."""
    with database.reading() as connection:
        return Totals(
            clutches=clutches.count(connection),
            within=clutches.count_within(connection, WITHIN),
            runs=runs.count(connection),
            held=runs.count_held(connection),
            ended_lives=assumptions.count_ended_lives(connection),
            diagnoses=jobs.count_open(connection, jobs.DIAGNOSIS),
        )
