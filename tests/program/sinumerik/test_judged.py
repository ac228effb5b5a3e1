"""Whole jobs of plain blocks: an independent reader makes the same poses of nominal and corrected text."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast
from judge import machines, sinumerik_words
from judge.linuxcnc import CanonMoves
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import deviation

import olp
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

ORIGINS = {
    "G54": np.array([250.0, 200.0, -300.0]), "G55": np.array([300.0, 260.5, -310.0]),
    "G505": np.array([-20.0, 30.0, -250.0]), "G500": np.zeros(3),
}  # fmt: skip
LENGTHS = {1: 120.0, 2: 85.5}
RECIPE = Recipe(
    controller="sinumerik",
    increment_mm=0.0001,
    travel=((-300.0, 900.0), (-300.0, 800.0), (-500.0, 200.0)),
    tools={n: {"Z_mm": z, "name": f"MILL {n}"} for n, z in LENGTHS.items()},
    work_offsets={
        name: {"X_mm": float(x), "Y_mm": float(y), "Z_mm": float(z), "set_by": "true"}
        for name, (x, y, z) in ORIGINS.items()
        if name != "G500"
    },
)
NAMES = {f"MILL {n}": n for n in LENGTHS}
STILL = {name: np.zeros(3) for name in ORIGINS}
#: tolerance, and what rounding to 0.1 um may add
ALLOWED_UM = 1.0 + 0.2


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 11, RECIPE)


def canon(data: bytes) -> CanonMoves:
    return sinumerik_words.read(data, ORIGINS, LENGTHS, NAMES).canon()


class Job:
    """Blocks that are drawn one after the other."""

    def __init__(self, seed: int, *, holes: bool) -> None:
        self.rng = np.random.default_rng(seed)
        self.rows = ["%_N_A_MPF", "G71 G90 G17 G40 G54 G64", "T1 M6", "D1", "G0 X0 Y0 Z20"]
        self.here = [0.0, 0.0, 20.0]
        for _ in range(30):
            kinds = [self.line, self.line, self.arc, self.frame, self.incremental, self.change]
            kinds[int(self.rng.integers(6))]()
            if holes and self.rng.random() < 0.15:
                self.holes()
        self.rows += ["G0 SUPA Z0 D0", "M30"]

    def word(self, letter: str, value: float) -> str:
        value = round(float(value), 3)
        return [f"{letter}{value:.3f}", f"{letter}={value}", f"{letter}=AC({value})"][self.rng.integers(3)]

    def line(self) -> None:
        spot = [*self.rng.uniform(-60, 60, 2), self.rng.uniform(-15, 5)]
        axes = sorted(self.rng.choice(3, self.rng.integers(1, 4), replace=False).tolist())
        for axis in axes:
            self.here[axis] = round(float(spot[axis]), 3)
        words = " ".join(self.word("XYZ"[axis], self.here[axis]) for axis in axes)
        self.rows.append(f"G{self.rng.integers(2)} {words}{self.rng.choice(['', ' F500', ' M8', ' ; X9'])}")

    def arc(self) -> None:
        x, y = self.here[:2]
        radius, angle = self.rng.uniform(3, 30), self.rng.uniform(0, 6.28)
        centre = (x + radius * math.cos(angle), y + radius * math.sin(angle))
        sign, sweep = self.rng.choice([2, 3]), self.rng.uniform(0.3, 5.8)
        turn = angle + math.pi + (sweep if sign == 3 else -sweep)
        end = [centre[0] + radius * math.cos(turn), centre[1] + radius * math.sin(turn)]
        self.here[:2] = [round(v, 4) for v in end]
        words = f"X{self.here[0]:.4f} Y={self.here[1]:.4f}"
        kind = self.rng.integers(4)
        if kind == 0:
            tail = f"CR={radius if sweep < math.pi else -radius:.4f}"
        elif kind == 1:
            tail = f"I=AC({centre[0]:.4f}) J=AC({centre[1]:.4f})"
        else:
            tail = f"I{centre[0] - x:.4f} J{centre[1] - y:.4f}"
        if kind == 3:
            self.here[2] = round(self.here[2] - 3.0, 3)
            tail += f" Z{self.here[2]:.3f} TURN={self.rng.integers(1, 3)}"
        self.rows.append(f"G{sign} {words} {tail}")

    def incremental(self) -> None:
        steps = self.rng.uniform(-9, 9, (2, 2)).round(3)
        self.rows += [f"G91 G1 X{steps[0, 0]} Y=IC({steps[0, 1]})", f"X={steps[1, 0]} Y{steps[1, 1]}", "G90"]
        self.here[0] += float(steps[:, 0].sum())
        self.here[1] += float(steps[:, 1].sum())

    def frame(self) -> None:
        x, y = self.rng.uniform(-20, 20, 2).round(2)
        angle = self.rng.uniform(-180, 180)
        some = [
            "TRANS", f"TRANS X{x} Y={y}", f"TRANS X={x} Z2", f"TRANS X{x}\nATRANS Y{y}\nG58 X{y}\nTRANS",
            f"TRANS Y{y}\nATRANS X{x}\nG58 X{y} Y3\nG59 Z1", f"ROT Z{angle:.4f}",
            f"TRANS X{x}\nG59 Z1\nTRANS", f"TRANS X{x}\nAROT Z{angle:.4f}",
            f"ROT Z{angle:.4f}\nATRANS X{x} Y{y}", "MIRROR X0", f"TRANS Y{y}\nAMIRROR Y0\nAROT Z{angle:.4f}",
        ]  # fmt: skip
        self.rows += ["TRANS", *some[self.rng.integers(len(some))].split("\n")]
        self.moved()

    def change(self) -> None:
        """Another tool, edge or offset."""
        some = ["G55", "G505", "G54", 'T="MILL 2" M6', "T1\nM6", "G0 SUPA Z0 D0\nD1", "G70\nG71", "G500\nG54"]
        self.rows += some[self.rng.integers(len(some))].split("\n")
        self.moved()

    def moved(self) -> None:
        spot = self.rng.uniform(-30, 30, 2).round(3)
        self.here = [float(spot[0]), float(spot[1]), 6.0]
        self.rows.append(f"G0 X{spot[0]} Y{spot[1]} Z6")

    def holes(self) -> None:
        cycle = ["CYCLE81(9,0,2,-5)", "CYCLE82(9,1,2,,4,0.5)", "CYCLE83(8,0,1,-9,,-3)"][self.rng.integers(3)]
        places = self.rng.uniform(-40, 40, (3, 2)).round(3)
        self.rows += [f"MCALL {cycle}", *(f"G0 X{x} Y{y}" for x, y in places), "MCALL"]
        self.here = [*places[-1].tolist(), 9.0]
        self.moved()

    @property
    def text(self) -> bytes:
        return "\n".join([*self.rows, ""]).encode()


def same_poses(data: bytes, path: Path) -> None:
    own = read(data, load_setup(path), DIALECTS["sinumerik"]).toolpath
    other = np.array(canon(data).axis)
    kept = np.isfinite(own.end_mm).all(axis=1)
    mine = np.isfinite(other).all(axis=1)
    assert kept.sum() == mine.sum() > 20
    assert own.end_mm[kept] == pytest.approx(other[mine], abs=1e-6)


@pytest.mark.parametrize("seed", some_fast(range(24), 6, 3))
def test_random_jobs_follow_their_path(bent: Path, seed: int) -> None:
    data = Job(seed, holes=False).text
    same_poses(data, bent)
    result = olp.correct(data, bent)
    same_poses(result.data, bent)
    nominal, corrected = canon(data), canon(result.data)
    errors = deviation(corrected, nominal, JudgeModel(bent), shift_by_frame=STILL, kinds=("feed", "arc"))
    assert errors.before.max_um > 3
    assert errors.max_um <= ALLOWED_UM


@pytest.mark.parametrize("seed", some_fast(range(100, 124), 12, 3))
def test_jobs_with_holes_are_read_alike(bent: Path, seed: int) -> None:
    data = Job(seed, holes=True).text
    same_poses(data, bent)
    same_poses(olp.correct(data, bent).data, bent)


DRILLED = """G71 G90 G17 G40 G54 G64
T1 M6
D1
G0 X0 Y0 Z20
MCALL CYCLE82(9,0,2,-4,,0.5)
X-120 Y-90
/X-100
X130
G0 Y110 F500
MCALL
N7 MCALL CYCLE85( 9 ,1.5,2, ,4)
X-110 Y100
MCALL
X120 Y-100
N9 CYCLE81(9,0,2,-3.25)
G0 X0 Y0
ROT Z30
X80 Y10
MCALL CYCLE83(8,0,1,-4,4,-2)
X81
MCALL
TRANS
G0 X1
M30
"""


def test_holes_are_right_at_their_bottoms_and_in_the_middle_of_their_strokes(bent: Path) -> None:
    # the judge knows modal calls alone
    data = DRILLED.replace("N9 CYCLE81(9,0,2,-3.25)\n", "").encode()
    result = olp.correct(data, bent)
    nominal, corrected = canon(data), canon(result.data)
    errors = deviation(corrected, nominal, JudgeModel(bent), shift_by_frame=STILL, kinds=("feed", "arc"))
    assert errors.before.max_um > 10
    assert errors.max_um <= ALLOWED_UM
    assert result.report["deviation"]["holds"]


def test_a_deep_hole_is_right_in_its_middle(bent: Path) -> None:
    data = (DRILLED.split("MCALL")[0] + "MCALL CYCLE81(9,0,2,-80)\nX100 Y90\nMCALL\nM30\n").encode()
    corrected = canon(olp.correct(data, bent).data)
    errors = deviation(corrected, canon(data), JudgeModel(bent), shift_by_frame=STILL, kinds=("feed",))
    assert errors.before.max_um > 20
    # half of what the axis of the hole leans along its stroke; where its begin is right it is 6 um
    assert errors.max_um < 3


def test_a_call_is_written_again_with_other_levels(bent: Path) -> None:
    lines = olp.correct(DRILLED.encode(), bent).data.decode().splitlines()
    calls = {name: [line for line in lines if name in line] for name in ("CYCLE82", "CYCLE85", "CYCLE81")}
    assert len(calls["CYCLE82"]) == 5
    assert calls["CYCLE82"][0] == "MCALL CYCLE82(9,0,2,-4,,0.5)"
    for line in calls["CYCLE82"][1:]:
        found = re.fullmatch(r"MCALL CYCLE82\((\S+?),(\S+?),2,(\S+?),,0.5\)", line)
        assert found is not None
        assert float(found[1]) != 9
        assert float(found[2]) - float(found[3]) == pytest.approx(4)
        # directly before the block that goes to its hole
        assert re.match(r"/?(G0 )?[XY]-?\d", lines[lines.index(line) + 1])
    # a distance to the bottom stays; the call of one hole is changed where it is
    first, again = calls["CYCLE85"]
    assert first == "N7 MCALL CYCLE85( 9 ,1.5,2, ,4)"
    assert re.fullmatch(r"MCALL CYCLE85\( 8\.9\d+ ,1\.\d+,2, ,4\)", again)
    (alone,) = calls["CYCLE81"]
    found = re.fullmatch(r"N9 CYCLE81\(9\.\d+,(-?0\.\d+),2,(-3\.\d+)\)", alone)
    assert found is not None
    assert float(found[1]) - float(found[2]) == pytest.approx(3.25)


def test_holes_do_not_depend_on_bands_and_chunks(bent: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = DRILLED.replace("/X", "X").encode()
    whole = olp.correct(data, bent).data
    monkeypatch.setattr("olp.program.bands.SIZE", 1)
    monkeypatch.setattr("olp.compensation.writer.Writer.chunk", 1)
    assert olp.correct(data, bent).data == whole
