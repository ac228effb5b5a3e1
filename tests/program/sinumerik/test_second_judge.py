"""Parametric programs unrolled, beside the interpreter of another house: nc-gcode-interpreter.

The extra `judges` has it; without it the test is skipped. It reads definitions, arrays, FOR, IF and IC. It
does not know G91, that `*` binds closer than `+`, and what IC counts behind TRANS: the other judge does.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read
from olp.program.sinumerik.flatten.unroll import flatten

interpreter = pytest.importorskip("nc_gcode_interpreter")
SINUMERIK = DIALECTS["sinumerik"]
NAMES = ("AA", "BB", "CC", "DD[0]", "DD[1]", "R[1]", "R[2]")


def random_program(rng: np.random.Generator) -> str:
    """Blocks and structures inside one another; loops end."""
    rows = ["DEF REAL AA=2.5, BB=-1.25, CC=4", "DEF REAL DD[2]", "DEF INT KK, LL", "DD[0]=3", "DD[1]=-7"]
    rows += ["R[1]=6", "R[2]=0.5"]

    def number() -> str:
        return str(rng.choice([*NAMES, str(rng.integers(1, 99) / 8)]))

    def value() -> str:
        first, other, third = number(), number(), number()
        shapes = [
            f"{first}{'+-*'[rng.integers(3)]}{other}",
            f"({first}-{other})*{third}",
            f"{first}-{other}-{third}",
            f"{first}+({other}*{third})",
            f"{first}/4",
            first,
        ]
        return shapes[rng.integers(len(shapes))]

    def block(depth: int) -> None:
        for _ in range(rng.integers(1, 5)):
            kind = rng.integers(8)
            if kind < 3:
                axis = "XYZ"[rng.integers(3)]
                rows.append(f"{axis}={[value(), f'IC({value()})'][rng.integers(2)]}")
            elif kind == 3:
                rows.append(f"{rng.choice(NAMES)}={number()}{'+-'[rng.integers(2)]}({rng.integers(1, 9)}/4)")
            elif depth > 1:
                rows.append(f"X={value()} Y={value()}")
            elif kind < 6:
                test = f"{number()}{rng.choice(['>', '<', '>=', '<='])}{number()}"
                rows.append(f"IF ({test})")
                block(depth + 1)
                rows.append("ELSE")
                block(depth + 1)
                rows.append("ENDIF")
            else:
                name = "KL"[depth] * 2
                rows.append(f"FOR {name}=1 TO {rng.integers(1, 4)}")
                block(depth + 1)
                rows.append("ENDFOR")

    rows += ["G0 X0 Y0 Z0", "G1 X1"]
    block(0)
    block(0)
    return "\n".join([*rows, "G1 X0 Y0 Z0", ""])


@pytest.mark.parametrize("seed", range(30))
def test_random_programs_end_their_blocks_alike(seed: int, tmp_path: Path) -> None:
    text = random_program(np.random.default_rng(seed))
    frame, _ = interpreter.nc_to_dataframe(text)
    setup = load_setup(machine(tmp_path, tables=TRUE_ZERO, controller="sinumerik"))
    own = read(flatten(f"G71 G90 G54\n{text}".encode(), SINUMERIK), setup, SINUMERIK).toolpath.end_mm
    theirs = np.array(frame.select(["X", "Y", "Z"]).rows(), float)
    theirs = theirs[~np.isnan(theirs).all(axis=1)]
    assert own == pytest.approx(theirs, abs=1e-6)
