"""Helices stay helices within tolerance in all three planes, also where a correction changes their sweep."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast
from judge import machines
from judge.machines import CHAINS, Recipe

import olp

PLANES = {"G17": (0, 1, 2), "G18": (0, 2, 1), "G19": (1, 2, 0)}


def helix(rng: np.random.Generator, plane: str) -> str:
    """One helix in G91 with its entry, of up to nine turns: whole ones state no end in the plane."""
    first, second, third = PLANES[plane]
    radius, angle = rng.uniform(5.0, 40.0), rng.uniform(0.0, 2 * math.pi)
    centre = radius * np.array([math.cos(angle), math.sin(angle)])
    words = [f"{'XYZ'[third]}{rng.uniform(-30.0, 30.0):.4f}"]
    if rng.random() < 0.6:
        turned = angle + rng.uniform(0.5, 5.5)
        end = centre - radius * np.array([math.cos(turned), math.sin(turned)])
        words += [f"{'XYZ'[axis]}{value:.4f}" for axis, value in zip((first, second), end, strict=True)]
    words += [f"{'IJK'[axis]}{value:.4f}" for axis, value in zip((first, second), centre, strict=True)]
    if rng.random() < 0.5:
        words.append(f"P{rng.integers(2, 10)}")
    place = " ".join(f"{a}{v:.3f}" for a, v in zip("XYZ", rng.uniform(-60.0, 60.0, 3), strict=True))
    return f"G17 G90 G1 {place}\n{plane} G91 {rng.choice(['G2', 'G3'])} {' '.join(words)}\n"


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("seed", some_fast(range(16), 8, 3))
def test_random_helices_end_within_tolerance(tmp_path: Path, plane: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    recipe = Recipe(
        chain=str(rng.choice(CHAINS)), increment_mm=0.0001, off_datum=True, waves=3.0,
        travel=((-300.0, 300.0), (-250.0, 250.0), (-250.0, 250.0)),
        work_offsets={"G54": {"X_mm": 0.0, "set_by": "true"}}, tools={1: {"Z_mm": 60.0}},
    )  # fmt: skip
    machine = machines.random_machine(tmp_path, seed, recipe)
    text = "G21 G90 G17 G94 G54 F1500\nG0 X0 Y0 Z0\n" + "".join(helix(rng, plane) for _ in range(12)) + "M2\n"
    report = olp.correct(text.encode(), machine).report
    assert report["deviation"]["path_max_um"] <= 1.0 + 0.87 * 0.1


@pytest.mark.parametrize("seed", some_fast((16, 19, *range(8)), 5))
def test_turns_about_a_pole_end_within_tolerance(tmp_path: Path, seed: int) -> None:
    """CP of Heidenhain keeps its radius, so that a helix of nearly a turn cannot end where it should."""
    rng = np.random.default_rng(seed)
    recipe = Recipe(
        chain=str(rng.choice(CHAINS)), controller="heidenhain", increment_mm=0.0001, waves=6.0,
        off_datum=True, travel=((-300.0, 300.0), (-250.0, 250.0), (-250.0, 250.0)),
        work_offsets={"G54": {"X_mm": 0.0, "set_by": "true"}}, tools={1: {"Z_mm": 60.0}},
    )  # fmt: skip
    machine = machines.random_machine(tmp_path, seed, recipe)
    lines = ["BEGIN PGM A MM", "TOOL CALL 1 Z S1000", "L X+0 Y+0 Z+0 R0 FMAX"]
    for _ in range(12):
        x, y, z = rng.uniform(-60.0, 60.0, 3)
        size = rng.choice([4.0, 30.0])
        turn = rng.choice([rng.uniform(330.0, 390.0), rng.uniform(20.0, 1500.0)])
        way = rng.choice(["+", "-"])
        lines += [
            f"L X{x:+.3f} Y{y:+.3f} Z{z:+.3f} F1500",
            f"CC X{x + rng.uniform(0.5, size):+.3f} Y{y + rng.uniform(-size, size):+.3f}",
            f"CP IPA{way}{turn:.3f} IZ{rng.uniform(-25.0, 25.0):+.3f} DR{way}",
        ]
    report = olp.correct("\n".join([*lines, "M30", "END PGM A MM\n"]).encode(), machine).report
    assert report["deviation"]["path_max_um"] <= 1.0 + 0.87 * 0.1
