"""Reads plain TP programs (LS) for tests, by numpy alone: where each move goes, in its user frame.

It shares nothing with `olp.program`: matrices come from angles by their own formula.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

_MOVE = re.compile(r"^\s*\d*:([LJ]) P\[(\d+)[^\]]*\] \S+ (?:\S+)\s*(?:Offset,PR\[(\d+)\])?", re.M)
_ELEMENT = re.compile(r"PR\[(\d+),(\d+)\]=(\S+)")
_POSITION = re.compile(r"P\[(\d+)[^\]]*\]\{(.*?)\};", re.S)
_AXIS = re.compile(r"\b([XYZWPR]) *= *(\S+)")


@dataclass(frozen=True)
class TpMove:
    """A move: straight or not, the tip in its user frame, its rotation, the numbers of frame and tool."""

    straight: bool
    tip: np.ndarray
    turn: np.ndarray
    frame: int
    tool: int


def matrix(w: float, p: float, r: float) -> np.ndarray:
    """Turned about the fixed axes X, then Y, then Z, by degrees."""
    turn = np.eye(3)
    for axis, angle in enumerate(np.radians([w, p, r])):
        a, b = [(1, 2), (2, 0), (0, 1)][axis]
        step = np.eye(3)
        step[a, a] = step[b, b] = np.cos(angle)
        step[b, a], step[a, b] = np.sin(angle), -np.sin(angle)
        turn = step @ turn
    return turn


def moves(text: bytes) -> list[TpMove]:
    """All L and J to positions of a text, in its order; registers hold what was stated last."""
    plain = text.decode("latin-1")
    stated = {}
    for number, body in _POSITION.findall(plain):
        frame, tool = re.search(r"UF *: *(\d+), UT *: *(\d+)", body).groups()
        axes = {name: float(value.rstrip(",")) for name, value in _AXIS.findall(body.split("CONFIG")[1][20:])}
        stated[int(number)] = axes, int(frame), int(tool)
    registers: dict[int, dict[int, float]] = {}
    found = []
    for line in plain.split("/POS")[0].splitlines():
        element = _ELEMENT.search(line)
        if element:
            registers.setdefault(int(element[1]), {})[int(element[2])] = float(element[3])
        move = _MOVE.match(line)
        if move is None:
            continue
        axes, frame, tool = stated[int(move[2])]
        tip = np.array([axes[name] for name in "XYZ"])
        if move[3]:
            tip = tip + np.array([registers[int(move[3])][k] for k in (1, 2, 3)])
        found.append(TpMove(move[1] == "L", tip, matrix(axes["W"], axes["P"], axes["R"]), frame, tool))
    return found
