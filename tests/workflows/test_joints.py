"""Programs on machines with rotary axes: corrected, proved, refused, and judged by an independent forward."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast, some_of_a_campaign
from cases.joint_machines import STRUCTURES, machine_file, program
from click.testing import CliRunner
from judge.five_axis import Judge

import olp
from olp.cli import main

#: mm and rad: half a last digit of 0.001 mm or deg, of three words and of two.
DIGITS_MM, DIGITS_RAD = 0.5e-3 * 3**0.5, np.radians(0.5e-3) * 2**0.5
HEAD = b"G21 G90 G54\nG0 X0 Y0 Z0 A-20 C30\n"
CASES = [(chain, tips) for chain in STRUCTURES for tips in (False, True)]


def corrected(folder: Path, text: bytes, chain: str = "C A Y F X Z", **words: object) -> olp.JointCorrection:
    return olp.correct_joints(text, machine_file(folder, chain, **words), tolerance_urad=2.0)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "tips"), some_of_a_campaign(CASES, 3))
def test_the_judge_finds_the_corrected_path_within_tolerance(chain: str, tips: bool, tmp_path: Path) -> None:
    machine = machine_file(tmp_path, chain, control="fanuc" if tips else "linuxcnc", seed=7)
    text = program(chain, seed=4, tips=tips)
    result = olp.correct_joints(text, machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    judge = Judge(machine)
    before, after = judge.judged(text, text), judge.judged(text, result.data)
    left = 1e-6 * result.report["orientation"]["uncorrectable_urad"]
    assert before[0] > 10e-3
    assert after[0] < 1e-3 + DIGITS_MM
    assert after[1] < 2e-6 + DIGITS_RAD + left
    stated = result.report["deviation"]["after"]
    assert after[0] == pytest.approx(1e-3 * stated["position_max_um"], abs=0.15e-3)
    assert after[1] == pytest.approx(1e-6 * stated["orientation_max_urad"], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("inch", [False, True])
def test_linear_digits_that_are_finer_than_rotary_ones_keep_the_ends_of_moves(
    inch: bool, tmp_path: Path
) -> None:
    """Linear words take up what 0.001 deg do to the tip, 3 um, which are many of their own digits."""
    machine = machine_file(tmp_path, "C A Y F X Z", seed=3)
    text = program("C A Y F X Z", seed=6)
    if inch:
        text = b"G20 G90 G54\nG0 X1. Y-2. Z3. A-20. C340.\nG1 X2. Y-1. C350. F50.\nX3. Z2. A-30. C360.\nM30\n"
    else:
        finer = re.sub(r"least_increment_mm = .*", "least_increment_mm = 0.00001", machine.read_text())
        machine.write_text(finer)
    result = olp.correct_joints(text, machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"], result.to_text()
    assert inch or Judge(machine).judged(text, result.data)[0] < 1e-3


@pytest.mark.slow
def test_moves_shorter_than_their_errors_are_judged(tmp_path: Path) -> None:
    rng, place, lines = np.random.default_rng(1), np.array([0.0, 0.0, 0.0, -20.0, 30.0]), []
    for step in ([10.0] * 3 + [8.0] * 2, *3 * [[0.03] * 3 + [0.02] * 2]):
        place = place + np.array(step) * rng.normal(0.0, 1.0, 5)
        lines.append("G1 X{:.3f} Y{:.3f} Z{:.3f} A{:.3f} C{:.3f} F500\n".format(*place))
    text, machine = HEAD + "".join(lines).encode() + b"M30\n", machine_file(tmp_path, "C A Y F X Z", seed=1)
    result = olp.correct_joints(text, machine, tolerance_urad=2.0)
    far, turned = Judge(machine).judged(text, result.data)
    stated = result.report["deviation"]["after"]
    assert far == pytest.approx(1e-3 * stated["position_max_um"], abs=0.15e-3)
    assert turned < 1e-6 * (stated["orientation_max_urad"] + 1.0)


@pytest.mark.parametrize(("chain", "tips"), some_fast(CASES, 11))
def test_without_errors_no_byte_changes(chain: str, tips: bool, tmp_path: Path) -> None:
    machine = machine_file(tmp_path, chain, control="fanuc" if tips else "linuxcnc", errors=False)
    text = program(chain, seed=2, tips=tips)
    assert olp.correct_joints(text, machine).data == text


def test_what_is_no_axis_word_stays(tmp_path: Path) -> None:
    text = HEAD + b"N10 (cut) G1  x5.0\ty-2 F100 S300 ; now\r\nN20 G1 A-21 M5\nM30\n"
    done = corrected(tmp_path, text).data
    kept = re.sub(rb"(?i)[ \t]*[XYZAC]-?[\d.]+", b"", done)
    stamp = kept.splitlines(keepends=True)[0]
    assert b"olp-corrected" in stamp
    for part in (b"N10 (cut) G1", b"F100 S300 ; now\r\n", b"N20 G1", b"M30\n"):
        assert part in kept
    assert kept.count(b"M5") == 1


def test_the_program_counts_increments_inches_and_time(tmp_path: Path) -> None:
    text = b"G20 G90 G54\nG0 X0 Y0 Z0 A-20 C30\nG93 G91 G1 X1.5 A-4 C8 F2\nX-0.5 C-8 F4\nG90\nM30\n"
    result = corrected(tmp_path, text, digit=0.0001)
    assert result.report["verdict"]["ok"]
    feeds = [float(f) for f in re.findall(rb"F([\d.]+)", result.data)]
    assert len(feeds) == result.report["moves"]["parts"] - 1
    assert sum(1.0 / f for f in feeds) == pytest.approx(0.75, abs=1e-3)


def test_a_work_offset_with_rotary_values(tmp_path: Path) -> None:
    words = HEAD + b"G1 X20 A-25 F100\nM30\n"
    turned = corrected(tmp_path, words, offset="X_mm = 30.0\nA_deg = 5.0\n")
    plain = HEAD.replace(b"X0", b"X30").replace(b"A-20", b"A-15") + b"G1 X50 A-20 F100\nM30\n"
    straight = corrected(tmp_path / "b", plain)
    stated = turned.report["deviation"]["after"]
    assert stated == pytest.approx(straight.report["deviation"]["after"], abs=1e-6)
    assert turned.report["largest_correction"] == pytest.approx(
        straight.report["largest_correction"], abs=1e-6
    )


def test_a_touched_offset_moves_the_part(tmp_path: Path) -> None:
    """At the touched position the tip is where it should be, and elsewhere it comes there."""
    machine = machine_file(tmp_path, "F X Y Z C B", offset="X_mm = 12.0\n")
    machine.write_text(
        machine.read_text().replace('set_by = "true"\n', "touched_at_mm = { X = 12.0, Y = 0.0, Z = 0.0 }\n")
    )
    kinematics = olp.load_kinematics(machine)
    values = kinematics.structure.axis_values({"X": 12.0})
    assert np.linalg.norm(kinematics.deviation(values)[0]) > 7e-3
    text = b"G90 G54\nG0 X0 Y0 Z0 B0 C0\nG1 X0.001 F100\nM30\n"
    here = olp.correct_joints(text, machine).report["deviation"]
    # half of the backlash is left, of 7 um and more
    assert here["before"]["position_max_um"] < 4.0
    away = text.replace(b"M30", b"G1 X25 Y-14 B6 C9\nM30")
    there = olp.correct_joints(away, machine).report["deviation"]
    assert there["holds"]
    assert there["after"]["position_max_um"] < 2.0 < there["before"]["position_max_um"]


REFUSED = [
    (b"G1 B5 F100\n", "OLP564", 3),
    (b"G92 A0\n", "OLP564", 3),
    (b"G1 F100 Z-1\nG81 X1 Z-5 R2\nG80\n", "OLP565", 4),
    (b"G1 A900 F100\n", "OLP567", 3),
    (b"G1 A1 A2 F100\n", "OLP515", 3),
]


@pytest.mark.parametrize(("text", "code", "line"), REFUSED)
def test_what_is_not_corrected_is_refused_with_its_line(
    tmp_path: Path, text: bytes, code: str, line: int
) -> None:
    with pytest.raises(olp.ProgramError) as caught:
        corrected(tmp_path, HEAD + text)
    assert (caught.value.code, caught.value.line) == (code, line)


@pytest.mark.parametrize("block", ["G91 G28 C0", "G28 C0", "G91 G28 Z0 C0"])
def test_a_rotary_axis_at_its_reference_position_is_not_known(tmp_path: Path, block: str) -> None:
    text = b"G90 G54\nG0 X0 Y0 Z0 A0 C30\n" + block.encode() + b"\nG90 Z5\nG1 X10 F100\nM30\n"
    machine = machine_file(tmp_path, "C A Y F X Z")
    with pytest.raises(olp.ProgramError, match=" C has not been commanded") as caught:
        olp.correct_joints(text, machine)
    assert (caught.value.code, caught.value.line) == ("OLP524", 5)
    again = olp.correct_joints(text.replace(b"G90 Z5", b"G90 G0 Z5 C30"), machine)
    assert again.report["deviation"]["holds"]
    assert block.encode() + b"\n" in again.data


def test_a_feed_from_nowhere_is_refused_and_a_start_is_taken(tmp_path: Path) -> None:
    text = b"G90 G54\nG0 X0 Y0 Z0\nG1 X10 F100\nM30\n"
    machine = machine_file(tmp_path, "C A Y F X Z")
    with pytest.raises(olp.ProgramError, match="A, C has not been commanded") as caught:
        olp.correct_joints(text, machine)
    assert (caught.value.code, caught.value.line) == ("OLP524", 3)
    job = tmp_path / "job.toml"
    job.write_text('schema = "olp-job-1"\nstart_deg = { A = -10.0, C = 5.0 }\n')
    assert olp.correct_joints(text, machine, job).report["verdict"]["ok"]


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (b"G0 X0 Y0 Z0 A0 C5\nG43.4 H1 X0 Y0 Z5 A-10\n", "not at zero"),
        (b"G0 X0 Y0 Z0 A0 C0\nG43.4 H2 X0 Y0 Z5 A-10\n", "another tool"),
        (b"G0 X0 Y0 Z0 A0 C0\nG43.4 H1 Z5\nG1 X10 F100\n", "X, Y has not been commanded"),
    ],
)
def test_a_tip_that_is_not_known_is_refused(tmp_path: Path, head: bytes, message: str) -> None:
    with pytest.raises(olp.ProgramError, match=message):
        corrected(tmp_path, b"G90 G54\n" + head + b"G1 X1 F100\nM30\n", control="fanuc")


def test_tips_and_axis_words_of_one_path_end_at_the_same_commands(tmp_path: Path) -> None:
    machine = machine_file(tmp_path, "C F X Y Z B", control="fanuc", digit=0.000001)
    run = olp.load_kinematics(machine, tool=1)
    pose = run.structure.axis_values({"X": 30.0, "Y": -10.0, "Z": 20.0, "B": 15.0, "C": 40.0})
    from olp.kinematics.programmed import tips_of_axes

    tips = dict(zip(run.structure.order, tips_of_axes(run, pose)[0].tolist(), strict=True))
    axes = dict(zip(run.structure.order, pose[0].tolist(), strict=True))
    texts = [
        b"G90 G54\nG0 X0. Y0. Z0. B0. C0.\n"
        + f"{code} {' '.join(f'{n}{v:.6f}' for n, v in place.items())}\n".encode()
        for code, place in (("G0", axes), ("G43.4 H1", tips))
    ]
    shifts = []
    for text, place in zip(texts, (axes, tips), strict=True):
        line = olp.correct_joints(text, machine).data.splitlines()[3].decode()
        shifts.append({n: float(re.search(rf"{n}(-?[\d.]+)", line)[1]) - place[n] for n in "BC"})  # type: ignore[index]
    assert shifts[0] == pytest.approx(shifts[1], abs=2e-6)


def test_verify_sees_one_wrong_digit(tmp_path: Path) -> None:
    machine = machine_file(tmp_path, "C F X Y Z B")
    text = program("C F X Y Z B", seed=9)
    data = olp.correct_joints(text, machine).data
    good = olp.verify_joints(text, data, machine)
    assert good.report["verdict"]["ok"]
    lines = data.splitlines(keepends=True)
    place = next(i for i in range(8, len(lines)) if b"C" in lines[i])
    wrong = re.sub(
        rb"C(-?\d+\.\d)(\d)", lambda m: b"C" + m[1] + str((int(m[2]) + 2) % 10).encode(), lines[place]
    )
    faulty = b"".join([*lines[:place], wrong, *lines[place + 1 :]])
    assert not olp.verify_joints(text, faulty, machine).report["verdict"]["ok"]
    with pytest.raises(olp.ProgramError, match="fewer"):
        olp.verify_joints(text, b"G90\nG0 X0 Y0 Z0 B0 C0\n", machine)
    with pytest.raises(olp.ProgramError, match="exchange"):
        olp.verify_joints(data, text, machine)
    with pytest.raises(olp.ProgramError, match="second one"):
        olp.correct_joints(data, machine)


def test_a_path_out_of_the_calibrated_box_is_refused_or_held(tmp_path: Path) -> None:
    machine = machine_file(tmp_path, "C A Y F X Z")
    calibration = tmp_path / "calibration.toml"
    calibration.write_text(calibration.read_text().replace("A_deg = [-720", "A_deg = [-22"))
    text = HEAD + b"G1 A-25 F100\nM30\n"
    with pytest.raises(olp.InputError, match="outside the calibrated -22 to 720"):
        olp.correct_joints(text, machine)
    held = olp.correct_joints(text, machine, outside_box="hold")
    assert [one.code for one in held.findings] == ["OLP403"]


def test_backlash_is_taken_up_where_an_axis_turns_round(tmp_path: Path) -> None:
    play = "[backlash]\nX_um = 6.0\nC_urad = 80.0\n"
    machine = machine_file(tmp_path, "C F X Y Z B", errors=False, calibration=play)
    lines = [
        b"G90 G54",
        b"G0 X-5 Y0 Z0 B10 C-5",
        b"G0 X0 C0",
        b"G1 X10 C5 F100",
        b"X5 C10",
        b"X12 C2",
        b"M30",
        b"",
    ]
    result = olp.correct_joints(b"\n".join(lines), machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    assert result.report["deviation"]["before"]["position_max_um"] > 5.0
    # a step before each of the two moves that turn X round
    assert result.report["moves"]["parts"] == 7
    where = [float(x) for x in re.findall(rb"X(-?[\d.]+)", result.data)]
    assert where[1:] == pytest.approx([0.003, 10.003, 9.997, 4.997, 5.003, 12.003])


def test_near_a_singular_posture_nothing_jumps(tmp_path: Path) -> None:
    """The tool along the axis of the table, whose tilt only a large turn of the table would correct."""
    text = b"G90 G54\nG0 X0 Y0 Z0 A0 C0\nG1 X10 A0.05 F100\nX20 A-0.05\nM30\n"
    result = corrected(tmp_path, text)
    assert result.report["largest_correction"]["C_urad"] < np.radians(1.01) * 1e6
    assert result.report["verdict"]["ok"]


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(main, list(words))
    return done.exit_code, done.output


def test_the_verbs_know_such_a_machine(tmp_path: Path) -> None:
    machine = str(machine_file(tmp_path, "C F X Y Z B"))
    part, out = tmp_path / "part.ngc", tmp_path / "out.ngc"
    part.write_bytes(program("C F X Y Z B", seed=9))
    code, text = run("correct", str(part), "-m", machine, "-o", str(out), "--tolerance-urad", "2")
    assert code == 0
    assert "corrected path is within" in text
    assert run("verify", str(part), str(out), "-m", machine, "-q") == (0, "")
    assert run("verify", str(part), str(part), "-m", machine, "-q")[0] == 1
    assert run("check", str(part), "-m", machine)[1].splitlines()[-1].startswith("Go: ")
    rows = run("simulate", str(part), "-m", machine)[1].splitlines()
    assert rows[1].startswith("X_mm,Y_mm,Z_mm,RX_urad")
    assert run("correct", str(part), "-m", machine, "--split-rapids")[0] == 2
    assert "does not state axes.X.velocity_mm_s" in run("retime", str(part), "-m", machine)[1]


def test_poses_are_corrected_in_columns(tmp_path: Path) -> None:
    machine = olp.load_kinematics(machine_file(tmp_path, "F X Y Z C B"))
    values = machine.structure.axis_values({"X": [10.0, 50.0], "C": 30.0, "B": [20.0, -40.0]})
    done = olp.correct_poses(machine, values)
    nominal, actual = machine.nominal(values), machine.actual(done.values)
    assert np.abs(actual.position - nominal.position).max() < 1e-9
    assert np.abs(actual.rotation[:, :, 2] - nominal.rotation[:, :, 2]).max() < 1e-12
    assert not done.beyond.any()
    assert olp.correct_poses(machine, values + 700.0).beyond.any()
