"""What the files of a machine of any joints hold, as values."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import field

from olp.core.machine import ZERO, Machine, Tool, Vector
from olp.core.toolpath import Interpolated
from olp.core.values import dataclass
from olp.kinematics.errors import MachineErrors, Payload
from olp.kinematics.structure import Structure


@dataclass(frozen=True, slots=True)
class JointMachine:
    """A machine file: the structure, the tools, and the path of the calibration, None where it names none.

    `control` is what a reader of programs needs to know of it: the linear axes X, Y and Z, work offsets and
    tools. It is None where the machine has other axes than these three and rotary ones. `arm` is the same for
    programs of robots, None where the machine is no arm of six axes whose last three meet in a point. With
    `tips_from_zero`
    programs with tool centre point control count from the workpiece with its rotary axes at zero, else from
    where these are when it is switched on; None is not stated. `leads` is what this mode leads evenly where
    the program does not say it, empty where the control decides. `swivel_axis` is the axis by whose position
    CYCLE800 chooses between two, empty where that is not stated. `real_time` is the beginning of the hash of
    the calibration that the control corrects by in every servo cycle, None where it does not.
    `largest_correction_mm` is the largest plausible error of the tip, None where it is not stated.
    """

    structure: Structure
    controller: str
    calibration: str | None = None
    tools: Mapping[int, Tool] = field(default_factory=dict)
    work_offsets: tuple[str, ...] = ()
    default_tool: int | None = None
    control: Machine | None = None
    arm: Machine | None = None
    tips_from_zero: bool | None = None
    leads: Interpolated = ""
    swivel_axis: str = ""
    real_time: str | None = None
    largest_correction_mm: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JointCalibration:
    """A calibration file: the errors, and the calibrated values of each axis in mm or deg. Its standard
    uncertainties grow by `growth_per_year`, a share. `payload` was on while measuring, where the errors do
    not say what a payload bends. `misfit_mm` is the standard deviation of each coordinate of the tip by what
    the errors do not explain."""

    errors: MachineErrors
    box: Mapping[str, tuple[float, float]]
    measured: datetime.date
    valid_until: datetime.date | None
    temperature_degC: float
    datum_mm: Vector = ZERO
    growth_per_year: float = 0.0
    payload: Payload = Payload()
    misfit_mm: float = 0.0
