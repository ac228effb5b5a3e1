"""What RL and RR promise, checked on samples: the tool is at its radius from the contour, on the right side.

It shares nothing with olp. A contour and the path of a tool are steps of `heidenhain_contours`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

from .heidenhain_contours import Step


def distance(step: Step, p: complex) -> float:
    """From a point to a step."""
    if not step.sweep:
        d = step.end - step.start
        share = ((p - step.start) * d.conjugate()).real / abs(d) ** 2 if d else 0.0
        return abs(p - step.start - min(max(share, 0.0), 1.0) * d)
    turn = cmath.phase((p - step.centre) / (step.start - step.centre)) * math.copysign(1, step.sweep)
    if turn % (2 * math.pi) <= abs(step.sweep):
        return abs(abs(p - step.centre) - abs(step.start - step.centre))
    return min(abs(p - step.start), abs(p - step.end))


def off_by(contour: Sequence[Step], tool: Sequence[Step], radius: float, samples: int = 12) -> float:
    """The largest difference between the radius and the distance of the tool from the contour."""
    points = [step.after(k / samples) for step in tool for k in range(samples + 1)]
    return max(abs(min(distance(c, p) for c in contour) - radius) for p in points)


def sides(contour: Sequence[Step], tool: Sequence[Step]) -> set[int]:
    """On which sides the tool is at the middle of its steps, across from the nearest step of the contour."""
    found = set()
    for step in tool:
        p = step.after(0.5)
        near = min(contour, key=lambda c: distance(c, p))
        share = min(range(201), key=lambda k: abs(near.after(k / 200) - p)) / 200
        if 0 < share < 1:
            found.add(1 if ((p - near.after(share)) / near.heading(share)).imag > 0 else -1)
    return found
