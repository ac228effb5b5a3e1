"""From logs of temperatures and drift to the thermal structure of a machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.thermal.drift import ThermalFit, findings, identify
from olp.core.errors import ConfigError
from olp.core.machine import Setup
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.sources.structure import Structure
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.structure import read_drift_log, structure_text
from olp.findings.catalogue import Finding
from olp.workflows.session import PathLike, Session
from olp.workflows.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class ThermalFitting(Shown):
    """The identified `structure`, its file (`data`, olp-thermal-1), the report ("olp-thermal-fit-1") and the
    findings."""

    structure: Structure
    data: bytes
    report: dict[str, Any]
    findings: tuple[Finding, ...]


def fit_thermal(
    logs: Sequence[PathLike],
    machine: PathLike | Setup,
    *,
    reference_degC: float | Mapping[str, float] | None = None,
    sensors: Sequence[str] = (),
) -> ThermalFitting:
    """Identify how the structure of a machine distorts with the temperatures of its sensors.

    `logs` are CSV files `t_s, NAME_degC ..., EXX@500_um ...`: time, sensors, and readings of drift of a
    component at an axis position. `reference_degC` are the readings of the sensors without distortion, by
    name or one for all; default the temperature of the calibration. `sensors` chooses some. Raises
    InputError, ConfigError, and CannotCompute where the logs do not determine the structure.
    """
    session = Session.start(machine)
    described = session.setup.machine
    if described.calibration is None:
        raise ConfigError(
            f"machine {described.name!r} names no calibration; its box_mm and temperature_degC are needed"
        )
    calibration = load_calibration(described.calibration, described)
    reference = calibration.temperature_degC if reference_degC is None else reference_degC
    read = [read_drift_log(log) for log in logs]
    if isinstance(reference, Mapping) and read:
        missing = [n for n in (sensors or read[0].sensors_degC) if n not in reference]
        unknown = [n for n in reference if n not in read[0].sensors_degC]
        if missing or unknown:
            what = (
                f"no reference of sensor {missing[0]}"
                if missing
                else f"{unknown[0]} is not a sensor of the logs"
            )
            raise ConfigError(f"{what}; expected one temperature in degC for each sensor, or one for all")
    fit = identify(read, np.asarray(calibration.box_mm, float), reference, sensors=sensors)
    report = _report(fit, described.name, logs)
    notes = [
        "Thermal structure, identified by olp calibrate thermal from "
        + ", ".join(Path(n).name for n in logs),
        f"condition of the sensors {fit.condition:.3g}; drift removed where it was not fitted "
        f"({fit.held_out}): {fit.removed:.1%}",
        'Name this file in the calibration file: [thermal] structure = "..."',
    ]
    data = structure_text(fit.structure, described.name, notes)
    return ThermalFitting(fit.structure, data, report, findings(fit))


def _report(fit: ThermalFit, machine: str, logs: Sequence[PathLike]) -> dict[str, Any]:
    components = []
    for c in fit.components:
        unit, scale = ("urad", 1.0 / RAD_PER_URAD) if c.component[1] in "ABC" else ("um", UM_PER_MM)
        components.append(
            {
                "component": c.component,
                "shapes": list(c.shapes),
                "positions": c.positions,
                "readings": c.readings,
                f"drift_rms_{unit}": c.drift_rms * scale,
                f"left_rms_{unit}": c.residual_rms * scale,
                f"held_out_drift_rms_{unit}": _known(c.held_out_drift_rms * scale),
                f"held_out_left_rms_{unit}": _known(c.held_out_rms * scale),
            }
        )
    coefficients = []
    for d, sigma in zip(fit.structure.distortions, fit.sigma, strict=True):
        unit, scale = ("urad", 1.0 / RAD_PER_URAD) if d.component[1] in "ABC" else ("um", UM_PER_MM)
        row: dict[str, Any] = {"component": d.component, "sensor": d.sensor}
        for name, more, value, s in zip(
            (f"offset_{unit}_K", f"growth_{unit}_m_K", f"bow_{unit}_K"),
            (1.0, 1e3, 1.0),
            (d.offset, d.growth, d.bow),
            sigma,
            strict=True,
        ):
            row[name], row[f"sigma_{name}"] = value * scale * more, s * scale * more
        coefficients.append(row)
    return {
        "schema": "olp-thermal-fit-1",
        "machine": machine,
        "logs": [Path(log).name for log in logs],
        "sensors": [
            {
                "name": s.name,
                "reference_degC": s.reference_degC,
                "range_degC": list(s.range_degC),
                "lag_s": s.lag_s,
            }
            for s in fit.structure.sensors
        ],
        "condition": fit.condition,
        "held_out": fit.held_out,
        "held_out_removed_share": _known(fit.removed),
        "components": components,
        "coefficients": coefficients,
        "findings": [f.as_dict() for f in findings(fit)],
    }


def _known(value: float) -> float | None:
    return None if np.isnan(value) else value
