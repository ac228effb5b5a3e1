"""Programs whose words state the direction of the tool, judged by an independent forward."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from cases.joint_machines import machine_file, program
from judge.five_axis import Judge

import olp

#: mm and rad: half a last digit of 0.001 mm, of three words, and of 1e-7 of three components. A tip that is
#: rounded along the path is beside another direction.
DIGITS_MM = 0.5e-3 * 3**0.5
DIGITS_RAD = 0.5e-7 * 3**0.5 + DIGITS_MM / 200.0
CHAINS = ("C A Y F X Z", "C F X Y Z B", "F X Y Z C B", "F X Y Z C A")


#: The words of a direction, by control.
WORDS = {"fanuc": ("I", "J", "K"), "sinumerik": ("A3=", "B3=", "C3=")}


def directed(judge: Judge, text: bytes, control: str) -> bytes:
    """A program in tool centre point control with directions in place of rotary words."""
    moves, lines, number = judge.read(text), [], -1
    for line in text.decode().splitlines():
        number += bool(re.search(r"[XYZABC]-?[\d.]", line))
        if number >= 0 and moves[number][1] and re.search(r"[ABC]-?[\d.]", line):
            towards = judge.forward(np.nan_to_num(moves[number][2])[None], False)[1][0]
            pairs = zip(WORDS[control], towards, strict=True)
            stated = "".join(f" {letter}{value:.6f}" for letter, value in pairs)
            line = re.sub(r"\s*[ABC]-?[\d.]+", "", line) + stated
        lines.append(line.replace("G43.4", "G43.5"))
    text = "\n".join(lines).encode() + b"\n"
    if control == "sinumerik":
        text = text.replace(b"G21 G90 G54", b"G71 G90 G54\nT1 M6\nD1\nORIVECT")
        text = re.sub(rb"G43.5 H1 (.*)", rb"TRAORI(1)\nG0 \1", text).replace(b"G49", b"TRAFOOF")
    return text


@pytest.mark.slow
@pytest.mark.parametrize("control", ["fanuc", "sinumerik"])
@pytest.mark.parametrize("chain", some_of_a_campaign(CHAINS, 4))
def test_directions_are_corrected_as_the_judge_finds(chain: str, control: str, tmp_path: Path) -> None:
    machine = machine_file(tmp_path, chain, control=control)
    judge = Judge(machine)
    nominal = directed(judge, program(chain, seed=3, moves=2, tips=True), control)
    result = olp.correct_joints(nominal, machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"], result.to_text()
    distance, angle = judge.judged(nominal, result.data)
    assert distance <= 1.1e-3 + DIGITS_MM
    assert angle <= 2.2e-6 + DIGITS_RAD


#: Job files with the rotary positions at the start of cutter-location data, on machines with B and with A.
STARTS = (
    'schema = "olp-job-1"\nstart_deg = { B = 15.0, C = 30.0 }\n',
    'schema = "olp-job-1"\nstart_deg = { A = -20.0, C = 30.0 }\n',
)


def points(judge: Judge, chain: str, seed: int, moves: int = 4) -> bytes:
    """The moves with directions as cutter-location data; one point has the direction of the one before."""
    lines, count = ["PARTNO/FIVE AXES", "UNITS/MM", "MULTAX/ON", "LOADTL/1", "RAPID"], 0
    for cuts, tips, place in judge.read(program(chain, seed=seed, moves=moves, tips=True)):
        if not tips:
            continue
        towards = judge.forward(np.nan_to_num(place)[None], False)[1][0]
        numbers = [f"{place[judge.order.index(name)]:.4f}" for name in "XYZ"]
        numbers += [f"{value:.7f}" for value in towards] if count != 2 else []
        lines += ["FEDRAT/500.,MMPM"] if cuts and count == 1 else []
        lines.append("GOTO/" + ",".join(numbers))
        count += 1
    return ("\n".join([*lines, "FINI"]) + "\n").encode()


def as_blocks(text: bytes) -> bytes:
    """Points as blocks that the judge reads, and where the rotary axes are at the start."""
    lines, rapid = ["G0 X0. Y0. Z0. A-20. B15. C30.", "G43.5"], False
    for line in text.decode().splitlines():
        if line.startswith("GOTO/"):
            numbers = line[5:].split(",")
            words = " ".join(f"{letter}{number}" for letter, number in zip("XYZIJK", numbers, strict=False))
            lines.append(f"G{0 if rapid else 1} {words}")
        rapid = line == "RAPID"
    return "\n".join(lines).encode()


@pytest.mark.slow
@pytest.mark.parametrize("chain", some_of_a_campaign(CHAINS[::-1], 4))
def test_points_with_directions_are_corrected_as_the_judge_finds(chain: str, tmp_path: Path) -> None:
    machine, job = machine_file(tmp_path, chain, control="fanuc"), tmp_path / "job.toml"
    job.write_text(STARTS["A" in chain])
    judge = Judge(machine)
    nominal = points(judge, chain, seed=3)
    result = olp.correct_joints(nominal, machine, job, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"], result.to_text()
    judge.vector = True
    distance, angle = judge.judged(as_blocks(nominal), as_blocks(result.data))
    assert distance <= 1.1e-3 + DIGITS_MM
    assert angle <= 2.2e-6 + DIGITS_RAD


def test_points_keep_their_form(tmp_path: Path) -> None:
    """Without errors no byte changes; with them a point that goes on in the next line still does, and one
    behind TLAXIS states its direction."""
    text = b"UNITS/MM\nLOADTL/1\nTLAXIS/-0.2,-0.3,0.9327379\nGOTO/1.,2.,3.\nMULTAX/ON\nFEDRAT/500.,MMPM\n"
    text += b"GOTO/20.,2.,3.,$\n -0.25,-0.3,0.9205977\nGOTO/25.,2.,3.\nFINI\n"
    job = tmp_path / "job.toml"
    job.write_text(STARTS[1])
    exact = machine_file(tmp_path / "exact", CHAINS[0], errors=False)
    assert olp.correct_joints(text, exact, job).data == text
    result = olp.correct_joints(text, machine_file(tmp_path / "m", CHAINS[0]), job, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    numbers = [line.count(b",") for line in result.data.splitlines() if line.startswith(b"GOTO/")]
    assert numbers[0] == 5 and 3 in numbers and b",$\n" in result.data
    again = olp.verify_joints(text, result.data, exact.parents[1] / "m" / "machine.toml", job)
    assert again.report["verdict"]["ok"]


POINTS = b"UNITS/MM\nLOADTL/1\nGOTO/1.,2.,3.,-0.2,-0.3,0.9327379\n"
NO_POINTS = [
    (POINTS + b"CYCLE/DRILL,DEPTH,5.,MMPM,100.,CLEAR,2.\nGOTO/5.,2.,3.\nFINI\n", "a CYCLE", 5, True),
    (POINTS + b"CIRCLE/0.,0.,3.,0.,0.,1.,5.\nGOTO/5.,2.,3.\nFINI\n", "an arc", 5, True),
    (POINTS + b"GODLTA/1.,0.,0.\nFINI\n", "a distance", 4, True),
    (POINTS + b"FINI\n", "start_deg", 3, False),
    (POINTS + b"FROM/0.,0.,50.,0.,0.,1.\nFINI\n", "has a tool axis", 4, True),
]


@pytest.mark.parametrize(("text", "message", "line", "started"), NO_POINTS)
def test_points_that_are_not_corrected_are_refused(
    text: bytes, message: str, line: int, started: bool, tmp_path: Path
) -> None:
    job = tmp_path / "job.toml"
    job.write_text(STARTS[1] if started else STARTS[1].splitlines()[0])
    with pytest.raises(olp.ProgramError, match=message) as caught:
        olp.correct_joints(text, machine_file(tmp_path, CHAINS[0]), job)
    assert caught.value.line == line


@pytest.mark.parametrize("control", ["fanuc", "sinumerik"])
def test_without_errors_no_byte_changes(control: str, tmp_path: Path) -> None:
    machine = machine_file(tmp_path, CHAINS[0], control=control, errors=False)
    text = directed(Judge(machine), program(CHAINS[0], seed=2, moves=5, tips=True), control)
    assert olp.correct_joints(text, machine).data == text


F_HEAD = b"G21 G90 G54\nG0 X0 Y0 Z0 A-20. C30.\nG43.5 H1 X0 Y0 Z0\n"
S_HEAD = b"G71 G90 G54\nT1 M6\nD1\nG0 X0 Y0 Z0 A-20 C30\nTRAORI\nG0 X0 Y0 Z0\n"


def corrected(folder: Path, text: bytes, control: str) -> olp.JointCorrection:
    zero = '[kinematics]\ntcp_frame_zero = "axis-zero"\n'
    machine = machine_file(folder, CHAINS[0], control=control, extra=zero)
    return olp.correct_joints(text, machine, tolerance_urad=2.0)


REFUSED = [
    ("fanuc", F_HEAD + b"G1 X5. A-10. F100.\n", "where I, J, K state the direction", 4),
    ("fanuc", F_HEAD + b"G1 X5. I0 J0 K0 F100.\n", "has no length", 4),
    ("fanuc", F_HEAD + b"G1 X5. I0. J0.5 K1 F100.\n", "decimal point", 4),
    ("fanuc", F_HEAD + b"G1 I0. I0.1 K1. F100.\n", "twice", 4),
    ("fanuc", F_HEAD + b"G1 X5. I0.00001 J0. K1. F100.\n", "nearly along the axis of C", 4),
    ("fanuc", F_HEAD.replace(b"G43.5", b"G43.4") + b"G1 X5. I0. J0. K1. F100.\n", "no mode", 4),
    ("fanuc", F_HEAD + b"G1 X5. I0. J0. K1. F100.\nI0.3 J-0.2 K0.9\n", "about as far", 5),
    # C by 100 deg and A by none, or C by 80 deg and A by 170: a control may count the way of C alone
    (
        "fanuc", F_HEAD.replace(b"A-20. C30.", b"A-85. C0.") + b"G1 X5. I-0.98106 J0.17299 K0.08716 F100.\n",
        "nearer one by another axis", 4,
    ),
    ("sinumerik", S_HEAD + b"G1 A=5 A3=0 B3=0 C3=1 F100\n", "beside words", 7),
    ("sinumerik", S_HEAD + b"TRAFOOF\nG1 A3=0 B3=0 C3=1 F100\n", "no mode", 8),
    ("sinumerik", S_HEAD + b"G1 A3=R1 B3=0 C3=1 F100\n", "--flatten", 7),
]  # fmt: skip


@pytest.mark.parametrize(("control", "text", "message", "line"), REFUSED)
def test_what_is_not_known_is_refused_with_its_line(
    control: str, text: bytes, message: str, line: int, tmp_path: Path
) -> None:
    with pytest.raises(olp.ProgramError, match=message) as caught:
        corrected(tmp_path, text, control)
    assert caught.value.line == line


def test_along_the_outer_axis_it_keeps_its_position(tmp_path: Path) -> None:
    """There a correction of some urad would turn the table by degrees: it stays, and that is said."""
    text = F_HEAD + b"G1 X5. I0. J0. K1. F100.\nX9.\nX20. I-0.2 J-0.3 K0.9\nM30\n"
    result = corrected(tmp_path, text, "fanuc")
    assert b"I0.0000000 J0.0000000 K1.0000000" in result.data
    assert [one.code for one in result.findings] == ["OLP106"]
    assert result.report["verdict"]["ok"]


def test_a_direction_holds_until_the_next_one(tmp_path: Path) -> None:
    """A block without one gets one where the correction needs it, in the order of the letters."""
    text = F_HEAD + b"G1 X5. I-0.2 J-0.3 K0.9 F100.\nX300. Y200.\nM30\n"
    lines = [line for line in corrected(tmp_path, text, "fanuc").data.splitlines() if b"I" in line]
    assert len(lines) > 2
    assert all(re.search(rb"I-?0\.\d{7} J-?0\.\d{7} K0\.\d{7}", line) for line in lines[1:])


AWAY = b"I-0.2 J-0.3 K0.9"


def test_a_move_that_is_kept_before_the_outer_axis_is_free(tmp_path: Path) -> None:
    text = F_HEAD + b"G1 X5. I0 J0 K1 F100.\nG53 G0 Z0\nG0 X5. Y0 Z50.\nM30\n"
    assert corrected(tmp_path, text, "fanuc").report["verdict"]["ok"]


@pytest.mark.parametrize("control", ["fanuc", "sinumerik"])
def test_a_direction_in_force_is_not_stated_again(control: str, tmp_path: Path) -> None:
    """Where nothing turns, no byte changes: behind words of axes, at the begin, and in another frame."""
    zero = '[kinematics]\ntcp_frame_zero = "axis-zero"\n'
    machine = machine_file(tmp_path, CHAINS[0], control=control, errors=False, extra=zero)
    text = F_HEAD + b"G1 X5. " + AWAY + b" F100.\nM30\n"
    if control == "sinumerik":
        text = S_HEAD + b"G1 X5 A3=-0.2 B3=-0.3 C3=0.9 F100\nROT Z30\nX7 Y0 Z0\nROT\nX9 Y0 Z0\nM30\n"
    assert olp.correct_joints(text, machine).data == text


def test_points_go_on_behind_a_change_of_tool(tmp_path: Path) -> None:
    """TLAXIS states a direction each time, and a deck of cards stays one."""
    job = tmp_path / "job.toml"
    job.write_text(STARTS[1])
    machine = machine_file(tmp_path, CHAINS[0], extra="")
    axis = b"TLAXIS/-0.2,-0.3,0.9327379\n"
    text = b"UNITS/MM\nLOADTL/1\n" + axis + b"GOTO/1.,2.,3.\nFEDRAT/500.,MMPM\n" + axis + b"GOTO/5.,2.,3.\n"
    text += b"LOADTL/1\nRAPID\nGOTO/5.,2.,3.,-0.2,-0.3,0.9327379\nGOTO/9.,2.,3.\nFINI\n"
    result = olp.correct_joints(text, machine, job, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"], result.to_text()
    cards = b"".join(b"%-72s%08d\n" % (line, 10 * k) for k, line in enumerate(text.splitlines(), 1))
    carded = olp.correct_joints(cards, machine, job, tolerance_urad=2.0)
    assert carded.report["verdict"]["ok"]
    assert {len(line) for line in carded.data.splitlines()} == {80}


def test_a_frame_that_turns_takes_the_tool_along(tmp_path: Path) -> None:
    """Points without a direction have the numbers of the one before, in the new frame too."""
    job = tmp_path / "job.toml"
    job.write_text(STARTS[1])
    axis, turn = (
        b",-0.2,-0.3,0.9327379\n",
        b"TRACUT/.9396926208,-.3420201433,0,10,.3420201433,.9396926208,0,0,0,0,1,0\n",
    )
    head = b"UNITS/MM\nLOADTL/1\nGOTO/1.,2.,3." + axis + b"FEDRAT/500.,MMPM\n" + turn
    machine = machine_file(tmp_path, CHAINS[0])
    ends = [
        olp.correct_joints(head + b"GOTO/20.,2.,3." + last + b"FINI\n", machine, job).data.splitlines()[-2]
        for last in (b"\n", axis)
    ]
    assert ends[0] == ends[1]


MORE_REFUSED = [
    ("fanuc", F_HEAD + b"G1 X5. " + AWAY + b" F100.\nG49\nG0 X0 Y0 Z0\nG91 G0 C1.\n", "a distance of a", 7),
    ("sinumerik", S_HEAD + b"G1 X5 A3=0 B3=0 C3=1 F100\nX9 A3=-0.25 B3=-0.3 C3=0.9\n", "near by|open", 8),
]


@pytest.mark.parametrize(("control", "text", "message", "line"), MORE_REFUSED)
def test_more_that_is_not_known_is_refused(
    control: str, text: bytes, message: str, line: int, tmp_path: Path
) -> None:
    with pytest.raises(olp.ProgramError, match=message) as caught:
        corrected(tmp_path, text, control)
    assert caught.value.line == line


def test_a_head_near_the_end_of_its_reach_is_proved(tmp_path: Path) -> None:
    """There the inner axis hangs on the digits of a direction, too."""
    text = b"G21 G90 G54\nG0 X0 Y0 Z0 A160. C30.\nG43.5 H1 X0 Y0 Z0\n"
    text += b"G1 X5. I0.8771635 J0.3861236 K0.2854692 F100.\nX9. I0.8825478 J0.3683607 K0.2922667\n"
    machine = machine_file(tmp_path, "F X Y Z C A", control="fanuc")
    assert olp.correct_joints(text, machine, tolerance_urad=2.0).report["verdict"]["ok"]
