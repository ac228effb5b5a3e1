"""Plots of a calibration of a machine of any joints: held-out readings before and after, and the unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from olp.core.arrays import Array
from olp.core.units import UM_PER_MM
from olp.reports.plots.base import Format, drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Distances that are drawn at least, in um, on a scale of decades.
_LEAST_UM = 1e-3


def held_out_plot(before_mm: Array, after_mm: Array, kind: Format = "svg") -> bytes:
    """(n,) distances of held-out readings before and after, those with the largest first."""
    order = np.argsort(-before_mm, kind="stable")
    rows = np.arange(1, len(order) + 1)

    def draw(figure: Figure) -> None:
        from matplotlib.ticker import MaxNLocator

        plot = figure.subplots()
        for off, colour, label in ((before_mm, "tab:orange", "before"), (after_mm, "tab:blue", "after")):
            shown = np.maximum(off[order] * UM_PER_MM, _LEAST_UM)
            plot.plot(rows, shown, "o", color=colour, markersize=3.5, label=label)
            plot.axhline(float(np.mean(off)) * UM_PER_MM, color=colour, linewidth=0.8, linestyle=(0, (4, 3)))
        plot.set_yscale("log")
        plot.yaxis.set_major_formatter("{x:g}")
        plot.xaxis.set_major_locator(MaxNLocator(integer=True))
        plot.set_xlabel("held-out reading, ordered by its distance before")
        plot.set_ylabel("distance in um; dashed: mean")
        plot.grid(color="0.9", linewidth=0.5)
        plot.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))

    return drawn("held-out", (8.0, 3.0), draw, kind)


def unknowns_plot(rows: Sequence[tuple[str, float, float]], kind: Format = "svg") -> bytes:
    """Unknowns by name with value and standard uncertainty in the unit that their name ends in."""
    units = [unit for unit in ("um", "urad") if any(name.endswith(f"_{unit}") for name, _, _ in rows)]

    def draw(figure: Figure) -> None:
        plots = figure.subplots(1, len(units), squeeze=False)[0]
        for plot, unit in zip(plots, units, strict=True):
            own = [row for row in rows if row[0].endswith(f"_{unit}")]
            place = np.arange(len(own))
            value, sigma = (np.array([row[k] for row in own], float) for k in (1, 2))
            plot.axvline(0.0, color="0.6", linewidth=0.6)
            plot.errorbar(
                value, place, xerr=2.0 * sigma, fmt="o", color="tab:blue", markersize=3.5, linewidth=1.0
            )
            plot.set_yticks(place, [name.removesuffix(f"_{unit}") for name, _, _ in own])
            plot.invert_yaxis()
            plot.set_xlabel(f"{unit}; bars: k = 2")
            plot.grid(color="0.9", linewidth=0.5, axis="x")

    longest = max(sum(name.endswith(f"_{unit}") for name, _, _ in rows) for unit in units)
    return drawn("unknowns", (8.0, 0.8 + 0.2 * longest), draw, kind)
