"""Reads plain RAPID for tests, by numpy alone: where each move goes, and with which tool.

It shares nothing with `olp.program`: targets are found by name, matrices come from quaternions by their own
formula. It knows declared targets, inline ones, Offs and RelTool, tools and work objects.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

_MOVE = re.compile(r"^\s*Move([LJ])\s+(.*);", re.M)
_DECLARED = re.compile(r"^\s*(?:LOCAL\s+)?(?:CONST|PERS|VAR)\s+(\w+)\s+(\w+)\s*:=\s*(.*);", re.M)


@dataclass(frozen=True)
class RobotMove:
    """A move: straight or not, the tip in the world, its rotation, and gauge point to tip in the world."""

    straight: bool
    tip: np.ndarray
    turn: np.ndarray
    lever: np.ndarray


def matrix(quaternion: list[float]) -> np.ndarray:
    """Rotation matrix of a quaternion, w first."""
    w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _about(axis: int, degrees: float) -> np.ndarray:
    half = np.radians(degrees) / 2
    quaternion = [np.cos(half), 0.0, 0.0, 0.0]
    quaternion[axis + 1] = np.sin(half)
    return matrix(quaternion)


def _list(text: str) -> list:
    words = re.sub(r"\bTRUE\b", "True", re.sub(r"\bFALSE\b", "False", text, flags=re.I), flags=re.I)
    return eval(words, {"__builtins__": {}})


def _split(text: str) -> list[str]:
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "[(") - (letter in "])")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def moves(text: bytes) -> list[RobotMove]:
    """All MoveL and MoveJ of a text, in its order."""
    plain = re.sub(r"!.*", "", text.decode("latin-1"))
    data = {name.lower(): _list(value) for _, name, value in _DECLARED.findall(plain) if value[:1] == "["}
    data["tool0"] = [True, [[0, 0, 0], [1, 0, 0, 0]]]
    data["wobj0"] = [False, True, "", [[0, 0, 0], [1, 0, 0, 0]], [[0, 0, 0], [1, 0, 0, 0]]]

    def pose(target: str) -> tuple[np.ndarray, np.ndarray]:
        call = re.fullmatch(r"(?i)(Offs|RelTool)\s*\((.*)\)", target)
        if call is None:
            value = _list(target) if target.startswith("[") else data[target.lower()]
            return np.array(value[0], float), matrix(value[1])
        inner, x, y, z, *_ = _split(call[2])
        z, *turns = z.split("\\")
        point, turn = pose(inner)
        shift = np.array([float(x), float(y), float(z)])
        if call[1].lower() == "offs":
            return point + shift, turn
        point = point + turn @ shift
        for name, value in sorted(part.split(":=") for part in turns):
            turn = turn @ _about("xyz".index(name.strip().lower()[-1]), float(value))
        return point, turn

    found = []
    for kind, words in _MOVE.findall(plain):
        target, _speed, _zone, tool, *_ = _split(words)
        name, _, frame = tool.partition("\\WObj:=")
        point, turn = pose(target)
        for origin, quaternion in reversed(data[(frame or "wobj0").lower()][3:5]):
            point = matrix(quaternion) @ point + np.array(origin, float)
            turn = matrix(quaternion) @ turn
        origin, quaternion = data[name.strip().lower()][1]
        lever = turn @ matrix(quaternion).T @ np.array(origin, float)
        found.append(RobotMove(kind == "L", point, turn, lever))
    return found
