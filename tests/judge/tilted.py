"""An independent judge of programs with tilted planes: its own reading of PLANE, CYCLE800 and G68.2, and its
own search of the rotary positions. It imports nothing of what it judges.

Words in a plane state the tip in the workpiece, turned by `scipy`'s rotations. Rotary axes stand there.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from judge.five_axis import OWN, Judge

#: rad by which a found position may miss the normal.
MISSED = 1e-9


class TiltedJudge(Judge):
    """Reads the planes of a program, and judges its feed moves in position."""

    def __init__(self, machine: Path) -> None:
        super().__init__(machine)
        self.turn = np.eye(3)
        self.below = np.zeros(3)
        self.shift = np.zeros(3)
        self.on = False
        self.found: dict[str, float] = {}
        self.searched: dict[tuple[bytes, float, str], dict[str, float]] = {}
        self.feeds = True
        #: the axis of larger and smaller positions of a swivel
        self.swivels = self.file.get("kinematics", {}).get("swivel_axis", "")

    def read(self, text: bytes) -> list[tuple[bool, bool, np.ndarray]]:
        self.turn, self.below, self.shift, self.on = np.eye(3), np.zeros(3), np.zeros(3), False
        rotary = [name for name in self.order if name not in OWN]
        words = dict.fromkeys("XYZ", np.nan)
        turned = dict.fromkeys(rotary, np.nan)
        moves: list[tuple[bool, bool, np.ndarray]] = []
        cycle, modal = "", ""
        text = re.sub(rb"\s*(?:;.*)?~\n", b" ", text)
        for line in text.decode().splitlines():
            line = line.partition(";")[0]
            if match := re.search(r"CYCL DEF 2\d\d .*Q203.*", line):
                cycle = match[0]
                continue
            if match := re.fullmatch(r"(?:N\d+ )?MCALL(.*)", line):
                modal = match[1].strip()
                continue
            if "CYCL CALL" in line or re.match(r"CYCLE8\d\b", line):
                moves += self.hole(moves[-1], cycle if "CALL" in line else line)
                words["Z"] = self.retracted
                continue
            if self.statement(line, words, turned):
                continue
            calls = cycle if "M99" in line else modal
            line = re.sub(r"\bL\b|R0|M\d+", "", line)
            given = dict(re.findall(r"([XYZABC])\s*([-+]?[\d.]+|\+Q12\d)", line))
            given = {name: word for name, word in given.items() if name in self.order}
            if not given:
                continue
            for name, word in given.items():
                if name in OWN:
                    words[name] = float(word)
                else:
                    turned[name] = self.found[name] if "Q" in word else float(word)
            place = np.full(len(self.order), np.nan)
            self.words = words
            tip = np.array([words[name] for name in "XYZ"]) + self.shift
            tip = self.turn @ tip + self.below if self.on else tip + self.below
            for name, value in [*zip("XYZ", tip, strict=True), *turned.items()]:
                place[self.order.index(name)] = value
            if np.isfinite(place).all():
                moves.append((self.cuts(line), self.on, place))
                if calls:
                    moves += self.hole(moves[-1], calls)
                    words["Z"] = self.retracted
        return moves

    def hole(self, before: tuple[bool, bool, np.ndarray], cycle: str) -> list[tuple[bool, bool, np.ndarray]]:
        """Where the tool stands, to the clearance, along the axis to the bottom, and out again."""
        if cycle.startswith("CYCL DEF"):
            q = {int(n): float(v) for n, v in re.findall(r"Q(\d+)\s*=\s*([-+\d.]+)", cycle)}
            levels = [q[203] + q[200], q[203] + q[201], q[203] + max(q[200], q[204])]
        else:
            number, given = re.findall(r"CYCLE8(\d)\s*\((.*)\)", cycle)[0]
            rtp, rfp, sdis, dp, *_ = (float(text or 0) for text in given.split(","))
            levels = [rfp + sdis, dp, *([rfp + sdis] if number in "459" else []), rtp]
        self.retracted = levels[-1]
        along = self.turn[:, 2] if self.on else np.array([0.0, 0.0, 1.0])
        strokes = []
        for number, level in enumerate(levels):
            place = before[2].copy()
            for name, part in zip("XYZ", along, strict=True):
                place[self.order.index(name)] += part * (level - self.words["Z"])
            strokes.append((0 < number < len(levels) - (levels[-1] != levels[-2]), self.on, place))
        return strokes

    def cuts(self, line: str) -> bool:
        if match := re.search(r"\bG0?([01])\b", line):
            self.feeds = match[1] == "1"
        return self.feeds and "MAX" not in line

    def statement(self, line: str, words: dict[str, float], turned: dict[str, float]) -> bool:
        """Take over a line that is no move."""
        if match := re.search(r"CYCL DEF 7\.\d ([XYZ])([-+\d.]+)", line):
            where = self.shift if self.on else self.below
            where["XYZ".index(match[1])] = float(match[2])
        elif "PLANE" in line:
            self.plane(line)
            words.update(dict.fromkeys("XYZ", np.nan))
            if "TURN" in line or "MOVE" in line:
                turned.update(self.found)
        elif "CYCLE800" in line:
            self.swivel(line)
            words.update(dict.fromkeys("XYZ", np.nan))
            if self.on:
                turned.update(self.found)
        elif match := re.search(r"G68\.2 X(\S+) Y(\S+) Z(\S+) I(\S+) J(\S+) K(\S+)", line):
            x, y, z, *angles = map(float, match.groups())
            self.on, self.below, self.shift = True, np.array([x, y, z]), np.zeros(3)
            self.turn = Rotation.from_euler("ZXZ", angles, degrees=True).as_matrix()
            words.update(dict.fromkeys("XYZ", np.nan))
        elif "G53.1" in line:
            self.search(0.0, "")
            turned.update(self.found)
        elif "G69" in line:
            self.on, self.below, self.turn = False, np.zeros(3), np.eye(3)
            words.update(dict.fromkeys("XYZ", np.nan))
        names = ("PLANE", "CYCL", "TOOL", "PGM", "G68", "G53.1", "G69", "G43", "T1", "G54", "D1", "CC ")
        return any(name in line for name in names)

    def swivel(self, line: str) -> None:
        given = [text.strip() for text in re.findall(r"\((.*)\)", line)[0].split(",")]
        self.on, self.turn, self.below, self.shift = len(given) > 1, np.eye(3), np.zeros(3), np.zeros(3)
        if not self.on:
            return
        numbers = [float(text or 0) if '"' not in text else 0.0 for text in given]
        axes = "".join("-XYZ"[int(numbers[3]) // 4**k % 4] for k in range(3))
        self.turn = Rotation.from_euler(axes, numbers[7:10], degrees=True).as_matrix()
        self.below, self.shift = np.array(numbers[4:7]), np.array(numbers[10:13])
        self.search(numbers[13], self.swivels)

    def plane(self, line: str) -> None:
        self.on = "RESET" not in line
        self.shift = np.zeros(3)
        line = re.sub(r"P[123](?=[XYZ])", "", line)
        numbers = [float(n) for n in re.findall(r"[A-Z]([-+]?\d+\.?\d*)", line)]
        if "RESET" in line:
            self.turn = np.eye(3)
        elif "SPATIAL" in line:
            self.turn = Rotation.from_euler("xyz", numbers[:3], degrees=True).as_matrix()
        elif "EULER" in line:
            self.turn = Rotation.from_euler("ZXZ", numbers[:3], degrees=True).as_matrix()
        elif "VECTOR" in line:
            base, normal = np.array(numbers[:3]), np.array(numbers[3:6])
            self.turn = self.directed(base, normal)
        elif "POINTS" in line:
            one, two, three = np.array(numbers[:9]).reshape(3, 3)
            self.turn = self.directed(two - one, np.cross(two - one, three - one))
        elif match := re.search(r"RELATIV SP([ABC])([-+\d.]+)", line):
            axis = np.eye(3)["ABC".index(match[1])]
            self.turn = self.turn @ Rotation.from_rotvec(axis * np.radians(float(match[2]))).as_matrix()
        if self.on:
            self.search(1.0 if re.search(r"S(EQ|YM)\+", line) else -1.0, "")

    @staticmethod
    def directed(first: np.ndarray, third: np.ndarray) -> np.ndarray:
        z = third / np.linalg.norm(third)
        y = np.cross(z, first)
        y /= np.linalg.norm(y)
        return np.column_stack((np.cross(y, z), y, z))

    def search(self, sign: float, axis: str) -> None:
        """The rotary positions that bring the tool along the normal: of an axis the larger or the smaller
        one, else that nearest the tool of a sign, or any within the travel."""
        key = (self.turn.tobytes(), sign, axis)
        if key not in self.searched:
            self.searched[key] = self.first_of(sign, axis)
        self.found = self.searched[key]

    def first_of(self, sign: float, axis: str) -> dict[str, float]:
        columns = [k for k, name in enumerate(self.order) if name not in OWN]
        names = [name for name in self.chain if name not in OWN and name != "F"]

        def miss(values: np.ndarray) -> np.ndarray:
            axes = np.zeros((1, len(self.order)))
            axes[0, columns] = values
            return self.forward(axes, False)[1][0] - self.turn[:, 2]

        found: list[dict[str, float]] = []
        for start in np.random.default_rng(1).uniform(-180, 180, (16, len(columns))):
            done = least_squares(miss, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
            values = dict(zip([self.order[k] for k in columns], done.x, strict=True))
            values = {name: (v + 180.0) % 360.0 - 180.0 for name, v in values.items()}
            ends = {name: self.file["axes"][name]["travel_deg"] for name in values}
            inside = all(ends[name][0] <= v <= ends[name][1] for name, v in values.items())
            if np.abs(done.fun).max() <= MISSED and inside:
                found.append(values)
        if axis:
            return max(found, key=lambda values: sign * values[axis])
        return max(found, key=lambda values: sign * values[names[-1]] >= -1e-6)
