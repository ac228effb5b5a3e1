"""The rules of uncertainty: the gain of a correction against its uncertainty, and the part tolerance."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="uncertainty")

RULES = (
    _rule(
        "OLP431",
        "gain within its uncertainty",
        Severity.INFO,
        "At these lines the correction is smaller than its expanded uncertainty (k = 2), so it may also "
        "make the deviation larger. It is still the better estimate, and a mix of corrected and nominal "
        "moves would make steps. These lines are corrected like the others.",
        "Measure what the report lists as most uncertain. --only-sure-components leaves out components that "
        "are smaller than their expanded uncertainty (k = 2).",
        "3 um of correction, and a squareness with an expanded uncertainty of 5 um there.",
    ),
    _rule(
        "OLP432",
        "gain of the program within its uncertainty",
        Severity.WARNING,
        "Over the whole program the gain of the correction is smaller than its uncertainty. The corrected "
        "program is better than the nominal one with a probability below 84 %.",
        "Run the nominal program, or calibrate again with a lower uncertainty.",
        "A calibration with an uncertainty of 20 um for errors of 10 um.",
    ),
    _rule(
        "OLP433",
        "part tolerance not assured",
        Severity.WARNING,
        "The part tolerance (--part-tolerance-um, or part_tolerance_um of the job) is small against the "
        "uncertainty of the calibration. All waypoints of the corrected program are within it with a "
        "probability below 95 %.",
        "Widen the tolerance, or lower the uncertainty. The report lists its contributions.",
        "--part-tolerance-um 5 with an expanded uncertainty of 8 um.",
    ),
    _rule(
        "OLP434",
        "temperature not corrected",
        Severity.WARNING,
        "The job states temperatures that differ from those of the calibration (20 degC for the workpiece), "
        "without an expansion in the calibration. The effect is not corrected and counts as uncertainty, "
        "with the expansion of steel (11.5 um/(m K)). Here it is more than half the tolerance.",
        "Give the table [thermal] of the calibration, or work at its temperature.",
        "`X_scale = 24.0` in the job, and no X_scale_um_m_K: 46 um over 1 m.",
    ),
    _rule(
        "OLP435",
        "components within their own uncertainty",
        Severity.INFO,
        "These components of the calibration are smaller than their expanded uncertainty (k = 2). "
        "Correcting them may not help.",
        "Measure them better, or leave them out with --only-sure-components.",
        "A squareness of 4 urad with a standard uncertainty of 5 urad.",
    ),
    _rule(
        "OLP436",
        "components left out",
        Severity.INFO,
        "--only-sure-components left these components uncorrected, because they are smaller than their "
        "expanded uncertainty (k = 2). Their expected effect stays, and counts as deviation.",
        "Nothing to do. Without the option they are corrected.",
        "--only-sure-components, and a squareness of 4 urad with a standard uncertainty of 5 urad.",
    ),
    _rule(
        "OLP437",
        "calibration has aged",
        Severity.WARNING,
        "By growth_per_year the standard uncertainties are at least twice those of the day of measuring.",
        "Calibrate again. Or check the machine (a circle, a diagonal) and state a lower growth.",
        "`growth_per_year = 0.5`, two years after measured.",
    ),
)
