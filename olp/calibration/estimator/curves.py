"""From an adjustment to the calibration that corrects programs: curves on a grid fine enough for
interpolation."""

from __future__ import annotations

import datetime
import itertools
import math
from collections.abc import Callable, Mapping

import numpy as np

from olp.calibration.estimator.basis import Kink, Step
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.parameters import MeasuringLine
from olp.calibration.estimator.warming import structure_of
from olp.core.arrays import Array
from olp.core.interpolation import Interpolant
from olp.core.machine import SQUARENESS
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration, Curve, Cyclic

#: Interpolation of the grid is this close to a fitted curve of displacements: 0.02 um.
GRID_MM = 2e-5
#: The same of angles: 0.02 urad.
GRID_RAD = 2e-8
#: Cells over an axis: the fewest of these that reach it.
CELLS = (40, 80, 160, 320, 640, 1280, 2560)
#: Decimals of what is written, mm and rad: 0.1 nm, 0.1 nrad.
DIGITS = 7, 10


def calibration_of(fit: Fit, valid_until: datetime.date | None = None) -> Calibration:
    """The calibration: each displacement curve on the line where it was measured, in the gauge of the datum.

    The mean slopes of straightness on lines through the datum are in the squareness, and nowhere else.
    """
    m = fit.measurements
    curves: list[Curve] = []
    backlash = [0.0, 0.0, 0.0]
    for axis, letter in enumerate(AXES):
        directed = _directed(fit, letter)
        if not directed:
            backlash[axis] = _backlash(fit, letter)
        for (line, two_way), names in _groups(fit, letter, directed).items():
            curves.append(_curve(fit, axis, line, names, two_way))
    x, y, z = (round(value, 7) for value in backlash)
    return Calibration(
        machine=m.machine,
        box_mm=fit.box_mm,
        datum_mm=fit.parameters.datum_mm,
        curves=tuple(curves),
        squareness={name: round(float(fit.squareness(name) @ fit.theta), DIGITS[1]) for name in SQUARENESS},
        backlash_mm=(x, y, z),
        cyclic=tuple(_cyclic(fit)),
        temperature_degC=m.temperature_degC,
        measured=m.measured,
        valid_until=valid_until,
        active_during_measurement=m.active_during_measurement,
        quality=fit.quality,
        structure=structure_of(fit),
    )


def sigmas_of(fit: Fit, calibration: Calibration) -> dict[str, Array]:
    """Standard uncertainty of every component at the positions of its curve, mm or rad."""
    sigmas: dict[str, Array] = {}
    for curve in calibration.curves:
        for name in curve.names:
            sigmas[name] = np.round(sigma_of(fit, name, curve.position_mm), DIGITS[name[1] in "ABC"])
    return sigmas


def sigma_of(fit: Fit, name: str, q: Array) -> Array:
    """(n,) standard uncertainty of a component at q (n,) on its own line."""
    rows = fit.curve(name, q)
    variance = np.einsum("nk,kl,nl->n", rows, fit.covariance, rows, optimize=True)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0) + fit.between_targets(name, q)))


def half_of(fit: Fit, name: str, q: Array) -> Array:
    """(n,) half of forward minus backward of a component at q (n,)."""
    space = fit.parameters.halves.get(name)
    if space is None:
        return np.zeros(len(q))
    return np.asarray(space.values(q) @ fit.theta[fit.parameters.slices[f"half {name}"]])


def _directed(fit: Fit, letter: str) -> bool:
    """Whether an axis needs curves by direction: any reversal but a constant backlash along itself."""
    own = f"E{letter}{letter}"
    return any(
        name != own or fit.prior.shapes[name].half == "curve"
        for name in fit.parameters.halves
        if name[2] == letter
    )


def _backlash(fit: Fit, letter: str) -> float:
    return float(-2.0 * half_of(fit, f"E{letter}{letter}", fit.box_mm[AXES.index(letter), :1])[0]) + 0.0


def _groups(fit: Fit, letter: str, directed: bool) -> Mapping[tuple[MeasuringLine, bool], list[str]]:
    """Components that share a file: measured on the same line, and with or without directions."""
    groups: dict[tuple[MeasuringLine, bool], list[str]] = {}
    own = fit.parameters.measuring_lines[f"E{letter}{letter}"]
    for kind in "XYZABC":
        name = f"E{kind}{letter}"
        if kind in "ABC" and not fit.parameters.framed and not np.any(fit.theta[fit.parameters.slices[name]]):
            continue
        two_way = directed and name in fit.parameters.halves
        groups.setdefault((fit.parameters.measuring_lines.get(name, own), two_way), []).append(name)
    return groups


def _curve(fit: Fit, axis: int, line: MeasuringLine, names: list[str], two_way: bool) -> Curve:
    low, high = (float(side) for side in fit.box_mm[axis])
    features = [f for name in names for f in fit.parameters.spaces[name].features]
    breaks = {low, high}
    for feature in features:
        ends = (feature.at_mm,) if isinstance(feature, Kink) else (feature.low_mm, feature.high_mm)
        breaks.update(end for end in ends if low < end < high)
    scale = np.array([GRID_RAD if name[1] in "ABC" else GRID_MM for name in names])

    def mean(q: Array) -> Array:
        return np.stack([fit.curve(name, q) @ fit.theta for name in names], axis=1)

    def half(q: Array) -> Array:
        return np.stack([half_of(fit, name, q) for name in names], axis=1)

    def scaled(q: Array) -> Array:
        return np.concatenate([mean(q) / scale, half(q) / scale], axis=1) if two_way else mean(q) / scale

    q = _grid(scaled, sorted(breaks), linear=bool(features))
    values, differences = mean(q), half(q)

    def columns(sign: float) -> dict[str, Array]:
        return {
            name: np.round(values[:, k] + sign * differences[:, k], DIGITS[name[1] in "ABC"]) + 0.0
            for k, name in enumerate(names)
        }

    return Curve(
        axis=AXES[axis],
        position_mm=q,
        columns={} if two_way else columns(0.0),
        forward=columns(1.0) if two_way else {},
        backward=columns(-1.0) if two_way else {},
        line_mm=line.line_mm,
        tool_mm=line.tool_mm,
        interpolation="linear" if features else "pchip",
    )


def _grid(values: Callable[[Array], Array], breaks: list[float], *, linear: bool) -> Array:
    """Positions through which interpolation is within 1 of the (scaled) values everywhere."""
    span = breaks[-1] - breaks[0]
    q = np.array(breaks)
    for cells in CELLS:
        parts = [
            np.linspace(a, b, max(1, math.ceil(cells * (b - a) / span)), endpoint=False)
            for a, b in itertools.pairwise(breaks)
        ]
        q = np.unique(np.round(np.concatenate([*parts, breaks[-1:]]), 6))
        q[0], q[-1] = breaks[0], breaks[-1]
        inside = (q[:-1, None] + np.diff(q)[:, None] * np.array([0.2, 0.4, 0.5, 0.6, 0.8])).ravel()
        through = Interpolant.through(q, values(q), "linear" if linear else "pchip")
        if float(np.abs(through(inside) - values(inside)).max()) < 1.0:
            break
    return q


def _cyclic(fit: Fit) -> list[Cyclic]:
    terms = []
    for name, waves in fit.parameters.waves.items():
        pairs = fit.theta[fit.parameters.slices[f"wave {name}"]].reshape(-1, 2)
        for wave, (sine, cosine) in zip(waves, pairs, strict=True):
            size = round(math.hypot(sine, cosine), DIGITS[name[1] in "ABC"])
            terms.append(Cyclic(name, wave.period_mm, size, round(math.atan2(cosine, sine), 6)))
    return terms


def joints_of(fit: Fit, name: str) -> list[tuple[Step, float]]:
    """The steps of a component with their heights, mm or rad."""
    space = fit.parameters.spaces[name]
    raw = space.gauge @ fit.theta[fit.parameters.slices[name]]
    pairs = zip(space.features, raw[space.spline.count :], strict=True)
    return [(feature, float(height)) for feature, height in pairs if isinstance(feature, Step)]
