"""Line charts as SVG, and nothing more: panels in a row, axes with round numbers, lines, points and bars of deviation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

import numpy as np

from models.arrays import FloatArray

COLOURS = ("#1f5fa8", "#c2410c", "#15803d", "#7c3aed", "#b45309", "#0e7490", "#9d174d")
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 340, 300, 62, 12, 46, 46
_LEGEND = 16
_MOST_POINTS = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """y [n] over x [n], as a line, or as points with a bar of one deviation [n] where that is given."""

    x: FloatArray
    y: FloatArray
    name: str = ""
    deviation: FloatArray | None = None
    points: bool = False
    dashed: bool = False
    colour: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One pair of axes."""

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series] = field(default_factory=tuple)
    zero: bool = False  # draw y = 0


def chart(panels: Sequence[Panel]) -> str:
    """The panels side by side."""
    legend = max(sum(bool(each.name) for each in panel.series) for panel in panels) * _LEGEND
    width, height = _WIDTH * len(panels), _HEIGHT + legend
    drawn = "".join(_panel(panel, _WIDTH * index) for index, panel in enumerate(panels))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="Helvetica, Arial, sans-serif" font-size="11" fill="#222">'
        f'<rect width="{width}" height="{height}" fill="#fff"/>{drawn}</svg>\n'
    )


def _panel(panel: Panel, left: float) -> str:
    low_x, high_x = _range([each.x for each in panel.series], None)
    wide = [each.y + sign * each.deviation for each in panel.series if each.deviation is not None for sign in (-1, 1)]
    low_y, high_y = _range([*(each.y for each in panel.series), *wide], 0.0 if panel.zero else None)
    x0, x1, y0, y1 = left + _LEFT, left + _WIDTH - _RIGHT, _HEIGHT - _BOTTOM, _TOP

    def across(x: FloatArray | float) -> FloatArray:
        return np.asarray(x0 + (np.asarray(x) - low_x) / (high_x - low_x) * (x1 - x0))

    def up(y: FloatArray | float) -> FloatArray:
        return np.asarray(y0 - (np.asarray(y) - low_y) / (high_y - low_y) * (y0 - y1))

    parts = [_text((x0 + x1) / 2, 18, panel.title, bold=True)]
    for value in _ticks(low_x, high_x):
        parts += [
            _line(across(value), y0, across(value), y1, "#ddd"),
            _text(float(across(value)), y0 + 14, f"{value:g}"),
        ]
    for value in _ticks(low_y, high_y):
        parts += [
            _line(x0, up(value), x1, up(value), "#ddd"),
            _text(x0 - 5, float(up(value)) + 4, f"{value:g}", anchor="end"),
        ]
    if panel.zero:
        parts.append(_line(x0, up(0.0), x1, up(0.0), "#888"))
    parts += [
        f'<rect x="{x0}" y="{y1}" width="{x1 - x0}" height="{y0 - y1}" fill="none" stroke="#888"/>',
        _text((x0 + x1) / 2, y0 + 32, panel.x_label),
        _text(x0 - 50, y1 - 10, panel.y_label, anchor="start"),
    ]
    named = 0
    for number, series in enumerate(panel.series):
        colour = series.colour or COLOURS[number % len(COLOURS)]
        parts.append(_series(series, colour, across(series.x), up(series.y), up))
        if series.name:
            y = _HEIGHT - 2 + named * _LEGEND
            dash = ' stroke-dasharray="5 3"' if series.dashed else ""
            parts.append(f'<path d="M{x0} {y}h22" stroke="{colour}" stroke-width="2"{dash}/>')
            parts.append(_text(x0 + 28, y + 4, series.name, anchor="start"))
            named += 1
    return "".join(parts)


def _series(series: Series, colour: str, x: FloatArray, y: FloatArray, up: object) -> str:
    if not series.points:
        keep = np.unique(np.linspace(0, x.size - 1, min(x.size, _MOST_POINTS)).astype(int))
        course = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[keep], y[keep], strict=True))
        dash = ' stroke-dasharray="5 3"' if series.dashed else ""
        return f'<polyline points="{course}" fill="none" stroke="{colour}" stroke-width="1.5"{dash}/>'
    parts = [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.6" fill="{colour}"/>' for a, b in zip(x, y, strict=True)]
    if series.deviation is not None and callable(up):
        ends = zip(x, up(series.y - series.deviation), up(series.y + series.deviation), strict=True)
        parts += [_line(a, low, a, high, colour) for a, low, high in ends]
    return "".join(parts)


def _range(values: Sequence[FloatArray], held: float | None) -> tuple[float, float]:
    known = np.concatenate([np.ravel(each) for each in values])
    low, high = float(known.min()), float(known.max())
    if held is not None:
        low, high = min(low, held), max(high, held)
    spare = 0.04 * (high - low) or max(abs(high), 1.0) * 0.04
    return low - spare, high + spare


def _ticks(low: float, high: float) -> list[float]:
    step = 10.0 ** math.floor(math.log10((high - low) / 4))
    step *= next(each for each in (1, 2, 5, 10) if (high - low) / (step * each) <= 6)
    return [round(step * number, 12) for number in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _line(x0: object, y0: object, x1: object, y1: object, colour: str) -> str:
    return f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="{colour}"/>'


def _text(x: float, y: float, text: str, *, anchor: str = "middle", bold: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{weight}>{escape(text)}</text>'
