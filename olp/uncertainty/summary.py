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
from olp.uncertainty.spread import COVERAGE, PROBABLE_GAIN, SEED, Chances, Confidence

#: Probabilities from here on are good enough: 2 sigma on both sides.
GOOD = 0.95
#: Standard uncertainties that have grown by this factor are reported as old.
AGED = 2.0
#: Lines in the report, at most.
_MOST_LINES = 10
#: Components in the report, and lines of a finding, at most.
_LISTED = 20
#: What the uncertainty does not cover.
_NOT_INCLUDED = (
    "what the control does between blocks, forces, and the process",
    "maps, load and thermal structures",
)


def summary(
    confidence: Confidence,
    path: Toolpath,
    uncertainty: Uncertainty,
    growth: float,
    expansion: Expansion | None,
    parts: Sequence[Component],
) -> dict[str, Any]:
    """The part of the report; probabilities only with a part tolerance."""
    points, chances = confidence.points, confidence.chances
    band = confidence.band_mm * UM_PER_MM
    variance = (confidence.sigma_mm**2).sum(axis=1)
    frames = {int(k) for k in np.unique(path.frame[points.move])}
    touched = [k for k in frames if path.frames[k].touched]
    return {
        "coverage_factor": COVERAGE,
        "source": uncertainty.source,
        "growth_by_age": growth,
        "repeatability_um": [v * UM_PER_MM for v in uncertainty.repeatability_mm],
        "temperature_K": uncertainty.temperature_K,
        "unmodelled_K": expansion.unmodelled_K if expansion is not None else 0.0,
        "zero_setting": _zero(len(touched), len(frames)),
        "not_included": list(_NOT_INCLUDED),
        "waypoints": len(confidence),
        "band_um": {
            "max_um": float(band.max(initial=0.0)),
            "median_um": float(np.median(band)) if len(band) else 0.0,
            "rms_um": _rms(band),
            "by_axis_max_um": {
                axis: float(COVERAGE * UM_PER_MM * confidence.sigma_mm[:, j].max(initial=0.0))
                for j, axis in enumerate(AXES)
            },
        },
        "expected": {
            "before_rms_um": _expected(points.before_mm, variance),
            "after_rms_um": _expected(points.after_mm, variance),
            "probability_better": None if chances is None else chances.gain,
        },
        "within": None if chances is None else {
            "tolerance_um": chances.limit_mm * UM_PER_MM,
            "before": _probabilities(chances.before, chances.program_before),
            "after": _probabilities(chances.after, chances.program_after),
            "draws": chances.draws,
            "seed": SEED,
        },
        "lines": [] if chances is None else _lines(confidence, chances),
        "components": [_component(part) for part in parts[:_LISTED]],
    }  # fmt: skip


def findings(
    confidence: Confidence,
    growth: float,
    expansion: Expansion | None,
    parts: Sequence[Component],
    left_out: frozenset[str],
) -> list[Finding]:
    """Findings about components whose gain is not probable and about the uncertainty; with a part tolerance
    also about waypoints and the program."""
    results = [] if confidence.chances is None else _of_chances(confidence, confidence.chances, expansion)
    doubtful = [part.name for part in parts if not part.probable and part.name not in left_out]
    if doubtful:
        what = f"{', '.join(doubtful)}: smaller than their expanded uncertainty (k = {COVERAGE:g})"
        results.append(_finding("OLP435", what))
    if left_out:
        results.append(_finding("OLP436", f"{', '.join(sorted(left_out))}: not corrected"))
    if growth >= AGED:
        what = f"standard uncertainties are {growth:.2g} times those on the day of measuring"
        results.append(_finding("OLP437", what))
    return results


def _of_chances(confidence: Confidence, chances: Chances, expansion: Expansion | None) -> list[Finding]:
    results = []
    weak = (chances.nearer < PROBABLE_GAIN) & (chances.before < GOOD)
    if weak.any():
        lines = _numbers(confidence.line[weak])
        what = f"{int(weak.sum())} of {len(confidence)} waypoints: the correction is within its uncertainty"
        results.append(_finding("OLP431", what, lines))
    if len(confidence) and chances.gain < PROBABLE_GAIN:
        before, after = (
            _expected(side, (confidence.sigma_mm**2).sum(axis=1))
            for side in (confidence.points.before_mm, confidence.points.after_mm)
        )
        what = (
            f"the corrected program is better with a probability of {100 * chances.gain:.0f} %: expected "
            f"rms deviation {before:.2f} um uncorrected, {after:.2f} um corrected"
        )
        results.append(_finding("OLP432", what))
    if chances.program_after < GOOD:
        poor = chances.lines[chances.line_after < GOOD]
        what = (
            f"all waypoints are within {chances.limit_mm * UM_PER_MM:g} um with a probability of "
            f"{100 * chances.program_after:.1f} %"
        )
        results.append(_finding("OLP433", what, _numbers(poor)))
    if (
        expansion is not None
        and expansion.unmodelled_K > 0.0
        and confidence.expansion_mm > 0.5 * chances.limit_mm
    ):
        what = (
            f"temperatures differ by up to {expansion.unmodelled_K:g} K without an expansion in the "
            f"calibration: about {confidence.expansion_mm * UM_PER_MM:.1f} um on this program"
        )
        results.append(_finding("OLP434", what))
    return results


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
        return "work offsets are true: nothing cancels, bands are those of absolute positions"
    words = "bands are relative to the touch-off: errors that both have in common cancel"
    return words if touched == frames else f"{words}; other work offsets are true, and nothing cancels there"


def _probabilities(each: Array, program: float) -> dict[str, float]:
    return {
        "program": program,
        "least": float(each.min(initial=1.0)),
        "mean": float(each.mean()) if len(each) else 1.0,
    }


def _lines(confidence: Confidence, chances: Chances) -> list[dict[str, Any]]:
    """The lines that are most likely out of tolerance after correction."""
    worst = np.argsort(chances.line_after, kind="stable")[:_MOST_LINES]
    rows = []
    for k in worst.tolist():
        own = confidence.line == chances.lines[k]
        rows.append(
            {
                "line": int(chances.lines[k]),
                "band_um": float(confidence.band_mm[own].max() * UM_PER_MM),
                "before_um": float(
                    np.sqrt((confidence.points.before_mm[own] ** 2).sum(axis=1)).max() * UM_PER_MM
                ),
                "within_before": float(chances.line_before[k]),
                "within_after": float(chances.line_after[k]),
                "nearer": float(chances.nearer[own].min()),
            }
        )
    return rows


def _component(part: Component) -> dict[str, Any]:
    angle = part.name[1] in "ABC" or part.name[0] != "E"
    unit, scale = ("urad", 1.0 / RAD_PER_URAD) if angle else ("um", UM_PER_MM)
    return {
        "name": part.name,
        f"value_{unit}": part.value * scale,
        f"expanded_uncertainty_{unit}": COVERAGE * part.sigma * scale,
        "probability_helps": part.helps,
        "sure": part.probable,
    }
