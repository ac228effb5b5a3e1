"""Residual errors with compensation tables in the control, next to those of a corrected program.

Points of a Latin hypercube over the calibrated box, each approached from a random side, with every tool in
turn; and points along a program, where the directions are those of its motion.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.calibration.control_tables.controls import Control, RealTime, Uncompensated
from olp.compensation.dead_band import follow
from olp.compensation.invert import invert
from olp.core.arrays import Array
from olp.core.rigid_fit import fit_points
from olp.core.toolpath import Kind, Toolpath
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.reversal import play_states, plays
from olp.proof.deviation import Tracer

#: The key of the uncompensated machine in reports.
UNCOMPENSATED = "as it is"
#: The key of the model itself in the control.
REAL_TIME = "real time"
#: The key of a corrected program.
CORRECT = "olp correct"
#: mm; by which a load may be off before its drive turns, as control code starts with.
BAND_MM = 5e-5
#: Points along a program, at most.
_MOST_POINTS = 100_000


@dataclass(frozen=True, slots=True)
class Residual:
    """Distances from where the tip should be, in um: root mean square and maximum, and the root mean square
    once a best-fit rigid frame has been taken out, as a work offset does in practice."""

    rms_um: float
    max_um: float
    rms_in_frame_um: float

    def as_dict(self) -> dict[str, float]:
        return {"rms_um": self.rms_um, "max_um": self.max_um, "rms_in_frame_um": self.rms_in_frame_um}


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Nominal axis positions (n, 3), tool vectors (3,) or (n, 3), and directions of the last
    motion (n, 3); `path` says that the points follow each other, `counted` (n,) which of them count."""

    points_mm: Array
    tool_mm: Array
    direction: Array
    path: bool = False
    counted: np.ndarray | None = None


def in_box(box_mm: Array, tools_mm: Array, count: int, seed: int) -> Samples:
    """A Latin hypercube over a box (3, 2), the tools (k, 3) in turn, the sides at random."""
    random = np.random.default_rng(seed)
    cells = np.array([random.permutation(count) for _ in range(3)]).T
    share = (cells + random.random((count, 3))) / count
    points = box_mm[:, 0] + share * (box_mm[:, 1] - box_mm[:, 0])
    direction = random.choice([-1.0, 1.0], (count, 3))
    return Samples(points, np.resize(tools_mm, (count, 3)), direction)


def along(path: Toolpath, box_mm: Array, chain: str, step_mm: float = 1.0) -> Samples:
    """Points along the moves of a program whose axes are all known; cutting moves count."""
    still = build(Calibration(machine="", box_mm=box_mm), chain, outside="hold")
    length = float(np.nansum(np.sqrt(((path.end_mm - path.starts_mm()) ** 2).sum(axis=1))))
    points, move = Tracer.trace(path, still, max(step_mm, length / _MOST_POINTS))
    known = np.isfinite(points).all(axis=1)
    points, move = points[known], move[known]
    tool = path.tool_mm()
    direction = play_states(points, np.zeros(3))
    counted = np.isin(path.kind[move], (Kind.LINE, Kind.ARC_CW, Kind.ARC_CCW))
    return Samples(points, tool if tool.ndim == 1 else tool[move], direction, True, counted)


def residuals_by(
    model: ErrorModel, controls: Mapping[str, Control], samples: Samples, increment_mm: Array | None = None
) -> dict[str, Residual]:
    """The residuals by name: of the uncompensated machine, with each control's tables and, where
    `increment_mm` (3,) is given, with corrected commands that are rounded to it."""
    residuals = {}
    for name, control in {UNCOMPENSATED: Uncompensated(), **controls}.items():
        direction = samples.direction
        if isinstance(control, RealTime) and samples.path:
            direction = _sides(model, samples)
        command = samples.points_mm + control.offset(samples.points_mm, samples.tool_mm, direction)
        residuals[name] = _residual(model, command, samples)
    if increment_mm is not None:
        play = _play(model, samples.points_mm, samples)
        command = invert(model, samples.points_mm, samples.tool_mm, play)
        residuals[CORRECT] = _residual(model, np.round(command / increment_mm) * increment_mm, samples)
    return residuals


def _sides(model: ErrorModel, samples: Samples) -> Array:
    """(n, 3) the sides of the backlash that bring the loads of the axes to points which follow each other."""
    load = invert(model, samples.points_mm, samples.tool_mm)
    width = model.backlash_at(load)
    if width is None:
        return samples.direction
    return np.stack([follow(load[:, j], width[:, j], BAND_MM)[0] for j in range(3)], axis=1)


def _play(model: ErrorModel, command: Array, samples: Samples) -> Array | None:
    return plays(model, command) if samples.path else samples.direction


def _residual(model: ErrorModel, command: Array, samples: Samples) -> Residual:
    actual = command + model.error(command, samples.tool_mm, _play(model, command, samples))
    wanted = samples.points_mm
    if samples.counted is not None:
        actual, wanted = actual[samples.counted], wanted[samples.counted]
    if not len(wanted):
        return Residual(0.0, 0.0, 0.0)
    distance = np.sqrt(((actual - wanted) ** 2).sum(axis=1)) * UM_PER_MM
    framed = fit_points(actual, wanted)(actual) - wanted
    return Residual(_rms(distance), float(distance.max()), _rms(np.sqrt((framed**2).sum(axis=1)) * UM_PER_MM))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
