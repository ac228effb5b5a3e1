"""The rules of what a program says: path modes, units, offsets, and what was detected from its text."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="program")

RULES = (
    _rule(
        "OLP201",
        "path mode without tolerance",
        Severity.WARNING,
        "In G64 without P the control rounds corners as far as its acceleration requires, which can be a "
        "millimetre.",
        "Use G64 P<tolerance> Q0, or G61 where exact stops are affordable.",
        "`G64` alone in the first line of a LinuxCNC program.",
    ),
    _rule(
        "OLP202",
        "path tolerance larger than the correction",
        Severity.WARNING,
        "The control may leave the programmed path by more than the whole correction. The correction then "
        "has no effect.",
        "Use a path tolerance well below the correction.",
        "`G64 P0.5` on a machine whose largest error is 0.04 mm.",
    ),
    _rule(
        "OLP203",
        "path mode merges blocks",
        Severity.WARNING,
        "G64 P without Q0 lets the control merge short blocks and use the whole path tolerance to smooth "
        "them.",
        "Add Q0, so that P bounds the deviation at corners only.",
        "`G64 P0.01`, where LinuxCNC takes Q = P.",
    ),
    _rule(
        "OLP208",
        "other axes not timed",
        Severity.WARNING,
        "Blocks also move a rotary or other axis, whose limits are not known here. Only X, Y and Z are "
        "timed, so the program takes longer than it says.",
        "Add the time of these blocks, or measure it at the control.",
        "`G1 A3600 F1000` on a machine file with X, Y and Z.",
        gate=False,
    ),
    _rule(
        "OLP209",
        "times of the control not stated",
        Severity.INFO,
        "The program changes tools, starts the spindle or calls M functions. The machine file does not state "
        "how long that takes, so it counts as no time.",
        "Give tool_change_s, spindle_start_s and m_codes_s in the table [times] of the machine file.",
        "`T2 M6` and a machine file without [times].",
        gate=False,
    ),
    _rule(
        "OLP210",
        "word that the time of the control leaves out",
        Severity.INFO,
        "The time on this control does not know what this word does to it. The builder of the machine sets "
        "it, or it changes feeds and corners by rules that are not published.",
        "Compare with the control, or learn limits and corners from a log of a run with `--log`.",
        "`CYCL DEF 32.2 HSC-MODE:1` with `--controller heidenhain`.",
        gate=False,
    ),
    _rule(
        "OLP301",
        "units assumed",
        Severity.INFO,
        "The program states neither G20 nor G21. Millimetres were assumed.",
        "State G21 (or G20) at the start of the program.",
        "`G90 G54` and no G21 before `G0 X10`.",
    ),
    _rule(
        "OLP302",
        "numbers without decimal point",
        Severity.WARNING,
        "On this control a length without a decimal point counts least increments: X100 is 0.1 mm.",
        'If the control is set to calculator-type input, state decimal_point = "calculator" in the machine '
        "file.",
        "`X100` on a Fanuc control.",
        doubt=True,
    ),
    _rule(
        "OLP303",
        "touch-off assumed",
        Severity.INFO,
        "The work offset counts as touched off on the uncompensated machine, so the correction leaves the "
        "touched point where it is.",
        'State set_by = "true" where the part was located by other means.',
        "`[work_offsets.G54]` with X_mm, Y_mm, Z_mm and nothing else.",
    ),
    _rule(
        "OLP304",
        "block delete",
        Severity.INFO,
        "Blocks under `/` were taken as executed. The program was proved with them left out too.",
        "Nothing to do where both positions of the switch are meant.",
        "`/G1 X100`.",
    ),
    _rule(
        "OLP305",
        "contour under cutter compensation",
        Severity.INFO,
        "Under G41/G42 the control makes the path of the tool from the contour and the cutter radius. The "
        "correction is computed on that path. It holds for the radius of the tool table, and well enough "
        "for a wear that is small beside it. No step takes up backlash along a contour.",
        "Keep radius_mm and wear_mm as the control has them. Have the path of the tool written (--contour "
        "path) where an axis with backlash turns round on the contour.",
        "`G41 D1` in a program for LinuxCNC.",
    ),
    _rule(
        "OLP313",
        "how the control makes a contour is assumed",
        Severity.WARNING,
        "How a contour begins, and how the tool goes round its outside corners, is a parameter of this "
        "control. The correction and its proof hold for what the message says.",
        "Compare it with the parameters of the control. Or have the path of the tool written (--contour "
        "path), which leaves nothing to them.",
        "`G41 D1` in a program for Fanuc: start-up of type A is assumed.",
    ),
    _rule(
        "OLP314",
        "path of the tool written without compensation",
        Severity.WARNING,
        "The contour was replaced by the path of the tool, so the control adds no radius and no wear.",
        "Correct the nominal program again when the wear has changed.",
        "`olp correct part.ngc --contour path` with `G41 D1` in the program.",
        gate=False,
    ),
    _rule(
        "OLP306",
        "feed move from an uncorrected position",
        Severity.WARNING,
        "A feed move starts where a move ended uncorrected, or where a canned cycle ended, which is right at "
        "one depth only. So its beginning deviates by more than the numerical tolerance, and counts in the "
        "verdict.",
        "Command all axes in rapids first, or put a rapid in front, after (olp on). Or give start_mm in the "
        "job file.",
        "`G0 X10`, then `G1 X50 Y10 Z1 F600`, with Y and Z unknown at the G0. Or a feed move after (olp off) "
        "and (olp on).",
    ),
    _rule(
        "OLP331",
        "detected from the text",
        Severity.INFO,
        "The file does not state this. It was detected from its rows or taken from the machine file.",
        "Check that it is right. State it in the header, or in a profile (--profile).",
        "`10;20;30` as the first row: the delimiter is a semicolon, the columns are X, Y and Z.",
    ),
    _rule(
        "OLP332",
        "orientation changes",
        Severity.WARNING,
        "Three linear axes cannot turn the tool. Orientations are kept as written, and the correction uses "
        "one tool vector for all rows.",
        "Correct lists of one orientation at a time, each with the tool vector that it has there.",
        "A column C that goes from 0 to 90 degrees.",
    ),
    _rule(
        "OLP333",
        "deviation between positions of a list",
        Severity.INFO,
        "A list states positions and not how the machine moves between them. On straight moves the errors "
        "would bend the path between two corrected positions by more than the tolerance.",
        'State joined = "lines" and insert = true in the profile, if the machine moves straight and rows '
        "may be inserted.",
        "Two tag points 2 m apart on a machine whose straightness is 5 um.",
    ),
    _rule(
        "OLP334",
        "macro of the machine",
        Severity.WARNING,
        "A name that is no command of the control is a macro of the machine, which is not read. No position "
        "is known after it. The modes G90, G91, M82 and M83 are taken to be those before it.",
        "State the modes again behind a macro that changes them. Name macros that move nothing in "
        "still_macros of the machine file.",
        "`START_PRINT BED=60` in a program for Klipper.",
    ),
    _rule(
        "OLP412",
        "thermal compensation in the program",
        Severity.WARNING,
        "The program switches on the control's own compensation for temperature (TECOMP, TEMPR). Expansion "
        "is corrected twice where the calibration was measured without it, or the job states temperatures "
        "too.",
        "State in active_during_measurement what was on while measuring, and leave temperatures_degC out of "
        "the job. Or switch the control's compensation off.",
        "`TECOMP/ON,0.0000105` in a DMIS program.",
    ),
    _rule(
        "OLP413",
        "direction of arcs assumed",
        Severity.WARNING,
        "CIRCLE statements of a form that is not that of Creo, NX or SolidWorks CAM are read as right-handed "
        "about their normal, and nothing in the program confirms it. Or an arc turns back where it should go "
        "on. Along the other part of the circle the errors differ.",
        "Compare one arc with the simulation of the CAM system (olp view), or have it write GOTOs for arcs.",
        "`CIRCLE/0,0,0,0,0,-1,5,0.06` behind a corner.",
    ),
    _rule(
        "OLP414",
        "transform of points assumed",
        Severity.WARNING,
        "TRACUT or TRANS moves points. The points after it are read as not moved yet, so that the "
        "post-processor moves them. Some CAM systems write points that are moved already and only repeat the "
        "statement.",
        "Compare one point with the simulation of the CAM system (olp view). If it is moved already, take "
        "the statement out.",
        "`TRACUT/1,0,0,250,0,1,0,0,0,0,1,0`.",
    ),
    _rule(
        "OLP415",
        "scans left uncorrected",
        Severity.WARNING,
        "The control follows the surface along a path (PATH, PAMEAS). The surface decides where the probe "
        "goes, so the points of the path are kept as written.",
        "Correct what the scan reports: olp results. Or measure with PTMEAS points.",
        "`PAMEAS/DISTANCE,0.5,P(PATH1)`.",
    ),
    _rule(
        "OLP416",
        "arcs read as chords",
        Severity.INFO,
        "An arc in no plane of two axes of the machine is read as chords within 0.2 um of it. Where the "
        "correction changes it, these chords are written as GOTO statements in its place.",
        "Nothing has to be done. Where the program becomes too long for the post-processor, have the CAM "
        "system write such arcs as points.",
        "`CIRCLE/10,0,10,0,0.6,0.8,10`.",
    ),
    _rule(
        "OLP417",
        "preset taken as the work offset of the job",
        Severity.WARNING,
        "The program selects a preset of the control that neither machine nor job states. The work offset of "
        "the job is taken for it. If the preset is elsewhere, the part is corrected for another place.",
        "State the preset, such as [work_offsets.2] for Q339=2, in the machine or job file.",
        "`CYCL DEF 247` with Q339=2, and [work_offsets.G54] alone.",
    ),
)
