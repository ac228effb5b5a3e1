"""Unit factors to the base units: mm, s, rad, kg, degC. Used only at the edge of text."""

from __future__ import annotations

MM_PER_INCH = 25.4
MM_PER_UM = 1e-3
RAD_PER_URAD = 1e-6
UM_PER_MM = 1e3
AXES = "XYZ"
