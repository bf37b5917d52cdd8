"""Which content is a newer version of which."""

import json

import pytest

from service.cli.sending.run_head import RunHead, of_body, of_file, same_run
from tests.service.cli.sending.stand_in_service import body


def head(*, torque: float = 1.0, **fields: object) -> RunHead:
    return of_body(json.dumps({"kind": "k", "channels": {"torque_nm": [torque]}} | fields).encode())


MORNING, NOON = "2026-01-01T08:00:00Z", "2026-01-01T12:00:00Z"


@pytest.mark.parametrize(
    ("older", "newer", "same_file", "expected"),
    [
        (head(run_id="a", cycles=70000), head(run_id="a", cycles=7000), False, True),
        (head(run_id="a"), head(run_id="b"), True, False),  # a recorder that writes every run into one file
        (head(cycles=70000), head(cycles=7000, torque=2), True, True),
        (head(cycles=70000), head(cycles=7000), False, False),
        (head(cycles=1), head(cycles=1, run_id="a"), True, True),
        (head(started_at=MORNING), head(started_at=NOON, torque=2), True, False),
        (head(started_at=MORNING), head(started_at=NOON), True, True),  # the start was mistyped
        (head(started_at=MORNING), head(started_at=MORNING, torque=2), True, True),
        (head(started_at=MORNING), head(started_at=NOON), False, False),
    ],
)
def test_versions_of_a_run(older: RunHead, newer: RunHead, same_file: bool, expected: bool) -> None:
    assert same_run(older, newer, same_file=same_file) is expected


def test_a_head_states_what_the_run_does() -> None:
    stated = of_body(body(7000, "a", started_at=NOON))
    assert (stated.run_id, stated.kind, stated.cycles, stated.started_at) == ("a", "maintenance", 7000.0, NOON)
    assert of_file({"kind": "k", "cycles": "7000.0"}, "abc") == RunHead(kind="k", cycles=7000.0, measurements="abc")


@pytest.mark.parametrize("text", [b"", b"no json", b"[1]", b"\xff", b"[" * 100000, b'{"cycles": "many", "run_id": 3}'])
def test_what_is_no_run_has_an_empty_head(text: bytes) -> None:
    assert of_body(text) == RunHead()


def test_cycles_that_are_no_number_are_not_stated() -> None:
    assert of_body(b'{"cycles": NaN}').cycles is None
    assert of_body(b'{"cycles": 1e999}').cycles is None


def test_a_version_that_states_its_start_in_another_time_zone_is_of_the_same_run() -> None:
    in_germany = head(started_at="2026-01-01T09:00:00+01:00", torque=2, cycles=7000)
    assert same_run(head(started_at=MORNING, cycles=7000.0), in_germany, same_file=True)
    assert not same_run(head(started_at=NOON), in_germany, same_file=True)


def test_measurements_are_the_same_however_their_numbers_are_written() -> None:
    texts = [b'{"started_at": "%s", "channels": {"torque_nm": [%s]}}' % (MORNING.encode(), n) for n in (b"1", b"1.0")]
    assert of_body(texts[0]).measurements == of_body(texts[1]).measurements
