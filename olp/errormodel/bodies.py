"""The three moving bodies of a chain: what each carries, and the lever arm on which its angles act."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import CHAINS, Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.components import ActingTerm, AxisComponents
from olp.errormodel.lever_arms import LeverArms, lever_arms_of, measured_as
from olp.errormodel.sources.squareness import shears

#: mm; short series of sine and cosine may be wrong by so much at the tip, anywhere in the box.
TRIGONOMETRY_MM = 2e-11
#: mm; the longest tool vector for which that holds, along each axis.
TOOL_REACH_MM = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Axis `axis` of the chain. `shear` (3,) times (q - datum) is its squareness; `lever_arms` lists (rows,
    lever arm). `sine_terms` 1 or 2: so many terms of the sine series (and cosine to second order) are exact
    to TRIGONOMETRY_MM; 0: take sine and cosine themselves. `sines` are the components with the sines of the
    angles where a table of these saves the second term."""

    axis: int
    carries_workpiece: bool
    components: AxisComponents
    shear: Vector
    datum_mm: float
    lever_arms: LeverArms
    sine_terms: int
    sines: AxisComponents | None = None


@lru_cache(maxsize=1)  # a run builds the model that refuses what is outside the box, and that which holds
def build_bodies(
    calibration: Calibration, chain: str, skip: frozenset[str], *, tool_terms: bool = True
) -> tuple[Body, ...]:
    """Bodies from tool to workpiece; raises ConfigError for an unknown chain."""
    if chain not in CHAINS:
        raise ConfigError(f"chain '{chain}'; expected X, Y, Z and F from workpiece to tool, such as FXYZ")
    order = chain.replace("F", "")
    tilts = shears(calibration.squareness, skip)
    bodies = []
    for place in reversed(range(3)):
        axis, after = order[place], order[place + 1 :]
        carries = chain.index(axis) < chain.index("F")
        j = AXES.index(axis)
        curves, datum_mm = calibration.curves_of(axis), calibration.datum_mm
        lever_arms = lever_arms_of(curves, datum_mm, axis, after, carries, tool_terms)
        cyclic = []
        for term in calibration.cyclic:
            if term.component[2] == axis and term.amplitude != 0.0 and term.component not in skip:
                measured = measured_as(curves, axis, term.measured())
                own = lever_arms_of(measured, datum_mm, axis, after, carries, tool_terms)
                cyclic.append(ActingTerm.of(term, own, lever_arms))
        components = AxisComponents.of(calibration, axis, skip, tuple(cyclic))
        peak = max((v.peak for v in components.variation[3:] if v is not None), default=0.0)
        reach_mm = _reach_mm(lever_arms, calibration.box_mm)
        terms = _sine_terms(peak, reach_mm)
        sines = components.with_sines(TRIGONOMETRY_MM / reach_mm) if terms == 2 else None
        bodies.append(Body(j, carries, components, tilts[axis], datum_mm[j], lever_arms, terms, sines))
    return tuple(bodies)


def _reach_mm(lever_arms: LeverArms, box_mm: Array) -> float:
    """The longest lever arm along an axis, anywhere in the box and with any tool."""
    tool = np.array([[TOOL_REACH_MM] * 3, [-TOOL_REACH_MM] * 3])
    return max(float(lever_arm.reach_mm(box_mm, tool).max()) for _, lever_arm in lever_arms)


def _sine_terms(peak: float, reach_mm: float) -> int:
    if (peak * peak) * (peak * peak) / 8.0 * reach_mm > TRIGONOMETRY_MM:
        return 0
    return 2 if peak**3 / 6.0 * reach_mm > TRIGONOMETRY_MM else 1
