"""Blocks that are more than a motion, by hand: where the axes are behind them, or why they are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

START = "G21 G90 G17 G54\nG0 X1 Y2 Z3\n"


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    offsets = "X_mm = 100.0\nY_mm = 200.0\nZ_mm = 300.0\n"
    return load_setup(machine(tmp_path_factory.mktemp("m"), tables=TRUE_ZERO + offsets))


def path(text: str, setup: Setup) -> Toolpath:
    return read((START + text).encode(), setup, DIALECTS["linuxcnc"]).toolpath


def ends(text: str, setup: Setup) -> list[list[float | None]]:
    """Axis positions behind the moves of a text, None where unknown; without the move of the start."""
    return [[None if math.isnan(v) else v for v in row] for row in path(text, setup).end_mm[1:].tolist()]


def refused(text: str, setup: Setup) -> str:
    with pytest.raises(ProgramError) as caught:
        path(text, setup)
    assert caught.value.line == 3
    return str(caught.value)


@pytest.mark.parametrize(("code", "kind"), [("G0", Kind.RAPID), ("G1", Kind.LINE)])
def test_g53_takes_axis_positions(code: str, kind: Kind, setup: Setup) -> None:
    text = f"F60\nG53 {code} X7\nG0 Y5\n"
    assert ends(text, setup) == [[7.0, 202.0, 303.0], [7.0, 205.0, 303.0]]
    moves = path(text, setup)
    assert moves.kind[1] == kind
    flags = int(moves.flag[1])
    assert flags & Flag.MACHINE and flags & Flag.PASS
    assert not int(moves.flag[2]) & Flag.MACHINE


def test_g53_is_refused_in_g91_and_with_other_motion(setup: Setup) -> None:
    assert "G53 takes axis positions, and the block is in G91" in refused("G91 G53 G0 X7\n", setup)
    assert "G53 takes G0 or G1 only" in refused("G53 G2 X7 I3 F60\n", setup)


def test_g28_goes_to_its_point_and_then_where_the_machine_has_it(setup: Setup) -> None:
    assert ends("G28 Z9\n", setup) == [[101.0, 202.0, 309.0], [101.0, 202.0, None]]
    assert ends("G91 G28 Z9\n", setup)[0] == [101.0, 202.0, 312.0]


def test_a_probe_may_stop_anywhere_on_its_path(setup: Setup) -> None:
    text = "G38.2 Z-5 F60\nG0 Z9\n"
    assert ends(text, setup) == [[101.0, 202.0, 295.0], [101.0, 202.0, None], [101.0, 202.0, 309.0]]
    assert path(text, setup).kind[1] == Kind.PROBE


@pytest.mark.parametrize(
    ("block", "holes"),
    [
        ("G90 G81 X11 Z-2 R1 F60", [(111.0, 202.0)]),
        ("G90 G81 X11 Z-2 R1 L3 F60", [(111.0, 202.0)] * 3),
        ("G91 G81 X10 Z-2 R-1 F60", [(111.0, 202.0)]),
        ("G91 G81 X10 Z-2 R-1 L3 F60", [(111.0, 202.0), (121.0, 202.0), (131.0, 202.0)]),
        ("G91 G81 Y-10 Z-2 R-1 L2 F60", [(101.0, 192.0), (101.0, 182.0)]),
    ],
)
def test_repeated_holes_step_in_g91_only_and_along_their_words_only(
    block: str, holes: list[tuple[float, float]], setup: Setup
) -> None:
    moves = path(block + "\nG80\n", setup)
    bottoms = moves.end_mm[moves.kind == Kind.LINE]
    assert [tuple(row) for row in bottoms[:, :2].tolist()] == holes
    z = 298.0 if "G90" in block else 300.0
    assert np.unique(bottoms[:, 2]).tolist() == [z]


def test_g98_is_the_level_before_and_g99_the_level_r(setup: Setup) -> None:
    # LinuxCNC begins in G99
    for code, z in (("G98", 303.0), ("G99", 301.0), ("", 301.0)):
        assert ends(f"{code} G81 X4 Z-2 R1 F60\nG80\n", setup)[-1] == [104.0, 202.0, z]


def test_g10_l20_makes_the_position_the_value_given(setup: Setup) -> None:
    """Axis X 101 becomes program X 30, so X31 is axis X 102; G54 has 71 then."""
    assert ends("G10 L20 P1 X30\nG0 X31\n", setup) == [[102.0, 202.0, 303.0]]
    assert ends("G92 X30\nG0 X31\n", setup) == [[102.0, 202.0, 303.0]]
    assert ends("G10 L2 P1 X30\nG0 X31\n", setup) == [[61.0, 202.0, 303.0]]


@pytest.mark.parametrize("p", ("0", "-1", "1.5"))
def test_turns_of_an_arc_are_an_integer_from_one(p: str, setup: Setup) -> None:
    assert "expected an integer from 1" in refused(f"G2 X1 Y2 I5 P{p} F60\n", setup)
