"""Holes of cycles on machines with rotary axes, in tilted planes and without: corrected, judged by an
independent judge, refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.joint_machines import machine_file
from judge.tilted import TiltedJudge

import olp

HEAD = [
    "BEGIN PGM A MM", "TOOL CALL 1 Z S1000", "CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 7.1 X-15.053",
    "CYCL DEF 7.2 Y+6.134", "CYCL DEF 7.3 Z+26.216", "L X+0 Y+0 Z+200 R0 FMAX",
]  # fmt: skip
DRILL = [
    "CYCL DEF {number} DRILLING ~", " Q200=+2 ;SET-UP CLEARANCE ~", " Q201=-20 ~", " Q206=+150 ~",
    " Q203=+0.5 ;SURFACE ~", " Q204=+50",
]  # fmt: skip
HOLES = [
    "L X+10 Y+20 R0 FMAX M99",
    "L X+40 FMAX M99",
    "L Y-35.5 FMAX",
    "CYCL CALL",
    "L X-80.25 Y-60 FMAX M99",
]
CUT = ["L Z+3 FMAX", "L X+0 F500", "L Z+60 FMAX"]
TAIL = ["L Z+300 R0 FMAX", "END PGM A MM"]
#: by chain: a plane, its rotary words, and um that remain: strokes lean, and with a tilted head an axis moves
#: along them whose error has waves of 4 um
PLANES = [
    (
        "C A Y F X Z",
        ["PLANE SPATIAL SPA+36.037 SPB-28.467 SPC+152.541 STAY SEQ+ TABLE ROT"],
        "A+Q120 C+Q122",
        2.0,
    ),
    ("C F X Y Z B", ["PLANE SPATIAL SPA+0 SPB+32.5 SPC+20 TURN FMAX SEQ+"], "", 5.5),
    ("C A Y F X Z", [], "A+0 C+0", 2.0),
]


def program(
    planes: list[str], rotary: str, holes: list[str] = HOLES, number: int = 200, cycle: list[str] = DRILL
) -> bytes:
    turn = [f"L {rotary} R0 FMAX"] if rotary else []
    defined = [line.format(number=number) for line in cycle]
    start = ["L X+0 Y+10 R0 FMAX M3", "L Z+50 FMAX"]
    lines = [
        *HEAD,
        *planes,
        *turn,
        *start,
        *defined,
        *holes,
        *CUT,
        *(["PLANE RESET STAY"] if planes else []),
        *TAIL,
    ]
    return "\n".join(lines).encode() + b"\n"


def corrected(folder: Path, text: bytes, chain: str = "C A Y F X Z", **words: str) -> olp.JointCorrection:
    return olp.correct_joints(text, machine_file(folder, chain, control="heidenhain", **words))


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "planes", "rotary", "most_um"), PLANES)
def test_holes_are_corrected_as_the_judge_finds(
    chain: str, planes: list[str], rotary: str, most_um: float, tmp_path: Path
) -> None:
    nominal = program(planes, rotary)
    result = corrected(tmp_path, nominal, chain)
    judge = TiltedJudge(tmp_path / "machine.toml")
    before, after = (judge.judged(nominal, text)[0] for text in (nominal, result.data))
    stated = result.report["deviation"]["after"]["position_max_um"]
    assert after * 1e3 <= stated < most_um < before * 1e3 / 2
    # one definition for each surface, and no block more than each hole has
    assert result.data.count(b"M99") == 3 and result.data.count(b"CYCL CALL") == 1
    behind = result.data.partition(b"CYCL DEF 200")[2].rpartition(b"M99")[0]
    assert not any(b" A" in line or b" C" in line for line in behind.splitlines() if line.startswith(b"L "))


SWIVELS = [
    ('CYCLE800(1,"TABLE",0,57,10,5,-20,30,20,15,0,0,3,1,0)', "Y-35.5"),
    ("", "Y-35.5 A0 C0"),
]


def called(folder: Path, swivel: str, first: str, between: str) -> tuple[bytes, olp.JointCorrection]:
    text = (
        f"G71 G90 G54 G17\nT1 M6\nD1\nG0 X0 Y0 Z200 A0 C0\n{swivel}\nG0 X0 {first}\nZ50\nF150\n"
        f"MCALL CYCLE81(50,0.5,2,-20)\nX10 Y20\n{between}\nMCALL\nG0 Y-35.5\n"
        "CYCLE85(50,0.5,2,-18,,0,150,300)\nG0 X-80.25 Y-60 Z10\nG1 X0 F500\nG0 Z60\nM30\n"
    ).encode()
    swivels = '[kinematics]\nswivel_axis = "A"\n'
    machine = machine_file(folder, "C A Y F X Z", control="sinumerik", extra=swivels)
    return text, olp.correct_joints(text, machine)


@pytest.mark.slow
@pytest.mark.parametrize(("swivel", "first"), SWIVELS)
def test_holes_of_called_cycles_are_corrected(swivel: str, first: str, tmp_path: Path) -> None:
    nominal, result = called(tmp_path, swivel, first, "X40")
    judge = TiltedJudge(tmp_path / "machine.toml")
    before, after = (judge.judged(nominal, text)[0] for text in (nominal, result.data))
    stated = result.report["deviation"]["after"]["position_max_um"]
    assert after * 1e3 <= stated + 1e-3 < 2.0 < before * 1e3 / 2
    assert result.data.count(b"CYCLE85") == 1


def test_a_feed_to_a_called_hole_is_one_block(tmp_path: Path) -> None:
    """Each block behind MCALL makes a hole, so none is inserted; what that leaves is named."""
    result = called(tmp_path, *SWIVELS[1], "G1 X40 F300")[1]
    calls = result.data.partition(b"MCALL ")[2].partition(b"MCALL\n")[0]
    assert len([line for line in calls.splitlines() if line.startswith((b"X", b"G1"))]) == 2
    assert [one.line for one in result.findings if one.code == "OLP101"] == [11]


def test_a_hole_that_leans_is_named(tmp_path: Path) -> None:
    deep = [line.replace("Q201=-20", "Q201=-200") for line in DRILL]
    found = corrected(tmp_path, program(PLANES[0][1], "A+Q120 C+Q122", cycle=deep)).findings
    assert [one.code for one in found if "along the stroke" in one.message] == ["OLP105"]


def test_without_errors_holes_stay(tmp_path: Path) -> None:
    text = program(PLANES[0][1], "A+Q120 C+Q122", number=207)
    machine = machine_file(tmp_path, "C A Y F X Z", control="heidenhain", errors=False)
    assert olp.correct_joints(text, machine).data == text


REFUSED = [
    (["CYCL DEF 1.0 PECKING", "CYCL DEF 1.1 SET UP 2", "CYCL DEF 1.2 DEPTH -10"], HOLES, "with Q203"),
    (DRILL, ["CYCL DEF 220 POLAR PATTERN"], "CYCL DEF 220"),
    (DRILL, ["CYCL CALL PAT F500"], "where the holes are"),
]


@pytest.mark.parametrize(("cycle", "holes", "message"), REFUSED)
def test_other_cycles_are_refused(cycle: list[str], holes: list[str], message: str, tmp_path: Path) -> None:
    with pytest.raises(olp.ProgramError, match=message):
        corrected(tmp_path, program(PLANES[0][1], "A+Q120 C+Q122", holes, cycle=cycle))


def test_a_table_takes_the_turn_of_a_plane_over(tmp_path: Path) -> None:
    """TABLE ROT turns it until X of the plane is along X of the machine; COORD ROT does not say where it
    is."""
    plane = ["PLANE SPATIAL SPA+0 SPB+0 SPC+30 STAY TABLE ROT"]
    result = corrected(tmp_path, program(plane, "A+Q120 C+Q122"))
    judge = TiltedJudge(tmp_path / "machine.toml")
    turn = np.array([[np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0]])
    tips, stands = np.vstack((0 * turn, 50 * turn)), np.zeros((2, 5))
    place = {}
    for angle in (30.0, -30.0):
        stands[:, judge.order.index("C")] = angle
        place[angle] = judge.solve(tips, stands)[:, judge.order.index("Y")]
    stated = min(place, key=lambda angle: abs(np.ptp(place[angle])))
    assert abs(np.ptp(place[stated])) < 1e-9
    again = corrected(tmp_path, program(plane, f"A+0 C{stated:+g}"))
    assert result.data.partition(b"FMAX M3")[2] == again.data.partition(b"FMAX M3")[2]
    with pytest.raises(olp.ProgramError, match="or TABLE ROT"):
        corrected(tmp_path, program([plane[0].replace("TABLE", "COORD")], "A+Q120 C+Q122"))
