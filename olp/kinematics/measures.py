"""How well a posture moves the tool: its distance from singular postures, and from the ends of travel."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.structure import REFERENCE_RADIUS_MM, Structure


@dataclass(frozen=True, slots=True, eq=False)
class Mobility:
    """Of each row the singular values (n, m) of the scaled Jacobian, the largest first. It leads from mm, and
    from arcs in mm at the reference radius, of the axes to the same of the tool."""

    singular_values: Array

    @property
    def smallest(self) -> Array:
        """(n,) the least motion of the tool by a motion of the axes of 1 mm: 0 at a singular posture."""
        return np.asarray(self.singular_values[:, -1])

    @property
    def condition(self) -> Array:
        """(n,) largest over smallest; infinite at a singular posture."""
        smallest = self.smallest
        safe = np.where(smallest > 0.0, smallest, 1.0)
        return np.where(smallest > 0.0, self.singular_values[:, 0] / safe, np.inf)

    @property
    def manipulability(self) -> Array:
        """(n,) product of the singular values (Yoshikawa 1985)."""
        return np.asarray(np.prod(self.singular_values, axis=1))


def mobility(
    machine: Kinematics, values: Array, reference_radius_mm: float = REFERENCE_RADIUS_MM
) -> Mobility:
    """How postures `values` (n, axes) in mm and deg move the tool of the nominal machine. With as many axes
    as the tool has freedoms, or fewer, the smallest singular value is 0 where an axis has no effect of its
    own. Raises CannotCompute where a platform does not close."""
    slopes = machine.jacobian(values)
    slopes[:, 3:] *= reference_radius_mm
    rotary = [joint.unit == "deg" for joint in machine.structure.joints.values()]
    slopes /= np.where(rotary, reference_radius_mm, 1.0)
    if machine.structure.symmetric_tool:
        across = np.swapaxes(machine.nominal(values).rotation, -1, -2)[:, :2]
        slopes = np.concatenate((slopes[:, :3], across @ slopes[:, 3:]), axis=1)
    return Mobility(np.asarray(np.linalg.svd(slopes, compute_uv=False), float))


def travel_left(structure: Structure, values: Array) -> Array:
    """(n, axes) mm or deg from axis values (n, axes) to the nearer end of travel; negative beyond it."""
    ends = np.array([joint.travel for joint in structure.joints.values()])
    return np.asarray(np.minimum(values - ends[:, 0], ends[:, 1] - values))
