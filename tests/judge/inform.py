"""Reads plain jobs of INFORM (JBI) for tests, by numpy alone: the numbers that each move goes to, in order.

It shares nothing with `olp.program`: lines are taken one by one as a control loads them, and the header lines
before a position are kept as they stand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from judge.arm import about

X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Move:
    """A move: straight or not, the `name` of its position and the words behind it, its numbers, and the
    header lines that hold for it, by their first words."""

    straight: bool
    name: str
    tail: str
    numbers: np.ndarray
    header: dict[str, str]
    line: int

    @property
    def in_pulses(self) -> bool:
        return self.header.get("POSTYPE", "PULSE") == "PULSE"

    @property
    def turn(self) -> np.ndarray:
        """The rotation of the tool: about the fixed X by Rx, then Y by Ry, then Z by Rz."""
        rx, ry, rz = self.numbers[3:6]
        return about(Z, rz) @ about(Y, ry) @ about(X, rx)

    @property
    def posture(self) -> tuple[int, ...]:
        return tuple(int(word) for word in self.header["RCONF"].split(",")[:6])


def moves(text: bytes) -> list[Move]:
    """All moves to positions that the text states."""
    held: dict[str, str] = {}
    stated: dict[tuple[str, int], tuple[np.ndarray, dict[str, str]]] = {}
    found = []
    for number, raw in enumerate(text.decode("latin-1").split("\n"), 1):
        line = raw.strip("\r\t \0\x1a")
        if line.startswith("///"):
            word, _, value = line[3:].partition(" ")
            held["FORM" if word in ("RECTAN", "PULSE", "ANGLE") else word] = value.strip()
        elif line[:1] in ("C", "P") and "=" in line and line[1 : line.index("=")].strip().isdigit():
            name, values = line.split("=")
            key = name[0], int(name[1:])
            assert key not in stated, f"{name} is stated twice"
            stated[key] = np.array([float(value) for value in values.split(",")]), dict(held)
        elif (move := line.removeprefix("S"))[:4] in ("MOVJ", "MOVL", "MOVC"):
            name, _, tail = move[5:].partition(" ")
            if name[1:].isdigit() and (name[0], int(name[1:])) in stated:
                numbers, header = stated[name[0], int(name[1:])]
                found.append(Move(move[3] == "L", name, tail, numbers, header, number))
    return found


def counts(text: bytes) -> tuple[int, int]:
    """The count of taught positions that the header states, and how many there are."""
    lines = text.decode("latin-1").splitlines()
    (stated,) = (line for line in lines if line.startswith("///NPOS"))
    return int(stated.split()[1].split(",")[0]), sum(line[:1] == "C" and "=" in line for line in lines)
