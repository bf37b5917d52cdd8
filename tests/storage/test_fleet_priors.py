"""What fleets have taught, by kind, version and the clutch left out."""

from dataclasses import replace

import pytest
from sqlalchemy.exc import IntegrityError

from storage import assumptions
from storage.assumptions import NOBODY, FleetPriorRow
from storage.engine.database import Database

PAPER = FleetPriorRow(
    fleet={"friction_material": "paper", "fluid": "Öl", "severity": {"basis": "cycles", "exponent": 1.0}},
    version=1,
    left_out=NOBODY,
    created_at="2026-01-01T00:00:00+00:00",
    members=("a", "b", "c"),
    content={"mean": [0.1 + 0.2, -1.0], "clutches": 3},
    code_version="0.1.0",
)
SINTER = replace(PAPER, fleet=PAPER.fleet | {"friction_material": "sinter"}, version=7)


def test_the_newest_version_of_a_kind_is_current(database: Database) -> None:
    newer = replace(PAPER, version=2, content={"mean": []})
    with database.writing() as connection:
        for row in (PAPER, newer, SINTER, replace(SINTER, version=9, left_out="a")):
            assumptions.insert_fleet_prior(connection, row)
    with database.reading() as connection:
        backwards = dict(reversed(PAPER.fleet.items()))
        assert assumptions.current_fleet_prior(connection, backwards) == newer
        assert assumptions.current_fleet_prior(connection, {"friction_material": "cork"}) is None
        assert assumptions.current_fleet_priors(connection) == [newer, SINTER]


def test_what_was_said_without_a_clutch_is_found_and_forgotten(database: Database) -> None:
    without_a = replace(PAPER, left_out="a", content={"clutches": 2})
    with database.writing() as connection:
        assumptions.insert_fleet_prior(connection, PAPER)
        assumptions.insert_fleet_prior(connection, without_a)
        assert assumptions.fleet_prior_without(connection, PAPER, "a") == without_a
        assert assumptions.fleet_prior_without(connection, PAPER, "b") is None
        assumptions.forget_left_out(connection, PAPER.fleet, before=1)
        assert assumptions.fleet_prior_without(connection, PAPER, "a") == without_a
        assumptions.forget_left_out(connection, PAPER.fleet, before=2)
        assert assumptions.fleet_prior_without(connection, PAPER, "a") is None
        assert assumptions.current_fleet_prior(connection, PAPER.fleet) == PAPER


def test_a_version_is_stored_once(database: Database) -> None:
    with database.writing() as connection:
        assumptions.insert_fleet_prior(connection, PAPER)
    with pytest.raises(IntegrityError), database.writing() as connection:
        assumptions.insert_fleet_prior(connection, replace(PAPER, content={}))
