"""Why a program is refused: the codes that `ProgramError` carries."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, severity=Severity.ERROR, topic="refusal", gate=False)

RULES = (
    _rule(
        "OLP500",
        "refused",
        why="The statement cannot be read correctly, and what is read wrongly is corrected wrongly.",
        remedy="Do what the message says.",
        example="A statement for which no other code of this group fits.",
    ),
    _rule(
        "OLP501",
        "not a program that is read",
        why="The text is in a language of another control, or it is another kind of file.",
        remedy="Give the program for the control of the machine file, or what the CAM system writes "
        "before its post-processor (APT CLDATA).",
        example="`MAZATROL` at the start: a program of Mazatrol.",
    ),
    _rule(
        "OLP502",
        "not plain text",
        why="Programs are read byte by byte, so that all that is not corrected remains as it is. "
        "UTF-16 and binary files have no such bytes.",
        remedy="Save or export the program as plain text (ASCII or UTF-8).",
        example="A program that a Windows editor saved as Unicode (UTF-16).",
    ),
    _rule(
        "OLP503",
        "dialect is not certain",
        why="The text, or its text and the ending of its file, fit several dialects. They "
        "read the same statement differently.",
        remedy="Name the dialect with --dialect, or with the key dialect of the job file.",
        example="A file `part.dmi` with the statements of an APT program.",
    ),
    _rule(
        "OLP504",
        "no columns of positions",
        why="The list does not show which of its columns are X, Y and Z, or a row has no numbers there.",
        remedy="Name the columns in the header, or give a profile with --dialect. Use the same "
        "delimiter and decimal mark in all rows.",
        example="`1;2` as a row of a list with three columns.",
    ),
    _rule(
        "OLP505",
        "form of a line",
        why="The control refuses a line that is too long, or whose tape mark or block number "
        "is not in its place.",
        remedy="Write the line as the message says.",
        example="`X10 N20`: the block number is not the first word.",
    ),
    _rule(
        "OLP506",
        "not whole",
        why="Elements of XML, or blocks of a program in it, do not hold together. So none of its "
        "statements is known.",
        remedy="Export the program again, or mend the place that the message names.",
        example="A `<Value` without its end, or a document type, which could name other files.",
    ),
    _rule(
        "OLP510",
        "statement is not understood",
        why="It may move the machine, or change how later statements are read.",
        remedy="Correct it, or take it out. If it is right, the text may be of another dialect (--dialect).",
        example="`X10,5`: a comma instead of a decimal point.",
    ),
    _rule(
        "OLP511",
        "parameters or flow control",
        why="Loops, calls and expressions get their values at run time. A correction needs plain blocks.",
        remedy="Unroll the program with --flatten. Or have the CAM system write plain blocks.",
        example="`#1=5` and `G1 X#1`, or `M98 P1000`.",
    ),
    _rule(
        "OLP512",
        "statement is not read in this dialect",
        why="Its effect is made inside the control, needs axes that are not modelled, or is not known.",
        remedy="Have the CAM system write plain moves for it. If another control is meant, state it in the "
        "machine file (controller), or with --dialect.",
        example="`G68.2 X0 Y0 Z0 I30`, a tilted plane.",
    ),
    _rule(
        "OLP513",
        "cutter radius is not known",
        why="The control makes the path of the tool itself, from a radius in its tables.",
        remedy="Give radius_mm, and wear_mm, of the tool in the machine or job file, "
        "as the control has them.",
        example="`G41 D7` without radius_mm in `[tools.7]`.",
    ),
    _rule(
        "OLP514",
        "comment is nested or not closed",
        why="A comment ends at the first closing bracket. So the rest of its line is read as words, "
        "and the control refuses it, or moves.",
        remedy="Take the inner brackets out, or replace them by [ and ]. Close each comment in its line.",
        example="`(ROUGHING (TOOL 5) SIDE A)`.",
    ),
    _rule(
        "OLP515",
        "stated twice in one block",
        why="A control takes one word of a letter and one code of a modal group per block. "
        "Which one it takes of two is not known.",
        remedy="Leave one of the two, or write two blocks.",
        example="`G1 X10 X20`, or `G0 G1 X10`.",
    ),
    _rule(
        "OLP516",
        "word is missing or impossible",
        why="Without the word, or with this value, the control refuses the block or reads "
        "it in a way that is not known.",
        remedy="Give the word that the message names.",
        example="`M61` without Q, or `T1.5`.",
    ),
    _rule(
        "OLP517",
        "no motion code in force",
        why="A block has axis words, and no code says how to move there.",
        remedy="Give G0, G1, G2 or G3 in the block or before it. Where the setting of the control is known, "
        "state it as `motion` in `[job_defaults]`.",
        example="`X10 Y10` as the first block, or after G80.",
        follows=True,
    ),
    _rule(
        "OLP518",
        "does not go with what is in force",
        why="The statement and a mode, or two statements of one block, exclude each other.",
        remedy="End the mode before, or write two blocks, as the message says.",
        example="`G53 X0` under G91.",
        follows=True,
    ),
    _rule(
        "OLP519",
        "word that no code uses",
        why="The control refuses a block with a word that no code of it takes. Often a code is missing.",
        remedy="Remove the word, or give the code that uses it.",
        example="`G1 X10 R5`: G1 has no R.",
        follows=True,
    ),
    _rule(
        "OLP520",
        "work offset is not defined",
        why="Without the offset the positions of the machine are not known, and its errors depend on them.",
        remedy="Give [work_offsets.NAME] in the machine or job file, with the values of the control.",
        example="`G55` and no [work_offsets.G55].",
    ),
    _rule(
        "OLP521",
        "tool is not defined",
        why="Angular errors act on the vector from the gauge point to the tip, and the tool "
        "length is part of the axis positions.",
        remedy="Give [tools.N] in the machine or job file, with its length from the table of the control.",
        example="`T7 M6` and no [tools.7].",
    ),
    _rule(
        "OLP522",
        "stylus is not defined",
        why="Angular errors act on the vector from the end of the ram to the centre of the tip.",
        remedy="Give [styli.NAME] offset_mm in the machine or job file.",
        example='`SNSLCT/S(S2)` and no [styli."S2"].',
    ),
    _rule(
        "OLP523",
        "frame is not read in this form",
        why="The frame is turned, tilted or named in a way whose effect on positions is not known here.",
        remedy="State the frame with its numbers and without the turn, as the message says.",
        example="`CSYS/A1` with a name instead of numbers.",
    ),
    _rule(
        "OLP524",
        "position is not known",
        why="The block needs the present position, and an axis has not been commanded yet. The "
        "error of the machine depends on it.",
        remedy="Command X, Y and Z in an absolute rapid first, or give start_mm in the job file. Where G28, "
        "G30 and M6 leave the axes can be stated in the machine file: home_mm, second_home_mm, "
        "tool_change_mm and tool_change_moves. A job file needs a machine file: --skew, --scale and "
        "--backlash take none.",
        example="`G2 X10 Y0 I5` as the first move.",
        follows=True,
    ),
    _rule(
        "OLP525",
        "later blocks depend on block delete",
        why="One corrected program cannot be right for both positions of the switch.",
        remedy="Take the `/` out, or restate the code or the axes in the next block without `/`. Or state "
        "`block_delete` in the job file and unroll the program with --flatten: then it is right for that "
        "position alone.",
        example="`/G91` before `G1 X10`.",
    ),
    _rule(
        "OLP526",
        "writes a table of the control",
        why="Tables of tools and offsets decide later positions, and what this block "
        "writes there is not read.",
        remedy="State the values in the machine or job file, and take the block out.",
        example="`G10 L1 P1 Z100`.",
    ),
    _rule(
        "OLP528",
        "contour that the control refuses",
        why="Under G41/G42 the control makes the path of the tool from the contour. Where the cutter does "
        "not fit into it, the control stops or cuts what it should not.",
        remedy="Use a smaller cutter, make the move longer, or enter the contour by a straight move that is "
        "longer than the cutter radius.",
        example="A pocket corner between two moves of 3 mm with a cutter radius of 5 mm.",
    ),
    _rule(
        "OLP530",
        "impossible arc",
        why="The control refuses an arc whose start, end and centre or radius do not fit.",
        remedy="Write more digits, or check the plane (G17, G18, G19) and whether I, "
        "J and K are absolute (G90.1).",
        example="`G2 X10 Y0 I4 J0` from X0 Y0: the radius is 4 mm at its start and 6 mm at its end.",
        follows=True,
    ),
    _rule(
        "OLP531",
        "canned cycle is incomplete",
        why="A word of the cycle is missing or impossible, so its path is not known.",
        remedy="Give the word in the first block of the cycle.",
        example="`G83 X0 Y0 Z-10 R2` without Q.",
        follows=True,
    ),
    _rule(
        "OLP532",
        "order of statements",
        why="The statement needs another one before it or after it.",
        remedy="Give the statement that the message names.",
        example="`ENDMES` without MEAS.",
        follows=True,
    ),
    _rule(
        "OLP533",
        "named position is not certain",
        why="The statement moves to a position by its name, and the text has none or two of that name.",
        remedy="Define the position once, or correct the list of positions that has it.",
        example="`JMOVE P5` without a definition of P5.",
        follows=True,
    ),
    _rule(
        "OLP540",
        "expression is not valid",
        why="The value of the word cannot be computed.",
        remedy="Correct the expression.",
        example="`X[1/0]`.",
        follows=True,
    ),
    _rule(
        "OLP541",
        "value is not known off line",
        why="The value is in the control: a probe result, an offset, a setting, or a "
        "parameter that another program has set.",
        remedy="Assign the value in the program, before it is used. Or give it in "
        "[parameters] of the job file.",
        example="`X#5061` (the last probe result).",
        follows=True,
    ),
    _rule(
        "OLP542",
        "loop, branch or call without its other end",
        why="A loop has no end, a branch no target, or a subprogram no text.",
        remedy="Add what is missing, or put the file of the subprogram beside the program.",
        example="`M98 P1000` and no O1000.",
        follows=True,
    ),
    _rule(
        "OLP543",
        "run is too long",
        why="The program would have more blocks, levels, holes, strokes or turns than can be meant.",
        remedy="Correct the endless loop, or the number that is too large or too small. "
        "Divide a long program.",
        example="`WHILE [1 EQ 1] DO1`.",
    ),
    _rule(
        "OLP544",
        "cannot be unrolled",
        why="Plain blocks cannot have the effect of this statement.",
        remedy="Write the path as plain blocks, as the message says.",
        example="`G66.1 P9000`, a macro with the words of every block.",
    ),
    _rule(
        "OLP550",
        "payload is not certain",
        why="The errors of the machine depend on the payload, and two sources contradict each "
        "other or one is not understood.",
        remedy="State the payload once: in the comments of the program, or in the job file.",
        example="`(OLP PAYLOAD heavy)`.",
    ),
    _rule(
        "OLP551",
        "feed or dwell has no value",
        why="Without it the time of the motion is not known.",
        remedy="Give the word that the message names.",
        example="`G1 X10` before any F.",
        follows=True,
    ),
    _rule(
        "OLP560",
        "already corrected",
        why="The text has the stamp of a correction. A second one would apply the model twice.",
        remedy="Correct the nominal program.",
        example="`olp correct part.corrected.ngc`.",
    ),
    _rule(
        "OLP561",
        "correction cannot be written",
        why="The corrected block would not have the meaning that it must have.",
        remedy="Change the block in the nominal program, as the message says.",
        example="A short arc of G93 before which backlash has to be taken up.",
    ),
    _rule(
        "OLP562",
        "not a correction of the nominal program",
        why="The two programs do not belong together, so nothing is proved about them.",
        remedy="Give the nominal program and its own correction, the nominal one first.",
        example="`olp verify part.corrected.ngc part.ngc`: the order is wrong.",
    ),
    _rule(
        "OLP563",
        "machine with other joints",
        why="This verb, or this dialect, is read for three linear axes only. Or the machine has other "
        "axes than X, Y, Z and rotary ones named A, B and C, so that words mean other motions.",
        remedy="Use `olp correct`, `verify`, `check` or `simulate` with G-code or a list of axis values. "
        "Look at the machine with `olp inspect machine.toml`, or compute with `olp.load_kinematics`.",
        example="`olp retime part.nc -m trunnion.toml`, and a program for an arm.",
    ),
    _rule(
        "OLP564",
        "word of an axis that is not read",
        why="The block moves an axis that the machine file does not state, or states "
        "a rotary axis where nothing "
        "moves.",
        remedy="State the axis in the machine file. Give offsets of rotary axes in [work_offsets.NAME].",
        example="`G1 B10` on a machine with A and C, `G92 A0`, and `E1` of a robot that is not at zero.",
    ),
    _rule(
        "OLP565",
        "not corrected with rotary joints",
        why="On a machine with rotary joints these blocks would need a correction that is not built.",
        remedy="Post the program as the message says: straight moves, cycles written out, "
        "the path of the tool's "
        "centre.",
        example="`G41 D1` or `G2 X10 I5` on a five-axis machine.",
    ),
    _rule(
        "OLP566",
        "no command for a pose",
        why="No axis values near the programmed ones bring the tool with its errors to "
        "where it should be, or no "
        "number of splits keeps the path between them within tolerance.",
        remedy="Look at the machine and its calibration there with `olp inspect "
        "--axes`. Keep away from singular "
        "postures, or raise the tolerances.",
        example="A tip on the axis of a table that would have to turn about it at once.",
    ),
    _rule(
        "OLP567",
        "corrected command out of travel",
        why="The correction leads an axis beyond its travel, at a waypoint or between two, where the control "
        "stops with an alarm.",
        remedy="Move the part away from the end of the travel, or correct travel_mm "
        "and travel_deg in the machine "
        "file.",
        example="`G1 A30` where travel_deg ends at 30 and A is corrected upwards.",
    ),
)
