"""`inspect` of a machine of any joints: what its files hold, in words, and the error at axis values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from olp.core.errors import UsageError
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.files.kinematics.load import JointSetup, load_joint_setup
from olp.files.write import PathLike
from olp.kinematics.errors import JointErrors
from olp.kinematics.measures import mobility, travel_left
from olp.kinematics.structure import Joint, Structure

#: Names of the directions of the machine, along and against them.
_ALONG = {(k, sign): f"{mark}{'XYZ'[k]}" for k in range(3) for sign, mark in ((1.0, "+"), (-1.0, "-"))}
#: A direction this close to an axis of the machine is named after it.
_ALMOST = 1e-9
#: The mobility is shown with so many decimals.
_DIGITS = 6


def joint_summary(machine: PathLike, job: PathLike | None = None) -> dict[str, Any]:
    """Chain, axes, platforms and calibration of a machine file, with units in the keys. Raises InputError,
    ConfigError."""
    setup = load_joint_setup(machine, job)
    described, structure, calibration = setup.machine, setup.machine.structure, setup.calibration
    summary: dict[str, Any] = {
        "machine": {
            "name": structure.name,
            "chain": " ".join(structure.chain),
            "controller": described.controller,
            "gauge_mm": list(structure.gauge.point_mm),
            "gauge_deg": list(structure.gauge.angles_deg),
            "tool_symmetry": "axis" if structure.symmetric_tool else "none",
            "work_offsets": sorted(described.work_offsets),
            "tools": sorted(described.tools),
        }
    }
    if calibration is not None:
        summary["calibration"] = {
            "measured": calibration.measured,
            "valid_until": calibration.valid_until,
            "temperature_degC": calibration.temperature_degC,
            "masses": len(calibration.errors.masses),
            "gravity": len(calibration.errors.gravity),
            "payload_kg": calibration.errors.payload.kg,
        }
    summary["axes"] = {name: _axis(setup, joint) for name, joint in structure.joints.items()}
    if structure.platforms:
        summary["platforms"] = {
            name: {
                "legs": len(platform.legs),
                "orientation": "solved" if platform.turns else "fixed",
                "driven_by": [leg.axis or leg.carriage for leg in platform.legs],
            }
            for name, platform in structure.platforms.items()
        }
    return summary


def _axis(setup: JointSetup, joint: Joint) -> dict[str, Any]:
    structure, calibration = setup.machine.structure, setup.calibration
    values: dict[str, Any] = {"carries": carried_by(structure, joint), "tool": in_words(joint)}
    if joint.kind == "rotary":
        values["point_mm"] = list(joint.point_mm)
    values[f"travel_{joint.unit}"] = list(joint.travel)
    if not joint.correct:
        values["correct"] = False
    if calibration is not None:
        values[f"calibrated_{joint.unit}"] = list(calibration.box[joint.name])
        values |= _errors(joint, calibration.errors.joints[joint.name])
    return values


def carried_by(structure: Structure, joint: Joint) -> str:
    """What an axis carries: the workpiece, the tool, or legs of a platform."""
    if joint.name not in structure.chain:
        return "legs"
    return "workpiece" if joint.name in structure.workpiece_side else "tool"


def in_words(joint: Joint) -> str:
    """What the tool does relative to the workpiece while the axis value grows."""
    if joint.kind == "length":
        return "leg grows"
    sizes = np.abs(joint.direction)
    k = int(np.argmax(sizes))
    line = _ALONG[k, float(np.sign(joint.direction[k]))]
    if sizes[k] < 1.0 - _ALMOST:
        line = "[" + ", ".join(f"{part:.4g}" for part in joint.direction) + "]"
    return f"turns about {line}" if joint.kind == "rotary" else f"moves along {line}"


def _errors(joint: Joint, errors: JointErrors) -> dict[str, Any]:
    """The sizes of what a calibration states of one axis, where it states anything."""
    angle = joint.kind == "rotary"
    unit, scale = ("urad", 1.0 / RAD_PER_URAD) if angle else ("um", UM_PER_MM)
    values: dict[str, Any] = {}
    if any(errors.shift_mm):
        values["location_um"] = [part * UM_PER_MM for part in errors.shift_mm]
    if any(errors.tilt_rad):
        values["location_urad"] = [part / RAD_PER_URAD for part in errors.tilt_rad]
    if errors.zero:
        values[f"zero_{unit}"] = errors.zero * scale
    if errors.backlash:
        values[f"backlash_{unit}"] = errors.backlash * scale
    if errors.curves:
        values["curves"] = len(errors.curves)
    if errors.harmonics:
        values["cyclic"] = len(errors.harmonics)
    return values


def joint_error_at(
    machine: PathLike, axes: Mapping[str, float], job: PathLike | None = None, tool: int | None = None
) -> dict[str, Any]:
    """The pose of the tool at axis values in mm and deg, and its error there: actual minus nominal, in
    workpiece coordinates. Axes that are left out are at 0. Raises UsageError, InputError, ConfigError,
    CannotCompute."""
    setup = load_joint_setup(machine, job, tool)
    structure, kinematics = setup.machine.structure, setup.kinematics
    unknown = sorted(axes.keys() - structure.joints.keys())
    if unknown:
        raise UsageError(
            f"{', '.join(unknown)}: no such axis of {structure.name!r}; expected {', '.join(structure.order)}"
        )
    values = structure.axis_values(axes)
    shift, turn = kinematics.deviation(values)
    left = travel_left(structure, values)[0]
    return {
        "axes": {
            f"{name}_{unit}": float(value)
            for name, unit, value in zip(structure.order, structure.units, values[0], strict=True)
        },
        "tool_mm": list(kinematics.tool_mm),
        "position_mm": kinematics.nominal(values).position[0].tolist(),
        "error_um": (shift[0] * UM_PER_MM).tolist(),
        "rotation_urad": (turn[0] / RAD_PER_URAD).tolist(),
        "mobility": round(float(mobility(kinematics, values).smallest[0]), _DIGITS),
        "beyond_travel": [n for n, rest in zip(structure.order, left, strict=True) if rest < 0.0],
    }
