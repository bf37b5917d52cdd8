"""What fleets have taught, by kind, version and the clutch left out."""

from dataclasses import replace

import pytest
from sqlalchemy.exc import IntegrityError

from storage import fleet_priors
from storage.engine.database import Database
from storage.fleet_priors import NOBODY, FleetPriorRow

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
            fleet_priors.insert(connection, row)
    with database.reading() as connection:
        backwards = dict(reversed(PAPER.fleet.items()))
        assert fleet_priors.current(connection, backwards) == newer
        assert fleet_priors.current(connection, {"friction_material": "cork"}) is None
        assert fleet_priors.all_current(connection) == [newer, SINTER]


def test_what_was_said_without_a_clutch_is_found_and_forgotten(database: Database) -> None:
    without_a = replace(PAPER, left_out="a", content={"clutches": 2})
    with database.writing() as connection:
        fleet_priors.insert(connection, PAPER)
        fleet_priors.insert(connection, without_a)
        assert fleet_priors.without(connection, PAPER, "a") == without_a
        assert fleet_priors.without(connection, PAPER, "b") is None
        fleet_priors.forget_left_out(connection, PAPER.fleet, before=1)
        assert fleet_priors.without(connection, PAPER, "a") == without_a
        fleet_priors.forget_left_out(connection, PAPER.fleet, before=2)
        assert fleet_priors.without(connection, PAPER, "a") is None
        assert fleet_priors.current(connection, PAPER.fleet) == PAPER


def test_a_version_is_stored_once(database: Database) -> None:
    with database.writing() as connection:
        fleet_priors.insert(connection, PAPER)
    with pytest.raises(IntegrityError), database.writing() as connection:
        fleet_priors.insert(connection, replace(PAPER, content={}))
