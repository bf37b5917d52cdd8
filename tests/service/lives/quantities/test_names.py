"""The names of quantities in the description are those that are followed."""

from typing import get_args

from service.lives.quantities.measured import QUANTITIES, Family
from service.schemas.life import EngagementQuantity, LoopQuantity, ParameterQuantity, QuantityName


def test_every_quantity_that_is_followed_may_be_asked_for_and_no_other() -> None:
    assert get_args(QuantityName) == tuple(QUANTITIES)
    families = {Family.PARAMETER: ParameterQuantity, Family.LAG: LoopQuantity, Family.ENGAGEMENT: EngagementQuantity}
    for family, names in families.items():
        assert get_args(names) == tuple(name for name, quantity in QUANTITIES.items() if quantity.family is family)
