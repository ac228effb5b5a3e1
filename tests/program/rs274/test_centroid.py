"""What Centroid mills make of their own words; LinuxCNC judges the same program in its words."""

from __future__ import annotations

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from judge import linuxcnc

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Kind, Toolpath
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

TOOLS = "".join(f"[tools.{n}]\nZ_mm = {n}0.0\nradius_mm = 2.0\n" for n in (1, 2))
KEYS = 'decimal_point = "calculator"\ntool_change_moves = ["Z"]\nhome_mm = { X = 7.0, Z = 300.0 }\n'
#: As its conversational programming writes a program, and the same in words of LinuxCNC.
OWN = """: shown to the operator
N1 ; header
M25 G49
G17 G40 G20 G80 G90 G98
G49 H0 M25
G0 X-2 Y0
N2 T1 M6
S2500 M3
G4 P3.00 ; pause
G43 D1
N3 X0.5 Y0.25 Z1. H1
G10 P73 R0.025
G1 Z-0.25 F20
X1. Y1.
G0 Z1.
G81 X2. Y1. Z-0.5 R0.1 F15.
X3. Y2.
G80
G49 H0 M25
T2 M6
G43
H2
G0 X0. Y0. Z1.
G1 Z-0.1 F5.
G3 X1. Y1. J1.
G49 H0 M25
M30
"""
SAME = """G17 G40 G20 G80 G90 G98
G0 X-2 Y0
T1 M6
S2500 M3
G43 H1
G0 X0.5 Y0.25 Z1.
G1 Z-0.25 F20
X1. Y1.
G0 Z1.
G81 X2. Y1. Z-0.5 R0.1 F15.
X3. Y2.
G80
G49
T2 M6
G43 H2
G0 X0. Y0. Z1.
G1 Z-0.1 F5.
G3 X1. Y1. I0. J1.
G49
M2
"""


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    folder = tmp_path_factory.mktemp("centroid")
    return load_setup(machine(folder, controller="centroid", keys=KEYS, tables=TRUE_ZERO + TOOLS))


def toolpath(text: str, setup: Setup) -> Toolpath:
    return read(text.encode(), setup, DIALECTS["centroid"]).toolpath


def refusal(text: str, setup: Setup) -> tuple[int | None, str]:
    with pytest.raises(ProgramError) as caught:
        toolpath(text, setup)
    return caught.value.line, caught.value.message


@pytest.mark.oracle
def test_a_program_of_its_own_conversation_goes_where_linuxcnc_goes(setup: Setup) -> None:
    lengths = {n: (0.0, 0.0, 10.0 * n) for n in (1, 2)}
    canon = linuxcnc.interpret(SAME.encode(), tools=lengths, find_known=False)
    path = toolpath(OWN, setup)
    cut = np.isin(path.kind, (Kind.LINE, Kind.ARC_CW, Kind.ARC_CCW))
    theirs = np.isin(canon.kind, [linuxcnc.KINDS.index(kind) for kind in ("feed", "arc")])
    assert theirs.sum() >= 6
    assert np.allclose(path.end_mm[cut], (canon.tip + canon.length)[theirs], atol=1e-6)


def test_a_move_before_the_number_of_the_length_is_refused(setup: Setup) -> None:
    text = "G21 G90\nG0 X0. Y0. Z50.\nG43\nG1 X1. F5.\nH1\nM30\n"
    assert refusal(text, setup) == (
        4,
        "G43 has no H word, and no block up to this move has one; give H with the number of the tool length",
    )  # fmt: skip
    # G49 ends the wait
    toolpath(text.replace("G1 X1.", "G49\nG1 X1."), setup)


def test_another_number_alone_is_refused(setup: Setup) -> None:
    text = "G21 G90\nG0 X0. Y0. Z50.\nG43\nZ40. H1\nG1 X1. F5.\nZ30. H2\nM30\n"
    assert refusal(text, setup)[0] == 6


def test_m25_leaves_z_at_home_and_the_others_where_they_are(setup: Setup) -> None:
    path = toolpath("G21 G90\nG0 X1. Y2. Z3.\nM25\nG0 X5.\nM30\n", setup)
    assert path.end_mm[-1].tolist() == [5.0, 2.0, 300.0]


@pytest.mark.parametrize(
    "block",
    ["G92 X0.", "G41 D1 X5.", "G51 X0. Y0. P3", "G68 R45.", "G65 P1 A2.", "M98 P9100", "G29", "M26",
     "G10 P81 R39",
     "G10 L2 P1 X1.", "G10 L20 P1 X0.", "G10 H5 R1.", "G54 P1"],
)  # fmt: skip
def test_what_the_manual_leaves_open_is_refused_with_its_line(setup: Setup, block: str) -> None:
    line, message = refusal(f"G21 G90\nG0 X0. Y0. Z50.\n{block}\nM30\n", setup)
    assert line == 3
    assert "; " in message


def test_a_dwell_counts_seconds_whatever_its_form() -> None:
    profile = DIALECTS["centroid"]
    assert profile.dwell_s(3.0, pointed=False) == profile.dwell_s(3.0, pointed=True) == 3.0
