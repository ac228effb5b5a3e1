"""The rules that `olp check` adds to those of a correction."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="gate")

RULES = (
    _rule(
        "OLP204",
        "reversal-heavy passage",
        Severity.WARNING,
        "An axis with lost motion turns round again and again after ways that are hardly longer than its "
        "lost motion. There the tip follows the play more than the command, and small faults of the measured "
        "lost motion add up.",
        "Smooth the passage in the source (fewer points, a larger tolerance of the CAM chords).",
        "`[backlash] X_um = 20`, and X10.00 X10.05 X10.00 X10.05 in a row.",
    ),
    _rule(
        "OLP205",
        "feed beyond the velocity of an axis",
        Severity.WARNING,
        "The programmed feed asks an axis for more than velocity_mm_s, so the control slows down there, or "
        "stops with an alarm.",
        "Lower F; `olp retime --write-feed` writes feeds that the axes can follow.",
        "`G1 X100 F60000` on an axis with velocity_mm_s = 500.",
    ),
    _rule(
        "OLP206",
        "acceleration beyond an axis",
        Severity.WARNING,
        "At the programmed feed, an arc or a run of short blocks asks an axis for more than "
        "acceleration_mm_s2, so the control slows down, or leaves the path. Of short blocks a correction can "
        "make more.",
        "Lower F there; `olp retime --slow` lists where and why.",
        "`G2 I0.5 F6000`: 100 mm/s about a radius of 0.5 mm asks for 20 m/s2.",
    ),
    _rule(
        "OLP307",
        "no feed",
        Severity.ERROR,
        "A feed move has no feed, or one that cannot be read for sure, so the control stops with an alarm, "
        "or moves at the last feed of the program before.",
        "Write an F word in the first feed move, and in every block of G93.",
        "`G1 X100` with no F before it.",
    ),
    _rule(
        "OLP308",
        "feed by time or by turns",
        Severity.INFO,
        "In G93 F is one over the time of a block, in G95 it counts by turns of the spindle. What the tool "
        "does then depends on how blocks are split, and on the speed of the spindle.",
        "Look whether this is meant; go back to G94 where it is not.",
        "`G93` in the first line, left over from a job with a rotary axis.",
    ),
    _rule(
        "OLP309",
        "feed changed",
        Severity.WARNING,
        "The corrected program moves at another feed than the nominal one, by more than 5 %: an F word or a "
        "feed mode was lost or changed on the way.",
        "Compare the F words of both programs at these lines.",
        "`G1 X100 F600` in the nominal program, and F60 in the corrected one.",
    ),
    _rule(
        "OLP310",
        "below the nominal path",
        Severity.ERROR,
        "A first move or a rapid takes the tip lower in Z than the nominal program does there, by more than "
        "the tolerance: what was meant to clear the part may not.",
        "Look at the Z words of these blocks; correct the nominal program again.",
        "`G0 Z50` as retract in the nominal program, and `G0 Z5` in the corrected one.",
    ),
    _rule(
        "OLP311",
        "corrected twice",
        Severity.ERROR,
        "The program that counts as nominal carries the stamp of a correction, or a program carries two: the "
        "model was applied twice, so the path is off by the whole error the other way.",
        "Take the nominal program, as it came from CAM, and correct that once.",
        "`olp check twice.nc --nominal once.nc`, where once.nc is corrected already.",
    ),
    _rule(
        "OLP312",
        "corrected with another calibration",
        Severity.ERROR,
        "The stamp of the program does not belong to the calibration of this machine file: the machine was "
        "measured again since, or the program was corrected for another machine.",
        "Correct the nominal program with the calibration that is in force.",
        "part.corrected.nc of last month, and a calibration.toml of today.",
    ),
    _rule(
        "OLP405",
        "outside the calibrated volume",
        Severity.ERROR,
        "A corrected command, or an arc between its ends, leaves box_mm of the calibration. Nobody has "
        "measured the error there.",
        "Move the part, measure the machine there, or accept the error at the face with --outside-box hold.",
        "box_mm of X up to 2000, and an arc that bulges to X2003 between two ends inside.",
    ),
    _rule(
        "OLP406",
        "tool unlike those measured with",
        Severity.WARNING,
        "The tip is farther from the gauge point, in some direction, than it was from any tool vector of the "
        "measurement by more than tool_within_mm of [check]: angular errors act over a lever that was never "
        "seen.",
        "Measure with a tool of such length too, or raise tool_within_mm with a reason.",
        "Curves with tool_mm = [0, 0, -120], and a tool of 300 mm.",
    ),
    _rule(
        "OLP407",
        "temperature unlike that of the calibration",
        Severity.WARNING,
        "A temperature of the job is farther from temperature_degC of the calibration than "
        "temperature_within_K of [check]. Expansion is only what [thermal] says; bending only what its "
        "structure holds.",
        "Wait until the machine is back in its range, or measure it warm.",
        "temperature_degC = 20, X_scale = 28 in the job file.",
    ),
    _rule(
        "OLP408",
        "age of the calibration not checked",
        Severity.INFO,
        "`olp` asks no clock, so without --date nobody has compared the calibration with the day of the run.",
        "Give --date, in a pipeline the day of the run.",
        "`olp check part.nc -m machine.toml`.",
    ),
    _rule(
        "OLP409",
        "correction larger than the sanity limit",
        Severity.ERROR,
        "A way-point was moved by more than largest_correction_um of [check]. Either the machine is that "
        "bad, or an input is wrong: a sign, a unit, an offset, another machine.",
        "Look at `olp inspect machine.toml --at` of that place; raise the limit where the figure is right.",
        "EXX written in mm into a column EXX_um of a thousand times the value.",
    ),
    _rule(
        "OLP410",
        "the control compensates everything",
        Severity.ERROR,
        'compensated_by_controller = "all": a corrected program would be corrected twice. The other findings '
        "are for a control whose tables are off.",
        "List what the control corrects now and did not while measuring, or switch its tables off.",
        'compensated_by_controller = "all".',
    ),
    _rule(
        "OLP411",
        "digits too coarse",
        Severity.WARNING,
        "Rounding to the last digit that the control takes (0.87 of it in space) may leave more than the "
        "tolerance, so the tolerance promises what the digits cannot hold.",
        "Let the control take more digits (least_increment_mm), or state the tolerance that is meant.",
        "least_increment_mm = 0.01 with --tolerance-um 1.",
    ),
)
