"""How joints give way under the weight of all that they carry, at the nominal posture."""

from __future__ import annotations

from collections.abc import Mapping

from olp.kinematics.columns import STILL, Columns, Triple, add, cross, dot, scaled, subtract, times, triple
from olp.kinematics.errors import MachineErrors
from olp.kinematics.motion import Yielded
from olp.kinematics.structure import FRAME, Structure

#: Standard acceleration of free fall, m/s2 (ISO 80000-3).
FREE_FALL_M_S2 = 9.80665
#: mm per m, for torques in Nm of arms in mm.
_MM_PER_M = 1e3


def yields_of(
    structure: Structure, errors: MachineErrors, motions: Mapping[str, Columns]
) -> dict[str, Yielded]:
    """By joint what it gives way, from its nominal `motions` by name."""
    if not errors.yields:
        return {}
    gravity: Triple = scaled(triple(structure.gravity), FREE_FALL_M_S2)
    gone: dict[str, Yielded] = {}
    for on_workpiece, names in _sides(structure):
        bodies = _bodies(names, motions, on_workpiece)
        weights = _weights(structure, errors, names, bodies, on_workpiece)
        for row, name in enumerate(names):
            gives = errors.yields.get(name)
            if gives is None:
                continue
            stator = bodies[names[row - 1]] if row else STILL
            joint = structure.joints[name]
            moving = joint.kind != "rotary"
            point = (bodies[name] if moving else stator).at(triple(joint.point_mm))
            force: Triple = (0.0, 0.0, 0.0)
            torque: Triple = (0.0, 0.0, 0.0)
            for kg, centre in (w for outer in names[row:] for w in weights[outer]):
                pull = scaled(gravity, kg)
                force = add(force, pull)
                torque = add(torque, cross(subtract(centre, point), scaled(pull, 1.0 / _MM_PER_M)))
            sign = -1.0 if on_workpiece else 1.0
            force = scaled(stator.turned_back(force), sign)
            torque = scaled(stator.turned_back(torque), sign)
            along = dot(force if moving else torque, triple(joint.direction))
            gone[name] = Yielded(
                times(gives.own, along), _each(triple(gives.tilt), torque), _each(triple(gives.shift), force)
            )
    return gone


def _each(a: Triple, b: Triple) -> Triple:
    return times(a[0], b[0]), times(a[1], b[1]), times(a[2], b[2])


def _sides(structure: Structure) -> tuple[tuple[bool, tuple[str, ...]], ...]:
    """The parts of both sides of the frame, the one next to it first."""
    frame = structure.chain.index(FRAME)
    return (True, structure.chain[:frame][::-1]), (False, structure.chain[frame + 1 :])


def _bodies(names: tuple[str, ...], motions: Mapping[str, Columns], on_workpiece: bool) -> dict[str, Columns]:
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
    bodies: Mapping[str, Columns],
    on_workpiece: bool,
) -> dict[str, list[tuple[float, Triple]]]:
    """By part the weights on it: kg, and centres in the frame."""
    weights: dict[str, list[tuple[float, Triple]]] = {name: [] for name in names}
    for mass in errors.masses:
        if mass.on in weights:
            weights[mass.on].append((mass.kg, bodies[mass.on].at(triple(mass.centre_mm))))
    payload = errors.payload
    if payload.kg and names and not on_workpiece:
        held = (bodies[names[-1]] @ Columns.of(structure.gauge.pose)).at(triple(payload.centre_mm))
        weights[names[-1]].append((payload.kg, held))
    return weights
