"""`calibrate plan --next` on a machine of any joints: the postures that a tracker should read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.design.choosing import Criterion
from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.poses import Postures
from olp.calibration.joints.random_postures import random_postures
from olp.calibration.joints.unknowns import model_of
from olp.core.arrays import Array
from olp.core.errors import UsageError
from olp.core.machine import Vector
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.core.values import dataclass
from olp.files.kinematics.machine import load_joint_machine
from olp.files.write import read_bytes
from olp.kinematics.structure import Structure
from olp.program.pointlist.axis_list import read_axis_list
from olp.workflows.session import PathLike
from olp.workflows.shown import Filed

#: Random postures from which to choose, and the seed of their axis values.
CANDIDATES = 1500
SEED = 1
#: Draws of random postures that the choice is compared with.
_DRAWS = 5
#: The usual sigma of a coordinate of a tracker, in um.
SIGMA_UM = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPoses(Filed):
    """(n, axes) `values` of the postures to read, in order; the report ("olp-poses-1")."""

    structure: Structure
    values: Array
    report: dict[str, Any]
    findings: tuple[()] = ()
    inputs: tuple[str, ...] = ()

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The list of axis values `target`, which is a program of such a machine."""
        order, joints = self.structure.order, self.structure.joints
        head = ",".join(f"{name}_{joints[name].unit}" for name in order)
        rows = [",".join(f"{value:.4f}" for value in row) for row in (self.values + 0.0).tolist()]
        return {Path(target): ("\n".join(["# joined=points", head, *rows]) + "\n").encode()}

    def to_text(self) -> str:
        """The report as the command line prints it."""
        from olp.reports.outline import outline
        from olp.reports.report import plain

        return outline(plain(self.report))


def plan_poses(
    machine: PathLike,
    count: int,
    *,
    reflector_mm: Vector = (0.0, 0.0, 0.0),
    sigma_um: float = SIGMA_UM,
    criterion: Criterion = "A",
    among: PathLike | None = None,
) -> PlannedPoses:
    """The postures that a tracker should read to calibrate a machine of any joints, `count` of them.

    `reflector_mm` is the vector from the gauge point to the reflector, `sigma_um` the uncertainty of a
    coordinate. `among` is a list of postures that the machine can take. Without it they are random ones
    within the travel of all axes; of a platform those of random poses. Raises InputError, ConfigError,
    UsageError, CannotCompute.
    """
    structure = load_joint_machine(machine).structure
    values = random_postures(structure, CANDIDATES, SEED) if among is None else _listed(among, structure)
    model = model_of(structure, values, Priors.of(structure))
    if count > len(values):
        raise UsageError(f"there are {len(values)} postures to choose {count} from; ask for fewer")
    postures = Postures.of(model, values, reflector_mm, sigma_um * MM_PER_UM)
    choice = postures.chosen(count, criterion)
    rng = np.random.default_rng(SEED)
    drawn = [postures.tip_mm(rng.permutation(len(values))[:count]) for _ in range(_DRAWS)]
    report = {
        "schema": "olp-poses-1",
        "machine": structure.name,
        "postures": count,
        "candidates": len(values),
        "unknowns": len(model.unknowns),
        "sigma_um": sigma_um,
        "tip_before_um": float(choice.rms_mm[0]) * UM_PER_MM,
        "tip_after_um": float(choice.rms_mm[-1]) * UM_PER_MM,
        "tip_after_random_ones_um": float(np.median(drawn)) * UM_PER_MM,
    }
    files = (str(machine), *(() if among is None else (str(among),)))
    return PlannedPoses(structure, values[choice.index], report, inputs=files)


def _listed(file: PathLike, structure: Structure) -> Array:
    return read_axis_list(read_bytes(file), structure.order, structure.units).values
