"""The tables of a machine of any joints in a chain."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from olp.core.errors import ConfigError
from olp.files.control_code.tables import NONE, Data, curve, defines, pair, real, triple
from olp.kinematics.chain import Kinematics
from olp.kinematics.columns import Columns, about, tilted
from olp.kinematics.columns import triple as columns_of
from olp.kinematics.errors import OWN, Gravity, JointErrors, MotionCurve, Yield
from olp.kinematics.inverse import LARGEST_TURN_DEG
from olp.kinematics.programmed import linear_columns
from olp.kinematics.structure import FRAME, REFERENCE_RADIUS_MM, Structure
from olp.kinematics.weight import FREE_FALL_M_S2, sign_about

#: Axes beyond those that hold the tip and the axis of a tool.
_SYMMETRIC = 5
_WHOLE = 6


def refuse_chain(machine: Kinematics) -> None:
    """Raises ConfigError for a machine that C code does not hold."""
    structure = machine.structure
    if structure.platforms:
        raise ConfigError(
            f"{', '.join(structure.platforms)}: code that corrects in real time holds chains of linear and "
            "rotary axes, no platforms on legs; correct the programs instead"
        )
    free = [name for name, joint in structure.joints.items() if joint.correct]
    most = _SYMMETRIC if structure.symmetric_tool else _WHOLE
    if len(free) > most:
        raise ConfigError(
            f"{len(free)} axes may be corrected, and {most} hold the tool: which way the others go is open. "
            f"Keep one of {', '.join(free)} with correct = false in its table"
        )


def joint_tables(machine: Kinematics, box: Mapping[str, tuple[float, float]]) -> list[str]:
    """The lines that define all tables of a machine with its errors."""
    structure, errors = machine.structure, machine.errors
    data = Data()
    order = [name for name in structure.chain if name != FRAME]
    data.array("olp_joint_list", "olp_joint", [_joint(data, machine, name) for name in order])
    masses = [
        f"{{{order.index(mass.on)}, {real(mass.kg)}, {triple(mass.centre_mm)}}}" for mass in errors.masses
    ]
    data.array("olp_mass_list", "olp_mass", masses)
    sags = [_sag(data, structure, order, term) for term in errors.gravity]
    data.array("olp_sag_list", "olp_sag", sags)
    wrong = about(
        columns_of(structure.gauge.point_mm),
        tilted(columns_of(errors.gauge_tilt_rad)),
        columns_of(errors.gauge_shift_mm),
    )
    joints = structure.joints.values()
    own = [errors.joints.get(name) for name in structure.order]
    sizes = {
        "OLP_AXES": len(order),
        "OLP_FRAME": structure.chain.index(FRAME),
        "OLP_MASSES": len(masses),
        "OLP_SAGS": len(sags),
        "OLP_YIELDS": int(bool(errors.yields)),
        "OLP_SYMMETRIC": int(structure.symmetric_tool),
        "OLP_RADIUS": real(REFERENCE_RADIUS_MM),
        "OLP_LARGEST_DEG": real(LARGEST_TURN_DEG),
    }
    gravity = [FREE_FALL_M_S2 * part for part in structure.gravity]
    units = [math.radians(1.0) * REFERENCE_RADIUS_MM if joint.unit == "deg" else 1.0 for joint in joints]
    rows = ", ".join(pair(box[name]) for name in structure.order)
    return [
        defines(sizes),
        *data.lines,
        f"static const olp_pose olp_gauge = {_pose(Columns.of(structure.gauge.pose))};",
        f"static const olp_pose olp_gauge_error = {_pose(wrong)};",
        f"static const double olp_gravity[3] = {triple(gravity)};",
        f"static const double olp_box[OLP_AXES][2] = {{{rows}}};",
        f"static const double olp_unit_mm[OLP_AXES] = {triple(units)};",
        *_linear(machine),
        _flags("olp_turns", [joint.unit == "deg" for joint in joints]),
        _flags("olp_corrects", [joint.correct for joint in joints]),
        _flags("olp_directed", [one is not None and one.backlash != 0.0 for one in own]),
    ]


def _sag(data: Data, structure: Structure, order: list[str], term: Gravity) -> str:
    direction = structure.joints[term.joint].direction
    turns = [
        math.radians(sign_about(structure, name, direction)) if name in term.angles else 0.0
        for name in structure.order
    ]
    own = f"{real(term.sine)}, {real(term.cosine)}"
    return f"{{{order.index(term.joint)}, {own}, {data.numbers(turns)}}}"


def has_tips(machine: Kinematics) -> bool:
    """Whether three linear axes follow from where the tip is."""
    try:
        linear_columns(machine.structure)
    except ConfigError:
        return False
    return True


def _linear(machine: Kinematics) -> list[str]:
    if not has_tips(machine):
        return []
    columns = ", ".join(map(str, linear_columns(machine.structure)))
    return [f"static const int olp_linear[3] = {{{columns}}};"]


def _flags(name: str, values: list[bool]) -> str:
    return f"static const int {name}[OLP_AXES] = {{{', '.join(str(int(v)) for v in values)}}};"


def _pose(pose: Columns) -> str:
    rows = pose.rows(1)
    turn = ", ".join(triple(row) for row in rows.rotation[0].tolist())
    return f"{{{{{turn}}}, {triple(rows.position[0])}}}"


def _joint(data: Data, machine: Kinematics, name: str) -> str:
    structure = machine.structure
    joint = structure.joints[name]
    errors = machine.errors.joints.get(name) or JointErrors(joint.point_mm)
    gives = machine.errors.yields.get(name) or Yield()
    line = tilted(columns_of(errors.tilt_rad)).turned(columns_of(joint.direction))
    across = np.cross(errors.tilt_rad, joint.direction)
    flags = (structure.order.index(name), joint.kind == "rotary", name in structure.workpiece_side)
    places = (joint.direction, joint.point_mm, np.array(line, float), across, errors.shift_mm)
    motions, harmonics = NONE, NONE
    if errors.curves:
        motions = f"olp_motions_{flags[0]}"
        data.array(motions, "olp_motion", [_motion(data, one) for one in errors.curves])
    if errors.harmonics:
        harmonics = f"olp_harmonics_{flags[0]}"
        waves = [(w.component, w.amplitude, 2.0 * np.pi / w.period, w.phase_rad) for w in errors.harmonics]
        data.array(
            harmonics, "olp_harmonic", [f"{{{c}, {', '.join(map(real, rest))}}}" for c, *rest in waves]
        )
    first = errors.curves[0] if errors.curves else None
    point = errors.point_mm if first is None else first.point_mm
    follows = first is not None and first.follows
    return (
        f"{{{', '.join(str(int(flag)) for flag in flags)}, {', '.join(triple(place) for place in places)},\n"
        f"     {real(errors.zero)}, {real(errors.datum)}, {real(errors.backlash)},\n"
        f"     {len(errors.curves)}, {motions}, {len(errors.harmonics)}, {int(follows)}, {triple(point)}, "
        f"{harmonics},\n     {real(gives.own)}, {triple(gives.tilt)}, {triple(gives.shift)}}}"
    )


def _motion(data: Data, motion: MotionCurve) -> str:
    values = motion.values
    columns = [
        f"&{curve(data, values, column)}" if values.y[:, column].any() else NONE for column in range(OWN + 1)
    ]
    flags = f"{int(motion.follows)}, {int(motion.periodic)}, {real(values.x[0])}"
    return f"{{{triple(motion.point_mm)}, {flags}, {{{', '.join(columns)}}}}}"
