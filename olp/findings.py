"""Findings: what a person should know about a run, as data with stable codes.

One table holds every code, so that the report, `--select`, `--fail-on` and `olp explain` agree.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from olp.gate_rules import GATE
from olp.rule import Rule as Rule
from olp.rule import Severity as Severity


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
        'file.',
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
        "A corrected command leaves the travel of an axis, so the control will stop with a limit alarm.",
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
)

RULES = {rule.code: rule for rule in sorted((*_TABLE, *GATE), key=lambda rule: rule.code)}


def worst(findings: Iterable[Finding]) -> Severity | None:
    """The highest severity among findings, None where there are none."""
    return max((finding.severity for finding in findings), default=None)
