"""The rules of a correction: its result, its residual, and the inputs that it was computed with."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="correction")

RULES = (
    _rule(
        "OLP101",
        "above tolerance",
        Severity.ERROR,
        "The written program, read back and run through the error model, deviates from the nominal path at "
        "these lines. The deviation exceeds the tolerance plus what rounding to the last digit explains.",
        "Correct the nominal program again, or undo the edit. If it fails again, look at the listed blocks. "
        "Give a smaller least_increment_mm if the control takes more digits, or raise --tolerance-um if so "
        "much is allowed. Along contours under G41 or G42, correct with --contour path. At holes of canned "
        "cycles, correct with --expand-cycles, where the finding names it.",
        "A hand-edited corrected program: `G1 X100.050` where X100.012 was written.",
    ),
    _rule(
        "OLP102",
        "moves left uncorrected",
        Severity.WARNING,
        "These moves were written unchanged. The error there depends on an axis without a commanded "
        "position, the control moves by itself (G53, G28, G30), or the section is switched off.",
        "Give start_mm in the job file, or command all axes in the first rapid.",
        "`G0 X10` as the first move, before Y and Z are commanded.",
    ),
    _rule(
        "OLP103",
        "side of the backlash unknown",
        Severity.INFO,
        "An axis rests on a known side of its backlash only after it has moved by that amount in one "
        "direction. At these lines the side is still unknown. What it may change is part of the deviation.",
        "Begin with a rapid that commands all axes. The correction then takes the backlash up before the "
        "cut.",
        "`[backlash] X_um = 4.0` and a program that begins with `G1 X10`.",
    ),
    _rule(
        "OLP104",
        "block moves another axis",
        Severity.INFO,
        "A block that also moves a rotary or other axis is corrected at its end only and never split. The "
        "words of the other axis are kept as written. So is a move of a robot with a word that belongs to "
        "its end or to its time, such as `UNTIL` or `Skip`.",
        "Split the block in the source where the path between its ends matters.",
        "`G1 X10 Y20 A90` in a long block.",
    ),
    _rule(
        "OLP105",
        "canned cycle corrected per hole",
        Severity.WARNING,
        "A canned cycle moves straight along the tool axis, so it can be exact at one depth only. The rest "
        "of its feed strokes deviates from the axis of the hole by more than the numerical tolerance.",
        "Write the cycles out as plain moves: with olp correct --expand-cycles, where the finding names it, "
        "else in the post-processor.",
        "`G81 Z-80 R2` where the column leans by 3 um over 80 mm.",
    ),
    _rule(
        "OLP106",
        "orientation not corrected",
        Severity.INFO,
        "A machine with three linear axes cannot turn its tool. The angular errors of the axes stay in the "
        "orientation of the tool.",
        "The program cannot correct this. The report states the largest angle.",
        "EAX of 200 urad and a face mill of 40 mm radius: 8 um at its rim.",
    ),
    _rule(
        "OLP107",
        "nothing to prove",
        Severity.WARNING,
        "No move of the program was corrected at a known position, so the proof is empty.",
        "Check that this is the program that you meant. Command all axes, or give start_mm in the job file.",
        "A program of nothing but G53 moves.",
    ),
    _rule(
        "OLP108",
        "above the part tolerance",
        Severity.ERROR,
        "The corrected path, as the model predicts it, is farther from the nominal path than the tolerance "
        "of the part allows. The uncertainty of the calibration comes on top of that.",
        "Look at the listed blocks. A smaller --tolerance-um follows the path more closely. Else state the "
        "tolerance that the part really has.",
        "`--part-tolerance-um 1` for a program with a hole whose stroke is off by 3 um.",
    ),
    _rule(
        "OLP109",
        "loops and subprograms kept",
        Severity.INFO,
        "The program has loops, subprograms or expressions. All passes of each line need the same numbers. "
        "So the lines were corrected in their places, and the flow is as you wrote it.",
        "Nothing needs to be done. Give --flatten to have every pass written out instead.",
        "A subprogram that M98 calls with L2, for a spring pass.",
    ),
    _rule(
        "OLP110",
        "calls and blocks written out",
        Severity.INFO,
        "The passes of these calls need other numbers than the others, or the control makes moves by itself "
        "there: corners, holes around a centre. They were written out in their place; other calls keep the "
        "subprogram.",
        "Nothing needs to be done. The written program is longer by these blocks.",
        "`M98 P1000` in G54 and in G55, where the machine has other errors.",
    ),
    _rule(
        "OLP111",
        "arcs written as straight moves",
        Severity.INFO,
        "With rotary axes no arc of a control has the corrected path. So these arcs became straight moves, "
        "each within the tolerance of its part of the arc.",
        "Nothing needs to be done. A wider --tolerance-um gives fewer moves.",
        "`G2 X40. I20.` behind G43.4 on a machine whose table turns askew.",
        gate=False,
    ),
    _rule(
        "OLP401",
        "calibration expired",
        Severity.ERROR,
        "The date given is later than valid_until of the calibration.",
        "Measure the machine again.",
        "`--date 2027-06-01`, and `valid_until = 2027-05-14`.",
        doubt=True,
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
        "The control corrects these errors already (compensated_by_controller), so the program leaves them "
        "to it.",
        "Nothing to do while the control's tables stay active.",
        'compensated_by_controller = ["EXX"].',
    ),
)
