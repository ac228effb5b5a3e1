"""The calibrated box that every model knows, and the one check of a caller's arrays."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index, Mask, any_in_row
from olp.core.errors import UsageError
from olp.core.values import dataclass


def as_points(axis_mm: object, name: str = "axis_mm") -> Array:
    """Rows (n, 3) of float64, whatever the number type; raises UsageError on any other shape."""
    points = np.asarray(axis_mm, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise UsageError(f"{name} has shape {points.shape}; expected (n, 3), one row X, Y, Z per point")
    return points


def as_tool(tool_mm: object, n: int) -> Array:
    """A tool vector (3,) or one per point (n, 3), without its payload; raises UsageError on any other
    shape."""
    tool = np.asarray(tool_mm, dtype=np.float64)
    if tool.shape not in ((3,), (n, 3), (4,), (n, 4)):
        raise UsageError(
            f"tool_mm has shape {tool.shape}; expected (3,) or ({n}, 3), or a fourth column with the payload"
        )
    return tool[..., :3]


def payload_of(tool_mm: object) -> Array | float:
    """The payload in kg that goes with tool rows: their fourth column, 0 where there is none."""
    tool = np.asarray(tool_mm, dtype=np.float64)
    if tool.shape[-1] < 4:
        return 0.0
    return float(tool[3]) if tool.ndim == 1 else np.ascontiguousarray(tool[:, 3])


def by_tool(tool_mm: Array) -> Iterator[tuple[slice | Index, Array]]:
    """The rows of each tool vector of tool rows (3,) or (n, 3), and the vector (3,)."""
    if tool_mm.ndim == 1:
        yield slice(None), tool_mm
    elif (tool_mm == tool_mm[:1]).all():
        yield slice(None), tool_mm[0] if len(tool_mm) else np.zeros(3)
    else:
        order = np.lexsort(tool_mm.T)
        ordered = tool_mm[order]
        first = np.flatnonzero(any_in_row(ordered[1:] != ordered[:-1])) + 1
        for a, b in pairwise((0, *first.tolist(), len(order))):
            yield order[a:b], ordered[a]


@dataclass(frozen=True, slots=True, eq=False)
class Boxed:
    """`box_mm` (3, 2). With `hold` a model is evaluated at the nearest point of the box. Without it the
    caller tests `inside`; outside its range a curve keeps its end value, so that iterations near a face
    are finite.
    """

    box_mm: Array
    hold: bool

    def inside(self, axis_mm: Array) -> Mask:
        """(n, 3) True where an axis position (n, 3) lies in the box, faces included; NaN does not."""
        points = as_points(axis_mm)
        return (points >= self.box_mm[:, 0]) & (points <= self.box_mm[:, 1])

    def clamped(self, axis_mm: Array) -> Array:
        """(n, 3) the positions at which the model is evaluated."""
        return np.clip(axis_mm, self.box_mm[:, 0], self.box_mm[:, 1]) if self.hold else axis_mm
