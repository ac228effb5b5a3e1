"""How joints give way under the weight of all that they carry, at the nominal posture.

The weights are stated as masses, or what they do is stated by sums of angles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.kinematics.columns import (
    STILL,
    Columns,
    Triple,
    add,
    cross,
    dot,
    plus,
    scaled,
    subtract,
    times,
    triple,
)
from olp.kinematics.errors import MachineErrors, Yield
from olp.kinematics.motion import Yielded
from olp.kinematics.structure import FRAME, Structure

#: Standard acceleration of free fall, m/s2 (ISO 80000-3).
FREE_FALL_M_S2 = 9.80665
#: mm per m, for torques in Nm of arms in mm.
_MM_PER_M = 1e3
#: Directions whose product differs from 1 by less are parallel.
_PARALLEL = 1e-9
#: A joint that gives way by nothing.
_UNMOVED = Yielded(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def yields_of(
    structure: Structure, errors: MachineErrors, values: Mapping[str, Array], motions: Mapping[str, Columns]
) -> dict[str, Yielded]:
    """By joint what it gives way, from axis `values` (n,) and nominal `motions` by name."""
    gone = _under_masses(structure, errors, motions) if errors.yields else {}
    for term in errors.gravity:
        about = structure.joints[term.joint].direction
        turn = sum(np.radians(values[name]) * sign_about(structure, name, about) for name in term.angles)
        own = term.sine * np.sin(turn) + term.cosine * np.cos(turn)
        old = gone.get(term.joint, _UNMOVED)
        gone[term.joint] = replace(old, own=plus(old.own, own))
    return gone


def sign_about(structure: Structure, name: str, direction: Vector) -> float:
    """1 where a rotary joint turns about a direction, -1 where about the opposite one, 0 elsewhere."""
    joint = structure.joints.get(name)
    if joint is None or joint.kind != "rotary":
        return 0.0
    along = float(np.dot(joint.direction, direction))
    return float(np.sign(along)) if abs(along) > 1.0 - _PARALLEL else 0.0


def turning_together(structure: Structure, joint: str) -> tuple[str, ...]:
    """The rotary joints of the chain about a rotary joint that are parallel to it at every posture, in the
    order of the chain: none between them turns about another direction. Empty where the joint is no part of
    the chain."""
    groups: list[list[str]] = [[]]
    for name in structure.chain:
        part = structure.joints.get(name)
        turns = part is not None and part.kind == "rotary"
        if part is None or (turns and not sign_about(structure, name, _of(structure, groups))):
            groups.append([])
        if turns:
            groups[-1].append(name)
    return next((tuple(group) for group in groups if joint in group), ())


def sums_of_angles(structure: Structure, joint: str) -> tuple[tuple[str, ...], ...]:
    """By each body that a rotary joint carries and that turns parallel to it, the joints whose values sum up
    to how it lies against gravity. Raises ConfigError where no sum of angles says that."""
    together = turning_together(structure, joint)
    for on_workpiece, names in _sides(structure):
        if not together or together[0] not in names:
            continue
        outward = together[::-1] if on_workpiece else together
        before = names[: names.index(outward[0])]
        tilting = [name for name in before if structure.joints[name].kind == "rotary"
                   and not sign_about(structure, name, structure.gravity)]  # fmt: skip
        if sign_about(structure, joint, structure.gravity):
            raise ConfigError(f"{joint} turns about the vertical, where no weight turns it")
        if tilting:
            raise ConfigError(
                f"how the weight on {joint} lies is no sum of angles, as {', '.join(tilting)} turn before it "
                "about other directions; state payload_kg and name it in elasticity"
            )
        first = outward.index(joint)
        return tuple(outward[: k + 1] for k in range(first, len(outward)))
    raise ConfigError(f"{joint} is no rotary axis of the chain, so that no weight turns it")


def _of(structure: Structure, groups: Sequence[Sequence[str]]) -> Vector:
    """The direction of the last group; that of no joint where it is empty."""
    return structure.joints[groups[-1][0]].direction if groups[-1] else ZERO


def gravity_problems(structure: Structure, errors: MachineErrors) -> Iterator[tuple[int, str]]:
    """What is wrong with terms of gravity: the place of each among them, and a sentence."""
    for place, term in enumerate(errors.gravity):
        if structure.platforms:
            yield place, "gravity of a machine with platforms is not modelled; leave [[gravity]] out"
            continue
        together = turning_together(structure, term.joint)
        if not together:
            yield place, f"gravity of {term.joint}, which is no rotary axis of the chain"
        elif not term.angles or len(set(term.angles)) < len(term.angles) or set(term.angles) - {*together}:
            yield (
                place,
                f"gravity of {term.joint} by the angles {', '.join(term.angles) or 'of no axis'}; expected "
                f"axes that stay parallel to {term.joint}, each once: {', '.join(together)}",
            )
        own = errors.yields.get(term.joint, Yield()).own
        if own and any(carries(structure, term.joint, mass.on) for mass in errors.masses):
            yield (
                place,
                f"gravity of {term.joint} beside its elasticity and [[masses]] that it carries: these count "
                "twice; state one of the two",
            )


def carries(structure: Structure, joint: str, other: str) -> bool:
    """Whether a joint carries the body of another one, or its own."""
    return any(joint in names and other in names[names.index(joint) :] for _, names in _sides(structure))


def _under_masses(
    structure: Structure, errors: MachineErrors, motions: Mapping[str, Columns]
) -> dict[str, Yielded]:
    """By joint what it gives way under the masses and the payload."""
    gravity: Triple = scaled(triple(structure.gravity), FREE_FALL_M_S2)
    gone: dict[str, Yielded] = {}
    for on_workpiece, names in _sides(structure):
        bodies = _bodies(names, motions, on_workpiece)
        weights = _weights(structure, errors, names, bodies, on_workpiece)
        sign = -1.0 if on_workpiece else 1.0
        # of all that is outboard: its weight, and the moment of that about the origin
        pull: Triple = (0.0, 0.0, 0.0)
        moment: Triple = (0.0, 0.0, 0.0)
        for row, name in reversed(tuple(enumerate(names))):
            for kg, centre in weights[name]:
                weight = scaled(gravity, kg)
                pull, moment = add(pull, weight), add(moment, cross(centre, scaled(weight, 1.0 / _MM_PER_M)))
            gives = errors.yields.get(name)
            if gives is None:
                continue
            stator = bodies[names[row - 1]] if row else STILL
            joint = structure.joints[name]
            moving = joint.kind != "rotary"
            point = (bodies[name] if moving else stator).at(triple(joint.point_mm))
            torque = subtract(moment, cross(point, scaled(pull, 1.0 / _MM_PER_M)))
            force = scaled(stator.turned_back(pull), sign)
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
