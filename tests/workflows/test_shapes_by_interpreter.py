"""Every shape of output is a program that LinuxCNC's interpreter takes, and it ends where it should."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.acceptance import CUTTING, judged
from cases.fast import some_of_a_campaign
from judge import linuxcnc, machines
from judge.machines import Recipe
from judge.model import JudgeModel

import olp

pytestmark = pytest.mark.oracle

HEAD = "G21 G90 G17 G94 G54 F900\nG0 X0 Y0 Z10\n"
PLAY = {"X": 6.0, "Y": 4.0, "Z": 5.0}
#: half the diagonal of a cube of the last digit, in um, and what the judge's arithmetic may add
CORNER_UM = 0.87
SLACK_UM = 0.02
TOLERANCE_UM = 1.0
SEEDS = range(3)


@dataclass(frozen=True)
class Shape:
    """A program by its seed, what the machine has, and what `correct` is told. `contour`: the control offsets
    the path, so that only its acceptance is judged."""

    text: Callable[[np.random.Generator], str]
    recipe: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    inserts: bool = False


def at(rng: np.random.Generator, low: float, high: float) -> str:
    return f"{rng.uniform(low, high):.3f}"


def rectangle(rng: np.random.Generator, on: str, off: str = "G40 G0 X0 Y0") -> str:
    """A rectangle with rounded corners, either way round, with a plunge and a slanted side."""
    x, y = rng.uniform(60, 160), rng.uniform(60, 120)
    return (
        f"{on} G1 X20 Y20\nX{x:.3f}\nG3 X{x + 10:.3f} Y30 J10\nG1 Y{y:.3f}\nZ-3\n"
        f"X{x - 25:.3f} Y{y + 9:.3f}\nG2 X{x - 45:.3f} R15\nG1 X20 Y{y:.3f}\nY20\nX40\n{off}\nG0 Z40\n"
    )


def reversals(rng: np.random.Generator) -> str:
    return "".join(f"G1 X{at(rng, -100, 100)} Y{at(rng, -100, 100)} Z{at(rng, -20, 20)}\n" for _ in range(12))


def before_arcs(rng: np.random.Generator) -> str:
    r = rng.uniform(8, 40)
    return (
        f"G1 X50 Y10\nX{50 - r:.3f}\nG3 X{50 - r:.3f} Y{10 + 2 * r:.3f} J{r:.3f}\nG2 I{r:.3f} J{r / 3:.3f}\n"
        f"G1 X0\nG19 G2 Y{10 + 2 * r:.3f} K{r:.3f} X4\nG17 G1 X-20 Y-20\nG2 X20 R50\n"
    )


def inverse_time(rng: np.random.Generator) -> str:
    return "G93\n" + "".join(
        f"G1 X{at(rng, -150, 150)} Y{at(rng, -150, 150)} F{at(rng, 1, 9)}\n" for _ in range(6)
    ) + "G94 F600\n"  # fmt: skip


def incremental(rng: np.random.Generator) -> str:
    steps = "".join(f"X{at(rng, -60, 60)} Y{at(rng, -60, 60)}\n" for _ in range(10))
    return f"G91\nG1 {steps}G2 X10 Y0 I5 J0\nG3 I7\nX0 Y-12 J-6\nG90 G0 X0 Y0\n"


def holes(rng: np.random.Generator) -> str:
    series = "".join(f"X{at(rng, -90, 90)} Y{at(rng, -90, 90)}\n" for _ in range(3))
    cycle = rng.choice(["G81", "G82 P0.1", "G83 Q4", "G73 Q4", "G85", "G89 P0.1"])
    return (
        f"G98 {cycle} Z-15 R2 X5 Y5\n{series}G99 X1 Y1\n{series}Z-12 X33\nG80\nG0 Z10\n"
        f"G91 G81 X12 Y-3 Z-9 R-6 L3\nG90 G80\nG0 Z20\nG18 G81 X4 Y-6 Z4 R3\nX9\nG80 G17\n"
    )


def helices(rng: np.random.Generator) -> str:
    r, z = rng.uniform(5, 30), rng.uniform(2, 12)
    return (
        f"G1 X0 Y0\nG3 X0 Y0 Z{10 - z:.3f} I{r:.3f}\nG2 Z10 I{r:.3f} J2 P3\nG3 X{2 * r:.3f} Y0 Z4 I{r:.3f}\n"
        f"G18 G2 Y3 I{-r:.3f} K1\nG19 G3 X9 J{r:.3f}\nG17\n"
    )


def threads(rng: np.random.Generator) -> str:
    """Threads of whole turns in every plane, both ways, with P and without, and in G91; and nearly whole
    ones."""
    r, lead = rng.uniform(2, 40), rng.uniform(0.5, 12)
    turns = f"G3 X0 Y0 Z{10 - lead:.3f} I{r:.3f}\nG2 X0 Y0 Z10 I{r:.3f} J-{r / 2:.3f}\nG3 Z2 I{r:.3f} P4\n"
    counted = f"G91\nG3 Z{lead:.3f} I{r:.3f}\nX0 Y0 Z{lead:.3f} I{r:.3f}\nG2 Z-{lead:.3f} J{r:.3f} P3\nG90\n"
    others = f"G18 G3 Y{lead:.3f} K{r:.3f}\nG2 Y0 I{r:.3f} K1 P2\nG19 G3 X{lead:.3f} J{r:.3f}\nG17\n"
    nearly = f"G1 X0 Y0 Z5\nG3 X0 Y-0.002 Z2 I{r:.3f}\nG2 X0 Y0 Z5 I{r:.3f}\n"
    return turns + counted + others + nearly


def deleted(rng: np.random.Generator) -> str:
    return (
        f"G1 X{at(rng, 50, 90)} Y5 Z1\n/G1 X90 Y{at(rng, 5, 9)} Z2\n/X-150 Y-150\nG1 X4 Y4 Z4\n"
        f"/G2 X8 Y4 Z4 I2\nG1 X0 Y0 Z0\n"
    )


def inches(rng: np.random.Generator) -> str:
    return (
        f"G20 F30\nG1 X{at(rng, 1, 5)} Y{at(rng, 1, 3)}\nX-5.1 Y-3.2\nG2 X-4.1 Y-3.2 I.5\n"
        "G81 X1 Y1 Z-.5 R.1\nX2\nG80\nG21 F600\nG1 X5 Y5\n"
    )


def numbered(rng: np.random.Generator) -> str:
    lines = [f"X{at(rng, -150, 150)} Y{at(rng, -150, 150)}" for _ in range(5)]
    blocks = "".join(f"N{10 * i + 10} G1 {words}\n" for i, words in enumerate(lines))
    flow = "o100 if [1 EQ 1]\nN90 G1 X80 Y-90\no100 endif\no7 repeat [2]\nN99 G91 X-9 Y3\nG90\no7 endrepeat\n"
    return blocks + flow


def crossings(rng: np.random.Generator) -> str:
    return reversals(rng) + before_arcs(rng) + "G61\n" + reversals(rng) + "M1\nG4 P.1\nG1 X9 Y9 M9\n"


CONTOUR = {"contour": "contour"}
SHAPES = {
    "contour by tool number": Shape(lambda r: rectangle(r, "G41 D1"), {}, CONTOUR),
    "contour by spindle tool": Shape(lambda r: rectangle(r, "G42"), {}, CONTOUR),
    "contour by diameter": Shape(lambda r: rectangle(r, "G42.1 D7.5"), {}, CONTOUR),
    "contour left by Z": Shape(lambda r: rectangle(r, "G41 D2", "G40\nG0 Z30\nX0\nY0"), {}, CONTOUR),
    "contour with backlash": Shape(lambda r: rectangle(r, "G41 D1"), {"backlash_um": PLAY}, CONTOUR),
    "contour outside with backlash": Shape(lambda r: rectangle(r, "G42 D2"), {"backlash_um": PLAY}, CONTOUR),
    "contour on a bent machine": Shape(
        lambda r: rectangle(r, "G41 D2") + rectangle(r, "G42 D2"),
        {"waves": 8.0, "peak_um": (200.0, 400.0), "backlash_um": PLAY},
        CONTOUR,
    ),
    "reversals": Shape(reversals, {"backlash_um": PLAY}, {}, True),
    "reversals before arcs": Shape(before_arcs, {"backlash_um": PLAY}, {}, True),
    "reversals in G91": Shape(incremental, {"backlash_um": PLAY}, {}, True),
    "reversals in G93": Shape(inverse_time, {"backlash_um": PLAY, "waves": 6.0}, {}, True),
    "directions": Shape(crossings, {"directed": "XYZ"}, {}, True),
    "bent lines and arcs": Shape(crossings, {"waves": 6.0}, {}, True),
    "bent G93": Shape(inverse_time, {"waves": 6.0}, {}, True),
    "bent G91": Shape(incremental, {"waves": 6.0}, {}, True),
    "helices": Shape(helices),
    "helices with backlash": Shape(helices, {"backlash_um": PLAY}, {}, True),
    "threads": Shape(threads, {"increment_mm": 0.0001, "peak_um": (5.0, 10.0), "waves": 0.3}, {}, True),
    "threads in coarse digits": Shape(threads, {}, {}, True),
    "threads with backlash": Shape(threads, {"backlash_um": PLAY}, {}, True),
    "holes": Shape(holes),
    "holes with backlash": Shape(holes, {"backlash_um": PLAY}),
    "holes expanded": Shape(holes, {}, {"expand_cycles": True}),
    "block delete": Shape(deleted),
    "inches": Shape(inches, {"backlash_um": PLAY}),
    "numbers and O-words": Shape(numbered, {"waves": 6.0}, {"flatten": True}, True),
    "rapids split": Shape(
        lambda r: reversals(r).replace("G1", "G0"), {"waves": 6.0}, {"split_rapids": True}, True
    ),
}  # fmt: skip
ENDS = {"lf": b"\n", "crlf": b"\r\n", "crcrlf": b"\r\r\n"}


def machine(folder: Path, seed: int, shape: Shape) -> Path:
    return machines.random_machine(folder, seed, Recipe(**shape.recipe))


@pytest.mark.parametrize("seed", some_of_a_campaign(SEEDS, 3))
@pytest.mark.parametrize("name", SHAPES)
def test_the_interpreter_takes_every_shape(tmp_path: Path, name: str, seed: int) -> None:
    shape = SHAPES[name]
    path = machine(tmp_path, seed, shape)
    nominal = (HEAD + shape.text(np.random.default_rng(seed)) + "M2\n").encode()
    moves = linuxcnc.interpret(nominal, path, find_known=False)
    result = olp.correct(nominal, path, **shape.options)
    written = linuxcnc.interpret(result.data, path, find_known=False)
    assert written.ended
    if shape.inserts:
        assert result.report["moves"]["inserted_blocks"] > 0
    if "hole" in name:
        assert end_um(path, moves, written).max() <= allowed_um(nominal, shape)
    elif not shape.options.get("contour"):
        kinds = linuxcnc.KINDS if "split_rapids" in shape.options else CUTTING
        verdict = judged(linear(nominal, path, shape), result.data, tmp_path, kinds=kinds)
        assert verdict.after.judged > 0
        assert verdict.vertex_max_um <= allowed_um(nominal, shape)
    elif len(written) == len(moves):
        # the control puts the contour of a corrected program where the nominal one is, but for the change of
        # the error over the cutter radius
        assert end_um(path, moves, written).max() <= allowed_um(nominal, shape) + 5.0


@pytest.mark.parametrize("end", ENDS)
def test_line_ends_stay_and_are_taken(tmp_path: Path, end: str) -> None:
    shape = SHAPES["bent lines and arcs"]
    path = machine(tmp_path, 1, shape)
    nominal = (HEAD + shape.text(np.random.default_rng(1)) + "M2\n").encode().replace(b"\n", ENDS[end])
    data = olp.correct(nominal, path).data
    assert data.count(ENDS[end]) == data.count(b"\n")
    assert data.count(b"\r") == data.count(b"\n") * ENDS[end].count(b"\r")
    assert linuxcnc.interpret(data, path, find_known=False).ended


def linear(nominal: bytes, path: Path, shape: Shape) -> bytes:
    """The program as the correction reads it."""
    return olp.flatten(nominal, path) if "flatten" in shape.options else nominal


def end_um(path: Path, moves: linuxcnc.CanonMoves, written: linuxcnc.CanonMoves) -> np.ndarray:
    """(n,) how far moves end from where the nominal program commands them; of programs with other moves only
    the last one."""
    a, b = moves.axis, written.axis
    if len(a) != len(b):
        a, b = a[-1:], b[-1:]
    model = JudgeModel(path)
    return np.asarray(np.linalg.norm(b + model.error_mm(b, model.tool_vector_mm(1)) - a, axis=1) * 1e3)


def allowed_um(nominal: bytes, shape: Shape) -> float:
    """Tolerance and the last digit; half of the backlash, whose side the judge does not follow."""
    play = list(shape.recipe.get("backlash_um", {}).values()) or (
        [4.0] * 3 if "directed" in shape.recipe else []
    )
    return TOLERANCE_UM + CORNER_UM + SLACK_UM + float(np.linalg.norm(play)) / 2
