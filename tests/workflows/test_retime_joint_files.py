"""What `retime` writes and compares on machines with rotary joints: every format holds the same motion, lines
add up to the whole, and written feeds read back."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from cli.test_cli import run
from judge.five_axis import Judge

import olp
from olp.core.errors import CannotCompute, ProgramError, UsageError

TRUNNION = Path(__file__).resolve().parents[2] / "programs" / "trunnion-mill" / "machine.toml"
HEAD = b"G21 G90 G17 G94 G54 G49 G64\nG0 X0. Y0. Z150. A0. C0.\n"
#: a quick corner, a line on which C is the slowest, and a rapid
TEXT = HEAD + b"G1 X9. A-9. F2400\nX-9. C40. F9000\nG4 P500\nG0 Z140.\nM30\n"
AXES, UNITS = ("X", "Y", "Z", "A", "C"), ("mm", "mm", "mm", "deg", "deg")


def table(data: bytes) -> tuple[list[str], np.ndarray]:
    head, *rows = csv.reader(io.StringIO(data.decode()))
    return head, np.array(rows, float)


@pytest.fixture(scope="module")
def motion() -> olp.JointRetiming:
    return olp.retime_joints(TEXT, TRUNNION, blend_mm=0.1)


def test_every_format_holds_the_same_motion(motion: olp.JointRetiming, tmp_path: Path) -> None:
    for kind in ("csv", "npz", "json"):
        motion.write(tmp_path / f"m.{kind}", cycle_s=0.004)
    motion.write(tmp_path / "m.pvt", "pvt", cycle_s=0.004)
    head, rows = table((tmp_path / "m.csv").read_bytes())
    places = [f"{axis}_{unit}" for axis, unit in zip(AXES, UNITS, strict=True)]
    assert head == ["t_s", *places, *(f"V{p}_s" for p in places), *(f"A{p}_s2" for p in places), "line"]
    time = rows[:, 0]
    assert np.diff(time)[:-1] == pytest.approx(0.004) and time[-1] == pytest.approx(motion.duration_s)
    place, *rates, line = motion.at(0, time)
    assert np.allclose(rows[:, 1:6], place, 1e-13, 1e-12)
    assert np.allclose(rows[:, 6:11], rates[0], 1e-11, 1e-10)
    assert np.array_equal(rows[:, -1], line)
    arrays = np.load(tmp_path / "m.npz")
    assert np.array_equal(arrays["position"], rows[:, 1:6]) and arrays["axes"].tolist() == list(AXES)
    assert np.array_equal(arrays["acceleration"], rows[:, 11:16]) and arrays["units"].tolist() == list(UNITS)
    ros = json.loads((tmp_path / "m.json").read_text())
    si = np.where(np.array(UNITS) == "mm", 1e-3, np.pi / 180.0)
    assert ros["joint_names"] == list(AXES)
    assert [point["velocities"] for point in ros["points"]] == pytest.approx(rates[0] * si)
    head, points = table((tmp_path / "m.pvt").read_bytes())
    assert head == ["dt_s", *(name for p in places for name in (p, f"V{p}_s"))]
    assert np.array_equal(points[:, 1::2], rows[:, 1:6]) and np.cumsum(points[:, 0]) == pytest.approx(time)


def test_lines_add_up_and_are_those_of_the_tip(motion: olp.JointRetiming) -> None:
    lines = motion.lines
    assert lines.line.tolist() == [3, 4, 6]
    assert float((lines.seconds + lines.dwell_s).sum()) == pytest.approx(motion.duration_s)
    assert lines.dwell_s.tolist() == pytest.approx([0.0, 0.5, 0.0])
    judge, (time, place, line) = Judge(TRUNNION), _sampled(motion)
    tip = judge.forward(place, False)[0]
    steps = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    ends = np.array([[0, 0, 10, 0, 0], [9, 0, 10, -9, 0], [-9, 0, 10, -9, 40], [-9, 0, 0, -9, 40]], float)
    for k, number in enumerate((3, 4, 6)):
        own = line[1:] == number
        way = judge.forward(np.linspace(ends[k], ends[k + 1], 2001), False)[0]
        length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
        assert lines.length_mm[k] == pytest.approx(length, rel=2e-3)
        assert lines.fastest_mm_s[k] == pytest.approx((steps / np.diff(time))[own].max(), rel=0.02)
    assert lines.feed_mm_s.tolist() == pytest.approx([40.0, 150.0, np.inf])
    assert [motion.limits[k] for k in lines.limit()][1] == "C jerk"
    slow = motion.slow[0]
    assert {3, 4} >= set(slow.line.tolist()) and (slow.slowest_mm_s < 0.5 * slow.feed_mm_s).all()
    at = [int(np.abs(time - one).argmin()) for one in slow.start_s]
    assert np.abs(slow.position_mm - tip[at]).max() < 8.0


def _sampled(motion: olp.JointRetiming) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time = np.linspace(0.0, motion.duration_s, 4001)
    place, *_, line = motion.at(0, time)
    return time, place, line


def test_planned_feeds_are_read_back(motion: olp.JointRetiming) -> None:
    data = motion.with_feeds()
    written = motion.report["write_feed"]
    assert written["words"] == 2 and b"F9000" not in data and data.count(b"\n") == TEXT.count(b"\n")
    again = olp.retime_joints(data, TRUNNION, blend_mm=0.1)
    assert again.duration_s == pytest.approx(written["duration_s"]) and again.duration_s >= motion.duration_s
    with pytest.raises(UsageError, match="states no feed in F words"):
        olp.retime_joints(b"X_mm,Y_mm,Z_mm,A_deg,C_deg\n0,0,0,0,0\n1,0,0,0,0\n", TRUNNION).with_feeds()


def test_another_program_is_compared_line_by_line(tmp_path: Path) -> None:
    slower = TEXT.replace(b"F9000", b"F1200")
    result = olp.retime_joints(slower, TRUNNION, nominal=TEXT, blend_mm=0.1)
    other = result.report["nominal"]
    assert other["lines_correspond"] and other["differences"][0]["line"] == 4
    change = result.duration_s - other["duration_s"]
    assert sum(row["corrected_s"] - row["nominal_s"] for row in other["differences"]) == pytest.approx(change)
    for name, text in (("a.nc", TEXT), ("b.nc", slower)):
        (tmp_path / name).write_bytes(text)
    files = [tmp_path / name for name in ("l.csv", "s.csv", "f.nc")]
    call = ("retime", str(tmp_path / "b.nc"), "-m", str(TRUNNION), "--nominal", str(tmp_path / "a.nc"))
    done = run(*call, "--lines", str(files[0]), "--slow", str(files[1]), "--write-feed", str(files[2]))
    assert done.exit_code == 0 and "Against a.nc" in done.stdout and "Feeds written" in done.stdout
    head, *rows = files[0].read_text().splitlines()
    assert head.startswith("line,seconds") and [row.split(",")[0] for row in rows] == ["3", "4", "6"]
    assert files[1].read_text().startswith("stretch,t_s") and b"F1200" not in files[2].read_bytes()


@pytest.mark.slow
def test_wider_corners_are_quicker_and_within() -> None:
    study = olp.retime_joints(TEXT, TRUNNION, blend_mm=0.1, study_blend=True).report["blend_study"]
    seconds = [row["duration_s"] for row in study]
    assert len(study) == 5 and seconds == sorted(seconds, reverse=True)
    assert all(0.0 < row["deviation_um"] <= row["tolerance_um"][0] for row in study)


def test_a_block_under_the_switch_is_left_out() -> None:
    text = HEAD + b"/G1 X50. F2400\nG1 X-9. C40. F900\nM30\n"
    assert olp.retime_joints(text, TRUNNION, block_delete=True).lines.line.tolist() == [4]
    with pytest.raises(ProgramError, match="block delete"):
        olp.retime_joints(text, TRUNNION)


def test_stretches_are_files_of_their_own(tmp_path: Path) -> None:
    text = HEAD + b"G1 X5. F900\nG28 Z0.\nG0 X0. Y0. Z150. A0. C0.\nG1 X5.\nM30\n"
    result = olp.retime_joints(text, TRUNNION)
    assert len(result.trajectories) == 2
    written = result.write(tmp_path / "m.csv")
    assert [path.name for path in written] == ["m-1.csv", "m-2.csv"]
    assert table(written[1].read_bytes())[1][0, 0] == 0.0
    with pytest.raises(CannotCompute, match="2 stretches"):
        result.parts()
