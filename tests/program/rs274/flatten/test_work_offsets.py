"""Variables that have the work offsets (#5221 and on), from the job and from G10 of the program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.unrolling import fanuc, flatten, refused
from judge import linuxcnc, machines
from judge.machines import Recipe

import olp
from olp.core.machine import Setup
from olp.files.config import load_setup

OFFSETS = {
    "G54": {"X_mm": 12.5, "Y_mm": -3.0, "Z_mm": -20.0, "set_by": "true"},
    "G59.3": {"X_mm": 7.0, "Y_mm": 8.0, "set_by": "true"},
}


def of(folder: Path, control: str = "linuxcnc") -> Setup:
    return load_setup(machines.zero_machine(folder, Recipe(controller=control, work_offsets=OFFSETS)), None)


@pytest.mark.oracle
def test_the_interpreter_has_the_same_offsets(tmp_path: Path) -> None:
    text = (
        b"G21 G90 G17 G54\nG0 X0 Y0 Z5\nG10 L2 P2 X[#5221+100] Y#5222 Z#5223\nG55 G0 X1 Y2 Z3\n"
        b"G1 X#5241 Y#5381 F100\nG10 L2 P2 Z-1\nG1 Z[#5243+2]\nM2\n"
    )
    path = machines.zero_machine(tmp_path, Recipe(work_offsets=OFFSETS))
    theirs, own = (
        linuxcnc.interpret(each, path, find_known=False).axis for each in (text, olp.flatten(text, path))
    )
    np.testing.assert_allclose(own, theirs, atol=1e-9)


def test_offsets_that_the_program_states_are_known_on_fanuc(tmp_path: Path) -> None:
    """Also before any G20 or G21: the unit of the control is one and the same."""
    assert fanuc("O1\nG90\nG10 L2 P2 X50.\nG0 X[#5241+1.]\nM30\n").splitlines()[3] == "G0 X51."
    known = flatten(b"O1\nG21 G90\nG0 Y[#5222+1.]\nM30\n", profile="fanuc", setup=of(tmp_path, "fanuc"))
    assert b"G0 Y-2." in known


def test_offsets_that_a_macro_sets_are_stated_by_g10() -> None:
    text = "O1\nG21 G90 G17\n#1=40.\n#5221=-[#1+2.5]\n#5242=#5221*2\nG54 G0 X1. Y2. Z3.\nG55 Y4.\nM30\n"
    written = fanuc(text).splitlines()
    assert written[2:4] == ["G10 L2 P1 X-42.5", "G10 L2 P2 Y-85."]
    assert "G91\nG90\nG10 L2 P6 Z5.\nG91\n" in fanuc("O1\nG21\nG91\n#5323=5.\nG1 X1.\nM30\n")
    for index in (5201, 5224, 5341, 7001):
        assert refused(f"O1\n#{index}=1.\n", "fanuc")[0] == "OLP544"
    assert refused("O1\n#5221=1.\n", "siemens-iso")[0] == "OLP544"


@pytest.mark.oracle
def test_the_interpreter_moves_where_a_macro_has_put_the_offset(tmp_path: Path) -> None:
    path = machines.zero_machine(tmp_path, Recipe(work_offsets=OFFSETS))
    unrolled = fanuc("O1\nG21 G90 G17\n#5221=100.+1.5\nG54 G0 X1. Y2. Z3.\nM30\n")
    plain = "\n".join(unrolled.splitlines()[1:]) + "\n"
    axis = linuxcnc.interpret(plain.encode(), path, find_known=False).axis
    np.testing.assert_allclose(axis[-1, 0], 102.5, atol=1e-9)


@pytest.mark.parametrize("profile", ["linuxcnc", "fanuc"])
@pytest.mark.parametrize(
    ("before", "variable"),
    [
        ("G20 G90\n", "#5221"),
        ("G21 G90\nG10 L20 P1 X0.\n", "#5221"),
        ("G21 G91\nG10 L2 P1 X5.\n", "#5221"),
        ("G21 G90\nG10 L2 P0 X5.\n", "#5221"),
        ("G21 G90\nG10 L2 P1 X5.\nG20\n", "#5221"),
        ("G21 G90\n", "#5261"),
        ("G21 G90\n", "#5224"),
    ],
)
def test_other_offsets_are_not_known(profile: str, before: str, variable: str, tmp_path: Path) -> None:
    text = f"{before}G0 X[{variable}+1.]\nM30\n"
    code, why, line = refused(text, profile, setup=of(tmp_path, profile))
    assert (code, line) == ("OLP541", before.count("\n") + 1)
    assert f"{variable} is" in why


@pytest.mark.parametrize("profile", ["grbl", "mach3", "mach4", "siemens-iso"])
def test_controls_whose_manuals_do_not_say_so_have_none(profile: str, tmp_path: Path) -> None:
    text = "G21 G90\nG0 X[#5221+1.]\nM30\n"
    assert refused(text, profile, setup=of(tmp_path, profile))[::2] == ("OLP541", 2)
