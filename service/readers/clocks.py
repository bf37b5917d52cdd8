"""Clocks that a file states beside its values: a step, a rate or a start, with the unit in the name, the text or beside it.

A clock is used or refused, never passed over: one whose unit is not known raises when it is read.
"""

import re
from collections.abc import Callable, Mapping

import numpy as np

from models.arrays import FloatArray
from service.errors import MAX_QUOTED, InvalidError
from service.readers.table import Clock
from service.readers.unit_table import conversion

#: Names of steps beside a unit of time, and of a count or something else without.
_COUNTED = "cycle|zyklus|takt|interval|intervall|intervalo|period|サイクル"
#: What states a clock. A name may end in its unit (`dt_ms`, `Sample rate [Hz]`).
_STEPS = (
    r"dt|ts|t_s|t_?sampl(?:e|ing)|delta_?[tx]|(?:wf_|x_)?increment|(?:h|x_?)resolution|time_?step|zeitschritt|schrittweite"
    r"|(?:sampl(?:e|ing)|scan|log(?:ging)?|record(?:ing)?)_?(?:interval|time|period|cycle)|abtast(?:intervall|zeit)"
    r"|messintervall|サンプリング周期|采样(?:间隔|周期)|intervalo_de_muestreo|pas_de_temps|период_дискретизации|"
    + _COUNTED
)
_RATES = (
    r"fs|f_s|(?:sampl(?:e|ing)|scan|data|acquisition)_?(?:rate|frequency)|rate|(?:abtast|mess)(?:rate|frequenz)"
    "|frecuencia_de_muestreo|frequenza_di_campionamento|частота_дискретизации"
    "|fréquence_d['’]échantillonnage|サンプリング周波数|采样(?:频)?率"
)
_STARTS = "t0|x0|wf_start_offset|start_value|hoffset"
#: Names of a unit, beside a value or as an end of its name.
UNITS = ("unit", "units", "unit_string", "yunit", "einheit")
#: The units of the abscissa, where they stand by themselves.
_X_UNITS = ("hunit", "x_unit", "xunit", "wf_xunit_string")
_HERTZ = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "1/s": 1.0, "s/s": 1.0, "sps": 1.0, "samples/s": 1.0, "s-1": 1.0}
_VALUE = re.compile(r"\s*(\d+(?:[.,]\d*)?(?:[eE][+-]?\d+)?)\s*(\D*)")


def stated_clock(held: Mapping[str, float | str], rows: Callable[[], int]) -> Clock | None:
    """The clock among names and what they hold: start + k · step [s] for each of the rows; None where none is stated."""
    named = {"_".join(key.strip(" :=").lower().split()): value for key, value in held.items()}
    step, rate, start = (_stated(named, kind) for kind in (_STEPS, _RATES, _STARTS))
    spacing = step or rate
    if spacing is None or not spacing[0] > 0:
        return None
    first = start or (0.0, "", "")

    def read() -> FloatArray:
        seconds = _in_seconds(*step) if step else 1 / _in_hertz(*spacing)
        return evenly(_in_seconds(*first), seconds, rows())

    counts = step is not None and step[:2] in ((1.0, ""), (1.0, "s")) and first[0] == 0
    return Clock((first, step, rate), read, counts=counts)


def evenly(start: float, step: float, rows: int) -> FloatArray:
    """Times [rows] a step apart."""
    return start + step * np.arange(rows, dtype=np.float64)


def _stated(named: Mapping[str, float | str], names: str) -> tuple[float, str, str] | None:
    """The number under one of the names, its unit ("" where none is stated), and the name."""
    for key, value in named.items():
        match = re.fullmatch(rf"(?:{names})(?:[_\[(]+(?P<unit>[^\W_]+/?[^\W_]*)[\])]?)?", key)
        text = _VALUE.fullmatch(value) if isinstance(value, str) else None
        if match is None or (isinstance(value, str) and text is None):
            continue
        unit = match["unit"]
        if not unit and re.fullmatch(_COUNTED, key) and not (text and text[2].strip()):
            continue
        if unit and (_HERTZ.get(unit) if names == _RATES else conversion("time_s", unit)) is None:
            continue
        number = float(text[1].replace(",", ".")) if text else float(value)
        beside = [f"{key}_{name}" for name in UNITS] + ([] if names == _RATES else [*_X_UNITS])
        stated = (
            unit or (text[2].strip() if text else "") or next((named[name] for name in beside if named.get(name)), "")
        )
        return number, str(stated), key
    return None


def _in_seconds(number: float, unit: str, key: str) -> float:
    converted = conversion("time_s", unit or "s")
    if converted is None:
        raise _unknown(unit, key)
    return number * converted.factor


def _in_hertz(number: float, unit: str, key: str) -> float:
    factor = _HERTZ.get(unit.lower())
    if factor is None:
        raise _unknown(unit, key)
    return number * factor


def _unknown(unit: str, key: str) -> InvalidError:
    message = f"the unit of {key[:MAX_QUOTED]} must be known, got {unit[:MAX_QUOTED]!r}"
    return InvalidError.of(message, code="unknown_unit")
