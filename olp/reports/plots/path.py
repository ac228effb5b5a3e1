"""Plots of a measured or predicted path: picture, deviation along it, histogram, circles and diagonals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from olp.comparison.figures import Run
from olp.comparison.path import Path
from olp.core.units import UM_PER_MM
from olp.reports.plots.base import drawn
from olp.reports.plots.thinned import COLUMNS, EDGES_UM, FLOOR_UM, Groups, painted, widened
from olp.reports.report import SIDES
from olp.uncertainty.spread import Confidence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

#: Colour of a group of runs.
COLOURS = {"before": "#c0453a", "after": "#1f6fb2"}
#: Colour of the nominal path.
_NOMINAL = "#9aa3ab"
#: Width of a figure, in inches.
_WIDTH = 7.4
#: Inches that labels need at the left, below, at the right and above.
_EDGES = (0.6, 0.42, 0.12, 0.28)
#: Most points that are drawn.
_DRAWN = 30_000

Runs = Mapping[str, Sequence[Run]]


def picture(path: Path, groups: Groups, sides: Mapping[str, str]) -> bytes:
    """The path in plan view; each pixel has the colour of its largest distance from the nominal path. `sides`
    labels the groups."""

    def draw(figure: Figure) -> None:
        from matplotlib import colormaps
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import LogNorm, to_rgb

        plots = figure.subplots(1, len(groups), squeeze=False)[0]
        top = max(group.largest_um for group in groups.values())
        norm = LogNorm(max(top / 300.0, FLOOR_UM), max(top, 10 * FLOOR_UM))
        canvas = next(iter(groups.values())).canvas
        ground = np.zeros((*canvas.shape, 4))
        ground[painted(path, canvas)] = (*to_rgb(_NOMINAL), 1.0)
        for plot, (name, group) in zip(plots, groups.items(), strict=True):
            image = ground.copy()
            pixels = widened(group.pixels)
            shown = pixels > 0.0
            image[shown] = colormaps["viridis"](norm(pixels[shown]))
            plot.imshow(image, extent=canvas.extent_mm, origin="lower", interpolation="nearest")
            plot.set(aspect="equal", title=sides[name], xlabel="X in mm", ylabel="Y in mm")
        beside = figure.add_axes((6.75 / _WIDTH, 0.2, 0.1 / _WIDTH, 0.65))
        bar = figure.colorbar(ScalarMappable(norm, "viridis"), cax=beside)
        bar.set_label("distance from the nominal path in um")
        _plain_decades(bar.ax.yaxis)

    span = next(iter(groups.values())).canvas.span_mm
    height = (6.0 / len(groups)) * float(span[1] / max(span[0], 1e-9)) + 0.7
    return drawn("picture", (_WIDTH, min(max(height, 1.8), 5.0)), draw, edges=(0.55, 0.4, 0.85, 0.25))


def _plain_decades(axis: Axis) -> None:
    """Numbers of a logarithmic axis as people write them."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def along(path: Path, groups: Groups, tolerance_um: float | None, sides: Mapping[str, str]) -> bytes:
    """Distance from the nominal path along it, from least to most in each column."""

    def draw(figure: Figure) -> None:
        plot = figure.subplots()
        middle = (np.arange(COLUMNS) + 0.5) * (path.length_mm / COLUMNS) / 1e3
        for name, group in groups.items():
            colour = COLOURS[name]
            plot.fill_between(
                middle, group.low, group.high, color=colour, alpha=0.35, linewidth=0, step="mid"
            )
            plot.plot(middle, group.high, color=colour, linewidth=0.7, label=f"{sides[name]}, largest")
        _tolerance(plot, tolerance_um)
        plot.set_yscale("log")
        _plain_decades(plot.yaxis)
        plot.set(xlabel="along the path in m", ylabel="distance in um", xlim=(0.0, path.length_mm / 1e3))
        plot.grid(color="0.92", linewidth=0.5)
        plot.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))

    return drawn("along", (_WIDTH, 2.4), draw, edges=_EDGES)


def _tolerance(plot: Axes, tolerance_um: float | None) -> None:
    if tolerance_um is not None:
        plot.axhline(tolerance_um, color="0.25", linewidth=0.8, linestyle=(0, (5, 3)), label="allowed")


def histogram(groups: Groups, tolerance_um: float | None, sides: Mapping[str, str]) -> bytes:
    """Histogram of the distances from the nominal path, by groups of runs."""

    def draw(figure: Figure) -> None:
        plot = figure.subplots()
        last = max(int(np.flatnonzero(group.count)[-1]) for group in groups.values()) + 1
        for name, group in groups.items():
            share, edges = group.count[:last] / group.points * 100, EDGES_UM[: last + 1]
            plot.stairs(share, edges, fill=True, alpha=0.35, color=COLOURS[name])
            plot.stairs(share, edges, color=COLOURS[name], linewidth=0.8, label=sides[name])
        if tolerance_um is not None:
            plot.axvline(tolerance_um, color="0.25", linewidth=0.8, linestyle=(0, (5, 3)), label="allowed")
        plot.set_xscale("log")
        _plain_decades(plot.xaxis)
        plot.set(xlabel="distance from the nominal path in um", ylabel="share of points in %")
        plot.grid(color="0.92", linewidth=0.5)
        plot.legend(frameon=False, loc="upper left")

    return drawn("histogram", (_WIDTH, 2.2), draw, edges=_EDGES)


def bands(confidence: Confidence) -> bytes:
    """Expected distance from the nominal point at waypoints with its band, uncorrected and corrected, along
    the program; with a part tolerance the probability of being within it, too. Of many points the least
    probable ones are shown."""

    def draw(figure: Figure) -> None:
        chances = confidence.chances
        parts = figure.subplots(2 if chances else 1, 1, sharex=True, squeeze=False)[:, 0].tolist()
        plot, bottom = parts[0], parts[-1]
        step = np.sqrt((np.diff(confidence.points.axis_mm, axis=0) ** 2).sum(axis=1))
        arc_m = np.concatenate(([0.0], np.cumsum(step))) / 1e3
        column = np.unique(np.linspace(0, len(arc_m), COLUMNS + 1).astype(int)[:-1])
        middle = arc_m[column]
        for name, deviation in (
            ("before", confidence.points.before_mm), ("after", confidence.points.after_mm)
        ):  # fmt: skip
            size = np.sqrt((deviation**2).sum(axis=1))
            high = np.maximum.reduceat(size + confidence.band_mm, column) * UM_PER_MM
            low = np.minimum.reduceat(np.maximum(size - confidence.band_mm, 0.0), column) * UM_PER_MM
            colour = COLOURS[name]
            plot.fill_between(middle, low, high, color=colour, alpha=0.3, linewidth=0, step="mid")
            expected = np.maximum.reduceat(size, column) * UM_PER_MM
            plot.plot(middle, expected, color=colour, linewidth=0.8, label=SIDES[name])
            if chances:
                least = 100.0 * np.minimum.reduceat(getattr(chances, name), column)
                bottom.plot(middle, least, color=colour, linewidth=0.8, drawstyle="steps-mid")
        if chances:
            _tolerance(plot, chances.limit_mm * UM_PER_MM)
            bottom.set(ylabel="within, %", ylim=(-3, 103))
        plot.set(ylabel="distance in um")
        plot.set_ylim(bottom=0.0)
        bottom.set(xlabel="along the waypoints in m")
        bottom.set_xlim(0.0, max(float(arc_m[-1]), 1e-6))
        for part in parts:
            part.grid(color="0.92", linewidth=0.5)
        plot.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.98))

    return drawn("bands", (_WIDTH, 3.4), draw, edges=_EDGES)


def components(path: Path, runs: Runs, sides: Mapping[str, str]) -> bytes:
    """Normal and binormal deviation of the first run of each group along the path."""

    def draw(figure: Figure) -> None:
        plots = figure.subplots(2, 1, sharex=True)
        for plot, side in zip(plots, ("normal", "binormal"), strict=True):
            for name in ("before", "after"):
                for run in runs.get(name, ())[:1]:
                    rows = np.flatnonzero(run.counted)
                    rows = rows[:: max(len(rows) // _DRAWN, 1)]
                    value = getattr(run.deviation, side)[rows] * UM_PER_MM
                    plot.plot(run.pairing.s_mm[rows] / 1e3, value, ",", color=COLOURS[name], rasterized=True)
                    plot.plot([], [], color=COLOURS[name], label=sides[name])
            plot.set_ylabel(f"{side} in um")
            plot.grid(color="0.92", linewidth=0.5)
        plots[0].legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.97))
        plots[1].set(xlabel="along the path in m", xlim=(0.0, path.length_mm / 1e3))

    return drawn("components", (_WIDTH, 3.2), draw, edges=_EDGES)


def circles(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Predicted radial deviations of circles, counter-clockwise, magnified about a common circle."""

    def draw(figure: Figure) -> None:
        plots = figure.subplots(
            1, len(rows), subplot_kw={"projection": "polar"}, gridspec_kw={"wspace": 0.4}, squeeze=False
        )[0]
        for plot, row in zip(plots, rows, strict=True):
            top = max(float(np.abs(row["before"]["radial_um"]).max()), 1.0)
            for name in ("before", "after"):
                value = np.asarray(row[name]["radial_um"])
                angle = np.linspace(0.0, 2.0 * np.pi, len(value), endpoint=False)
                plot.plot(
                    np.append(angle, 0.0),
                    np.append(value, value[0]),
                    color=COLOURS[name],
                    linewidth=1.0,
                    label=SIDES[name],
                )
            plot.plot(np.linspace(0, 2 * np.pi, 181), np.zeros(181), color="0.4", linewidth=0.6)
            plot.set_ylim(-2.5 * top, 1.3 * top)
            plot.set_yticks([-top, 0.0, top], [f"-{top:.0f}", "0", f"{top:.0f} um"], fontsize=6)
            plot.set_xticks(np.radians((0, 90, 180, 270)), ["0", "90", "180", "270"], fontsize=6)
            plot.grid(color="0.9", linewidth=0.5)
            plot.spines["polar"].set_visible(False)
            plot.set_title(f"{row['plane']}, radius {row['radius_mm']:g} mm", fontsize=8)
        plots[0].legend(frameon=False, loc="lower left", bbox_to_anchor=(-0.15, -0.12), fontsize=7)

    return drawn("circles", (_WIDTH, 2.7), draw, edges=(0.3, 0.3, 0.1, 0.4))


def diagonals(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Predicted deviation of positioning along the body diagonals, mean of both directions."""

    def draw(figure: Figure) -> None:
        plots = figure.subplots(1, len(rows), sharey=True, squeeze=False)[0]
        for plot, row in zip(plots, rows, strict=True):
            for name in ("before", "after"):
                value = row[name]["deviation_um"]
                share = np.linspace(0.02, 0.98, len(value)) * row["length_mm"]
                plot.plot(
                    share, value, ".-", color=COLOURS[name], linewidth=0.9, markersize=2.5, label=SIDES[name]
                )
            plot.axhline(0.0, color="0.5", linewidth=0.5)
            plot.set(title=row["name"], xlabel="mm")
            plot.title.set_fontsize(8)
            plot.grid(color="0.92", linewidth=0.5)
        plots[0].set_ylabel("deviation in um")
        plots[0].legend(frameon=False, fontsize=7)

    return drawn("diagonals", (_WIDTH, 2.0), draw, edges=(0.55, 0.4, 0.1, 0.25))
