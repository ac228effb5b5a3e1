"""The picture of a motion over time: four plots above each other, as SVG or PNG bytes."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from olp.core.errors import UsageError
from olp.core.optional import require_matplotlib
from olp.reports.plots.base import Format

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def end_of(duration_s: float, from_s: float, to_s: float | None) -> float:
    """Where a span of a motion ends, s. Raises UsageError where it is empty."""
    end = duration_s if to_s is None else min(to_s, duration_s)
    if not 0.0 <= from_s < end:
        raise UsageError(
            f"there is no motion to draw from {from_s:g} to {end:g} s; the trajectory takes "
            f"{duration_s:.3f} s"
        )
    return end


def motion_picture(
    title: str, span: tuple[float, float], kind: Format, draw: Callable[[Sequence[Axes]], None], *, names: int
) -> bytes:
    """The bytes of a picture whose plots (4,) `draw` fills: speeds, velocity, acceleration and jerk. The
    first two name what they show, up to `names` beside each other.

    The same plots give the same bytes.
    """
    require_matplotlib()
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "olp", "svg.fonttype": "none", "font.size": 8.0}):
        figure = Figure(figsize=(11.0, 8.0), layout="constrained")
        plots = figure.subplots(4, 1, sharex=True)
        draw(plots)
        for plot in plots:
            plot.grid(color="0.9", linewidth=0.5)
            plot.set_axisbelow(True)
            plot.margins(x=0.0)
        for plot in plots[:2]:
            plot.legend(frameon=False, ncols=names, loc="lower right", bbox_to_anchor=(1.0, 0.98))
        plots[3].set_xlabel("time in s")
        plots[3].set_xlim(*span)
        # a name may hold a $
        figure.suptitle(title, parse_math=False)
        buffer = io.BytesIO()
        metadata = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(buffer, format=kind, dpi=130, metadata=metadata)
    return buffer.getvalue()
