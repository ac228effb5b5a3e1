"""Tilted planes on machines with rotary axes: corrected, judged by an independent judge, refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.joint_machines import machine_file
from judge.tilted import TiltedJudge

import olp

#: mm: the tolerance, half a last digit of three words, and what lies between samples.
WITHIN_MM = 1.1e-3 + 0.5e-3 * 3**0.5
SHIFT = ["CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 7.1 X-15.053", "CYCL DEF 7.2 Y+6.134", "CYCL DEF 7.3 Z+26.216"]
PATH = [
    "L X+10 Y+20 R0 FMAX M3", "L Z+50 FMAX", "L Z-3 F200", "L X+40", "L Y-35.5 Z-1",
    "L X-10 Y-10 Z-7", "L Z+50 FMAX",
]  # fmt: skip
#: by chain: a form of PLANE, and how its rotary axes turn
FORMS = [
    ("C A Y F X Z", ["PLANE SPATIAL SPA+36.037 SPB-28.467 SPC+152.541 STAY SEQ+ TABLE ROT"], "A+Q120 C+Q122"),
    (
        "C F X Y Z B",
        ["PLANE VECTOR BX+4.0 BY+0 BZ-2.0 NX+1.0 NY-0.5 NZ+2.0 MOVE DIST50 F2000 SEQ+ COORD ROT"],
        "",
    ),
    (
        "F X Y Z C A",
        ["PLANE SPATIAL SPA-17 SPB+0 SPC+55.7 STAY SEQ+", "PLANE RELATIV SPB+33.2 TURN MB MAX FMAX SEQ-"],
        "",
    ),
]


def program(planes: list[str], rotary: str = "", path: list[str] = PATH, shift: list[str] = SHIFT) -> bytes:
    turn = [f"L {rotary} R0 FMAX M126"] if rotary else []
    head = ["BEGIN PGM A MM", "TOOL CALL 1 Z S1000", "L X+0 Y+0 Z+200 R0 FMAX"]
    tail = ["PLANE RESET STAY", "L Z+300 R0 FMAX", "END PGM A MM"]
    return "\n".join([*head, *shift, *planes, *turn, *path, *tail]).encode() + b"\n"


def corrected(folder: Path, text: bytes, chain: str = "C A Y F X Z", **words: str) -> olp.JointCorrection:
    return olp.correct_joints(text, machine_file(folder, chain, control="heidenhain", **words))


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "planes", "rotary"), FORMS)
def test_planes_are_corrected_as_the_judge_finds(
    chain: str, planes: list[str], rotary: str, tmp_path: Path
) -> None:
    nominal = program(planes, rotary)
    result = corrected(tmp_path, nominal, chain)
    assert result.report["verdict"]["ok"]
    judge = TiltedJudge(tmp_path / "machine.toml")
    assert judge.judged(nominal, nominal)[0] > 10e-3
    assert judge.judged(nominal, result.data)[0] <= WITHIN_MM


def test_rotary_axes_stand_in_a_plane(tmp_path: Path) -> None:
    """No rotary word is written, and what angle stays is in the report."""
    result = corrected(tmp_path, program(FORMS[0][1], "A+Q120 C+Q122"))
    assert result.data.count(b"Q120") == 1 and b"A-" not in result.data and b" C+3" not in result.data
    assert result.report["deviation"]["after"]["orientation_max_urad"] > 20.0


def test_backlash_of_a_rotary_axis_stays_and_the_tip_is_right(tmp_path: Path) -> None:
    calibration = "[backlash]\nC_urad = 60.0\nX_um = 8.0\n"
    text = program(FORMS[0][1], "A+Q120 C+Q122")
    result = corrected(tmp_path, text, calibration=calibration)
    assert result.report["verdict"]["ok"]
    assert result.report["deviation"]["after"]["position_max_um"] < 1.9
    assert b" C" not in result.data.partition(b"FMAX M126")[2]


def test_without_errors_no_byte_changes(tmp_path: Path) -> None:
    text = program(FORMS[0][1], "A+Q120 C+Q122")
    machine = machine_file(tmp_path, "C A Y F X Z", control="heidenhain", errors=False)
    assert olp.correct_joints(text, machine).data == text


def test_axis_words_and_found_positions_are_one(tmp_path: Path) -> None:
    """SPB 45 is at A +45, C +90, as the manual of the control has it."""
    planes = ["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY SEQ+ TABLE ROT"]
    found = corrected(tmp_path, program(planes, "A+Q120 C+Q122")).data
    stated = corrected(tmp_path, program(planes, "A+45 C+90")).data
    assert found.replace(b"A+Q120 C+Q122", b"A+45 C+90").splitlines()[2:] == stated.splitlines()[2:]


def test_zeros_in_the_plane_cancel_every_shift_with_it(tmp_path: Path) -> None:
    """As posts reset a plane: CYCL DEF 7 with zeros, PLANE RESET, then words in the preset again."""
    zeros = [f"CYCL DEF 7.{k} {axis}+0" for k, axis in enumerate("XYZ", 1)]
    after = ["L A+0 C+0 R0 FMAX", "L X+5 Y+5 R0 FMAX", "L Z+10 FMAX", "L X+30 F100"]
    text = program(FORMS[0][1], "A+Q120 C+Q122", [*PATH, *zeros, "PLANE RESET STAY", *after])
    twin = program([], "A+0 C+0", after[1:], [])
    both = [corrected(tmp_path, one).data.splitlines() for one in (text, twin)]
    cut = [next(k for k, line in enumerate(lines) if b"F100" in line) for lines in both]
    assert both[0][cut[0] :] == both[1][cut[1] :]


REFUSED = [
    (["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY"], "A+Q120 C+Q122", PATH, "SEQ", 9),
    (["PLANE SPATIAL SPA+0 SPB+0 SPC+45 STAY SEQ+"], "A+Q120 C+Q122", PATH, "about its normal alone", 9),
    (["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY SEQ+"], "A+44 C+90", PATH, "1 deg off the normal", 12),
    (["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY SEQ+"], "", PATH, "not known there", 11),
    (["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY SEQ+"], "A-Q120 C+Q122", PATH, "parameters", 9),
    (["PLANE SPATIAL SPA+0 SPB+Q5 SPC+0 STAY SEQ+"], "", PATH, "with numbers", 8),
    (["PLANE AXIAL A+45 C+90 STAY"], "", PATH, "AXIAL.* is not read", 8),
    (["PLANE VECTOR BX+1 BY+0 BZ+1 NX+0 NY+0 NZ+1 STAY SEQ+"], "", PATH, "square", 8),
    (FORMS[0][1], "A+Q120 C+Q122", [*PATH[:3], "L A+30 F100"], "turns while", 13),
    (FORMS[0][1], "A+Q120 C+Q122", [*PATH[:3], "CC X+0 Y+0", "C X+10 Y+20 DR+"], "an arc", 14),
    (FORMS[0][1], "A+Q120 C+Q122", [*PATH[:3], "CYCL DEF 7.1 X+1", "L X+9"], "datum shift was", 14),
    (FORMS[0][1], "A+Q120 C+Q122", PATH[1:4], "X, Y has not been commanded", 11),
]


@pytest.mark.parametrize(("planes", "rotary", "path", "message", "line"), REFUSED)
def test_what_is_not_known_is_refused_with_its_line(
    planes: list[str], rotary: str, path: list[str], message: str, line: int, tmp_path: Path
) -> None:
    with pytest.raises(olp.ProgramError, match=message) as caught:
        corrected(tmp_path, program(planes, rotary, path))
    assert caught.value.line == line
