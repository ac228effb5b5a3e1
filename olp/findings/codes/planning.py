"""The rules of what is told about a calibration from outside: doctor, plan and refinement."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="planning", gate=False)

RULES = (
    _rule(
        "OLP831",
        "curve in the wrong sense or unit",
        Severity.ERROR,
        "Independent points say that this error of the machine is the stated one times another factor: minus "
        "one where the sense is wrong, a thousand or 4.848 where the unit is. Corrected with it, programs "
        "get worse.",
        "Look at the sense and unit of the instrument's file; `olp calibrate doctor -o` writes a calibration "
        "with all that is decided put right.",
        "EBX flipped: a level that counts + where the nose goes down.",
    ),
    _rule(
        "OLP832",
        "curves of an axis in another arrangement",
        Severity.ERROR,
        "Independent points are explained much better where two columns change places, positions count from "
        "the other end, or the reflector stood elsewhere.",
        "Look at the names of columns and how the lines were taken; `olp calibrate doctor -o` writes what is "
        "decided.",
        "EAX and EBX in each other's place: pitch and roll of X confused.",
    ),
    _rule(
        "OLP833",
        "sense not decided by these points",
        Severity.WARNING,
        "With the noise of the points and an unknown frame either sense of this curve remains possible, or "
        "its neighbours explain the points as well.",
        "Add the proposed points to the same set-up; a curve that does little anywhere may stay open.",
        "ECZ, which acts on offset tools only, from points with one straight tool.",
    ),
    _rule(
        "OLP834",
        "points not explained",
        Severity.WARNING,
        "Whatever sign and unit the curves have, points differ from the calibration by several times their "
        "uncertainty: the machine has changed, the points are of another machine or state, or the stated "
        "uncertainty is too small. What is decided is decided with the larger scatter.",
        "Compare date, temperature and active tables of the control; look at the rows with large residuals.",
        "Points taken after a crash.",
    ),
    _rule(
        "OLP835",
        "point far off",
        Severity.WARNING,
        "This point is off by many times its uncertainty while the others agree: another target, a broken "
        "beam, an axis that was still moving.",
        "Measure it again, or leave the row out.",
        "Row 14, 9 standard deviations off.",
    ),
    _rule(
        "OLP836",
        "error not on the machine",
        Severity.ERROR,
        "Points show nothing of this curve, although they would: the control corrects it already, or the "
        "curve is of another state of the machine. Corrected with it, the error comes back in the other "
        "sense.",
        "Look at the tables that are active in the control, and list them in compensated_by_controller.",
        "EXX while the pitch compensation of X is on.",
    ),
    _rule(
        "OLP837",
        "wanted uncertainty out of reach",
        Severity.WARNING,
        "None of the methods that were compared gets there in the given box with the given instruments.",
        "Use a better instrument or more points (--points), make the box smaller (--box), or want less.",
        "2 um over 3 x 2 x 1 m from a tracker of 15 um.",
    ),
    _rule(
        "OLP838",
        "plan leaves errors unseen",
        Severity.WARNING,
        "Whatever the readings will be, nothing in this plan depends on these errors, or too little.",
        "Use three reflectors that are not on one line, or another method.",
        "ECZ with one straight reflector.",
    ),
    _rule(
        "OLP839",
        "run not foreseen by the calibration's uncertainty",
        Severity.WARNING,
        "The points differ from the calibration by more than noise and its covariance explain: the machine "
        "has changed, or the covariance is too small. It was moved within its covariance all the same, and "
        "the new uncertainty is larger by what was not foreseen.",
        "Look for the change (temperature, crash, active tables); measure anew where it is large, refine "
        "again where it is small.",
        "15 um found, 6 um expected.",
    ),
)
