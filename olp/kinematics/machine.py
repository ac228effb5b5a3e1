"""What the files of a machine of any joints hold, as values."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import field

from olp.core.machine import Tool
from olp.core.values import dataclass
from olp.kinematics.errors import MachineErrors
from olp.kinematics.structure import Structure


@dataclass(frozen=True, slots=True)
class JointMachine:
    """A machine file: the structure, the tools, and the path of the calibration, None where it names none."""

    structure: Structure
    controller: str
    calibration: str | None = None
    tools: Mapping[int, Tool] = field(default_factory=dict)
    work_offsets: tuple[str, ...] = ()
    default_tool: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JointCalibration:
    """A calibration file: the errors, and the calibrated values of each axis in mm or deg."""

    errors: MachineErrors
    box: Mapping[str, tuple[float, float]]
    measured: datetime.date
    valid_until: datetime.date | None
    temperature_degC: float
