"""The rules of measured paths against nominal ones."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="comparison", gate=False)

RULES = (
    _rule(
        "OLP601",
        "wrong pairing",
        Severity.ERROR,
        "Many measured points find no place on the nominal path, or lie much nearer to another pass than to "
        "the one that their order says; figures from such pairs would mean nothing, so none are stated.",
        "Look whether this is the program that was measured, whether the points are in its order (--order) "
        "and its frame (--align fit), and whether their unit is right; --reach-mm says how far a point may "
        "lie from its place.",
        "A run in inches read as mm, or the points of another part.",
    ),
    _rule(
        "OLP602",
        "measured points left out",
        Severity.WARNING,
        "Single points lie farther from the path than --reach-mm and are part of no figure: outliers of the "
        "instrument, or a piece of another path.",
        "Look at the points; raise --reach-mm where the machine is really off by as much.",
        "Three of 2000 points lie 40 mm away, where the beam was broken.",
    ),
    _rule(
        "OLP603",
        "part of the path not measured",
        Severity.WARNING,
        "A stretch of the cutting path has no measured points, so nothing is said about it.",
        "Measure it, or compare with a program that ends where the measurement does.",
        "The tracker lost its target between lines 210 and 260.",
    ),
    _rule(
        "OLP604",
        "the fit takes the error with it",
        Severity.WARNING,
        "A best-fit frame cannot tell a shift or a turn of the path from an error of the machine: what "
        "squareness and straightness turn and shift goes into the frame, and the residual looks better than "
        "the part will be.",
        "Measure in the machine's frame: take the instrument's frame from points that are independent of the "
        "path, such as artefacts or the table, and compare with --align none.",
        "40 urad between X and Y on a flat contour: a turn of 20 urad hides half of it.",
    ),
    _rule(
        "OLP605",
        "frame not determined",
        Severity.WARNING,
        "The path has the same shape after a shift or a turn, such as along a straight line or about the "
        "axis of a circle, or fits in two places; the fit leaves that motion at zero.",
        "Measure a path with corners in all directions, or give the frame.",
        "All points lie on one line along X: turns about it and shifts along it change nothing.",
    ),
    _rule(
        "OLP606",
        "points not in the order of the path",
        Severity.INFO,
        "The points run against the path, or in no order along it; each then takes its nearest place.",
        "Nothing, as long as the path neither repeats nor crosses itself; else measure in order.",
        "A CMM sorted the points by their numbers.",
    ),
    _rule(
        "OLP607",
        "fewer cycles than ISO 9283 asks for",
        Severity.INFO,
        "ISO 9283 takes accuracy and repeatability from 30 cycles for poses and 10 for paths; fewer give the "
        "same figures with more scatter.",
        "Measure more cycles, or state their number with the figures.",
        "AT from 3 runs.",
    ),
    _rule(
        "OLP608",
        "place of points in doubt",
        Severity.WARNING,
        "Without an order, points near a crossing belong to either pass; they are part of no figure.",
        "Measure in order along the path.",
        "A figure eight, measured with `--order free`: points beside its crossing.",
    ),
    _rule(
        "OLP609",
        "measured path above tolerance",
        Severity.ERROR,
        "The measured path leaves the nominal one by more than --tolerance-um.",
        "Look at the worst lines, and at the before/after table for what the correction gained.",
        "12 um at line 340 with `--tolerance-um 5`.",
    ),
    _rule(
        "OLP611",
        "best-fit frame",
        Severity.INFO,
        "The points were stated in another frame and were brought into the nominal one by the rigid "
        "transform with the least squared distances from the path.",
        "Nothing; OLP604 says where this hides errors.",
        "Points of a tracker that stands beside the machine.",
    ),
)
