"""What texts of several dialects say, by which a dialect is detected."""

import re

#: Statements of points that APT and DMIS share.
POINTS_BY_SLASH = re.compile(rb"(?im)^[ \t]*(GOTO|RAPID|FROM)[ \t]*/")
