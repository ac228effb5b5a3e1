"""The rows of a table of one axis: component errors where a control with linear interpolation needs them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import ROUND_CEILING, Decimal
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array
from olp.core.interpolation import Interpolant
from olp.core.machine import COMPONENTS, ZERO
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.bodies import build_bodies
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Reference
from olp.errormodel.lever_arms import LeverArm
from olp.errormodel.sources.cyclic import cyclic_value

#: Between rows a table may miss the curve by this much where its size allows, mm.
MISS_MM = 5e-5
#: The same of an angle, rad.
MISS_RAD = 5e-8
#: Rows that may stand between two positions of a curve.
_MOST_PARTS = 32
#: Rows of a table with equal steps, where nothing limits it and the positions of the curve do not fit.
_MOST_EVEN = 1001
#: Rows per period of a cyclic term, so that straight lines miss 2 % of its amplitude.
_ROWS_PER_PERIOD = 16
#: Rows of a table that follows cyclic terms, at most.
_MOST_DENSE = 10_001
#: Decimals of computed values in mm.
_MM_DECIMALS = 8
#: Decimals of computed values in rad.
_RAD_DECIMALS = 12
#: The step of tables in um, in mm.
_MICROMETRE = Decimal("0.001")


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """One component along its axis: (n,) positions in mm, and errors in both directions in mm or rad; `both`
    is False where they are the same. `miss` is the largest departure of straight lines between the rows from
    the curve, in mm or rad; `cyclic` says that the cyclic terms of the component, if any, are in the rows."""

    name: str
    position_mm: Array
    forward: Array
    backward: Array
    both: bool
    miss: float = 0.0
    cyclic: bool = True

    @property
    def mean(self) -> Array:
        """(n,) mean of both directions."""
        return self.forward if not self.both else 0.5 * (self.forward + self.backward)


def component_rows(
    calibration: Calibration, name: str, *, most: int | None = None, even: bool = False
) -> Rows | None:
    """Rows of a component as its curve states it, on its own line, with the backlash of its axis; None
    where the calibration does not hold it.

    Positions are the curve's own where straight lines between them are good enough, and more where they are
    not, or where cyclic terms have to be followed. `most` limits their number, and `even` asks for equal
    steps. Values at the curve's own positions are exact. Cyclic terms are left out where their period would
    get too few rows.
    """
    j = AXES.index(name[2])
    backlash = calibration.backlash_mm[j] if name[1] == name[2] else 0.0
    curve = next((c for c in calibration.curves if name in c.names), None)
    terms = [c for c in calibration.cyclic if c.component == name and c.amplitude]
    if curve is None:
        if not backlash and not terms:
            return None
        zeros = {name: np.zeros(2)}
        curve = Curve(name[2], np.array(calibration.box_mm[j]), zeros, interpolation="linear")
    parts = _parts(curve, name)
    good = MISS_RAD if name[1] in "ABC" else MISS_MM
    position = _positions(curve, parts, most, even, good)
    dense = _dense(position, terms, most, even)
    position = position if dense is None else dense
    miss = max(_miss(curve, part, position) for part in parts)
    values = [_values_at(curve, part, position, name) for part in parts]
    if terms and dense is not None:
        repeating = sum((cyclic_value(term, position) for term in terms), np.zeros(len(position)))
        values = [_rounded(part + repeating, name) for part in values]
    forward, backward = values[0], values[-1]
    if backlash:
        forward = _rounded(forward - 0.5 * backlash, name)
        backward = _rounded(backward + 0.5 * backlash, name)
    both = len(parts) == 2 or bool(backlash)
    return Rows(name, position, forward, backward, both, miss, not terms or dense is not None)


def _dense(position: Array, terms: Sequence[Cyclic], most: int | None, even: bool) -> Array | None:
    """Positions that follow cyclic terms as well; None where there are none, or they take too many rows."""
    if not terms:
        return None
    low, high = float(position[0]), float(position[-1])
    step = min(term.period_mm for term in terms) / _ROWS_PER_PERIOD
    count = math.ceil((high - low) / step) + 1
    limit = _MOST_DENSE if most is None else most
    if count + (0 if even else len(position)) > limit:
        return None
    if even:
        return _even(low, high, count)
    return np.unique(np.concatenate([position, _even(low, high, count)[1:-1]]))


def common_rows(calibration: Calibration, curve: Curve) -> list[Rows]:
    """Rows of the components of one curve, all at the same positions, without backlash."""
    position = _fine(calibration, [curve])
    table = []
    for name in (n for n in COMPONENTS if n in curve.names):
        terms = [c for c in calibration.cyclic if c.component == name and c.amplitude]
        rows = [component_rows(replace(calibration, backlash_mm=ZERO), name)]
        held = all(row is not None and row.cyclic for row in rows)
        values = [_values_at(curve, part, position, name) for part in _parts(curve, name)]
        if terms and held:
            repeating = sum((cyclic_value(term, position) for term in terms), np.zeros(len(position)))
            values = [_rounded(part + repeating, name) for part in values]
        miss = max(_miss(curve, part, position) for part in _parts(curve, name))
        table.append(Rows(name, position, values[0], values[-1], len(values) == 2, miss, held))
    return table


def _fine(calibration: Calibration, curves: Sequence[Curve]) -> Array:
    """Positions between which straight lines are good enough for every component of some curves."""
    still = replace(calibration, backlash_mm=ZERO)
    own = [component_rows(still, name) for curve in curves for name in curve.names]
    return np.unique(np.concatenate([rows.position_mm for rows in own if rows is not None]))


def along_axes(calibration: Calibration) -> Calibration:
    """The same without angular cyclic terms, which need their own lever arms, and with a curve of zeros for
    each component that is cyclic only."""
    cyclic = tuple(term for term in calibration.cyclic if term.component[1] in AXES)
    held = {name for curve in calibration.curves for name in curve.names}
    bare = sorted({term.component for term in cyclic} - held)
    boxes = {name: np.array(calibration.box_mm[AXES.index(name[2])]) for name in bare}
    curves = [Curve(n[2], box, {n: np.zeros(2)}, interpolation="linear") for n, box in boxes.items()]
    return replace(calibration, cyclic=cyclic, curves=(*calibration.curves, *curves))


def as_straightness(calibration: Calibration) -> Calibration:
    """The same with squareness as slopes of straightness: for a control without squareness."""
    square = calibration.squareness
    slopes = {
        "EXY": -square.get("C0Y", 0.0), "EXZ": square.get("B0Z", 0.0), "EYZ": -square.get("A0Z", 0.0)
    }  # fmt: skip
    curves = list(calibration.curves)
    for name, slope in slopes.items():
        if not slope:
            continue
        j = AXES.index(name[2])
        place = next((i for i, curve in enumerate(curves) if name in curve.names), None)
        if place is None:
            ends = np.array(calibration.box_mm[j])
            values = _rounded(slope * (ends - calibration.datum_mm[j]), name)
            curves.append(Curve(name[2], ends, {name: values}, interpolation="linear"))
            continue
        # Monotone cubics do not add up: the slope is added where straight lines stand for the curve.
        curve = curves[place]
        position = _fine(replace(calibration, cyclic=()), [curve])
        lean = slope * (position - calibration.datum_mm[j])
        sides = [
            {n: _values_at(curve, v, position, n) + (lean if n == name else 0.0) for n, v in side.items()}
            for side in (curve.columns, curve.forward, curve.backward)
        ]
        sides = [{n: _rounded(v, n) if n == name else v for n, v in side.items()} for side in sides]
        curves[place] = replace(
            curve, position_mm=position, columns=sides[0], forward=sides[1], backward=sides[2],
            interpolation="linear",
        )  # fmt: skip
    return replace(calibration, curves=tuple(curves), squareness=dict.fromkeys(square, 0.0))


def zeroed(calibration: Calibration, chain: str, reference: Reference = "functional-point") -> Calibration:
    """The same errors as they would have been measured on lines through axis position 0 with no tool: for a
    control that counts all lever arms from the machine's zero.

    Lines elsewhere add angle times lever arm to the translations of their curves, to first order; where no
    lever arm changes, values do not change. With `reference` "table" the errors of axes that carry
    the workpiece are those at a point fixed on it, at its zero. Squareness counts from 0 as well: what that
    shifts goes into EXX and EYY.
    """
    square, (_, y, z) = calibration.squareness, calibration.datum_mm
    c0y, b0z, a0z = (square.get(name, 0.0) for name in ("C0Y", "B0Z", "A0Z"))
    shifts = {"X": {"EXX": c0y * y - b0z * z}, "Y": {"EYY": a0z * z}, "Z": {}}
    curves: list[Curve] = []
    for body in build_bodies(calibration, chain, frozenset()):
        axis = AXES[body.axis]
        shift = {name: value for name, value in shifts[axis].items() if value}
        own = calibration.curves_of(axis)
        on_table = body.carries_workpiece and reference == "table"
        lever_arms = {row: lever_arm for rows, lever_arm in body.lever_arms for row in rows}
        turns = any(name[1] in "ABC" for curve in own for name in curve.names)
        moved = turns and any(
            any(lever_arm.offset_mm) or lever_arm.moves[body.axis] != on_table
            for lever_arm in lever_arms.values()
        )
        kind: Reference = "table" if on_table else "functional-point"
        if moved or shift:
            curves.append(_joined(calibration, axis, lever_arms, shift, kind))
        else:
            curves += [replace(c, line_mm=ZERO, tool_mm=ZERO, reference=kind) for c in own]
    curves.sort(key=lambda curve: curve.axis)
    return replace(calibration, curves=tuple(curves), datum_mm=ZERO)


def _joined(
    calibration: Calibration,
    axis: str,
    lever_arms: dict[int, LeverArm],
    shift: dict[str, float],
    kind: Reference,
) -> Curve:
    """One curve of an axis with all its components, moved to the line through 0 with no tool."""
    j, own = AXES.index(axis), calibration.curves_of(axis)
    position = _fine(replace(calibration, cyclic=()), own) if own else np.array(calibration.box_mm[j])
    holder = {name: curve for curve in own for name in curve.names}
    both = any(curve.forward for curve in own)
    sides: list[dict[str, Array]] = []
    for side in (0, -1) if both else (0,):
        values = {
            name: _values_at(curve, _parts(curve, name)[side], position, name)
            for name, curve in holder.items()
        }
        none = np.zeros(len(position))
        angles = np.column_stack([values.get(f"E{d}{axis}", none) for d in "ABC"])
        for i, name in enumerate(f"E{d}{axis}" for d in AXES):
            where = [np.zeros(1)] * 3
            where[j] = position
            arms = lever_arms[i].at(where, [0.0, 0.0, 0.0])
            if kind == "table":
                arms[j] = arms[j] - position
            lever_arm = np.column_stack([none + arm for arm in arms])
            added = np.cross(angles, lever_arm)[:, i] + shift.get(name, 0.0)
            if name in values or np.any(added):
                values[name] = _rounded(values.get(name, 0.0) + added, name)
        sides.append(values)
    names = [name for name in COMPONENTS if any(name in values for values in sides)]
    columns = [{n: values.get(n, np.zeros(len(position))) for n in names} for values in sides]
    return Curve(
        axis, position, {} if both else columns[0], columns[0] if both else {}, columns[-1] if both else {},
        ZERO, ZERO, kind, "linear",
    )  # fmt: skip


def _parts(curve: Curve, name: str) -> tuple[Array, ...]:
    """The values of a component: of the mean, or forward and backward."""
    return (curve.columns[name],) if curve.columns else (curve.forward[name], curve.backward[name])


def _values_at(curve: Curve, values: Array, position: Array, name: str) -> Array:
    """(m,) values at positions: those of the curve where they are its own, else rounded interpolated ones."""
    through = Interpolant.through(curve.position_mm, values[:, None], curve.interpolation)
    result = _rounded(through(position)[:, 0], name)
    own = np.clip(np.searchsorted(curve.position_mm, position), 0, len(values) - 1)
    same = curve.position_mm[own] == position
    result[same] = values[own[same]]
    return result


def _rounded(values: Array, name: str) -> Array:
    return np.asarray(np.round(values, _RAD_DECIMALS if name[1] in "ABC" else _MM_DECIMALS), float)


def _positions(curve: Curve, parts: tuple[Array, ...], most: int | None, even: bool, good: float) -> Array:
    own = curve.position_mm
    if even and not _is_even(own):
        position = _common(own, most or _MOST_EVEN)
        if position is None:
            return _even(own[0], own[-1], most or _MOST_EVEN)
        own = position
    if most is not None and len(own) > most:
        return _even(own[0], own[-1], most)
    if curve.interpolation == "linear":
        return own
    if even:
        position, count = own, 2
        while max(_miss(curve, part, position) for part in parts) > good and count <= _MOST_PARTS:
            rows = (len(own) - 1) * count + 1
            if most is not None and rows > most:
                break
            position, count = _even(own[0], own[-1], rows), 2 * count
        return position
    position = own
    while max(_misses(curve, part, position).max() for part in parts) > good:
        worst = np.max([_misses(curve, part, position) for part in parts], axis=0)
        split = np.flatnonzero(worst > good)
        if most is not None:
            split = split[np.argsort(-worst[split], kind="stable")][: most - len(position)]
        if not len(split) or len(position) > _MOST_PARTS * len(own):
            break
        position = np.unique(np.concatenate([position, 0.5 * (position[split] + position[split + 1])]))
    return position


def _misses(curve: Curve, values: Array, position: Array) -> Array:
    """(m-1,) largest departure of the curve from the straight line between successive positions."""
    through = Interpolant.through(curve.position_mm, values[:, None], curve.interpolation)
    # Between positions and knots the curve is one cubic, which eight parts follow.
    inside = (curve.position_mm > position[0]) & (curve.position_mm < position[-1])
    pieces = np.union1d(position, curve.position_mm[inside])
    share = np.arange(8) / 8.0
    samples = (pieces[:-1, None] + share * np.diff(pieces)[:, None]).ravel()
    off = np.abs(through(samples)[:, 0] - np.interp(samples, position, through(position)[:, 0]))
    starts = np.searchsorted(pieces, position[:-1]) * len(share)
    return np.asarray(np.maximum.reduceat(off, starts), float)


def _miss(curve: Curve, values: Array, position: Array) -> float:
    return float(_misses(curve, values, position).max())


def _is_even(position: Array) -> bool:
    """Equal steps, by the decimals of the positions."""
    exact = [Decimal(repr(value)) for value in position.tolist()]
    return len({high - low for low, high in pairwise(exact)}) == 1


def _even(low: float, high: float, count: int) -> Array:
    """At most `count` positions with equal steps of whole micrometres from `low` to `high`, or just beyond
    where no such step divides the span."""
    first = Decimal(repr(float(low)))
    span = Decimal(repr(float(high))) - first
    for steps in range(count - 1, count // 2, -1):
        if span % (_MICROMETRE * steps) == 0:
            step = span / steps
            break
    else:
        step = (span / (count - 1)).quantize(_MICROMETRE, ROUND_CEILING)
        steps = int((span / step).to_integral_value(ROUND_CEILING))
    return np.array([float(first + step * i) for i in range(steps + 1)])


def _common(position: Array, most: int) -> Array | None:
    """Equal steps that meet every position, None where that takes more than `most` of them."""
    exact = [Decimal(repr(value)) for value in position.tolist()]
    micrometres = [(value - exact[0]) / _MICROMETRE for value in exact]
    if any(value != value.to_integral_value() for value in micrometres):
        return None
    step = math.gcd(*(int(value) for value in micrometres))
    count = int(micrometres[-1]) // step + 1
    if count > most:
        return None
    return np.array([float(exact[0] + _MICROMETRE * step * i) for i in range(count)])
