"""Alarms: rules, what they raise, receivers, and what these were sent."""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, StringConstraints, model_validator

from models.prognosis.criteria import QUANTILES
from service.api import base

WatchedQuantity = Literal[
    "remaining_cycles", "remaining_days", "health", "shudder_margin", "held_runs", "off_course", "verdict", "state",
    "silent_hours",
]  # fmt: skip
#: Which side of its limit a quantity is watched at, and the limit where none is given (None: it must be); quantities that
#: have no limit are not here.
LIMITS: dict[str, tuple[Literal["below", "above"], float | None]] = {
    "remaining_cycles": ("below", None),
    "remaining_days": ("below", None),
    "health": ("below", None),
    "shudder_margin": ("below", 0.0),
    "held_runs": ("above", 0.0),
    "silent_hours": ("above", None),
}


def _quantile(sent: float) -> float:
    if sent not in QUANTILES:
        raise ValueError(
            f"probability must be one of {', '.join(f'{quantile:g}' for quantile in QUANTILES)}, got {sent:g}"
        )
    return sent


Probability = Annotated[
    float,
    # an enum of numbers is none that generators of clients write
    Field(strict=True, json_schema_extra={"oneOf": [{"const": quantile} for quantile in QUANTILES]}),
    AfterValidator(_quantile),
]
Limit = Annotated[float, Field(ge=-base.LARGEST_LIMIT, le=base.LARGEST_LIMIT, allow_inf_nan=False, strict=True)]
EventState = Literal["raised", "acknowledged", "cleared"]
_Address = Annotated[str, StringConstraints(min_length=1, max_length=base.LONGEST_ADDRESS, strip_whitespace=True)]


class KindIn(base.Schema):
    """A kind of clutch. Omitted fields match everything."""

    friction_material: base.Name | None = Field(default=None, description="The friction material")
    reaction_plate: base.Name | None = Field(default=None, description="The reaction plate's material")
    fluid: base.Name | None = Field(default=None, description="The fluid")


class AlarmIn(base.Schema):
    """A rule: when an alarm is raised, of which clutches."""

    name: base.Title = Field(default="", description="Name for people")
    clutch_id: base.Identifier | None = Field(default=None, description="The clutch; default: all clutches")
    kind: KindIn | None = Field(default=None, description="Only clutches of this kind")
    quantity: WatchedQuantity = Field(
        description="The watched quantity: `remaining_cycles` (to the first criterion that ends the life), "
        "`remaining_days` at "
        "the pace of the runs, `health`, `shudder_margin` (slope of the newest test's curves, s/m), `held_runs`, "
        "`off_course`, `verdict` of the newest diagnosis, `state`, `silent_hours` since the last run arrived"
    )
    probability: Probability = Field(
        default=0.05,
        description="Quantile that is compared with the limit; 0.05 is the safe bound, also for the shudder margin",
    )
    below: Limit | None = Field(default=None, description="The alarm is raised if the value is below this limit")
    above: Limit | None = Field(default=None, description="The alarm is raised if the value is above this limit")
    median_within: Annotated[float, Field(ge=1.0, le=base.LARGEST_LIMIT, allow_inf_nan=False, strict=True)] | None = (
        Field(
            default=2.0,
            description="For remaining cycles and days: the alarm is raised only if the median, too, is below so many times"
            " the limit. With few tests the safe bound is low and the median high: then the tests do not show the end yet."
            " null: the bound alone decides",
        )
    )
    any_of: tuple[base.StateName | base.VerdictName, ...] | None = Field(
        default=None,
        description="States or verdicts that raise the alarm; default: every state but `normal`, or every verdict"
        " with a disagreement of data and model",
    )
    speed_rpm: Annotated[base.PositiveNumber, Field(le=base.MAX_SPEED_RPM)] = Field(
        default=100.0, description="Speed at which the shudder margin is taken, rpm"
    )
    hysteresis: Annotated[base.NotNegativeNumber, Field(le=1.0)] = Field(
        default=0.1, description="How far the value must come back before the alarm is cleared, as a share of the limit"
    )
    enabled: bool = Field(default=True, strict=True, description="Whether the rule is in use")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """The rule, with a limit on the side that its quantity needs, and no field that has no effect; else ValueError."""
        side, usual = LIMITS.get(self.quantity, (None, None))
        for name in ("below", "above"):
            value = getattr(self, name)
            if value is not None and name != side:
                instead = f"its limit is {side!r}" if side else "it has no limit"
                raise ValueError(f"{self.quantity} cannot be watched with {name!r}: {instead}")
        if side is not None and getattr(self, side) is None:
            if usual is None:
                raise ValueError(f"{self.quantity} needs {side!r}, its limit")
            object.__setattr__(self, side, usual)
        if self.quantity == "silent_hours" and not (self.above or 0.0) > 0.0:
            raise ValueError(f"silent_hours needs a limit above 0, got {self.above}")
        if self.any_of is not None and self.quantity not in ("state", "verdict"):
            raise ValueError(f"any_of is for the quantities state and verdict, not for {self.quantity}")
        if self.clutch_id is not None and self.kind is not None:
            raise ValueError("give clutch_id or kind, not both")
        return self

    @property
    def limit(self) -> float | None:
        return self.below if self.above is None else self.above


class AlarmOut(AlarmIn):
    """A rule in force."""

    alarm_id: str = Field(description="The rule's name")
    saved_at: str = Field(description="When it was saved")
    saved_by: str = Field(description="Who saved it")


class AlarmPage(base.Page[AlarmOut]):
    """Rules by name."""

    items: list[AlarmOut] = Field(description="The rules")


class EventOut(base.Answer):
    """An alarm that was raised."""

    event_id: str = Field(description="The alarm's name")
    alarm_id: str = Field(description="The rule that raised it; it may have been deleted since")
    clutch_id: str = Field(description="The clutch")
    quantity: WatchedQuantity = Field(description="What is watched")
    name: str = Field(description="The rule's name at that time")
    value: base.Real | None = Field(description="The value that raised it; null if it is not a number")
    limit: base.Real | None = Field(description="The limit that it passed; null if the rule has none")
    message: str = Field(description="The alarm in a sentence")
    as_of_cycles: base.Real | None = Field(description="Duty cycles since new of the clutch's latest run at that time")
    state: EventState = Field(description="`raised`, `acknowledged` or `cleared`")
    raised_at: str = Field(description="When it was raised")
    acknowledged_at: str | None = Field(description="When it was acknowledged")
    acknowledged_by: str | None = Field(description="Who acknowledged it")
    note: str = Field(description="Remark of the person who acknowledged it")
    cleared_at: str | None = Field(description="When the alarm was cleared")


class EventPage(base.Page[EventOut]):
    """Alarms, newest first."""

    items: list[EventOut] = Field(description="The alarms")


class AcknowledgeIn(base.Schema):
    """An alarm is acknowledged."""

    note: base.Reason = Field(default="", description="A remark")


class WebhookIn(base.Schema):
    """A receiver of alarms."""

    url: _Address = Field(
        description="`https://...` or `http://...`; with the extra `notify` also an address of Apprise, as `mailtos://...`, "
        "`msteams://...`, `slack://...`, `ntfys://...`"
    )
    secret: Annotated[str, StringConstraints(max_length=base.LONGEST_SECRET, pattern=r"^[^\x00]*$")] | None = Field(
        default=None,
        description="Secret that signs the requests; default: the service makes one and shows it once, in this answer",
    )
    name: base.Title = Field(default="", description="Name for people")
    clutch_id: base.Identifier | None = Field(default=None, description="Only alarms of this clutch")
    cleared: bool = Field(
        default=False, strict=True, description="Whether the receiver also gets a message when an alarm is cleared"
    )

    @model_validator(mode="after")
    def _long_enough(self) -> Self:
        if self.secret and len(self.secret) < base.SHORTEST_SECRET:
            raise ValueError(f"secret must have at least {base.SHORTEST_SECRET} characters, or be left out")
        return self


class WebhookOut(base.Answer):
    """A receiver; its address without passwords."""

    webhook_id: str = Field(description="The receiver's name")
    url: str = Field(description="Its address, without passwords, tokens and queries")
    secret: str | None = Field(description="The secret, only if the service has just made it; else null")
    name: str = Field(description="Name for people")
    clutch_id: str | None = Field(description="Only alarms of this clutch; null: all")
    cleared: bool = Field(description="Whether the receiver also gets a message when an alarm is cleared")
    created_at: str = Field(description="When it was made")
    created_by: str = Field(description="Who made it")


class WebhookPage(base.Page[WebhookOut]):
    """Receivers by name."""

    items: list[WebhookOut] = Field(description="The receivers")


class DeliveryOut(base.Answer):
    """A message to a receiver, sent or waiting."""

    delivery_id: str = Field(description="Its name, the header `Clutchlife-Delivery`; the same at each attempt")
    webhook_id: str = Field(description="The receiver")
    event_id: str | None = Field(description="The alarm; null: a test")
    state: Literal["waiting", "delivered", "failed"] = Field(
        description="`waiting` for an attempt, `delivered`, or `failed` for good"
    )
    attempts: int = Field(description="Number of attempts")
    status: int | None = Field(description="The HTTP status of the last attempt")
    problem: str | None = Field(description="Why the last attempt failed")
    created_at: str = Field(description="When it was put into the outbox")
    last_attempt_at: str | None = Field(description="Time of the last attempt")
    delivered_at: str | None = Field(description="Time of the delivery")
    next_attempt_at: str | None = Field(description="Time of the next attempt; null if there is none")


class DeliveryPage(base.Page[DeliveryOut]):
    """Deliveries, newest first."""

    items: list[DeliveryOut] = Field(description="The deliveries")


class TestedOut(base.Answer):
    """The result of a test at each receiver."""

    deliveries: list[DeliveryOut] = Field(
        description="One delivery per receiver; `waiting`: there will be another attempt"
    )
    message: str = Field(description="The result in a sentence")


EXAMPLE: Mapping[str, object] = {
    "clutch_id": "bench3-017",
    "quantity": "remaining_cycles",
    "probability": 0.05,
    "below": 4000,
}
