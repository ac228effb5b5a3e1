"""Contours under cutter compensation (G41, G42): what a correction leaves whole, and which axes it holds.

The control offsets the contour by the cutter radius, and looks at the corners between its blocks. A step that
takes up backlash is a block with corners, and shorter than the cutter: the control refuses it. Before the
first move along a contour and after the last one the tool stands beside it. A word that is inserted there for
an axis that the program does not move would drive the cutter into the contour.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from olp.compensation.plan import Plan
from olp.core.arrays import Index, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.toolpath import Kind, Toolpath
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Contour:
    """(n,) `whole` moves take no further block, `steady` ones no step in front of them. (n, 3) `held`: the
    axis keeps its last command. `beside` are rapids with a held axis, whose end is not on the contour."""

    whole: Mask
    steady: Mask
    held: Mask
    beside: Index

    @staticmethod
    def of(path: Toolpath) -> Contour | None:
        """None without cutter compensation. Raises ProgramError where a contour changes its side."""
        on = path.compensated()
        if not on.any():
            return None
        _refuse_change(path, on)
        moved = path.end_mm != path.starts_mm()
        whole, held = np.zeros(len(path), bool), np.zeros((len(path), 3), bool)
        edges = np.flatnonzero(on != np.concatenate(([False], on[:-1])))
        for a, b in pairwise([*edges.tolist(), len(path)]):
            of = path.frames[int(path.frame[a if on[a] else a - 1])].compensation
            assert of is not None
            plane = PLANES[of.plane][:2]
            if on[a]:
                across = moved[a:b][:, plane].any(axis=1)
                held[a:b, plane] = ~across[:, None]
                whole[a : a + _first(across) + 1] = True
            else:
                for axis in plane:
                    upto = a + _first(moved[a:b, axis])
                    held[a:upto, axis] = True
                    whole[a : min(upto + 1, b)] = True
        still = held.any(axis=1)
        beside = np.flatnonzero(still & (path.kind == Kind.RAPID))
        return Contour(whole | still, on | whole | still, held, beside)

    def source(self, rows: Plan) -> Index:
        """(r, 3) the row from which each axis has its command."""
        held = self.held[rows.move] & ~rows.raw
        order = np.broadcast_to(np.arange(len(rows))[:, None], held.shape)
        return np.asarray(np.maximum.accumulate(np.where(held, 0, order), axis=0), np.int64)

    def hold(self, rows: Plan) -> Plan:
        """The plan with its held axes at their last commands."""
        return replace(rows, command_mm=np.take_along_axis(rows.command_mm, self.source(rows), axis=0))


def _refuse_change(path: Toolpath, on: Mask) -> None:
    """Raise ProgramError where the side, plane or radius of the compensation changes within a contour: where
    the control crosses over to the other one is not known."""
    frames = path.frames
    kinds = list(dict.fromkeys(f.compensation for f in frames))
    which = np.array([kinds.index(f.compensation) for f in frames])[path.frame]
    change = np.flatnonzero(on[1:] & on[:-1] & (which[1:] != which[:-1])) + 1
    if change.size:
        raise ProgramError(
            "the side, plane or radius of the cutter compensation changes here without G40 before it, and "
            "how the control goes over is not known; program G40 between the two contours",
            line=int(path.line[change[0]]),
            code="OLP524",
        )


def _first(mask: Mask) -> int:
    """Index of the first True; the length where there is none."""
    return int(mask.argmax()) if mask.any() else len(mask)
