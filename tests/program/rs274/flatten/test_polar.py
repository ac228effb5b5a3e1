"""G16: radius and angle about program zero are written as X and Y."""

from __future__ import annotations

import math
import random
import re
from pathlib import Path

import numpy as np
import pytest
from cases.unrolling import fanuc, refusal
from judge.machines import Recipe, random_machine

import olp

HEAD = "O1\nG21 G17 G90\nG0 X0. Y0. Z9.\n"


def unrolled(body: str) -> str:
    return fanuc(f"{HEAD}{body}M30\n").removeprefix(HEAD).removesuffix("M30\n")


def test_positions_of_holes_about_zero() -> None:
    body = "G16\nG81 X50. Y0. Z-3. R1. F9.\nY60.\nY180.\nG80\nG15\nX1. Y2.\n"
    assert unrolled(body) == "\nG81 X50. Y0.  Z-3. R1. F9.\nX25. Y43.3013\nX-50. Y0.\nG80\n\nX1. Y2.\n"


def test_moves_that_state_no_position_and_dwells_stay() -> None:
    assert unrolled("G16\nG1 X10. Y90. F9.\nZ-1.\nG4 X1.\nY0. Z0.\nG15\n") == (
        "\nG1 X0. Y10.  F9.\nZ-1.\nG4 X1.\nX10. Y0. Z0.\n\n"
    )


@pytest.mark.parametrize("seed", range(5))
def test_angles_in_g91_count_from_the_one_before(seed: int) -> None:
    """The written increments add up to the positions of the angles, to rounding of one step."""
    rng = random.Random(seed)
    radius, angle = round(rng.uniform(5, 90), 3), round(rng.uniform(-180, 180), 3)
    steps = [round(rng.uniform(-200, 200), 3) for _ in range(12)]
    lines = "".join(f"Y{step:.3f}\n" for step in steps)
    text = unrolled(f"G16\nG1 X{radius:.3f} Y{angle:.3f} F9.\nG91\n{lines}G90\nG15\n")
    words = [(float(x), float(y)) for x, y in re.findall(r"X(-?[\d.]+) Y(-?[\d.]+)", text)]
    x, y = words[0]
    for step, (dx, dy) in zip(steps, words[1:], strict=True):
        angle += step
        x, y = x + dx, y + dy
        assert x == pytest.approx(radius * math.cos(math.radians(angle)), abs=5.1e-5)
        assert y == pytest.approx(radius * math.sin(math.radians(angle)), abs=5.1e-5)


@pytest.mark.parametrize(
    ("body", "code", "line", "message"),
    [
        ("G91\nG16\n", "OLP518", 5, "G16 in G91 takes the present position as its centre"),
        ("G18\nG16\n", "OLP518", 5, "G17 only"),
        ("G16 X5. Y1.\n", "OLP518", 4, "put G16 into a block of its own"),
        ("G16\nX5.\n", "OLP516", 5, "no radius or no angle"),
        ("G16\nX50 Y1.\n", "OLP515", 5, "X has no decimal point"),
        ("G16\nX5. Y0.\nG91\nX1.\n", "OLP518", 7, "a radius in G91"),
        ("G16\nX5. Y0.\nG53 X0.\n", "OLP518", 6, "no polar positions"),
    ],
)
def test_what_is_not_certain_is_refused(body: str, code: str, line: int, message: str) -> None:
    error = refusal(f"{HEAD}{body}G15\nM30\n", "fanuc")
    assert (error.code, error.line) == (code, line)
    assert message in str(error)


def test_a_program_with_polar_positions_is_corrected_where_it_is_unrolled(tmp_path: Path) -> None:
    """The corrected program moves where a program of the same positions in X and Y does."""
    machine = random_machine(tmp_path, 3, Recipe())
    machine.write_text(machine.read_text().replace('controller = "linuxcnc"', 'controller = "fanuc"'))
    head = "G21 G17 G90 G54\nT1 M6\nG0 X0. Y0. Z50.\nG43 H1 Z20.\n"
    polar = f"{head}G16\nG1 X40. Y30. F500\nY120.\nX20. Z5.\nG15\nM30\n"
    plain = f"{head}G1 X34.641 Y20. F500\nX-20. Y34.641\nX-10. Y17.3205 Z5.\nM30\n"
    done = olp.correct(polar.encode(), machine, flatten=True)
    assert b"G16" not in olp.correct(polar.encode(), machine).data
    assert olp.correct(polar.encode(), machine).data == done.data
    assert done.report["verdict"]["ok"]
    like = olp.correct(plain.encode(), machine)
    ends = [olp.simulate(some.data, machine, step_mm=1e4).points_mm for some in (done, like)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1.1e-3)
