"""The lever arms on which the angles of an axis act.

Contribution of axis j: E_j(q) + eps_j(q) x [L_j(P, t) - L_j(P_line(q), t_line)] with L_j the tool vector plus
the axes after j toward the tool, plus axis j itself where it carries the workpiece. P_line takes the axes by
whose position the values are tabled from P, and the others from the line. So every translation component
returns its measured value at its own node, and each row has its own lever arm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from olp.core.arrays import Array
from olp.core.interpolation import Column
from olp.core.machine import ZERO, Vector
from olp.core.units import AXES
from olp.core.values import dataclass

#: Component errors of an axis in this order.
DIRECTIONS = "XYZABC"

#: The third coordinate: the lever arm of angle a on row i is coordinate _OTHER[i, a].
_OTHER = {(i, a): 3 - i - a for i in range(3) for a in range(3) if i != a}

#: First order: eps_a adds sign * eps_a * arm_k to row i, as (i, a, k, sign).
CROSS = ((0, 1, 2, 1.0), (0, 2, 1, -1.0), (1, 2, 0, 1.0), (1, 0, 2, -1.0), (2, 0, 1, 1.0), (2, 1, 0, -1.0))


class Measured(Protocol):
    """What was measured of one axis: names of components, the axes by whose position they are tabled, and
    the positions of the others, and with what tool."""

    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def arguments(self) -> tuple[str, ...]: ...
    @property
    def line_mm(self) -> Vector | None: ...
    @property
    def tool_mm(self) -> Vector: ...
    @property
    def reference(self) -> str: ...


@dataclass(frozen=True, slots=True)
class Measurement:
    """Where and with what components of one axis were measured, without their values."""

    names: tuple[str, ...]
    arguments: tuple[str, ...]
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO
    reference: str = "functional-point"


def measured_as(curves: Sequence[Measured], axis: str, stated: Mapping[str, Any]) -> tuple[Measurement, ...]:
    """How the curves of an axis were measured, with what is `stated` by name instead; where it has no curve,
    one measurement through the datum without tool."""
    own = [Measurement(c.names, c.arguments, c.line_mm, c.tool_mm, c.reference) for c in curves]
    return tuple(replace(one, **stated) for one in own or [Measurement((), (axis,))])


@dataclass(frozen=True, slots=True)
class LeverArm:
    """Coordinate k is q_k + t_k - offset_k where `moves`, t_k - offset_k elsewhere; lengths in mm."""

    moves: tuple[bool, bool, bool]
    offset_mm: Vector

    def at(self, position: list[Array], tool: list[Column]) -> list[Column]:
        """Three columns, from columns of axis positions and of the tool vector."""
        arms = [tool[k] - self.offset_mm[k] for k in range(3)]
        return [position[k] + arms[k] if self.moves[k] else arms[k] for k in range(3)]

    def reach_mm(self, box_mm: Array, tool_mm: Array) -> Array:
        """(3,) largest absolute coordinate in the box for tool vectors (m, 3)."""
        arms = tool_mm - np.array(self.offset_mm)
        moves = np.array(self.moves)[:, None]
        ends = np.where(moves, box_mm, 0.0)
        return np.asarray(np.abs(ends.T[:, None, :] + arms[None, :, :]).max(axis=(0, 1)))


LeverArms = tuple[tuple[tuple[int, ...], LeverArm], ...]


def lever_arms_of(
    curves: Sequence[Measured], datum_mm: Vector, axis: str, after: str, carries: bool, tool_terms: bool
) -> LeverArms:
    """The lever arms of what was measured of one axis; `after` are the axes behind it toward the tool."""
    holder = {name: curve for curve in curves for name in curve.names}
    default = curves[0] if len(curves) == 1 else None

    def lever_arm(sources: list[Measured | None]) -> LeverArm:
        """The lever arm of one row, coordinate by coordinate from the curve with which it was measured."""
        moves, offset = [False] * 3, [0.0] * 3
        for k, source in enumerate(sources):
            tool = source.tool_mm[k] if source is not None and tool_terms else 0.0
            own = AXES[k] == axis
            on_table = own and source is not None and source.reference == "table"
            arguments = (axis,) if source is None else source.arguments
            # An argument has no coordinate on the line; seen from a reflector on its table, it has moved from
            # the datum.
            carried = AXES[k] in after or (own and carries)
            moves[k] = carried and (on_table or AXES[k] not in arguments)
            line = None if source is None or on_table else source.line_mm
            position_mm = (datum_mm if line is None else line)[k] if moves[k] else 0.0
            offset[k] = position_mm + tool
        return LeverArm((moves[0], moves[1], moves[2]), (offset[0], offset[1], offset[2]))

    rows: dict[LeverArm, list[int]] = {}
    for i in range(3):
        measured = holder.get(f"E{AXES[i]}{axis}", default)
        # A row without a curve is zero on the lines on which the angles were measured.
        sources: list[Measured | None] = [measured] * 3
        if measured is None:
            for a, name in enumerate("ABC"):
                if a != i:
                    sources[_OTHER[i, a]] = holder.get(f"E{name}{axis}")
        rows.setdefault(lever_arm(sources), []).append(i)
    return tuple((tuple(members), lever_arm) for lever_arm, members in rows.items())
