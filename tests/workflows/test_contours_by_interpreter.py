"""Random contours under cutter compensation, nominal and corrected, judged by LinuxCNC's interpreter."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from judge import linuxcnc, machines
from judge.machines import Recipe

import olp
from olp.compensation.corners import gouging
from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.dialect import Options
from olp.program.registry import DIALECTS
from olp.program.rs274.reader import read

pytestmark = pytest.mark.oracle

RECIPE = {"work_offsets": {"G54": {"X_mm": 300.0, "Y_mm": 300.0, "Z_mm": -200.0, "set_by": "true"}}}
PLAY = {"X": 6.0, "Y": 4.0, "Z": 3.0}


def contour(seed: int) -> bytes:
    """Lines and arcs of 0.03 to 30 mm with corners of all sizes, in G17 or G18; many cannot be cut."""
    rng = np.random.default_rng(seed)
    plane = "G18" if seed % 5 == 0 else "G17"
    (a, i), (b, j), third = (("Z", "K"), ("X", "I"), "Y") if plane == "G18" else (("X", "I"), ("Y", "J"), "Z")
    side = rng.choice(["G41", "G42"])
    on = side + rng.choice(
        [" D1", " D2", "", f".1 D{rng.uniform(1, 12):.3f}", f".1 D{rng.uniform(1, 12):.3f}"]
    )
    place = rng.uniform(8, 20, 2)
    lines = [f"G21 G90 {plane} G94 G54 F1000", "G0 X0 Y0 Z10", "G1 Z0"]
    lines.append(f"{on} G1 {a}{place[0]:.3f} {b}{place[1]:.3f}")
    heading = math.atan2(place[1], place[0])
    for _ in range(rng.integers(2, 7)):
        heading += rng.choice([0, rng.normal() * 0.02, rng.normal() * 0.3, rng.uniform(-1.8, 1.8)])
        if seed % 2 and rng.random() < 0.5:
            radius, sweep = 10 ** rng.uniform(0, 1.5), rng.uniform(0.1, 2.5) * rng.choice([-1, 1])
            away = radius * np.sign(sweep) * np.array([-math.sin(heading), math.cos(heading)])
            end = math.atan2(-away[1], -away[0]) + sweep
            place = place + away + radius * np.array([math.cos(end), math.sin(end)])
            code = "G3" if sweep > 0 else "G2"
            words = f"{i}{away[0]:.5f} {j}{away[1]:.5f}"
            lines.append(f"{code} {a}{place[0]:.5f} {b}{place[1]:.5f} {words}")
            heading += sweep
        else:
            place = place + 10 ** rng.uniform(-1.5, 1.5) * np.array([math.cos(heading), math.sin(heading)])
            lines.append(f"G1 {a}{place[0]:.5f} {b}{place[1]:.5f}")
            if rng.random() < 0.2:
                lines.append(f"G1 {third}{rng.uniform(-5, 5):.2f}")
    return "\n".join([*lines, "G40 G0 X0 Y0", "G0 Z50", "M2", ""]).encode()


@pytest.mark.parametrize("block", range(4))
def test_what_the_interpreter_refuses_is_found(tmp_path: Path, block: int) -> None:
    """The rule finds more: the interpreter does not look at the end of a contour. At arcs it counts along
    their tangents, so that one contour in a hundred may be judged otherwise."""
    path = machines.zero_machine(tmp_path, Recipe(**RECIPE))
    setup = load_setup(path)
    taken, refused, missed, too_strict = 0, 0, [], 0
    for seed in range(60 * block, 60 * block + 60):
        text = contour(seed)
        found = gouging(read(text, setup, DIALECTS["linuxcnc"], Options(contour=True)).toolpath).any()
        if linuxcnc.accepts(text, path):
            taken, too_strict = taken + 1, too_strict + bool(found)
        else:
            refused += 1
            missed += [] if found else [seed]
    assert len(missed) <= 1
    assert taken > 20 and refused > 10
    assert too_strict <= 0.25 * taken


@pytest.mark.parametrize("play", [{}, PLAY])
@pytest.mark.parametrize("block", range(3))
def test_a_contour_that_was_taken_is_taken_once_corrected(
    tmp_path: Path, block: int, play: dict[str, float]
) -> None:
    path = machines.random_machine(tmp_path, block, Recipe(backlash_um=play, waves=4.0, **RECIPE))
    wrong, taken, refused = [], 0, 0
    for seed in range(50 * block, 50 * block + 50):
        nominal = contour(seed)
        if not linuxcnc.accepts(nominal, path):
            continue
        try:
            result = olp.correct(nominal, path, contour=True)
        except ProgramError as error:
            assert error.line is not None
            refused += 1
            continue
        taken += 1
        wrong += [] if linuxcnc.accepts(result.data, path) else [seed]
    assert not wrong
    assert taken > 15
    assert refused <= 4
