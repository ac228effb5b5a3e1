"""What becomes of the statements of a KRL text."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

#: Functions that neither move the robot nor set base or tool, in capitals.
STILL = frozenset(
    (b"ABS", b"SIN", b"COS", b"TAN", b"ACOS", b"ATAN2", b"SQRT", b"INV_POS", b"FORWARD", b"INVERSE",
     b"VARSTATE", b"VARTYPE", b"STRLEN", b"STRDECLLEN", b"STRCLEAR", b"STRADD", b"STRFIND", b"STRCOMP",
     b"STRCOPY", b"STRTOINT", b"STRTOREAL", b"STRTOBOOL", b"PULSE", b"CWRITE", b"CREAD", b"COPEN", b"CCLOSE",
     b"SREAD", b"SWRITE", b"EKI_INIT", b"EKI_OPEN", b"EKI_CLOSE", b"EKI_CLEAR", b"EKI_SEND", b"EKI_GETREAL",
     b"EKI_GETINT", b"EKI_GETBOOL", b"EKI_GETFRAME", b"EKI_GETSTRING", b"EKI_SETREAL", b"EKI_SETINT",
     b"EKI_SETBOOL", b"EKI_SETFRAME", b"EKI_SETSTRING", b"EKI_CHECKBUFFER", b"EKI_HALT", b"TIMER_LIMIT",
     b"SVEL_JOINT", b"SVEL_CP", b"SACC_JOINT", b"SACC_CP", b"STOOL", b"STOOL2", b"SBASE", b"SLOAD",
     b"SIPO_MODE", b"SAPO", b"SAPO_PTP", b"SGEAR_JERK", b"SJERK", b"SORI_TYP", b"SCIRC_TYP", b"SREF",
     b"USE_CM_PRO_VALUES", b"IR_STOPM", b"SET_CD_PARAMS", b"SET_KRLMSG", b"SET_KRLDLG", b"EXISTS_KRLMSG",
     b"EXISTS_KRLDLG", b"CLEAR_KRLMSG", b"GET_SYSTEM_DATA", b"SIGN", b"MIN", b"MAX", b"ROUND", b"ERR_RAISE",
     b"NOT", b"AND", b"OR", b"EXOR", b"IF", b"WHILE", b"UNTIL", b"SWITCH", b"CASE", b"RETURN", b"WAIT",
     b"FOR", b"B_AND", b"B_OR", b"B_EXOR", b"B_NOT", b"TO", b"THEN", b"BY", b"MBX_REC")
)  # fmt: skip

#: Those among them that give an argument another value.
WRITING = frozenset(
    (b"CREAD", b"SREAD", b"EKI_GETREAL", b"EKI_GETINT", b"EKI_GETBOOL", b"EKI_GETFRAME", b"EKI_GETSTRING",
     b"STRTOINT", b"STRTOREAL", b"STRTOBOOL", b"GET_SYSTEM_DATA", b"MBX_REC")
)  # fmt: skip

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"LIN, SLIN": (_C, "a straight move to {...}, a name of one, or a product (:) of them"),
    b"PTP, SPTP": (_C, "corrected at its end; the path of the joints is not judged"),
    b"S, T": (_C, "on arms: S names the posture, and T is written again where an axis passes zero"),
    b"E6POS, POS, FRAME": (_C, "changed where moves use it, and cloned where they differ"),
    b"{A1 ...}, E6AXIS": (_C, "corrected on arms; else kept, and the position behind it is unknown"),
    b"$BASE, $TOOL": (_R, "a number, numbers, $NULLFRAME, or the name of a frame"),
    b"BASE_DATA[n], TOOL_DATA[n]": (
        _R, "where the text states their numbers, or `$config.dat`; else those of machine or job"
    ),
    b"FDAT_ACT, BAS": (_R, "base and tool of a taught point; behind #INITMOV base 0 and tool 1"),
    b"$VEL.CP": (_R, "the speed from here on"),
    b"$ORI_TYPE=#VAR": (_R, "tools turn evenly on straight moves from here on"),
    b"$ORI_TYPE=": (_NO, "on arms, with #CONSTANT or #JOINT before a straight move; set #VAR"),
    b"WITH": (_R, "base and tool of the move"),
    b"IF, SWITCH, FOR, WHILE, REPEAT, LOOP": (
        _R, "behind moves that may not run, the next one is corrected at its end"
    ),
    b"a call": (_R, "may move, and set base and tool: these have to be set again"),
    b"TRIGGER": (_R, "the move behind it is never split"),
    b"$POS_ACT, $AXIS_ACT": (_X, "a move to them goes nowhere"),
    b"XHOME": (_X, "joint values of the control's own data, or of `joint_targets` of the job"),
    b"WAIT, $OUT, HALT, INTERRUPT, ON_ERROR_PROCEED": (_X, ""),
    b"other assignments": (_X, "unless they change a position or frame that a move uses: then refused"),
    b"CIRC, SCIRC": (_C, "an arc through a position to another one; several arcs where one would bend"),
    b"CIRC_REL, SCIRC_REL": (_R, "left as written: a distance from where the robot is"),
    b"CA": (_NO, "ends an arc by its angle, elsewhere than its end says; program the end"),
    b"$CIRC_TYPE=": (_NO, "before an arc, with another value than #BASE: the tool turns along with the arc"),
    b"SPLINE": (_NO, "is a spline; post straight moves"),
    b"{X ...} that lacks numbers": (_R, "left as written: they are as where the robot comes from"),
    b"LIN_REL, PTP_REL": (_R, "left as written: a distance from where the robot is"),
    b"ASYPTP": (_NO, "moves external axes past the targets"),
    b"#TCP": (_R, "the tool stands still, and the robot moves the part: moves are left as written"),
    b"RSI_MOVECORR, RSI_ON": (_NO, "moves targets by what a sensor says"),
}  # fmt: skip
