"""The common errands pass through few files: who follows one with a finger finds its end."""

from collections.abc import Callable

import pytest

from tests.architecture import document, rooms
from tests.architecture.source import ROOT

#: An errand by its part of docs/architecture.md, and the most files of service and storage that it may enter.
ERRANDS = [
    pytest.param("get", rooms.of_get, 10, id="GET remaining-useful-life"),
    # 24 before plausibility (7), workers, the watch and the lock beside the file, a prediction's warnings; see
    # docs/architecture.md
    pytest.param("post", rooms.of_post, 34, id="POST a stationary run"),
]


@pytest.mark.parametrize(("name", "errand", "most"), ERRANDS)
def test_an_errand_enters_few_files(name: str, errand: Callable[[], list[str]], most: int) -> None:
    paths = errand()
    print("\n".join(f"{number:2d} {path}" for number, path in enumerate(paths, start=1)))
    assert paths, "nothing was watched"
    assert all((ROOT / path).is_file() for path in paths)
    if len(paths) > most:
        pytest.fail("\n".join([f"{len(paths)} files are entered, at most {most}:", *paths]), pytrace=False)
    documented = document.paths_of(document.parts(document.DOCUMENT.read_text(encoding="utf-8"))[name])
    assert set(documented) == set(paths), "docs/architecture.md names other files: make architecture"
