"""What a fit says of temperatures: the thermal structure of the calibration, and rows of the report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from olp.calibration.estimator.fitted import Fit
from olp.calibration.observations.base import unit_of
from olp.calibration.observations.sensors import coefficients, ranges_of, shapes_of
from olp.core.units import AXES
from olp.errormodel.sources.structure import Distortion, Sensor, Structure

#: Decimals of coefficients in mm and rad per K, and how many more those of growth per mm have.
_DIGITS = 7, 10
_PER_MM = 3


def structure_of(fit: Fit) -> Structure | None:
    """How the machine changes with each K of each sensor, from the temperatures at which its curves hold.
    None where no line has sensors."""
    p = fit.parameters
    if not p.warm:
        return None
    own = [line for line in fit.measurements.lines if line.sensors_degC]
    ranges = ranges_of([(line.source, line.sensors_degC) for line in own])
    sensors = tuple(Sensor(name, at, ranges[name]) for name, at in p.sensors_degC.items())
    distortions = []
    for name in p.warm:
        of_axis = f"E{name[2]}{name[2]}"
        line = p.measuring_lines[name if name[1] in AXES else of_axis]
        digits = _DIGITS[name[1] in "ABC"]
        values = coefficients(fit.theta[p.slices[f"warm {name}"]], shapes_of(name, p.warm))
        for sensor, (offset, growth, bow) in zip(p.sensors_degC, values.tolist(), strict=True):
            distortions.append(
                Distortion(
                    name, sensor, p.span_mm(name), round(offset, digits), round(growth, digits + _PER_MM),
                    round(bow, digits), line.line_mm, line.tool_mm,
                )
            )  # fmt: skip
    return Structure(sensors, tuple(distortions))


def temperature_rows(fit: Fit) -> dict[str, Any]:
    """Tables of sensors and of what each K does, with standard uncertainties; none without sensors."""
    structure = structure_of(fit)
    if structure is None:
        return {}
    sensors = [
        {"name": one.name, "reference_degC": one.reference_degC, "lowest_degC": one.range_degC[0],
         "highest_degC": one.range_degC[1]}
        for one in structure.sensors
    ]  # fmt: skip
    tables: dict[str, Any] = {"sensors": sensors}
    for name in fit.parameters.warm:
        section = f"per_kelvin_of_{'angles' if name[1] in 'ABC' else 'lengths'}"
        tables.setdefault(section, []).extend(_rows(fit, name))
    return tables


def _rows(fit: Fit, name: str) -> Iterator[dict[str, Any]]:
    part, kinds = fit.parameters.slices[f"warm {name}"], shapes_of(name, fit.parameters.warm)
    unit, scale = unit_of(name)
    sigma = np.sqrt(np.diag(fit.covariance)[part])
    values, sigmas = (scale * row.reshape(-1, len(kinds)) for row in (fit.theta[part], sigma))
    for k, sensor in enumerate(fit.parameters.sensors_degC):
        row: dict[str, Any] = {"name": f"{name} by {sensor}"}
        for kind, value, spread in zip(kinds, values[k].tolist(), sigmas[k].tolist(), strict=True):
            key = f"{kind}_{unit}_{'m_' if kind == 'growth' else ''}K"
            row |= {key: value, f"sigma_{key}": spread}
        yield row
