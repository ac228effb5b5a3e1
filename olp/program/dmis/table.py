"""The statements of DMIS: what becomes of each. One table for the reader and for `olp inspect`.

Forms after ISO 22093, and the habits of WinWerth and MODUS.
"""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

_FEATURE = "nominals, tolerances and actuals are never edited"
_RUN_TIME = (
    "goes to a position that only the run of the program decides; align with MEAS and DATSET, "
    "and write the points after that"
)
_JUMP = (
    "jumps, so which statements run is known at run time only; "
    "write them in the order in which they run, or between IF and ENDIF"
)
_SCAN = "scans in a form that is not known; write PTMEAS points, or MEAS with PATH and PAMEAS"

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"GOTO": (_C, "x,y,z, CART, POL,r,angle,height, and INCR,distance,i,j,k; POL and INCR become CART. INCR "
            "behind a touch or another position that only the control knows is left as it is"),
    b"PTMEAS": (_C, "CART,x,y,z or POL,r,angle,height, with or without a direction, inside MEAS or RMEAS"),
    b"PAMEAS": (_R, "scans along a PATH, inside MEAS: the control follows the surface; left uncorrected"),
    b"CALIB": (_R, "CALIB/SENS: as MEAS; others are refused"),
    b"WKPLAN": (_R, "the plane of POL: XYPLAN, YZPLAN or ZXPLAN"),
    b"DMESW": (_R, "CONTIN and PAUSE; other commands may move the machine and are refused"),
    b"MEAS": (_R, "a feature is measured; without a PTMEAS the control makes its own points"),
    b"RMEAS": (_R, "as MEAS; its points are corrected at their nominal positions"),
    b"ENDMES": (_R, ""),
    b"FROM": (_R, "where GOHOME goes; left uncorrected"),
    b"GOHOME": (_R, "left uncorrected"),
    b"RAPID": (_R, "for the next GOTO"),
    b"UNITS": (_R, "MM, CM, M or INCH"),
    b"SNSDEF": (_R, "FIXED,CART: the offset of the stylus, its tool vector"),
    b"SNSLCT": (_R, "the stylus; its offset from the job, else from SNSDEF"),
    b"TRANS": (_R, "D() = …: a frame of the job, under the label of the datum"),
    b"ROTATE": (_R, "D() = …: a frame of the job, under the label of the datum"),
    b"DATSET": (_R, "D() = …: a frame of the job, under the label of the datum"),
    b"RECALL": (_R, "D(): a frame of the job, under the label of the datum; of a sensor S() or SA(), which "
               "SNSLCT has to select"),
    b"MODE": (_R, "points under MODE/MAN are left uncorrected: the operator moves the machine"),
    b"TECOMP": (_R, "thermal compensation is detected, with a warning"),
    b"TEMPR": (_R, "thermal compensation is detected, with a warning"),
    b"FEDRAT": (_R, "POSVEL and MESVEL in MMPS, MPM, IPS or IPM"),
    b"IF": (_R, "points are corrected in both branches; frames and styli must not change there"),
    b"ELSE": (_R, ""),
    b"ELSEIF": (_R, ""),
    b"ENDIF": (_R, ""),
    b"DO": (_R, "points are corrected; frames and styli must not change there"),
    b"ENDDO": (_R, ""),
    b"MACRO": (_R, "M() = MACRO … ENDMAC: refused where it moves"),
    b"ENDMAC": (_R, ""),
    b"CALL": (_R, "a macro of this program, which does not move"),
    b"ENDFIL": (_R, "the end"),
    **dict.fromkeys(
        (b"FEAT", b"TOL", b"CONST", b"DATDEF", b"DATTRG", b"OUTPUT", b"EVAL", b"REFMNT", b"BOUND"),
        (_X, _FEATURE),
    ),
    **dict.fromkeys(
        (
            b"FILNAM", b"DMISMN", b"DMISMD", b"DVPOFT", b"DECPL", b"TEXT", b"SNSET", b"ACLRAT", b"FLY",
            b"PRCOMP", b"SAVE", b"DMEID", b"DMESWI", b"DMESWV", b"MATDEF", b"GECOMP",
            b"DISPLY", b"DISPLAY", b"VFORM", b"OPEN", b"CLOSE", b"WRITE",
            b"REPORT", b"GEOALG", b"ALGDEF", b"LITDEF", b"FILDEF", b"CZSLCT", b"CZONE", b"PIEZOWFP",
            b"POINTDIST", b"SCANFILTER", b"SPLINESCAN3D", b"W3D", b"DELETE", b"DEVICE", b"DID", b"FINPOS",
            b"MFGDEV", b"PARTID", b"PARTREV", b"PARTSER", b"QISDEF", b"OPERID", b"PLANID", b"LOTID", b"DATE",
            b"TIME", b"CMPNTGRP", b"SENSOR", b"SNSMNT", b"SNSGRP", b"WRIST", b"EXTENS", b"THLDEF", b"CLMPID",
            b"CLMPSN", b"FIXTID", b"FIXTSN", b"PREVOP", b"PROCID", b"ROTDEF", b"CRGDEF", b"ERROR", b"BADTST",
            b"ALGOR", b"LOTNUM", b"KEYCHAR", b"QUERY", b"VALUE", b"LIGHTOPTION", b"SIMREQT", b"UNCERTSET",
            b"UNCERTALG", b"ENDXTN", b"DECL", b"PSTHRU",
        ),
        (_X, ""),
    ),
    **dict.fromkeys(
        (b"PATH", b"SCNMOD", b"SCNSET", b"SCNPLN"),
        (_X, "of scans, which are left uncorrected: the surface decides where the probe goes"),
    ),
    b"SCAN": (_NO, _SCAN),
    b"PAUSE": (_X, "stops for the operator on some controls, as DMESW/PAUSE does; not of the standard"),
    **dict.fromkeys((b"JUMPTO", b"SELECT", b"CASE", b"ENDCAS", b"DFTCAS", b"ENDSEL"), (_NO, _JUMP)),
    **dict.fromkeys((b"XTERN", b"INCLUD"), (_NO, "runs another file; put its statements into this program")),
    **dict.fromkeys((b"LOCATE", b"ITERAT", b"BFSET", b"PTBUFF", b"RESUME"), (_NO, _RUN_TIME)),
    **dict.fromkeys((b"GOTARG", b"ENDGO"), (_NO, "leaves the way to the control; write its points as GOTO")),
    **dict.fromkeys(
        (b"ASSIGN", b"OBTAIN", b"PROMPT"), (_X, "a motion that uses the value is refused")
    ),
    **dict.fromkeys(
        (b"ROTSET", b"ROTAB", b"CRSLCT", b"CRMODE", b"THLCHG"),
        (_NO, "moves an axis that is not read; write a program for each of its positions"),
    ),
}  # fmt: skip
