"""Contours under cutter compensation (G41, G42): what a plan of the tool's path leaves whole, and which
axes it holds.

The control makes the tool's path from the contour, and looks at the corners between its blocks. A step that
takes up backlash is a block with corners, and shorter than the cutter: the control refuses it. A word that is
inserted in a block that only moves the tool along its axis would be a corner too.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from olp.compensation.arcs import WIDE
from olp.compensation.lines import Cuts
from olp.compensation.plan import Plan
from olp.core.arrays import Index, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES, arc_points
from olp.core.toolpath import Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel


@dataclass(frozen=True, slots=True, eq=False)
class Contour:
    """(n,) `whole` moves take no further block, `steady` ones no step in front of them. (n, 3) `held`: the
    axis keeps its last command."""

    whole: Mask
    steady: Mask
    held: Mask

    @staticmethod
    def of(path: Toolpath) -> Contour | None:
        """None without cutter compensation. Raises ProgramError where a contour changes its side."""
        on = path.compensated()
        if not on.any():
            return None
        _refuse_change(path, on)
        moved = path.end_mm != path.starts_mm()
        corners = np.array([(c := f.compensation) is not None and c.corner for f in path.frames], bool)
        whole, held = corners[path.frame], np.zeros((len(path), 3), bool)
        number = path.contour_number()
        edges = np.flatnonzero(number != np.concatenate(([-1], number[:-1])))
        for a, b in pairwise([*edges.tolist(), len(path)]):
            of = path.frames[int(path.frame[a])].compensation
            if of is not None:
                plane = PLANES[of.plane][:2]
                across = moved[a:b][:, plane].any(axis=1) | np.isin(
                    path.kind[a:b], (Kind.ARC_CW, Kind.ARC_CCW)
                )
                held[a:b, plane] = ~across[:, None]
                whole[a : a + (int(across.argmax()) if across.any() else b - a) + 1] = True
        still = held.any(axis=1)
        return Contour(whole | still, on | whole | still, held)

    def source(self, rows: Plan) -> Index:
        """(r, 3) the row from which each axis has its command."""
        held = self.held[rows.move] & ~rows.raw
        order = np.broadcast_to(np.arange(len(rows))[:, None], held.shape)
        return np.asarray(np.maximum.accumulate(np.where(held, 0, order), axis=0), np.int64)

    def hold(self, rows: Plan) -> Plan:
        """The plan with its held axes at their last commands."""
        return replace(rows, command_mm=np.take_along_axis(rows.command_mm, self.source(rows), axis=0))


def long_parts(path: Toolpath, cuts: Cuts) -> Cuts:
    """The cuts of lines that leave parts longer than the cutter radius: the control turns shorter ones by
    more than their digits are worth."""
    move, share, target = cuts
    length = np.sqrt(np.square(path.end_mm[move] - path.starts_mm()[move]).sum(axis=1))
    least = path.compensated_radius_mm()[move]
    kept = np.minimum(share, 1 - share) * length >= least
    return move[kept], share[kept], target[kept]


def in_arcs(path: Toolpath, model: ErrorModel, cuts: Cuts, whole: Mask) -> Cuts:
    """The cuts of arcs, and further ones of contours.

    A control takes the radius at the end of an arc for that of all of it. A bent arc of more than half a
    circle does not have it."""
    arcs = path.arcs
    size = np.abs(arcs.sweep_rad)
    some = np.flatnonzero((size > WIDE) & (path.compensated_radius_mm()[arcs.move] > 0))
    # an arc that enters a contour stays one
    some = some[~np.isin(arcs.move[some], cuts[0]) & ~whole[arcs.move[some]]]
    if not some.size:
        return cuts
    count = np.ceil(size[some] / (0.9 * np.pi)).astype(np.int64)
    which = np.repeat(some, count)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + 1) / np.repeat(count, count)
    move = arcs.move[which]
    start = np.where((move > 0)[:, None], path.end_mm[np.maximum(move - 1, 0)], np.array(path.start_mm))
    point = arc_points(
        start, path.end_mm[move], arcs.centre_mm[which], arcs.plane[which], arcs.sweep_rad[which], share
    )
    tool = path.tool_mm()
    error = model.error(point, tool if tool.ndim == 1 else tool[move])
    bent = np.zeros(len(path), bool)
    bent[move[1:][(np.abs(error[1:] - error[:-1]).max(axis=1) > 1e-9) & (move[1:] == move[:-1])]] = True
    inner = bent[move] & (share < 1.0)
    return (
        np.concatenate((cuts[0], move[inner])), np.concatenate((cuts[1], share[inner])),
        np.concatenate((cuts[2], point[inner])),
    )  # fmt: skip


def _refuse_change(path: Toolpath, on: Mask) -> None:
    """Raise ProgramError where the side of the compensation changes within a contour: where the control
    crosses over to the other one is not known."""
    left = np.array([(c := f.compensation) is not None and c.left for f in path.frames], bool)[path.frame]
    number = path.contour_number()
    change = np.flatnonzero(on[1:] & on[:-1] & (left[1:] != left[:-1]) & (number[1:] == number[:-1])) + 1
    if change.size:
        raise ProgramError(
            "the side of the cutter compensation changes here without its end before it, and how the control "
            "goes over is not known; end it between the two contours",
            line=int(path.line[change[0]]),
            code="OLP528",
        )
