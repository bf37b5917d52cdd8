"""The form that registers a clutch shows what the service would fill in; names that are spelt almost alike."""

from collections.abc import Callable

import pytest

from service.schemas.clutch import ClutchIn
from tests.browser.modules import Module

pytestmark = pytest.mark.browser


def test_the_form_s_first_values_are_the_service_s_defaults(loaded: Callable[[str], Module]) -> None:
    shown = loaded("sending/registration.js").evaluate("m => m.DEFAULTS")
    filled_in = ClutchIn(clutch_id="any").model_dump()
    filled_in["end_of_life"].pop("criteria")  # the form has mean COF's fraction alone
    assert shown == {name: filled_in[name] for name in shown}
    assert {"geometry", "oil", "end_of_life"} <= shown.keys()


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("bench3-17", ["bench3-017"]),
        ("Bench3_017", ["bench3-017"]),
        ("bench3-071", ["bench3-017"]),
        ("left", []),
        ("c2", []),  # of two letters, two may not differ
    ],
)
def test_names_that_are_spelt_almost_alike(loaded: Callable[[str], Module], typed: str, meant: list[str]) -> None:
    assert loaded("sending/similar_names.js")("similarTo", typed, ["bench3-017", "c1", "right"]) == meant
