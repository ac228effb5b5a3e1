"""The statements of Heidenhain conversational programs: what becomes of each. One table for the reader and
for `olp inspect`."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

#: what --flatten writes out
UNROLL = "write it out with --flatten"
_FLOW = f"branches, repeats or calls: {UNROLL}"
_JUMP = f"branches, unless they pass over assignments alone: {UNROLL}"
_PATH = f"follows from the blocks beside it: {UNROLL}"
_CONTROL = "is a path that the control makes itself"
_FREE = "is free contour programming: the control finds its points; have it converted to L and C"
_TILT = "tilts the working plane; only angles of 0 are read"
_KNOWN_AT_RUN = "takes values that only the control knows"

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"L": (_C, "straight moves, also bare words; I before a letter is a distance; FMAX is a rapid"),
    b"CC": (_C, "the pole; a new one is put before an arc whose centre moves alone"),
    b"C": (_C, "arcs about the pole, whole circles, in the plane of the pole"),
    b"CR": (_C, "arcs with a radius"),
    b"CP": (_C, "arcs and helices with an angle about the pole"),
    b"BEGIN PGM": (_R, "MM or INCH"),
    b"END PGM": (_R, "the end"),
    b"TOOL CALL": (_R, "the tool, by number or name, and DL; its length is active from here on"),
    b"CYCL DEF 1": (_R, "pecking from the present height, which is corrected"),
    b"CYCL DEF 2": (_R, "as CYCL DEF 1"),
    b"CYCL DEF 17": (_R, "as CYCL DEF 1"),
    b"CYCL DEF 200": (_R, "holes are corrected in the plane, and in depth by a CYCL DEF with another Q203"),
    **dict.fromkeys(
        (b"CYCL DEF 201", b"CYCL DEF 202", b"CYCL DEF 203", b"CYCL DEF 205", b"CYCL DEF 206",
         b"CYCL DEF 207", b"CYCL DEF 208", b"CYCL DEF 209", b"CYCL DEF 240", b"CYCL DEF 241"),
        (_R, "as CYCL DEF 200"),
    ),
    b"CYCL CALL": (_R, f"one hole where the tool is, as M99; POS and PAT: {UNROLL}"),
    b"CYCL DEF 7": (_R, "datum shift with numbers"),
    b"TRANS DATUM": (_R, "as CYCL DEF 7; not TABLE"),
    b"TRANS MIRROR": (_NO, f"as CYCL DEF 8: {UNROLL}"),
    b"TRANS ROTATION": (_NO, f"as CYCL DEF 10: {UNROLL}"),
    b"TRANS SCALE": (_NO, f"as CYCL DEF 11: {UNROLL}"),
    b"CYCL DEF 9": (_R, "a dwell"),
    b"CYCL DEF 247": (_R, "the preset: a work offset with its number as name, else the one of the job"),
    b"CYCL DEF 8": (_NO, f"mirrors X or Y: {UNROLL}"),
    b"CYCL DEF 10": (_NO, f"rotates: {UNROLL}"),
    b"CYCL DEF 11": (_NO, f"scales: {UNROLL}"),
    b"CYCL DEF 26": (_NO, f"scales single axes: {UNROLL}"),
    b"CYCL DEF 19": (_NO, _TILT),
    b"CYCL DEF 220": (_NO, f"makes a pattern of holes on a circle: {UNROLL}"),
    b"CYCL DEF 221": (_NO, f"makes a pattern of holes on lines: {UNROLL}"),
    b"CYCL DEF 224": (_NO, "makes a pattern of holes that encodes a text; post the holes one by one"),
    b"PLANE": (_NO, f"{_TILT}; as a frame where the machine file has the rotary axes"),
    b"FUNCTION TCPM": (_NO, "needs the rotary axes of the machine; describe them in the machine file"),
    b"M128": (_NO, "as FUNCTION TCPM"),
    b"M91": (_R, "axis positions; left uncorrected"),
    b"M92": (_R, "a position that is not known"),
    b"M99": (_R, "one hole at the end of the block"),
    b"PATTERN DEF": (_NO, f"makes a pattern of holes: {UNROLL}"),
    b"M89": (_NO, f"a hole at the end of each block: {UNROLL}"),
    b"LBL": (_R, "labels; those whose section only sets modes may be called"),
    b"CALL LBL": (_NO, _FLOW),
    b"CALL PGM": (_NO, _FLOW),
    b"FN 9": (_NO, _JUMP),
    b"FN 10": (_NO, _JUMP),
    b"FN 11": (_NO, _JUMP),
    b"FN 12": (_NO, _JUMP),
    b"Q": (_R, "parameters with numbers, for feeds and cycles; expressions and axis words with --flatten"),
    b"FN 0": (_R, "as Q"),
    b"FN 18": (_R, "the parameter is not known afterwards"),
    **dict.fromkeys(
        (b"FN 1", b"FN 2", b"FN 3", b"FN 4", b"FN 5", b"FN 6", b"FN 7", b"FN 8", b"FN 13"),
        (_R, "as FN 18; its value with --flatten"),
    ),
    b"FN 17": (_NO, "writes into tables of the control"),
    b"STOP": (_R, "the motion rests"),
    b"LP": (_NO, f"states a polar position: {UNROLL}"),
    b"CT": (_NO, _PATH),
    b"CTP": (_NO, _PATH),
    b"RND": (_NO, _PATH),
    b"CHF": (_NO, _PATH),
    b"APPR": (_NO, _PATH),
    b"DEP": (_NO, _PATH),
    b"RL": (_NO, f"the control offsets the contour by the radius of the tool: {UNROLL}"),
    b"RR": (_NO, f"the control offsets the contour by the radius of the tool: {UNROLL}"),
    b"LN": (_NO, "needs the rotary axes of the machine; describe them in the machine file"),
    b"SPL": (_NO, _CONTROL),
    **dict.fromkeys((b"FL", b"FLT", b"FC", b"FCT", b"FPOL", b"FSELECT"), (_NO, _FREE)),
    b"TCH PROBE": (_NO, _KNOWN_AT_RUN),
    **dict.fromkeys(
        (b"BLK FORM", b"TOOL DEF", b"CYCL DEF 13", b"CYCL DEF 32", b"CYCL DEF 239", b"CYCL DEF 332",
         b"CYCL DEF 392", b"FN 14", b"FN 15", b"FN 16", b"FN 19", b"FN 20", b"FN 26", b"FN 27",
         b"FN 29", b"FN 38",
         b"FUNCTION RESET", b"FUNCTION MODE", b"FUNCTION DWELL", b"FUNCTION FEED", b"FUNCTION S-PULSE",
         b"FUNCTION PROG PATH", b"FUNCTION TOOL"),
        (_X, ""),
    ),
}  # fmt: skip
