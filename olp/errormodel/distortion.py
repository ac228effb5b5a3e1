"""How a part follows a sensor, and in which shapes an axis distorts with it.

The thermal structure (`olp.errormodel.sources.structure`) evaluates these shapes, and
`olp.calibration.thermal` identifies them from logs.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array

#: The shapes, in the order of the columns of `shapes`.
SHAPES = ("offset", "growth", "bow")


def shapes(span_mm: tuple[float, float], q: Array) -> Array:
    """(n, 3) offset, growth and bow at axis positions q (n,)."""
    middle, half = 0.5 * (span_mm[0] + span_mm[1]), 0.5 * (span_mm[1] - span_mm[0])
    u = q - middle
    return np.stack([np.ones_like(u), u, 1.0 - (u / half) ** 2], axis=1)


def lagged(time_s: Array, temperature_degC: Array, lag_s: float) -> Array:
    """(n,) structure temperature behind a sensor (n,), exact for a sensor that changes linearly between its
    readings; it starts settled. A negative lag is a lead: the sensor lags its part by so much. Then the rise
    of the sensor over its lag is added to the sensor."""
    if lag_s == 0.0:
        return temperature_degC
    if lag_s < 0.0:
        return 2.0 * temperature_degC - lagged(time_s, temperature_degC, -lag_s)
    step = np.diff(time_s)
    keep = np.exp(-step / lag_s)
    rate = np.diff(temperature_degC) / step
    # theta - T + lag * rate decays; so theta(end) = T(end) - lag rate + keep (theta - T(start) + lag rate)
    drive = temperature_degC[1:] - lag_s * rate - keep * (temperature_degC[:-1] - lag_s * rate)
    structure_degC = [float(temperature_degC[0])]
    for k, d in zip(keep.tolist(), drive.tolist(), strict=True):
        structure_degC.append(k * structure_degC[-1] + d)
    return np.array(structure_degC)
