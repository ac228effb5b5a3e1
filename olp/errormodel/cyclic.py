"""Errors that repeat with the pitch of a screw or the period of a scale.

They act on components, so an angular one has its levers too. They are evaluated directly: no table
of affordable size resolves a period of some hundredths of a millimetre.
"""

from __future__ import annotations

import math

import numpy as np

from olp.core.arrays import Array
from olp.errormodel.calibration import Cyclic


def cyclic_value(term: Cyclic, q: Array) -> Array:
    """(n,) amplitude * sin(2 pi q / period + phase) at axis positions q (n,) in mm; mm or rad."""
    angle = q * (2.0 * math.pi / term.period_mm)
    angle += term.phase_rad
    value = np.sin(angle, out=angle)
    value *= term.amplitude
    return value
