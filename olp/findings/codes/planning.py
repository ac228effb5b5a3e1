"""The rules of what independent points say about a calibration: doctor, plan and refinement."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="planning", gate=False)

RULES = (
    _rule(
        "OLP831",
        "curve with the wrong sign or unit",
        Severity.ERROR,
        "Independent points show this error times another factor than stated: -1 for a wrong sign, 1000 or "
        "4.848 for a wrong unit. Corrected with this curve, programs get worse.",
        "Check the sign convention and unit of the instrument's file. `olp calibrate doctor -o` writes a "
        "calibration with everything that is decided corrected.",
        "EBX with the opposite sign: a level that counts + where the nose goes down.",
    ),
    _rule(
        "OLP832",
        "curves of an axis in another arrangement",
        Severity.ERROR,
        "Independent points fit much better with another arrangement: two columns exchanged, positions "
        "counted from the other end, or another offset of the reflector.",
        "Check the names of columns and how the lines were taken. `olp calibrate doctor -o` writes what is "
        "decided.",
        "EAX and EBX exchanged: pitch and roll of X confused.",
    ),
    _rule(
        "OLP833",
        "sign not decided by these points",
        Severity.WARNING,
        "With the noise of the points and an unknown instrument frame, either sign of this curve is "
        "possible. Or other curves explain the points as well.",
        "Add the proposed points to the same set-up. A curve with little effect anywhere may stay undecided.",
        "ECZ, which acts on offset tools only, from points with one straight tool.",
    ),
    _rule(
        "OLP834",
        "points not explained",
        Severity.WARNING,
        "With every sign and unit, points differ from the calibration by several times their uncertainty. "
        "The machine has changed, the points are of another machine or state, or the uncertainty is too "
        "small. The verdicts use the larger scatter.",
        "Compare date, temperature and active tables of the control. Look at the rows with large residuals.",
        "Points taken after a crash.",
    ),
    _rule(
        "OLP835",
        "point far off",
        Severity.WARNING,
        "This point deviates by many times its uncertainty while the others agree. It is another target, "
        "the beam was broken, or an axis was still moving.",
        "Measure it again, or leave the row out.",
        "Row 14, 9 standard deviations off.",
    ),
    _rule(
        "OLP836",
        "error not on the machine",
        Severity.ERROR,
        "The points do not show this curve, although they would. The control corrects it already, or the "
        "curve is of another state of the machine. Corrected with it, the machine gets the opposite error.",
        "Look at the tables that are active in the control, and list their errors in "
        "compensated_by_controller.",
        "EXX while the pitch compensation of X is on.",
    ),
    _rule(
        "OLP837",
        "wanted uncertainty out of reach",
        Severity.WARNING,
        "None of the methods compared reaches the wanted uncertainty in the given box with the given "
        "instruments.",
        "Use a better instrument or more readings (--points, or N of --next), make the box smaller (--box), "
        "or accept a larger uncertainty.",
        "2 um over 3 x 2 x 1 m from a tracker of 15 um.",
    ),
    _rule(
        "OLP838",
        "errors not observable with this plan",
        Severity.WARNING,
        "The readings of this plan depend on these errors too little or not at all, whatever their values "
        "are.",
        "Use three reflectors that are not on one line, or another method.",
        "ECZ with one straight reflector.",
    ),
    _rule(
        "OLP839",
        "deviation beyond the calibration's uncertainty",
        Severity.WARNING,
        "The points differ from the calibration by more than noise and its covariance explain. The machine "
        "has changed, or the covariance is too small. The calibration was refined within its covariance all "
        "the same, and its new uncertainty is larger.",
        "Look for the change (temperature, crash, active tables). Measure again where it is large, refine "
        "again where it is small.",
        "15 um measured, 6 um expected.",
    ),
    _rule(
        "OLP840",
        "a run that agrees too well",
        Severity.WARNING,
        "The points differ from the calibration by much less than their own noise would make them differ. "
        "So this run has refined the calibration before, or the stated uncertainty of the points is too "
        "large.",
        "Do not refine with one run twice: it counts as two, and the stated uncertainty is too small. Else "
        "state what the points scatter by.",
        "Reduced chi-square is 0.09 with 57 readings.",
    ),
)
