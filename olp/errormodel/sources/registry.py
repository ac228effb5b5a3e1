"""The error sources that a calibration may hold, in the order of their tables in a file."""

from __future__ import annotations

from typing import Any

from olp.errormodel.entry import Numbers
from olp.errormodel.sources.backlash import Backlash
from olp.errormodel.sources.base import ErrorSource
from olp.errormodel.sources.beams import Beams
from olp.errormodel.sources.compliance import Compliance
from olp.errormodel.sources.curves import Curves
from olp.errormodel.sources.cyclic import CyclicErrors
from olp.errormodel.sources.expansion import ScaleExpansion
from olp.errormodel.sources.maps import Maps
from olp.errormodel.sources.repeatability import Repeatability
from olp.errormodel.sources.squareness import Squareness
from olp.errormodel.sources.structure import ThermalStructure

#: Every error source; nothing else lists them.
SOURCES: tuple[ErrorSource[Any, Any], ...] = (
    Curves(),
    Squareness(),
    Backlash(),
    Repeatability(),
    CyclicErrors(),
    Maps(),
    Compliance(),
    Beams(),
    ScaleExpansion(),
    ThermalStructure(),
)

#: The kinds of numbers that a covariance may hold, by name.
NUMBERS: dict[str, Numbers] = {numbers.kind: numbers for source in SOURCES for numbers in source.numbers}
