"""How joints give way under the weight of all that they carry, at the nominal posture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.arrays import Array
from olp.kinematics.errors import MachineErrors
from olp.kinematics.motion import Yielded
from olp.kinematics.poses import STILL, Poses, turned
from olp.kinematics.structure import FRAME, Structure

#: Standard acceleration of free fall, m/s2 (ISO 80000-3).
FREE_FALL_M_S2 = 9.80665
#: mm per m, for torques in Nm of arms in mm.
_MM_PER_M = 1e3


def yields_of(
    structure: Structure, errors: MachineErrors, motions: Mapping[str, Poses], values: Array
) -> dict[str, Yielded]:
    """By joint what it gives way at axis values (n, axes), from its nominal `motions` by name."""
    if not errors.yields:
        return {}
    count = len(values)
    gravity = np.array(structure.gravity) * FREE_FALL_M_S2
    gone: dict[str, Yielded] = {}
    for on_workpiece, names in _sides(structure):
        bodies = _bodies(names, motions, on_workpiece)
        weights = _weights(structure, errors, names, bodies, on_workpiece)
        for row, name in enumerate(names):
            gives = errors.yields.get(name)
            if gives is None:
                continue
            stator = bodies[names[row - 1]] if row else STILL
            moving = structure.joints[name].kind != "rotary"
            point = (bodies[name] if moving else stator).at(np.array(structure.joints[name].point_mm))
            force, torque = np.zeros((count, 3)), np.zeros((count, 3))
            for kg, centre in (w for outer in names[row:] for w in weights[outer]):
                force += kg * gravity
                torque += np.cross(centre - point, kg * gravity) / _MM_PER_M
            back = np.swapaxes(stator.rotation, -1, -2)
            sign = -1.0 if on_workpiece else 1.0
            force, torque = sign * turned(back, force), sign * turned(back, torque)
            direction = np.array(structure.joints[name].direction)
            along = (force if moving else torque) @ direction
            gone[name] = Yielded(
                gives.own * along, np.array(gives.tilt) * torque, np.array(gives.shift) * force
            )
    return gone


def _sides(structure: Structure) -> tuple[tuple[bool, tuple[str, ...]], ...]:
    """The parts of both sides of the frame, the one next to it first."""
    frame = structure.chain.index(FRAME)
    return (True, structure.chain[:frame][::-1]), (False, structure.chain[frame + 1 :])


def _bodies(names: tuple[str, ...], motions: Mapping[str, Poses], on_workpiece: bool) -> dict[str, Poses]:
    """Where the body of each part is in the frame; that of the workpiece's side moves by the inverse."""
    pose, bodies = STILL, {}
    for name in names:
        pose = pose @ (motions[name].inverse() if on_workpiece else motions[name])
        bodies[name] = pose
    return bodies


def _weights(
    structure: Structure,
    errors: MachineErrors,
    names: tuple[str, ...],
    bodies: Mapping[str, Poses],
    on_workpiece: bool,
) -> dict[str, list[tuple[float, Array]]]:
    """By part the weights on it: kg, and (n, 3) centres in the frame."""
    weights: dict[str, list[tuple[float, Array]]] = {name: [] for name in names}
    for mass in errors.masses:
        if mass.on in weights:
            weights[mass.on].append((mass.kg, bodies[mass.on].at(np.array(mass.centre_mm))))
    payload = errors.payload
    if payload.kg and names and not on_workpiece:
        held = (bodies[names[-1]] @ structure.gauge.pose).at(np.array(payload.centre_mm))
        weights[names[-1]].append((payload.kg, held))
    return weights
