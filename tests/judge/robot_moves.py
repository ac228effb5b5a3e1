"""Reads plain programs of robots on arms for tests, by numpy alone: where each move goes, and with which
words of configuration.

It shares nothing with `olp.program`: one regular expression for a move of each language, and rotations as
products of turns about single axes (`judge.arm.about`), as the languages define their angles.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from judge import inform, val3
from judge.arm import about

X, Y, Z = np.eye(3)
_NUMBER = re.compile(r"-?\d*\.?\d+(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class Move:
    """A move: straight or not, and the joints in degrees, or the rotation and the place of the tip in the
    world. `words` are those of the configuration, and `outer` is the first external axis."""

    straight: bool
    joints: np.ndarray | None
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    tip: np.ndarray = field(default_factory=lambda: np.zeros(3))
    words: tuple[str, ...] = ()
    outer: float = 0.0


@dataclass(frozen=True)
class Frames:
    """Frame and tool, as rotations and places: those that the texts of a test state."""

    turn: np.ndarray
    origin: np.ndarray

    def placed(self, turn: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.turn @ turn, self.origin + self.turn @ place


def abc(a: float, b: float, c: float) -> np.ndarray:
    """Turned by A about Z, then by B about the new Y, then by C about the new X."""
    return about(Z, a) @ about(Y, b) @ about(X, c)


def wpr(w: float, p: float, r: float) -> np.ndarray:
    """Turned by W about the fixed X, then by P about the fixed Y, then by R about the fixed Z."""
    return about(Z, r) @ about(Y, p) @ about(X, w)


def rotvec(vector: np.ndarray) -> np.ndarray:
    """Turned about the direction of a vector by its length in rad."""
    size = np.linalg.norm(vector)
    return np.eye(3) if size == 0 else about(vector / size, np.degrees(size))


def _words(text: str) -> dict[str, str]:
    return dict(re.findall(r"\b([A-Z]\d?)\s*=?\s*('?[-+.\w]+'?)", text))


def krl(text: bytes, frames: Frames) -> list[Move]:
    """Moves of KRL to positions with names or numbers."""
    plain = re.sub(r";.*", "", text.decode("latin-1"))
    named = dict(re.findall(r"(?m)^(?:DECL )?(?:E6POS|E6AXIS) (\w+)=(\{.*\})", plain))
    found = []
    for kind, target in re.findall(r"(?m)^\s*(LIN|PTP) ([^{\s]+|\{[^}]*\})", plain):
        words = _words(named.get(target, target))
        outer = float(words.get("E1", "0"))
        if "A1" in words:
            values = np.array([float(words[f"A{k}"]) for k in range(1, 7)])
            found.append(Move(False, values, outer=outer))
            continue
        place = np.array([float(words[name]) for name in "XYZ"])
        turn, tip = frames.placed(abc(*(float(words[name]) for name in "ABC")), place)
        status = words.get("S", ""), words.get("T", "")
        found.append(Move(kind == "LIN", None, turn, tip, status, outer))
    return found


def tp(text: bytes, frames: Frames) -> list[Move]:
    """Moves of TP programs to positions that the text states."""
    plain, found = text.decode("latin-1"), []
    stated = dict(re.findall(r"P\[(\d+)\]\{(.*?)\};", plain, re.S))
    for kind, number in re.findall(r"(?m)^\s*\d*:([LJ]) P\[(\d+)\]", plain):
        body = stated[number]
        config = re.search(r"CONFIG : '(.*?)'", body)
        words = _words(body[0 if config is None else config.end() :])
        outer = float(words.get("E1", "0"))
        if config is None:
            values = np.array([float(words[f"J{k}"]) for k in range(1, 7)])
            found.append(Move(False, values, outer=outer))
            continue
        place = np.array([float(words[name]) for name in "XYZ"])
        turn, tip = frames.placed(wpr(*(float(words[name]) for name in "WPR")), place)
        found.append(Move(kind == "L", None, turn, tip, (config[1],), outer))
    return found


def rapid(text: bytes, frames: Frames) -> list[Move]:
    """Moves of RAPID to targets with names or numbers."""
    plain = re.sub(r"!.*", "", text.decode("latin-1"))
    named = dict(re.findall(r"(?:robtarget|jointtarget) (\w+):=(\[.*\]);", plain))
    found = []
    for kind, target in re.findall(r"Move(L|J|AbsJ) (\w+|\[\[.*\]\]),v", plain):
        numbers = [float(number) for number in _NUMBER.findall(named.get(target, target))]
        if kind == "AbsJ":
            found.append(Move(False, np.array(numbers[:6]), outer=numbers[6]))
            continue
        w, *axis = numbers[3:7]
        half = np.arctan2(np.linalg.norm(axis), w)
        own = rotvec(2 * half * np.array(axis) / np.linalg.norm(axis))
        turn, tip = frames.placed(own, np.array(numbers[:3]))
        words = tuple(f"{v:g}" for v in numbers[7:11])
        found.append(Move(kind == "L", None, turn, tip, words, numbers[11]))
    return found


def ur(text: bytes, frames: Frames) -> list[Move]:
    """Moves of URScript to poses and joints with names or numbers, in m and rad."""
    plain = re.sub(r"#.*", "", text.decode("latin-1"))
    named = dict(re.findall(r"(?m)^\s*(\w+)=(p?\[.*\])", plain))
    found = []
    for kind, target in re.findall(r"move([lj])\((?:pose_trans\(frame, ?)?(p?\[[^\]]*\]|\w+)", plain):
        value = named.get(target, target)
        numbers = np.array([float(number) for number in _NUMBER.findall(value)])
        if not value.startswith("p"):
            found.append(Move(False, np.degrees(numbers)))
            continue
        turn, tip = frames.placed(rotvec(numbers[3:]), 1000.0 * numbers[:3])
        found.append(Move(kind == "l", None, turn, tip))
    return found


#: Pulses of each joint in a degree, in tests of jobs of INFORM.
PULSES_PER_DEG = 1e5


def jbi(text: bytes, frames: Frames) -> list[Move]:
    """Moves of INFORM to taught positions."""
    found = []
    for move in inform.moves(text):
        if move.in_pulses:
            found.append(Move(move.straight, move.numbers / PULSES_PER_DEG))
            continue
        turn, tip = frames.placed(move.turn, move.numbers[:3])
        found.append(Move(move.straight, None, turn, tip, tuple(str(word) for word in move.posture)))
    return found


def staubli(text: bytes, frames: Frames) -> list[Move]:
    """Moves of VAL 3, whose frame and tool are those of its own data."""
    return [Move(move.straight, move.joints, move.turn, move.tip, move.words) for move in val3.moves(text)]


READERS: dict[str, Callable[[bytes, Frames], list[Move]]] = {
    "krl": krl,
    "tp": tp,
    "rapid": rapid,
    "ur": ur,
    "inform": jbi,
    "val3": staubli,
}
