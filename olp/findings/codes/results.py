"""The rules of reported points that are corrected."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="results", gate=False)

RULES = (
    _rule(
        "OLP621",
        "assumed from the rows",
        Severity.INFO,
        "The file does not state this. It was detected from the rows, such as the meaning of columns, or "
        "the side of the tip that touched.",
        "Check that it is right. State it in the header, or in a profile (--profile).",
        "`X;Y;Z` in the first row, and no profile.",
    ),
    _rule(
        "OLP622",
        "values left uncorrected",
        Severity.WARNING,
        "These values come from several touches that the file does not hold one by one, or were computed "
        "from such values. They still hold the machine's error, beside points that do not.",
        "Let the machine write its touch points, correct those, and evaluate the features from them.",
        "`FA(BORE)=FEAT/CIRCLE,INNER,CART,50.0021,..` in DMIS output.",
    ),
    _rule(
        "OLP623",
        "touch not known",
        Severity.WARNING,
        "The error of the machine changes over the radius of the tip. The file does not state on which side "
        "of the tip the surface was, or whether points are centres.",
        'Give columns I, J, K (out of the surface), or point = "centre" in the profile.',
        "A tip of 4 mm radius where the error changes by 50 um/m: 0.2 um.",
    ),
    _rule(
        "OLP624",
        "rotation of a frame set on the uncompensated machine",
        Severity.WARNING,
        "The directions of this frame come from touches on the uncompensated machine, so the machine's "
        "errors at those touches rotate it. Only its zero can be corrected from one position.",
        "Correct the points of the alignment too (--frame machine) and fit the frame to them. State it with "
        'set_by = "true".',
        "A part aligned along an edge by two touches 400 mm apart.",
    ),
    _rule(
        "OLP625",
        "compensation active while measuring",
        Severity.WARNING,
        "The file says that the control or its program compensated while it was measured. That is right "
        "only if the calibration was measured with the same compensation active.",
        "Check that active_during_measurement and the table [thermal] of the calibration say the same.",
        "`TECOMP/ON` in DMIS, or `# volumetric compensation: on`.",
    ),
    _rule(
        "OLP626",
        "no stamp",
        Severity.WARNING,
        "No comment marks the corrected file, so nothing prevents a second correction of it.",
        "Keep corrected files apart, or let the profile allow a comment (stamp = true).",
        "`stamp = false` in a profile.",
    ),
)
