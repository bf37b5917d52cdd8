"""The files that the common errands pass through are printed, and are those that docs/explanation/architecture.md names."""

from collections.abc import Callable

import pytest

from tests.architecture import document, rooms
from tests.architecture.source import ROOT
from tests.measuring import parts

ERRANDS = [
    pytest.param("get", rooms.of_get, id="GET remaining-useful-life"),
    pytest.param("post", rooms.of_post, id="POST a stationary run"),
]


@pytest.mark.parametrize(("name", "errand"), ERRANDS)
def test_the_document_names_the_files_of_an_errand(name: str, errand: Callable[[], list[str]]) -> None:
    paths = errand()
    print("\n".join(f"{number:2d} {path}" for number, path in enumerate(paths, start=1)))
    assert paths, "nothing was watched"
    assert all((ROOT / path).is_file() for path in paths)
    documented = document.paths_of(parts(document.DOCUMENT.read_text(encoding="utf-8"))[name])
    if set(documented) != set(paths):  # what another thread entered meanwhile is entered once
        again = errand()
        paths = [path for path in paths if path in again]
    assert set(documented) == set(paths), "docs/explanation/architecture.md names other files: make architecture"
