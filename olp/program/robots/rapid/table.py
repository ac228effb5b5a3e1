"""What becomes of the instructions of RAPID, by their names in capitals."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support
from olp.program.robots.rapid.forms import FORMS, JOINT_MOVES

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

_COMPUTED = "goes where only the control knows; program the target with its numbers"
_MOVED = "moves all later targets by an amount that the text does not state; program the moved targets"
_PATH = "changes the path while the robot moves; take it into a program of its own"
_APPLICATION = "is a move of an application package with words of its own; post it as MoveL"
_AXES = "moves single axes past the targets"
_OTHER = "robots move at the same time: moves with an ID are left as written"
_WHOLE = "as MoveL, MoveJ or MoveC; never split, as an action belongs to its end or its way"
_PROCESS = "as MoveL, MoveJ or MoveC; the data of its process stay as they are"

TABLE: Mapping[bytes, tuple[Support, str]] = {
    **dict.fromkeys((word for word, form in FORMS.items() if form.whole), (_C, _WHOLE)),
    **dict.fromkeys((word for word, form in FORMS.items() if not form.whole), (_C, _PROCESS)),
    **dict.fromkeys((b"SEARCHL", b"SEARCHC"), (_C, "corrected at its end; where it stops is not known")),
    b"MOVEL": (_C, "a straight move to a target with numbers, Offs or RelTool of one, or an array element"),
    b"MOVEJ": (_C, "corrected at its end; the path of the joints is not judged"),
    **dict.fromkeys(sorted(JOINT_MOVES), (_C, "corrected on arms; else kept, and where it ends unknown")),
    b"MOVEC": (_C, "an arc through a target to another one; several arcs where one would bend"),
    b"ROBTARGET": (_C, "a declared target, corrected where moves use it, and cloned where they differ"),
    b"TOOLDATA": (_R, "the tool of moves that name it"),
    b"WOBJDATA": (_R, "the frame of moves that name it"),
    b"SPEEDDATA": (_R, "the speed of moves that name it"),
    b"JOINTTARGET": (_X, "kept as written"),
    b"CONST": (_X, "other constants and variables"),
    b"MODULE": (_X, ""),
    b"CIRPATHMODE": (_R, "with CirPointOri or Wrist45 ... an arc is refused"),
    b"SOFTACT": (_R, "the axes are soft from here on: what the load does to the path is not corrected"),
    b"SINGAREA": (_R, "with Wrist a straight move of an arm is corrected at its end, with LockAxis4 refused"),
    b"PROC": (_R, "where its first move comes from is not known: it is corrected at its end"),
    b"IF": (_R, "behind moves that may not run, the next one is corrected at its end"),
    b"CALL": (_R, "behind a routine that may move, the next move is corrected at its end"),
    b"ASSIGNMENT": (_X, "moves to what it changes, or with such a tool or frame, are left as written"),
    **dict.fromkeys((b"SEARCHJ", b"CONTACTL"), (_NO, _COMPUTED)),
    b"TRIGGABSJ": (_NO, "is a move with an action on the way, which is not read yet"),
    **dict.fromkeys((b"PDISPON", b"PDISPSET"), (_NO, _MOVED)),
    **dict.fromkeys((b"EOFFSON", b"EOFFSSET"), (_NO, "moves a track, or a positioner; elsewhere it is kept")),
    **dict.fromkeys(
        (b"CORRCON", b"CORRWRITE", b"EGMACTPOSE", b"EGMACTJOINT", b"EGMACTMOVE", b"EGMRUNPOSE",
         b"EGMRUNJOINT", b"EGMMOVEL", b"EGMMOVEC", b"EGMSTREAMSTART", b"CONTACTL"),
        (_NO, _PATH),
    ),
    **dict.fromkeys(
        (b"SPOTML", b"SPOTMJ", b"NUTL", b"NUTJ", b"LASERL", b"LASERC", b"CALIBL", b"CALIBJ", b"CALIBC",
         b"FCPRESSL", b"FCPRESSC"),
        (_NO, _APPLICATION),
    ),
    **dict.fromkeys(
        (b"MOVEEXTJ", b"INDAMOVE", b"INDRMOVE", b"INDDMOVE", b"INDCMOVE", b"STEPBWDPATH", b"DROPWOBJ",
         b"WAITWOBJ", b"STARTLOAD"),
        (_NO, _AXES),
    ),
    **dict.fromkeys((b"SETDATAVAL", b"SETALLDATAVAL"), (_NO, "gives another value to data that it names")),
    **dict.fromkeys((b"SYNCMOVEON", b"SYNCMOVERESUME"), (_R, _OTHER)),
    **dict.fromkeys(
        (b"CONFL", b"CONFJ", b"VELSET", b"ACCSET", b"WORLDACCLIM", b"PATHACCLIM", b"PATHRESOL",
         b"MOTIONSUP", b"GRIPLOAD", b"MECHUNITLOAD", b"ACTUNIT", b"DEACTUNIT", b"SPEEDREFRESH",
         b"WAITTIME", b"WAITDI", b"WAITDO", b"WAITUNTIL", b"WAITGI", b"WAITGO", b"WAITAI", b"WAITAO",
         b"WAITROB", b"WAITSYNCTASK", b"SETDO", b"SETGO", b"SETAO", b"SET", b"RESET", b"PULSEDO", b"INVERTDO",
         b"IODISABLE", b"IOENABLE", b"TPWRITE", b"TPERASE", b"TPREADFK", b"TPREADNUM", b"TPSHOW", b"UIMSGBOX",
         b"UISHOW", b"ERRWRITE", b"ERRLOG", b"CLKSTART", b"CLKSTOP", b"CLKRESET", b"INCR", b"DECR", b"ADD",
         b"CLEAR", b"OPEN", b"CLOSE", b"WRITE", b"WRITEBIN", b"WRITESTRBIN", b"WRITEANYBIN", b"READANYBIN",
         b"READRAWBYTES", b"WRITERAWBYTES", b"CLEARRAWBYTES", b"PACKRAWBYTES", b"UNPACKRAWBYTES", b"REWIND",
         b"CLEARIOBUFF", b"REMOVEFILE", b"MAKEDIR", b"SOCKETCREATE", b"SOCKETCONNECT", b"SOCKETBIND",
         b"SOCKETLISTEN", b"SOCKETACCEPT", b"SOCKETSEND", b"SOCKETRECEIVE", b"SOCKETCLOSE", b"CONNECT",
         b"IDELETE", b"IENABLE", b"IDISABLE", b"ISIGNALDI", b"ISIGNALDO", b"ISIGNALGI", b"ISIGNALAI",
         b"ISIGNALAO", b"ITIMER", b"IWATCH", b"ISLEEP", b"IERROR", b"IPERS", b"PDISPOFF", b"EOFFSOFF",
         b"CORRCLEAR", b"CORRDISCON", b"SOFTDEACT", b"EGMRESET", b"EGMGETID", b"EGMSETUPUC", b"EGMSTOP",
         b"EGMSTREAMSTOP", b"SYNCMOVEOFF", b"TRIGGIO", b"TRIGGEQUIP", b"TRIGGINT", b"WAITSYNC",
         b"STOPMOVE", b"STARTMOVE", b"CLEARPATH", b"STOREPATH", b"BOOKERRNO", b"RAISE", b"RETRY", b"TRYNEXT",
         b"RESETRETRYCOUNT", b"TESTSIGNDEFINE", b"WARMSTART", b"GETTRAPDATA", b"READERRDATA", b"GETSYSDATA",
         b"SPYSTART", b"SPYSTOP", b"LOAD", b"UNLOAD", b"WAITLOAD", b"SAVE", b"TEXTTABINSTALL", b"SETSYSDATA",
         b"SETDATASEARCH", b"GETDATAVAL", b"BITSET", b"BITCLEAR", b"COPYFILE", b"RENAMEFILE",
         b"CLOSEDIR", b"OPENDIR", b"STOP", b"STOPMOVERESET", b"WZBOXDEF", b"WZDOSET",
         b"WZLIMSUP", b"WZFREE", b"WZENABLE", b"WZDISABLE", b"WZSPHDEF", b"WZCYLDEF", b"BREAK", b"EXIT",
         b"EXITCYCLE", b"RETURN", b"GOTO"),
        (_X, ""),
    ),
}  # fmt: skip
