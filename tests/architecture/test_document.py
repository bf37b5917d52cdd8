"""docs/explanation/architecture.md and its picture are those of the code as it is, and its ways those of the errands."""

from collections.abc import Callable

import pytest
from fastapi.testclient import TestClient

from tests.architecture import document, picture, rooms
from tests.lab.measuring import filled, parts

PARTS = parts(document.DOCUMENT.read_text(encoding="utf-8"))
AGAIN = "write it again: make architecture"


def test_the_picture_is_that_of_the_code() -> None:
    assert picture.PICTURE.read_text(encoding="utf-8") == picture.draw(), AGAIN


def test_the_parts_are_those_of_the_code() -> None:
    written = document.written()
    assert {name: PARTS[name] for name in written} == {name: text.strip("\n") for name, text in written.items()}, AGAIN


def test_every_part_is_written_by_the_code() -> None:
    assert PARTS.keys() == document.written().keys() | {"get", "post", "diagnosis"}


def test_only_arrows_that_no_longer_way_implies_are_drawn() -> None:
    edges = {name: frozenset(targets) for name, targets in {"a": "bc", "b": "c", "c": "", "d": ""}.items()}
    assert picture.reduced(edges) == {"a": {"b"}, "b": {"c"}, "c": set(), "d": set()}
    assert picture.in_rows(edges, edges) == [["a"], ["b"], ["c", "d"]]


@pytest.mark.parametrize(("name", "errand"), [("get", rooms.get_life), ("post", rooms.post_run)])
def test_the_document_names_the_files_of_an_errand(name: str, errand: Callable[[TestClient, str], None]) -> None:
    paths = rooms.entered(errand)
    print("\n".join(f"{number:2d} {path}" for number, path in enumerate(paths, start=1)))
    assert paths, "nothing was watched"
    documented = document.paths_of(PARTS[name])
    if set(documented) != set(paths):  # what another thread entered meanwhile is entered once
        again = rooms.entered(errand)
        paths = [path for path in paths if path in again]
    assert set(documented) == set(paths), "docs/explanation/architecture.md names other files: make architecture"


def test_a_part_that_is_missing_is_named() -> None:
    text = "<!-- get -->\nold\n<!-- end -->\n\n<!-- post -->\n<!-- end -->\n"
    written = filled(text, {"get": "1. `a.py`: A.", "post": ""})
    assert parts(written) == {"get": "1. `a.py`: A.", "post": ""}
    assert document.paths_of(written) == ["a.py"]
    with pytest.raises(ValueError, match="must hold the part <!-- chapters -->"):
        filled(text, {"chapters": ""})
