"""Why a record holds no engagement that can be evaluated."""

from dataclasses import dataclass
from enum import StrEnum


class SlipStatus(StrEnum):
    """Whether a record holds an engagement, and if not, why."""

    DETERMINED = "determined"
    TOO_FEW_SAMPLES = "too_few_samples"
    TIME_NOT_INCREASING = "time_not_increasing"
    SAMPLED_TOO_SLOWLY = "sampled_too_slowly"
    NO_PRESSURE = "no_pressure"
    NO_SLIP = "no_slip"
    SLIP_NEVER_ENDS = "slip_never_ends"
    NO_TORQUE = "no_torque"
    STARTS_IN_CONTACT = "starts_in_contact"
    GAP = "gap"


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """Why a record holds no engagement, as a status and a sentence."""

    status: SlipStatus
    message: str
