"""Whether the oil of a stationary test was too hot for its friction to be compared with that of other tests."""

from models.records.criteria import HOTTEST_OIL
from models.records.runs import Plateaus


def hot_oil_notes(plateaus: Plateaus) -> list[tuple[str, str]]:
    """A code and a sentence where the hottest plateau lies above the criterion; none where temperature was not measured."""
    if plateaus.oil_temperature is None or plateaus.oil_temperature.max() <= HOTTEST_OIL:
        return []
    hottest, limit = (kelvin - 273.15 for kelvin in (float(plateaus.oil_temperature.max()), HOTTEST_OIL))
    return [("hot_oil", f"the oil reached {hottest:.0f} °C, above {limit:.0f} °C: compare this test with care")]
