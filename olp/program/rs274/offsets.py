"""The offsets between program and axis positions, and how G52, G92 and G10 change them.

axis position = turn (program position + shift (G92) + local (G52)) + work offset + tool length, in mm. A work
offset may be turned about Z, and a transform of the program (G68, G51, G51.1) turns its positions before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import ZERO, Vector
from olp.core.toolpath import Interpolated
from olp.core.turns import Turn, about_z, rows_of, turned
from olp.core.values import dataclass
from olp.program.frames import Placement, product
from olp.program.frames import turned as turned_vector


def _zeros() -> list[float]:
    return [0.0] * 3


@dataclass(frozen=True, slots=True)
class Transform:
    """A rotation, scaling or mirror image that the program switches on with `code`: a point w becomes `about`
    + `turn` (w - `about`), in mm. It moves the `axes`."""

    code: int
    turn: Turn
    about: Vector
    axes: tuple[int, ...]

    def shift(self) -> Array:
        """(3,) by how much the zero of the program is moved."""
        about = np.array(self.about)
        return np.asarray(about - np.array(self.turn) @ about)


@dataclass(slots=True)
class Offsets:
    """The offsets in force, in mm. `name` is the work offset, `written` are those that the program has
    written, by name, and `turned_deg` their angles about Z. `shift` is that of G92, `saved` its stored value,
    `local` that of G52, `length` that of the tool. `transform` is that of the program. `plane` is a
    tilted one, below it and the shifts. `tip` and `directed` are as in `Frame`."""

    name: str
    written: dict[str, list[float]] = field(default_factory=dict)
    turned_deg: dict[str, float] = field(default_factory=dict)
    shift: list[float] = field(default_factory=_zeros)
    saved: list[float] = field(default_factory=_zeros)
    local: list[float] = field(default_factory=_zeros)
    length: Vector = ZERO
    transform: Transform | None = None
    plane: Placement | None = None
    tip: Interpolated = ""
    directed: bool = False

    def stated(self) -> tuple[Any, ...]:
        """All that is in force, as a key: where it is equal, so are offsets and turns."""
        return (
            self.name, tuple(self.written.get(self.name, ())), self.turned_deg.get(self.name),
            *self.shift, *self.local, self.length, self.transform, self.plane, self.tip, self.directed,
        )  # fmt: skip

    def turn(self, angle_deg: float) -> Turn | None:
        """How words are turned, with a work offset at this angle; None where they are not."""
        inner = None if self.transform is None else self.transform.turn
        if self.plane is not None:
            inner = product(self.plane.turn, inner)
        if inner is None:
            return rows_of(about_z(angle_deg)) if angle_deg else None
        return rows_of(about_z(angle_deg) @ np.array(inner))

    def total(self, work: Sequence[float], angle_deg: float) -> Vector:
        """Axis position of the zero of the program, with this work offset (3,) at this angle."""
        if not angle_deg and self.transform is None and self.plane is None:
            x, y, z = (work[i] + self.shift[i] + self.local[i] + self.length[i] for i in range(3))
            return (x, y, z)
        inner = [s + o for s, o in zip(self.shift, self.local, strict=True)]
        if self.transform is not None:
            inner = [i + float(m) for i, m in zip(inner, self.transform.shift(), strict=True)]
        if self.plane is not None:
            inside = turned_vector(self.plane.turn, (inner[0], inner[1], inner[2]))
            inner = [i + p for i, p in zip(inside, self.plane.shift_mm, strict=True)]
        if angle_deg:
            inner = (about_z(angle_deg) @ inner).tolist()
        length = ZERO if self.plane is not None else self.length
        x, y, z = (work[i] + inner[i] + length[i] for i in range(3))
        return (x, y, z)

    def work_at(self, axis: int, position: float, value: float) -> float:
        """The work offset that makes an axis position the program position `value` (G10 L20); it is not
        turned."""
        return position - self.length[axis] - self.shift[axis] - self.local[axis] - value

    def preset(
        self, values: dict[int, float], position: Sequence[float], work: Sequence[float], angle_deg: float
    ) -> None:
        """Shift so that an axis position (3,) becomes the program position `values` by axis (G92)."""
        inner = [position[i] - work[i] - self.length[i] for i in range(3)]
        if angle_deg:
            inner = turned(about_z(-angle_deg), np.array([inner]))[0].tolist()
        for axis, value in values.items():
            self.shift[axis] = inner[axis] - self.local[axis] - value

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
