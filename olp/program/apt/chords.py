"""Arcs in no plane of two axes of the machine: read as chords, each within `SAGITTA_MM` of the arc.

Such an arc is resolved in coordinates of its own, in which its normal is the third axis. Where it has to be
written otherwise, its chords are written as points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import arc_points
from olp.core.values import dataclass
from olp.program.apt.arcs import LEAN, ArcForm, Resolved, joints, resolved

#: how far a chord may be from its arc
SAGITTA_MM = 2e-4
#: chords of one arc at most: a turn of 60 m radius
_MOST = 40_000


@dataclass(frozen=True, slots=True, eq=False)
class Chorded:
    """An arc as chords: (n, 3) `end` of each, and how it joins the straight move before it (`joints`)."""

    end: Array
    joint: int


def leaning(forms: Sequence[ArcForm], turn: Array | None) -> Mask:
    """(m,) arcs whose normal is no axis of the machine; `turn` is that of their frame."""
    normal = np.array([f.normal for f in forms])
    normal = normal if turn is None else normal @ turn.T
    size = np.sqrt((normal * normal).sum(axis=1))
    along = np.abs(normal).max(axis=1)
    return np.asarray((size > 0) & ~(size - along <= LEAN * size))


def chorded(
    form: ArcForm, start: Array, end: Array, before: Array, line: int, unit_mm: float, offset: Array,
    turn: Array | None,
) -> Chorded:  # fmt: skip
    """An arc from point `start` to `end`, (3,) on the machine, as chords. Raises ProgramError as `resolved`
    does, and for an arc of too many chords."""
    normal = np.array(form.normal)
    basis = _basis(normal if turn is None else turn @ normal)
    inner = basis if turn is None else basis @ turn
    if not np.isfinite([start, end]).all():
        raise ProgramError(
            "the start of the arc is not known; command X, Y and Z first, or give a machine file and a job "
            "file with start_mm",
            line=form.line,
            code="OLP524",
        )
    places = (basis @ np.array((start, end, before)).T).T
    shape = _resolved(form, places, line, unit_mm, basis @ offset, inner)
    radius = float(np.hypot(*(places[0] - shape.centre[0])[:2]))
    angle = 2.0 * float(np.arccos(max(1.0 - SAGITTA_MM / max(radius, SAGITTA_MM), 0.0)))
    count = max(int(np.ceil(abs(float(shape.sweep[0])) / angle)), 2)
    if count > _MOST:
        raise ProgramError(
            f"an arc in no plane of two axes of the machine needs {count} chords to be within "
            f"{SAGITTA_MM * 1e3:g} um; have the CAM system write it as GOTOs",
            line=form.line,
            code="OLP512",
        )
    ends = [np.repeat(point[None], count, axis=0) for point in (places[0], places[1], shape.centre[0])]
    plane, sweep = np.repeat(shape.plane, count), np.repeat(shape.sweep, count)
    share = np.arange(1, count + 1) / np.full(count, float(count))
    points = arc_points(ends[0], ends[1], ends[2], plane, sweep, share) @ basis
    points[-1] = end
    joint = int(joints(shape, places[:1], places[2:])[0])
    return Chorded(points, joint)


def _resolved(
    form: ArcForm, places: Array, line: int, unit_mm: float, offset: Array, inner: Array
) -> Resolved:  # fmt: skip
    """The arc in its own coordinates, in which `inner` turns what the program states."""
    own = tuple((inner @ np.array(form.centre)).tolist())
    begins = None if form.begins is None else tuple((inner @ np.array(form.begins)).tolist())
    # the third axis is the normal to the last digit
    stated = replace(form, centre=own, normal=(0.0, 0.0, 1.0), begins=begins)
    return resolved(
        [stated], places[:1], places[1:2], np.array([line], np.int64), unit_mm, offset[None], None
    )


def _basis(normal: Array) -> Array:
    """(3, 3) rows: two directions across a normal, and the normal, right-handed."""
    third = normal / np.linalg.norm(normal)
    first = np.cross(third, np.eye(3)[np.abs(third).argmin()])
    first /= np.linalg.norm(first)
    return np.array((first, np.cross(third, first), third))
