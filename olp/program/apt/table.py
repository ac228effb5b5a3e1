"""The statements of APT and CLDATA: what becomes of each. One table for the reader and for `olp inspect`.

Forms after ISO 4343 and ISO 3592, and the habits of Creo, NX, CATIA, SolidWorks CAM and Autodesk.
"""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

_CONTOUR = "drives the tool along geometry that only an APT processor resolves; send its output (CLDATA)"
_LOGIC = "branches or repeats; send the output of the APT processor (CLDATA)"
_TURNS = (
    "turns the part or the head, and the position of the part afterwards is not known; "
    "send a program for each position of the part"
)
_GEOMETRY = "defines geometry; send the output of the APT processor (CLDATA), which has points"
_CYCLE = "is a path that the control makes itself; have the CAM system write its points"

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"GOTO": (_C, "points with or without a tool axis"),
    b"GODLTA": (_C, "distances, which do not drift; one number is along the tool axis"),
    b"CIRCLE": (_C, "arc to the next GOTO: centre, normal, radius (Creo, NX, SolidWorks CAM)"),
    b"MOVARC": (_C, "arc to the next GOTO: centre, normal, radius, ANGLE (Autodesk)"),
    b"TLON": (_C, "arc of CATIA: INDIRV, TLON,GOFWD/(CIRCLE…),ON,(LINE…)"),
    b"INDIRV": (_R, "the direction in which the next TLON begins"),
    b"AUTOPS": (_R, "CATIA writes it before INDIRV and TLON: the arc is at the level of the tool"),
    b"FROM": (_R, "where the tool is; left uncorrected"),
    b"GOHOME": (_R, "goes to its own point or to that of FROM; left uncorrected"),
    b"RAPID": (_R, "for the next GOTO only"),
    b"FEDRAT": (_R, "MMPM, IPM, MMPR, IPR, in either order"),
    b"UNITS": (_R, "MM or INCH"),
    b"UNIT": (_R, "MM or INCH"),
    b"LOADTL": (_R, "the tool and its length, from the tables of machine and job"),
    b"LOAD": (_R, "LOAD/TOOL: as LOADTL"),
    b"TOOLNO": (_R, "as LOADTL"),
    b"TURRET": (_R, "as LOADTL"),
    b"CYCLE": (_R, "the GOTOs under it are positions of holes: corrected where the tool meets the part"),
    b"CUTCOM": (_R, "points keep their side, and are corrected where they are stated"),
    b"MULTAX": (_R, "points carry a tool axis, which is corrected where the machine has rotary axes"),
    b"TLAXIS": (_R, "the tool axis from here on"),
    b"CSYS": (_R, "a coordinate system: a frame of the job"),
    b"MSYS": (_R, "a coordinate system: a frame of the job"),
    b"ORIGIN": (_R, "a coordinate system: a frame of the job"),
    b"$$-> CSYS": (_R, "Creo's coordinate system, in a comment: a frame of the job"),
    b"TRACUT": (_R, "a rotation and shift in numbers, for the points after it; NOMORE ends it"),
    b"TRANS": (_R, "a shift of the points after it, in numbers"),
    b"COPY": (_R, "repeats the moves since INDEX: where --flatten writes them out, else refused"),
    b"SPINDL": (_R, "the spindle, for feeds per turn"),
    b"DELAY": (_R, "a dwell in seconds"),
    b"STOP": (_R, "the motion rests"),
    b"OPSTOP": (_R, "the motion rests"),
    b"RETRCT": (_R, "a move of the control: positions are unknown until the next GOTO"),
    b"GOCLER": (_R, "a move of the control: positions are unknown until the next GOTO"),
    b"UNLOAD": (_R, "a move of the control: positions are unknown until the next GOTO"),
    b"AUXFUN": (_R, "an M code; one that calls programs or moves a pallet is refused"),
    b"PREFUN": (_R, "a G code; one that may change what later points mean is refused"),
    b"SET": (_R, "SET/MODE alone, which is of the post-processor's output; other forms are refused"),
    b"OPSKIP": (_R, "block delete; points under it are refused"),
    **dict.fromkeys((b"ROTABL", b"ROTATE", b"ROTHED"), (_R, "an angle of 0 only; others are refused")),
    b"FINI": (_R, "the end"),
    b"INSERT": (_X, "text for the control; refused where it reads as a block that moves"),
    **dict.fromkeys(
        (
            b"PARTNO", b"PPRINT", b"REMARK", b"REM", b"TITLE", b"TPRINT", b"DISPLY", b"PRINT", b"PAINT",
            b"TOOL PATH", b"END-OF-PATH", b"END", b"MACHIN", b"INTOL", b"OUTTOL", b"TOLER", b"CUTTER",
            b"TOOL", b"SELECT", b"SELCTL", b"COOLNT", b"CLEARP", b"CLRSRF", b"SEQNO",
            b"SETUP", b"TRNTYP", b"ARCSLP", b"LEADER", b"NOPOST", b"CLPRNT",
            b"PITCH", b"MCHTOL", b"DPMULTAX", b"INDEX", b"TLDATA",
            b"CSI_SET_FLUTE_LENGTH", b"CSI_SET_EXTENSION_LENGTH", b"TOOL_OFFSET",
            b"CLAMP", b"CHKPTS", b"MAXIPM", b"LINTOL", b"CATPROCESS", b"BOX", b"STOCK", b"MODE", b"DRESS",
            b"REWIND", b"PLABEL", b"TMARK", b"LPRINT", b"CHECK", b"SLOWDN", b"AIR", b"LETTER",
            b"OVPLOT", b"PENDWN", b"PENUP", b"PPLOT", b"DRAFT", b"TLSPEC", b"OPNAME", b"OPTYPE",
            b"APPLY", b"TLNAME", b"MFGNO",
        ),
        (_X, ""),
    ),
    **dict.fromkeys(
        (b"GOLFT", b"GORGT", b"GOFWD", b"GOBACK", b"GOUP", b"GODOWN", b"GO", b"TLLFT", b"TLRGT", b"TLNDON",
         b"TLOFPS", b"TLONPS", b"INDIRP", b"CONTUR", b"PROFIL", b"POCKET", b"SCURV", b"NOPS"),
        (_NO, _CONTOUR),
    ),
    **dict.fromkeys(
        (b"POINT", b"LINE", b"PLANE", b"VECTOR", b"MATRIX", b"CYLNDR", b"SPHERE", b"PATERN", b"TABCYL",
         b"ELLIPS", b"REFSYS", b"ZSURF", b"OBTAIN"),
        (_NO, _GEOMETRY),
    ),
    **dict.fromkeys(
        (b"MACRO", b"TERMAC", b"CALL", b"LOOPST", b"LOOPND", b"JUMPTO", b"IF", b"TRANTO", b"CALSUB", b"BREAK",
         b"RESERV", b"READ", b"REPEAT", b"DO"),
        (_NO, _LOGIC),
    ),
    **dict.fromkeys((b"TILT", b"PALLET", b"HEAD"), (_NO, _TURNS)),
    **dict.fromkeys((b"THREAD", b"NURBS", b"SPLINE", b"BSPLIN", b"POLYLN", b"PIERCE"), (_NO, _CYCLE)),
    b"SWITCH": (_NO, "states the output point of a turning tool, and lathes are not corrected; send the "
               "program of a mill"),
    b"PPFUN": (_NO, "calls a function of the post-processor, and some change what later points mean; take it "
              "out where its manual says that it changes no position"),
    b"SYN": (_NO, "gives words another meaning in the post-processor; write the statements without it"),
    b"MIRROR": (_NO, "mirrors coordinates in the post-processor; have the CAM system write the moved points"),
}  # fmt: skip

#: statements that take the rest of their line as text
FREE = (b"PARTNO", b"PPRINT", b"INSERT", b"REMARK", b"REM", b"TITLE", b"TPRINT", b"DISPLY", b"CATPROCESS")
