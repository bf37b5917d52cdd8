"""The audit trail: rows are added, read newest first, of a clutch or of one run."""

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from storage import changes
from tests.storage.samples import CLUTCH


def insert(
    connection: Connection,
    number: int,
    clutch_id: str = CLUTCH,
    *,
    action: str = changes.WITHDRAW,
    run_id: str | None = "run-0001",
) -> None:
    after = {"state": "withdrawn", "number": number}
    who = {"at": "2026-11-02T10:00:00+00:00", "by": "key:ab12 bench 3", "reason": f"Grund {number} ü"}
    changes.insert(connection, clutch_id, action, {"state": "accepted"}, after, run_id=run_id, revision=number, **who)


def test_a_trail_is_read_newest_first_page_by_page(connection: Connection) -> None:
    for number in range(5):
        insert(connection, number, run_id=None if number == 3 else f"run-{number % 2}")
    whole = changes.page(connection, CLUTCH)
    assert [row.revision for row in whole] == [4, 3, 2, 1, 0]
    assert (whole[1].run_id, whole[1].reason, whole[1].after["number"]) == (None, "Grund 3 ü", 3)
    first = changes.page(connection, CLUTCH, limit=2)
    assert first + changes.page(connection, CLUTCH, before=first[-1].change_key) == whole
    assert [row.revision for row in changes.page(connection, CLUTCH, run_id="run-0")] == [4, 2, 0]
    assert changes.page(connection, "other") == []
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), connection.begin_nested():
        insert(connection, 1, "nobody")


def test_the_last_change_of_a_history_is_none_that_leaves_it_alone(connection: Connection) -> None:
    assert changes.last_of_history(connection, CLUTCH) == 0
    actions = (changes.CORRECT, changes.EDIT, changes.HOLD, changes.ARCHIVE, changes.UNARCHIVE)
    for number, action in enumerate(actions, start=1):
        insert(connection, number, action=action)
    assert changes.last_of_history(connection, CLUTCH) == 2
    assert changes.last_of_history(connection, "other") == 0
