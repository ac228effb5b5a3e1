"""Arcs on machines with rotary axes, judged against the arcs that the test itself wrote."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast
from cases.joint_machines import STRUCTURES, machine_file
from judge.five_axis import OWN, Judge

import olp

#: By code of the plane: its axes, and the letters of its centre.
PLANES = {17: ("XYZ", "IJ"), 18: ("ZXY", "KI"), 19: ("YZX", "JK")}
CASES = [
    (chain, 17 + (number + which) % 3, bool(which))
    for number, chain in enumerate(STRUCTURES)
    for which in (0, 1)
]


class Arc:
    """An arc of a test: coordinates at shares, and the program that ends with it."""

    def __init__(
        self, chain: str, seed: int, *, plane: int = 17, tips: bool = False, turns: float = 0.0,
        turning: float = 0.0,
    ) -> None:  # fmt: skip
        rng = np.random.default_rng(seed)
        self.names, (self.axes, self.letters) = ["X", "Y", "Z", *STRUCTURES[chain]], PLANES[plane]
        self.tips, self.plane = tips, plane
        self.radius, self.begin = rng.uniform(3.0, 12.0), rng.uniform(-3.0, 3.0)
        self.sweep = 2.0 * np.pi * turns or rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 5.5)
        middle = {"X": 10.0, "Y": -20.0, "Z": 30.0, "A": -25.0, "B": 20.0, "C": 40.0}
        self.middle = np.array([middle[name] for name in self.names])
        self.step = np.array([0.0 if name in OWN else turning * rng.normal() for name in self.names])
        self.step[self.names.index(self.axes[2])] = rng.uniform(-3.0, 3.0)
        begin, end = self.place(np.array([0.0, 1.0])).round(3)
        # words have digits: the arc is the one of the words
        centre = self.place(np.array([np.nan]))[0].round(3)
        first, second = (self.names.index(name) for name in self.axes[:2])
        arms = [(place[first] - centre[first], place[second] - centre[second]) for place in (begin, end)]
        self.radii = [np.hypot(*arm) for arm in arms]
        self.begin = np.arctan2(arms[0][1], arms[0][0])
        self.sweep += (np.arctan2(arms[1][1], arms[1][0]) - self.begin - self.sweep + np.pi) % (
            2.0 * np.pi
        ) - np.pi
        self.ends, self.centre = (begin, end), centre

    def place(self, share: np.ndarray) -> np.ndarray:
        """(n, axes) coordinates; the centre at a share of NaN."""
        place = self.middle + np.nan_to_num(share)[:, None] * self.step
        angle = self.begin + share * self.sweep
        for name, way in zip(self.axes[:2], (np.cos(angle), np.sin(angle)), strict=True):
            place[:, self.names.index(name)] += np.nan_to_num(self.radius * way)
        return place

    def along(self, share: np.ndarray) -> np.ndarray:
        """(n, axes) coordinates of the arc as its words say."""
        begin, end = self.ends
        place = begin + share[:, None] * (end - begin)
        angle = self.begin + share * self.sweep
        radius = self.radii[0] + share * (self.radii[1] - self.radii[0])
        for name, way in zip(self.axes[:2], (np.cos(angle), np.sin(angle)), strict=True):
            column = self.names.index(name)
            place[:, column] = self.centre[column] + radius * way
        return place

    def text(self, *, by_radius: bool = False) -> bytes:
        begin, end = self.ends
        code = "G3" if self.sweep > 0 else "G2"
        words = " ".join(f"{name}{value:.3f}" for name, value in zip(self.names, end, strict=True))
        for letter, name in zip(self.letters, self.axes, strict=False):
            column = self.names.index(name)
            if not by_radius:
                words += f" {letter}{self.centre[column] - begin[column]:.3f}"
        if by_radius:
            words += f" R{self.radius if abs(self.sweep) < np.pi else -self.radius:.5f}"
        turns = int((abs(self.sweep) - 1e-6) // (2.0 * np.pi)) + 1
        words += f" P{turns}" if turns > 1 else ""
        start = " ".join(f"{name}{value:.3f}" for name, value in zip(self.names, begin, strict=True))
        zero = " ".join(f"{name}0" for name in self.names)
        head = f"G21 G90 G54 G{self.plane}\nG0 {zero}\n"
        head += f"G43.4 H1 {start}\n" if self.tips else f"G0 {start}\n"
        return f"{head}{code} {words} F500 (arc)\nG0 Z150\n{'G49' if self.tips else 'G80'}\nM30\n".encode()


def judged(judge: Judge, arc: Arc, text: bytes) -> tuple[float, float, float]:
    """The largest distance in mm and angle in rad of the tool along the parts of an arc, and the largest
    share of it that one part leaves out."""
    head, tail = text.split(b"(arc)")
    lines = head.splitlines(keepends=True)
    count = len(judge.read(b"".join(lines[:-1])))
    moves = judge.read(b"".join(lines) + tail)
    places = np.array([place for _, _, place in moves[count - 1 : -1]])
    part = np.linspace(0.0, 1.0, 3)[:, None]
    samples = np.vstack([a + part * (b - a) for a, b in pairwise(places)])
    tip, axis = judge.forward(judge.axes(samples, arc.tips), True)
    linear = [judge.order.index(name) for name in OWN]

    def cost(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        place = arc.along(share)
        there, along = judge.forward(place, False)
        # by its definition; the axis of the tool depends on the rotary axes alone
        there = place[:, linear] if arc.tips else there
        return np.linalg.norm(tip - there, axis=1), np.linalg.norm(np.cross(axis, along), axis=1)

    # parts go on along the arc
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(samples[:, linear], axis=0), axis=1)))
    guess = length / length[-1]
    low, high = np.clip(guess - 0.05, 0.0, 1.0), np.clip(guess + 0.05, 0.0, 1.0)
    for _ in range(30):
        left, right = low + (high - low) / 3, high - (high - low) / 3
        costs = [np.hypot(d, 100.0 * a) for d, a in (cost(left), cost(right))]
        low, high = np.where(costs[0] < costs[1], low, left), np.where(costs[0] < costs[1], right, high)
    found = 0.5 * (low + high)
    distance, angle = cost(found)
    gap = float(np.diff(np.concatenate(([0.0], found, [1.0]))).max())
    return float(distance.max()), float(angle.max()), gap


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "plane", "tips"), some_fast(CASES, 11))
def test_an_arc_is_within_tolerance_of_itself(chain: str, plane: int, tips: bool, tmp_path: Path) -> None:
    machine = machine_file(tmp_path, chain, control="fanuc" if tips else "linuxcnc", seed=5)
    arc = Arc(chain, seed=plane + tips, plane=plane, tips=tips, turning=3.0 * (plane == 18))
    result = olp.correct_joints(arc.text(), machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    far, turned, gap = judged(Judge(machine), arc, result.data)
    left = 1e-6 * result.report["orientation"]["uncorrectable_urad"]
    stated = result.report["deviation"]["after"]
    assert far < 1e-3 + 0.5e-3 * 3**0.5
    assert far == pytest.approx(1e-3 * stated["position_max_um"], abs=0.15e-3)
    assert turned < 2e-6 + np.radians(0.5e-3) * 2**0.5 + 5e-6 + left
    assert gap < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("words", [{"turns": 1.0}, {"turns": -2.0}, {"by_radius": True}])
def test_whole_turns_and_radii(words: dict[str, float], tmp_path: Path) -> None:
    machine = machine_file(tmp_path, "C A Y F X Z", seed=5)
    by_radius = bool(words.pop("by_radius", False))
    arc = Arc("C A Y F X Z", seed=1, **words)
    result = olp.correct_joints(arc.text(by_radius=by_radius), machine, tolerance_um=50.0)
    assert result.report["verdict"]["ok"]
    far, _, gap = judged(Judge(machine), arc, result.data)
    # a radius of five decimals states another centre
    assert far < 52e-3 and gap < 0.1
    last = [line for line in result.data.splitlines() if line.startswith(b"G1")]
    assert last and all(letter not in last[0] for letter in (b"I", b"J", b"R", b"P"))


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "tips"), [("C A Y F X Z", True), ("C F X Y Z B", False)])
@pytest.mark.parametrize("form", ["CP", "C"])
def test_conversational_arcs_are_within_tolerance_of_themselves(
    chain: str, tips: bool, form: str, tmp_path: Path
) -> None:
    """About a pole by an angle, with a step along Z, and to an end."""
    machine, arc = machine_file(tmp_path, chain, control="heidenhain", seed=5), Arc(chain, seed=3, tips=tips)
    (begin, end), (x, y) = arc.ends, arc.centre[[arc.names.index(name) for name in "XY"]]
    third = arc.names.index("Z")
    if form == "C":
        begin[third] = end[third]
    start = " ".join(f"{name}{value:+.3f}" for name, value in zip(arc.names, begin, strict=True))
    turn, down = "+" if arc.sweep > 0 else "-", f"Z{end[third]:+.3f}"
    words = f"IPA{np.degrees(arc.sweep):+.6f} {down}"
    if form == "C":
        words = f"X{end[arc.names.index('X')]:+.3f} Y{end[arc.names.index('Y')]:+.3f}"
    zero = " ".join(f"{name}+0" for name in arc.names)
    lines = [
        "BEGIN PGM A MM", "TOOL CALL 1 Z", f"L {zero} R0 FMAX", "L M128" if tips else "M8",
        f"L {start} R0 FMAX", f"CC X{x:+.3f} Y{y:+.3f}", f"{form} {words} DR{turn} F500 ; (arc)",
        "L Z+150 R0 FMAX", "M129", "END PGM A MM", "",
    ]  # fmt: skip
    result = olp.correct_joints("\n".join(lines).encode(), machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    far, _, gap = judged(Judge(machine), arc, result.data)
    assert far < 1e-3 + 1e-3 * 3**0.5
    assert gap < 0.1
    assert b"\n" + form.encode() + b" " not in result.data and b" DR" not in result.data


MODAL = (
    b"G21 G90 G54\nG0 X0 Y0 Z0 A-20 C30\nN10 G02 X10. I5.F500 S9 ; cut\r\nX20 Y10 R10.\n"
    b"G91 X-10 Y10 I-10 J0\nG1 X-10\nG90\nM30\n"
)


def test_what_is_written_are_straight_moves_in_the_words_of_the_program(tmp_path: Path) -> None:
    result = olp.correct_joints(MODAL, machine_file(tmp_path, "C A Y F X Z"))
    lines = result.data.splitlines(keepends=True)
    assert "OLP111" in [one.code for one in result.findings]
    heads = [line for line in lines if line.startswith((b"N10", b"G91", b"G1"))]
    assert heads[0].startswith(b"N10 G01 X") and heads[0].endswith(b"F500 S9 ; cut\r\n")
    assert not any(
        letter in b"".join(lines[2:]).replace(b"INC", b"") for letter in (b"I", b"R", b"J", b"G02")
    )
    assert heads[1].startswith(b"G91 X")


@pytest.mark.parametrize("tips", [False, True])
def test_without_errors_arcs_stay(tips: bool, tmp_path: Path) -> None:
    machine = machine_file(tmp_path, "C A Y F X Z", control="fanuc" if tips else "linuxcnc", errors=False)
    text = Arc("C A Y F X Z", 3, tips=tips, turns=1.0).text()
    result = olp.correct_joints(text, machine)
    assert result.data == text and not result.findings
    assert tips or olp.correct_joints(MODAL, machine).data == MODAL


def test_backlash_is_taken_up_where_an_axis_turns_round(tmp_path: Path) -> None:
    machine = machine_file(
        tmp_path, "C A Y F X Z", errors=False, calibration="[backlash]\nX_um = 20.0\nY_um = 30.0\n"
    )
    arc = Arc("C A Y F X Z", 2, turns=1.0)
    result = olp.correct_joints(arc.text(), machine)
    assert result.report["verdict"]["ok"]
    places = [place for _, _, place in Judge(machine).read(result.data.partition(b"\nG0 Z150")[0])][2:]
    points = np.array(places)[:, :2]
    way = np.diff(points, axis=0)
    # the side of each axis is that of its last motion that is more than a digit
    sides, side = [], np.zeros(2)
    for step in way:
        side = np.where(np.abs(step) > 2e-3, np.sign(step), side)
        sides.append(side)
    took_up = np.abs(way).max(axis=1) < 0.04
    table = points[1:] - 0.5 * np.array([0.02, 0.03]) * np.array(sides)
    away = np.hypot(*(table - arc.centre[:2]).T) - arc.radii[0]
    assert np.abs(away[~took_up]).max() < 2e-3
    assert 3 <= took_up.sum() <= 6


SINUMERIK = [b"I=AC(5.0) J=AC(0)", b"I5 J0", b"CR=5"]


def test_the_forms_of_sinumerik_arcs_become_the_same_straight_moves(tmp_path: Path) -> None:
    head, machine = (
        b"G90 G54\nG0 X0 Y0 Z0 A0 C0\n",
        machine_file(tmp_path, "C A Y F X Z", control="sinumerik"),
    )
    texts = [
        olp.correct_joints(head + b"G3 X10 Y0 " + form + b" F100\nM30\n", machine, tolerance_um=200.0).data
        for form in SINUMERIK
    ]
    # digits of words may differ by the last one
    moves = [[place for _, _, place in Judge(machine).read(text)] for text in texts]
    for text, places in zip(texts, moves, strict=True):
        assert not any(word in text.split(b"\n", 1)[1] for word in (b"AC", b"CR", b"I", b"J", b"(", b")"))
        assert np.array(places) == pytest.approx(np.array(moves[0]), abs=1.1e-3)


REFUSED = [
    (b"G1 X5 F100\nG43.4 H1\nG2 X0 Y0 Z0 I-2.5\n", "fanuc", 5),
    (b"G68.2 X0 Y0 Z0 I0. J20. K0.\nG53.1\nG2 X10 I5 F100\n", "fanuc", 5),
]


@pytest.mark.parametrize(("text", "control", "line"), REFUSED)
def test_arcs_that_are_not_read_are_refused(text: bytes, control: str, line: int, tmp_path: Path) -> None:
    head = b"G21 G90 G54\nG0 X0 Y0 Z0 A0 C0\n"
    with pytest.raises(olp.ProgramError) as caught:
        olp.correct_joints(head + text + b"M30\n", machine_file(tmp_path, "C A Y F X Z", control=control))
    assert caught.value.line == line
