"""The examples in docstrings give what they say."""

import doctest
import importlib

import pytest

from tests.architecture.source import by_name

PARTS = ("models.", "service.", "storage.")
WITH_EXAMPLES = sorted(name for name, module in by_name().items() if name.startswith(PARTS) and ">>> " in module.text)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_the_examples_of_a_docstring_give_what_they_say(name: str) -> None:
    found = doctest.testmod(importlib.import_module(name))
    assert found.attempted > 0
    assert found.failed == 0


def test_there_are_examples_to_run() -> None:
    assert "models.friction.stribeck" in WITH_EXAMPLES
