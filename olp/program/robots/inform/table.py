"""What becomes of the statements of a job of INFORM, and which of them neither move nor lead elsewhere."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

#: Moves that are not read, and why.
REFUSED: Mapping[bytes, str] = {
    b"MOVS": "is a spline, which is not read; post straight moves (MOVL)",
    **dict.fromkeys(
        (b"SMOVS", b"EMOVL", b"EMOVC"),
        "counts from a positioner or another robot, whose place is not stated; post the job without it",
    ),
}
#: Moves by a distance.
BY_DISTANCE = frozenset((b"IMOV", b"EIMOVL", b"EIMOVC"))
#: Statements of blocks.
BLOCKS: Mapping[bytes, str] = {
    b"IFTHENEXP": "if", b"IFTHEN": "if", b"SWITCH": "if", b"ELSEIFEXP": "else", b"ELSEIF": "else",
    b"ELSE": "else", b"CASE": "else", b"DEFAULT": "else", b"ENDIF": "end", b"ENDSWITCH": "end",
    b"WHILEEXP": "loop", b"WHILE": "loop", b"FOR": "loop", b"ENDWHILE": "end", b"NEXT": "end",
}  # fmt: skip
#: Statements behind which the control moves all targets, those that end this, and what is done to them.
MOVING: Mapping[bytes, tuple[bytes, str]] = {
    b"SFTON": (b"SFTOF", "a shift (SFTON)"),
    b"COMARCON": (b"COMARCOF", "a sensor (COMARCON)"),
    b"SYSTART": (b"SYEND", "a conveyor (SYSTART)"),
}
#: Statements that give a position to their first argument.
ASSIGNING = frozenset(
    (b"SET", b"SETE", b"ADD", b"SUB", b"MUL", b"DIV", b"INC", b"DEC", b"CNVRT", b"MSHIFT", b"GETS", b"GETPOS",
     b"MULMAT", b"INVMAT", b"CLEAR", b"GETARG", b"DIN", b"AIN", b"LOADV", b"NSRCH", b"PRINTMSG")
)  # fmt: skip
#: Statements that use a position as a direction alone, so that its last digits do not count.
POINTING = frozenset((b"REFP",))
#: Statements that give numbers to frames and tools.
SETTING = frozenset((b"MFRAME", b"SETTOOL"))
#: Statements of the control: the robot stays where it is, and the next one follows.
STILL = ASSIGNING | POINTING | SETTING | frozenset(
    (b"NOP", b"DOUT", b"PULSE", b"AOUT", b"ARATION", b"ARATIOF", b"WAIT", b"TIMER", b"PAUSE", b"AND", b"OR",
     b"NOT", b"XOR", b"GETE", b"SIN", b"COS", b"ATAN", b"SQRT", b"SETFILE", b"GETFILE", b"SETREG", b"GETREG",
     b"MSG", b"CLS", b"COMM", b"DI", b"EI", b"ADVINIT", b"ADVSTOP", b"SPEED",
     b"ARCON", b"ARCOF", b"ARCSET", b"ARCCTS", b"ARCCTE", b"ARCCUR", b"ARCVOL", b"AWELD", b"VWELD", b"WVON",
     b"WVOF", b"CLRSENS", b"SFTOF", b"COMARCOF", b"SYEND", b"SKILLSND", b"TSYNC", b"PSTART", b"PWAIT",
     b"LOGSET", b"CVAR", b"HAND", b"HSEN", b"TOOLON", b"TOOLOF", b"LASERON", b"LASEROF", b"STROBE", b"UNLOCK",
     b"LOCK", b"CWAIT", b"VAR$", b"CHR$", b"MID$", b"LEN$", b"VAL", b"ASC", b"CAT$", b"MVAL", b"DIALOG")
)  # fmt: skip

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"MOVL": (_C, "a straight move to a taught position (C) or a position variable (P)"),
    b"MOVJ": (_C, "corrected at its end; the path of the joints is not judged"),
    b"C00000=, P000=": (_C, "changed where moves use it, and cloned where they differ"),
    b"MOVC": (_C, "three behind a move: straight to the first, then an arc; others: corrected at points"),
    b"///RECTAN": (_R, "positions X, Y, Z, Rx, Ry, Rz in mm and deg"),
    b"///PULSE": (_R, "positions in pulses: corrected on arms that state pulses_per_deg, else kept"),
    b"///ANGLE": (_R, "joints in degrees: corrected on arms, else kept"),
    b"///POSTYPE": (_R, "BASE, ROBOT and USER are read; TOOL and MTOOL are refused where a move uses one"),
    b"///USER": (_R, "the frame UFn of machine or job file"),
    b"///TOOL": (_R, "the tool of machine or job file by its number"),
    b"///RCONF": (_R, "on arms: names the posture of MOVJ, and is written again where it changes"),
    b"///NPOS": (_R, "the count of taught positions is raised where it was right"),
    b"BC00000=, EC00000=": (_R, "kept; a move during which one changes is never split"),
    b"V=": (_R, "the speed, in mm/s"),
    b"PL=": (_R, "parts of a move are passed"),
    b"SMOVL": (_C, "as MOVL; corrected at its end where a positioner moves, from which its path counts"),
    b"SMOVC": (_C, "corrected at its points, as its path counts from a positioner"),
    b"UNTIL, SRCH, NWAIT, T=, T0000": (_R, "the move is never split"),
    b"+MOVJ EC": (_R, "a positioner moves at the same time; each part states where it is"),
    b"VJ=, VR=, ACC=, DEC=, CR=, CONT": (_X, ""),
    b"SFTON, COMARCON, SYSTART": (_R, "the moves up to SFTOF, COMARCOF, SYEND are left as written"),
    b"SET, SETE, ADD, CNVRT": (_R, "moves to a position that gets another value are left as written"),
    b"MFRAME, SETTOOL": (_R, "give the same frame or tool in the job file"),
    b"MOVJ EC": (_X, "a positioner moves, and the robot does not"),
    b"CALL, *LABEL, IFTHENEXP": (_R, "where moves depend on the run, the next is corrected at its end"),
    b"REFP, ARCON, DOUT, TIMER": (_X, ""),
    b"any other statement": (_X, "may move: the next move is corrected at its end"),
    b"'": (_X, ""),
    b"IMOV": (_R, "left as written: a distance from where the robot is"),
    **{name: (_NO, why) for name, why in REFUSED.items()},
    b"another word behind a move": (_NO, "its effect on the path is not known; post the move without it"),
}  # fmt: skip
