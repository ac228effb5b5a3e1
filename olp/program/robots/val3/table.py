"""What becomes of the statements of a program of VAL 3."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

#: Instructions that neither move the robot nor change data that they are given, in small letters.
STILL = frozenset(
    (
        b"waitendmove open close delay wait popupmsg put putln cls logmsg userpage title gotoxy settextmode "
        b"disablepower enablepower setpayload stopmove restartmove setmoveid getmoveid setvelocity "
        b"setmonitorspeed isempty issettled autoconnectmove taskkill tasksuspend taskresume taskstatus "
        b"setmutex libload libsave siolink siosettings clearbuffer sioctrl setfullgain setjointmon ioset "
        b"aioset dioset watch beep size distance iskeypressed setinputs popup help resetturn setprofile"
    ).split()
)
#: Instructions after which the robot may be anywhere, in small letters.
AWAY = frozenset((b"resetmotion",))

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"movel": (_C, "a straight move to a point, its numbers, appro(...) or compose(...)"),
    b"movej": (_C, "corrected at its end; the path of the joints is not judged"),
    b"movec": (_C, "an arc through a point to another one; several arcs where one would bend"),
    b"point, pointRx, pointRs": (
        _C, "changed where moves use it; where they differ it gets a further element"
    ),
    b"joint, jointRx, jointRs": (_C, "corrected on arms; else kept, and the position behind it is unknown"),
    b"{{...},{...}}": (_C, "a point in the world with its configuration"),
    b"p.trsf = {...}, p.trsf.x =": (_C, "numbers in an assignment, and those that a call gives"),
    b"shoulder, elbow, wrist": (_R, "on arms these words name the posture"),
    b"frame, tool": (_R, "from the data or an assignment, or from machine or job"),
    b"link": (_R, "the frame that a point counts from"),
    b"mdesc": (_R, "speed; parts of a move get an element of their own that blends"),
    b"call": (_R, "a program of the application is followed; one of a library may do anything"),
    b"if, switch, while, for, do": (
        _R, "behind moves that may not run, the next one is corrected at its end"
    ),
    b"other assignments": (_R, "data that are computed are refused where a move uses them"),
    b"resetMotion": (_R, "the robot may be anywhere behind it"),
    b"here, herej": (_X, "a move there goes nowhere"),
    b"waitEndMove, open, close, delay, wait, popUpMsg": (_X, ""),
    b"alterMovej, alterMovel, alterMovec": (_NO, "is a path that is altered in the run"),
    b"taskCreate": (
        _R, "the only task that moves is followed; correct others alone, moves beside them are at their ends"
    ),
    b"millimeterUnit": (_NO, "with the value false: lengths in inch"),
}  # fmt: skip
