"""The confidence of a run as a mapping for reports, and as findings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.toolpath import Toolpath
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.sensitivity import Expansion
from olp.errormodel.uncertainty import Uncertainty
from olp.findings.catalogue import Finding
from olp.uncertainty.components import Component
from olp.uncertainty.spread import COVERAGE, SEED, SURE, Confidence

#: Probabilities from here on are good enough: 2 sigma on both sides.
GOOD = 0.95
#: Standard uncertainties that have grown so much are old.
AGED = 2.0
_MOST_LINES, _LISTED = 10, 20
_NOT_INCLUDED = (
    "what the control does between blocks, forces, and the process",
    "maps, load and thermal structures",
)


def summary(
    found: Confidence,
    path: Toolpath,
    uncertainty: Uncertainty,
    growth: float,
    expansion: Expansion | None,
    parts: Sequence[Component],
    *,
    asked: bool,
) -> dict[str, Any]:
    """What the report says; `asked`: the user named the tolerance."""
    points = found.points
    band = found.band_mm * UM_PER_MM
    variance = (found.sigma_mm**2).sum(axis=1)
    frames = {int(k) for k in np.unique(path.frame[points.move])}
    touched = [k for k in frames if path.frames[k].touched or path.frames[k].tool_touched]
    return {
        "coverage_factor": COVERAGE,
        "source": uncertainty.source,
        "growth_by_age": growth,
        "repeatability_um": [v * UM_PER_MM for v in uncertainty.repeatability_mm],
        "temperature_K": uncertainty.temperature_K,
        "unmodelled_K": expansion.unmodelled_K if expansion is not None else 0.0,
        "zero_setting": _zero(len(touched), len(frames)),
        "not_included": list(_NOT_INCLUDED),
        "waypoints": len(found),
        "band_um": {
            "max_um": float(band.max(initial=0.0)),
            "median_um": float(np.median(band)) if len(band) else 0.0,
            "rms_um": _rms(band),
            "by_axis_max_um": {
                axis: float(COVERAGE * UM_PER_MM * found.sigma_mm[:, j].max(initial=0.0))
                for j, axis in enumerate(AXES)
            },
        },
        "expected": {
            "before_rms_um": _expected(points.before_mm, variance),
            "after_rms_um": _expected(points.after_mm, variance),
            "probability_better": found.gain,
        },
        "within": {
            "tolerance_um": found.within_mm * UM_PER_MM,
            "asked": asked,
            "before": _probabilities(found.within_before, found.program_before),
            "after": _probabilities(found.within_after, found.program_after),
            "draws": found.draws,
            "seed": SEED,
        },
        "lines": _lines(found),
        "components": [_component(part) for part in parts[:_LISTED]],
    }


def findings(
    found: Confidence,
    growth: float,
    expansion: Expansion | None,
    parts: Sequence[Component],
    left_out: frozenset[str],
    *,
    asked: bool,
) -> list[Finding]:
    """Where the gain is not sure, and what else is to be known about it."""
    out = []
    weak = (found.nearer < SURE) & (found.within_before < GOOD)
    if weak.any():
        lines = _numbers(found.line[weak])
        what = f"{int(weak.sum())} of {len(found)} way-points: what is taken away is within its uncertainty"
        out.append(_finding("OLP431", what, lines))
    if len(found) and found.gain < SURE:
        before, after = (
            _expected(side, (found.sigma_mm**2).sum(axis=1))
            for side in (found.points.before_mm, found.points.after_mm)
        )
        what = (
            f"the corrected program is better with a probability of {100 * found.gain:.0f} %: rms deviation "
            f"expected {before:.2f} um before, {after:.2f} um after"
        )
        out.append(_finding("OLP432", what))
    if asked and found.program_after < GOOD:
        poor = found.lines[found.line_after < GOOD]
        what = (
            f"all way-points are within {found.within_mm * UM_PER_MM:g} um with a probability of "
            f"{100 * found.program_after:.1f} %"
        )
        out.append(_finding("OLP433", what, _numbers(poor)))
    if expansion is not None and expansion.unmodelled_K > 0.0 and found.expansion_mm > 0.5 * found.within_mm:
        what = (
            f"temperatures differ by up to {expansion.unmodelled_K:g} K without an expansion in the "
            f"calibration: about {found.expansion_mm * UM_PER_MM:.1f} um on this program"
        )
        out.append(_finding("OLP434", what))
    doubtful = [part.name for part in parts if not part.sure and part.name not in left_out]
    if doubtful:
        out.append(_finding("OLP435", f"{', '.join(doubtful)}: smaller than 2 sigma"))
    if left_out:
        out.append(_finding("OLP436", f"{', '.join(sorted(left_out))}: not corrected"))
    if growth >= AGED:
        what = f"standard uncertainties are {growth:.2g} times those on the day of measuring"
        out.append(_finding("OLP437", what))
    return out


def _finding(code: str, message: str, lines: Sequence[int] = ()) -> Finding:
    first = lines[0] if lines else None
    return Finding(code, message, first, tuple(lines[:_LISTED]), max(len(lines), 1))


def _numbers(lines: Index) -> list[int]:
    return [int(line) for line in np.unique(lines).tolist()]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _expected(deviation_mm: Array, variance: Array) -> float:
    """Root of the expected mean square of deviations, um."""
    if not len(variance):
        return 0.0
    return float(np.sqrt(np.mean((deviation_mm**2).sum(axis=1) + variance)) * UM_PER_MM)


def _zero(touched: int, frames: int) -> str:
    if not touched:
        return "work offsets are true: nothing cancels, bands are those of absolute places"
    words = "bands are of places against the touch-off, where what both have in common cancels"
    return words if touched == frames else f"{words}; other work offsets are true, there nothing cancels"


def _probabilities(each: Array, program: float) -> dict[str, float]:
    return {
        "program": program,
        "least": float(each.min(initial=1.0)),
        "mean": float(each.mean()) if len(each) else 1.0,
    }


def _lines(found: Confidence) -> list[dict[str, Any]]:
    """The lines that are most likely out of tolerance after correction."""
    worst = np.argsort(found.line_after, kind="stable")[:_MOST_LINES]
    out = []
    for k in worst.tolist():
        own = found.line == found.lines[k]
        out.append(
            {
                "line": int(found.lines[k]),
                "band_um": float(found.band_mm[own].max() * UM_PER_MM),
                "before_um": float(np.sqrt((found.points.before_mm[own] ** 2).sum(axis=1)).max() * UM_PER_MM),
                "within_before": float(found.line_before[k]),
                "within_after": float(found.line_after[k]),
                "nearer": float(found.nearer[own].min()),
            }
        )
    return out


def _component(part: Component) -> dict[str, Any]:
    angle = part.name[1] in "ABC" or part.name[0] != "E"
    unit, scale = ("urad", 1.0 / RAD_PER_URAD) if angle else ("um", UM_PER_MM)
    return {
        "name": part.name,
        f"value_{unit}": part.value * scale,
        f"expanded_uncertainty_{unit}": COVERAGE * part.sigma * scale,
        "probability_helps": part.helps,
        "sure": part.sure,
    }
