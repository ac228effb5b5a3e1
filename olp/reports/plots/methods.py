"""The picture of methods of calibration: what each leaves at independent points, and the time it takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from olp.reports.plots.base import Format, drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Colour of a method.
_BAR = "#9fb8cc"
#: Colour of the method to use.
_USED = "#1f6fb2"
#: Width of the picture in inches.
_WIDTH = 7.4
#: Height of a row in inches.
_ROW = 0.32
#: Height of what is around the rows, in inches.
_AROUND = 1.0


def methods(rows: Sequence[Mapping[str, Any]], use: str, noise_um: float, kind: Format = "svg") -> bytes:
    """Bars of the residual (um rms) of each row of the report, on a logarithmic scale.

    A tick is where the method states its own uncertainty, a dashed line is at the noise of the points. The
    time stands behind each bar.
    """

    def draw(figure: Figure) -> None:
        plot = figure.subplots()
        level = np.arange(len(rows))[::-1]
        residual = np.array([row["residual_um"] for row in rows])
        colours = [_USED if row["name"] == use else _BAR for row in rows]
        plot.barh(level, residual, 0.7, color=colours)
        for y, row in zip(level, rows, strict=True):
            if row["stated_um"] is not None:
                plot.plot([row["stated_um"]] * 2, [y - 0.35, y + 0.35], color="0.1", linewidth=1.4)
            hours = [row[key] for key in ("machine_h", "set_up_h") if row[key] is not None]
            words = f" {row['residual_um']:.3g} um" + (f", {sum(hours):.1f} h" if hours else "")
            plot.text(row["residual_um"], y, words, va="center", fontsize=7)
        if noise_um > 0.0:
            plot.axvline(noise_um, color="0.4", linestyle="--", linewidth=0.8)
        marks = [*residual.tolist(), noise_um, *(row["stated_um"] or 0.0 for row in rows)]
        shown = [mark for mark in marks if mark > 0.0]
        plot.set(xscale="log", xlim=(0.5 * min(shown), 8.0 * max(shown)))
        plot.xaxis.set_major_formatter("{x:g}")
        plot.set_yticks(level, [row["name"] for row in rows])
        plot.set_xlabel(
            "residual at independent points, um rms\ntick: stated uncertainty; dashed: noise of the points"
        )

    return drawn("methods", (_WIDTH, _AROUND + _ROW * len(rows)), draw, kind)
