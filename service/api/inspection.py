"""Inspections of a clutch's friction surface: roughness, skewness, a note, and photographs as files."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.api import base
from service.api.base import Answer, ClutchName, Cycles, Origin, Page, PositiveNumber, Real, Schema, StartedAt

Skewness = Annotated[
    float, Field(ge=-base.LARGEST_SKEWNESS, le=base.LARGEST_SKEWNESS, allow_inf_nan=False, strict=True)
]
MediaType = Literal["image/png", "image/jpeg", "image/webp"]


class InspectionIn(Schema):
    """An inspection of the friction surface. At least one of roughness, skewness and note is required."""

    cycles: Cycles = Field(description="Duty cycles since new when the surface was inspected")
    performed_at: Annotated[StartedAt, Field(strict=True)] | None = Field(
        default=None, description="When it was inspected: ISO 8601 with a time zone"
    )
    lining: Annotated[str, StringConstraints(max_length=base.LONGEST_NAME, strip_whitespace=True)] = Field(
        default="", description="The disc, its side, or the place on its lining; empty if the clutch has only one"
    )
    roughness_um: PositiveNumber | None = Field(
        default=None, description="Arithmetic mean roughness R_a of the surface profile, µm"
    )
    skewness: Skewness | None = Field(
        default=None, description="Skewness R_sk of the surface profile; negative if valleys outweigh peaks"
    )
    note: Annotated[str, StringConstraints(max_length=base.LONGEST_NOTE, strip_whitespace=True)] = Field(
        default="", description="A remark"
    )
    origin: Origin = "measured"

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if self.roughness_um is None and self.skewness is None and not self.note:
            raise ValueError(
                "give roughness_um, skewness or a note; photographs are then sent to the inspection's /photographs"
            )
        return self


class PhotographOut(Answer):
    """A photograph of an inspection; its file is at `/photographs/{photograph_id}` below the inspection."""

    photograph_id: str = Field(description="The photograph's name: the SHA-256 of its bytes")
    media_type: MediaType = Field(description="The type of its file")
    bytes: int = Field(description="Length of its file")
    received_at: str = Field(description="When it was stored; UTC, ISO 8601")
    received_by: str = Field(description="Who posted it: `key:` with the key's id and note, or `local`")


class InspectionOut(Answer):
    """A stored inspection."""

    clutch_id: ClutchName
    inspection_id: str = Field(description="The inspection's name; it derives from its content")
    cycles: Real = Field(description="Duty cycles since new when the surface was inspected")
    performed_at: str | None = Field(description="When it was inspected, ISO 8601; null if not stated")
    lining: str = Field(description="The disc, its side, or the place on its lining; empty if not stated")
    roughness_um: Real | None = Field(description="Arithmetic mean roughness R_a, µm; null if not measured")
    skewness: Real | None = Field(description="Skewness R_sk of the surface profile; null if not measured")
    note: str = Field(description="The remark")
    origin: Origin
    content_sha256: str = Field(description="Hash of what was posted")
    received_at: str = Field(description="When it was stored; UTC, ISO 8601")
    received_by: str = Field(description="Who posted it: `key:` with the key's id and note, or `local`")
    state: Literal["accepted", "withdrawn"] = Field(description="`accepted`, or `withdrawn` until it is restored")
    duplicate: bool = Field(description="Whether the inspection was stored before this request")
    photographs: list[PhotographOut] = Field(description="Its photographs, in the order in which they came")


class InspectionPage(Page[InspectionOut]):
    """Inspections by cycles."""

    items: list[InspectionOut] = Field(description="The inspections of this page")
