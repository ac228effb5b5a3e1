"""The offsets between program and axis positions, and how G52, G92 and G10 change them.

axis position = program position + work offset + shift (G92) + local (G52) + tool length, in mm, axis by axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass


def _zeros() -> list[float]:
    return [0.0] * 3


@dataclass(slots=True)
class Offsets:
    """The offsets in force, in mm. `name` is the work offset, `written` are those that the program has
    written, by name. `shift` is that of G92, `saved` its stored value, `local` that of G52, `length` that of
    the tool."""

    name: str
    written: dict[str, list[float]] = field(default_factory=dict)
    shift: list[float] = field(default_factory=_zeros)
    saved: list[float] = field(default_factory=_zeros)
    local: list[float] = field(default_factory=_zeros)
    length: Vector = ZERO

    def total(self, work: Sequence[float]) -> Vector:
        """Axis position less program position, with this work offset (3,)."""
        x, y, z = (work[i] + self.shift[i] + self.local[i] + self.length[i] for i in range(3))
        return (x, y, z)

    def work_at(self, axis: int, position: float, value: float) -> float:
        """The work offset that makes an axis position the program position `value` (G10 L20)."""
        return position - self.length[axis] - self.shift[axis] - self.local[axis] - value

    def preset(self, axis: int, position: float, work: Sequence[float], value: float) -> None:
        """Shift so that an axis position becomes the program position `value` (G92)."""
        self.shift[axis] = position - work[axis] - self.length[axis] - self.local[axis] - value

    def clear_shift(self, *, save: bool) -> None:
        """End the shift; `save` leaves the stored one for G92.3 (G92.2), else that is zero too (G92.1)."""
        if not save:
            self.saved = _zeros()
        self.shift = _zeros()

    def store_shift(self) -> None:
        """The stored shift is the present one (G92, and G52 where it is the same)."""
        self.saved = list(self.shift)

    def restore_shift(self) -> None:
        """The saved shift again (G92.3)."""
        self.shift = list(self.saved)
