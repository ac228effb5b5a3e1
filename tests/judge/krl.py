"""Reads plain KRL for tests, by numpy alone: where each move goes, and with which base and tool.

It shares nothing with `olp.program`: it holds the values of all names while it goes through the lines, as the
control does, and a component that a move leaves out keeps its last value.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

_MOVE = re.compile(r"(?i)^\s*S?(LIN|PTP|LIN_REL|PTP_REL)\b(?!\s*=)\s*(.*)$")
_VALUE = re.compile(r"(?i)^\s*(?:(?:GLOBAL|DECL|CONST)\s+)*(?:\w+\s+)?([$\w.]+(?:\[\d+\])?)\s*=\s*(.*)$")
_WORD = re.compile(r"([A-Za-z]\d?)\s*('?[-+.\w]+'?)")


@dataclass(frozen=True)
class KrlMove:
    """A move: straight or not, the tip in the world, its rotation, and gauge point to tip in the world."""

    straight: bool
    tip: np.ndarray
    turn: np.ndarray
    lever: np.ndarray


def _words(text: str) -> dict[str, str]:
    body = text.strip().strip("{}")
    return {name.upper(): value for name, value in _WORD.findall(body.rpartition(":")[2])}


def _frame(words: dict[str, str]) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(
        "ZYX", [float(words.get(k, 0)) for k in "ABC"], degrees=True
    ).as_matrix()
    matrix[:3, 3] = [float(words.get(k, 0)) for k in "XYZ"]
    return matrix


def moves(src: bytes, dat: bytes = b"") -> list[KrlMove]:
    """All moves to positions of a text, in its order."""
    values: dict[str, str] = {"$NULLFRAME": "{}"}
    base = tool = np.eye(4)
    here: dict[str, str] = {}
    found = []

    def frame(expression: str) -> np.ndarray:
        product = np.eye(4)
        for term in re.findall(r"\{[^}]*\}|[^:{}]+", expression):
            if term.strip():
                text = term if "{" in term else values[term.strip().upper()]
                product = product @ _frame(_words(text))
        return product

    for line in [*dat.decode("latin-1").splitlines(), *src.decode("latin-1").splitlines()]:
        plain = line.partition(";")[0]
        move, value = _MOVE.match(plain), _VALUE.match(plain)
        if move is not None:
            target = re.split(r"(?i)\s+(?:C_\w+|WITH)\b|#", move[2])[0].strip()
            name = target.upper()
            if "A1" in _words(values.get(name, target)):
                continue
            kind = move[1].upper()
            if kind.endswith("_REL"):
                shift = _words(target)
                at = _frame(here)
                step = np.array([float(shift.get(k, 0)) for k in "XYZ"])
                step = at[:3, :3] @ step if "#TOOL" in plain.upper() else step
                for k, v in zip("XYZ", at[:3, 3] + step, strict=True):
                    here[k] = repr(float(v))
                point = _frame(here)
            elif ":" in target.replace("FRAME:", "").replace("E6POS:", ""):
                point, here = frame(target), {}
            else:
                here = here | _words(values.get(name, target))
                point = _frame(here)
            pose = base @ point
            lever = pose[:3, :3] @ tool[:3, :3].T @ tool[:3, 3]
            found.append(KrlMove(kind.startswith("LIN"), pose[:3, 3], pose[:3, :3], lever))
        elif value is not None:
            name, text = value[1].upper(), value[2].strip()
            if name == "$BASE":
                base = frame(text)
            elif name == "$TOOL":
                tool = frame(text)
            else:
                values[name] = text
    return found
