"""Directions from stations of unknown pose (theodolites, angular pods) as rows of the adjustment.

Each pod reads azimuth and elevation of the reflector in an unknown instrument frame. Angles alone do not
determine the scale; one known distance between two pods does. Poses start from the directions of the nominal
points and are iterated by Gauss-Newton.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, ClassVar

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk, residuals_of
from olp.calibration.estimator.parameters import Unknowns
from olp.calibration.observations.base import (
    OWN_SCALE,
    Advance,
    Alternative,
    Noise,
    Observation,
    Outlier,
    Scattered,
    ScatteredState,
)
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute, ConfigError
from olp.core.rigid_fit import fit_points, rotation_of
from olp.core.units import RAD_PER_URAD
from olp.core.values import dataclass

#: Points whose rows are built at once, to limit memory.
CHUNK = 2000
#: The Gauss-Newton iteration has converged where no pod moves by more than this.
STILL_MM = 1e-5
#: Turns of a pod are multiplied by this lever arm (1 m), so that all unknowns have one size.
LEVER_ARM_MM = 1000.0
#: Iterations of a first pose, at most.
_STEPS = 30
#: Where a pod may start along each axis: shares of the extent of the points, from their lower end.
_AROUND = (-0.7, 0.5, 1.7)
#: A pose is refused where its directions miss the nominal points by more than this (rad, rms).
_LARGEST_MISS_RAD = 2e-3
#: Pods stand no farther off than so many times the extent of the points.
_DISTANCES = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Pods(Scattered):
    """Directions to the reflector from pods or theodolites, each in its own unknown instrument frame.

    `axis_mm` (n, 3) and `tool_mm` (n, 3) or (3,) as for Points; `azimuth_rad` and `elevation_rad` (n, k) of k
    pods, `sigma` the standard uncertainty of an angle in rad. `baselines` are known distances: (pod, pod, mm,
    standard uncertainty in mm), pods counted from 0. Without one the scale is not observable. Raises
    ConfigError.
    """

    read_columns: ClassVar[tuple[str, ...]] = ("axis_mm", "azimuth_rad", "elevation_rad")

    axis_mm: Array
    tool_mm: Array
    azimuth_rad: Array
    elevation_rad: Array
    sigma: float
    baselines: tuple[tuple[int, int, float, float], ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        axis = np.atleast_2d(np.array(self.axis_mm, float))
        columns = {
            "axis_mm": axis,
            "tool_mm": np.array(np.broadcast_to(self.tool_mm, axis.shape), float),
            "azimuth_rad": np.array(self.azimuth_rad, float),
            "elevation_rad": np.array(self.elevation_rad, float),
        }
        shape = columns["azimuth_rad"].shape
        if (
            len(shape) != 2
            or shape[0] != len(axis)
            or shape != columns["elevation_rad"].shape
            or len(axis) < 6
        ):
            raise ConfigError(
                f"{len(axis)} points of pods; expected at least 6, each with both angles of every pod",
                file=self.source or None,
            )
        if not all(np.isfinite(column).all() for column in columns.values()) or not self.sigma > 0.0:
            raise ConfigError(
                "an angle is not finite, or sigma is not above 0; leave such rows out",
                file=self.source or None,
            )
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    @property
    def count(self) -> int:
        """How many pods."""
        return int(self.azimuth_rad.shape[1])

    def alternatives(self) -> Sequence[Alternative]:
        """Baselines of another length, and swapped columns that leave a pose. Angles counted otherwise, and
        other swaps, are refused with their cause."""
        found = [one for one in self.swapped() if self._alike(one.observation)]
        if self.baselines:
            loose = [(i, j, mm, math.hypot(sigma, OWN_SCALE * mm)) for i, j, mm, sigma in self.baselines]
            words = "a baseline between its pods has another length than stated, or temperature changed it"
            other = replace(self, baselines=tuple(loose))
            found.append(Alternative("scale", words, other, where_off=True))
        return found

    def _alike(self, other: Observation) -> bool:
        """Whether poses may fit both these points and those of another: they differ by little but a shift."""
        assert isinstance(other, Pods)
        tip = self.axis_mm + self.tool_mm
        change = other.axis_mm + other.tool_mm - tip
        off = np.sqrt(np.mean((change - change.mean(axis=0)) ** 2))
        return bool(off < _LARGEST_MISS_RAD * _DISTANCES * np.ptp(tip, axis=0).max())

    def start(self, noise: Noise | None = None) -> PodsState:
        return PodsState(self, first_poses(self))


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Position of a pod, and the rotation that takes directions of the machine's frame into the pod's."""

    place_mm: Array
    rotation: Array

    def moved(self, step: Array) -> Pose:
        """After a shift in mm and a turn in rad times LEVER_ARM_MM, in the machine's frame."""
        return Pose(self.place_mm + step[:3], self.rotation @ rotation_of(-step[3:] / LEVER_ARM_MM))


@dataclass(frozen=True, slots=True, eq=False)
class PodsState(ScatteredState):
    """Directions in an adjustment, and the poses of their pods. Two rows (rad) per point and pod, then one
    (mm) per baseline."""

    noun = "directions"
    tally = ""
    observation: Pods
    poses: tuple[Pose, ...]

    @property
    def section(self) -> str:
        return "sets_of_pods"

    @property
    def label(self) -> str:
        return self.observation.source or "pods"

    def block(self, parameters: Unknowns, theta: Array) -> Block:
        return pods_block(self.observation, parameters, theta, self.poses)

    def step(self, block: Block, theta: Array) -> Advance:
        values = residuals_of(block, theta)[0].reshape(-1, 6)
        return Advance(values, bool(np.abs(values[:, :3]).max() < STILL_MM))

    def moved(self, step: Advance, slips: Sequence[Outlier]) -> PodsState:
        moved = [pose.moved(turn) for pose, turn in zip(self.poses, step.values, strict=True)]
        return PodsState(self.observation, tuple(moved))

    def spread_over_rows(self, numbers: Index) -> Index:
        pods = self.observation
        parts = [np.repeat(numbers[start : start + CHUNK], 2) for start in range(0, len(numbers), CHUNK)]
        whole = [np.tile(part, pods.count) for part in parts]
        return np.concatenate([*whole, np.zeros(len(pods.baselines), np.int64)])

    def row(self, residual: Array, chi_square: float) -> dict[str, Any]:
        return {
            "name": self.label,
            "directions": 2 * self.observation.azimuth_rad.size,
            "sigma_urad": self.observation.sigma / RAD_PER_URAD,
            "chi_square_per_reading": chi_square / len(residual),
        }


def first_poses(pods: Pods) -> tuple[Pose, ...]:
    """Poses from the nominal points, as if the machine had no errors. Raises CannotCompute, with the
    conventions of angles that would fit."""
    tip = pods.axis_mm + pods.tool_mm
    poses = []
    for k in range(pods.count):
        miss, pose = _resected(tip, pods.azimuth_rad[:, k], pods.elevation_rad[:, k])
        if miss > _LARGEST_MISS_RAD:
            raise CannotCompute(
                f"pod {k + 1} of {pods.source or 'the pods'}: no pose fits its angles to the points"
                + _cause(pods, k)
            )
        poses.append(pose)
    return tuple(poses)


def _cause(pods: Pods, k: int) -> str:
    """What to state or put right so that a pose of a pod fits, or what to check where that is not known."""
    tip, azimuth, elevation = pods.axis_mm + pods.tool_mm, pods.azimuth_rad[:, k], pods.elevation_rad[:, k]
    clockwise = "azimuths counted the other way round"
    zenith = "vertical angles counted from the other zero"
    for words, turned, up in (
        (clockwise, -azimuth, elevation),
        (zenith, azimuth, 0.5 * np.pi - elevation),
        (f"{clockwise} and {zenith}", -azimuth, 0.5 * np.pi - elevation),
    ):
        if _resected(tip, turned, up)[0] < 0.1 * _LARGEST_MISS_RAD:
            return (
                f", and one fits with {words}; state azimuth (clockwise, counter-clockwise) and vertical "
                "(zenith, elevation) as the instrument counts them"
            )
    for one in pods.swapped():
        other = one.observation
        assert isinstance(other, Pods)
        if _resected(other.axis_mm + other.tool_mm, azimuth, elevation)[0] < 0.1 * _LARGEST_MISS_RAD:
            return f", and one fits if {one.words}; put them right in the file or the plan"
    return "; check the angles, and that their rows are those of the points"


def pods_block(pods: Pods, parameters: Unknowns, theta: Array, poses: Sequence[Pose]) -> Block:
    """The directions of all pods and the distances between them, linearised where the machine's errors are
    `theta`. Six unknowns per pod: shift, and turn times LEVER_ARM_MM."""
    size, unknowns = parameters.size, 6 * pods.count
    tip = pods.axis_mm + pods.tool_mm

    def chunks() -> Iterator[Chunk]:
        for start in range(0, len(tip), CHUNK):
            part = slice(start, start + CHUNK)
            design = parameters.design(pods.axis_mm[part], pods.tool_mm[part])
            shift = design @ theta
            for k, pose in enumerate(poses):
                seen = pods.azimuth_rad[part, k], pods.elevation_rad[part, k]
                misses, rows, local = _linear(tip[part] + shift, *seen, pose)
                on_theta = np.einsum("nai,nij->naj", rows, design).reshape(-1, size)
                table = np.zeros((len(on_theta), unknowns))
                table[:, 6 * k : 6 * k + 6] = local.reshape(-1, 6)
                y = misses.reshape(-1) + on_theta @ theta
                yield Chunk(on_theta, y, np.full(len(y), pods.sigma), table)
        for i, j, length, sigma in pods.baselines:
            apart = poses[j].place_mm - poses[i].place_mm
            distance = float(np.linalg.norm(apart))
            table = np.zeros((1, unknowns))
            table[0, 6 * i : 6 * i + 3] = -apart / distance
            table[0, 6 * j : 6 * j + 3] = apart / distance
            yield Chunk(np.zeros((1, size)), np.array([length - distance]), np.array([sigma]), table)

    return Block(np.arange(size), np.zeros(unknowns), chunks, pods.source or "pods")


def _linear(tip: Array, azimuth: Array, elevation: Array, pose: Pose) -> tuple[Array, Array, Array]:
    """(n, 2) measured less expected azimuth and elevation, (n, 2, 3) what a shift of the tip does to them,
    and (n, 2, 6) what the pod's unknowns do."""
    ray = tip - pose.place_mm
    x, y, z = (ray @ pose.rotation.T).T
    flat = np.hypot(x, y)
    square = flat**2 + z**2
    misses = np.stack(
        [
            _small(azimuth - np.arctan2(y, x)),
            elevation - np.arctan2(z, flat),
        ],
        axis=1,
    )
    own = np.zeros((len(ray), 2, 3))
    own[:, 0, 0], own[:, 0, 1] = -y / flat**2, x / flat**2
    own[:, 1, 0], own[:, 1, 1], own[:, 1, 2] = -x * z / flat / square, -y * z / flat / square, flat / square
    rows = own @ pose.rotation
    # a turn w of the pod changes its angles as a shift of the tip by -w x ray does
    turned = np.cross(rows, ray[:, None, :])
    return misses, rows, np.concatenate([-rows, turned / LEVER_ARM_MM], axis=2)


def _resected(tip: Array, azimuth: Array, elevation: Array) -> tuple[float, Pose]:
    """The pose whose angles to the nominal points fit the readings best, from starts all around them, and by
    how much they miss (rad, rms)."""
    flat = np.cos(elevation)
    seen = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    low, span = tip.min(axis=0), np.ptp(tip, axis=0)
    best: tuple[float, Pose] | None = None
    for share in product(_AROUND, repeat=3):
        place = low + np.array(share) * np.maximum(span, 0.3 * span.max())
        direction = tip - place
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        pose = Pose(place, _turn(direction, seen))
        cost = np.inf
        for _ in range(_STEPS):
            misses, _, local = _linear(tip, azimuth, elevation, pose)
            cost = float(np.sqrt(np.mean(misses**2)))
            step, *_ = np.linalg.lstsq(local.reshape(-1, 6), misses.reshape(-1), rcond=1e-10)
            limit = max(1.0, float(np.abs(step).max()) / 1000.0)
            pose = pose.moved(np.asarray(step / limit, float))
            if float(np.abs(step).max()) < 1e-4:
                break
        if best is None or cost < best[0]:
            best = cost, pose
        if cost < 0.1 * _LARGEST_MISS_RAD:
            break
    assert best is not None, "there are starts"
    return best


def _turn(direction: Array, seen: Array) -> Array:
    """(3, 3) rotation that brings unit vectors onto others best."""
    both = np.concatenate([direction, -direction]), np.concatenate([seen, -seen])
    return fit_points(both[0], both[1]).rotation


def _small(angle: Array) -> Array:
    """Angles between -pi and pi."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
