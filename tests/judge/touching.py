"""A probe that touches spheres, holes and faces on a machine with errors: independent of the project.

A program of touches is read from its text alone: moves `G38.2`, and the label that the comment behind logs.
The place of a touch is where the tip, whose effective radius is known, first meets a surface on its way.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Distance = Callable[[np.ndarray], float]
Error = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Surface:
    """A surface as the distance of a place of the tip from it, for an effective radius."""

    name: str
    distance: Distance


def sphere(name: str, centre: np.ndarray, diameter: float, radius: float) -> Surface:
    return Surface(name, lambda p: float(np.linalg.norm(p - centre)) - 0.5 * diameter - radius)


def hole(name: str, middle: np.ndarray, diameter: float, up: np.ndarray, radius: float) -> Surface:
    """The wall below the face through `middle`, and that face above it."""

    def distance(p: np.ndarray) -> float:
        height = float((p - middle) @ up)
        aside = float(np.linalg.norm(p - middle - height * up))
        if aside < 0.5 * diameter:
            return 0.5 * diameter - radius - aside if height < 0.0 else 1.0
        return height - radius

    return Surface(name, distance)


def face(name: str, place: np.ndarray, out: np.ndarray, radius: float) -> Surface:
    return Surface(name, lambda p: float((p - place) @ out) - radius)


def moves(text: str) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Label, begin and end of each touch of a program, in axis positions."""
    place, found = np.zeros(3), []
    for line in text.splitlines():
        words = dict(re.findall(r"([XYZ])(-?[\d.]+)", line.split("(")[0]))
        target = np.array([float(words.get(a, place[k])) for k, a in enumerate("XYZ")])
        if line.startswith("G38.2"):
            found.append(["", place, target])
            continue
        label = re.match(r"\(LOG,([^,]+),#5061", line)
        if label:
            found[-1][0] = label[1]
        elif line.startswith("G0"):
            place = target
    return [(name, begin, end) for name, begin, end in found]


def touch(
    text: str, surfaces: Sequence[Surface], tool: Sequence[float], error: Error, sigma: float = 0.0,
    seed: int = 0,
) -> list[tuple[str, np.ndarray]]:  # fmt: skip
    """Label and axis position of every touch, with noise along its way."""
    rng = np.random.default_rng(seed)
    by_name = {surface.name: surface for surface in surfaces}
    planned = moves(text)
    begins = np.array([begin for _, begin, _ in planned])
    ends = np.array([end for _, _, end in planned])
    ways = (ends - begins) / np.linalg.norm(ends - begins, axis=1)[:, None]
    # over some mm the error of the machine is a straight line
    first, last = error(begins, ways), error(ends, ways)
    touched = []
    for k, (label, begin, end) in enumerate(planned):
        distance = by_name[label.split("_")[1]].distance
        way, long = ways[k], float(np.linalg.norm(end - begin))

        def off(s: float, k: int = k, way: np.ndarray = way, at: Distance = distance) -> float:
            share = s / float(np.linalg.norm(ends[k] - begins[k]))
            place = begins[k] + s * way + np.array(tool)
            return at(place + (1.0 - share) * first[k] + share * last[k])

        low, high = 0.0, long
        above, below = off(low), off(high)
        assert above > 0.0 > below, label
        # false position, with halves where one end stays (Illinois)
        for _ in range(60):
            middle = (low * below - high * above) / (below - above)
            value = off(middle)
            if abs(value) < 1e-9:
                break
            if value > 0.0:
                low, above, below = middle, value, 0.5 * below
            else:
                high, below, above = middle, value, 0.5 * above
        low = middle
        touched.append((label, begin + (low + rng.normal(0.0, sigma)) * way))
    return touched


def log(touched: Sequence[tuple[str, np.ndarray]]) -> str:
    """The file that LinuxCNC writes by the comments of the program."""
    rows = [f"{label},{x:.6f},{y:.6f},{z:.6f}" for label, (x, y, z) in touched]
    return "\n".join(["touch,X_mm,Y_mm,Z_mm", *rows]) + "\n"
