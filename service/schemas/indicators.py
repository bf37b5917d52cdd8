"""The indicators of one measured engagement, as a receipt has them."""

from pydantic import Field

from service.schemas.base import Answer


class IndicatorEstimate(Answer):
    """A value with its standard error, which counts noise."""

    value: float = Field(description="The value")
    sd: float = Field(description="Its standard error")


class Indicators(Answer):
    """The indicators of one engagement; null is what the record does not determine."""

    stop_time_s: IndicatorEstimate | None = Field(description="From 10 % of the highest torque to standstill, s")
    engagement_energy_kj: IndicatorEstimate | None = Field(description="Dissipated from contact to standstill, kJ")
    peak_power_kw: IndicatorEstimate | None = Field(description="Highest power, kW")
    initial_cof: IndicatorEstimate | None = Field(description="COF at 90 % of the initial speed")
    midpoint_cof: IndicatorEstimate | None = Field(description="COF at 50 % of the initial speed")
    endpoint_cof: IndicatorEstimate | None = Field(description="COF at 10 % of the initial speed")
    breakaway_cof: IndicatorEstimate | None = Field(description="COF at which slip begins again after the standstill")
    initial_cof_ratio: IndicatorEstimate | None = Field(description="Initial over midpoint COF")
    endpoint_cof_ratio: IndicatorEstimate | None = Field(description="Endpoint over midpoint COF")
    breakaway_cof_ratio: IndicatorEstimate | None = Field(description="Breakaway over midpoint COF")
    torque_rise: IndicatorEstimate | None = Field(
        description="Torque at the end of slip over that at half speed, less 1"
    )


class ReceivedEngagement(Answer):
    """The engagement that a block of duty carries; null where it was not evaluated."""

    status: str = Field(
        description="`determined`, or why not: `no_slip`, `slip_never_ends`, `no_torque`, `no_pressure`, "
        "`time_not_increasing`, `sampled_too_slowly`, `starts_in_contact`, `gap`, `too_few_samples`"
    )
    message: str = Field(description="The status in a sentence")
    start_s: float | None = Field(description="Start of slip on the record's clock, s")
    end_s: float | None = Field(description="End of slip on the record's clock, s")
    initial_speed_rpm: float | None = Field(description="Sliding speed at contact, rpm")
    maximum_pressure_bar: float | None = Field(description="Highest pressure of the slip, bar")
    indicators: Indicators = Field(description="The indicators, each with its standard error")
