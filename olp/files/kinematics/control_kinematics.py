"""What every table of a control's own kinematics has in common: what the control knows of a machine once the
values are entered, and what stays wrong with it.

A module of this package that `olp.files.kinematics.tables` names holds such tables in `TABLES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from olp.core.errors import ConfigError
from olp.core.machine import ZERO
from olp.core.values import dataclass
from olp.kinematics.columns import tilted, triple
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import FRAME, Joint, Structure

#: A linear axis is along its own within this.
_ALONG = 1e-12
#: The linear axes of a machine tool.
LINEAR = "XYZ"
#: What is to be done with a table that `olp init` does not read.
STATED = "state them in the machine file and fit the calibration again"


@dataclass(frozen=True, slots=True, eq=False)
class Entered:
    """The text of a table; the machine as the control `knows` it once the values are entered, rounded as they
    are written; and the errors of the machine that are left then. The last ones count from the nominal
    machine: lines that the table holds are still in them."""

    data: bytes
    known: Structure
    left: MachineErrors
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class KinematicTable:
    """One format. `enter` raises ConfigError for a machine that the table cannot hold. `then` says what is to
    be done once the control has the values, with the name of the file as `{file}`."""

    key: str
    title: str
    ending: str
    status: str
    holds: str
    enter: Callable[[Structure, MachineErrors], Entered]
    then: str = STATED


def as_it_lies(structure: Structure, errors: MachineErrors, *, turned: bool = True) -> Structure:
    """The structure with its rotary axes on the lines that the calibration says; without `turned` only their
    points, for controls that hold no directions. What else is wrong with the machine stays: linear axes,
    zeros, error motions, elasticity."""
    joints = dict(structure.joints)
    for name, joint in joints.items():
        wrong = errors.joints.get(name)
        if wrong is not None and joint.kind == "rotary":
            x, y, z = joint.direction
            if turned:
                turn = tilted(triple(wrong.tilt_rad))
                x, y, z = (float(part) for part in turn.turned(triple(joint.direction)))
            a, b, c = np.add(joint.point_mm, wrong.shift_mm).tolist()
            joints[name] = replace(joint, direction=(x, y, z), point_mm=(a, b, c))
    return replace(structure, joints=joints)


def rounded(structure: Structure, digit_mm: float) -> Structure:
    """The structure with the points of its rotary axes at whole digits of a control."""
    joints = dict(structure.joints)
    for name, joint in joints.items():
        if joint.kind == "rotary":
            x, y, z = (digit_mm * np.round(np.array(joint.point_mm) / digit_mm)).tolist()
            joints[name] = replace(joint, point_mm=(x, y, z))
    return replace(structure, joints=joints)


def left_zeros(structure: Structure, errors: MachineErrors) -> dict[str, float]:
    """By axis of the chain the error of its zero in mm or deg."""
    zeros = {}
    for name in structure.chain:
        joint, wrong = structure.joints.get(name), errors.joints.get(name)
        if joint is not None and wrong is not None and wrong.zero:
            zeros[name] = float(np.degrees(wrong.zero)) if joint.kind == "rotary" else wrong.zero
    return zeros


def without_zeros(errors: MachineErrors) -> MachineErrors:
    """The errors of a machine whose axes were set to their true zeros."""
    return replace(errors, joints={name: replace(wrong, zero=0.0) for name, wrong in errors.joints.items()})


def zero_notes(structure: Structure, errors: MachineErrors, what: str) -> tuple[str, ...]:
    """What to set at the reference points, for a table whose `what` hold no zeros of rotary axes."""
    return tuple(
        f"the zero of {name} is off by {value:.6f} deg; set it at the reference point, no {what} holds it"
        for name, value in left_zeros(structure, errors).items()
        if structure.joints[name].kind == "rotary"
    )


def turning(structure: Structure, what: str) -> tuple[list[Joint], list[Joint]]:
    """The one or two rotary axes of a machine tool before and behind the frame, in the order of the chain.
    Raises ConfigError, which says that `what` cannot hold the machine."""
    refuse(what, problems(structure))
    frame = structure.chain.index(FRAME)
    rotary = [
        (k, structure.joints[name])
        for k, name in enumerate(structure.chain)
        if name != FRAME and structure.joints[name].kind == "rotary"
    ]
    return [j for k, j in rotary if k < frame], [j for k, j in rotary if k > frame]


def refuse(what: str, found: Iterator[str]) -> None:
    """Raises ConfigError with all problems, where there are any."""
    listed = list(found)
    if listed:
        raise ConfigError(f"{what} cannot hold this machine: {'; '.join(listed)}")


def problems(structure: Structure) -> Iterator[str]:
    """Why a machine is not a machine tool whose one or two rotary axes are at the ends of its chain."""
    if structure.platforms:
        yield "it has a platform on legs"
        return
    yield from linear_problems(structure)
    if not 1 <= len(structure.joints) - len(LINEAR) <= 2:
        yield "expected X, Y and Z with one or two rotary axes"
    sides = ["".join(structure.joints[n].kind[0] for n in side) for side in _sides(structure)]
    if "lr" in sides[0] or "rl" in sides[1]:
        yield "a rotary axis carries a linear one; expected them at the workpiece and at the tool"
    if structure.gauge.point_mm != ZERO or structure.gauge.angles_deg != ZERO:
        yield "its gauge frame is not the zero of the machine"


def linear_problems(structure: Structure) -> Iterator[str]:
    """Why the linear axes of a machine are not X, Y and Z along the machine's own directions."""
    linear = {name: joint for name, joint in structure.joints.items() if joint.kind == "linear"}
    for name, joint in linear.items():
        if name not in LINEAR or abs(joint.direction[LINEAR.index(name)] - 1.0) > _ALONG:
            yield f"the linear axis {name} is not along X, Y or Z of the machine"
    if sorted(linear) != list(LINEAR):
        yield "its linear axes are not X, Y and Z"


def _sides(structure: Structure) -> tuple[list[str], list[str]]:
    chain, frame = list(structure.chain), structure.chain.index(FRAME)
    return chain[:frame], chain[frame + 1 :]
