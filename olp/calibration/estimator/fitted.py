"""The result of an adjustment: the errors of a machine with their covariance, and all residuals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from olp.calibration.estimator.basis import Step
from olp.calibration.estimator.beside import block_of
from olp.calibration.estimator.normal import Block
from olp.calibration.estimator.parameters import CROSS, LEVER_ARM_MM, Parameters, frame_columns, turned_by
from olp.calibration.estimator.prior import Prior
from olp.calibration.iso230.conventions import AXES_OF, LEAN
from olp.calibration.observations.base import Outlier, Result, S, ScatteredState, State
from olp.calibration.observations.measurements import Measurements
from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.quality import Fitted, Quality

#: Positions along a line from which its mean slope is taken.
_ALONG = 41


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """theta with its covariance and layout; see `error`, `sigma`, `design`. `results` are those of all
    observations.

    The gauge takes the mean slopes of straightness on lines through the datum as squareness. `box_mm` (3, 2)
    is what the lines covered.
    `cyclic_unobservable` says by component why a period was not fitted.
    """

    measurements: Measurements
    parameters: Parameters
    theta: Array
    covariance: Array
    prior: Prior
    results: tuple[Result[Any], ...]
    outliers: tuple[Outlier, ...]
    box_mm: Array
    chi_square: float
    freedom: float
    cyclic_unobservable: Mapping[tuple[str, float], str]

    def of(self, kind: type[S]) -> tuple[Result[S], ...]:
        """The results of a kind of state, such as LineState."""
        return tuple(result for result in self.results if isinstance(result.state, kind))

    @property
    def scattered(self) -> tuple[Result[ScatteredState], ...]:
        """The results of readings all over the volume."""
        return tuple(result for result in self.results if isinstance(result.state, ScatteredState))

    @property
    def misfit(self) -> float:
        """By how many standard deviations chi-square is above what noise gives."""
        return self.quality.total.deviations

    @property
    def quality(self) -> Quality:
        """How well the readings fit, in all and by file or instrument."""
        sums: dict[str, tuple[float, float]] = {}
        for result in self.results:
            chi_square, freedom = sums.get(result.state.label, (0.0, 0.0))
            sums[result.state.label] = (chi_square + result.chi_square, freedom + result.freedom)
        sources = (Fitted(label, *figures) for label, figures in sums.items() if label)
        return Quality(Fitted("all readings", self.chi_square, self.freedom), tuple(sources))

    def block(self, state: State) -> Block:
        """The readings of a state at the solution. Raises ConfigError or CannotCompute."""
        return block_of(state, self.theta, self.parameters, self.prior.hidden)

    def design(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        """(n, 3, size) dependence of the error on theta. It is in the frame of the machine where some points
        were measured in it, else in the gauge of the datum. On lines through the datum X then has no mean
        slope, nor has Y towards Z."""
        position = np.atleast_2d(np.asarray(axis_mm, float))
        table = self.parameters.design(position, np.asarray(tool_mm, float), play)
        if self.parameters.framed:
            return table
        arm = position + tool_mm - np.array(self.parameters.datum_mm)
        return np.asarray(table + turned_by(self.parameters.turn, arm))

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        """(n, 3) estimated error in mm, to first order."""
        return np.asarray(self.design(axis_mm, tool_mm, play) @ self.theta)

    def sigma(self, axis_mm: Array, tool_mm: Array) -> Array:
        """(n, 3) standard uncertainty of `error` in mm."""
        position, tool = np.atleast_2d(np.asarray(axis_mm, float)), np.asarray(tool_mm, float)
        rows = self.design(position, tool)
        variance = np.einsum("nik,kl,nil->ni", rows, self.covariance, rows, optimize=True)
        return np.asarray(np.sqrt(np.maximum(variance + self.hidden(position, tool), 0.0)))

    def hidden(self, axis_mm: Array, tool_mm: Array) -> Array:
        """(n, 3) variance of `error` in mm^2 that the covariance does not hold: what lies between targets."""
        variance = np.zeros(axis_mm.shape)
        for name in self.parameters.spaces:
            axis = AXES.index(name[2])
            between = self.between_targets(name, axis_mm[:, axis])
            if not between.any():
                continue
            if name[1] in AXES:
                variance[:, AXES.index(name[1])] += between
                continue
            for i, a, k, _ in CROSS:
                if "ABC"[a] == name[1]:
                    variance[:, i] += between * self.parameters.lever_arm(i, axis, k, axis_mm, tool_mm) ** 2
        return variance

    def between_targets(self, name: str, q: Array) -> Array:
        """(n,) variance of a component at q (n,) that its unknowns do not hold: what the cells of its spline
        hide, and steps, whose position between two targets is unknown. A step of height J lies before q with
        probability u, so it is J^2 u (1 - u)."""
        space = self.parameters.spaces[name]
        raw = space.gauge @ self.theta[self.parameters.slices[name]]
        total = self.prior.hidden[name].at(q)
        if name not in self.prior.shapes:
            return total
        for feature, jump in zip(space.features, raw[space.spline.count :], strict=True):
            if isinstance(feature, Step):
                u = feature.values(q)
                total += jump**2 * u * (1.0 - u)
        return total

    def curve(self, name: str, q: Array) -> Array:
        """(n, size) mean of a component at q (n,) on its own line, in the gauge of the datum, without cyclic
        terms, as functionals of theta."""
        rows = np.zeros((len(q), self.parameters.size))
        rows[:, self.parameters.slices[name]] = self.parameters.spaces[name].values(q)
        if name in self.parameters.slopes:
            axis = AXES.index(name[2])
            rows -= (q - self.parameters.datum_mm[axis])[:, None] * self.parameters.slopes[name]
        if self.parameters.framed:
            rows += self._of_frame(name, q)
        return rows

    def _of_frame(self, name: str, q: Array) -> Array:
        """(n, size) what the frame adds to a component: its shift to X, its turn to straightness, and that
        of the tool to the angles of the axis that bears it."""
        rows = np.zeros((len(q), self.parameters.size))
        start, axis = self.parameters.slices["frame"].start, AXES.index(name[2])
        if name[1] not in AXES:
            if not self.parameters.after(axis):
                rows[:, start + 6 + "ABC".index(name[1])] = 1.0 / LEVER_ARM_MM
            return rows
        row = AXES.index(name[1])
        if not self.parameters.after(axis):
            # its angles count from the tool of its line
            tool = np.array([self.parameters.measuring_lines[name].tool_mm])
            rows[:, start + 6 : start + 9] = frame_columns(tool)[0, row, 3:]
        if axis == 0:
            rows[:, start + row] = 1.0
        if row != axis:
            # the turn that the gauge removed is added again
            k = 3 - row - axis
            sign = 1.0 if (axis - k) % 3 == 1 else -1.0
            turn = -self.parameters.turn[k]
            turn[start + 3 + k] += 1.0 / LEVER_ARM_MM
            rows += sign * (q - self.parameters.datum_mm[axis])[:, None] * turn
        return rows

    def squareness(self, name: str) -> Array:
        """(size,) a squareness in the gauge of the datum, as functional of theta."""
        functional = np.zeros(self.parameters.size)
        functional[self.parameters.slices[name]] = 1.0
        first, second, sign = {
            "C0Y": ("EXY", "EYX", -1.0),
            "B0Z": ("EXZ", "EZX", 1.0),
            "A0Z": ("EYZ", "EZY", -1.0),
        }[name]
        return np.asarray(
            functional + sign * (self.parameters.slopes[first] + self.parameters.slopes[second])
        )

    def squareness_at(self, name: str, place_mm: Array, tool_mm: Array) -> Array:
        """(size,) the squareness of lines through an axis position (3,), over the box and with a tool vector
        (3,), as functional of theta: what a square would show there. Angles of the axes are in it."""
        earlier, later = AXES_OF[name]
        total = np.zeros(self.parameters.size)
        for along, across in ((earlier, later), (later, earlier)):
            low, high = self.box_mm[along].tolist()
            q = np.linspace(low, high, _ALONG)
            position = np.tile(np.asarray(place_mm, float), (_ALONG, 1))
            position[:, along] = q
            weight = (q - q.mean()) / float(((q - q.mean()) ** 2).sum())
            total += weight @ self.design(position, tool_mm)[:, across]
        return LEAN[name] * total
