"""The rules of a correction: what it reached, what it left, and what it was computed with."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="correction")

RULES = (
    _rule(
        "OLP101",
        "above tolerance",
        Severity.ERROR,
        "The written program, read back and run through the error model, leaves the nominal path by more "
        "than the tolerance plus what rounding to the last digit explains.",
        "Raise --tolerance-um, let the machine take more digits (least_increment_mm), or look at the listed "
        "blocks.",
        "A hand-edited corrected program: `G1 X100.050` where X100.012 was written.",
    ),
    _rule(
        "OLP102",
        "moves passed uncorrected",
        Severity.WARNING,
        "These moves were written as they were: the error there depends on an axis that has not been "
        "commanded yet, or the control moves by itself (G53, G28, G30), or the section is switched off.",
        "Give start_mm in the job file, or command all axes in the first rapid.",
        "`G0 X10` as the first move, while nobody has commanded Y and Z.",
    ),
    _rule(
        "OLP103",
        "lost motion unknown",
        Severity.INFO,
        "Until an axis has moved by its lost motion in one direction, nobody knows on which flank it rests.",
        "Approach the first point from a known side; the spread is at most half the lost motion.",
        "`[backlash] X_um = 4.0` and a program that begins with `G1 X10`.",
    ),
    _rule(
        "OLP104",
        "block moves another axis",
        Severity.INFO,
        "A block that also moves a rotary or other axis is corrected at its end only and never split; the "
        "other axis' words are carried untouched.",
        "Split the block in the source where the path between its ends matters.",
        "`G1 X10 Y20 A90` in a long block.",
    ),
    _rule(
        "OLP105",
        "canned cycle corrected per hole",
        Severity.WARNING,
        "A canned cycle moves straight along the tool axis, so it can be exact at one depth only; here the "
        "rest of the stroke leaves the nominal path by more than the tolerance.",
        "Write the cycles out as plain moves with --expand-cycles.",
        "`G81 Z-80 R2` where the column leans by 3 um over 80 mm.",
    ),
    _rule(
        "OLP106",
        "orientation not corrected",
        Severity.INFO,
        "A machine with three linear axes cannot turn its tool; the angular errors of the axes remain in the "
        "orientation of the tool.",
        "Nothing in the program can mend it; the largest angle is in the report.",
        "EAX of 200 urad and a face mill of 40 mm radius: 8 um at its rim.",
    ),
    _rule(
        "OLP107",
        "nothing to prove",
        Severity.WARNING,
        "No move of the program was corrected at a known position, so the proof says nothing.",
        "Look whether this is the program that you meant; command all axes, or give start_mm in the job "
        "file.",
        "A program of nothing but G53 moves.",
    ),
    _rule(
        "OLP401",
        "calibration expired",
        Severity.WARNING,
        "The date given is later than valid_until of the calibration.",
        "Measure the machine again.",
        "`--date 2027-06-01`, and `valid_until = 2027-05-14`.",
    ),
    _rule(
        "OLP402",
        "outside travel",
        Severity.ERROR,
        "A command leaves the travel of an axis, so the control will stop with a limit alarm.",
        "Move the part, or leave the section out with (olp off).",
        "Travel of X up to 2000 mm, and the corrected program writes X2000.012.",
    ),
    _rule(
        "OLP403",
        "held at the face of the calibrated box",
        Severity.WARNING,
        "Commands outside the calibrated box were corrected with the error at its face (--outside-box hold).",
        "Measure the machine over the whole working volume.",
        "box_mm of X up to 2000, and a move to X2001 with --outside-box hold.",
    ),
    _rule(
        "OLP404",
        "compensated by the control",
        Severity.INFO,
        "These errors are left to the control, which corrects them already.",
        "Nothing, as long as the control's tables stay active.",
        'compensated_by_controller = ["EXX"].',
    ),
)
