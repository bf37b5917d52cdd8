"""The friction surface of a simulated clutch: what a profilometer would measure along the sliding direction.

    R(ζ) = R_fresh + s(ζ) (R_worn - R_fresh),    s(ζ) = min(1, (1 - μ(ζ)/μ(0)) / 0.5)

for R_a and R_sk alike, with the mean COF μ. The reference measured both ends, each the average of eight radial places of
one wafer block: R_a fell from 9.52 to 1.94 µm and R_sk from -0.87 to -3.4 over its tests, the lining had become smooth and
flat. It says nothing of the states between, and nothing of other clutches: that the surface goes with the loss of COF and
is the reference's worn one where half of it is lost is assumed here. The reference prints no scatter of its averages: none
is added.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 3, figs. 4 and 5.
"""

from dataclasses import dataclass

from models.rig.truth import SimulatedClutch

#: The share of mean COF that is lost where the surface is the worn one: the end of life.
_LOST = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """A surface profile's arithmetic mean roughness R_a > 0 [m] and the skewness R_sk [-] of its heights."""

    roughness: float
    skewness: float


#: The lining before and after the reference's tests.
FRESH, WORN = Surface(roughness=9.52e-6, skewness=-0.87), Surface(roughness=1.94e-6, skewness=-3.4)


def surface(clutch: SimulatedClutch, wear: float) -> Surface:
    """The surface of a clutch after wear ζ >= 0 [duty cycles]. Raises ValueError on another."""
    share = min(1.0, (1.0 - clutch.mean_cof(wear) / clutch.mean_cof(0.0)) / _LOST)
    return Surface(
        roughness=FRESH.roughness + share * (WORN.roughness - FRESH.roughness),
        skewness=FRESH.skewness + share * (WORN.skewness - FRESH.skewness),
    )
