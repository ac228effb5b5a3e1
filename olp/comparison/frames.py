"""The frames that measured files state, brought into the first work frame of a program."""

from __future__ import annotations

import numpy as np

from olp.compensation.plan import zero_shifts
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import Setup
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """The frames of a program on its machine. (f, 3) `shift_mm` are the errors with which their zeros were
    touched off. A position on the machine is that of the tip without tool lengths."""

    path: Toolpath
    setup: Setup
    shift_mm: Array

    @staticmethod
    def of(path: Toolpath, model: ErrorModel, setup: Setup) -> Frames:
        return Frames(path, setup, zero_shifts(path.frames, model))

    @property
    def first(self) -> str:
        """The work offset of the first move."""
        return self.path.frames[int(self.path.frame[0])].work_offset

    def into_first(self, points_mm: Array, frame: str | None, file: str) -> Array:
        """Points (m, 3) of a file that states a frame, in the first one, as they are where it states none.
        Raises ConfigError for a frame that is not known."""
        if frame in (None, self.first):
            return points_mm
        number = int(self.path.frame[0])
        first = self.path.frames[number]
        return first.tip_mm(self._on_machine(points_mm, frame, file) - self.shift_mm[number])

    def on_machine(self, points_mm: Array, number: int) -> Array:
        """Positions on the machine of points (m, 3) of a frame of the program."""
        frame = self.path.frames[number]
        turned = points_mm if frame.turn is None else points_mm @ np.array(frame.turn).T
        return np.asarray(turned + frame.origin_mm() + self.shift_mm[number], float)

    def _on_machine(self, points_mm: Array, frame: str | None, file: str) -> Array:
        if frame == "machine":
            return points_mm
        assert frame is not None
        for number in np.unique(self.path.frame).tolist():
            if self.path.frames[number].work_offset == frame:
                return self.on_machine(points_mm, number)
        offset = self.setup.work_offset(frame)
        if offset is None or any(offset.rotation_deg):
            raise ConfigError(
                f"frame {frame!r} is not an unrotated work offset of machine or job; expected "
                f'{self.first!r} or "machine"',
                file=file,
            )
        return np.asarray(points_mm + np.array(offset.offset_mm), float)
