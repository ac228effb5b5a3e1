"""Reads plain URScript for tests, by numpy alone: where each move to a pose goes, in mm and the base.

It shares nothing with `olp.program`: a rotation is the exponential of its vector.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

_LINE = re.compile(r"^\s*(move[lpj]|set_tcp)\((.*)\)\s*$", re.M)
_NAMED = re.compile(r"^\s*(\w+)=(p\[[^\]]*\])\s*$", re.M)
_POSE = re.compile(r"p\[([^\]]*)\]")


@dataclass(frozen=True)
class UrMove:
    """A move: straight or not, the tip, its rotation, and gauge point to tip in the base, mm."""

    straight: bool
    tip: np.ndarray
    turn: np.ndarray
    lever: np.ndarray


def _pose(text: str) -> tuple[np.ndarray, np.ndarray]:
    numbers = np.array([float(number) for number in text.split(",")])
    return numbers[:3] * 1000.0, Rotation.from_rotvec(numbers[3:]).as_matrix()


def moves(text: bytes) -> list[UrMove]:
    """All moves to poses of a text, in its order."""
    plain = re.sub(r"#.*", "", text.decode("latin-1"))
    named = dict(_NAMED.findall(plain))
    tool = (np.zeros(3), np.eye(3))
    found = []
    for name, words in _LINE.findall(plain):
        for key, value in named.items():
            words = re.sub(rf"\b{key}\b", value, words)
        poses = [_pose(pose) for pose in _POSE.findall(words)]
        if not poses:
            continue
        point, turn = poses[-1]
        for origin, outer in reversed(poses[:-1]):
            point, turn = origin + outer @ point, outer @ turn
        if name == "set_tcp":
            tool = (point, turn)
            continue
        found.append(UrMove(name != "movej", point, turn, turn @ tool[1].T @ tool[0]))
    return found
