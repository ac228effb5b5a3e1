"""What words of a program state on a machine: values of its axes, or the pose of its tool.

Where a platform on legs or an arm carries the tool, a control computes the axes: X, Y and Z are the tip in
machine coordinates. Where all turns are led, A, B and C are Rz Ry Rx of fixed axes in degrees; where one is,
it has the letter of its axis.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.kinematics.branches import family_of
from olp.kinematics.chain import Kinematics
from olp.kinematics.poses import Poses, rotation_vector, tilts
from olp.kinematics.postures import wrapped
from olp.kinematics.structure import FRAME, Structure

#: The step of words, mm or deg, where no axis states one.
_UNSTATED = 1e-6
#: The letters that turn the tool about X, Y and Z.
TURNS = "ABC"


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The coordinates of a program: their `names`, `units` and `steps`, which are least increments, by
    column. `poses` says that they state poses."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    steps: tuple[float, ...]
    poses: bool = False

    @staticmethod
    def of_axes(structure: Structure) -> Coordinates:
        """Values of the axes."""
        steps = tuple(joint.least_increment for joint in structure.joints.values())
        return Coordinates(structure.order, structure.units, steps)

    @staticmethod
    def of_words(structure: Structure) -> Coordinates:
        """What words state: poses where the control computes the axes, else values of the axes."""
        turns = stated_turns(structure)
        if turns is None:
            return Coordinates.of_axes(structure)
        lengths = [joint.least_increment for joint in structure.joints.values() if joint.unit == "mm"]
        finest = min((step for step in lengths if step > 0.0), default=_UNSTATED)
        units = ("mm",) * len(AXES) + ("deg",) * len(turns)
        steps = (finest,) * len(AXES) + (_UNSTATED,) * len(turns)
        return Coordinates((*AXES, *turns), units, steps, poses=True)

    @property
    def rotary(self) -> Mask:
        """(axes,) the columns in degrees."""
        return np.array([unit == "deg" for unit in self.units])

    @property
    def linear(self) -> Index:
        """(3,) the columns of X, Y and Z."""
        return np.array([self.names.index(name) for name in AXES])

    def beside(self, found: Array, near: Array) -> Array:
        """(n, axes) coordinates that state the same as `found`, with turns next to those of `near` (n, axes).
        Whole turns more state the same pose, and so does another triple of A, B and C."""
        turns = [self.names.index(name) for name in TURNS if self.poses and name in self.names]
        if not turns:
            return found
        own, wanted = found[:, turns], near[:, turns]
        triples = [own]
        if len(turns) == len(TURNS):
            triples.append(own * (1.0, -1.0, 1.0) + 180.0)
        away = [wrapped(triple - wanted) for triple in triples]
        size = [np.abs(part).max(axis=1) for part in away]
        best = np.where((size[-1] < size[0])[:, None], away[-1], away[0])
        result = found.copy()
        # where the near ones are not known, those that were found stay
        result[:, turns] = np.where(np.isnan(best), own, wanted + best)
        return result


def stated_turns(structure: Structure) -> str | None:
    """The letters that turn the tool where words state poses, None where they state axis values. A platform
    alone is led by poses where three axes or six are in its legs, and a serial machine that has a posture."""
    if structure.platforms or structure.posture is not None:
        return turns_of(structure)
    return None


def turns_of(structure: Structure) -> str | None:
    """The same for words that may state poses: of a serial machine also before its posture is known."""
    if not structure.platforms:
        family = family_of(structure)
        return None if family is None else family.turns
    alone = len(structure.platforms) == 1 and structure.chain == (FRAME, *structure.platforms)
    return {len(AXES): "", len(AXES) + len(TURNS): TURNS}.get(len(structure.order)) if alone else None


def states_poses(structure: Structure) -> bool:
    """Whether words of a program state poses."""
    return stated_turns(structure) is not None


def stated_poses(structure: Structure, values: Array) -> Poses:
    """(n) poses of the tool that coordinates (n, axes) state, in machine coordinates. What they do not turn
    is as with all axes at zero."""
    turns = stated_turns(structure)
    assert turns is not None
    angles = np.zeros((len(values), len(TURNS)))
    angles[:, [TURNS.index(letter) for letter in turns]] = np.radians(values[:, len(AXES) :])
    return Poses(tilts(angles) @ _reference(structure), values[:, : len(AXES)])


def poses_of_axes(machine: Kinematics, values: Array) -> Array:
    """(n, axes) coordinates that state the poses of the nominal machine at axis values (n, axes), NaN where
    these are unknown. Turns are within half a turn."""
    stated, known = np.full(values.shape, np.nan), np.isfinite(values).all(axis=1)
    pose, turns = machine.nominal(values[known]), stated_turns(machine.structure)
    assert turns is not None
    stated[known, : len(AXES)] = pose.position
    turn = pose.rotation @ _reference(machine.structure).T
    if len(turns) == 1:
        stated[known, len(AXES)] = np.degrees(rotation_vector(turn)[:, TURNS.index(turns)])
    elif turns:
        a = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
        b = np.arctan2(-turn[:, 2, 0], np.hypot(turn[:, 2, 1], turn[:, 2, 2]))
        c = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
        stated[known, len(AXES) :] = np.degrees(np.stack((a, b, c), axis=1))
    return stated


def _reference(structure: Structure) -> Array:
    """(3, 3) the rotation of the tool that is stated as no turn: that of the gauge on a platform."""
    family = None if structure.posture is None else family_of(structure)
    return structure.gauge.pose.rotation if family is None else family.reference
