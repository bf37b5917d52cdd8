"""Line charts as SVG: panels in a row with lines, points and bars of deviation; the same numbers give the same bytes."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field

from models.arrays import FloatArray

COLOURS = ("#1f5fa8", "#c2410c", "#15803d", "#7c3aed", "#b45309", "#0e7490", "#9d174d")


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
    import matplotlib as mpl  # 0.4 s for whoever draws, not for every collection

    mpl.use("svg")
    mpl.rcParams |= {"svg.hashsalt": "clutchlife", "svg.fonttype": "none", "font.size": 8}
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(panels), figsize=(3.6 * len(panels), 3.6), layout="constrained", squeeze=False)
    for axis, panel in zip(axes[0], panels, strict=True):
        axis.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
        axis.grid(color="#ddd")
        if panel.zero:
            axis.axhline(0.0, color="#888", linewidth=0.8)
        for number, each in enumerate(panel.series):
            colour, dashes = each.colour or COLOURS[number % len(COLOURS)], "--" if each.dashed else "-"
            line = "none" if each.points else dashes
            style = {"marker": "o" if each.points else "", "markersize": 4, "color": colour, "label": each.name or None}
            axis.errorbar(each.x, each.y, each.deviation, linestyle=line, **style)
        if any(each.name for each in panel.series):
            axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), frameon=False)
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    plt.close(figure)
    return drawn.getvalue()
