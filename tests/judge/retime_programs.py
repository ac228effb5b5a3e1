"""Random programs to be re-timed, and random limits: every path mode, kinds of feeds, rests, scales of moves.

Each is written for LinuxCNC, begins at the axis positions 0, and is of 3 to 30 blocks with moves.
"""

from __future__ import annotations

import math

import numpy as np

from judge import programs

#: kinds of blocks, and how often they come
_WEIGHTS = {
    "line": 6.0, "rapid": 2.0, "arc": 2.0, "circle": 0.2, "burst": 0.7, "tiny": 1.0, "back": 0.7,
    "straight": 1.5, "mode": 1.2, "feed": 2.0, "dwell": 0.7, "stop": 0.5, "plane": 1.0, "inverse": 0.3,
    "turns": 0.2,
}  # fmt: skip
_PLANES = {17: "XYZ", 18: "ZXY", 19: "YZX"}


def limits(seed: int) -> np.ndarray:
    """(3, 3) velocity, acceleration and jerk of X, Y and Z, mm and s, over decades; at times one is slow."""
    rng = np.random.default_rng([seed, 1])
    limits = np.array(
        [10.0 ** rng.uniform(1.3, 3.0), 10.0 ** rng.uniform(2.0, 4.3), 10.0 ** rng.uniform(3.0, 6.0)]
    )
    limits = limits[:, None] * 10.0 ** rng.uniform(-0.4, 0.4, (3, 3))
    draw = rng.random()
    if draw < 0.1:
        limits[:, rng.integers(3)] /= 100.0
    elif draw < 0.15:
        limits[2] = 10.0 ** rng.uniform(1.0, 2.0)
    elif draw < 0.2:
        limits[2] = 1e9
    return np.asarray(limits)


def program(seed: int) -> bytes:
    """A legal program of its own for each seed."""
    rng = np.random.default_rng([seed, 2])
    if rng.random() < 0.2:
        features = [name for name in programs.FEATURES if rng.random() < 0.5] or ["lines"]
        text = programs.random_program(seed, features=features, blocks=int(rng.integers(2, 12)))
        return text.replace(b"G94", _mode(rng).encode() + b" G94", 1)
    return _Writer(rng).text().encode()


def _mode(rng: np.random.Generator) -> str:
    kind = rng.choice(["G61", "G61.1", "G64", "P", "Q"], p=[0.15, 0.15, 0.1, 0.4, 0.2])
    if kind not in "PQ":
        return str(kind)
    tolerance = 10.0 ** (rng.uniform(-4, -3) if rng.random() < 0.05 else rng.uniform(-2.7, 0.3))
    second = f" Q{tolerance * rng.choice([0.0, 0.5, 1.0]):.5f}" if kind == "Q" else ""
    return f"G64 P{tolerance:.5f}{second}"


class _Writer:
    """Blocks in absolute millimetres, at one scale a program."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.position = np.zeros(3)
        self.scale = 10.0 ** rng.uniform(-2, 2.5)
        self.digits = int(rng.choice([3, 4, 6]))
        self.plane = 17
        self.inverse = False
        self.blocks = ["G21 G90 G17 G40 G49 G80 G94", _mode(rng), self.feed()]

    def feed(self) -> str:
        if self.rng.random() < 0.05:
            return f"F{10.0 ** self.rng.uniform(-3, -1):.6f}"
        return f"F{10.0 ** self.rng.uniform(0.5, 4.8):.3f}"

    def text(self) -> str:
        blocks = int(self.rng.integers(3, 31))
        kinds = list(_WEIGHTS)
        weights = np.array(list(_WEIGHTS.values()))
        weights *= self.rng.random(len(kinds)) < 0.7
        weights[0] += 1.0
        for kind in self.rng.choice(kinds, size=blocks, p=weights / weights.sum()):
            getattr(self, f"_{kind}")()
        self._leave()
        return "\n".join([*self.blocks, "M2"]) + "\n"

    def word(self) -> str:
        """The F word that each feed block needs under inverse time, else perhaps one."""
        if self.inverse:
            return f" F{10.0 ** self.rng.uniform(-1, 3):.4f}"
        return " " + self.feed() if self.rng.random() < 0.15 else ""

    def to(self, target: np.ndarray, code: str = "G1") -> None:
        target = np.round(np.clip(target, -900.0, 900.0), self.digits)
        words = "".join(
            f" {name}{value:.{self.digits}f}"
            for name, value, old in zip("XYZ", target, self.position, strict=True)
            if value != old or self.rng.random() < 0.1
        )
        if words:
            self.blocks.append(code + words + (self.word() if code == "G1" else ""))
            self.position = target

    def step(self, size: float) -> np.ndarray:
        direction = self.rng.normal(size=3)
        if self.rng.random() < 0.5:
            direction *= self.rng.random(3) < 0.5
        return np.asarray(direction * size * 10.0 ** self.rng.uniform(-0.7, 0.3))

    def _line(self) -> None:
        self.to(self.position + self.step(self.scale))

    def _rapid(self) -> None:
        self.to(self.position + self.step(self.scale * 3), "G0")

    def _straight(self) -> None:
        """Parts of one line, with feeds of their own."""
        step = self.step(self.scale)
        for _ in range(int(self.rng.integers(2, 5))):
            self.to(self.position + step * self.rng.uniform(0.05, 1.0))

    def _back(self) -> None:
        here = self.position
        self._line()
        self.to(here)

    def _tiny(self) -> None:
        for _ in range(int(self.rng.integers(1, 6))):
            self.to(self.position + self.rng.normal(size=3) * 10.0 ** self.rng.uniform(-6, -2))

    def _burst(self) -> None:
        """Dense points of a curve, in rounded digits."""
        a, b = self.step(self.scale * 0.3), self.step(self.scale * 0.3)
        count = int(self.rng.integers(8, 40))
        for t in np.linspace(0.0, 1.0, count)[1:]:
            self.to(self.position + (a * math.cos(4 * t) + b * math.sin(3 * t)) / count * 4)

    def _circle(self) -> None:
        self._arc(whole=True)

    def _arc(self, whole: bool = False) -> None:
        radius = min(
            self.scale * 10.0 ** self.rng.uniform(-1.5, 0.3), 10.0 if self.rng.random() < 0.9 else 100.0
        )
        if radius < 0.05:
            return
        first, second, third = ("XYZ".index(name) for name in _PLANES[self.plane])
        angle, counter_clockwise = self.rng.uniform(0, 2 * math.pi), self.rng.random() < 0.5
        sweep = 2 * math.pi if whole else self.rng.uniform(0.02, 3.0 if self.rng.random() < 0.8 else 6.2)
        centre = np.zeros(3)
        centre[[first, second]] = -radius * np.array([math.cos(angle), math.sin(angle)])
        # the radius at the end is the radius at the start, but for the last digit
        offset = np.round(centre, 6)
        turned = angle + sweep * (1 if counter_clockwise else -1)
        end = self.position.copy()
        if not whole:
            reach = math.hypot(offset[first], offset[second])
            end[[first, second]] += offset[[first, second]] + reach * np.array(
                [math.cos(turned), math.sin(turned)]
            )
        if self.rng.random() < 0.4:
            end[third] += self.step(self.scale)[third]
        if np.abs(end).max() > 900.0:
            return
        end = np.round(end, 6)
        words = "".join(f" {'XYZ'[i]}{end[i]:.6f}" for i in range(3) if not (whole and i != third))
        words += "".join(f" {'IJK'[i]}{offset[i]:.6f}" for i in (first, second))
        turns = f" P{self.rng.integers(2, 4)}" if self.rng.random() < 0.1 else ""
        self.blocks.append(("G3" if counter_clockwise else "G2") + words + turns + self.word())
        self.position = end

    def _mode(self) -> None:
        self.blocks.append(_mode(self.rng))

    def _feed(self) -> None:
        if not self.inverse:
            self.blocks.append(self.feed())

    def _dwell(self) -> None:
        self.blocks.append(f"G4 P{self.rng.uniform(0, 2) * (self.rng.random() < 0.9):.3f}")

    def _stop(self) -> None:
        self.blocks.append(str(self.rng.choice(["M0", "M3 S1000", "M8", "M9", "S500", "M62 P0"])))

    def _plane(self) -> None:
        self.plane = int(self.rng.choice(list(_PLANES)))
        self.blocks.append(f"G{self.plane}")

    def _leave(self) -> None:
        if self.inverse:
            self.inverse = False
            self.blocks += ["G94", self.feed()]

    def _inverse(self) -> None:
        if self.inverse:
            self._leave()
        else:
            self.inverse = True
            self.blocks.append("G93")

    def _turns(self) -> None:
        self._leave()
        self.blocks += [f"S{self.rng.integers(10, 9000)}", f"G95 F{10.0 ** self.rng.uniform(-3, 0):.4f}"]
        self._line()
        self.blocks += ["G94", self.feed()]
