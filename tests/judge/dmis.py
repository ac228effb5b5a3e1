"""A reader of DMIS points that shares nothing with olp: GOTO and PTMEAS in all their forms, in part numbers.

Written from the statement forms alone, for judging. Of the state it follows units, angles and working plane.
"""

from __future__ import annotations

import math
import re

import numpy as np

#: first, second and third axis of each working plane
PLANES = {"XYPLAN": (0, 1, 2), "YZPLAN": (1, 2, 0), "ZXPLAN": (2, 0, 1)}


def degrees(text: str) -> float:
    """Of `12.5` and of `12:30:00`."""
    parts = [abs(float(p)) for p in text.split(":")]
    size = sum(p / 60.0**k for k, p in enumerate(parts))
    return -size if text.strip().startswith("-") else size


def read_points(data: bytes) -> np.ndarray:
    """(n, 3) mm in the datum, of every GOTO and PTMEAS in the order of the text."""
    text = re.sub(r"(?m)\$\$.*$", "", data.decode("latin-1").replace("\r", ""))
    text = re.sub(r"\$[ \t]*\n", "", text)
    unit, radians, plane = 1.0, False, PLANES["XYPLAN"]
    points: list[np.ndarray] = []
    for statement in text.split("\n"):
        major, _, rest = statement.strip().upper().partition("/")
        minor = [word.strip() for word in rest.split(",")]
        if major.strip() == "UNITS":
            unit = 25.4 if minor[0] == "INCH" else 1.0
            radians = "ANGRAD" in minor
        elif major.strip() == "WKPLAN" and minor[0] in PLANES:
            plane = PLANES[minor[0]]
        elif major.strip() in ("GOTO", "PTMEAS"):
            if minor[0] == "POL":
                angle = float(minor[2]) if radians else math.radians(degrees(minor[2]))
                point = np.zeros(3)
                radius = float(minor[1])
                point[list(plane)] = (radius * math.cos(angle), radius * math.sin(angle), float(minor[3]))
                points.append(unit * point)
            elif minor[0] == "INCR":
                way = np.array([float(v) for v in minor[2:5]])
                points.append(points[-1] + unit * float(minor[1]) * way / math.sqrt(way @ way))
            else:
                numbers = minor[1:4] if minor[0] == "CART" else minor[:3]
                points.append(unit * np.array([float(v) for v in numbers]))
    return np.array(points)
