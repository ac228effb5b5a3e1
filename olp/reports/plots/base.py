"""Static plots: the curves of a calibration as SVG or PNG bytes."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from olp.core.interpolation import Interpolant
from olp.core.optional import require_matplotlib
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.calibration import Calibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Format = Literal["svg", "png"]
#: Inches at the left, below, at the right and above.
Edges = tuple[float, float, float, float]

#: Prefix and colour of a component by its letter, the same for every axis.
_KINDS = {
    "X": ("EX", "tab:blue"),
    "Y": ("EY", "tab:orange"),
    "Z": ("EZ", "tab:green"),
    "A": ("EA", "tab:blue"),
    "B": ("EB", "tab:orange"),
    "C": ("EC", "tab:green"),
}
#: Points of a drawn curve.
_POINTS = 400


def drawn(
    name: str, size: tuple[float, float], draw: Callable[[Figure], None], kind: Format = "svg",
    edges: Edges | None = None,
) -> bytes:  # fmt: skip
    """The bytes of a figure of `size` inches; an SVG is the element alone, for a page or a file. Its plots
    leave the `edges` free; without them the labels are drawn a second time to find what they need.

    The same data give the same bytes; ids of two plots in a page differ by their name.
    """
    require_matplotlib()
    import matplotlib
    from matplotlib.figure import Figure

    style: Any = {
        "svg.hashsalt": f"olp-{name}", "svg.fonttype": "none", "font.size": 8.0, "font.family": "sans-serif",
        "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "0.5", "axes.linewidth": 0.6,
        "xtick.color": "0.3", "ytick.color": "0.3",
    }  # fmt: skip
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size, layout=None if edges else "constrained")
        if edges:
            (left, bottom, right, top), (width, height) = edges, size
            figure.subplots_adjust(left / width, bottom / height, 1.0 - right / width, 1.0 - top / height)
        draw(figure)
        buffer = io.BytesIO()
        metadata = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(buffer, format=kind, dpi=160, metadata=metadata)
    data = buffer.getvalue()
    return data[data.index(b"<svg") :] if kind == "svg" else data


def calibration_curves(calibration: Calibration, kind: Format = "svg") -> bytes:
    """Component errors of X, Y, Z by position: um above, urad below. Measured points are dots.

    The lines are what the model interpolates; where both directions were measured, forward is solid and
    backward dashed. The same calibration gives the same bytes.
    """
    require_matplotlib()
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "olp", "svg.fonttype": "none", "font.size": 8.0}):
        figure = Figure(figsize=(11.0, 6.0), layout="constrained")
        plots = figure.subplots(2, 3, sharey="row", squeeze=False)
        for column, axis in enumerate(AXES):
            for row, (kinds, unit, scale) in enumerate(
                (("XYZ", "um", UM_PER_MM), ("ABC", "urad", 1.0 / RAD_PER_URAD))
            ):
                plot = plots[row][column]
                plot.axhline(0.0, color="0.6", linewidth=0.6)
                plot.axvline(calibration.datum_mm[column], color="0.6", linewidth=0.6)
                plot.set_ylabel(f"error in {unit}" if column == 0 else "")
                plot.set_xlabel(f"{axis} in mm" if row == 1 else "")
                plot.grid(color="0.9", linewidth=0.5)
                for letter in kinds:
                    _draw(plot, calibration, axis, letter, scale)
                if plot.get_legend_handles_labels()[0]:
                    plot.legend(frameon=False, ncols=3, loc="best")
            plots[0][column].set_title(f"axis {axis}")
        title = f"{calibration.machine}: actual minus commanded, at the measuring lines"
        # a name may hold a $
        figure.suptitle(title, parse_math=False)
        buffer = io.BytesIO()
        metadata = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(buffer, format=kind, dpi=130, metadata=metadata)
    return buffer.getvalue()


def _draw(plot: Axes, calibration: Calibration, axis: str, letter: str, scale: float) -> None:
    prefix, colour = _KINDS[letter]
    name = prefix + axis
    for curve in calibration.curves_of(axis):
        if name not in curve.names:
            continue
        x = curve.position_mm
        dense = np.linspace(x[0], x[-1], _POINTS)
        branches = (
            [(curve.columns[name], "-", name)]
            if curve.columns
            else [(curve.forward[name], "-", f"{name} +"), (curve.backward[name], "--", f"{name} -")]
        )
        for values, style, label in branches:
            between = Interpolant.through(x, values[:, None], curve.interpolation)(dense)[:, 0]
            plot.plot(dense, between * scale, style, color=colour, linewidth=1.0, label=label)
            plot.plot(x, values * scale, ".", color=colour, markersize=2.5)
