"""The statements of Sinumerik programs: what becomes of each. One table for the reader and for the docs.

Sources: Siemens, Programming Manuals Fundamentals and Job Planning; measured programs of public posts.
"""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

Table = Mapping[str, tuple[Support, str]]

_NO_PATH = "has no effect on the path"
_REFIT = "the control fits the path again within its own tolerance"

#: Words and calls that move no axis and change nothing that later blocks mean.
_WITHOUT_PATH = (
    "MSG", "STOPRE", "SETMS", "FNORM", "FLIN", "FCUB", "FPO", "FFWON", "FFWOF", "SOFT", "SOFTA",
    "BRISK", "BRISKA", "DRIVE", "DRIVEA", "JERKLIM", "VELOLIM", "ACCLIMA", "VELOLIMA", "JERKLIMA",
    "FGROUP", "FGREF", "WORKPIECE", "EXTERN", "GROUP_BEGIN", "GROUP_END", "GROUP_ADDEND", "STARTFIFO",
    "STOPFIFO", "FIFOCTRL", "WAITS", "UPATH", "SPATH", "CFC", "CFTCP", "CFIN",
    "CUT2D", "CUT2DF", "CUT2DD", "CDON", "CDOF", "CDOF2", "DIAMOF",
    "TOFRAMEOF", "TOROTOF", "PAROTOF", "TCOFR", "DISPLON", "DISPLOF", "ACTBLOCNO",
    "ORIEULER", "ORIRPY", "ORIRPY2", "ORIVIRT1", "ORIVIRT2",
    "OSOF", "OSC", "OSS", "OSSE", "OSD", "OST", "PROC", "SETPIECE", "SPCON", "SPCOF", "ISD", "FENDNORM",
    "FENDOFF", "WALIMON", "WALIMOF", "SBLON", "SBLOF", "PTPG0", "CP", "DYNNORM", "DYNPOS", "DYNROUGH",
    "DYNSEMIFIN", "DYNFINISH", "DYNPREC", "CTOLOF", "RTLION", "RTLIOF", "OVRRAP", "OVR", "SPOS",
    "SPOSA", "LIMS", "ACC", "FA", "FL", "FZ", "FD", "SVC", "CTOL", "OTOL", "ATOL", "STOLF",
    "ACCLIM", "CPRECON", "CPRECOF", "CUTMOD", "NEWCONF", "TANGOF", "WAITM",
    "ORISON", "ORISOF",
)  # fmt: skip
#: Statements that stay as they are, and why.
HARMLESS: Mapping[str, str] = {
    **dict.fromkeys(_WITHOUT_PATH, _NO_PATH),
    **dict.fromkeys(("COMPON", "COMPCURV", "COMPCAD", "COMPSURF", "COMPOF"), _REFIT),
}

#: How contours under G41 and G42 are approached, go round corners and are left: what each is in, and whether
#: contours are read with it.
CONTOUR_WAYS: Mapping[str, tuple[str, bool]] = {
    "NORM": ("approach", True), "KONT": ("approach", False), "KONTC": ("approach", False),
    "KONTT": ("approach", False), "G450": ("corner", True), "G451": ("corner", False),
    "G460": ("end", True), "G461": ("end", False), "G462": ("end", False), "DISC": ("disc", False),
    "OFFN": ("allowance", False), "CUTCONON": ("pause", False), "CUTCONOF": ("pause", True),
}  # fmt: skip

#: Statements that change how later blocks are understood.
READ: Mapping[str, str] = {
    "TRAFOOF": "ends TRAORI",
    **dict.fromkeys(("ORIWKS", "ORIMKS", "ORIAXES", "ORIVECT"), "what turns evenly where the tool turns"),
    "TRANS": "a programmable offset, which replaces the programmable frame",
    "ATRANS": "a programmable offset, which adds to the programmable frame",
    **dict.fromkeys(("ROT", "AROT"), "turns the programmable frame about Z; about X and Y it is refused"),
    **dict.fromkeys(("SCALE", "ASCALE"), "scales the programmable frame"),
    **dict.fromkeys(("MIRROR", "AMIRROR"), "mirrors the programmable frame"),
    "RPL": "the angle of ROT and AROT in G17",
    "G500": "no settable offset; [work_offsets.G500] where the control has a base offset",
    "G505": "G505 to G599: settable offsets, which need [work_offsets.G505] and so on",
    "$P_UIFR[1]": "=CTRANS(X,...) and [1,X,TR]=: settable offsets that the program writes, from G54 on",
    "SUPA": "one block in machine coordinates",
    "G153": "one block in machine coordinates",
    "T": 'T="NAME" is the tool with that name in the machine or job file',
    "D": "D1 counts the length of the tool in the spindle, D0 none",
    "MCALL": "calls a cycle behind every block with motion",
    "CYCLE832": "states the path tolerance",
    "ADIS": "states the path tolerance of G641",
    "G58": "the absolute part of the programmable offset, axis by axis",
    "G59": "the additive part of the programmable offset, axis by axis",
    "G74": "to the reference point: the axes are not known behind it",
    "G75": "to a fixed point: the axes are not known behind it",
    "M17": "the end of the program, as RET",
    "SAVE": "--flatten writes the G codes of the call again behind the subprogram; frames in it are refused",
    "RET": "the end of the program",
    **dict.fromkeys(("G41", "G42"), "cutter compensation with the radius of the edge in force"),
    **dict.fromkeys(CONTOUR_WAYS, "how contours begin, end and go round corners: G41 and G42 are read with "
                    "NORM, G450, DISC=0 and G460"),
}  # fmt: skip

_UNROLLED = "goes through --flatten"
_FLOW = """
    R DEF IF ELSE ENDIF FOR ENDFOR WHILE ENDWHILE REPEAT UNTIL LOOP ENDLOOP REPEATB GOTO GOTOF GOTOB
    GOTOC GOTOS CASE CALL EXTCALL L P
"""
_SHAPES = "CIP CT I1 J1 K1 HOLES1 HOLES2 CYCLE801 AP RP G110 G111 G112 ANG CHF CHR RND RNDM AR"
#: Statements that need the unroller.
UNROLLED: Mapping[str, str] = dict.fromkeys((*_FLOW.split(), *_SHAPES.split()), _UNROLLED)
#: Those of them that are read where they state numbers.
_IN_PART = {
    "R": "numbers, and words that take one; an expression goes through --flatten",
    "DEF": "variables without values or with numbers; others go through --flatten",
}

_ROTARY = "needs the kinematics of rotary axes, which are not read; post the operation for three axes"
_THREAD = "cuts a thread, which a correction would distort; leave the thread to an uncorrected program"
_SPLINE = "is a curve of the control, which is not read; post the path in G1, G2 and G3"
_MEASURES = "ends where a probe meets the part; leave it to an uncorrected program"
_FRAME = "turns or scales the frame, which is not read; post the path without it"
_SYNCHRONOUS = "acts at any time, also on axes, which is not read; take it out"
_LATHE = "belongs to lathes"
_CYCLE = "makes its path inside the control; post the operation as plain moves"

#: Statements that are refused, and why.
REFUSED: Mapping[str, str] = {
    "TRAORI": "needs the rotary axes of the machine; describe them in the machine file",
    **dict.fromkeys(("CYCLE800", "TRACYL", "TRANSMIT", "TRAANG", "TRACON", "TRAFOON", "TCARR",
                     "TOROT", "TOROTX", "TOROTY", "TOROTZ", "TOFRAME", "TOFRAMEX", "TOFRAMEY", "TOFRAMEZ",
                     "PAROT", "A2", "B2", "C2", "A3", "B3", "C3", "A4", "B4", "C4", "LEAD", "TILT", "THETA",
                     "ORIPATH", "ORICONCW", "ORICONCCW", "PTP"), _ROTARY),
    **dict.fromkeys(("G33", "G34", "G35", "G331", "G332", "G63", "CYCLE97", "CYCLE99"), _THREAD),
    **dict.fromkeys(("ASPLINE", "BSPLINE", "CSPLINE", "POLY", "PO", "PW", "INVCW", "INVCCW", "SPN"), _SPLINE),
    **dict.fromkeys(("MEAS", "MEAW", "MEASA", "MEAWA", "CYCLE971", "CYCLE976", "CYCLE977", "CYCLE978",
                     "CYCLE979", "CYCLE998"), _MEASURES),
    **dict.fromkeys(("ROTS", "AROTS", "CROTS", "$P_PFRAME", "$P_IFRAME"), _FRAME),
    "$P_UIFR": "is read as shifts of X, Y and Z alone; give [work_offsets] in the job file",
    **dict.fromkeys(("WHEN", "WHENEVER", "FROM", "EVERY", "DO", "ID", "IDS"), _SYNCHRONOUS),
    **dict.fromkeys(("FRC", "FRCM"), "is a feed of corners that the control makes; post them as blocks"),
    **dict.fromkeys(("DIAMON", "DIAM90", "DIAMCYCOF", "CYCLE93", "CYCLE95"), _LATHE),
    **dict.fromkeys(("G147", "G148", "G247", "G248", "G347", "G348"), "approaches on a curve of the control; "
                    "post the approach as G1, G2 and G3"),
    **dict.fromkeys(("POCKET1", "POCKET2", "POCKET3", "POCKET4", "SLOT1", "SLOT2", "LONGHOLE", "CYCLE60",
                     "CYCLE61", "CYCLE62", "CYCLE63", "CYCLE64", "CYCLE70", "CYCLE71", "CYCLE72", "CYCLE73",
                     "CYCLE74", "CYCLE75", "CYCLE76", "CYCLE77", "CYCLE79", "CYCLE802",
                     "CYCLE899", "CYCLE90"), _CYCLE),
    "G291": "switches to ISO mode, another language; name the dialect of that mode with --dialect",
    "POS": "moves a positioning axis on its own; program it as a G0 block",
    "POSA": "moves a positioning axis on its own; program it as a G0 block",
    "FB": "is a feed of one block, which a block in front of it would take away; give F there, and the feed "
          "before it in the next block",
    "OEMIPO1": "is a motion of the machine builder",
    "TOFFL": "changes the length of the tool, which is not read; put it into the tool table",
    "TOFFR": "changes the radius of the tool, which is not read; put it into the tool table",
    "TOFF": "changes the length of the tool, which is not read; put it into the tool table",
}  # fmt: skip

#: Cycles whose strokes are known.
DRILLING = frozenset({"CYCLE81", "CYCLE82", "CYCLE83", "CYCLE84", "CYCLE840", "CYCLE85", "CYCLE86", "CYCLE87",
                      "CYCLE88", "CYCLE89"})  # fmt: skip

#: Patterns of places for the cycle of an MCALL.
PATTERNS = frozenset({"HOLES1", "HOLES2", "CYCLE801"})

#: G codes that have no effect on the path.
HARMLESS_G = frozenset({601, 602, 603, 140, 141, 142, 143, 290, 340, 341, 621})
#: Path modes with rounding; G60 stops at the end of each block.
ROUNDING_G = frozenset({64, 641, 642, 643, 644, 645})


def statements() -> Table:
    """All statements that are more than words, by name."""
    table = {name: (Support.UNCHANGED, why) for name, why in HARMLESS.items()}
    table |= {name: (Support.READ, why) for name, why in READ.items()}
    table |= dict.fromkeys(DRILLING, (Support.READ, "a cycle behind the motion of a block, left as it is"))
    table |= {name: (Support.REFUSED, why) for name, why in UNROLLED.items()}
    table |= {name: (Support.REFUSED, why) for name, why in REFUSED.items()}
    table |= {name: (Support.READ, why) for name, why in _IN_PART.items()}
    return dict(sorted(table.items()))
