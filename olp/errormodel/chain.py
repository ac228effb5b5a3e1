"""The rigid-body model of all 24 serial chains: the exact product of the bodies' matrices, in blocks.

A body of the tool side maps x to q + shear + E + S x with S = Rz Ry Rx. A body that carries the
workpiece is the inverse of its table's motion: its own rotation comes last, S = Rx Ry Rz, and turns its
coordinate too. Only departures from the nominal position are summed, so no digits cancel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.interpolation import Column
from olp.core.values import dataclass
from olp.errormodel.bodies import Body
from olp.errormodel.boxed import Boxed, as_points, as_tool, by_tool
from olp.errormodel.chain_bound import AxisBound, axis_bounds, chord_bound
from olp.errormodel.components import Six
from olp.errormodel.lever_arms import CROSS

#: Points at a time: about the size of the second-level cache (1 MB); measured best of 2k to 32k.
BLOCK = 16384
#: Bounds of the chord are kept for so many tool vectors.
_KEPT = 1 << 10

#: A turn about axis a moves coordinate p toward q: (p, q) by axis.
_PLANES = ((1, 2), (2, 0), (0, 1))

Three = list[Column | None]


@dataclass(frozen=True, slots=True, eq=False)
class RigidBody(Boxed):
    """`bodies` from tool to workpiece. With `exact` False the model is its linearisation; with `tool_terms`
    False the tool vector is taken as zero (the paper's equation)."""

    bodies: tuple[Body, ...]
    exact: bool = True
    tool_terms: bool = True
    _bounds: dict[bytes, list[AxisBound]] = field(default_factory=dict, init=False, repr=False)

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        points = as_points(axis_mm)
        tool = as_tool(tool_mm, len(points))
        states = None if play is None else as_points(play, "play")
        # column by column where the points lie so
        result = np.empty_like(points)
        for start in range(0, len(points), BLOCK):
            part = slice(start, start + BLOCK)
            position, unknown = self._positions(points[part])
            arms = self._arms(tool, part)
            moved = None if states is None else states[part]
            for i, value in enumerate(self._block(position, arms, moved)):
                result[part, i] = 0.0 if value is None else value
            if unknown is not None:
                result[part][unknown @ self.depends_on.T] = np.nan
        return result

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        points = as_points(axis_mm)
        states = None if play is None else as_points(play, "play")
        position, unknown = self._positions(points)
        result = np.zeros(points.shape)
        for body in self.bodies:
            moved = None if states is None else states[:, body.axis]
            six = body.components.evaluate(position[body.axis], moved)
            for a, angle in enumerate(six[3:]):
                if angle is None:
                    continue
                if unknown is not None and body.components.varies[3 + a]:
                    angle = np.where(unknown[:, body.axis], np.nan, angle)
                result[:, a] += angle
        return result

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        points = as_points(axis_mm)
        states = None if play is None else as_points(play, "play")
        position, unknown = self._positions(points)
        hidden = None if unknown is None else unknown @ self.depends_on.T
        tool = self._arms(as_tool(tool_mm, len(points)), slice(None))
        for body in sorted(self.bodies, key=lambda b: b.axis):
            lever_arms = [(rows, lever_arm.at(position, tool)) for rows, lever_arm in body.lever_arms]
            moved = None if states is None else states[:, body.axis]
            for name, six in body.components.sources(position[body.axis], moved):
                value = _columns(_first_order(six, lever_arms), len(points))
                if np.any(value != 0.0):
                    yield name, _hide(value, hidden)
            for i, name in ((0, "C0Y" if body.axis == 1 else "B0Z"), (1, "A0Z")):
                value = np.zeros(points.shape)
                value[:, i] = body.shear[i] * (position[body.axis] - body.datum_mm)
                if np.any(value != 0.0):
                    yield name, _hide(value, hidden)

    @property
    def depends_on(self) -> Mask:
        depends = np.zeros((3, 3), dtype=np.bool_)
        for body in self.bodies:
            depends = self._depends_after(body, depends)
        return depends

    def backlash_at(self, axis_mm: Array) -> Array | None:
        points = as_points(axis_mm)
        position, unknown = self._positions(points)
        by_axis = {b.axis: b.components.backlash_at(position[b.axis]) for b in self.bodies}
        if all(backlash is None for backlash in by_axis.values()):
            return None
        result = np.zeros(points.shape)
        for j, backlash in by_axis.items():
            if backlash is not None:
                result[:, j] = backlash
                if unknown is not None and isinstance(backlash, np.ndarray):
                    result[unknown[:, j], j] = np.nan
        return result

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        delta = as_points(delta_mm, "delta_mm")
        bound = np.zeros(len(delta))
        for rows, tool in by_tool(as_tool(tool_mm, len(delta)) if self.tool_terms else np.zeros(3)):
            bounds = self._bounds.get(tool.tobytes())
            if bounds is None:
                if len(self._bounds) > _KEPT:
                    self._bounds.clear()
                bounds = axis_bounds(self.bodies, self.box_mm, tool[None], second_order=self.exact)
                self._bounds[tool.tobytes()] = bounds
            bound[rows] = chord_bound(bounds, delta[rows])
        return bound

    def _positions(self, points: Array) -> tuple[list[Array], Mask | None]:
        """Finite columns of positions, and (n, 3) where they are unknown; None where all are known."""
        unknown = None
        if np.isnan(np.min(points, initial=0.0)):
            unknown = np.isnan(points)
            points = np.where(unknown, self.box_mm[:, 0], points)
        columns = [np.ascontiguousarray(points[:, k]) for k in range(3)]
        if self.hold:
            # as `clamped`, but column by column, which is faster
            box = self.box_mm.tolist()
            columns = [np.clip(column, *ends) for column, ends in zip(columns, box, strict=True)]
        return columns, unknown

    def _arms(self, tool: Array, part: slice) -> list[Column]:
        if not self.tool_terms:
            return [0.0, 0.0, 0.0]
        if tool.ndim == 1:
            return [float(t) for t in tool]
        return [np.ascontiguousarray(tool[part, k]) for k in range(3)]

    def _block(self, position: list[Array], tool: list[Column], play: Array | None) -> Three:
        error: Three = [None, None, None]
        for body in self.bodies:
            q = position[body.axis]
            components = body.sines if body.sines is not None and self.exact else body.components
            six = components.evaluate(q, None if play is None else play[:, body.axis])
            shift: Three = [None if s == 0.0 else s * (q - body.datum_mm) for s in body.shear]
            turned: Three = [None, None, None]
            if any(angle is not None for angle in six[3:]):
                if self.exact:
                    carried = (
                        [_sum(error[i], shift[i]) for i in range(3)] if body.carries_workpiece else error
                    )
                    turned = self._turn(body, six, position, tool, carried)
                else:
                    lever_arms = [(rows, lever_arm.at(position, tool)) for rows, lever_arm in body.lever_arms]
                    turned = _first_order((None, None, None, *six[3:]), lever_arms)
            error = [_added(_added(error[i], six[i]), _added(shift[i], turned[i])) for i in range(3)]
        return error

    def _turn(self, body: Body, six: Six, position: list[Array], tool: list[Column], carried: Three) -> Three:
        """(S - I)(lever arm + carried), each row with its own lever arm; angles as the body states them."""
        terms = body.sine_terms if body.sines is None else 1
        angles = [(a, *_sine(angle, terms)) for a, angle in enumerate(six[3:]) if angle is not None]
        if body.carries_workpiece:
            angles.reverse()
        turned: Three = [None, None, None]
        for rows, lever_arm in body.lever_arms:
            arm = lever_arm.at(position, tool)
            for k, more in enumerate(carried):
                if more is not None:
                    arm[k] += more
            moved = _rotate(angles, arm)
            for i in rows:
                turned[i] = moved[i]
        return turned

    def _depends_after(self, body: Body, depends: Mask) -> Mask:
        """Dependence of the error once `body` is added; follows the same products as `_block`."""
        own = np.arange(3) == body.axis
        varies = body.components.varies
        variation = body.components.variation
        result = depends.copy()
        for i in range(3):
            if varies[i] or body.shear[i] != 0.0:
                result[i] |= own
        for rows, lever_arm in body.lever_arms:
            arm = np.diag(lever_arm.moves)
            present = np.array(lever_arm.moves) | self.tool_terms
            turned = np.zeros((3, 3), dtype=np.bool_)
            if self.exact:
                carried = arm | depends
                if body.carries_workpiece:
                    carried |= np.outer(np.array(body.shear) != 0.0, own)
                for a in (2, 1, 0) if body.carries_workpiece else (0, 1, 2):
                    if variation[3 + a] is None:
                        continue
                    pair = list(_PLANES[a])
                    # all that either of them carries, so also what earlier turns gave them
                    both = carried[pair].any(axis=0) | (own & varies[3 + a])
                    turned[pair] = carried[pair] = both
            else:
                for i, a, k, _ in CROSS:
                    if variation[3 + a] is not None and present[k]:
                        turned[i] |= arm[k] | (own & varies[3 + a])
            for i in rows:
                result[i] |= turned[i]
        return result


def _first_order(six: Six, lever_arms: list[tuple[tuple[int, ...], list[Column]]]) -> Three:
    """E + eps x lever arm, each row with its own lever arm."""
    value: Three = list(six[:3])
    for rows, lever_arm in lever_arms:
        for i, a, k, sign in CROSS:
            angle = six[3 + a]
            if i in rows and angle is not None:
                value[i] = _sum(value[i], sign * (angle * lever_arm[k]))
    return value


def _sine(angle: Column, terms: int) -> tuple[Column, Column]:
    """sin(angle) and -tan(angle / 2): by series of so many terms, which the body chose, or exactly (0)."""
    if terms == 0:
        return np.sin(angle), np.tan(-0.5 * angle)
    if terms == 2:
        third = angle * angle
        third *= angle
        third *= 1.0 / 6.0
        angle = angle - third
    return angle, -0.5 * angle


def _rotate(angles: list[tuple[int, Column, Column]], arm: list[Column]) -> Three:
    """(S - I) arm for the turns (axis, sin, -tan of half) in their order, as exact plane rotations. The
    columns of `arm` are changed."""
    moved: Three = [None, None, None]
    for turn, (a, sine, half) in enumerate(angles, 1):
        p, q = _PLANES[a]
        aside = half * arm[p]
        aside -= arm[q]
        aside *= sine
        back = half * arm[q]
        back += arm[p]
        back *= sine
        needed = {i for later, _, _ in angles[turn:] for i in _PLANES[later]}
        for i, more in ((p, aside), (q, back)):
            if i in needed:
                arm[i] += more
            done = moved[i]
            if done is None:
                moved[i] = more
            else:
                done += more
                moved[i] = done
    return moved


def _sum(a: Column | None, b: Column | None) -> Column | None:
    if a is None:
        return b
    return a if b is None else a + b


def _added(a: Column | None, b: Column | None) -> Column | None:
    """The sum of columns that are needed no more."""
    if a is None or b is None:
        return b if a is None else a
    a += b
    return a


def _columns(three: Three, n: int) -> Array:
    result = np.zeros((n, 3))
    for i, value in enumerate(three):
        if value is not None:
            result[:, i] = value
    return result


def _hide(value: Array, hidden: Mask | None) -> Array:
    return value if hidden is None else np.where(hidden, np.nan, value)
