"""Plots of the error motions of joints as SVG or PNG bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import UsageError
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.kinematics.errors import COMPONENTS, OWN, JointErrors
from olp.kinematics.machine import JointCalibration
from olp.kinematics.structure import Joint, Structure
from olp.reports.plots.base import Format, drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Points of a drawn curve; a cyclic error has so many a period at least.
_POINTS = 400
_PER_PERIOD = 24
_MOST_POINTS = 20_000
#: Inches of the plots of one axis, and of both rows.
_WIDTH = 3.6
_HEIGHT = 6.0
_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:blue", "tab:orange", "tab:green", "0.2")


def joint_curves(structure: Structure, calibration: JointCalibration, kind: Format = "svg") -> bytes:
    """Error motions of every axis that has curves or cyclic errors, over its calibrated values: um above,
    urad below. Measured points are dots; cyclic errors are added. The same calibration gives the same bytes.
    Raises UsageError where no axis has any."""
    errors = calibration.errors.joints
    shown = [
        joint for name, joint in structure.joints.items() if errors[name].curves or errors[name].harmonics
    ]
    if not shown:
        raise UsageError(
            "the calibration has no curves and no cyclic errors, so there is nothing to draw; its numbers "
            "are listed without --plot"
        )

    def draw(figure: Figure) -> None:
        plots = figure.subplots(2, len(shown), squeeze=False)
        for column, joint in enumerate(shown):
            _draw(plots[:, column], joint, errors[joint.name], calibration.box[joint.name])
        for row, unit in enumerate(("um", "urad")):
            plots[row][0].set_ylabel(f"error in {unit}")
        # a name may hold a $
        figure.suptitle(f"{structure.name}: actual minus commanded", parse_math=False)

    return drawn("joint-curves", (_WIDTH * len(shown) + 0.6, _HEIGHT), draw, kind)


def _draw(plots: Array, joint: Joint, errors: JointErrors, box: tuple[float, float]) -> None:
    """The two plots of one axis: each curve by itself, as its functional point is its own."""
    periods = [abs(one.period) for one in errors.harmonics]
    count = max([_POINTS, *(int(_PER_PERIOD * (box[1] - box[0]) / period) for period in periods)])
    value = np.linspace(*box, min(count, _MOST_POINTS))
    lines = [(curve.at(value), curve.values.x) for curve in errors.curves]
    if errors.harmonics:
        # those without a curve act at the point of the axis, as its first curve mostly does
        first, x = lines[0] if lines else (np.zeros((len(value), len(COMPONENTS))), np.zeros(0))
        first = np.array(first)
        for one in errors.harmonics:
            first[:, one.component] += one.at(value)
        lines[:1] = [(first, x)]
    rotary = joint.kind == "rotary"
    lengths = {0, 1, 2} | (set() if rotary else {OWN})
    for row, (plot, scale) in enumerate(zip(plots, (UM_PER_MM, 1.0 / RAD_PER_URAD), strict=True)):
        plot.axhline(0.0, color="0.6", linewidth=0.6)
        plot.grid(color="0.9", linewidth=0.5)
        for values, x in lines:
            for column, letter in enumerate(COMPONENTS):
                if (column in lengths) == (row == 0) and np.any(values[:, column]):
                    own = column == OWN
                    name = f"E{joint.name if own else letter}{joint.name}"
                    colour = _COLOURS[column]
                    plot.plot(value, values[:, column] * scale, color=colour, linewidth=1.0, label=name)
                    at = x[(x >= box[0]) & (x <= box[1])]
                    there = np.interp(at, value, values[:, column] * scale)
                    plot.plot(at, there, ".", color=colour, markersize=2.5)
        if plot.get_legend_handles_labels()[0]:
            plot.legend(framealpha=0.9, edgecolor="none", ncols=3, loc="best")
        else:
            plot.set_yticks([])
            plot.text(0.5, 0.6, "none", ha="center", transform=plot.transAxes, color="0.4")
        plot.set_xlim(*box)
    plots[0].set_title(f"axis {joint.name}", parse_math=False)
    plots[1].set_xlabel(f"{joint.name} in {joint.unit}", parse_math=False)
