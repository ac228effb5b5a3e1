"""Plots of measured lines: positioning after ISO 230-2, pitch, yaw and roll, bidirectional straightness,
squareness pairs, reversal, circles, and residuals of a fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from olp.calibration.iso230.ballbar import CircleFit
from olp.calibration.iso230.conventions import LEAN, angle_words
from olp.calibration.iso230.evaluation import Pair
from olp.calibration.iso230.go_return import Reversal
from olp.calibration.iso230.positioning import Evaluation, scale_of
from olp.calibration.iso230.separation import Separation
from olp.calibration.iso230.squareness import slope_of
from olp.calibration.observations.lines import Line
from olp.core.arrays import Array, Index
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.reports.plots.base import Format, drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colour of readings approached in +.
UP = "#1f6fb2"
#: Colour of readings approached in -.
DOWN = "#c0453a"
#: Colour of the mean of both.
MEAN = "0.15"
_SIDES = {1: (UP, "+"), -1: (DOWN, "-")}
#: Index of the axis about which a component turns.
_ABOUT = {"A": 0, "B": 1, "C": 2}
#: Width of a plot in inches.
_WIDTH = 7.4
#: Component curves of this many points are smooth to the eye.
_DENSE = 300


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A line and its fitted curve: (m,) positions of the curve, its value there and its standard uncertainty,
    the readings (n,) with the same zero and slope, all in mm or rad."""

    line: Line
    position_mm: Array
    value: Array
    sigma: Array
    reading: Array


def name_of_turn(component: str, vertical: str = "Z") -> str:
    """Roll, yaw or pitch for an angular component such as EBX; for the vertical axis itself tilt about the
    horizontal ones."""
    axis, about = AXES.index(component[2]), _ABOUT[component[1]]
    if about == axis:
        return "roll"
    if component[2] == vertical:
        return f"tilt about {AXES[about]}"
    return "yaw" if AXES[about] == vertical else "pitch"


def name_of_straightness(component: str, vertical: str = "Z") -> str:
    """Direction and plane of a straightness, for a component such as EZX."""
    return f"in {component[1]}, {'vertical' if component[1] == vertical else 'horizontal'}"


def positioning(evaluation: Evaluation, kind: Format = "svg") -> bytes:
    """Every reading, mean and +-2 s of both directions, the mean of both, and A, E, M, R and B as ISO 230-2
    defines them."""
    unit, scale = scale_of(evaluation.line)

    def draw(figure: Figure) -> None:
        plot, side = figure.subplots(1, 2, width_ratios=(5, 1.35))
        _both(plot, evaluation, scale)
        title = f"{evaluation.component}, {evaluation.runs} runs"
        plot.set(xlabel=f"{evaluation.line.component[2]} in mm", ylabel=f"deviation in {unit}", title=title)
        plot.legend(frameon=False, ncols=3, loc="upper left", bbox_to_anchor=(0.0, -0.13), fontsize=7)
        _figures(side, plot, evaluation, unit, scale)

    return drawn(f"positioning-{evaluation.component}", (_WIDTH, 3.3), draw, kind)


def angles(evaluations: Sequence[Evaluation], vertical: str = "Z", kind: Format = "svg") -> bytes:
    """Roll, pitch and yaw of one axis, one plot each, both directions."""
    return _stack("angles", evaluations, lambda name: name_of_turn(name, vertical), kind)


def straightness(evaluations: Sequence[Evaluation], vertical: str = "Z", kind: Format = "svg") -> bytes:
    """Straightness of one axis in both directions across it, about its reference line."""
    return _stack(
        "straightness",
        evaluations,
        lambda name: f"straightness {name_of_straightness(name, vertical)}",
        kind,
    )


def _stack(name: str, evaluations: Sequence[Evaluation], words: Callable[[str], str], kind: Format) -> bytes:
    def draw(figure: Figure) -> None:
        plots = figure.subplots(len(evaluations), 1, squeeze=False, sharex=True)[:, 0]
        for plot, evaluation in zip(plots, evaluations, strict=True):
            unit, scale = scale_of(evaluation.line)
            _both(plot, evaluation, scale)
            figures = evaluation.figures()
            keys: list[str] = [key for key in ("E", "M", "B", "R") if key in figures] or list(figures)
            values = ", ".join(f"{_symbol(key)} = {figures[key] * scale:.2f}" for key in keys)
            plot.set_title(
                f"{evaluation.component}, {words(evaluation.component)}: {values} {unit}", loc="left"
            )
            plot.set_ylabel(f"in {unit}")
        plots[-1].set_xlabel(f"{evaluations[0].component[2]} in mm")
        plots[0].legend(frameon=False, ncols=5, loc="lower right", bbox_to_anchor=(1.0, 1.08), fontsize=7)

    axis = evaluations[0].component[2]
    return drawn(f"{name}-{axis}", (_WIDTH, 0.5 + 1.65 * len(evaluations)), draw, kind)


def _both(plot: Axes, evaluation: Evaluation, scale: float) -> None:
    x = evaluation.target_mm
    plot.axhline(0.0, color="0.6", linewidth=0.6)
    plot.grid(color="0.92", linewidth=0.5)
    zero = _zero(evaluation)
    shift = _shift(evaluation)
    line = evaluation.line
    value = line.value - zero - evaluation.slope * line.target_mm
    for d, (colour, _) in _SIDES.items():
        rows = line.direction == d
        mark = "^" if d > 0 else "v"
        plot.plot(
            line.target_mm[rows], value[rows] * scale, mark, color=colour, markersize=2.8, alpha=0.45,
            markeredgewidth=0,
        )  # fmt: skip
    for side in evaluation.sides:
        colour, sign = _SIDES[side.direction]
        mean, spread = (side.mean - shift) * scale, 2.0 * side.s * scale
        plot.fill_between(x, mean - spread, mean + spread, color=colour, alpha=0.13, linewidth=0)
        plot.plot(x, mean, color=colour, linewidth=1.1, label=f"mean approached in {sign}")
        plot.plot(x, mean + spread, "--", color=colour, linewidth=0.6, label=f"$\\pm$2 s in {sign}")
        plot.plot(x, mean - spread, "--", color=colour, linewidth=0.6)
    if len(evaluation.sides) == 2:
        plot.plot(x, (evaluation.mean - shift) * scale, color=MEAN, linewidth=0.9, label="mean of both")


def _zero(evaluation: Evaluation) -> float:
    """The zero that the evaluation subtracts from the readings of a straightness, besides its slope; of other
    quantities, which have no zero, the mean of the first target."""
    line = evaluation.line
    if line.quantity != "straightness":
        return float(evaluation.mean[0])
    rest = line.value - evaluation.slope * line.target_mm
    inside = np.mean([side.mean.mean() for side in evaluation.sides])
    return float(np.mean([rest[line.direction == s.direction].mean() for s in evaluation.sides]) - inside)


def _shift(evaluation: Evaluation) -> float:
    """The offset that a plot subtracts from the means of the evaluation."""
    return 0.0 if evaluation.line.quantity == "straightness" else float(evaluation.mean[0])


def _symbol(key: str) -> str:
    base, _, rest = key.partition("_")
    return base + {"": "", "up": "↑", "down": "↓", "mean": " mean"}[rest]


def _figures(side: Axes, plot: Axes, evaluation: Evaluation, unit: str, scale: float) -> None:
    """Spans of A, E and M at the height of the plot, and all figures as a table."""
    side.set_axis_off()
    side.set(xlim=(0, 1), ylim=plot.get_ylim())
    figures = evaluation.figures()
    spans: list[tuple[str, Array]] = []
    if "A" in figures:
        means = np.array([s.mean for s in evaluation.sides])
        spread = 2.0 * np.array([s.s for s in evaluation.sides])
        ends = np.array([(means - spread).min(), (means + spread).max()])
        spans = [("A", ends), ("E", np.array([means.min(), means.max()]))]
        spans.append(("M", np.array([evaluation.mean.min(), evaluation.mean.max()])))
    for k, (name, ends) in enumerate(spans):
        x = 0.05 + 0.13 * k
        low, high = (ends - _shift(evaluation)) * scale
        side.annotate(
            "", (x, low), (x, high), arrowprops={"arrowstyle": "<->", "color": "0.3", "linewidth": 0.8}
        )
        side.text(x, high, name, ha="center", va="bottom", fontsize=8, fontweight="bold")
    rows = "\n".join(f"{_symbol(key)} = {value * scale:.2f}" for key, value in figures.items())
    side.text(0.46, 0.5, f"in {unit}\n{rows}", transform=side.transAxes, va="center", linespacing=1.5)


def squareness(pair: Pair, kind: Format = "svg") -> bytes:
    """Both straightness lines of a pair as measured, with their slopes, and the squareness, which is their
    sum."""
    reading = pair.reading

    def draw(figure: Figure) -> None:
        plots = figure.subplots(1, 2)
        total = 0.0
        for plot, line in zip(plots, (pair.first, pair.second), strict=True):
            slope = slope_of(line)
            total += slope.slope
            middle = line.target_mm.mean()
            x = np.array(slope.span_mm)
            for d, (colour, sign) in _SIDES.items():
                rows = line.direction == d
                if rows.any():
                    plot.plot(
                        line.target_mm[rows], (line.value[rows] - line.value.mean()) * UM_PER_MM, ".",
                        color=colour, markersize=3, alpha=0.5, markeredgewidth=0,
                        label=f"approached in {sign}",
                    )  # fmt: skip
            plot.plot(x, slope.slope * (x - middle) * UM_PER_MM, color=MEAN, linewidth=1.0, label="mean line")
            plot.set_title(
                f"{line.component}: slope {slope.slope / RAD_PER_URAD:+.2f} urad "
                f"($\\pm${2 * slope.sigma / RAD_PER_URAD:.2f})"
            )
            plot.set(xlabel=f"{line.component[2]} in mm", ylabel=f"in {line.component[1]}, um")
            plot.grid(color="0.92", linewidth=0.5)
        plots[0].legend(frameon=False, fontsize=7)
        square = pair.square.error_rad / RAD_PER_URAD
        factor = "" if LEAN[reading.component] > 0 else "-"
        figure.suptitle(
            f"{reading.component} = {factor}({total / RAD_PER_URAD:+.2f} - ({square:+.2f}) of the square) = "
            f"{reading.value_rad / RAD_PER_URAD:+.2f} urad "
            f"($\\pm${2 * reading.sigma_rad / RAD_PER_URAD:.2f}); "
            f"{angle_words(reading.component, reading.value_rad)}",
            fontsize=8.5,
        )

    return drawn(f"squareness-{reading.component}", (_WIDTH, 2.9), draw, kind)


def reversals(measured: Sequence[Reversal], kind: Format = "svg") -> bytes:
    """B at each target with twice its standard uncertainty, and the mean of each line."""

    def draw(figure: Figure) -> None:
        plots = figure.subplots(1, len(measured), squeeze=False)[0]
        for plot, reversal in zip(plots, measured, strict=True):
            unit, scale = scale_of(reversal.line)
            plot.axhline(0.0, color="0.6", linewidth=0.6)
            plot.errorbar(
                reversal.target_mm, reversal.at * scale, 2.0 * reversal.sigma_at * scale, fmt=".",
                color=UP, markersize=4, elinewidth=0.7, capsize=1.5,
            )  # fmt: skip
            words = "constant" if reversal.constant else "mean; depends on position"
            plot.axhline(reversal.mean * scale, color=MEAN, linewidth=0.9, label=words)
            plot.set(
                xlabel=f"{reversal.line.component[2]} in mm", ylabel=f"B in {unit}",
                title=f"{reversal.line.component}: B = {reversal.mean * scale:+.2f} {unit}",
            )  # fmt: skip
            plot.grid(color="0.92", linewidth=0.5)
            plot.legend(frameon=False, fontsize=7)

    name = "-".join(r.line.component for r in measured)
    return drawn(f"reversals-{name}", (_WIDTH, 2.4), draw, kind)


def cyclic(separation: Separation, kind: Format = "svg") -> bytes:
    """Mean and non-cyclic part along the axis, and the cyclic part over one period."""
    unit, scale = scale_of(separation.line)
    waves = separation.harmonics

    def draw(figure: Figure) -> None:
        along, over = figure.subplots(1, 2, width_ratios=(3, 2))
        along.plot(
            separation.target_mm, separation.mean * scale, ".-", color=UP, linewidth=0.6, markersize=3,
            label="mean of both",
        )  # fmt: skip
        along.plot(
            separation.target_mm, separation.noncyclic * scale, color=MEAN, linewidth=1.0, label="not cyclic"
        )
        along.set(
            xlabel=f"{separation.line.component[2]} in mm",
            ylabel=f"in {unit}",
            title=separation.line.component,
        )
        longest = max(h.period_mm for h in waves)
        dense = np.linspace(0.0, longest, _DENSE)
        part = sum((h.at(dense) for h in waves), np.zeros(_DENSE))
        over.plot(dense, part * scale, color=MEAN, linewidth=1.0)
        amplitudes = ", ".join(
            f"{h.period_mm:g} mm: {h.amplitude * scale:.2f} $\\pm$ {2 * h.sigma_amplitude * scale:.2f} {unit}"
            for h in waves
        )
        over.set(xlabel=f"position modulo {longest:g} mm")
        over.set_title(amplitudes, fontsize=7)
        for plot in (along, over):
            plot.grid(color="0.92", linewidth=0.5)
        along.legend(frameon=False, fontsize=7)

    return drawn(f"cyclic-{separation.line.component}", (_WIDTH, 2.4), draw, kind)


def circle(fit: CircleFit, kind: Format = "svg") -> bytes:
    """Radial deviations of both directions with the centre removed, and their residuals."""
    c = fit.circles

    def draw(figure: Figure) -> None:
        reading = c.value - fit.value[1] * np.cos(c.angle_rad) - fit.value[2] * np.sin(c.angle_rad)
        reading = reading - fit.value[0]
        for k, (title, value) in enumerate((("as measured", reading), ("residual of the fit", fit.residual))):
            plot = figure.add_subplot(1, 2, k + 1, projection="polar")
            top = max(float(np.abs(reading).max()), 1e-4) * UM_PER_MM
            for d, name in ((1, "counter-clockwise"), (-1, "clockwise")):
                for run in np.unique(c.run[c.direction == d]):
                    rows = (c.direction == d) & (c.run == run)
                    order = np.argsort(c.angle_rad[rows] % (2 * np.pi))
                    plot.plot(
                        c.angle_rad[rows][order], value[rows][order] * UM_PER_MM, color=_SIDES[d][0],
                        linewidth=0.8, label=name if run == c.run[c.direction == d].min() else None,
                    )  # fmt: skip
            plot.plot(np.linspace(0, 2 * np.pi, 181), np.zeros(181), color="0.4", linewidth=0.6)
            plot.set_ylim(-2.5 * top, 1.3 * top)
            plot.set_yticks([-top, 0.0, top], [f"-{top:.1f}", "0", f"{top:.1f} um"], fontsize=6)
            first, second = c.names
            plot.set_xticks(
                np.radians((0, 90, 180, 270)),
                [f"+{first}", f"+{second}", f"-{first}", f"-{second}"],
                fontsize=7,
            )
            plot.grid(color="0.9", linewidth=0.5)
            plot.spines["polar"].set_visible(False)
            plot.set_title(title, fontsize=8)
            if k == 0:
                plot.legend(frameon=False, loc="lower left", bbox_to_anchor=(-0.3, -0.16), fontsize=7)
        figure.suptitle(f"{c.plane}, radius {c.radius_mm:g} mm", fontsize=9)

    return drawn(f"circle-{c.plane}", (_WIDTH, 3.6), draw, kind)


def fitted(lines: Sequence[Fitted], kind: Format = "svg") -> bytes:
    """Readings of lines and their fitted curve, with its +-2 sigma band."""

    def draw(figure: Figure) -> None:
        for plot, item in zip(_grid(figure, len(lines)), lines, strict=False):
            unit, scale = scale_of(item.line)
            _readings(plot, item.line.target_mm, item.reading * scale, item.line.direction)
            low, high = (item.value + s * item.sigma for s in (-2.0, 2.0))
            plot.fill_between(
                item.position_mm, low * scale, high * scale, color=MEAN, alpha=0.18, linewidth=0
            )
            plot.plot(item.position_mm, item.value * scale, color=MEAN, linewidth=0.9)
            plot.set_title(f"{item.line.component} in {unit}", loc="left", fontsize=7.5)

    return drawn("fitted", _grid_size(len(lines)), draw, kind)


def residuals(lines: Sequence[tuple[Line, Array]], kind: Format = "svg") -> bytes:
    """Residuals (n,) of a fit in mm or rad, of every line."""

    def draw(figure: Figure) -> None:
        for plot, (line, residual) in zip(_grid(figure, len(lines)), lines, strict=False):
            unit, scale = scale_of(line)
            plot.axhline(0.0, color="0.5", linewidth=0.6)
            _readings(plot, line.target_mm, residual * scale, line.direction)
            rms = float(np.sqrt((residual**2).mean())) * scale
            plot.set_title(f"{line.component}: {rms:.2f} {unit} rms", loc="left", fontsize=7.5)

    return drawn("residuals", _grid_size(len(lines)), draw, kind)


def _readings(plot: Axes, x: Array, value: Array, direction: Index) -> None:
    for d, (colour, _) in _SIDES.items():
        rows = direction == d
        plot.plot(x[rows], value[rows], ".", color=colour, markersize=3.2, alpha=0.7, markeredgewidth=0)


def _grid(figure: Figure, count: int) -> list[Axes]:
    plots = list(figure.subplots(-(-count // 3), 3, squeeze=False).flat)
    for plot in plots[count:]:
        plot.set_axis_off()
    for plot in plots[:count]:
        plot.grid(color="0.92", linewidth=0.5)
        plot.tick_params(labelsize=6)
    return plots


def _grid_size(count: int) -> tuple[float, float]:
    return _WIDTH, 0.3 + 1.35 * -(-count // 3)
