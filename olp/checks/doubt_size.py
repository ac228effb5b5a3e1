"""Doubts about the size of the error: at the waypoints of a program, and anywhere in the calibrated box."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from olp.checks.base import finding, lines_of
from olp.checks.doubt_units import UNMEASURABLE
from olp.core.arrays import Array, distinct_rows
from olp.core.machine import Machine
from olp.core.toolpath import Flag, Toolpath
from olp.core.units import UM_PER_MM
from olp.errormodel.base import ErrorModel
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import Finding
from olp.program.text.columns import apart, found, spans

#: Sane errors per length: 1 mm/m is five times a poor machine tool, and 667 urad of a hobby router pass.
_SHARE = 1e-3
#: mm; sane errors of a small machine, whose assembly is no better than that of a larger one.
_FLOOR_MM = 0.5
#: mm; below this diagonal of the box even sane errors are that small.
_SHORT_MM = 50.0
#: Moves that are not corrected.
_UNTOUCHED = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)
#: Positions along each axis of the box at which the error is computed.
_NODES = 5
#: Waypoints that are evaluated at once.
_CHUNK = 1 << 14


def largest_mm(machine: Machine) -> float:
    """The largest plausible error: what the machine file states, else from the diagonal of the travel."""
    stated = machine.sanity.largest_correction_mm
    return max(_SHARE * diagonal_mm(machine), _FLOOR_MM) if stated is None else stated


def diagonal_mm(machine: Machine) -> float:
    """The diagonal of the travel."""
    return float(np.linalg.norm([np.ptp(machine.axes[axis].travel_mm) for axis in "XYZ"]))


def size_doubts(
    path: Toolpath, model: ErrorModel, calibration: Calibration, machine: Machine
) -> list[Finding]:
    """Errors too large for this machine at waypoints, else in the box, or too small to be measured."""
    limit, tools = largest_mm(machine), path.tools_mm()
    # far below that everywhere, of most machines, and then no waypoint has to be looked at
    if not _most_mm(model, tools) <= limit:
        size = _at_waypoints(path, model)
        wild = found(len(size), lambda some: size[some] > limit)
        if wild.size:
            largest = float(size[wild].max()) * UM_PER_MM
            expected = f"at most {limit * UM_PER_MM:.0f} um are expected of this machine"
            what = f"the error is up to {largest:.0f} um at {len(wild)} waypoints; {expected}"
            return [finding("OLP409", what, lines_of(path, wild))]
    return box_doubts(model, tools, calibration, machine, lambda: _largest(_at_waypoints(path, model)))


def box_doubts(
    model: ErrorModel, tools_mm: Array, calibration: Calibration, machine: Machine,
    known_mm: Callable[[], float] = float,
) -> list[Finding]:  # fmt: skip
    """Errors too large anywhere in the box with one of the tool vectors (k, 3), or too small to be measured.
    `known_mm` gives the largest one that is known beside them: where it is as small."""
    limit = largest_mm(machine)
    expected = f"at most {limit * UM_PER_MM:.0f} um are expected of this machine"
    points, in_box = _in_box(model, tools_mm)
    worst, largest = int(in_box.argmax()), float(in_box.max())
    if largest > limit:
        place = ", ".join(f"{v:g}" for v in points[worst].tolist())
        what = f"calibration: the error is {largest * UM_PER_MM:.0f} um at ({place}) in the box; {expected}"
        return [finding("OLP445", what)]
    span = float(np.linalg.norm(np.ptp(model.box_mm, axis=1)))
    if largest < UNMEASURABLE * span:
        largest = max(largest, known_mm())
    if 0.0 < largest < UNMEASURABLE * span and span > _SHORT_MM and not calibration.thermal:
        what = f"calibration: the error is at most {largest * UM_PER_MM:.2g} um anywhere in the box"
        return [finding("OLP451", f"{what}; expected more than {UNMEASURABLE * span * UM_PER_MM:.2g} um")]
    return []


def _in_box(model: ErrorModel, tools_mm: Array) -> tuple[Array, Array]:
    """(m, 3) positions all over the box, and (m,) the largest error there with one of the tools (k, 3)."""
    points = _box_points(model.box_mm)
    # a program may change between few tools ten thousand times
    tools = distinct_rows(tools_mm)
    error = np.nan_to_num(np.stack([model.error(points, tool) for tool in tools]))
    return points, np.asarray(np.linalg.norm(error, axis=2).max(axis=0))


def _most_mm(model: ErrorModel, tools_mm: Array) -> float:
    """A bound of the error anywhere in the box with one of the tools (k, 3); infinite where there is
    backlash."""
    points, in_box = _in_box(model, tools_mm)
    if model.backlash_at(points) is not None:
        return float("inf")
    # from the nodes to anywhere: along X on an edge, then along Y on a face, then along Z
    step = np.diag(np.ptp(model.box_mm, axis=1) / (_NODES - 1))
    bends = [model.chord_bound(step, tool) for tool in distinct_rows(tools_mm)]
    return float(in_box.max() + np.sum(bends, axis=1).max())


def _at_waypoints(path: Toolpath, model: ErrorModel) -> Array:
    """(n,) size of the error at the end of each move, at the face of the box for those outside, 0 where it is
    not known or the move is not corrected. Half of the backlash is part of it."""
    size = apart((len(path),), np.float64)
    low, high = model.box_mm.T
    for some in spans(len(path), _CHUNK):
        place = np.clip(path.end_mm[some], low, high)
        error = np.nan_to_num(model.error(place, path.tool_mm(some.start, some.stop)))
        backlash = model.backlash_at(place)
        if backlash is not None:
            error = np.abs(error) + 0.5 * np.abs(np.nan_to_num(backlash))
        size[some] = np.sqrt(np.einsum("ij,ij->i", error, error))
        size[some][(path.flag[some] & _UNTOUCHED) != 0] = 0.0
    return size


def _largest(size: Array) -> float:
    return max((float(size[some].max()) for some in spans(len(size))), default=0.0)


def _box_points(box_mm: Array) -> Array:
    """(m, 3) positions all over the box, with its corners."""
    lines = (np.linspace(low, high, _NODES) for low, high in box_mm)
    return np.array(list(itertools.product(*lines)))
