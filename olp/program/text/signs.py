"""Signs of a dialect in a text that several dialects share."""

import re

#: Statements of points that APT and DMIS share.
POINTS_BY_SLASH = re.compile(rb"(?im)^[ \t]*(GOTO|RAPID|FROM)[ \t]*/")

#: What begins lines of Sinumerik programs, and of those of no other dialect that is read.
SINUMERIK = (
    rb"(?:N\d+[ \t]*)?(?:;?%_N_|;\$PATH=|TRAORI\b|TRAFOOF\b|CYCLE\d+[ \t]*\(|MCALL\b|"
    rb"POCKET\d[ \t]*\(|HOLES\d[ \t]*\(|MSG[ \t]*\(|T[ \t]*=[ \t]*\"|"
    rb"(?:A?TRANS|A?ROT|A?MIRROR|A?SCALE)\b|"
    rb"R\d+[ \t]*=|(?:EXTERN|SUPA|FFWON|SOFT|COMPCAD|COMPON|STOPRE|G64[1-5])\b|WORKPIECE[ \t]*\(|"
    rb"[^;(\r\n]*\b(?:[XYZIJKFS]1?|CR|TURN)=[ \t]*[-+R\d(AI])"
)
