"""JSON made to be costly: it is refused in memory near its own size and in linear work, its errors named and counted."""

import json
from collections.abc import Callable

import pytest

from service.api.clutch import ClutchIn
from service.errors import MAX_ERRORS, InvalidError
from service.runs.json_run import checked, read_run
from tests.growth import APART, LINEAR, peak, time_ratio
from tests.support import stationary

HEAD = '{"kind":"stationary_stribeck","cycles":0,'


def unknown_fields(count: int) -> bytes:
    return (HEAD + ",".join(f'"a{number}":1' for number in range(count)) + "}").encode()


def unknown_channels(count: int) -> bytes:
    return (HEAD + '"channels":{' + ",".join(f'"a{number}":[]' for number in range(count)) + "}}").encode()


def values(value: str) -> Callable[[int], bytes]:
    return lambda count: (HEAD + '"channels":{"torque_nm":[1.5,' + ",".join([value] * count) + "]}}").encode()


def nested(opening: str) -> Callable[[int], bytes]:
    return lambda count: (HEAD + '"channels":' + opening * count).encode()


def missing(count: int) -> bytes:
    return ('{"channels":{"torque_nm":[' + ",".join(["1.5"] * count) + "]}}").encode()


def refused(body: bytes) -> InvalidError:
    with pytest.raises(InvalidError) as raised:
        read_run(body)
    assert len(raised.value.errors) <= MAX_ERRORS
    assert all(len(error.message) < 400 for error in raised.value.errors)
    return raised.value


def require_total(found: InvalidError, count: int) -> None:
    """All of a body's errors are counted, those of one that is too long at least as far as its beginning goes."""
    if found.detail.endswith(" errors or more"):
        assert min(count, 2000) < found.total <= count
    else:
        assert found.total == count


KINDS: dict[str, Callable[[int], bytes]] = {
    "unknown fields": unknown_fields,
    "unknown channels": unknown_channels,
    "numbers as texts": values('"12"'),
    "nothing as a value": values("null"),
    "objects as values": values("{}"),
    "deep lists": nested("["),
    "deep objects": nested('{"a":'),
    "texts that never end": nested('"\\"'),
    "fields that are missing": missing,
    "a number of many digits": lambda count: (HEAD + f'"cycles":{"1" * count}}}').encode(),
    "a name of many letters": lambda count: (HEAD + f'"{"a" * count}":1}}').encode(),
    "a text of many letters": lambda count: (HEAD + f'"run_id":"{"a" * count}"}}').encode(),
}


@pytest.mark.parametrize("kind", KINDS)
def test_memory_stays_near_the_size_of_the_body_and_work_is_linear(kind: str) -> None:
    body = KINDS[kind](200_000)
    assert peak(lambda: refused(body)) < 12 * len(body) + 2**20
    bodies = {size: KINDS[kind](size) for size in (10_000, APART * 10_000)}
    assert time_ratio(lambda size: refused(bodies[size]), 10_000) < LINEAR


@pytest.mark.parametrize("count", [100, 4000, 60_000])
def test_each_unknown_field_is_an_error(count: int) -> None:
    """By whatever means it is found."""
    found = refused(unknown_fields(count))
    require_total(found, count + (count < 5000))  # where the body is parsed, its channels are missing too
    error = next(error for error in found.errors if error.code == "extra_forbidden")
    assert (error.pointer, error.message) == ("/a0", "a0: no such field")


def test_unknown_channels_and_parts_of_duty_are_errors() -> None:
    require_total(refused(unknown_channels(10_000)), 10_000)
    assert refused(unknown_channels(10_000)).errors[30].pointer == "/channels/a30"
    body = '{"kind":"run_in","cycles":0,"duty":{"cycles":1,' + ",".join(f'"b/{n}":"x"' for n in range(10_000)) + "}}"
    found = refused(body.encode())
    require_total(found, 10_000)
    assert found.errors[7].pointer == "/duty/b~17"


@pytest.mark.parametrize("count", [100, 4000, 60_000])
def test_each_number_that_is_a_text_is_an_error_with_its_row(count: int) -> None:
    body = stationary(0)
    body["channels"] = {name: [1.5, 2, *["7,5"] * count, 3] for name in body["channels"]}
    found = refused(json.dumps(body, indent=count % 3).encode())
    require_total(found, 3 * count)
    first = found.errors[0]
    assert (first.pointer, first.row, first.code) == ("/channels/pressure_bar/2", 3, "not_a_number")
    assert [error.row for error in found.errors] == list(range(3, 53))


def test_errors_that_are_too_many_to_count_are_said_to_be_more() -> None:
    found = refused(values('{"a":[]}')(200_000))
    assert found.total > 1000
    assert found.detail.endswith(f"; {found.total} errors or more")
    assert found.errors[0].pointer == "/channels/torque_nm/1"


def test_many_marks_that_are_no_known_error_are_one_error() -> None:
    assert [error.code for error in refused(nested("[")(20_000)).errors] == ["too_many_marks"]
    body = json.dumps({"kind": "maintenance", "cycles": 0, "event": "other", "note": "x", "run_id": "a"})[:-1]
    assert [error.code for error in refused((body + ',"a":' + "[" * 20_000).encode()).errors] == ["too_many_marks"]


def test_the_longest_note_of_quotation_marks_is_a_note() -> None:
    for mark in '"', "[", "{":
        body = {"kind": "maintenance", "cycles": 0, "event": "other", "note": mark * 4000}
        assert read_run(json.dumps(body).encode()).details["note"] == mark * 4000
        assert refused(json.dumps(body | {"note": mark * 4001}).encode()).errors[0].code == "string_too_long"


def test_other_bodies_know_their_own_fields() -> None:
    body = '{"clutch_id":"a",' + ",".join(f'"channels{number}":1' for number in range(20_000)) + "}"
    with pytest.raises(InvalidError) as raised:
        checked(ClutchIn, body.encode())
    require_total(raised.value, 20_000)
    assert raised.value.errors[0].pointer == "/channels0"


def test_what_is_no_json_is_named() -> None:
    for body in (b"", b"{", b'{"a":}', b'{"kind":"maintenance",}'):
        error = refused(body).errors[0]
        assert error.code == "json_invalid"
        assert error.message.startswith("the body must be valid JSON: ")


@pytest.mark.parametrize("kept", [r"\\u0000", r"a\\\\u0000", r"\u0001"])
def test_a_zero_character_is_refused_for_no_database_of_json_reads_it(kept: str) -> None:
    head = '{"kind":"maintenance","cycles":0,"event":"other","note":"'
    for note in (r"a\u0000b", r"\\\u0000", r"\n\u0000"):
        assert "U+0000" in str(refused(f'{head}{note}"}}'.encode()))
    assert read_run(f'{head}{kept}"}}'.encode()).details["note"] == json.loads(f'"{kept}"')
