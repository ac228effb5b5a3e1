"""An artefact that the machine touches with its own probe: features, how it lies, and where it is touched.

Touches go along the axes of the machine, from both sides of a sphere or hole: backlash then moves no centre.
The stylus stands along Z, so nothing is touched from below.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import Vector
from olp.core.rigid_fit import Rigid
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.touches import Touches

Kind = Literal["sphere", "hole", "face"]
#: Directions out of the surface in which each kind is touched; those of a wall point to its axis.
ROUND = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
#: A face, and the axis of a hole, may be turned by so much from an axis of the machine: 5 degrees.
SQUARE = float(np.cos(np.radians(5.0)))
#: The half turn of 45 degrees, for touches between the equator and the pole.
_SLANT = float(np.sqrt(0.5))


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """A sphere, a hole or a face in the frame of its artefact. `place_mm` is the centre of a sphere, the
    middle of a hole in the face around it, or the place of a face that is touched. `direction` points out of
    that face, along the axis of a hole. `depth_mm` is how deep the wall of a hole is touched. `touches` on a
    sphere are 5, or 9 with four at 45 degrees. `sigma_mm` is the uncertainty of a coordinate, 0 as drawn."""

    name: str
    kind: Kind
    place_mm: Vector
    diameter_mm: float = 0.0
    direction: Vector = (0.0, 0.0, 1.0)
    depth_mm: float = 0.0
    touches: int = 5
    sigma_mm: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """How an artefact lies: its frame in places of the tip, which are axis positions plus the tool vector.
    `turned_over` says that a straightedge shows its other side."""

    frame: Rigid
    turned_over: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Probing:
    """An artefact, its poses, and the probe. `approach_mm` is how far before a surface a touch begins, and
    behind it gives up. `clear_mm` is the height above all features where nothing is in the way. `sigma_mm` is
    the repeatability of a touch, `sigma_radius_mm` how well the effective radius of the tip is known."""

    name: str
    features: tuple[Feature, ...]
    poses: tuple[Pose, ...]
    tool_mm: Vector
    radius_mm: float
    approach_mm: float
    clear_mm: float
    sigma_mm: float
    sigma_radius_mm: float
    feed_mm_min: float


@dataclass(frozen=True, slots=True, eq=False)
class Aimed:
    """Touches (n,) of one pose, in places of the tip: the number of each touched feature, and what it shows
    of it ("sphere", "wall", "face"). Then its place on the surface and its direction out of it (n, 3)."""

    feature: tuple[int, ...]
    part: tuple[str, ...]
    surface_mm: Array
    normal: Array


def aim(probing: Probing, number: int) -> Aimed:
    """The touches of a pose, in order. Raises ConfigError where a face or hole is not square to the
    machine."""
    pose = probing.poses[number]
    rows: list[tuple[int, str, Array, Array]] = []
    for k, feature in enumerate(probing.features):
        place = pose.frame(np.array([feature.place_mm]))[0]
        out = pose.frame.rotation @ np.array(feature.direction)
        label = f"pose {number + 1}, {feature.name}"
        rows += [(k, *touch) for touch in _touches(feature, probing, place, out, label)]
    features, parts, places, normals = zip(*rows, strict=True)
    return Aimed(features, parts, np.array(places), np.array(normals))


def _touches(
    feature: Feature, probing: Probing, place: Array, out: Array, label: str
) -> Iterator[tuple[str, Array, Array]]:
    """What a touch shows, its place on the surface, and its direction out of it."""
    radius = 0.5 * feature.diameter_mm
    flat = [np.array([x, y, 0.0]) for x, y in ROUND]
    if feature.kind == "sphere":
        slant = [_SLANT * (way + np.array([0.0, 0.0, 1.0])) for way in flat] if feature.touches > 5 else []
        for way in (*flat, *slant, np.array([0.0, 0.0, 1.0])):
            yield "sphere", place + radius * way, way
    elif feature.kind == "hole":
        if not out[2] >= SQUARE:
            raise ConfigError(f"{label}: the hole does not open upwards; expected its axis along Z")
        deep = place - np.array([0.0, 0.0, feature.depth_mm])
        for way in flat:
            yield "wall", deep + radius * way, -way
        # around the hole, so that the tilt of its face cancels
        beside = radius + 2.0 * probing.radius_mm
        for way in flat:
            yield "face", place + beside * way, np.array([0.0, 0.0, 1.0])
    else:
        axis = _square_axis(out, label)
        if axis == 2 and out[2] < 0.0:
            raise ConfigError(f"{label}: the face looks down, where the stylus cannot touch it")
        yield "face", place, np.eye(3)[axis] * np.sign(out[axis])


def _square_axis(out: Array, label: str) -> int:
    axis = int(np.abs(out).argmax())
    if not abs(out[axis]) >= SQUARE:
        raise ConfigError(f"{label}: the face is not square to an axis of the machine within 5 degrees")
    return axis


def face_axis(probing: Probing, number: int, feature: int) -> tuple[int, int]:
    """The axis of the machine that a face of a pose is square to, and the side to which it looks."""
    one = probing.features[feature]
    out = probing.poses[number].frame.rotation @ np.array(one.direction)
    axis = _square_axis(out, f"pose {number + 1}, {one.name}")
    return axis, int(np.sign(out[axis]))


def touches_of(probing: Probing, number: int, travel_mm: Mapping[str, tuple[float, float]]) -> Touches:
    """The touches of a pose (from 0) as axis positions. Raises ConfigError with what the machine cannot
    reach, and where another feature is in the way."""
    aimed = aim(probing, number)
    tool, r, away = np.array(probing.tool_mm), probing.radius_mm, probing.approach_mm
    contact = aimed.surface_mm + r * aimed.normal - tool
    start = contact + away * aimed.normal
    wall = np.array([part == "wall" for part in aimed.part])
    names = [probing.features[k].name for k in aimed.feature]
    for k in np.flatnonzero(wall):
        # straight down in the middle of the hole
        middle = aimed.surface_mm[k] + 0.5 * probing.features[aimed.feature[k]].diameter_mm * aimed.normal[k]
        start[k] = middle - tool
    end = contact - away * aimed.normal
    top = _top_mm(probing, number) + r + probing.clear_mm - tool[2]
    labels = _labels(names, number)
    touches = Touches(
        labels, start, contact, end, aimed.normal, float(top), probing.tool_mm, r, probing.feed_mm_min
    )
    problems = [*_beyond(touches, travel_mm), *_in_the_way(probing, number, touches, aimed)]
    if problems:
        raise ConfigError("; ".join(problems), problems=tuple(problems))
    return touches


def _labels(names: Sequence[str], number: int) -> tuple[str, ...]:
    """Pose, feature, and number of the touch on it."""
    count: dict[str, int] = {}
    labels = []
    for name in names:
        count[name] = count.get(name, 0) + 1
        labels.append(f"P{number + 1}_{name}_{count[name]}")
    return tuple(labels)


def _top_mm(probing: Probing, number: int) -> float:
    """The height of the highest surface of a pose, in places of the tip."""
    places = probing.poses[number].frame(np.array([f.place_mm for f in probing.features]))
    heights = [
        z + (0.5 * f.diameter_mm if f.kind == "sphere" else 0.0)
        for z, f in zip(places[:, 2].tolist(), probing.features, strict=True)
    ]
    return float(max(heights))


def _beyond(touches: Touches, travel_mm: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    """Moves that leave the travel of the machine, each axis once."""
    places, number = touches.moves()
    for k, axis in enumerate(AXES):
        low, high = travel_mm[axis]
        outside = np.flatnonzero((places[:, k] < low) | (places[:, k] > high))
        if len(outside):
            first = int(outside[0])
            # a move on the way belongs to the touch after it
            later = number[first:][number[first:] >= 0]
            label = touches.labels[int(later[0])] if len(later) else touches.labels[-1]
            yield (
                f"{label}: {axis} would have to go to {places[first, k]:.3f}; expected {low:g} to {high:g}, "
                "the travel; move the artefact, or change clear_mm or approach_mm"
            )


def _in_the_way(probing: Probing, number: int, touches: Touches, aimed: Aimed) -> Iterator[str]:
    """Spheres that the tip would hit as it comes straight down or touches, each touch once."""
    spheres = [k for k, f in enumerate(probing.features) if f.kind == "sphere"]
    if not spheres:
        return
    centre = probing.poses[number].frame(np.array([probing.features[k].place_mm for k in spheres]))
    reach = np.array([0.5 * probing.features[k].diameter_mm for k in spheres]) + probing.radius_mm
    tool = np.array(probing.tool_mm)
    for k, label in enumerate(touches.labels):
        for place in (touches.start_mm[k] + tool, touches.contact_mm[k] + tool):
            beside = np.hypot(*(centre[:, :2] - place[:2]).T)
            # the tip and what carries it are above this place
            hit = (beside < reach) & (centre[:, 2] > place[2] - reach)
            own = np.array([s == aimed.feature[k] for s in spheres])
            if (hit & ~own).any():
                other = probing.features[spheres[int(np.flatnonzero(hit & ~own)[0])]].name
                yield f"{label}: {other} is in the way; expected more room, or a smaller approach_mm"
                break


__all__ = ["Aimed", "Feature", "Pose", "Probing", "aim", "face_axis", "touches_of"]
