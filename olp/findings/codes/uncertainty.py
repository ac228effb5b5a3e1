"""The rules of uncertainty: where a correction is sure to help, and within which tolerance."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="uncertainty")

RULES = (
    _rule(
        "OLP431",
        "gain within its uncertainty",
        Severity.INFO,
        "At these lines the deviation that the correction takes away is smaller than the expanded "
        "uncertainty (2 sigma) with which the calibration knows it, so it may as well grow. By expectation "
        "the corrected path is still the better one, and mixing corrected and nominal moves would make "
        "steps; so they are corrected like the others.",
        "Measure better what the report lists as most uncertain; --only-sure-components leaves out "
        "components that are within their own uncertainty.",
        "3 um of correction, and a squareness that is known to 5 um there.",
    ),
    _rule(
        "OLP432",
        "correction not sure to help",
        Severity.WARNING,
        "Over the whole program the gain of the correction is smaller than its uncertainty: the probability "
        "that the corrected program is better than the nominal one is below 84 %.",
        "Run the nominal program, or calibrate again with a lower uncertainty.",
        "A calibration of 20 um of uncertainty for errors of 10 um.",
    ),
    _rule(
        "OLP433",
        "within tolerance by chance",
        Severity.WARNING,
        "The tolerance that --within-um asks for is smaller than what the calibration is sure of: the "
        "probability that all way-points of the corrected program are within it is below 95 %.",
        "Widen the tolerance, or lower the uncertainty: the report tells what it is made of.",
        "--within-um 5 with a band of 8 um.",
    ),
    _rule(
        "OLP434",
        "temperature not corrected",
        Severity.WARNING,
        "The job states temperatures that differ from those of the calibration (20 degC for the workpiece), "
        "and the calibration has no expansion for them. What they do is not corrected; it counts as "
        "uncertainty, with the expansion of steel (11.5 um/(m K)), here more than half the tolerance.",
        "Give the table [thermal] of the calibration, or work at its temperature.",
        "`X_scale = 24.0` in the job, and no X_scale_um_m_K: 46 um over 1 m.",
    ),
    _rule(
        "OLP435",
        "components within their own uncertainty",
        Severity.INFO,
        "What the calibration says of these components is smaller than its expanded uncertainty (2 sigma), "
        "so it is not sure that correcting them helps.",
        "Measure them better, or leave them out with --only-sure-components.",
        "A squareness of 4 urad with a standard uncertainty of 5 urad.",
    ),
    _rule(
        "OLP436",
        "components left out",
        Severity.INFO,
        "--only-sure-components: these components are within their own uncertainty and were not corrected. "
        "What they are expected to do remains, and counts as deviation.",
        "Nothing; without the option they are corrected.",
        "--only-sure-components, and a squareness of 4 urad known to 5 urad.",
    ),
    _rule(
        "OLP437",
        "calibration has aged",
        Severity.WARNING,
        "By growth_per_year the standard uncertainties are at least twice those of the day of measuring.",
        "Calibrate again, or check the machine (a circle, a diagonal) and state a lower growth.",
        "`growth_per_year = 0.5`, two years after measured.",
    ),
)
