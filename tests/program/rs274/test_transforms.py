"""Rotation, scaling and mirror images of ISO controls by hand, and where it is not certain what they make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases.blocks import program, refusal, setup_of

from olp.core.machine import Setup

HEAD = "G21 G90 G17 G54\nG0 X1. Y2. Z3.\n"
FACTORS = "G51 X0. Y0. Z0."


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    made = {c: setup_of(tmp_path_factory.mktemp(c), c) for c in ("fanuc", "haas")}
    unit = replace(made["fanuc"].machine, scaling_unit=0.00001)
    return made | {"scaled": replace(made["fanuc"], machine=unit)}


def control(name: str) -> str:
    return "fanuc" if name == "scaled" else name


#: Blocks behind `HEAD` (axes at 101, 202, 303, the work offset at 100, 200, 300): the last axis position.
PLACES = {
    ("fanuc", "G68 X10. Y0. R90.\nX12. Y3."): (107, 202, 303),
    ("haas", "G68 X10. Y0. R-90.\nX12. Y3."): (113, 198, 303),
    ("fanuc", "G68 X10. Y0. R90.\nX12. Y3.\nX13."): (107, 203, 303),
    ("fanuc", "G68 X10. Y0. R90.\nX12. Y3.\nG91 X2.\nG90"): (107, 204, 303),
    ("fanuc", "G68 X10. Y0. R90.\nX12. Y3.\nG69\nX1. Y1."): (101, 201, 303),
    ("fanuc", "G68 X1. Y1. R90.\nG69 X5. Y6."): (105, 206, 303),
    ("fanuc", "G68 X1. Y1. R0\nX5."): (105, 202, 303),
    ("fanuc", "G68 X1. Y1. R360.\nX5."): (105, 202, 303),
    ("fanuc", "G51.1 X5.\nX2."): (108, 202, 303),
    ("fanuc", "G51.1 X5.\nG51.1 Y1.\nX2. Y2."): (108, 200, 303),
    ("fanuc", "G51.1 X5. Y1.\nG50.1 X0.\nX2. Y2."): (102, 200, 303),
    ("fanuc", "G51.1 X5. Y1.\nG50.1\nX2. Y2."): (102, 202, 303),
    ("haas", "G101 X0\nX5."): (95, 202, 303),
    ("haas", "G101 X0 Y0\nG100 X0\nX5. Y3."): (105, 197, 303),
    ("haas", "G101 X0 Y0\nG100\nX5. Y3."): (105, 203, 303),
    ("haas", f"{FACTORS} P2.\nX2. Y3. Z4."): (104, 206, 308),
    ("haas", "G51 X10. Y0. Z4. P.5\nX2. Y3. Z4."): (106, 201.5, 304),
    ("scaled", f"{FACTORS} P200000\nX2. Y3. Z4."): (104, 206, 308),
    ("scaled", f"{FACTORS} I100000 J-50000 K100000\nX2. Y3."): (102, 198.5, 303),
    # what ends nothing leaves all as it is
    ("fanuc", "G69 G50 G50.1\nX5."): (105, 202, 303),
    ("fanuc", "G68 X1. Y0. R90.\nG50\nX2. Y0."): (101, 201, 303),
}  # fmt: skip


@pytest.mark.parametrize(("name", "text"), PLACES)
def test_positions_by_hand(name: str, text: str, setups: dict[str, Setup]) -> None:
    read = program(f"{HEAD}{text}\nM30\n", setups[name], control(name))
    assert read.toolpath.end_mm[-1] == pytest.approx(PLACES[name, text], abs=1e-9)


def test_axes_that_turn_are_not_known_until_they_are_stated(setups: dict[str, Setup]) -> None:
    read = program(f"{HEAD}G68 X0. Y0. R45.\nZ5.\nX1. Y1.\nG69\nZ9.\nM30\n", setups["fanuc"], "fanuc")
    known = np.isfinite(read.toolpath.end_mm)
    assert known[:, 2].all()
    assert known[:, 0].tolist() == known[:, 1].tolist() == [True, False, False, True, False, False]
    mirrored = program(f"{HEAD}G51.1 X0.\nZ5.\nM30\n", setups["fanuc"], "fanuc")
    assert np.isfinite(mirrored.toolpath.end_mm[-1]).tolist() == [False, True, True]


def test_a_mirrored_arc_turns_the_other_way(setups: dict[str, Setup]) -> None:
    text = f"{HEAD}G51.1 X5.\nG0 X0. Y0.\nG2 X4. Y0. I2. J0. F100.\nG50.1\nM30\n"
    path = program(text, setups["fanuc"], "fanuc").toolpath
    assert path.arcs.sweep_rad == pytest.approx([np.pi])
    assert path.arcs.centre_mm[0] == pytest.approx([108.0, 200.0, 303.0])


#: Blocks behind `HEAD`: a part of why they are refused, and the code.
REFUSED = {
    ("fanuc", "G68 X1. R30."): ("no Y for its centre", "OLP518"),
    ("fanuc", "G68 X1. Y1."): ("without R turns by a setting", "OLP518"),
    ("haas", "G68 R30."): ("its centre; unroll the program with --flatten", "OLP511"),
    ("fanuc", "G68 X1. Y1. R30"): ("R of G68 has no decimal point", "OLP518"),
    ("fanuc", "G91 G68 X1. Y1. R30."): ("depends on a parameter of the control", "OLP518"),
    ("fanuc", "G18 G68 X1. Z1. R30."): ("plane of X and Y only", "OLP518"),
    ("fanuc", "G68 X1. Y1. Z0. K1. R30."): ("turns in space", "OLP518"),
    ("fanuc", "G68 X1. Y1. R30.\nG68 X1. Y1. R60."): ("give G69 before it", "OLP518"),
    ("fanuc", "G51.1 X1.\nG68 X1. Y1. R60."): ("give G50.1 before it", "OLP518"),
    ("fanuc", "G51.1"): ("the coordinate of its mirror", "OLP518"),
    ("fanuc", "G68 X1. Y1. R30.\nG55"): ("give G69 before", "OLP518"),
    ("fanuc", "G68 X1. Y1. R30.\nG53 G0 X1."): ("give G69 before", "OLP518"),
    ("fanuc", "G68 X1. Y1. R30.\nG28 Z1."): ("give G69 before", "OLP518"),
    ("fanuc", "G68 X1. Y1. R30.\nG92 X1."): ("give G69 before", "OLP518"),
    ("fanuc", "G68 X1. Y1. R30.\nG1 Z1. F100.\nG18 X1. Y1.\nG2 X2. Z1. R5."): ("turned out of", "OLP530"),
    ("fanuc", "G51.1 Z1.\nZ1.\nG81 X1. Y1. Z-1. R1. F100."): ("turns, mirrors or scales its tool", "OLP518"),
    ("fanuc", f"{FACTORS} P2000"): ("give scaling_unit in the machine file", "OLP541"),
    ("scaled", f"{FACTORS} P2."): ("has a decimal point", "OLP518"),
    ("scaled", f"{FACTORS} P0"): ("expected a factor from", "OLP518"),
    ("scaled", FACTORS): ("without its factors", "OLP518"),
    ("scaled", "G51 X1. Y1. P200000"): ("no Z for its centre", "OLP518"),
    ("scaled", f"{FACTORS} I200000 J100000 K100000\nX0. Y0.\nG2 X4. R5."): ("scaled to an ellipse", "OLP530"),
    ("haas", f"{FACTORS} P2"): ("has no decimal point", "OLP518"),
    ("haas", f"{FACTORS} I2. J1. K1."): ("without its factors", "OLP518"),
    ("haas", "G51.1 X1."): ("G51.1", "OLP512"),
    ("fanuc", "/G68 X1. Y1. R30."): ("under block delete", "OLP525"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "text"), REFUSED)
def test_what_is_not_certain_is_refused(name: str, text: str, setups: dict[str, Setup]) -> None:
    why, code = REFUSED[name, text]
    refused = refusal(f"{HEAD}{text}\nM30\n", setups[name], control(name))
    assert why in refused["why"] and refused["code"] == code
    assert refused["line"] == 3 + text.count("\n")


def test_a_cycle_may_begin_where_its_block_states_the_place(setups: dict[str, Setup]) -> None:
    text = f"{HEAD}G68 X0. Y0. R90.\nG81 X5. Y0. Z-1. R1. F100.\nX6.\nG80\nM30\n"
    holes = program(text, setups["fanuc"], "fanuc").holes
    assert holes.place_mm == pytest.approx(np.array([[100.0, 205.0], [100.0, 206.0]]))
    why = refusal(text.replace(" Y0. Z-1.", " Z-1."), setups["fanuc"], "fanuc")["why"]
    assert "starts where an axis has not been commanded" in why
