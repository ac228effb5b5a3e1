"""What shows the dialect of a program: endings of files, and what its texts say.

It stands apart from the dialects, so that a text is told from others without importing them all.
"""

from __future__ import annotations

import re

from olp.core.patterns import pattern
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True)
class Signs:
    """`endings` are endings of files, in small letters, that only this dialect has. `own` matches what only
    its texts say at the start of a line, `shared` what texts of other dialects say too. No line that shows a
    sign is a plain block (`is_plain`)."""

    endings: tuple[str, ...] = ()
    own: re.Pattern[bytes] | None = None
    shared: re.Pattern[bytes] | None = None


#: A comment in a block, which is no sign.
_ASIDE = pattern(rb"\([^)\r\n]*\)")
_G641 = pattern(rb"[Gg]64[1-5]")
#: Letters, what numbers are made of, blanks, and marks.
_KINDS = b"".join(
    b"0" if c in b"+-.0123456789" else b" " if c.isspace() else b"A" if c.isalpha() or c == b"_" else b"!"
    for c in map(bytes, zip(range(256)))
)

#: Statements of points that APT and DMIS share.
_POINTS_BY_SLASH = pattern(rb"(?im)^[ \t]*(GOTO|RAPID|FROM)[ \t]*/")

NO_SIGNS = Signs()
OKUMA = Signs(("min", "ssb", "sub"))
LISTS = Signs(("csv", "tsv"))
PRINTER = Signs(
    shared=pattern(
        rb"(?im)^;[ \t]*(?:FLAVOR:Marlin|generated (?:by|with) (?:\w+slicer|cura|simplify3d)\w*"
        rb"|generated with Cura_SteamEngine|HEADER_BLOCK_START|gcode_flavor[ \t]*=)"
    )
)
KLIPPER = Signs(
    own=pattern(rb"(?im)^;[ \t]*gcode_flavor[ \t]*=[ \t]*klipper[ \t]*\r?$|^;FLAVOR:Klipper[ \t]*\r?$"),
    shared=PRINTER.shared,
)
#: What begins lines of Sinumerik programs, and of those of no other dialect that is read.
SINUMERIK_LINE = (
    rb"(?:N\d+[ \t]*)?(?:;?%_N_|;\$PATH=|TRAORI\b|TRAFOOF\b|CYCLE\d+[ \t]*\(|MCALL\b|"
    rb"POCKET\d[ \t]*\(|HOLES\d[ \t]*\(|MSG[ \t]*\(|T[ \t]*=[ \t]*\"|"
    rb"(?:A?TRANS|A?ROT|A?MIRROR|A?SCALE)\b|"
    rb"R\d+[ \t]*=|(?:EXTERN|SUPA|FFWON|SOFT|COMPCAD|COMPON|STOPRE|G64[1-5])\b|WORKPIECE[ \t]*\(|"
    rb"[^;(\r\n]*(?<![\w.])(?:[XYZIJKFS]1?|CR|TURN)=[ \t]*[-+R\d(AI])"
)
SINUMERIK = Signs(("mpf", "spf"), own=pattern(rb"(?im)^[ \t]*(?:" + SINUMERIK_LINE + rb")"))
HEIDENHAIN = Signs(
    ("h", "hnc"),
    own=pattern(
        rb"(?im)^[ \t]*(?:\d+[ \t]+)?(?:(?:BEGIN|END)[ \t]+PGM\b|TOOL[ \t]+CALL\b|CYCLE?[ \t]+DEF\b|"
        rb"BLK[ \t]+FORM\b|CALL[ \t]+LBL\b|LBL[ \t]+[\d\"]|"
        rb"L[ \t]+[^\r\n;]*(?:\bR[0LR]\b|\bF[ \t]*MAX\b)|CC?[ \t]+[XYZ][^\r\n;]*[-+\d.])"
    ),
)
APT = Signs(
    ("apt", "aptsource", "ncl", "cls", "cl", "clt", "cldata", "clf"),
    own=pattern(
        rb"(?im)^[ \t]*(PARTNO|LOADTL|LOAD[ \t]*/|SPINDL|FINI[ \t]*\r?$|CUTTER|TOOL PATH|CUTCOM|MULTAX|"
        rb"TLAXIS|RAPID[ \t]*/?[ \t]*\r?$|FEDRAT[ \t]*/[ \t]*(?:[\d.]|[IM]P?M)|GODLTA|INDIRV|MOVARC|"
        rb"CIRCLE[ \t]*/|CYCLE[ \t]*/|UNITS?[ \t]*/[ \t]*(?:MM|INCH(?:ES)?)[ \t]*\r?$|"
        rb"GOTO[ \t]*/[-+.\dED \t]+(?:,[-+.\dED \t]+){5})"
    ),
    shared=_POINTS_BY_SLASH,
)
DMIS = Signs(
    ("dmi", "dms", "dmis"),
    own=pattern(
        rb"(?im)^[ \t]*(DMISMN|FILNAM|SNSLCT|SNSET|PTMEAS|MEAS[ \t]*/|ENDMES|ENDFIL|WKPLAN|TECOMP|"
        rb"UNITS[ \t]*/[ \t]*\w+[ \t]*,|GOTO[ \t]*/[ \t]*CART|"
        rb"MODE[ \t]*/[ \t]*(?:MAN|PROG|AUTO)|F\([^)]*\)[ \t]*=[ \t]*FEAT|"
        rb"FEDRAT[ \t]*/[ \t]*\w+VEL)"
    ),
    shared=_POINTS_BY_SLASH,
)
RAPID = Signs(
    ("mod", "modx", "prg", "sysx", "pgf"),
    own=pattern(
        rb"(?im)^[ \t]*(?:%%%\s*VERSION|MODULE[ \t]+\w+[ \t]*(?:\(|\r?$)|"
        # not the types of Sinumerik's own PROC
        rb"(?:LOCAL[ \t]+)?PROC[ \t]+\w+[ \t]*\("
        rb"(?![ \t]*(?:VAR[ \t]+)?(?:(?:REAL|INT|BOOL|AXIS|FRAME|CHAR)\b|STRING[ \t]*\[))|"
        rb"Move(?:L|J|C|AbsJ)[ \t]+(?:\[|\w+[ \t]*[,{\\(])|"
        rb"(?:(?:LOCAL|TASK)[ \t]+)?(?:CONST|PERS|VAR)[ \t]+\w+[ \t]+\w+)"
    ),
)
LS = Signs(
    ("ls",),
    own=pattern(rb"(?im)^[ \t]*(?:/(?:PROG|ATTR|MN|POS)\b|\d*:[ \t]*[JLCAS][ \t]+PR?\[)"),
)
URSCRIPT = Signs(
    ("script", "urscript"),
    own=pattern(
        rb"(?im)^[ \t]*(?:(?:def|thread)[ \t]+\w+[ \t]*\([^():\r\n]*\)[ \t]*:|"
        rb"(?:global|local)[ \t]+\w+[ \t]*=|(?:if|elif|while)\b[^\r\n]*:[ \t]*(?:#[^\r\n]*)?\r?$|"
        rb"(?:movej|movel|movep|movec|servoj|set_tcp)[ \t]*\([ \t]*(?:p?\[|pose_|get_))"
    ),
)
VAL3 = Signs(
    ("pgx", "pjx"),
    own=pattern(
        rb"(?im)^(?:\xef\xbb\xbf)?[ \t]*(?:<\?xml[^>\r\n]*>[ \t]*)?"
        rb"<(?:Programs?|programList|Project|Database|dataList)\b[^<>]*"
        rb"(?:/VAL3/(?:Program|Project|Data)/|\"(?:Program|Project|Data)NameSpace\")"
    ),
)
KRL = Signs(
    ("src",),
    own=pattern(
        rb"(?im)^[ \t]*(?:&(?:ACCESS|REL|PARAM|COMMENT)\b|"
        rb"(?:GLOBAL[ \t]+)?DEF(?:DAT|FCT[ \t]+\w+)?[ \t]+\w+[ \t]*(?:\([^\r\n]*\)[ \t]*(?:;[^\r\n]*)?)?\r?$|"
        rb"S?(?:PTP|LIN|CIRC)(?:_REL)?[ \t]+(?:\{|X[A-Z_]*\w*\b(?![ \t]*[-+.\d]))|"
        rb"\$(?:BASE|TOOL)[ \t]*=|BAS[ \t]*\([ \t]*#|(?:GLOBAL[ \t]+)?DECL[ \t]+(?:GLOBAL[ \t]+)?E6POS\b)"
    ),
)
INFORM = Signs(
    ("jbi",),
    own=pattern(
        rb"(?im)^[ \t]*(?:/JOB[ \t]*\r?$|//(?:NAME|POS|INST)\b|///(?:NPOS|POSTYPE|RECTAN|RCONF)\b|"
        rb"MOV[JLCS][ \t]+[CP]\d+)"
    ),
)


def is_plain(text: bytes) -> bool:
    """Whether a text is one of plain blocks: outside comments no letter without a number behind it, no mark,
    and no G641 to G645."""
    blocks = _ASIDE.sub(b"", text) if b"(" in text else text
    kinds = blocks.translate(_KINDS)
    bare = b"!" in kinds or b"AA" in kinds or b"A " in kinds or kinds.endswith(b"A")
    return not bare and (b"64" not in blocks or _G641.search(blocks) is None)
