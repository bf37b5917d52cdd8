"""How a drawn file fares: read, suggested rightly or wrongly, asked for, or read with wrong numbers in silence."""

from collections.abc import Mapping
from enum import StrEnum

import numpy as np

from models.arrays import FloatArray
from service.api.rig import Suggestion
from service.errors import InvalidError
from service.readers.read_file import read_file, reading_of
from service.runs.upload import read_file_run
from tests.lab.files.writers import Drawn

#: Relative to a column's largest value: what four decimals and a factor of a unit lose.
_CLOSE = 2e-3
_NEEDED = ("pressure_bar", "speed_rpm", "torque_nm")


class Verdict(StrEnum):
    """What became of a file."""

    READ = "read"
    SUGGESTED = "suggested rightly"
    SUGGESTED_WRONGLY = "suggested wrongly"
    ASKED = "refused without a suggestion"
    WRONG = "wrong in silence"


def judged(file: Drawn) -> tuple[Verdict, str]:
    """The verdict on a file that is sent with its kind and cycles, and what was said."""
    try:
        run = read_file_run(file.path, filename=file.path.name, kind=file.kind, cycles=0.0)  # type: ignore[arg-type]
    except InvalidError as error:
        if not isinstance(error.suggestion, Suggestion):
            return Verdict.ASKED, error.detail[:200]
        try:
            wrong = difference(confirmed(file, error.suggestion), file.truth)
        except InvalidError as refused:
            wrong = refused.detail
        said = f"{wrong}; {error.suggestion.map}; {error.detail[:120]}"
        return (Verdict.SUGGESTED_WRONGLY if wrong else Verdict.SUGGESTED), said
    wrong = difference(run.channels, file.truth)
    return (Verdict.WRONG if wrong else Verdict.READ), wrong


def confirmed(file: Drawn, suggestion: Suggestion) -> Mapping[str, FloatArray]:
    """The channels of a file that is read as suggested."""
    mapping = ",".join(f"{channel}:{title}" for channel, title in suggestion.map.items())
    options = {name: getattr(suggestion, name) for name in ("table", "time", "decimal", "missing", "good")}
    return read_file(file.path, filename=file.path.name, reading=reading_of(mapping, **options)).columns


def difference(read: Mapping[str, FloatArray], truth: Mapping[str, FloatArray]) -> str:
    """What differs between the channels as read and as they are; empty where nothing does."""
    for channel in (*_NEEDED, *(["time_s"] if "time_s" in truth else [])):
        if channel not in read:
            return f"{channel} is missing"
        found, right = read[channel], truth[channel]
        if channel == "time_s":
            found, right = found - found[0], right - right[0]
        if found.size != right.size:
            return f"{channel} has {found.size} of {right.size} rows"
        scale = float(np.abs(right).max()) or 1.0
        if not np.allclose(found, right, rtol=0, atol=_CLOSE * scale):
            return f"{channel} begins {found[:2].tolist()}, not {right[:2].tolist()}"
    oil = read.get("oil_temperature_c"), truth.get("oil_temperature_c")
    if oil[0] is not None and oil[1] is not None and not np.allclose(oil[0], oil[1], atol=0.2):
        return "the oil's temperature is another"
    return ""
