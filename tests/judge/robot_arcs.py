"""Reads plain programs of robots with arcs for tests, and runs along them, by numpy alone.

It shares nothing with `olp.program`: one regular expression for a move of each language, and the centre of an
arc from the equations of its three points. Angles come from the lengths of chords.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from judge import inform
from judge.arm import between
from judge.robot_moves import abc, rotvec, wpr
from judge.val3 import matrix

#: A rotation and a place.
Pose = tuple[np.ndarray, np.ndarray]
_NUMBER = re.compile(r"-?\d*\.?\d+(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class Step:
    """A move to the last of its poses in the frame of the program: "P" by joints, "L" straight, "C" an arc
    through the first one."""

    kind: str
    poses: tuple[Pose, ...]


def rapid(text: bytes) -> list[Step]:
    """Moves of RAPID to targets with names or numbers."""
    plain = re.sub(r"!.*", "", text.decode("latin-1"))
    named = dict(re.findall(r"robtarget (\w+):=(\[.*\]);", plain))

    def pose(target: str) -> Pose:
        numbers = [float(number) for number in _NUMBER.findall(named.get(target, target))]
        w, *axis = numbers[3:7]
        half = np.arctan2(np.linalg.norm(axis), w)
        return rotvec(2 * half * np.array(axis) / np.linalg.norm(axis)), np.array(numbers[:3])

    found = []
    for kind, targets in re.findall(r"Move(L|J|C)\s+((?:(?:\w+|\[\[.*?\]\])\s*,\s*)+?)v\d", plain):
        own = re.findall(r"\[\[.*?\]\]|\w+", targets)
        found.append(Step({"J": "P"}.get(kind, kind), tuple(pose(target) for target in own)))
    return found


def krl(text: bytes) -> list[Step]:
    """Moves of KRL to positions with names or numbers."""
    plain = re.sub(r";.*", "", text.decode("latin-1"))
    named = dict(re.findall(r"(?m)^(?:DECL )?E6POS (\w+)=(\{.*\})", plain))

    def pose(target: str) -> Pose:
        words = dict(re.findall(r"\b([A-Z]\d?) ([-+.\d]+)", named.get(target, target)))
        values = {name: float(value) for name, value in words.items()}
        return abc(*(values[name] for name in "ABC")), np.array([values[name] for name in "XYZ"])

    found = []
    for kind, targets in re.findall(r"(?m)^\s*(LIN|PTP|CIRC) (.*?)(?: C_\w+)?\s*$", plain):
        own = re.findall(r"\{[^}]*\}|\w+", targets)
        kinds = {"LIN": "L", "PTP": "P", "CIRC": "C"}
        found.append(Step(kinds[kind], tuple(pose(target) for target in own)))
    return found


def tp(text: bytes) -> list[Step]:
    """Moves of TP programs to positions that the text states."""
    plain = text.decode("latin-1")
    stated = dict(re.findall(r"P\[(\d+)\]\{(.*?)\};", plain, re.S))

    def pose(number: str) -> Pose:
        words = dict(re.findall(r"\b([A-Z])\s*=\s*([-+.\d]+)", stated[number].partition("CONFIG")[2]))
        values = {name: float(value) for name, value in words.items()}
        return wpr(*(values[name] for name in "WPR")), np.array([values[name] for name in "XYZ"])

    moves = re.findall(r"(?m)^ *\d*:([LJC]) P\[(\d+)\]\s*(?::\s*)?(?:P\[(\d+)\])?", plain)
    return [
        Step({"J": "P"}.get(kind, kind), tuple(pose(number) for number in numbers if number))
        for kind, *numbers in moves
    ]


def ur(text: bytes) -> list[Step]:
    """Moves of URScript to poses with names or numbers, in m and rad."""
    plain = re.sub(r"#.*", "", text.decode("latin-1"))
    named = dict(re.findall(r"(?m)^\s*(\w+)=(p\[.*\])", plain))
    found = []
    for kind, words in re.findall(r"move([ljc])\((.*)\)", plain):
        poses = []
        for target in re.findall(r"pose_trans\(frame, ?(p\[[^\]]*\]|\w+)\)", words):
            numbers = np.array([float(number) for number in _NUMBER.findall(named.get(target, target))])
            poses.append((rotvec(numbers[3:]), 1000.0 * numbers[:3]))
        found.append(Step({"j": "P"}.get(kind, kind.upper()), tuple(poses)))
    return found


def val3(text: bytes) -> list[Step]:
    """Moves of VAL 3 to elements of arrays, in the frame that these have."""
    plain = re.sub(r"//.*", "", text.decode("latin-1"))
    stated: dict[str, dict[str, str]] = {}
    for name, body in re.findall(r'(?s)<Data name="(\w+)"[^>]*>(.*?)</Data>', plain):
        for own in re.findall(r"<Value ([^>]*)/>", body):
            words = dict(re.findall(r'(\w+)="([^"]*)"', own))
            stated[f"{name}[{words['key']}]"] = words

    def pose(name: str) -> Pose:
        words = stated[name if "[" in name else f"{name}[0]"]
        found = matrix([float(words.get(key, "0")) for key in ("x", "y", "z", "rx", "ry", "rz")])
        return found[:3, :3], found[:3, 3]

    found = []
    for kind, targets in re.findall(r"(?m)^\s*move([ljc])\((.*)\)", plain):
        own = [name.strip() for name in targets.split(",")[:-2]]
        found.append(Step({"j": "P"}.get(kind, kind.upper()), tuple(pose(name) for name in own)))
    return found


def jbi(text: bytes) -> list[Step]:
    """Moves of INFORM in poses. Of three moves MOVC the second and the third are an arc, and the first one
    leads straight to it. Moves to where the robot is are left out."""
    lines, found, points = text.split(b"\n"), [], []
    here = np.zeros(6)
    for move in inform.moves(text):
        pose = move.turn, move.numbers[:3]
        points = [*points, pose] if lines[move.line - 1].startswith(b"MOVC") else []
        assert len(points) <= 3, "a run of more than three"
        if len(points) == 3:
            found.append(Step("C", tuple(points[1:])))
        elif len(points) < 2 and not np.array_equal(here, move.numbers):
            found.append(Step("L" if move.straight else "P", (pose,)))
        here = move.numbers
    return found


READERS: dict[str, Callable[[bytes], list[Step]]] = {
    "krl": krl,
    "tp": tp,
    "rapid": rapid,
    "ur": ur,
    "jbi": jbi,
    "val3": val3,
}


def along(start: Pose, step: Step, shares: np.ndarray) -> list[Pose]:
    """The poses at shares of a move: of its length, or of the angle of an arc."""
    turn, end = step.poses[-1]
    if step.kind != "C":
        return [(between(start[0], turn, s), start[1] + s * (end - start[1])) for s in shares]
    via = step.poses[0][1]
    a, b = via - start[1], end - start[1]
    # as far from all three points, and in their plane
    rows = np.array([a, b, np.cross(a, b)])
    centre = start[1] + np.linalg.solve(rows, np.array([a @ a / 2, b @ b / 2, 0.0]))
    radius = np.linalg.norm(start[1] - centre)
    angles = [2 * np.arcsin(min(1.0, np.linalg.norm(way) / (2 * radius))) for way in (a, end - via)]
    # which of two arcs a chord has: the shorter one, unless the third point lies on that
    axis = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    for k, (one, other) in enumerate(((start[1], via), (via, end))):
        if np.cross(one - centre, other - centre) @ axis < 0:
            angles[k] = 2 * np.pi - angles[k]
    first = (start[1] - centre) / radius
    second = np.cross(axis, first)
    found = []
    for s in shares:
        angle = s * sum(angles)
        place = centre + radius * (np.cos(angle) * first + np.sin(angle) * second)
        found.append((between(start[0], turn, s), place))
    return found
