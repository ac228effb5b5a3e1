"""What every error model offers. error = actual - commanded, of the tool tip relative to the workpiece.

All positions are axis positions in mm, rows X, Y, Z; angles in rad, right-handed about +X, +Y, +Z.
A model is a value: no state, no text, no files. A sum of models is a model (`olp.errormodel.total`).

Play state: `play` is (n, 3) in [-1, 1] per axis. It is +1 where the axis last moved in + and its backlash is
taken up, -1 where the same holds in -, and 0 where it is unknown or in the middle. With a backlash of b mm an
axis adds -b/2 * play to its own position. Without `play` models give the mean of both directions.

A tool row is X, Y, Z of the tool vector in mm and, in a fourth column, the payload in kg; without that column
the payload is 0. So the payload goes with the tool wherever a tool goes.

A NaN axis position is unknown: error components that depend on that axis (`depends_on`) are NaN, the others
finite. Models never test the box; without "hold" the caller asks `inside`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from olp.core.arrays import Array, Mask


class ErrorModel(Protocol):
    """A vectorised model of the tip's position error."""

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        """(n, 3) error in mm at axis positions (n, 3) with tool rows (3,) or (n, 3), or (4,) or (n, 4)."""
        ...

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        """(n, 3) orientation error of the tool relative to the workpiece in rad, with payloads (n,) or
        one."""
        ...

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        """(name, (n, 3) mm) by source, e.g. "EXX", "ECX", "C0Y", "cyclic EXX", "backlash X"; only non-zero
        sources; their sum is the error to first order."""
        ...

    @property
    def box_mm(self) -> Array:
        """(3, 2) calibrated axis positions."""
        ...

    def inside(self, axis_mm: Array) -> Mask:
        """(n, 3) True where an axis position lies in the box, faces included; NaN does not."""
        ...

    @property
    def depends_on(self) -> Mask:
        """(3, 3): [i, j] is True where error component i changes with the position of axis j."""
        ...

    def backlash_at(self, axis_mm: Array) -> Array | None:
        """(n, 3) backlash b of each axis at its position in mm, None where no axis has any."""
        ...

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        """(n,) upper bound in mm, anywhere in the box, of how far the error along a straight move by delta_mm
        (n, 3) departs from the straight line between its values at both ends. It also holds for every move
        that is shorter along each axis, and does not depend on the moves and tools beside it."""
        ...
