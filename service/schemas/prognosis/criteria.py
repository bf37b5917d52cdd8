"""What ends a life: criteria as they are given in a clutch's record."""

from typing import Annotated, Any, Self, get_args

from pydantic import Field, model_validator

from service.schemas.base import PositiveNumber, Schema
from service.schemas.limits import LARGEST_LIMIT, MOST_CRITERION_PRESSURE_BAR, MOST_SPEED_RPM
from service.schemas.prognosis.quantities import ALIASES, LevelQuantity, LoopQuantity, QuantityName

_Value = Annotated[float, Field(ge=-LARGEST_LIMIT, le=LARGEST_LIMIT, allow_inf_nan=False, strict=True)]


class CriterionIn(Schema):
    """A quantity that ends the life where it reaches a limit: a share of its initial value, or a value."""

    quantity: QuantityName = Field(description="The quantity, as in `/degradation`")
    fraction: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)] | None = Field(
        default=None, description="The life ends when the quantity has fallen to this share of its initial value"
    )
    below: _Value | None = Field(
        default=None, description="The life ends when it falls below this value; of a slope 0 where no limit is given"
    )
    above: _Value | None = Field(default=None, description="The life ends when it rises above this value")
    pressure_bar: Annotated[PositiveNumber, Field(le=MOST_CRITERION_PRESSURE_BAR)] | None = Field(
        default=None, description="Line pressure, bar: that of all but mean COF, which left out is the mean over all"
    )
    speed_rpm: Annotated[PositiveNumber, Field(le=MOST_SPEED_RPM)] | None = Field(
        default=None, description="Speed of a slope, rpm"
    )
    frequency_hz: PositiveNumber | None = Field(default=None, description="Frequency of a quantity of loops, Hz")

    @model_validator(mode="before")
    @classmethod
    def _has_a_limit(cls, given: Any) -> Any:
        """A slope's limit is 0, where friction begins to fall with speed, and mean COF's half of what it was."""
        if isinstance(given, dict) and isinstance(given.get("quantity"), str):
            given = given | {"quantity": ALIASES.get(given["quantity"], given["quantity"])}
        if not isinstance(given, dict) or any(given.get(name) is not None for name in ("fraction", "below", "above")):
            return given
        usual = {"slope": {"below": 0.0}, "mean_cof": {"fraction": 0.5}}
        quantity = given.get("quantity")
        return given | usual.get(quantity, {}) if isinstance(quantity, str) else given

    @model_validator(mode="after")
    def _is_one_limit_at_one_place(self) -> Self:
        limits = [name for name in ("fraction", "below", "above") if getattr(self, name) is not None]
        if len(limits) != 1:
            raise ValueError(
                f"exactly one of fraction, below and above must be given, got {', '.join(limits) or 'none'}"
            )
        if self.quantity == "slope" and self.fraction is not None:
            raise ValueError("a slope changes sign: its limit is below or above a value, not a fraction")
        if self.quantity != "mean_cof" and (self.pressure_bar is None) is (self.quantity in get_args(LevelQuantity)):
            given = "be given" if self.pressure_bar is None else "not be given"
            raise ValueError(f"pressure_bar must {given} for {self.quantity}")
        of_loops = self.quantity in get_args(LoopQuantity)
        for name, needed in (("speed_rpm", self.quantity == "slope"), ("frequency_hz", of_loops)):
            if (getattr(self, name) is not None) is not needed:
                raise ValueError(f"{name} must {'' if needed else 'not '}be given for {self.quantity}")
        return self
