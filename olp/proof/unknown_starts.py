"""How far the tip may be off where a feed move starts at a place that is not known along some axis."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import TargetRows
from olp.core.arrays import Array, Index, all_in_row, any_in_row
from olp.core.toolpath import Kind, Toolpath
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays
from olp.errormodel.sampling import steps_needed

Single = npt.NDArray[np.float32]

#: Steps over the box at most in which an unknown axis is tried, and two of them.
_MOST_PROBES = (1 << 10, 1 << 7)


class UnknownStarts:
    """The starts of the nominal moves of a path, as `measure` has them."""

    def __init__(
        self,
        nominal: Toolpath,
        target: TargetRows,
        path: Toolpath,
        groups: Index,
        model: ErrorModel,
        bend: float,
    ) -> None:
        self.nominal, self.target, self.path, self.groups = nominal, target, path, groups
        self.model, self.bend = model, bend

    def block(self, a: int, b: int, worst: Single) -> None:
        """Raise the largest deviations of nominal moves a..b. A feed move may start where an axis is unknown:
        how far the tip may be off there in the others, the largest over the box of the unknown axis. What an
        unknown play changes is not part of it."""
        nominal = self.nominal
        start = nominal.starts_mm(a, b)
        unknown = np.isnan(start)
        if not unknown.any():
            return
        some = any_in_row(unknown & ~np.isnan(self.target[a:b])) & ~all_in_row(unknown)
        some &= nominal.kind[a:b] != Kind.RAPID
        for i in np.flatnonzero(some).tolist():
            meant = start[i] + self.target[a + i] - nominal.end_mm[a + i]
            first = int(self.groups[a + i - 1]) + 1 if a + i else 0
            if first < len(self.path):
                worst[i] = np.fmax(worst[i], self._largest(first, np.isfinite(start[i]), meant))

    def _largest(self, move: int, known: npt.NDArray[np.bool_], meant: Array) -> float:
        """How far the tip may be from where it is `meant` (3,), along axes that are `known` (3,), before a
        move of the path; NaN where these are not known there."""
        path, model = self.path, self.model
        command = path.starts_mm(move, move + 1)[0]
        if not np.isfinite(command[known]).all():
            return np.nan
        box, tool = np.array(model.box_mm), path.tool_mm(move, move + 1)
        most = _MOST_PROBES[int((~known).sum()) - 1]
        span = np.where(known, 0.0, box[:, 1] - box[:, 0])
        # where the error bends, and not only at the corners of the box
        steps = int(steps_needed(model, span[None], tool, self.bend, at_least=8, at_most=most)[0])
        ranges = [
            command[axis : axis + 1] if known[axis] else np.linspace(low, high, steps + 1)
            for axis, (low, high) in enumerate(box.tolist())
        ]
        point = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 3)
        play = self._plays
        play = None if play is None else np.broadcast_to(play[max(move - 1, 0)], point.shape)
        away = point + model.error(point, tool, play) - meant
        return float(np.sqrt(np.nansum(away[:, known] ** 2, axis=1)).max())

    @cached_property
    def _plays(self) -> Array | None:
        """(m, 3) play after each move of the path, which few programs need; None without backlash."""
        return plays(self.model, self.path.end_mm)
