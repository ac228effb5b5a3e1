"""Tilted planes on machines with rotary axes: corrected, judged by an independent judge, refused by name."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
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


def corrected(
    folder: Path, text: bytes, chain: str = "C A Y F X Z", control: str = "heidenhain", **words: str
) -> olp.JointCorrection:
    return olp.correct_joints(text, machine_file(folder, chain, control=control, **words))


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
    unknown = corrected(tmp_path, text, calibration=calibration)
    assert not unknown.report["verdict"]["ok"] and "OLP103" in [one.code for one in unknown.findings]
    text = text.replace(b" Z+200 R0", b" Z+200 A+0 C+0 R0", 1)
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
    (["PLANE SPATIAL SPA+0 SPB+0 SPC+45 STAY SEQ+"], "A+Q120 C+Q122", PATH, "about the axis of C, and", 9),
    (["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY SEQ+"], "A+44 C+90", PATH, "1 deg off the normal", 12),
    (["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY SEQ+"], "", PATH, "not known there", 11),
    (["PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY SEQ+"], "A-Q120 C+Q122", PATH, "parameters", 9),
    (["PLANE SPATIAL SPA+0 SPB+Q5 SPC+0 STAY SEQ+"], "", PATH, "with numbers", 8),
    (["PLANE AXIAL A+45 C+90 STAY"], "", PATH, "AXIAL.* is not read", 8),
    (["PLANE VECTOR BX+1 BY+0 BZ+1 NX+0 NY+0 NZ+1 STAY SEQ+"], "", PATH, "square", 8),
    (FORMS[0][1], "A+Q120 C+Q122", [*PATH[:3], "L A+30 F100"], "turns while", 13),
    (FORMS[0][1], "A+Q120 C+Q122", ["L Z+3 FMAX", "CC X+0 Y+0", "C X+10 Y+20 DR+ F9"], "arc starts", 12),
    (["CC X+0 Y+9", *FORMS[0][1]], "A+Q120 C+Q122", ["L X+0 Y+0 Z+3 FMAX", "C DR+ F9"], "CC again", 12),
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


SWIVEL = 'CYCLE800(1,"TABLE",0,{mode},10,5,-20,30,20,15,0,0,3,{way},0)'
S_PATH = "G0 X10 Y20\nZ50\nG1 Z-5 F200\nX40\nY-35.5\nX-10 Y-10 Z-7\nG0 Z50\n"


def swivelled(mode: int = 57, way: int = 1, call: str = SWIVEL, path: str = S_PATH) -> bytes:
    head = "G71 G90 G54 G17\nT1 M6\nD1\nG0 X0 Y0 Z200 A0 C0\n"
    return f"{head}{call.format(mode=mode, way=way)}\n{path}CYCLE800()\nG0 Z300\nM30\n".encode()


def by_swivel(folder: Path, text: bytes, axis: str = "A") -> olp.JointCorrection:
    key = f'[kinematics]\nswivel_axis = "{axis}"\n' if axis else ""
    return corrected(folder, text, control="sinumerik", extra=key)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "way", "axis"), some_of_a_campaign([(57, 1, "A"), (27, -1, "A"), (54, 1, "C")], 3)
)
def test_swivelled_planes_are_corrected_as_the_judge_finds(
    mode: int, way: int, axis: str, tmp_path: Path
) -> None:
    nominal = swivelled(mode, way)
    result = by_swivel(tmp_path, nominal, axis)
    assert result.report["verdict"]["ok"]
    judge = TiltedJudge(tmp_path / "machine.toml")
    assert judge.judged(nominal, nominal)[0] > 10e-3
    assert judge.judged(nominal, result.data)[0] <= WITHIN_MM


def test_a_swivel_that_turns_no_axis_takes_the_words(tmp_path: Path) -> None:
    """_DIR 0: the program turns the axes itself, and these are checked."""
    call = 'CYCLE800(0,"T",0,57,0,0,0,0,45,0,0,0,0,0)'
    done = by_swivel(tmp_path, swivelled(call=call, path="G0 A45 C90\n" + S_PATH), "")
    assert done.report["verdict"]["ok"] and b"A45 C90\n" in done.data
    with pytest.raises(olp.ProgramError, match="1 deg off the normal"):
        by_swivel(tmp_path, swivelled(call=call, path="G0 A44 C90\n" + S_PATH), "")


S_REFUSED = [
    (SWIVEL, S_PATH, "", "swivel_axis", 5),
    (SWIVEL.replace('"TABLE",0', '"TABLE",100'), S_PATH, "A", "_ST is not", 5),
    (SWIVEL.replace("{mode}", "192"), S_PATH, "A", "_MODE", 5),
    (SWIVEL.replace("{way}", ""), S_PATH, "A", "_DIR is left out", 5),
    (SWIVEL.replace("30,20", "R1,20"), S_PATH, "A", "no number", 5),
    ("TRANS X5\n" + SWIVEL, S_PATH, "A", "programmable frame", 6),
    ("D0\n" + SWIVEL, S_PATH, "A", "length of the tool in the spindle is not in force", 7),
    (SWIVEL + "\nTRAORI", S_PATH, "A", "swivelled plane", 6),
    (SWIVEL, S_PATH + "G1 A10 F100\n", "A", "turns while", 13),
    (SWIVEL, "G0 X10 Y20\nG1 Z-5 F200\n", "A", "Z has not been commanded", 7),
]


@pytest.mark.parametrize(("call", "path", "axis", "message", "line"), S_REFUSED)
def test_what_is_not_known_of_a_swivel_is_refused(
    call: str, path: str, axis: str, message: str, line: int, tmp_path: Path
) -> None:
    with pytest.raises(olp.ProgramError, match=message) as caught:
        by_swivel(tmp_path, swivelled(call=call, path=path), axis)
    assert caught.value.line == line


PLANE = "G68.2 X10. Y5. Z-20. I30. J25. K15."
G_PATH = "G43 H1\nG0 X10. Y20.\nZ50.\nG1 Z-5. F200.\nX40.\nY-35.5\nX-10. Y-10. Z-7.\nG0 Z50.\n"


def tilted(turn: str = "A25. C150.", plane: str = PLANE, path: str = G_PATH) -> bytes:
    head = "G21 G90 G54\nT1 M6\nG0 X0. Y0. Z200. A0. C0.\n"
    return f"{head}{plane}\n{turn}\n{path}G69\nG49\nM30\n".encode()


@pytest.mark.slow
def test_planes_of_iso_controls_are_corrected_as_the_judge_finds(tmp_path: Path) -> None:
    nominal = tilted()
    result = corrected(tmp_path, nominal, control="fanuc")
    assert result.report["verdict"]["ok"]
    judge = TiltedJudge(tmp_path / "machine.toml")
    assert judge.judged(nominal, nominal)[0] > 10e-3
    assert judge.judged(nominal, result.data)[0] <= WITHIN_MM


def test_g53_1_takes_the_position_within_the_travel(tmp_path: Path) -> None:
    machine = machine_file(tmp_path, "C A Y F X Z", control="fanuc")
    head, mark, tail = machine.read_text().partition("[axes.A]")
    machine.write_text(head + mark + tail.replace("[-720.0, 720.0]", "[-5.0, 200.0]", 1))
    found = olp.correct_joints(tilted("G53.1"), machine).data
    stated = olp.correct_joints(tilted("A25. C150."), machine).data
    assert found.partition(b"G43")[2] == stated.partition(b"G43")[2]


G_REFUSED = [
    ("G53.1", PLANE, G_PATH, "two positions", 5),
    ("G53.1 P1", PLANE, G_PATH, "G53.1 is read alone", 5),
    ("A25. C150.", PLANE.replace("J25.", "J25"), G_PATH, "no decimal point", 4),
    ("A25. C150.", PLANE.replace(" K15.", ""), G_PATH, "I, J and K", 4),
    ("A25. C150.", PLANE + "\nG68.2 X1. Y0. Z0. I1. J1. K1.", G_PATH, "another plane", 5),
    ("A25. C150.", "G91\n" + PLANE, G_PATH, "in G90", 5),
    ("A25. C150.", PLANE, G_PATH.replace("G43 H1\n", ""), "is not in force", 6),
    ("A25. C150.", PLANE, G_PATH + "G69\nG0 X0.\nG1 X5. F100.\n", "has not been commanded", 16),
]


@pytest.mark.parametrize(("turn", "plane", "path", "message", "line"), G_REFUSED)
def test_what_is_not_known_of_a_plane_of_iso_controls_is_refused(
    turn: str, plane: str, path: str, message: str, line: int, tmp_path: Path
) -> None:
    with pytest.raises(olp.ProgramError, match=message) as caught:
        corrected(tmp_path, tilted(turn, plane, path), control="fanuc")
    assert caught.value.line == line


@pytest.mark.slow
def test_the_tip_is_led_in_a_plane_as_without_it(tmp_path: Path) -> None:
    """M128 in a plane that turns the words by 90 deg, and the same path without the plane."""
    head = "BEGIN PGM A MM\nTOOL CALL 1 Z\nL X+0 Y+0 Z+200 A+0 C+0 R0 FMAX\n"
    plane = "PLANE SPATIAL SPA+0 SPB+0 SPC+90 STAY\nM128\nL X+0 Y+0 Z+20 A-10 C+5 R0 FMAX\n"
    turned = head + plane + "L X+30 Y+10 Z+10 A-20 C+15 F500\nL X-10 F500\n"
    plain = head + "M128\nL X+0 Y+0 Z+20 A-10 C+5 R0 FMAX\nL X-10 Y+30 Z+10 A-20 C+15 F500\nL Y-10 F500\n"
    both = [corrected(tmp_path, text.encode()).report["deviation"]["before"] for text in (turned, plain)]
    assert both[0] == pytest.approx(both[1], rel=1e-6)


#: By control: half a circle of 10 mm about (20, 20) and a whole one that goes down by 2 mm, in a plane.
ROUND = {
    "heidenhain": program(FORMS[0][1], "A+Q120 C+Q122", [
        "L X+10 Y+20 R0 FMAX M3", "L Z+50 FMAX", "L Z-3 F200", "CC X+20 Y+20", "C X+30 DR+",
        "CP IPA+360 IZ-2 DR+", "L Z+50 FMAX",
    ]),
    "sinumerik": swivelled(path=(
        "G0 X10 Y20\nZ50\nG1 Z-3 F200\nG3 X30 I10 J0\nG3 X30 Y20 Z-5 I=AC(20) J=AC(20)\nG0 Z50\n"
    )),
    "fanuc": tilted(path=(
        "G43 H1\nG0 X10. Y20.\nZ50.\nG1 Z-3. F200.\nG3 X30. I10. J0.\nG3 X30. Y20. Z-5. I-10. J0.\nG0 Z50.\n"
    )),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("control", ROUND)
def test_arcs_in_a_plane_are_round_there(control: str, tmp_path: Path) -> None:
    """The tool with its errors, seen along the words of the plane."""
    extra = '[kinematics]\nswivel_axis = "A"\n' if control == "sinumerik" else ""
    result = corrected(tmp_path, ROUND[control], control=control, extra=extra)
    assert result.report["verdict"]["ok"]
    judge = TiltedJudge(tmp_path / "machine.toml")
    text = re.split(rb"\n(?:PLANE RESET|CYCLE800\(\)|G69)", result.data)[0] + b"\n"
    moves = judge.read(text)
    turn, zero = judge.turn, judge.below + judge.turn @ judge.shift
    places = np.array([place for _, _, place in moves])
    first = next(k for k, (cuts, _, _) in enumerate(moves) if cuts)
    share = np.linspace(0.0, 1.0, 5)[:, None]
    samples = np.vstack([a + share * (b - a) for a, b in pairwise(places[first:-1])])
    tip = (judge.forward(judge.axes(samples, True), True)[0] - zero) @ turn
    turned = np.unwrap(np.arctan2(tip[:, 1] - 20.0, tip[:, 0] - 20.0))
    turned -= turned[0]
    assert turned[-1] == pytest.approx(3 * np.pi, abs=1e-3)
    assert np.hypot(tip[:, 0] - 20.0, tip[:, 1] - 20.0) == pytest.approx(10.0, abs=WITHIN_MM)
    level = -3.0 - np.clip(turned - np.pi, 0.0, None) / np.pi
    assert tip[:, 2] == pytest.approx(level, abs=WITHIN_MM)
    assert result.report["deviation"]["before"]["position_max_um"] > 10.0


@pytest.mark.parametrize("control", ROUND)
def test_arcs_in_a_plane_stay_without_errors(control: str, tmp_path: Path) -> None:
    extra = '[kinematics]\nswivel_axis = "A"\n' if control == "sinumerik" else ""
    machine = machine_file(tmp_path, "C A Y F X Z", control=control, errors=False, extra=extra)
    assert olp.correct_joints(ROUND[control], machine).data == ROUND[control]
