"""Planned duty, and the remaining useful life under it."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from service.schemas.base import NotNegativeNumber, PositiveNumber, Schema
from service.schemas.limits import LEAST_BLOCK_CYCLES, LEAST_PLANNED_KJ, MOST_BLOCKS, MOST_CYCLES
from service.schemas.prognosis.life import Quantiles, RemainingLife


class PlannedBlock(Schema):
    """Duty cycles that are planned alike. What states no severity is as severe as recent duty."""

    cycles: Annotated[PositiveNumber, Field(ge=LEAST_BLOCK_CYCLES, le=MOST_CYCLES)] = Field(
        description="Duty cycles in the block"
    )
    energy_per_cycle_kj: Annotated[PositiveNumber, Field(ge=LEAST_PLANNED_KJ)] | None = Field(
        default=None, description="Energy to be dissipated in a duty cycle, kJ"
    )
    sd: NotNegativeNumber = Field(
        default=0.0, description="Standard deviation of that energy, kJ: how sure the plan is"
    )
    initial_speed_rpm: PositiveNumber | None = Field(
        default=None, description="Sliding speed at the start of an engagement, rpm"
    )
    engagement_duration_s: PositiveNumber | None = Field(default=None, description="Time from contact to standstill, s")
    maximum_pressure_bar: PositiveNumber | None = Field(
        default=None,
        description="Line pressure of an engagement, bar: with a speed it gives the energy where none is stated",
    )

    @model_validator(mode="after")
    def _complete(self) -> "PlannedBlock":
        """What says nothing without another field is refused with a reason, rather than left out in silence."""
        if self.sd > 0.0 and self.energy_per_cycle_kj is None:
            raise ValueError("sd is the deviation of energy_per_cycle_kj, which is missing")
        if self.sd > (self.energy_per_cycle_kj or 0.0):
            raise ValueError("sd is larger than energy_per_cycle_kj: a plan that open predicts nothing")
        if self.initial_speed_rpm is None and (self.engagement_duration_s or self.maximum_pressure_bar):
            raise ValueError("engagement_duration_s and maximum_pressure_bar say nothing without initial_speed_rpm")
        return self


class ProgrammeIn(Schema):
    """Blocks that are run one after the other, and from the first one again until the end of life."""

    programme: Annotated[tuple[PlannedBlock, ...], Field(min_length=1, max_length=MOST_BLOCKS)] = Field(
        description="The blocks of duty"
    )
    pace_cycles_per_hour: PositiveNumber | None = Field(
        default=None, description="Duty cycles an hour, idle hours included; left out, that of the dated runs"
    )


class PlannedLife(RemainingLife):
    """Remaining life under planned duty: `remaining_cycles` and `end_of_life_cycles` are those of the programme."""

    recent_duty_cycles: Quantiles = Field(description="Quantiles of the remaining cycles were recent duty to go on")
    remaining_blocks: Quantiles = Field(
        description="Quantiles of the blocks until the end, the last one in part; the programme begins again after its last"
    )
    block_severity: list[float | None] = Field(
        description="How many cycles of recent duty a cycle of each block is worth, the median; null without a prediction"
    )
    end_of_life_at: dict[str, str | None] | None = Field(
        description="Quantiles of the date of the end, UTC, ISO 8601; null where no pace is known"
    )
    pace_cycles_per_hour: float | None = Field(description="Duty cycles an hour that dates were computed with")
    pace_from: Literal["request", "runs"] | None = Field(
        description="Whose pace it is: the request's, or that of the present life's dated runs"
    )
