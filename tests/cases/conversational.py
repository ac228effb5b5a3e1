"""Random programs of plain conversational blocks, with all that such blocks leave out."""

from __future__ import annotations

import math
import random


class Job:
    """Blocks that are drawn one after the other; the position is the one that the blocks lead to."""

    def __init__(self, seed: int, digits: int = 3) -> None:
        self.draw, self.digits = random.Random(seed), digits
        self.lines: list[str] = []
        self.here = [0.0, 0.0, 20.0]
        self.numbered = self.draw.random() < 0.7
        self.plus = self.draw.random() < 0.5

    def n(self, value: float) -> str:
        text = f"{value:.{self.draw.choice((self.digits, self.digits, 6))}f}"
        return "+" + text if self.plus and not text.startswith("-") else text

    def put(self, text: str) -> None:
        self.lines.append(f"{len(self.lines)} {text}" if self.numbered else text)

    def spot(self) -> list[float]:
        return [self.draw.uniform(-60, 60), self.draw.uniform(-60, 60), self.draw.uniform(-15, 5)]

    def line(self) -> None:
        step = self.draw.random() < 0.2
        axes = self.draw.sample(range(3), self.draw.randint(1, 3))
        end, words = self.spot(), []
        for axis in sorted(axes):
            value = round(end[axis], self.digits)
            if step:
                change = round(value - self.here[axis], self.digits)
                words.append(f"I{'XYZ'[axis]}{self.n(change)}")
                self.here[axis] += change
            else:
                words.append(f"{'XYZ'[axis]}{self.n(value)}")
                self.here[axis] = value
        name = "" if self.draw.random() < 0.1 else "L "
        tail = self.draw.choice(["", "", " R0", " R0 F500", " F750", " R0 FMAX", " F MAX", " M8"])
        self.put(name + " ".join(words) + tail)

    def pole(self, radius: float) -> tuple[float, float]:
        angle = self.draw.uniform(0, 2 * math.pi)
        x, y = (round(v, self.digits) for v in (
            self.here[0] + radius * math.cos(angle), self.here[1] + radius * math.sin(angle)
        ))  # fmt: skip
        if self.draw.random() < 0.15:
            self.put(f"CC IX{self.n(round(x - self.here[0], 6))} IY{self.n(round(y - self.here[1], 6))}")
        else:
            self.put(f"CC X{self.n(x)} Y{self.n(y)}")
        return x, y

    def arc(self) -> None:
        x, y = self.pole(self.draw.uniform(3, 30))
        for _ in range(self.draw.choice((1, 1, 2))):
            radius = math.hypot(self.here[0] - x, self.here[1] - y)
            sign = self.draw.choice("+-")
            if self.draw.random() < 0.2:
                self.put(f"C DR{sign}")
                continue
            angle = self.draw.uniform(0, 2 * math.pi)
            self.here[0] = round(x + radius * math.cos(angle), 5)
            self.here[1] = round(y + radius * math.sin(angle), 5)
            self.put(f"C X{self.here[0]:.5f} Y{self.here[1]:.5f} DR{sign}{self.draw.choice(['', ' F300'])}")

    def by_radius(self) -> None:
        end = self.spot()
        x, y = round(end[0], self.digits), round(end[1], self.digits)
        half = math.hypot(x - self.here[0], y - self.here[1]) / 2
        size = round(half * self.draw.uniform(1.05, 2.0) + 0.1, self.digits)
        self.put(f"CR X{self.n(x)} Y{self.n(y)} R{self.draw.choice('+-')}{size} DR{self.draw.choice('+-')}")
        self.here[:2] = [x, y]

    def helix(self) -> None:
        x, y = self.pole(self.draw.uniform(3, 20))
        angle = round(self.draw.uniform(20, 800), 3) * self.draw.choice((1, -1))
        radius = math.hypot(self.here[0] - x, self.here[1] - y)
        now = math.atan2(self.here[1] - y, self.here[0] - x) + math.radians(angle)
        self.here[0], self.here[1] = x + radius * math.cos(now), y + radius * math.sin(now)
        down = ""
        if self.draw.random() < 0.7:
            step = round(self.draw.uniform(-2, 1), self.digits)
            self.here[2] += step
            down = f" IZ{self.n(step)}"
        self.put(f"CP IPA{angle:+.3f}{down} DR{'+' if angle > 0 else '-'}")


def program(seed: int, count: int = 25) -> bytes:
    """A program of `count` pieces of path."""
    job = Job(seed)
    job.put("BEGIN PGM RANDOM MM")
    job.put("TOOL CALL 1 Z S2000")
    job.put("L X+0 Y+0 Z+20 R0 FMAX M3")
    job.put("L Z+5 F400")
    job.here = [0.0, 0.0, 5.0]
    for _ in range(count):
        if max(abs(v) for v in job.here) > 90:
            job.put("L X+10 Y-20 Z+5 R0 F900")
            job.here = [10.0, -20.0, 5.0]
        job.draw.choice((job.line, job.line, job.arc, job.by_radius, job.helix))()
    job.put("L Z+50 R0 FMAX M30")
    job.put("END PGM RANDOM MM")
    return ("\n".join(job.lines) + "\n").encode()
