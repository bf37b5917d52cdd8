"""What an adopted diagnosis changes in tracking: measurements are freed of artefacts, a life gets an effect's course.

An *artefact* (oil temperature, a shifted zero, an unsettled dwell ...) is in the measurement and not in the clutch: its
torque is taken off every plateau before a curve is fitted. A *course* (running-in, oil change, accelerated wear ...) is in
the clutch and not in eq. 6: its mean torque is taken off the measured course before eq. 6 is tracked, and put back when
the threshold's first passage is looked for.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, StationaryRun


@dataclass(frozen=True, slots=True, kw_only=True)
class Extension:
    """An extended model, ready to be stored as JSON and applied to runs that come later.

    `effects` are slugs; `content` is what `to_dict` stores: plain numbers, strings, lists and dicts, all finite.
    """

    effects: tuple[str, ...]
    content: Mapping[str, Any]

    def artefact(self, run: StationaryRun, campaign: Campaign) -> FloatArray:
        """Torque [n] Nm that the artefacts add to each plateau of a run; zero where there are none.

        `campaign` gives what a run alone does not say (maintenance, moments of the other runs); it need not hold `run`.
        """
        raise NotImplementedError

    def course(self, cycles: FloatArray, pressure: FloatArray, velocity: FloatArray) -> FloatArray:
        """Mean torque [m, k] Nm over velocity [v] m/s that the effects of use add at cycles [m] and pressure [k] Pa."""
        raise NotImplementedError

    def course_sd(self, cycles: FloatArray, pressure: FloatArray, velocity: FloatArray) -> FloatArray:
        """Deviation [m, k] Nm of `course`, from the effect's amplitude and shape."""
        raise NotImplementedError

    @property
    def severity_exponent(self) -> float | None:
        """Where load severity was adopted: ζ grows by (energy/usual energy)^exponent a cycle; else None."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """As JSON can carry it."""
        return {"effects": list(self.effects), "content": dict(self.content)}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> "Extension":
        """The inverse of `to_dict`."""
        return cls(effects=tuple(stored["effects"]), content=stored["content"])
