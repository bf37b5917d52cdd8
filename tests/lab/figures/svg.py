"""Line charts as SVG: panels in a row with lines, or points and their deviations; the same numbers give the same bytes."""

import io
from typing import Any

from models.arrays import FloatArray

COLOURS = ("#1f5fa8", "#c2410c", "#15803d", "#7c3aed", "#b45309", "#0e7490", "#9d174d")


class Chart:
    """Panels in a row, pairs of axes each; what is drawn comes into the last one that was begun."""

    def __init__(self, panels: int) -> None:
        import matplotlib as mpl  # 0.4 s for whoever draws, not for every collection

        mpl.use("svg")
        mpl.rcParams |= {"svg.hashsalt": "clutchlife", "svg.fonttype": "none", "font.size": 8}
        from matplotlib import pyplot as plt

        self.figure, axes = plt.subplots(1, panels, figsize=(3.6 * panels, 3.6), layout="constrained", squeeze=False)
        self._axes = iter(axes[0])

    def panel(self, title: str, x_label: str, y_label: str, *, zero: bool = False) -> None:
        """Begin the next one; `zero`: with a line at y = 0."""
        self.axis = next(self._axes)
        self.axis.set(title=title, xlabel=x_label, ylabel=y_label)
        self.axis.grid(color="#ddd")
        if zero:
            self.axis.axhline(0.0, color="#888", linewidth=0.8)

    def line(self, x: FloatArray, y: FloatArray, name: str = "", *, dashed: bool = False, colour: str = "") -> None:
        """y [n] over x [n]."""
        self._series(x, y, None, linestyle="--" if dashed else "-", marker="", label=name or None, color=colour)

    def points(self, x: FloatArray, y: FloatArray, deviation: FloatArray) -> None:
        """y [n] over x [n], each with a bar of one deviation [n]."""
        self._series(x, y, deviation, linestyle="none", marker="o", label=None, color="")

    def _series(self, x: FloatArray, y: FloatArray, deviation: FloatArray | None, **style: Any) -> None:
        style["color"] = style["color"] or COLOURS[len(self.axis.containers) % len(COLOURS)]
        self.axis.errorbar(x, y, deviation, markersize=4, **style)

    def drawn(self) -> str:
        from matplotlib import pyplot as plt

        for axis in self.figure.axes:
            if axis.get_legend_handles_labels()[0]:
                axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), frameon=False)
        text = io.StringIO()
        self.figure.savefig(text, format="svg", metadata={"Date": None})
        plt.close(self.figure)
        return text.getvalue()
