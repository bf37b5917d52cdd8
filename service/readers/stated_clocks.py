"""Clocks that a file states beside its values: a step, a rate or a start, with the unit in the name, the text or beside it.

A clock is used or refused, never passed over: one whose unit is not known raises when it is read.
"""

import re
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from models.arrays import FloatArray
from service.errors import MAX_QUOTED, InvalidError
from service.readers.numerals import Stamps, is_stamp
from service.readers.table import Clock
from service.readers.unit_table import conversion, spellings

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
#: What else is a rate, where it is stated in hertz; what says which of several rates that of the rows is.
_ANY_RATE = (
    r"(?:[^\W_]+_)*(?:stor(?:age|ed|ing)|sav(?:e|ed|ing)|output|export|speicher|ausgabe)_?(?:rate|frequency|frequenz)"
)
_STORED = re.compile("stor|sav|record|log|output|export|speicher|ausgabe|aufzeichn")
#: What says that not every sample is a row.
_DECIMATION = re.compile(
    r"(?:decim|dezim|thinn|down_?sampl|sub_?sampl|data_?reduc|datenreduk|間引|抽取)\D{0,30}(?:1/)?(\d+)"
)
_COUNTS = "(?:number_of_|no\\._of_|num_)?(?:samples|points)|(?:anzahl_)?(?:messwerte|messpunkte)"
_DURATIONS = r"(?:\w+_)?(?:duration|dauer|durée|duración|durata)|messzeit|(?:test|recording|measurement)_time"
_STARTS = (
    r"t0|x0|wf_start_offset|start_value|hoffset|start(?:ing)?(?:_?time)?|t_?start|(?:start|time|t)_?offset|(?:trigger_?)?delay"
    r"|begin(?:ning)?|origin_?time|startzeit|zeitversatz|offset(?=_(?:s|sec|ms|us|µs)$)"
)
#: Names of a unit, beside a value or as an end of its name.
UNITS = ("unit", "units", "unit_string", "ni_unitdescription", "yunit", "einheit")
#: The units of the abscissa, where they stand by themselves.
_X_UNITS = ("hunit", "x_unit", "xunit", "wf_xunit_string")
_SECOND = np.timedelta64(1, "s")
_HERTZ = dict.fromkeys(["", "hz", "1/s", "s-1", "s/s", "sps", "samples/s"], 1.0) | {"khz": 1e3, "ks/s": 1e3, "mhz": 1e6}
_VALUE = re.compile(r"\s*([+-]?\d+(?:[.,]\d*)?(?:[eE][+-]?\d+)?)\s*(\D*)")


def stated_clock(
    held: Mapping[str, float | str], rows: Callable[[], int], stamps: Stamps, counted: str = ""
) -> Clock | None:
    """The clock stated by names and values: start + k · step [s] for each of the rows; None if none is stated.

    A start that is a point in time counts from the first one of the file, which `stamps` knows.

    Of several rates that of what was stored is meant. Reading the clock raises InvalidError where rates differ otherwise, or
    something else says that not every sample is a row: `counted` (how a column counts samples), a decimation, a duration.
    """
    named = {"_".join(key.strip(" :=").lower().split()): value for key, value in held.items()}
    steps, rates, starts = (list(_stated(named, kind)) for kind in (_STEPS, _RATES, _STARTS))
    steps = [one for one in steps if not re.fullmatch(_COUNTED, one[2])] or ([] if rates else steps)
    if not steps + rates or not (steps + rates)[0][0] > 0:
        return None
    other_clocks = [one for one in _stated(named, _ANY_RATE) if one[1].lower() not in ("", "s-1")]
    first, ways = starts[0] if starts else (_moment(named, stamps), "", ""), [*steps, *rates, *other_clocks]

    def read() -> FloatArray:
        seconds = {one[2]: in_seconds(*one, rate=one not in steps) for one in ways if one[0] > 0}
        stored = {key: step for key, step in seconds.items() if _STORED.search(key)} or seconds
        step, slowest = next(iter(stored.values())), max(stored.values())
        against = [] if slowest - min(stored.values()) <= 1e-3 * slowest else list(stored)  # but for rounding
        against += [f"{key} = {value}" for key, value in named.items() if _is_decimation(key, value)]
        samples = next((one[0] for one in _stated(named, _COUNTS)), None)
        lasts = next((in_seconds(*one) for one in _stated(named, _DURATIONS) if one[1]), None)
        if samples == rows() and lasts and not 0.5 < lasts / (samples * step) < 2:
            against.append(f"{lasts:g} s for {samples:g} samples")
        if against or counted:
            shown = ", ".join([f"one every {step:g} s", *against, *filter(None, [counted])])[: 3 * MAX_QUOTED]
            message = f"the file states its sampling in contradictory ways: {shown}. Add a column of times"
            raise InvalidError.of(message, code="ambiguous", pointer="/time")
        return evenly(in_seconds(*first), step, rows())

    counts = bool(steps) and steps[0][:2] in ((1.0, ""), (1.0, "s")) and first[0] == 0
    return Clock((first, *ways, counted), read, counts=counts)


def _moment(named: Mapping[str, float | str], stamps: Stamps) -> float:
    """The time of the first sample, in s after the first time in the file; 0 if none is stated."""
    texts = [value.strip() for key, value in named.items() if isinstance(value, str) and re.fullmatch(_STARTS, key)]
    since = [stamps.since_first([text]) for text in texts if is_stamp(text)]
    return next((float(moment[0] / _SECOND) for moment in since if moment is not None), 0.0)


def _is_decimation(key: str, value: float | str) -> bool:
    """Whether a name says that only some of the samples were kept."""
    match = _DECIMATION.search(f"{key} {value}")
    return match is not None and float(match[1]) != 1


def evenly(start: float, step: float, rows: int) -> FloatArray:
    """Equidistant times [rows] from a start and a step."""
    return start + step * np.arange(rows, dtype=np.float64)


def _stated(named: Mapping[str, float | str], names: str) -> Iterator[tuple[float, str, str]]:
    """The numbers stored under any of the names, each with its unit ("" if none is stated) and its name."""
    for key, value in named.items():
        match = re.fullmatch(rf"(?:{names})(?:[_\[(]+(?P<unit>[^\W_]+/?[^\W_]*)[\])]?)?", key)
        text = _VALUE.fullmatch(value) if isinstance(value, str) else None
        if match is None or (isinstance(value, str) and text is None):
            continue
        unit, of_rates = match["unit"], names in (_RATES, _ANY_RATE)
        if not unit and re.fullmatch(_COUNTED, key) and not (text and text[2].strip()):
            continue
        if unit and (_HERTZ.get(unit) if of_rates else conversion("time_s", unit)) is None:
            continue
        number = float(text[1].replace(",", ".")) if text else float(value)
        unit_names = [f"{key}_{name}" for name in UNITS] + ([] if of_rates else [*_X_UNITS])
        stated = (
            unit
            or (text[2].strip() if text else "")
            or next((named[name] for name in unit_names if named.get(name)), "")
        )
        yield number, str(stated), key


def in_seconds(number: float, unit: str, key: str, *, rate: bool = False) -> float:
    """A time, or the step of a rate, in s. Raises InvalidError where its unit is not known."""
    known = None if rate else conversion("time_s", unit or "s")
    factor = _HERTZ.get(unit.lower()) if rate else None if known is None else known.factor
    if factor is None:
        allowed = "Hz, kHz, samples/s" if rate else spellings("time_s")
        message = f"the unit of {key[:MAX_QUOTED]} must be one of {allowed}, got {unit[:MAX_QUOTED]!r}"
        raise InvalidError.of(message, code="unknown_unit")
    return 1 / (number * factor) if rate else number * factor
