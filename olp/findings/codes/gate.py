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
        "An axis with backlash reverses again and again after moves that are hardly longer than its "
        "backlash. There the tip follows the play more than the command, and small errors of the measured "
        "backlash add up.",
        "Smooth the passage in the source, with fewer points or a larger chord tolerance in the CAM system.",
        "`[backlash] X_um = 20`, and X10.00 X10.05 X10.00 X10.05 in a row.",
    ),
    _rule(
        "OLP205",
        "feed beyond the velocity of an axis",
        Severity.WARNING,
        "The programmed feed asks an axis for more than its velocity_mm_s. The control slows down there, or "
        "stops with an alarm.",
        "Lower F. `olp retime --write-feed` writes feeds that the axes can follow.",
        "`G1 X100 F60000` on an axis with velocity_mm_s = 500.",
    ),
    _rule(
        "OLP206",
        "acceleration beyond an axis",
        Severity.WARNING,
        "At the programmed feed, an arc or a run of short blocks asks an axis for more than its "
        "acceleration_mm_s2. The control slows down, or leaves the path. A correction can add short blocks.",
        "Lower F there. `olp retime --slow` lists where and why.",
        "`G2 I0.5 F6000`: 100 mm/s about a radius of 0.5 mm asks for 20 m/s2.",
    ),
    _rule(
        "OLP207",
        "feeds not checked against an axis",
        Severity.INFO,
        "The machine file does not state the velocity or the acceleration of an axis. Whether the axis can "
        "follow the programmed feed was not checked there.",
        "Give velocity_mm_s and acceleration_mm_s2 of the axis in the machine file.",
        "`[axes.X]` without velocity_mm_s, as `olp init` writes it where it was not stated.",
    ),
    _rule(
        "OLP307",
        "no feed",
        Severity.ERROR,
        "A feed move has no feed, or the feed cannot be read. The control stops with an alarm, or moves at "
        "the last feed of the program before.",
        "Write an F word in the first feed move, and in every block of G93.",
        "`G1 X100` with no F before it.",
    ),
    _rule(
        "OLP308",
        "feed by time or by turns",
        Severity.INFO,
        "In G93, F is one over the time of a block. In G95, F counts per turn of the spindle. The motion "
        "then depends on how blocks are split, and on the spindle speed.",
        "Check that this is meant. Write G94 where it is not.",
        "`G93` in the first line, kept from a job with a rotary axis.",
    ),
    _rule(
        "OLP309",
        "feed changed",
        Severity.WARNING,
        "The feed of the corrected program differs from that of the nominal one by more than 5 %. An F word "
        "or a feed mode was lost or changed.",
        "Compare the F words of both programs at these lines.",
        "`G1 X100 F600` in the nominal program, and F60 in the corrected one.",
    ),
    _rule(
        "OLP310",
        "below the nominal path",
        Severity.ERROR,
        "A first move or a rapid takes the tip lower in Z than the nominal program does, by more than the "
        "tolerance. A move that should clear the part may hit it.",
        "Look at the Z words of these blocks. Correct the nominal program again.",
        "`G0 Z50` as retract in the nominal program, and `G0 Z5` in the corrected one.",
    ),
    _rule(
        "OLP311",
        "corrected twice",
        Severity.ERROR,
        "The nominal program carries the stamp of a correction, or a program carries two stamps. The "
        "correction was applied twice, so the path is wrong by the whole error with the opposite sign.",
        "Take the nominal program as the CAM system wrote it, and correct it once.",
        "`olp check twice.nc --nominal once.nc`, where once.nc is corrected already.",
    ),
    _rule(
        "OLP312",
        "corrected with another calibration",
        Severity.ERROR,
        "The stamp of the program does not belong to the calibration of this machine file. The machine was "
        "measured again since, or the program was corrected for another machine.",
        "Correct the nominal program with the calibration that is in force.",
        "part.corrected.nc of last month, and a calibration.toml of today.",
    ),
    _rule(
        "OLP405",
        "outside the calibrated volume",
        Severity.ERROR,
        "A corrected command, or an arc between its ends, leaves box_mm of the calibration. The error there "
        "was not measured.",
        "Move the part, measure the machine there, or accept the error at the face with --outside-box hold.",
        "box_mm of X up to 2000, and an arc that bulges to X2003 between two ends inside.",
    ),
    _rule(
        "OLP406",
        "tool unlike those of the calibration",
        Severity.WARNING,
        "The tool vector differs from every tool vector of the calibration by more than tool_within_mm of "
        "[check], in at least one direction. Angular errors act over a lever arm that was not measured.",
        "Measure with a tool of such length too, or raise tool_within_mm with a reason.",
        "Curves with tool_mm = [0, 0, -120], and a tool of 300 mm.",
        doubt=True,
    ),
    _rule(
        "OLP407",
        "temperature unlike that of the calibration",
        Severity.WARNING,
        "A temperature of the job differs from temperature_degC of the calibration by more than "
        "temperature_within_K of [check]. The model knows only the expansion in [thermal] and the bending "
        "in its structure.",
        "Wait until the machine is back in its range, or measure it warm.",
        "temperature_degC = 20, X_scale = 28 in the job file.",
    ),
    _rule(
        "OLP408",
        "age of the calibration not checked",
        Severity.INFO,
        "`olp` does not read the system clock. Without --date the age of the calibration is not compared "
        "with its validity.",
        "Give --date, in a pipeline the day of the run.",
        "`olp check part.nc -m machine.toml`.",
    ),
    _rule(
        "OLP409",
        "correction larger than the sanity limit",
        Severity.ERROR,
        "A waypoint was moved by more than largest_correction_um of [check]. The machine has such large "
        "errors, or an input is wrong: a sign, a unit, an offset, another machine.",
        "Look at the error with `olp inspect machine.toml --at` that position, or `--axes` those values. "
        "Raise the limit where the error is real.",
        "EXX in nm, written into the column EXX_um.",
        doubt=True,
    ),
    _rule(
        "OLP410",
        "the control compensates everything",
        Severity.ERROR,
        'With compensated_by_controller = "all", a corrected program would be corrected twice. The other '
        "findings are for a control whose tables are off.",
        "List the errors that the control corrects now and did not correct while measuring, or switch its "
        "tables off.",
        'compensated_by_controller = "all".',
    ),
    _rule(
        "OLP411",
        "digits too coarse",
        Severity.WARNING,
        "Rounding to the last digit that the control takes can exceed the numerical tolerance. In space the "
        "rounding error is up to 0.87 of that digit.",
        "Give a smaller least_increment_mm if the control takes more digits, or raise the tolerance.",
        "least_increment_mm = 0.01 with --tolerance-um 1.",
    ),
)
