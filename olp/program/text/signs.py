"""Signs of a dialect in a text that several dialects share."""

import re

#: Statements of points that APT and DMIS share.
POINTS_BY_SLASH = re.compile(rb"(?im)^[ \t]*(GOTO|RAPID|FROM)[ \t]*/")
