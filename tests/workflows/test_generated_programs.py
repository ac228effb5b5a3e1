"""The programs of `programs/generate.py` are corrected on the machine that they are made for."""

from __future__ import annotations

import runpy
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

import olp

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
MAKE = runpy.run_path(str(PROGRAMS / "generate.py"))


@pytest.mark.parametrize("kind", ["raster", "contour", "holes", "steps"])
def test_a_generated_program_is_corrected_and_proved(kind: str) -> None:
    text = "\n".join(chain(MAKE["START"], MAKE[kind](400), MAKE["END"])) + "\n"
    done = olp.correct(text.encode(), PROGRAMS / "gantry-plate" / "machine.toml")
    assert done.report["verdict"]["numerical"]["holds"]


def test_three_points_of_a_circle_give_its_centre() -> None:
    middle = 3 - 2j
    p, q, r = (middle + 5 * np.exp(1j * angle) for angle in (0.1, 1.7, -2.0))
    assert abs(MAKE["centre"](p, q, r) - middle) < 1e-12
