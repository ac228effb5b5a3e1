"""What becomes of the statements of a TP program."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"L P[n]": (_C, "a straight move"),
    b"C P[n] P[m]": (_C, "an arc through P[n] to P[m]; several arcs where one would bend"),
    b"J P[n]": (_C, "corrected at its end; the path of the joints is not judged"),
    b"P[n]{...}": (_C, "changed where moves use it, and cloned where they differ"),
    b"L PR[n], J PR[n]": (_R, "left as written: the text does not state the register"),
    b"P[n]{J1=...}": (_C, "corrected on arms; else kept, and the position behind it is unknown"),
    b"CONFIG": (_C, "on arms: the letters name the posture, and turns are written again where they change"),
    b"Offset,PR[n]": (_R, "with the numbers of PR[n] in the program; else the move is left as written"),
    b"Tool_Offset,PR[n]": (_R, "as Offset, along the tool"),
    b"PR[n,i]=": (_R, "a number is kept for Offset, UFRAME and UTOOL"),
    b"UFRAME[n]=PR[i]": (_R, "the frame n, where the program gives PR[i] its numbers"),
    b"UTOOL[n]=PR[i]": (_R, "the tool n, where the program gives PR[i] its numbers"),
    b"UFRAME_NUM=": (_R, "the frame of positions with UF : F"),
    b"UTOOL_NUM=": (_R, "the tool of positions with UT : F"),
    b"LBL, CALL, IF, FOR": (_R, "where moves depend on the run, the next one is corrected at its end"),
    b"Weave": (_R, "the path about which the tool swings is corrected, and a finding says so"),
    b"Skip": (_R, "the move is never split, and where the next one begins is not known"),
    b"TB, TA, DB, AP_LD, RT_LD": (_R, "the move is never split"),
    b"ACC, PTH, EV": (_X, ""),
    b"RTCP": (_NO, "the tool stands still, and the robot moves the part"),
    b"Wjnt": (_NO, "behind a straight move of an arm: the wrist turns by its joints; post it without"),
    b"another word behind a move": (_NO, "its effect on the path is not known; post the move without it"),
    b"any other statement": (_X, "a macro may move: the next move is corrected at its end"),
    b"!": (_X, ""),
    b"A P[n], S P[n]": (_NO, "is an arc of several moves or a spline; post arcs (C) or straight moves"),
    b"INC": (_NO, "is a distance; program the position"),
    b"COORD": (_NO, "counts from a positioner, whose place is not stated; post the program without it"),
    b"P[n]=": (_NO, "gives another value to a position"),
    b"OFFSET CONDITION": (_NO, "moves later targets; state the register in each move"),
    b"VOFFSET, Touch Offset, Track": (_NO, "moves targets by what a sensor sees"),
}  # fmt: skip
