"""Re-timing on machines with rotary joints: limits in all axes, the feed and the tolerance at the tip, found
with own samples and an own forward."""

from __future__ import annotations

import json
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.fast import left_to_a_campaign
from cases.joint_jobs import JOINT_JOBS
from cli.test_cli import run
from judge.five_axis import Judge
from judge.machines import Recipe, zero_machine

import olp
from olp.core.errors import CannotCompute, ConfigError, ProgramError, UsageError
from olp.trajectory import contest
from olp.trajectory.joint_motion import NO_TUBES
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.retime import JointRetimeOptions, JointRetiming, retimed

FOLDER = Path(__file__).resolve().parents[2] / "programs"
TRUNNION = FOLDER / "trunnion-mill" / "machine.toml"
HEAD = b"G21 G90 G17 G94 G54 G49\nG0 X0. Y0. Z150. A0. C0.\n"


def samples(result: JointRetiming, cycle_s: float = 1e-3) -> list[tuple[np.ndarray, ...]]:
    """Times, axis values, velocities, accelerations, jerks and lines of each stretch."""
    parts = []
    for k, one in enumerate(result.stretches):
        time = np.append(np.arange(0.0, one.trajectory.duration_s, cycle_s), one.trajectory.duration_s)
        parts.append((time, *result.at(k, time)))
    return parts


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(JOINT_JOBS, ("trunnion-mill",)))
def test_every_axis_keeps_its_limits(name: str) -> None:
    job = FOLDER / name / "job.toml"
    result = olp.retime_joints(job.with_name(JOINT_JOBS[name]), job.with_name("machine.toml"), job)
    axes = tomllib.loads(job.with_name("machine.toml").read_text())["axes"]
    for time, place, *rates, _ in samples(result):
        for column, axis in enumerate(axes.values()):
            unit = "deg" if axis.get("kind") == "rotary" else "mm"
            for rate, key in zip(rates, ("velocity_{}_s", "acceleration_{}_s2", "jerk_{}_s3"), strict=True):
                most = axis[key.format(unit)]
                assert np.abs(rate[:, column]).max() <= most * (1.0 + 1e-9), (name, column, key)
        # what is said of velocities is the slope of the positions
        slope = np.diff(place, axis=0) / np.diff(time)[:, None]
        assert np.abs(slope - 0.5 * (rates[0][1:] + rates[0][:-1])).max() < 0.5
        assert not rates[0][0].any() and np.abs(rates[0][-1]).max() < 1e-6


def judged(text: bytes, machine: Path, tolerance_mm: float) -> JointRetiming:
    """The tip is within its feed, and within the tolerance of the programmed way, by an own reader."""
    result = retimed(JointRun.of(text, machine), JointRetimeOptions(blend_mm=tolerance_mm))
    judge = Judge(machine)
    moves = judge.read(text)
    way = []
    for (_, _, first), (_, tips, second) in pairwise(moves):
        assert not tips
        if np.isfinite(first).all():
            share = np.linspace(0.0, 1.0, 4001)[:, None]
            way.append(judge.forward(first + share * (second - first), False)[0])
    every = np.vstack(way)
    feeds = [float(word[1:]) for word in text.decode().split() if word.startswith("F")]
    assert len(set(feeds)) == 1
    for time, place, *_ in samples(result, 2e-3):
        tip = judge.forward(place, False)[0]
        for point in tip[:: max(1, len(tip) // 400)]:
            assert np.linalg.norm(every - point, axis=1).min() < tolerance_mm + 0.01
        speed = np.linalg.norm(np.diff(tip, axis=0), axis=1) / np.diff(time)
        assert speed.max() <= feeds[0] / 60.0 * 1.002
    return result


@pytest.mark.slow
def test_the_tip_keeps_feed_and_path() -> None:
    """Axis words: the tip makes curves while the axes go straight."""
    text = (
        HEAD.replace(b"G0", b"G1 F900")
        + b"G1 X20. Y10. Z120. A-20. C30.\nX-20. C-40.\nA5. Y0.\nX10. Z140.\nM30\n"
    )
    machine = TRUNNION
    result = judged(text, machine, 0.05)
    assert result.report["largest_share_of_limit"]["feed"] == pytest.approx(1.0, abs=2e-3)
    # a wider tolerance is never slower
    wider = retimed(JointRun.of(text, machine), JointRetimeOptions(blend_mm=0.5))
    assert wider.duration_s < result.duration_s


@pytest.mark.slow
@pytest.mark.parametrize("turns", [1, 3])
def test_arcs_are_kept_and_take_their_time(turns: int) -> None:
    """A helix on a table that turns under it: the tip stays on its cylinder, at its feed."""
    text = (
        HEAD
        + b"G43.4 H1 X20. Y0. Z0. A0. C0.\nG64 P0.02\n"
        + (
            f"G3 X20. Y0. Z6. I-20. J0. P{turns} A-20. F1800.\nM30\n".encode()
            if turns > 1
            else b"G3 X20. Y0. Z6. I-20. J0. A-20. F1800.\nM30\n"
        )
    )
    machine = TRUNNION.with_name("machine.toml")
    try:
        result = retimed(JointRun.of(text, machine), JointRetimeOptions())
    except ProgramError:
        assert turns > 1
        return
    judge = Judge(machine)
    length = turns * np.hypot(2 * np.pi * 20.0, 6.0 / turns)
    (part,) = samples(result, 2e-3)
    tip = judge.forward(part[1], False)[0]
    line = part[-1] == 5
    # work offset Z -140
    radius = np.hypot(tip[line, 0], tip[line, 1])
    assert np.abs(radius - 20.0).max() < 0.025
    assert (part[0][line][-1] - part[0][line][0]) * 30.0 == pytest.approx(length, rel=0.1)


@pytest.mark.slow
def test_linear_moves_take_the_time_that_they_take_three_axes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same limits, the same program, without and with rotary axes that stand. Three have tubes."""

    def none(*args: object) -> None:
        raise CannotCompute("no tube")

    monkeypatch.setattr(contest, "in_tube", none)
    limits = "velocity_mm_s = 500.0\nacceleration_mm_s2 = 4000.0\njerk_mm_s3 = 40000.0\n"
    travel = ((-300.0, 300.0),) * 3
    three = zero_machine(tmp_path / "m", Recipe(travel=travel, work_offsets={"G54": {"set_by": "true"}}))
    text = three.read_text()
    for line in set(text.splitlines()):
        if line.startswith(("velocity_mm_s", "acceleration_mm_s2", "jerk_mm_s3")):
            text = text.replace(f"{line}\n", "")
    for axis in "XYZ":
        text = text.replace(f"[axes.{axis}]\n", f"[axes.{axis}]\n{limits}")
    three.write_text(text)
    five = tmp_path / "five.toml"
    plain = TRUNNION.read_text("utf-8").replace('calibration = "calibration.toml"\n', "")
    five.write_text(plain.replace("5000.0", "4000.0").replace("50000.0", "40000.0"), "utf-8")
    moves = b"G1 X60. Y20. Z10. F6000\nX80. Y-30.\nY-60. Z0.\nX0. Y0.\nZ30.\nM30\n"
    start = b"G21 G90 G17 G94 G54 G49 G64\nG0 X0. Y0. Z50.%s\n"
    one = olp.retime((start % b"").replace(b"G49", b"") + moves, three, blend_mm=0.05).duration_s
    other = olp.retime_joints(start % b" A0. C0." + moves, five, blend_mm=0.05).duration_s
    assert other == pytest.approx(one, rel=1e-3)


@pytest.mark.slow
def test_one_axis_alone_takes_what_ruckig_says() -> None:
    import ruckig

    text = HEAD + b"G1 C90. F99999\nM30\n"
    result = olp.retime_joints(text, TRUNNION)
    motion = ruckig.InputParameter(1)
    motion.target_position, motion.max_velocity = [90.0], [180.0]
    motion.max_acceleration, motion.max_jerk = [900.0], [9000.0]
    found = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(motion, found)
    # the tip is off the axis of C by nothing: the feed counts nowhere
    assert result.duration_s == pytest.approx(found.duration, rel=1e-6)


@pytest.mark.slow
def test_times_and_dwells_are_kept() -> None:
    program = HEAD + b"G93 G1 X30. C20. F4.\nG94\nG4 P2000\nM30\n"
    result = olp.retime_joints(program, TRUNNION)
    assert result.report["dwell_s"] == pytest.approx(2.0)
    assert 15.0 < result.duration_s - 2.0 < 15.6
    turned = olp.retime_joints(HEAD + b"G93 G1 C20. F12.\nC40. F6.\nM30\n", TRUNNION)
    assert turned.duration_s == pytest.approx(15.0, abs=0.3)


def test_limits_that_are_missing_are_named(tmp_path: Path) -> None:
    machine = tmp_path / "m.toml"
    text = TRUNNION.read_text("utf-8").replace('calibration = "calibration.toml"\n', "")
    machine.write_text(text.replace("jerk_deg_s3 = 6000.0\n", ""), "utf-8")
    with pytest.raises(ConfigError, match=r"does not state axes\.A\.jerk_deg_s3, which"):
        olp.retime_joints(HEAD + b"M30\n", machine)


@pytest.mark.slow
def test_what_a_correction_costs_in_time_is_that_of_both_texts(tmp_path: Path) -> None:
    text = HEAD + b"G1 X20. A-20. C30. F900\nX-20.\nM30\n"
    (tmp_path / "p.nc").write_bytes(text)
    stated = olp.correct_joints(text, TRUNNION, times=True)
    time = stated.report["time"]
    assert time["nominal_s"] == pytest.approx(olp.retime_joints(text, TRUNNION).duration_s, rel=1e-9)
    again = olp.retime_joints(stated.data, TRUNNION).duration_s
    assert time["corrected_s"] == pytest.approx(again, rel=1e-9)
    assert time["share"] == pytest.approx(again / time["nominal_s"] - 1.0) and time["optimised"]
    plain = olp.correct_joints(text, TRUNNION)
    assert "time" not in plain.report and plain.data == stated.data
    report = tmp_path / "r.html"
    call = ("correct", str(tmp_path / "p.nc"), "-m", str(TRUNNION), "-o", str(tmp_path / "o.nc"), "--force")
    done = run(*call, "--report", str(report))
    sentence = f"nominal program {time['nominal_s']:.3f} s, corrected program {again:.3f} s"
    assert sentence in done.stdout and sentence in report.read_text("utf-8")
    # a machine without limits of motion: the report says why it is not known
    bare = tmp_path / "machine.toml"
    bare.write_text(TRUNNION.read_text("utf-8").replace("jerk_deg_s3 = 6000.0\n", ""), "utf-8")
    for name in ("calibration.toml", "c.csv"):
        (tmp_path / name).write_bytes(TRUNNION.with_name(name).read_bytes())
    call = ("correct", str(tmp_path / "p.nc"), "-m", str(bare), "-o", str(tmp_path / "o.nc"), "--force")
    done = run(*call, "--report", str(report))
    assert done.exit_code == 0 and "Time, not known: " in done.stdout and "axes.A.jerk_deg_s3" in done.stdout
    assert run(*call, "--times").exit_code == 3


@pytest.mark.slow
def test_the_verb_writes_table_and_report(tmp_path: Path) -> None:
    job = str(FOLDER / "gantry-wrist" / "job.toml")
    out, report = tmp_path / "out.csv", tmp_path / "out.json"
    done = run("retime", "-j", job, "-o", str(out), "--report", str(report), "--cycle-ms", "10")
    assert done.exit_code == 0, done.stderr
    assert "Longest lines" in done.stdout and "57.5" in done.stdout
    head, *rows = out.read_text().splitlines()
    assert head.startswith("t_s,X_mm,Y_mm,Z_mm,C_deg,B_deg,VX_mm_s") and head.endswith(",AB_deg_s2,line")
    assert len(rows) == pytest.approx(5752, abs=5)
    found = json.loads(report.read_text())
    assert found["schema"] == "olp-joint-retime-1"
    # the third run is one straight move
    assert found["in_tubes"] == {"faster": 0, "not_faster": {NO_TUBES: 2}}
    assert "2 of 2 runs are no faster: a tube bounds axes" in done.stdout
    done = run("retime", "-j", job, "-o", str(tmp_path / "x.txt"))
    assert done.exit_code == 2 and "ends in no known format" in done.stderr
    done = run("retime", "-j", job, "--controller", "fanuc")
    assert done.exit_code == 2 and "--controller is not for machines with rotary joints" in done.stderr
    done = run("retime", "-j", job, "--plot-span", "0", "1")
    assert done.exit_code == 2 and "name a file with --plot" in done.stderr


@pytest.mark.slow
def test_gains_are_what_a_program_with_these_values_saves(tmp_path: Path) -> None:
    text = HEAD + b"G1 X20. A-9. F2400\nX-20. C9.\nA0. Y9.\nM30\n"
    base = olp.retime_joints(text, TRUNNION, gains=True, blend_mm=0.1)
    rows = base.report["gains"]
    others = {"tolerance": (text, 0.4), "feed": (text.replace(b"F2400", b"F3000"), 0.1)}
    for change, (other, blend_mm) in others.items():
        result = olp.retime_joints(other, TRUNNION, blend_mm=blend_mm)
        assert result.duration_s < base.duration_s
        before, after = (
            {row["line"]: row["seconds"] for row in one.report["longest_lines"]} for one in (base, result)
        )
        mine = [row for row in rows if row["change"] == change]
        # lines that gain less than 1 ms are left out
        expected = {k: before[k] - after[k] for k in (3, 4, 5) if before[k] - after[k] > 1e-3}
        assert {row["line"]: row["seconds"] for row in mine} == pytest.approx(expected) and mine
        assert [row["seconds"] for row in mine] == sorted((row["seconds"] for row in mine), reverse=True)
    assert {(row["now"], row["then"]) for row in rows} == {(100.0, 400.0), (2400.0, 3000.0)}
    # an override is a feed
    (tmp_path / "p.nc").write_bytes(text)
    pictures = [tmp_path / name for name in ("one.svg", "two.svg", "part.png")]
    call = ("retime", str(tmp_path / "p.nc"), "-m", str(TRUNNION), "--feed-override", "125", "--plot")
    done = run(*call, str(pictures[0]), "--gains")
    assert "What would gain most" in done.stdout and "125 % of the programmed feed" in done.stdout
    quicker = olp.retime_joints(text.replace(b"F2400", b"F3000"), TRUNNION)
    assert olp.retime_joints(text, TRUNNION, feed_override=125.0).duration_s == quicker.duration_s
    run(*call, str(pictures[1]))
    run(*call, str(pictures[2]), "--plot-span", "0.5", "1")
    picture = pictures[0].read_bytes()
    assert picture == pictures[1].read_bytes() and pictures[2].read_bytes()[:4] == b"\x89PNG"
    assert all(f">{name}</text>".encode() in picture for name in "XYZAC")
    assert b"velocity, % of limit" in picture and b"p.nc on trunnion-500" in picture
    with pytest.raises(UsageError, match="no motion to draw"):
        base.plots(pictures[1], from_s=99.0)


def test_the_tip_of_a_hexapod_is_nowhere_above_its_feed(tmp_path: Path) -> None:
    """Chords in the legs: the tip was 0.03 % faster than F between the places at which a chord was looked
    at."""
    job = tmp_path / "job.toml"
    offset = "X_mm = 0.0\nY_mm = 0.0\nZ_mm = 710.0\n"
    job.write_text(f'schema = "olp-job-1"\n[work_offsets.G54]\nset_by = "true"\n{offset}')
    text = b"G21 G90 G17 G54 G64 P0.01\nG0 X0 Y0 Z20 A0 B0 C0\nG1 Z0 F600\nX60 Y-15 A2 B-1.5\nY40\nM30\n"
    machine = FOLDER / "hexapod" / "machine.toml"
    result = olp.retime_joints(text, machine, job)
    solved = olp.load_kinematics(machine)
    ((time, place, *_, line),) = samples(result, 2e-3)
    # the tip by positions alone: a mean speed is at most the largest one
    speed = np.linalg.norm(np.diff(solved.nominal(place).position, axis=0), axis=1) / np.diff(time)
    cut = (line[1:] > 2) & (line[:-1] > 2)
    assert 0.999 < speed[cut].max() / 10.0 < 1.0 + 1e-7
    assert result.report["largest_share_of_limit"]["feed"] <= 1.0
    legs = [leg for one in result.stretches for leg in one.trajectory.legs]
    assert sum(leg.duration_s for leg in legs) == pytest.approx(result.duration_s)
