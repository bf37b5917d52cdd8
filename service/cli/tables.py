"""Tables and numbers for a terminal."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from service.cli.options import out, print_line

#: Ends are predicted up to a million cycles (HORIZON of models.prognosis.criteria, whose numerics no command waits for).
BEYOND_HORIZON = "over 1,000,000"
UNKNOWN = "unknown"


def show_table(columns: Sequence[str], rows: Iterable[Sequence[str]], *, left: int = 1) -> None:
    """Print a table, one line per row even in a narrow terminal: `left` columns of words, then columns of numbers."""
    lines = [columns, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for place, line in enumerate(lines):
        cells = [
            cell.ljust(width) if column < left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        out.print("  ".join(cells).rstrip(), markup=False, soft_wrap=True, style="" if place else "bold")


def number(value: float | None, digits: int = 3) -> str:
    """A number with this many digits; "-" for None."""
    if value is None:
        return "-"
    return f"{value:,.0f}" if 100 <= abs(value) < 1e6 else f"{value:.{digits}g}"


def chance(value: float | None) -> str:
    """A probability in per cent, never rounded to 0 or 100 %; "-" for None."""
    if value is None:
        return "-"
    return "> 99 %" if value > 0.995 else "< 1 %" if value < 0.005 else f"{100 * value:.0f} %"


def with_deviation(value: float | None, deviation: float | None) -> str:
    """A value with its standard deviation, rounded to the deviation's second digit; "-" for None."""
    if value is None:
        return "-"
    if deviation is None or not deviation > 0.0 or not math.isfinite(deviation):
        return number(value)
    decimals = max(0, 1 - math.floor(math.log10(deviation)))
    return f"{value:,.{decimals}f} ± {deviation:,.{decimals}f}"


def coefficient(value: float, deviation: float) -> str:
    """A coefficient with its standard deviation; "-" if it is smaller than the deviation."""
    return UNKNOWN if deviation > abs(value) else with_deviation(value, deviation)


def cycles(value: float | None) -> str:
    """Duty cycles as whole numbers; null means beyond the horizon of predictions."""
    return BEYOND_HORIZON if value is None else f"{value:,.0f}"


def model_name(model: Mapping[str, Any]) -> str:
    """A model with the effects that extend it."""
    effects = ", ".join(model["effects"])
    return f"{model['name']} ({effects})" if effects else str(model["name"])


def warn(warnings: Iterable[Mapping[str, Any]]) -> None:
    for notice in warnings:
        print_line(f"warning: {notice['message']}")
