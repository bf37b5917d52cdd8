"""After a record is edited, every answer is that of a clutch that was registered so; an archived clutch takes in no more."""

from collections.abc import Callable
from typing import Any

import pytest

from service.answers import clutch_list
from service.answers import runs as run_answers
from service.api.clutch import ClutchEdit, ClutchIn
from service.changes import edit_clutch, learn_fleet
from service.errors import ArchivedError, ConflictError
from service.paging import WHOLE
from storage.clutches import ClutchSelection
from tests.service.changes.benches import AT, CLUTCH, WHO, Bench, assert_same, body, overtaken, send_to
from tests.service.clients import as_answered

HISTORY = (("test", 0.0), ("duty", 400.0), ("loop", 500.0), ("oil_change", 1500.0), ("test", 2000.0))


def edit(bench: Bench, *, archived: bool | None = None, **fields: Any) -> None:
    asked = ClutchEdit.model_validate({"reason": "the drawing says so"} | fields)
    edit_clutch.edit(bench.database, CLUTCH, asked.fields(), archived=archived, reason=asked.reason, **WHO)


def sent(bench: Bench) -> Bench:
    for kind, cycles in HISTORY:
        bench.send(body(kind, f"{kind}-{cycles:g}", cycles))
    bench.send(body("test", "odd", 1700.0, odd=True))
    bench.send(body("test", "junk", 1800.0))
    bench.withdraw("junk")
    return bench


GEOMETRY = {"geometry": {"inner_diameter_mm": 90, "outer_diameter_mm": 140, "friction_faces": 4}}
OIL_AND_KIND = {"oil": {"kinematic_viscosity_40c_cst": 30}, "fluid": "CVTF", "origin": "simulated"}
EDITS = [
    pytest.param(GEOMETRY, False, id="geometry"),
    pytest.param(GEOMETRY, True, id="geometry under an adopted model"),
    pytest.param({"torque_filter_ms": 20}, False, id="the torque channel's filter"),
    pytest.param({"end_of_life": {"cof_fraction": 0.8}}, False, id="end of life"),
    pytest.param({"severity": {"basis": "dissipated_energy", "exponent": 1.5}}, True, id="severity"),
    pytest.param(OIL_AND_KIND, True, id="oil and kind"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("fields", "adopted"), EDITS)
def test_an_edited_clutch_answers_as_one_that_was_registered_so(
    new_bench: Callable[..., Bench], fields: dict[str, Any], adopted: bool
) -> None:
    edited, right = new_bench(), new_bench(fields)
    for bench in (edited, right):
        bench.diagnose("d1", "")
        if adopted:
            bench.adopt("d1")
        sent(bench)
    before = edited.answers(degradation_too=False)
    edit(edited, **fields)
    assert_same(edited, right)
    assert edited.receipts() == right.receipts()  # those that are held and withdrawn, too
    assert edited.answers(degradation_too=False) != before
    edit(edited, **{name: ClutchIn(clutch_id=CLUTCH).model_dump()[name] for name in fields})
    assert edited.answers(degradation_too=False) == before


def test_a_field_is_replaced_as_a_whole_and_the_trail_says_what_changed(new_bench: Callable[..., Bench]) -> None:
    bench = new_bench({"geometry": {"friction_faces": 6, "pressure_factor": 1.1}})
    edit(bench, geometry={"friction_faces": 4}, fluid="ATF")
    edit(bench, geometry={"friction_faces": 4})  # as it is
    (entry,) = as_answered(run_answers.trail(bench.database, CLUTCH, WHOLE))["items"]
    assert (entry["action"], entry["run_id"], entry["reason"]) == ("edit", None, "the drawing says so")
    assert entry["before"].keys() == entry["after"].keys() == {"geometry"}
    assert (entry["after"]["geometry"]["friction_faces"], entry["after"]["geometry"]["pressure_factor"]) == (4, 1.0)
    assert clutch_list.look_up(bench.database, CLUTCH).revision == 1


def test_the_record_in_force_and_the_one_that_was_registered_are_known(new_bench: Callable[..., Bench]) -> None:
    bench = new_bench({"fluid": "first"})
    edit(bench, fluid="second")
    edit(bench, fluid="third")

    def register(fluid: str) -> bool:
        record = ClutchIn.model_validate({"clutch_id": CLUTCH, "fluid": fluid})
        return edit_clutch.register(bench.database, record, created_at=AT)

    assert not register("first")
    assert not register("third")
    with pytest.raises(ConflictError):
        register("second")
    assert clutch_list.look_up(bench.database, CLUTCH).fluid == "third"


def test_an_archived_clutch_is_left_out_takes_in_no_run_and_still_teaches(bench: Bench) -> None:
    known = body("test", "a", 0.0)
    bench.send(known)
    before = bench.answers()
    edit(bench, archived=True)
    edit(bench, archived=True)
    with pytest.raises(ArchivedError, match="archived"):
        bench.send(body("test", "b", 1000.0))
    assert bench.send(known)["duplicate"]
    totals = [clutch_list.totals(bench.database, ClutchSelection(archived=archived)).all for archived in (False, True)]
    assert totals == [0, 1]
    assert learn_fleet.lessons_of(learn_fleet._state(bench.database, CLUTCH))[0].fluid == "ATF"
    edit(bench, archived=False)
    assert bench.answers() == before
    bench.send(body("test", "b", 1000.0))
    actions = [entry.action for entry in run_answers.trail(bench.database, CLUTCH, WHOLE).items]
    assert actions == ["unarchive", "archive"]


def test_an_edit_that_is_overtaken_by_a_run_holds_for_it(
    new_bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    edited, right = new_bench(), new_bench({"end_of_life": {"cof_fraction": 0.8}})
    run = body("test", "b", 1000.0)
    edited.send_tests(0)
    right.send_tests(0)
    right.send(run)
    calls = overtaken(monkeypatch, edit_clutch, "_computed", edited.database, lambda other: send_to(other, run))
    edit(edited, end_of_life={"cof_fraction": 0.8})
    assert len(calls) == 2
    assert_same(edited, right)
