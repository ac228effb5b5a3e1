"""Random postures of a machine of any joints, from which those to measure are chosen."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError, NotInvertible
from olp.core.units import AXES
from olp.kinematics.chain import Kinematics
from olp.kinematics.coordinates import poses_of_axes, states_poses
from olp.kinematics.correction import beyond_travel
from olp.kinematics.errors import LegErrors, MachineErrors
from olp.kinematics.pose_axes import axes_of_poses
from olp.kinematics.structure import Structure

#: deg by which a platform is turned at most; beyond it joints of legs are at their ends.
_TILT_DEG = 30.0
#: Where legs that are off move the tip so many times more than usual, they hardly hold it.
_SWAYS = 5.0
#: mm by which legs are off there, and how often that is tried.
_OFF_MM = 0.3
_TRIALS = 2
#: Poses of a platform that are drawn at a time.
_DRAWN = 2048
#: Draws at most: where so few are in the travel, a list says better what the machine can take.
_MOST_DRAWS = 40


def random_postures(structure: Structure, count: int, seed: int) -> Array:
    """(n, axes) random axis values within the travel, `count` of them, or fewer where a platform reaches few
    of the poses that are drawn. Raises ConfigError for a platform whose postures are not found that way."""
    random = np.random.default_rng(seed)
    low, high = np.array([joint.travel for joint in structure.joints.values()]).T
    if not structure.platforms:
        return random.uniform(low, high, (count, len(low)))
    if not states_poses(structure):
        raise _not_found("further axes carry the platform or its tool")
    try:
        machine = Kinematics(structure)
        middle = 0.5 * (low + high)[None]
        home, slopes = poses_of_axes(machine, middle)[0], machine.jacobian(middle)[0]
    except CannotCompute:
        raise _not_found("its legs do not close in the middle of their travel") from None
    rotary = np.array([unit == "deg" for unit in structure.units])
    half = 0.5 * np.where(rotary, np.radians(high - low), high - low)
    reach = np.full(len(home), _TILT_DEG)
    reach[: len(AXES)] = np.abs(slopes[: len(AXES)]) @ half
    found: list[Array] = []
    for _ in range(_MOST_DRAWS):
        # near the middle and far from it: how far the travel leads differs from machine to machine
        size = random.uniform(0.0, 1.0, (_DRAWN, 1)) * reach
        found.append(_reached(machine, home + size * random.uniform(-1.0, 1.0, (_DRAWN, len(home)))))
        if sum(map(len, found)) >= count:
            break
    values = np.concatenate(found)[:count]
    if not len(values):
        raise _not_found("no pose that was drawn is within the travel")
    return _firm(structure, values, random)


def _reached(machine: Kinematics, poses: Array) -> Array:
    """(m, axes) axis values of those of the poses (n, axes) that are within the travel."""
    while len(poses):
        try:
            values = axes_of_poses(machine, poses)
        except NotInvertible as error:
            poses = np.delete(poses, error.rows, axis=0)
            continue
        return values[~beyond_travel(machine.structure, values).any(axis=1)]
    return poses


def _firm(structure: Structure, values: Array, random: np.random.Generator) -> Array:
    """(m, axes) those of the values (n, axes) at which legs that are a little off hold the platform nearly
    where it was: elsewhere no reading tells how far they are off."""
    nominal = Kinematics(structure).nominal(values).position
    (platform,) = structure.platforms.values()
    moved_mm = np.zeros(len(values))
    for _ in range(_TRIALS):
        off_mm = random.normal(0.0, _OFF_MM, len(platform.legs)).tolist()
        legs = {(platform.name, k): LegErrors(length_mm=one) for k, one in enumerate(off_mm)}
        there = _where(Kinematics(structure, MachineErrors(legs=legs)), values)
        moved_mm = np.maximum(moved_mm, np.linalg.norm(there - nominal, axis=1))
    # one that does not close is nowhere
    return values[moved_mm < _SWAYS * np.nanmedian(moved_mm)]


def _where(machine: Kinematics, values: Array) -> Array:
    """(n, 3) mm where the tip is, NaN where the platform does not close."""
    try:
        return machine.actual(values).position
    except CannotCompute:
        if len(values) == 1:
            return np.full((1, 3), np.nan)
        half = len(values) // 2
        return np.vstack((_where(machine, values[:half]), _where(machine, values[half:])))


def _not_found(why: str) -> ConfigError:
    return ConfigError(
        f"random postures of this platform are not found: {why}; give a list of postures of the machine "
        "(--among)"
    )
