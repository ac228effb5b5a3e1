"""Reads plain applications of VAL 3 for tests, by the XML reader of Python and numpy alone: where each move
goes, and with which tool and which words of configuration.

It shares nothing with `olp.program`: it holds the numbers of all data by name and index, and runs the
programs line by line as the control does. Rotations are products of turns about single axes.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np

from judge.arm import about

X, Y, Z = np.eye(3)
_MARK = re.compile(rb"\n<!--olp: file [^\n]*-->\n")
_NAMES = ("x", "y", "z", "rx", "ry", "rz")
_JOINTS = ("j1", "j2", "j3", "j4", "j5", "j6")
_PAIRS = ("()", "{}", "[]")
_WORDS = ("shoulder", "elbow", "wrist")
_SPEED = ("accel", "vel", "decel", "tmax", "rmax", "blend", "leave", "reach")


@dataclass(frozen=True)
class Val3Move:
    """A move: straight or not, joints in degrees or the tip in the world and its rotation. `lever` goes from
    gauge point to tip in the world, `tool` is the tip at the flange. `motion` says how the move is made. An
    arc goes by way of the pose `via` (4, 4)."""

    straight: bool
    joints: np.ndarray | None
    tip: np.ndarray
    turn: np.ndarray
    lever: np.ndarray
    tool: np.ndarray
    words: tuple[str, ...]
    motion: dict[str, str]
    via: np.ndarray | None = None


def matrix(numbers: list[float]) -> np.ndarray:
    """Shifted, then turned about x, then about the new y, then about the new z."""
    found = np.eye(4)
    rx, ry, rz = numbers[3:]
    found[:3, :3] = about(X, rx) @ about(Y, ry) @ about(Z, rz)
    found[:3, 3] = numbers[:3]
    return found


class _Application:
    def __init__(self, text: bytes) -> None:
        self.data: dict[str, dict[str, str]] = {}
        self.sizes: dict[str, int] = {}
        self.programs: dict[str, tuple[list[str], list[str]]] = {}
        self.first = ""
        self.moves: list[Val3Move] = []
        for part in _MARK.split(text):
            self._part(ET.fromstring(part))

    def _part(self, root: ET.Element) -> None:
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
        for data in root.iter("Data"):
            if data.get("size"):
                self.sizes[data.attrib["name"]] = int(data.attrib["size"])
            for value in data.iter("Value"):
                self.data[f"{data.get('name')}[{value.get('key', '0')}]"] = dict(value.attrib)
        for kind in ("frame", "point", "joint", "tool", "mdesc"):
            for datum in root.iter(kind):
                father = next((e for e in datum if e.tag in ("fFather", "pFather", "tFather")), None)
                for value in [e for e in datum if e.tag.startswith("value")]:
                    own = {k: v for e in value for k, v in e.attrib.items()}
                    if father is not None and father.get("name"):
                        own["fatherId"] = f"{father.get('name')}[{father.get('fatherIndex')}]"
                    self.data[f"{datum.get('name')}[{value.get('index')}]"] = own
        for program in [*root.iter("Program"), *root.iter("program")]:
            code = next((e for e in program.iter() if e.tag in ("Code", "code")), None)
            if code is not None:
                names = [e.attrib["name"] for e in program.iter("Parameter")]
                self.programs[program.attrib["name"]] = names, (code.text or "").splitlines()
                self.first = self.first or program.attrib["name"]

    # -- expressions ---------------------------------------------------------------------------------

    def _pose(self, key: str) -> np.ndarray:
        """The place of a frame or point in the world, or of a tool at the flange."""
        if key in ("world[0]", "flange[0]"):
            return np.eye(4)
        own = self.data[key]
        outer = self._pose(own["fatherId"]) if own.get("fatherId") else np.eye(4)
        return outer @ matrix([float(own.get(name) or 0) for name in _NAMES])

    @staticmethod
    def _key(text: str) -> str:
        text = text.strip()
        return text if text.endswith("]") else f"{text}[0]"

    def _numbers(self, text: str) -> list[float]:
        return [float(v) for v in text.strip().strip("{}").split(",")]

    def _target(self, text: str) -> tuple[np.ndarray, tuple[str, ...]]:
        text = text.strip()
        if text.startswith("appro"):
            inner, _, shift = text[6:-1].rpartition(",{")
            pose, words = self._target(inner)
            return pose @ matrix(self._numbers(shift)), words
        if text.startswith("compose"):
            inner, _, shift = text[8:-1].rpartition(",{")
            point, _, frame = inner.rpartition(",")
            pose, words = self._target(point)
            axes = self._pose(self._key(frame))[:3, :3]
            pose[:3, 3] += axes @ matrix(self._numbers(shift))[:3, 3]
            return pose, words
        if text.startswith("{{"):
            first, _, second = text[2:-2].partition("},{")
            return matrix(self._numbers(first)), tuple(second.split(","))
        key = self._key(text)
        return self._pose(key), tuple(self.data[key].get(word, "") for word in _WORDS)

    # -- statements ----------------------------------------------------------------------------------

    def run(self, name: str, values: dict[str, str]) -> None:
        for line in self.programs[name][1]:
            text = re.sub(r"//.*", "", line).strip()
            move = re.fullmatch(r"(?:\w+\s*=\s*)?move([ljc])\s*\((.*)\)", text)
            call = re.fullmatch(r"call (\w+)\((.*)\)", text)
            value = re.fullmatch(r"(\w+(?:\[\d+\])?)((?:\.\w+)+)\s*=\s*(.*)", text)
            if move is not None:
                self._move(move[1], *re.fullmatch(r"(.*),([^,{}]*),([^,{}]*)", move[2]).groups())
            elif call is not None:
                names = self.programs[call[1]][0]
                self.run(call[1], dict(zip(names, call[2].split(","), strict=True) if names else ()))
            elif value is not None:
                own = self.data.setdefault(self._key(value[1]), {})
                name, stated = value[2].rpartition(".")[2], values.get(value[3].strip(), value[3].strip())
                if name == "trsf":
                    own.update(zip(_NAMES, stated.strip("{} ").split(","), strict=True))
                else:
                    own[{"tvel": "tmax"}.get(name, name)] = stated

    def _move(self, kind: str, target: str, tool: str, motion: str) -> None:
        straight, via = kind == "l", None
        if kind == "c":
            # the comma outside of all brackets
            places = [k for k, mark in enumerate(target) if mark == ","]
            place = next(
                k for k in places if all(target[:k].count(a) == target[:k].count(b) for a, b in _PAIRS)
            )
            via, target = self._target(target[:place])[0], target[place + 1 :]
        at_flange = self._pose(self._key(tool))
        key = self._key(target)
        how = self.data.get(self._key(motion), {})
        how = {k: how[k] for k in _SPEED if k in how}
        if set(self.data.get(key, {})) & set(_JOINTS):
            joints = np.array([float(self.data[key].get(name) or 0) for name in _JOINTS])
            none = np.full(3, np.nan)
            self.moves.append(Val3Move(straight, joints, none, np.eye(3), none, at_flange, (), how))
            return
        pose, words = self._target(target)
        turn = pose[:3, :3]
        lever = turn @ at_flange[:3, :3].T @ at_flange[:3, 3]
        self.moves.append(Val3Move(straight, None, pose[:3, 3], turn, lever, at_flange, words, how, via))


def moves(text: bytes) -> list[Val3Move]:
    """All moves of an application, from its first program on."""
    application = _Application(text)
    application.run(application.first, {})
    return application.moves


def sizes(text: bytes) -> dict[str, tuple[int, int]]:
    """By the names of data their stated size, and the number of their elements."""
    application = _Application(text)
    count = {name: sum(key.startswith(f"{name}[") for key in application.data) for name in application.sizes}
    return {name: (size, count[name]) for name, size in application.sizes.items()}
