"""Adopted models, the COF that they correct, and what fleets have taught, by kind, version and the clutch left out."""

from dataclasses import replace

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from storage import assumptions, diagnoses
from storage.assumptions import NOBODY, AdoptedRow, FleetPriorRow
from tests.storage.samples import CLUTCH, new_diagnosis, store_run


def test_models_are_kept_by_version_and_come_from_a_diagnosis_or_none(connection: Connection) -> None:
    diagnoses.insert(connection, new_diagnosis(0))
    assert assumptions.current_adoption(connection, CLUTCH) is None
    rows = [
        AdoptedRow(version=1, diagnosis_id="d0", adopted_at="then"),
        AdoptedRow(version=2, diagnosis_id=None, adopted_at="now"),
    ]
    for row in rows:
        assumptions.insert_adoption(connection, CLUTCH, row)
    assert assumptions.current_adoption(connection, CLUTCH) == rows[1]
    assert assumptions.adoptions_of(connection, CLUTCH) == rows[::-1]
    assert assumptions.adoptions_of(connection, "other") == []
    with pytest.raises(IntegrityError), connection.begin_nested():
        assumptions.insert_adoption(connection, CLUTCH, replace(rows[0], version=3, diagnosis_id="nothing"))


def test_corrections_stand_beside_the_fits(connection: Connection) -> None:
    key = store_run(connection, 1)
    cofs = {4e5: (0.12, 0.001, (0.11, 0.13)), 5e5: (0.11, 0.002, ())}
    assumptions.write_corrected_cofs(connection, key, cofs)
    assert assumptions.corrected_cofs_of(connection, CLUTCH) == {key: cofs}
    assumptions.write_corrected_cofs(connection, key, {4e5: (0.13, 0.001, ())})
    assert assumptions.corrected_cofs_of(connection, CLUTCH) == {key: {4e5: (0.13, 0.001, ())}}
    assert assumptions.corrected_cofs_of(connection, "other") == {}
    assumptions.clear_corrected_cofs(connection, "other")
    assert assumptions.corrected_cofs_of(connection, CLUTCH)
    assumptions.clear_corrected_cofs(connection, CLUTCH)
    assert assumptions.corrected_cofs_of(connection, CLUTCH) == {}


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


def test_the_newest_version_of_a_kind_is_current_and_each_is_stored_once(connection: Connection) -> None:
    newer = replace(PAPER, version=2, content={"mean": []})
    for row in (PAPER, newer, SINTER, replace(SINTER, version=9, left_out="a")):
        assumptions.insert_fleet_prior(connection, row)
    backwards = dict(reversed(PAPER.fleet.items()))
    assert assumptions.current_fleet_prior(connection, backwards) == newer
    assert assumptions.current_fleet_prior(connection, {"friction_material": "cork"}) is None
    assert assumptions.current_fleet_priors(connection) == [newer, SINTER]
    with pytest.raises(IntegrityError), connection.begin_nested():
        assumptions.insert_fleet_prior(connection, replace(PAPER, content={}))


def test_a_clutch_gets_what_it_did_not_teach_of_its_version_or_the_newest(connection: Connection) -> None:
    taught = replace(PAPER, members=("a", "b"))
    without_a = replace(taught, left_out="a", content={"clutches": 2})
    newer = replace(taught, version=2, members=("b",), content={"mean": []})
    for row in (taught, without_a, newer):
        assumptions.insert_fleet_prior(connection, row)

    def of(clutch_id: str, version: int | None) -> FleetPriorRow | None:
        return assumptions.fleet_prior_for(connection, PAPER.fleet, clutch_id, version)

    assert [of("c", version) for version in (None, 0, 1, 2, 7)] == [newer, None, taught, newer, newer]
    assert [of("a", version) for version in (None, 1)] == [newer, without_a]
    assert [of("b", version) for version in (None, 1)] == [None, None]
    assumptions.forget_left_out(connection, PAPER.fleet, before=1)
    assert of("a", 1) == without_a
    assumptions.forget_left_out(connection, PAPER.fleet, before=2)
    assert of("a", 1) is None
    assert assumptions.current_fleet_prior(connection, PAPER.fleet) == newer


def test_a_large_fleet_is_left_out_in_twenty_groups(connection: Connection) -> None:
    members = tuple(f"clutch-{number:02}" for number in range(45))
    groups = assumptions.groups(members)
    assert sorted(name for group in groups for name in group) == list(members)
    assert len(groups) == 20
    assert assumptions.groups(members[:20]) == [(name,) for name in members[:20]]
    everyone = replace(PAPER, members=members)
    assumptions.insert_fleet_prior(connection, everyone)
    for group in groups:
        without = replace(everyone, left_out=group[0], content={"without": list(group)})
        assumptions.insert_fleet_prior(connection, without)
    for name in members:
        found = assumptions.fleet_prior_for(connection, PAPER.fleet, name, 1)
        assert name in found.content["without"]
    assert assumptions.fleet_prior_for(connection, PAPER.fleet, "another", 1) == everyone
