"""G5 to G5.3 as chords, and `@` and `^` as X and Y: by hand, by laws, and by LinuxCNC's interpreter."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import machine
from cases.unrolling import flatten, lcnc, refused
from judge import linuxcnc

from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read
from olp.program.rs274.flatten.splines import CHORD_MM, at, chords

HEAD = "G21 G90 G17 G94 F100\nG0 X1 Y2 Z3\n"


def test_a_cubic_is_the_polynomial_of_bernstein() -> None:
    points = np.random.default_rng(1).normal(size=(4, 2))
    t = np.linspace(0, 1, 9)[:, None]
    share = [math.comb(3, k) * t**k * (1 - t) ** (3 - k) for k in range(4)]
    by_hand = sum(s * p for s, p in zip(share, points, strict=True))
    np.testing.assert_allclose(at(points, np.ones(4), 4, t[:, 0]), by_hand, atol=1e-12)


def test_a_weight_makes_a_quarter_of_a_circle() -> None:
    points = np.array([[5.0, 0.0], [5.0, 5.0], [0.0, 5.0]])
    weights = np.array([1.0, math.sqrt(0.5), 1.0])
    on = at(points, weights, 3, np.linspace(0, 1, 30))
    np.testing.assert_allclose(np.hypot(*on.T), 5.0, atol=1e-12)
    ends = chords(points, weights, 3, CHORD_MM)
    middle = (ends[1:] + ends[:-1]) / 2
    assert 5.0 - np.hypot(*middle.T).min() == pytest.approx(CHORD_MM, rel=0.8)
    assert np.hypot(*middle.T).min() > 5.0 - CHORD_MM


def test_the_sum_of_splines_is_the_spline_of_the_sum() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 7, 2))
    weights, where = np.ones(7), np.linspace(0, 4, 23)
    np.testing.assert_allclose(
        at(a + b, weights, 4, where), at(a, weights, 4, where) + at(b, weights, 4, where), atol=1e-12
    )


SPLINES = {
    "cubic": "G5 I1 J2 P-1 Q2 X10 Y2 (c)",
    "cubics that go on": "G5 I1 J2 P-1 Q2 X10 Y2\nG5 P-1 Q2 X20 Y2 F30\nG1 X4",
    "cubic, one axis": "G5 I1 J1 P-1 Q2 X10",
    "distances": "G91 G5 I1 J2 P-1 Q2 X10 Y2\nG1 X5",
    "quadratic": "N3 M3 S50 G5.1 I1 J2 X10 Y2\nG0 Z9",
    "quadratic to an angle": "G5.1 I1 J2 @10 ^30",
    "inches": "G20 G0 X1 Y1\nG5.1 I.1 J.2 X1 Y.2",
    "expressions": "#1=2\no1 repeat [3]\nG5.1 I[#1] J-#1 X[#1 * 4] Y1\n#1=[#1 + 2]\no1 endrepeat",
    "NURBS": "G5.2 P1 L3 X2 Y5\nX5 Y5 P1\nX6 Y2 P2\nX9 Y3 P1\nG5.3",
    "NURBS of order 4": "G5.2 P1 L4 X2 Y5\nX5 Y5 P1\nX6 Y2 P2\nX9 Y3 P1\nX12 Y-4 P.5\nG5.3\nG0 X0",
    "NURBS, first weight": "G5.2 P3\nX2 Y5 P1\nX7 Y6 P1\nX9 Y1 P1\nG5.3",
    "NURBS, distances": "G91\nG5.2 P1 L3 X2 Y5\nX5 Y5 P1\nX6 Y2 P2\nX9 Y3 P1\nG5.3\nG1 X1",
}
POLAR = {
    "radius and angle": "G0 @5 ^30",
    "radius": "G1 @5 Z1",
    "angle": "G0 ^90",
    "distances": "G91 G1 @1 ^10\n@2 ^4 Z1",
    "arc": "G2 ^90 R3",
    "other plane": "G18 G0 @5 ^10",
    "holes": "G98 G81 @5 ^30 R4 Z-2\n^60\n^90",
    "a row of holes": "G91 G81 @1 R1 Z-2 L3\nG90 G0 X4",
    "holes on a circle": "G91 G98 G81 ^30 R1 Z-2 L3\nG90 G80\nG0 X4",
    "a spiral": "o100 repeat [40]\nG91 G1 @-.0025 ^4.5\no100 endrepeat\nG90 X0",
}


def path(data: bytes) -> np.ndarray:
    moves = linuxcnc.interpret(data, find_known=False)
    return np.vstack([moves.start, moves.tip])


def off_um(points: np.ndarray, line: np.ndarray) -> float:
    """The largest distance of points (n, 3) from a line of points (m, 3)."""
    a, b = line[:-1], line[1:]
    way = b - a
    away = points[:, None] - a[None]
    share = np.clip((away * way).sum(2) / np.maximum((way**2).sum(1), 1e-30), 0, 1)
    return 1000.0 * float(np.sqrt(((away - share[..., None] * way) ** 2).sum(2)).min(1).max())


@pytest.mark.oracle
@pytest.mark.parametrize("name", SPLINES)
def test_the_interpreter_is_on_the_chords(name: str) -> None:
    """Its own chords are coarser, with their ends on the curve."""
    linuxcnc.require()
    source = f"{HEAD}{SPLINES[name]}\nM2\n".encode()
    here, there = path(source), path(flatten(source, profile="linuxcnc"))
    assert off_um(here, there) < 1000 * CHORD_MM
    np.testing.assert_allclose(here[-1], there[-1], atol=1e-8)


@pytest.mark.oracle
@pytest.mark.parametrize("expand", [False, True])
@pytest.mark.parametrize("name", POLAR)
def test_the_interpreter_goes_to_the_same_positions(name: str, *, expand: bool) -> None:
    linuxcnc.require()
    source = f"{HEAD}{POLAR[name]}\nM2\n".encode()
    here, there = path(source), path(flatten(source, profile="linuxcnc", expand_cycles=expand))
    assert off_um(here, there) < 1e-5
    assert off_um(there, here) < 1e-5
    np.testing.assert_allclose(here[-1], there[-1], atol=1e-8)


def test_polar_words_are_written_as_x_and_y() -> None:
    assert lcnc("G21 G90\nG0 X3 Y4 Z1\nG1 ^0 F9 (c)\n@2 Z0\nG91 ^90\nM2\n") == (
        "G21 G90\nG0 X3 Y4 Z1\nG1 X5 Y0 F9 (c)\nX2 Y0 Z0\nG91 X-2 Y2\nM2\n"
    )


def test_a_spline_leaves_its_other_words_in_front() -> None:
    text = lcnc(f"{HEAD}N7 G91 M3 S9 G5.1 I5 J0 X5 Y5 F20 (curve)\nM2\n").splitlines()
    assert text[2] == "N7 G91 M3 S9 F20 (curve)"
    assert text[3] == "G90"
    assert text[-2:] == ["G91", "M2"]
    assert text[-3] == "G1 X6 Y7"
    assert all(re.fullmatch(r"G1 X[\d.]+ Y[\d.]+", block) for block in text[4:-2])


@pytest.mark.parametrize(
    ("body", "code", "line", "why"),
    [
        ("G5.1 I1 X9 Y9", "OLP516", 3, "G5.1 needs I and J"),
        ("G5 P1 Q1 X9 Y9", "OLP516", 3, "does not go on another G5 needs I and J"),
        ("G5 I1 J1 P1 Q1 X9 Y9\nG1 X0\nG5 P1 Q1 X9 Y9", "OLP516", 5, "needs I and J"),
        ("G5 I1 J1 P1 X9 Y9", "OLP516", 3, "G5 needs P and Q"),
        ("G18 G5.1 I1 J1 X9", "OLP518", 3, "G17"),
        ("G93 G5.1 I1 J1 X9 F2", "OLP518", 3, "G93"),
        ("G41.1 D1\nG5.1 I1 J1 X9", "OLP518", 4, "G40"),
        ("G5.1 I1 J1 X9 Z4", "OLP516", 3, "has Z"),
        ("G5.1 I1 J1 X9 M30", "OLP518", 3, "own block"),
        ("G5.1 I1 J1 X9\nY3", "OLP517", 4, "states no motion code"),
        ("G5.3", "OLP532", 3, "no G5.2 begins"),
        ("G5.2 X5 Y5 P1\nG5.3", "OLP516", 4, "expected 3 or more"),
        ("G5.2 X5 Y5", "OLP516", 3, "no weight"),
        ("G5.2 X5 P1", "OLP516", 3, "needs X and Y"),
        ("G5.2 X5 Y5 P0", "OLP516", 3, "more than 0"),
        ("G5.2 X5 Y5 P1\nG1 X4", "OLP518", 4, "G5.3"),
        ("G5.2 X5 Y5 P1\nG5.1 I1 J1 X4", "OLP518", 4, "G5.3"),
        ("G5.2 X5 Y5 P1\nX6 Y2 P1\nG5.3 X1", "OLP516", 5, "no words"),
        ("G55\nG5.1 I1 J1 X9", "OLP524", 4, "the position of X is needed"),
        ("G0 X1 ^10", "OLP515", 3, "in one way"),
        ("G92 @1 ^10", "OLP516", 3, "has none"),
        ("G53 G0 @1 ^10", "OLP516", 3, "has none"),
        ("G41.1 D1\nG1 @1 ^10", "OLP518", 4, "cutter compensation"),
        ("G0 X0 Y0\nG91 G0 @1", "OLP518", 4, "no angle"),
        ("G55\nG0 ^9", "OLP524", 4, "the position of X is needed"),
    ],
)  # fmt: skip
def test_what_is_refused(body: str, code: str, line: int, why: str) -> None:
    found, message, where = refused(f"{HEAD}{body}\nM2\n")
    assert (found, where) == (code, line)
    assert why in message


@pytest.mark.parametrize("body", ["G5.1 I1 J2 X10 Y2", "G0 @5 ^30"])
def test_without_unrolling_the_way_on_is_named(body: str, tmp_path: Path) -> None:
    setup = load_setup(machine(tmp_path))
    with pytest.raises(ProgramError, match="--flatten") as caught:
        read(f"{HEAD}{body}\nM2\n".encode(), setup, DIALECTS["linuxcnc"])
    assert (caught.value.code, caught.value.line) == ("OLP511", 3)


@pytest.mark.parametrize("count", (0, -1))
def test_a_row_of_holes_in_radius_and_angle_has_one_at_least(count: int) -> None:
    text = f"G21 G17 G90\nG0 X0 Y0 Z9\nG91 G98 G81 R-1 Z-2 ^30 L{count} F9\nG80\nM2\n"
    assert refused(text, "linuxcnc") == (
        "OLP516",
        f"a cycle is repeated {count} times; expected one or more",
        3,
    )
