"""The rules of measured paths against nominal ones."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="comparison", gate=False)

RULES = (
    _rule(
        "OLP601",
        "measured points do not match the path",
        Severity.ERROR,
        "Many measured points are far from the nominal path, or much nearer to another pass than to the one "
        "in their order. Figures from such pairs would mean nothing, so none are stated.",
        "Check that this is the program that was measured. Check the order of the points (--order), their "
        "frame (--align fit) and their unit. The largest accepted distance of a point from the path is "
        "--reach-mm.",
        "A run in inches read as mm, or the points of another part.",
    ),
    _rule(
        "OLP602",
        "measured points left out",
        Severity.WARNING,
        "Single points lie farther from the path than --reach-mm and are in no figure. They are outliers of "
        "the instrument, or belong to another path.",
        "Look at the points. Raise --reach-mm where the machine really deviates by as much.",
        "Three of 2000 points lie 40 mm away, where the beam was broken.",
    ),
    _rule(
        "OLP603",
        "part of the path not measured",
        Severity.WARNING,
        "A section of the cutting path has no measured points, or points that count were not measured, or a "
        "run has no point that counts. The figures do not cover it.",
        "Measure it, or compare with a program that ends where the measurement does.",
        "The tracker lost its target between lines 210 and 260.",
    ),
    _rule(
        "OLP604",
        "part of the error absorbed by the fit",
        Severity.WARNING,
        "A best-fit frame cannot separate a shift or a rotation of the path from an error of the machine. "
        "It absorbs part of squareness and straightness, so the residual is smaller than the deviation of "
        "the part.",
        "Measure in the machine's frame and compare with --align none. Take that frame from points outside "
        "the path, such as artefacts or the table.",
        "40 urad between X and Y on a flat contour: a rotation of 20 urad hides half of it.",
    ),
    _rule(
        "OLP605",
        "frame not determined",
        Severity.WARNING,
        "The path looks the same after a shift or a rotation, as a straight line or a circle does, or it "
        "fits in two positions. The fit leaves that motion at zero.",
        "Measure a path with corners in all directions, or give the frame.",
        "All points lie on one line along X: rotations about it and shifts along it change nothing.",
    ),
    _rule(
        "OLP606",
        "points not in the order of the path",
        Severity.INFO,
        "The points run against the path, or in no order along it. Points in no order were each paired with "
        "the nearest position of the path.",
        "Nothing to do where the path neither repeats nor crosses itself. Otherwise measure in order.",
        "A CMM sorted the points by their numbers.",
    ),
    _rule(
        "OLP607",
        "fewer cycles than ISO 9283 asks for",
        Severity.INFO,
        "ISO 9283 takes accuracy and repeatability from 30 cycles for poses and 10 for paths. Fewer cycles "
        "give the same figures with more scatter.",
        "Measure more cycles, or state their number with the figures.",
        "AT from 3 runs.",
    ),
    _rule(
        "OLP608",
        "points between two passes",
        Severity.WARNING,
        "Without an order, a point near a crossing may belong to either pass. Such points are in no figure.",
        "Measure in order along the path.",
        "A figure eight, measured with `--order free`: points beside its crossing.",
    ),
    _rule(
        "OLP609",
        "measured path above tolerance",
        Severity.ERROR,
        "The measured path deviates from the nominal one by more than --part-tolerance-um, or "
        "part_tolerance_um of the job. It is also an error where a run has no point that counts, so that the "
        "tolerance cannot be verified.",
        "Look at the worst lines. With --before, the table shows what the correction gained.",
        "12 um at line 340 with `--part-tolerance-um 5`.",
    ),
    _rule(
        "OLP611",
        "best-fit frame",
        Severity.INFO,
        "The points were stated in another frame. They were moved into the nominal one by the rigid "
        "transform with the least squared distances from the path.",
        "Nothing to do. OLP604 says where this hides errors.",
        "Points of a tracker that stands beside the machine.",
    ),
)
