"""The uncertainty of a run: from what was loaded and proved to bands, probabilities, advice and findings."""

from __future__ import annotations

import datetime
from typing import Any

from olp.core.arrays import Index
from olp.core.progress import Progress
from olp.core.units import MM_PER_UM
from olp.errormodel.sensitivity import Expansion, Sensitivity
from olp.errormodel.uncertainty import Uncertainty
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.uncertainty.components import components
from olp.uncertainty.spread import Confidence, Unknowns, confidence, waypoints
from olp.uncertainty.summary import findings, summary
from olp.workflows.session import Loaded

Assessment = tuple[Confidence, dict[str, Any], list[Finding]]


def assess(
    loaded: Loaded,
    uncertainty: Uncertainty,
    nominal: Program,
    corrected: Program,
    groups: Index,
    uncorrected: Index,
    part_tolerance_um: float | None,
    date: datetime.date | None,
    tell: Progress,
) -> Assessment:
    """Bands of a proved program, with a part tolerance its probabilities, its part of the report, and its
    findings."""
    unknowns, growth, expansion = unknowns_of(loaded, uncertainty, date)
    points = waypoints(nominal, corrected, groups, uncorrected, loaded.full)
    limit = None if part_tolerance_um is None else part_tolerance_um * MM_PER_UM
    result = confidence(unknowns, nominal.toolpath, points, limit, tell=tell)
    parts = [
        c for c in components(loaded.calibration, uncertainty.scaled(growth)) if c.name not in loaded.skip
    ]
    report = summary(result, nominal.toolpath, uncertainty, growth, expansion, parts)
    return result, report, findings(result, growth, expansion, parts, loaded.left_out)


def unknowns_of(
    loaded: Loaded, uncertainty: Uncertainty, date: datetime.date | None
) -> tuple[Unknowns, float, Expansion | None]:
    """The unknowns of the machine on the day `date`, the factor by which they have grown since measuring,
    and expansion where temperatures matter."""
    measured = loaded.calibration.measured
    days = None if date is None or measured is None else (date - measured).days
    growth = uncertainty.growth(days)
    expansion: Expansion | None = Expansion.of(
        loaded.calibration, uncertainty, dict(loaded.setup.job.temperatures_degC)
    )
    if expansion is not None and not any((*expansion.scale, expansion.workpiece)):
        expansion = None
    sensitivity = Sensitivity.of(
        loaded.calibration,
        loaded.setup.machine.chain,
        uncertainty.scaled(growth),
        skip=loaded.skip,
        expansion=expansion,
    )
    return Unknowns(sensitivity, uncertainty.repeatability_mm), growth, expansion
