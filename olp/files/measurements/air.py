"""Air and material compensation of the raw readings of a laser, from columns of the environment.

    # laser_zero_mm = 0.0
    # laser_assumes = { air_degC = 20.0, pressure_hPa = 1013.25, humidity_percent = 50.0 }
    target_mm,run,direction,value_um,air_degC,pressure_hPa,humidity_percent

A laser counts wavelengths, and these are shorter in dense air. The index of air is that of the equation of
B. Edlen as K. P. Birch and M. J. Downs revised it (Metrologia 1993, 1994), for 633 nm.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array
from olp.files.measurements.line_keys import LineKeys
from olp.files.measurements.readings import AIR, MATERIAL, Readings

#: Wavenumber of the laser squared, 1/um^2.
_WAVENUMBER_2 = 1.0 / 0.6329908**2
#: Pa per hPa.
_PA = 100.0
#: What the columns may hold.
_RANGES = {
    "air_degC": (-10.0, 60.0),
    "pressure_hPa": (500.0, 1200.0),
    "humidity_percent": (0.0, 100.0),
    "material_degC": (-10.0, 60.0),
}


def refractive_index(air_degC: Array, pressure_hPa: Array, humidity_percent: Array) -> Array:
    """(n,) refractive index of air for 633 nm."""
    t, p = np.asarray(air_degC, float), _PA * np.asarray(pressure_hPa, float)
    vapour = humidity_percent * 6.112 * np.exp(17.62 * t / (243.12 + t))
    standard = 1e-8 * (8342.54 + 2406147.0 / (130.0 - _WAVENUMBER_2) + 15998.0 / (38.9 - _WAVENUMBER_2))
    dense = (1.0 + 1e-8 * (0.601 - 0.00972 * t) * p) / (1.0 + 0.003661 * t)
    moist = 1e-10 * 292.75 / (t + 273.15) * (3.7345 - 0.0401 * _WAVENUMBER_2) * vapour
    return np.asarray(1.0 + p * standard * dense / 96095.43 - moist)


def environment_problems(readings: Readings, component: str, keys: LineKeys) -> Iterator[str]:
    """What is wrong with the columns of the environment and the keys that belong to them."""
    stated = readings.environment
    air, material = AIR[0] in stated, MATERIAL in stated
    wanted = {
        "laser_assumes": (keys.laser_assumes is not None, air),
        "laser_zero_mm": (keys.laser_zero_mm is not None, air or material),
        "expansion_um_m_K": (keys.expansion_um_m_K is not None, material),
        "material_reference_degC": (keys.material_reference_degC is not None, material),
    }
    for key, (given, needed) in wanted.items():
        if needed and not given:
            yield f"{key} is missing; the columns of the environment need it"
        elif given and not needed:
            yield f"{key} is stated, but the file has no column that needs it; leave it out"
    if (air or material) and component[1] != component[2]:
        yield f"columns of the environment are for positioning, and {component} is not; leave them out"
    for name, (low, high) in _RANGES.items():
        for value in stated.get(name, np.zeros(0)).tolist():
            if not low <= value <= high:
                yield f"{name} = {value:g}; expected {low:g} to {high:g}"
                break


def compensated(readings: Readings, keys: LineKeys) -> Readings:
    """Readings, in the sign convention of the file, as in the true air, and as with the material at its
    reference temperature. Without columns of the environment they stay as they are."""
    stated = readings.environment
    if not stated or keys.laser_zero_mm is None:
        return readings
    length = readings.target_mm - keys.laser_zero_mm
    scale = np.zeros(len(length))
    assumed = keys.laser_assumes
    if assumed is not None:
        index = refractive_index(*(stated[name] for name in AIR))
        taken = refractive_index(*(np.array(getattr(assumed, name)) for name in AIR))
        scale += taken / index - 1.0
    if keys.expansion_um_m_K is not None and keys.material_reference_degC is not None:
        warmer = stated[MATERIAL] - keys.material_reference_degC
        scale -= keys.expansion_um_m_K * 1e-6 * warmer
    sign = -1.0 if str(keys.sense).endswith("commanded-minus-actual") else 1.0
    return replace(readings, value=readings.value + sign * length * scale)
