"""Balls of an artefact that the machine touched in several poses, as rows of the adjustment.

The places of the balls may be unknown: they are the same in all poses, while the errors of the machine
differ. So the artefact need not be better than the machine. Only its scale has to be known from somewhere:
two balls whose places are known tell it, or a laser. A ball bar is an artefact of two balls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from typing import Any, ClassVar

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk, residuals_of
from olp.calibration.estimator.parameters import Unknowns, frame_columns
from olp.calibration.observations.base import (
    Advance,
    Alternative,
    Noise,
    Outlier,
    Scattered,
    ScatteredState,
    rms,
    slips_of,
)
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.rigid_fit import fit_points, line_of_points
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass

#: Standard deviation of a coordinate of a ball whose place is not known but for a drawing, mm.
DRAWN_MM = 1.0
#: No centre is known better than this, in mm: 1 nm.
LEAST_MM = 1e-6
#: Balls whose places change by less in a step have converged, mm: what is left acts over the turn of a pose.
STILL_MM = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Artefact(Scattered):
    """Centres of balls, touched in several poses.

    `axis_mm` (n, 3) are axis positions where the probe, at the end of `tool_mm` (n, 3) or (3,), is at the
    centre of a ball. `ball` (n,) are rows of `certificate_mm` (balls, 3): places in the frame of the
    artefact. `pose` (n,) numbers how it lay. `sigma` is the standard uncertainty of a coordinate of a centre,
    with `covariance_mm2` (n, 3, 3) of each centre their root mean square. `sigma_ball_mm` (balls,) is that of
    the certificate; 0 where the place is only as drawn. Raises ConfigError.
    """

    read_columns: ClassVar[tuple[str, ...]] = ("ball", "pose", "axis_mm")

    axis_mm: Array
    tool_mm: Array
    ball: Index
    pose: Index
    certificate_mm: Array
    sigma_ball_mm: Array
    sigma: float
    source: str = ""
    row: Index = field(default_factory=lambda: np.zeros(0, np.int64))
    covariance_mm2: Array | None = None

    def __post_init__(self) -> None:
        axis = np.atleast_2d(np.array(self.axis_mm, float))
        balls = np.atleast_2d(np.array(self.certificate_mm, float))
        columns = {
            "axis_mm": axis,
            "tool_mm": np.array(np.broadcast_to(self.tool_mm, axis.shape), float),
            "ball": np.array(self.ball, np.int64),
            "pose": np.array(self.pose, np.int64),
            "certificate_mm": balls,
            "sigma_ball_mm": np.array(np.broadcast_to(self.sigma_ball_mm, len(balls)), float),
            "row": np.array(self.row, np.int64) if len(self.row) else np.arange(1, len(axis) + 1),
        }
        if not self.sigma > 0.0:
            raise ConfigError(
                "the uncertainty of a centre is not stated; expected sigma_um", file=self.source
            )
        for number in np.unique(columns["pose"]):
            few = len(np.unique(columns["ball"][columns["pose"] == number]))
            if few < 2:
                raise ConfigError(
                    f"pose {number} has one ball; expected at least 2", file=self.source or None
                )
        once = len(np.unique(columns["pose"])) == 1
        if once and not columns["sigma_ball_mm"].all():
            raise ConfigError(
                "the artefact has one pose only and balls whose places are not known; expected more poses, "
                "turned or shifted, or the uncertainty of its certificate in sigma_certificate_um",
                file=self.source or None,
            )
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    def alternatives(self) -> Sequence[Alternative]:
        """Balls counted from the other end, swapped columns, and a certificate that is not theirs."""
        last = len(self.certificate_mm) - 1
        other = replace(self, ball=last - self.ball)
        found = [Alternative("order", "its balls are counted from the other end", other), *self.swapped()]
        if self.sigma_ball_mm.any() and len(np.unique(self.pose)) > 1:
            drawn = replace(self, sigma_ball_mm=np.zeros(len(self.certificate_mm)))
            words = "its certificate is that of another artefact, or temperature changed its length"
            found.append(Alternative("scale", words, drawn, where_off=True))
        return found

    def start(self, noise: Noise | None = None) -> ArtefactState:
        return ArtefactState(self, self.certificate_mm)


@dataclass(frozen=True, slots=True, eq=False)
class ArtefactState(ScatteredState):
    """An artefact in an adjustment, and where its balls are by the estimate so far. Three rows per centre."""

    noun = "centres of balls"
    tally = "points"
    observation: Artefact
    balls_mm: Array

    @property
    def section(self) -> str:
        return "sets_of_points"

    def block(self, parameters: Unknowns, theta: Array) -> Block:
        return artefact_block(self.observation, parameters, self.balls_mm)

    def step(self, block: Block, theta: Array) -> Advance:
        values = residuals_of(block, theta)[0][-3 * len(self.balls_mm) :].reshape(-1, 3)
        change = self.observation.certificate_mm + values - self.balls_mm
        return Advance(values, bool(np.abs(change).max() < STILL_MM))

    def slips(self, block: Block, theta: Array, settled: bool) -> Sequence[Outlier]:
        # before the balls have converged, a residual may come from them
        if not settled:
            return ()
        taken = self.observation
        # one a ball: its other centres may be off because of it
        worst: dict[int, Outlier] = {}
        for slip in slips_of(block, theta, taken.source, taken.row, "ball"):
            worst.setdefault(int(taken.ball[taken.row == slip.row][0]), slip)
        return list(worst.values())

    def moved(self, step: Advance, slips: Sequence[Outlier]) -> ArtefactState:
        taken = self.observation
        use = ~np.isin(taken.row, [slip.row for slip in slips])
        kept = replace(
            taken, axis_mm=taken.axis_mm[use], tool_mm=taken.tool_mm[use], ball=taken.ball[use],
            pose=taken.pose[use], row=taken.row[use],
            covariance_mm2=None if taken.covariance_mm2 is None else taken.covariance_mm2[use],
        )  # fmt: skip
        return ArtefactState(kept, taken.certificate_mm + step.values)

    def spread_over_rows(self, numbers: Index) -> Index:
        return np.repeat(numbers, 3)

    def row(self, residual: Array, chi_square: float) -> dict[str, Any]:
        return {
            "name": self.label,
            "points": self.count,
            "sigma_coordinate_um": self.observation.sigma * UM_PER_MM,
            "residual_um": rms(residual) * UM_PER_MM,
            "chi_square_per_coordinate": chi_square / (3 * self.count),
        }


def artefact_block(taken: Artefact, parameters: Unknowns, balls_mm: Array) -> Block:
    """The centres of an artefact, along the axes or the principal axes of each covariance. Its own unknowns
    are the small motions of each pose, and how far each ball is from its certificate. The turn of balls on
    one line about that line shows nowhere, and is none of them."""
    n, balls = len(taken.axis_mm), len(balls_mm)
    tip = taken.axis_mm + taken.tool_mm
    y = np.zeros((n, 3))
    motions: list[Array] = []
    offsets = np.zeros((n, 3, 3 * balls))
    for number in np.unique(taken.pose).tolist():
        own = np.flatnonzero(taken.pose == number)
        frame = fit_points(balls_mm[taken.ball[own]], tip[own])
        y[own] = frame(balls_mm[taken.ball[own]]) - tip[own]
        moved = np.zeros((n, 3, 6))
        moved[own] = frame_columns(tip[own] - tip[own].mean(axis=0))
        line = line_of_points(tip[own])
        if line is not None:
            across = np.linalg.svd(line[None])[2][1:].T
            moved = np.concatenate([moved[:, :, :3], moved[:, :, 3:] @ across], axis=2)
        motions.append(moved)
        off = (balls_mm - taken.certificate_mm)[taken.ball[own]]
        # what the balls are off counts from the certificate, whose uncertainty is its prior
        y[own] -= off @ frame.rotation.T
        for one, ball in zip(own.tolist(), taken.ball[own].tolist(), strict=True):
            offsets[one, :, 3 * ball : 3 * ball + 3] = -frame.rotation
    free = sum(moved.shape[2] for moved in motions)
    known = np.where(taken.sigma_ball_mm > 0.0, taken.sigma_ball_mm, DRAWN_MM)
    precision = np.concatenate([np.zeros(free), np.repeat(known**-2.0, 3)])
    rows = parameters.design(taken.axis_mm, taken.tool_mm)
    local = np.concatenate([*motions, offsets], axis=2)
    sigma = np.full((n, 3), taken.sigma)
    if taken.covariance_mm2 is not None:
        variance, across = np.linalg.eigh(taken.covariance_mm2)
        sigma, turn = np.sqrt(np.maximum(variance, LEAST_MM**2)), across.transpose(0, 2, 1)
        rows, local, y = turn @ rows, turn @ local, np.einsum("nij,nj->ni", turn, y)
    size = parameters.size
    chunk = Chunk(rows.reshape(3 * n, size), y.reshape(-1), sigma.reshape(-1), local.reshape(3 * n, -1))
    return Block.of(chunk, np.arange(size), precision, taken.source or "artefact")
