"""The common errands pass through few files: who follows one with a finger finds its end."""

from collections.abc import Callable

import pytest

from tests.architecture import rooms
from tests.architecture.source import ROOT

#: An errand, and the most files of service and storage that it may enter.
ERRANDS = [
    pytest.param(rooms.of_get, 10, id="GET remaining-useful-life"),
    pytest.param(rooms.of_post, 24, id="POST a stationary run"),
]


@pytest.mark.parametrize(("errand", "most"), ERRANDS)
def test_an_errand_enters_few_files(errand: Callable[[], list[str]], most: int) -> None:
    paths = errand()
    print("\n".join(f"{number:2d} {path}" for number, path in enumerate(paths, start=1)))
    assert paths, "nothing was watched"
    assert all((ROOT / path).is_file() for path in paths)
    if len(paths) > most:
        pytest.fail("\n".join([f"{len(paths)} files are entered, at most {most}:", *paths]), pytrace=False)
