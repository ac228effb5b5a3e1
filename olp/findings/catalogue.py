"""Findings: what a person should know about a run, as data with stable codes.

One table holds every code, so that the report, `--select`, `--fail-on` and `olp explain` agree.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from olp.findings.codes.calibration import CALIBRATION
from olp.findings.codes.control_tables import TABLES
from olp.findings.codes.gate import GATE
from olp.findings.codes.measurements import METROLOGY
from olp.findings.codes.model import MODEL
from olp.findings.codes.planning import PLANNING
from olp.findings.codes.uncertainty import CONFIDENCE
from olp.findings.rule import Rule as Rule
from olp.findings.rule import Severity as Severity


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding; `line` counts from 1 in the program, `lines` are all lines concerned (the first few)."""

    code: str
    message: str
    line: int | None = None
    lines: tuple[int, ...] = ()
    count: int = 1

    @property
    def severity(self) -> Severity:
        return RULES[self.code].severity

    def as_dict(self) -> dict[str, object]:
        return {
            "code": self.code,
            "severity": self.severity.name.lower(),
            "message": self.message,
            "line": self.line,
            "lines": list(self.lines),
            "count": self.count,
        }


_TABLE = (
    Rule(
        "OLP101",
        "above tolerance",
        Severity.ERROR,
        "The written program, read back and run through the error model, leaves the nominal path by more "
        "than the tolerance plus what rounding to the last digit explains.",
        "Raise --tolerance-um, let the machine take more digits (least_increment_mm), or look at the listed "
        "blocks.",
        "A hand-edited corrected program: `G1 X100.050` where X100.012 was written.",
    ),
    Rule(
        "OLP102",
        "moves passed uncorrected",
        Severity.WARNING,
        "These moves were written as they were: the error there depends on an axis that has not been "
        "commanded yet, or the control moves by itself (G53, G28, G30), or the section is switched off.",
        "Give start_mm in the job file, or command all axes in the first rapid.",
        "`G0 X10` as the first move, while nobody has commanded Y and Z.",
    ),
    Rule(
        "OLP103",
        "lost motion unknown",
        Severity.INFO,
        "Until an axis has moved by its lost motion in one direction, nobody knows on which flank it rests.",
        "Approach the first point from a known side; the spread is at most half the lost motion.",
        "`[backlash] X_um = 4.0` and a program that begins with `G1 X10`.",
    ),
    Rule(
        "OLP104",
        "block moves another axis",
        Severity.INFO,
        "A block that also moves a rotary or other axis is corrected at its end only and never split; the "
        "other axis' words are carried untouched.",
        "Split the block in the source where the path between its ends matters.",
        "`G1 X10 Y20 A90` in a long block.",
    ),
    Rule(
        "OLP105",
        "canned cycle corrected per hole",
        Severity.WARNING,
        "A canned cycle moves straight along the tool axis, so it can be exact at one depth only; here the "
        "rest of the stroke leaves the nominal path by more than the tolerance.",
        "Write the cycles out as plain moves with --expand-cycles.",
        "`G81 Z-80 R2` where the column leans by 3 um over 80 mm.",
    ),
    Rule(
        "OLP106",
        "orientation not corrected",
        Severity.INFO,
        "A machine with three linear axes cannot turn its tool; the angular errors of the axes remain in the "
        "orientation of the tool.",
        "Nothing in the program can mend it; the largest angle is in the report.",
        "EAX of 200 urad and a face mill of 40 mm radius: 8 um at its rim.",
    ),
    Rule(
        "OLP107",
        "nothing to prove",
        Severity.WARNING,
        "No move of the program was corrected at a known position, so the proof says nothing.",
        "Look whether this is the program that you meant; command all axes, or give start_mm in the job "
        "file.",
        "A program of nothing but G53 moves.",
    ),
    Rule(
        "OLP201",
        "path mode without tolerance",
        Severity.WARNING,
        "In G64 without P the control rounds corners as far as its acceleration asks for, which can be a "
        "millimetre.",
        "Use G64 P<tolerance> Q0, or G61 where exact stops are affordable.",
        "`G64` alone in the first line of a LinuxCNC program.",
    ),
    Rule(
        "OLP202",
        "path tolerance larger than the correction",
        Severity.WARNING,
        "The control may leave the programmed path by more than the whole correction, which then is lost.",
        "Use a path tolerance well below the correction.",
        "`G64 P0.5` on a machine whose largest error is 0.04 mm.",
    ),
    Rule(
        "OLP203",
        "path mode merges blocks",
        Severity.WARNING,
        "G64 P without Q0 lets the control merge short blocks and spend the whole tolerance on smooth paths.",
        "Add Q0 to keep P as a bound at corners only.",
        "`G64 P0.01`, where LinuxCNC takes Q = P.",
    ),
    Rule(
        "OLP301",
        "units assumed",
        Severity.INFO,
        "The program states neither G20 nor G21; millimetres were assumed.",
        "State G21 (or G20) at the start of the program.",
        "`G90 G54` and no G21 before `G0 X10`.",
    ),
    Rule(
        "OLP302",
        "numbers without decimal point",
        Severity.INFO,
        "On this control a length without a decimal point counts least increments: X100 is 0.1 mm.",
        'If the control is set to calculator-type input, state decimal_point = "calculator" in the machine '
        "file.",
        "`X100` on a Fanuc control.",
    ),
    Rule(
        "OLP303",
        "touch-off assumed",
        Severity.INFO,
        "The work offset is taken as touched off on the raw machine, so the touched point keeps its place.",
        'State set_by = "true" where the part was located by other means.',
        "`[work_offsets.G54]` with X_mm, Y_mm, Z_mm and nothing else.",
    ),
    Rule(
        "OLP304",
        "block delete",
        Severity.INFO,
        "Blocks under `/` were taken as executed; the program was proved with them left out too.",
        "Nothing, where both positions of the switch are meant.",
        "`/G1 X100`.",
    ),
    Rule(
        "OLP305",
        "contour taken as tool path",
        Severity.WARNING,
        "Under G41/G42 the control offsets the contour by the tool radius; the correction was computed on "
        "the contour.",
        "Program the tool path where the radius is large against the change of the error.",
        "`olp correct part.nc --contour` with `G41 D1` in the program.",
    ),
    Rule(
        "OLP306",
        "cutting at an uncorrected place",
        Severity.WARNING,
        "A feed move starts where a rapid ended uncorrected, so its beginning leaves the nominal path.",
        "Command all axes in rapids first, or give start_mm in the job file.",
        "`G0 X10`, then `G1 X50 F600`, with Y and Z unknown at the G0.",
    ),
    Rule(
        "OLP331",
        "told from the text",
        Severity.INFO,
        "The file does not state this; it was told from its rows or taken from the machine file.",
        "Look whether it is so; state it in the header, or in a profile (--profile).",
        "`10;20;30` as the first row: the delimiter is a semicolon, the columns are X, Y and Z.",
    ),
    Rule(
        "OLP332",
        "orientation changes",
        Severity.WARNING,
        "Three linear axes cannot turn the tool: orientations are carried as they are, and the lever of the "
        "tool is taken as the same all along.",
        "Correct lists of one orientation at a time, each with the tool vector that it has there.",
        "A column C that goes from 0 to 90 degrees.",
    ),
    Rule(
        "OLP333",
        "between places of a list",
        Severity.INFO,
        "A list says where the machine goes and not how. If it goes straight, its errors bend the way "
        "between "
        "two corrected places by more than the tolerance.",
        'State joined = "lines" and insert = true in the profile, if the machine goes straight and rows '
        "may be "
        "inserted.",
        "Two tag points 2 m apart on a machine whose straightness is 5 um.",
    ),
    Rule(
        "OLP401",
        "calibration expired",
        Severity.WARNING,
        "The date given is later than valid_until of the calibration.",
        "Measure the machine again.",
        "`--date 2027-06-01`, and `valid_until = 2027-05-14`.",
    ),
    Rule(
        "OLP402",
        "outside travel",
        Severity.ERROR,
        "A command leaves the travel of an axis, so the control will stop with a limit alarm.",
        "Move the part, or leave the section out with (olp off).",
        "Travel of X up to 2000 mm, and the corrected program writes X2000.012.",
    ),
    Rule(
        "OLP403",
        "held at the face of the calibrated box",
        Severity.WARNING,
        "Commands outside the calibrated box were corrected with the error at its face (--outside-box hold).",
        "Measure the machine over the whole working volume.",
        "box_mm of X up to 2000, and a move to X2001 with --outside-box hold.",
    ),
    Rule(
        "OLP404",
        "compensated by the control",
        Severity.INFO,
        "These errors are left to the control, which corrects them already.",
        "Nothing, as long as the control's tables stay active.",
        'compensated_by_controller = ["EXX"].',
    ),
    Rule(
        "OLP412",
        "thermal compensation in the program",
        Severity.WARNING,
        "The program switches on a compensation of the control's own for temperature (TECOMP, TEMPR). Where "
        "the calibration was measured without it, or the job states temperatures too, expansion is "
        "corrected twice.",
        "State in active_during_measurement what was on while measuring, and leave temperatures_degC out of "
        "the job, or switch the control's compensation off.",
        "`TECOMP/ON,0.0000105` in a DMIS program.",
    ),
    Rule(
        "OLP413",
        "sense of arcs assumed",
        Severity.WARNING,
        "CIRCLE statements of this form (NX) are read as turning right-handed about their normal, and no "
        "joint of the program tells whether they do: along the other part of the circle errors differ.",
        "Compare one arc with the simulation of the CAM system (olp view), or have it write GOTOs for arcs.",
        "`CIRCLE/0,0,0,0,0,-1,5,0.06,0.5,10,0` behind a corner.",
    ),
    Rule(
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
    Rule(
        "OLP602",
        "measured points left out",
        Severity.WARNING,
        "Single points lie farther from the path than --reach-mm and are part of no figure: outliers of the "
        "instrument, or a piece of another path.",
        "Look at the points; raise --reach-mm where the machine is really off by as much.",
        "Three of 2000 points lie 40 mm away, where the beam was broken.",
    ),
    Rule(
        "OLP603",
        "part of the path not measured",
        Severity.WARNING,
        "A stretch of the cutting path has no measured points, so nothing is said about it.",
        "Measure it, or compare with a program that ends where the measurement does.",
        "The tracker lost its target between lines 210 and 260.",
    ),
    Rule(
        "OLP604",
        "the fit takes the error with it",
        Severity.WARNING,
        "A best-fit frame cannot tell a shift or a turn of the path from an error of the machine: what "
        "squareness and straightness turn and shift goes into the frame, and the residual looks better "
        "than the part will be.",
        "Measure in the machine's frame: take the instrument's frame from points that are independent of the "
        "path, such as artefacts or the table, and compare with --align none.",
        "40 urad between X and Y on a flat contour: a turn of 20 urad hides half of it.",
    ),
    Rule(
        "OLP605",
        "frame not determined",
        Severity.WARNING,
        "The path has the same shape after a shift or a turn, such as along a straight line or about the "
        "axis of a circle, or fits in two places; the fit leaves that motion at zero.",
        "Measure a path with corners in all directions, or give the frame.",
        "All points lie on one line along X: turns about it and shifts along it change nothing.",
    ),
    Rule(
        "OLP606",
        "points not in the order of the path",
        Severity.INFO,
        "The points run against the path, or in no order along it; each then takes its nearest place.",
        "Nothing, as long as the path neither repeats nor crosses itself; else measure in order.",
        "A CMM sorted the points by their numbers.",
    ),
    Rule(
        "OLP607",
        "fewer cycles than ISO 9283 asks for",
        Severity.INFO,
        "ISO 9283 takes accuracy and repeatability from 30 cycles for poses and 10 for paths; fewer give the "
        "same figures with more scatter.",
        "Measure more cycles, or state their number with the figures.",
        "AT from 3 runs.",
    ),
    Rule(
        "OLP608",
        "place of points in doubt",
        Severity.WARNING,
        "Without an order, points near a crossing belong to either pass; they are part of no figure.",
        "Measure in order along the path.",
        "A figure eight, measured with `--order free`: points beside its crossing.",
    ),
    Rule(
        "OLP609",
        "measured path above tolerance",
        Severity.ERROR,
        "The measured path leaves the nominal one by more than --tolerance-um.",
        "Look at the worst lines, and at the before/after table for what the correction gained.",
        "12 um at line 340 with `--tolerance-um 5`.",
    ),
    Rule(
        "OLP611",
        "best-fit frame",
        Severity.INFO,
        "The points were stated in another frame and were brought into the nominal one by the rigid "
        "transform with the least squared distances from the path.",
        "Nothing; OLP604 says where this hides errors.",
        "Points of a tracker that stands beside the machine.",
    ),
    Rule(
        "OLP621",
        "taken for granted",
        Severity.INFO,
        "What the file does not state was told from its rows, such as which columns hold what, or which side "
        "of the tip touched.",
        "Look whether it is so; state it in the header, or in a profile (--profile).",
        "`X;Y;Z` in the first row, and no profile.",
    ),
    Rule(
        "OLP622",
        "values carried uncorrected",
        Severity.WARNING,
        "These values come from several touches that the file does not hold one by one, or were evaluated "
        "from "
        "such values, so they still hold the machine's error beside points that do not.",
        "Let the machine write its touch points, correct those, and evaluate the features from them.",
        "`FA(BORE)=FEAT/CIRCLE,INNER,CART,50.0021,..` in DMIS output.",
    ),
    Rule(
        "OLP623",
        "touch not known",
        Severity.WARNING,
        "The error of a machine changes over the radius of a tip, and the file does not say on which side of "
        "the tip the surface was, or whether points are centres.",
        'Give columns I, J, K (out of the surface), or point = "centre" in the profile.',
        "A tip of 4 mm radius where the error changes by 50 um/m: 0.2 um.",
    ),
    Rule(
        "OLP624",
        "rotation of a frame set on the raw machine",
        Severity.WARNING,
        "A frame whose directions come from touches on the raw machine is turned by the machine's errors at "
        "those touches; only its zero can be corrected from one place.",
        "Correct the points of the alignment too (--frame machine), fit the frame to them, and state it with "
        'set_by = "true".',
        "A part aligned along an edge by two touches 400 mm apart.",
    ),
    Rule(
        "OLP625",
        "compensation active while measuring",
        Severity.WARNING,
        "The file says that the control or its program compensated while it was measured. That is right only "
        "if the calibration was measured with the same compensation active.",
        "Look whether active_during_measurement and the table [thermal] of the calibration say the same.",
        "`TECOMP/ON` in DMIS, or `# volumetric compensation: on`.",
    ),
    Rule(
        "OLP626",
        "no stamp",
        Severity.WARNING,
        "Without a comment that says so, nothing keeps a corrected file from being corrected again.",
        "Keep corrected files apart, or let the profile allow a comment (stamp = true).",
        "`stamp = false` in a profile.",
    ),
)

RULES = {
    rule.code: rule
    for rule in sorted(
        (*_TABLE, *GATE, *CALIBRATION, *METROLOGY, *TABLES, *MODEL, *CONFIDENCE, *PLANNING),
        key=lambda rule: rule.code,
    )
}

#: findings of uncertainty
CONFIDENCE_CODES = tuple(rule.code for rule in CONFIDENCE)
#: what a gate looks for: all but those of measured paths and of measurements of a machine
GATE_CODES = tuple(code for code in RULES if not code.startswith(("OLP6", "OLP8")))


def worst(findings: Iterable[Finding]) -> Severity | None:
    """The highest severity among findings, None where there are none."""
    return max((finding.severity for finding in findings), default=None)
