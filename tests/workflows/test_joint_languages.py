"""Programs of Sinumerik and Heidenhain controls on machines with rotary axes, judged by an independent
forward."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from cases.joint_machines import machine_file, program
from judge.five_axis import Judge

import olp

#: mm and rad: half a last digit of 0.001 mm or deg, of three words and of two.
DIGITS_MM, DIGITS_RAD = 0.5e-3 * 3**0.5, np.radians(0.5e-3) * 2**0.5
CHAINS = ("C A Y F X Z", "C F X Y Z B", "F X Y Z C B")


def sinumerik(text: bytes, lead: str) -> bytes:
    """A program of G-code as a Sinumerik control has it."""
    text = text.replace(b"G21 G90 G54", b"G71 G90 G54\nT1 M6\nD1\n" + lead.encode())
    text = re.sub(rb"G43.4 H1 (.*)", rb"TRAORI(1)\nG0 \1", text)
    return text.replace(b"G49", b"TRAFOOF")


def corrected(folder: Path, text: bytes, chain: str, control: str, **words: str) -> olp.JointCorrection:
    machine = machine_file(folder, chain, control=control, **words)
    return olp.correct_joints(text, machine, tolerance_urad=2.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chain", "lead"),
    [(CHAINS[0], "ORIAXES"), *some_of_a_campaign(((CHAINS[2], "ORIVECT"), (CHAINS[1], "ORIVECT")), 2)],
)
def test_traori_is_corrected_as_the_judge_finds(chain: str, lead: str, tmp_path: Path) -> None:
    nominal = sinumerik(program(chain, seed=3, moves=3, tips=True), lead)
    result = corrected(tmp_path, nominal, chain, "sinumerik")
    assert result.report["verdict"]["ok"] and result.report["moves"]["with_tip_control"]
    distance, angle = Judge(tmp_path / "machine.toml").judged(nominal, result.data)
    assert distance <= 1.1e-3 + DIGITS_MM
    assert angle <= 2.2e-6 + DIGITS_RAD


def heidenhain(text: bytes) -> bytes:
    """A program of G-code as a Heidenhain control has it."""
    lines = [b"BEGIN PGM A MM", b"TOOL CALL 1 Z S1000"]
    for line in text.splitlines()[1:-1]:
        stated = re.sub(rb"([XYZABC])(?=\d)", rb"\1+", re.sub(rb"^G(?:[01]|43.4 H1) ", b"", line))
        if line.startswith(b"G43.4"):
            lines.append(b"FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS")
        rapid = line.startswith((b"G0", b"G43.4"))
        lines.append(b"L M129" if line == b"G49" else b"L " + stated + (b" R0 FMAX" if rapid else b" R0"))
    numbered = [b"%d %s" % (k, line) for k, line in enumerate([*lines, b"END PGM A MM"])]
    return b"\n".join(numbered) + b"\n"


def numbers(text: bytes) -> list[tuple[bytes, bytes]]:
    """The axis words of a program, one after the other, where each language has the same."""
    lines = [
        line
        for line in text.splitlines()
        if not re.search(rb"PGM|TCPM|CALL|olp|G21|M\d|G49|G71|[DT]\d|OR|TR", line)
    ]
    return re.findall(rb"([XYZABC])\+?([-\d.]+)", b"\n".join(lines))


@pytest.mark.parametrize("tips", [False, True])
@pytest.mark.parametrize("chain", CHAINS[:2])
def test_each_language_has_the_words_that_gcode_has(chain: str, tips: bool, tmp_path: Path) -> None:
    """One path in G-code, in Sinumerik and in Heidenhain words is corrected to the same numbers."""
    text = program(chain, seed=5, moves=3, tips=tips)
    wanted = numbers(corrected(tmp_path / "a", text, chain, "fanuc").data)
    assert len(wanted) > len(numbers(text))
    machine = machine_file(tmp_path / "b", chain, control="heidenhain")
    found = olp.correct_joints(heidenhain(text), machine, tolerance_urad=2.0)
    assert found.report["moves"]["with_tip_control"] == (5 if tips else 0)
    assert numbers(found.data) == wanted
    assert b"R0 FMAX\n" in found.data and b" L X+" in found.data
    text = sinumerik(text, "ORIAXES").replace(b"D1\n", b"" if not tips else b"D1\n")
    assert numbers(corrected(tmp_path / "c", text, chain, "sinumerik").data) == wanted


@pytest.mark.parametrize("control", ["sinumerik", "heidenhain"])
def test_without_errors_no_byte_changes(control: str, tmp_path: Path) -> None:
    text = program("C A Y F X Z", seed=2, moves=4, tips=True)
    text = heidenhain(text) if control == "heidenhain" else sinumerik(text, "ORIVECT")
    machine = machine_file(tmp_path, "C A Y F X Z", control=control, errors=False)
    assert olp.correct_joints(text, machine).data == text


S_HEAD = b"G71 G90 G54\nT1 M6\nD1\nG0 X0 Y0 Z0 A-20 C30\n"
H_HEAD = b"BEGIN PGM A MM\nTOOL CALL 1 Z\nL X+0 Y+0 Z+0 A-20 C+30 R0 FMAX\n"
REFUSED = [
    ("sinumerik", b"G1 C=ACP(20) F100\n", "turns it round", 5),
    ("sinumerik", b"G1 C=DC(330) F100\n", "shortest way", 5),
    ("sinumerik", b"G1 C=IC(5) F100\n", "a distance in G90", 5),
    ("sinumerik", b"SCALE X2\nG0 X0 Y0 Z0\nG1 X1 F100\n", "mirrored or scaled", 6),
    ("sinumerik", b"TRAORI(2)\n", "another transformation", 5),
    ("sinumerik", b"D0\nTRAORI\n", "no edge", 6),
    ("sinumerik", b"TRAORI\nD0\n", "D0 comes behind TRAORI", 6),
    ("sinumerik", b"TRANS X5\nTRAORI\n", "programmable frame", 6),
    ("sinumerik", b"TRAORI\nG1 A2=0 B2=0 C2=1 F100\n", "A2", 6),
    ("sinumerik", b"TRAORI\nSUPA G0 Z0\nG1 X5 F100\n", "X, Y, Z has not been commanded", 7),
    ("heidenhain", b"L IX+5 F100\n", "distance", 4),
    ("heidenhain", b"L IC+5 F100\n", "distance", 4),
    ("heidenhain", b"M126\nL C+300 F100\n", "shortest way", 5),
    ("heidenhain", b"FUNCTION TCPM F TCP AXIS SPAT PATHCTRL AXIS\n", "AXIS POS", 4),
    ("heidenhain", b"L A+Q120 C+Q122 FMAX\n", "parameters", 4),
    ("heidenhain", b"CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 C+5\n", "rotary axis", 5),
    ("heidenhain", b"M128\nL X+5 F100\n", "Y, Z has not been commanded", 5),
]


@pytest.mark.parametrize(("control", "text", "message", "line"), REFUSED)
def test_what_is_not_known_is_refused_with_its_line(
    control: str, text: bytes, message: str, line: int, tmp_path: Path
) -> None:
    head = S_HEAD if control == "sinumerik" else H_HEAD
    with pytest.raises(olp.ProgramError, match=message) as caught:
        corrected(tmp_path, head + text, "C A Y F X Z", control)
    assert caught.value.line == line


def test_the_tip_ends_where_m129_stands(tmp_path: Path) -> None:
    """M128 acts at the begin of its block, M129 at the end; a later part of the move takes it along."""
    text = (
        H_HEAD.replace(b"A-20 C+30", b"A+0 C+0")
        + b"L X+1 Y+1 Z+1 FMAX M128\nL X+90 A-30 F500 M129\nEND PGM A MM\n"
    )
    result = corrected(tmp_path, text, "C A Y F X Z", "heidenhain")
    assert result.report["moves"]["with_tip_control"] == 2
    parts = [line for line in result.data.splitlines() if line.startswith(b"L ")]
    assert len(parts) > 3 and [b"M129" in line for line in parts].index(True) == len(parts) - 1


def test_words_in_brackets_keep_them(tmp_path: Path) -> None:
    text = S_HEAD + b"G1 C=DC(32) F100\nX=AC(5)\nM30\n"
    lines = corrected(tmp_path, text, "C A Y F X Z", "sinumerik").data.splitlines()
    assert any(re.match(rb"G1 C=DC\([\d.]+\)", line) for line in lines)
    assert any(re.match(rb"X=AC\([\d.]+\) Y", line) for line in lines)


def test_a_rotated_frame_turns_with_the_words(tmp_path: Path) -> None:
    """A path in a frame about Z, and the same path without it, come to the same places."""
    turned = S_HEAD + b"ROT Z90\nG0 X0 Y0 Z0\nG1 X20 Z5 F100\nM30\n"
    plain = S_HEAD + b"G0 X0 Y0 Z0\nG1 Y20 Z5 F100\nM30\n"
    both = [
        corrected(tmp_path / name, text, "C A Y F X Z", "sinumerik").report
        for name, text in (("a", turned), ("b", plain))
    ]
    assert both[0]["deviation"]["before"] == pytest.approx(both[1]["deviation"]["before"])
    assert both[0]["verdict"]["ok"] and both[1]["verdict"]["ok"]


def vectors(chain: str, folder: Path, *, seed: int = 4, moves: int = 4) -> tuple[bytes, Path]:
    """A program of LN blocks, with normals here and there, and its machine."""
    machine = machine_file(folder, chain, control="heidenhain", digit=0.0001)
    judge, rng = Judge(machine), np.random.default_rng(seed)
    names = [name for name in judge.order if name not in "XYZ"]
    axes = np.array([0.0, 0.0, 0.0, *({"A": -25.0, "B": 20.0, "C": 40.0}[name] for name in names)])
    turns = " ".join(f"{name}{value:+.3f}" for name, value in zip(names, axes[3:], strict=True))
    lines = ["BEGIN PGM T MM", "TOOL CALL 1 Z S3000", f"L X+0 Y+0 Z+200 {turns} R0 FMAX"]
    tip = np.array([10.0, -20.0, 40.0])
    for number in range(moves):
        tip = tip + rng.uniform(-20, 20, 3)
        axes[3:] += rng.uniform(-5, 5, len(names))
        words = [
            f"{a}{v:+.4f}"
            for a, v in zip("XYZ", tip, strict=True)
            if not number or a == "X" or rng.random() < 0.7
        ]
        if number % 2:
            words += [f"N{a}{v:+.7f}" for a, v in zip("XYZ", (0.6, 0.0, 0.8), strict=True)]
        towards = judge.forward(axes[None], False)[1][0]
        words += [f"T{a}{v:+.7f}" for a, v in zip("XYZ", towards, strict=True)]
        lines.append("LN " + " ".join(words) + (" F MAX M128" if not number else " F1200"))
    lines += ["L Z+150 FMAX M129", "L Z+200 R0 FMAX M30", "END PGM T MM"]
    return "".join(f"{number} {line}\n" for number, line in enumerate(lines)).encode(), machine


def as_judged(text: bytes) -> bytes:
    """LN blocks in words that the judge reads: its I, J and K are the direction of the tool."""
    text = re.sub(rb" N[XYZ][-+][\d.]+", b"", text)
    return re.sub(rb" T([XYZ])", lambda m: b" " + {b"X": b"I", b"Y": b"J", b"Z": b"K"}[m[1]], text).replace(
        b"LN", b"G1"
    )


@pytest.mark.slow
@pytest.mark.parametrize("chain", [CHAINS[0], CHAINS[2], "F X Y Z C A"])
def test_vectors_of_heidenhain_blocks_are_corrected_as_the_judge_finds(chain: str, tmp_path: Path) -> None:
    text, machine = vectors(chain, tmp_path)
    result = olp.correct_joints(text, machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    distance, angle = Judge(machine).judged(as_judged(text), as_judged(result.data))
    assert distance <= 1.1e-3 + 0.1 * DIGITS_MM
    # the nearest pose along the path, which is chosen by the tip as well
    assert angle <= 4e-6
    again = olp.verify_joints(text, result.data, machine, tolerance_urad=2.0)
    assert again.report["verdict"]["ok"]


def test_a_tool_that_cannot_turn_is_proved_where_its_parts_are_planned(tmp_path: Path) -> None:
    """Beside the outer axis the rotary axes stay as programmed, and the tip is met all the same: the pose of
    the path that is nearest in place and angle is another one, microns away."""
    machine = machine_file(tmp_path, "F X Y Z C B", control="heidenhain", seed=2, digit=0.0001)
    directions = ["-0.0052579 TY-0.0031095", "-0.0012970 TY-0.0011679", "+0.0000000 TY+0.0069813"]
    lines = ["TOOL CALL 1 Z S3000", "L X+0 Y+0 Z+200 B+4 C+30 R0 FMAX"]
    for number, (words, z) in enumerate(zip(directions, (0.9999813, 0.9999985, 0.9999756), strict=True)):
        place = f"LN X{25 + 5 * number:+.4f} Y{3 * number - 11:+.4f} Z{43 + number:+.4f} TX{words} TZ+{z}"
        lines.append(place + (" F1200" if number else " F MAX M128"))
    text = "\n".join(["BEGIN PGM T MM", *lines, "END PGM T MM", ""]).encode()
    report = olp.correct_joints(text, machine, tolerance_urad=2.0).report
    assert report["orientation"]["near_singular"]
    assert report["deviation"]["after"]["position_max_um"] < 1.0
    assert report["deviation"]["after"]["orientation_max_urad"] > 100.0


def test_angles_of_rapids_are_no_uncorrectable_ones(tmp_path: Path) -> None:
    """A rapid before tool centre point control keeps its rotary words; what cuts is turned."""
    text = b"0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S1000\n2 L X+0 Y+0 Z+200 B+20 C+30 R0 FMAX\n"
    text += b"3 L X+0 Y+0 Z+40 B+20 C+30 R0 FMAX M128\n4 L X+10 F1000\n5 L M129\n6 END PGM A MM\n"
    report = corrected(tmp_path, text, "F X Y Z C B", "heidenhain").report
    assert report["deviation"]["before"]["orientation_max_urad"] > 20.0
    assert report["orientation"]["uncorrectable_urad"] < 0.1


def test_vectors_are_written_as_they_are_programmed(tmp_path: Path) -> None:
    text, machine = vectors("C A Y F X Z", tmp_path, moves=3)
    result = olp.correct_joints(text, machine, tolerance_urad=2.0)
    blocks = [line for line in result.data.decode().splitlines() if " LN " in line]
    assert len(blocks) > len(re.findall(rb" LN ", text))
    number = r"[-+]\d+\.\d"
    direction = rf"( N[XYZ]{number}+){{0,3}} TX({number}{{7}}) TY({number}{{7}}) TZ({number}{{7}})"
    form = re.compile(rf"\d+ LN( [XYZ]{number}+)+{direction}( F MAX M128| F1200)?")
    for block in blocks:
        match = form.fullmatch(block)
        assert match is not None, block
        assert abs(np.linalg.norm([float(one) for one in match.groups()[2:5]]) - 1.0) < 2e-7
    # a later part of a block states all numbers, and the normal of the surface
    first = {block.split()[0]: block for block in reversed(blocks)}
    for block in (block for block in blocks if block != first[block.split()[0]]):
        assert re.match(r"\d+ LN X\S+ Y\S+ Z\S+ [NT]X", block)
        assert ("NX+0.6000000 NY+0.0000000 NZ+0.8000000 TX" in block) == ("NX" in first[block.split()[0]])
    # the block behind them turns nothing but for the correction
    assert re.search(r"\d+ L Z\S+ X\S+ Y\S+ A-2\S+ C\+?\d\S+ FMAX M129", result.data.decode())
    assert (
        olp.correct_joints(
            text, machine_file(tmp_path, "C A Y F X Z", control="heidenhain", errors=False)
        ).data
        == text
    )


VECTORS = (
    H_HEAD + b"M128\nL X+1 Y+1 Z+9 FMAX\nLN X+2 NX+0 NY+0 NZ+1 TX+0.3 TY+0.15 TZ+0.9 F100\nEND PGM A MM\n"
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"CALL 1 Z", b"CALL 1 Z DR-0.05", "DL and DR"),
        (b"CALL 1 Z", b"CALL 1 Z DL+0.1", "DL and DR"),
        (b"CALL 1 Z", b"CALL 1 Z DR2:+0.1", "DL and DR"),
        (b" TX+0.3 TY+0.15 TZ+0.9", b"", "TX, TY and TZ"),
        (b" TZ+0.9", b" TX+0.9", "TX, TY and TZ"),
        (b" NZ+1", b"", "NX, NY and NZ"),
        (b"TX+0.3 TY+0.15 TZ+0.9", b"TX+0 TY+0 TZ+0", "no length"),
        (b"LN X+2", b"LN", "no coordinate"),
        (b"LN X+2", b"LN X+2 C+3", "beside words of rotary axes"),
        (b"M128\n", b"", "behind M128"),
        (b"LN X+2", b"L X+2", "not understood"),
    ],
)
def test_blocks_with_vectors_that_are_not_clear_are_refused(
    old: bytes, new: bytes, message: str, tmp_path: Path
) -> None:
    assert VECTORS.count(old) >= 1
    with pytest.raises(olp.ProgramError, match=message) as caught:
        corrected(tmp_path, VECTORS.replace(old, new, 1), "C A Y F X Z", "heidenhain")
    assert caught.value.line == 6 - (old == b"M128\n")


@pytest.mark.parametrize("call", [b"CALL 1 Z DL+0 DR+0.000", b"CALL 1 Z DR2:0"])
def test_a_call_with_differences_of_zero_is_read(call: bytes, tmp_path: Path) -> None:
    text = VECTORS.replace(b"CALL 1 Z", call).replace(b"A-20 C+30", b"A-20 C+60")
    assert corrected(tmp_path, text, "C A Y F X Z", "heidenhain").data.count(b"\nLN ") > 1
