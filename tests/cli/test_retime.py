"""`olp retime` and `olp.retime`: files, streams, refusals, and the answers of the report."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from click.testing import CliRunner, Result
from judge.unpacker import Page

import olp
from olp.cli import main
from olp.core.errors import UsageError
from olp.files.trajectory import COLUMNS, LINE_COLUMNS, SLOW_COLUMNS
from olp.trajectory.usage import LIMITS
from olp.workflows.retime import Retiming
from olp.workflows.retime_files import Format

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
BED = PROGRAMS / "nasty" / "machine.toml"
START = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
SQUARE = "G21 G90 G54\nG64 P0.02\nG1 X40 F3000\nY40\nX0\nY0\nG4 P0.5\nG1 X1 Z5 F60\nM2\n"
#: three stretches: a tool change and G28 leave the axes where the control wants
CHANGES = "G1 X40 F3000\nT2 M6\nG0 X0 Y0 Z9\nG1 X5 F600\nG28 Z9\nG0 X9 Y9 Z0\nG1 X2\nM2\n"
TOOLS = "[tools.1]\nZ_mm = 50.0\n[tools.2]\nZ_mm = 60.0\n"


def run(*args: str | Path, stdin: bytes | None = None) -> Result:
    """A call whose failure is an exit code, never an exception."""
    result = CliRunner().invoke(main, [str(arg) for arg in args], input=stdin)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture
def job(tmp_path: Path) -> Path:
    return machine(tmp_path / "m", tables=TRUE_ZERO + TOOLS, job=START).with_name("job.toml")


def program(folder: Path, text: str = SQUARE, name: str = "part.ngc") -> Path:
    (folder / name).write_text(text)
    return folder / name


def table(path: Path) -> tuple[list[str], list[list[str]]]:
    head, *rows = [line.split(",") for line in path.read_text().splitlines()]
    return head, rows


def report_of(*args: str | Path) -> dict[str, Any]:
    result = run("retime", *args, "--json")
    assert result.exit_code == 0, result.stderr
    return dict(json.loads(result.stdout))


# -- the whole time ---------------------------------------------------------------------------------------


def test_the_control_takes_the_times_of_the_machine_file(job: Path, tmp_path: Path) -> None:
    text = "S900 M3\nG1 X40 F3000 M8\nT2 M6\nG0 X0 Y0 Z9\nG1 X5 F600\nM9\nG1 X2\nM2\n"
    part, file = program(tmp_path, text), job.with_name("machine.toml")
    bare = report_of(part, "-j", job)
    assert [row["seconds"] for row in bare["control"]] == [None] * 4
    assert [f["code"] for f in bare["findings"]].count("OLP209") == 1
    rest = report_of(program(tmp_path, text.replace("M9\n", "G4 P0\n"), "rest.ngc"), "-j", job)
    with file.open("a") as machine_file:
        machine_file.write(
            "[times]\ntool_change_s = 6.0\nspindle_start_s = 2.0\nm_codes_s = { M8 = 0.5, M9 = 0.25 }\n"
        )
    whole = report_of(part, "-j", job)
    assert whole["control"] == [
        {"what": "spindle start", "count": 1, "seconds": 2.0},
        {"what": "tool change", "count": 1, "seconds": 6.0}, {"what": "M8", "count": 1, "seconds": 0.5},
        {"what": "M9", "count": 1, "seconds": 0.25},
    ]  # fmt: skip
    assert whole["duration_s"] == pytest.approx(rest["duration_s"] + 8.75, abs=1e-9)
    assert whole["dwell_s"] == pytest.approx(0.0, abs=1e-9)
    assert not any(f["code"] == "OLP209" for f in whole["findings"])
    assert "tool change  " in run("retime", part, "-j", job).stdout


@pytest.mark.parametrize(
    ("codes", "says"), [("{ M6 = 1.0 }", "tool_change_s"), ("{ G4 = 1.0 }", "such as M8")]
)
def test_a_time_of_no_m_code_is_refused(job: Path, tmp_path: Path, codes: str, says: str) -> None:
    with job.with_name("machine.toml").open("a") as machine_file:
        machine_file.write(f"[times]\nm_codes_s = {codes}\n")
    result = run("retime", program(tmp_path), "-j", job)
    assert result.exit_code == 3
    assert says in result.stderr


def test_an_override_changes_feeds_and_no_rapids(job: Path, tmp_path: Path) -> None:
    part = program(tmp_path, "G1 X40 F600\nG0 X0\nM2\n")
    slow = report_of(program(tmp_path, "G1 X40 F300\nG0 X0\nM2\n", "slow.ngc"), "-j", job)
    half = report_of(part, "-j", job, "--feed-override", "50")
    assert half["duration_s"] == slow["duration_s"]
    assert half["feed_override"] == 0.5
    assert "Override    50 %" in run("retime", part, "-j", job, "--feed-override", "50").stdout
    assert half["ruckig_share"] == 1.0
    refused = run("retime", part, "-j", job, "--feed-override", "50", "--write-feed", tmp_path / "f.ngc")
    assert refused.exit_code == 2
    with pytest.raises(UsageError, match="feed override is 0 %"):
        olp.retime(part, job.with_name("machine.toml"), job, feed_override=0.0)


@pytest.mark.slow
def test_gains_are_those_of_the_program_with_more_tolerance_or_feed(job: Path, tmp_path: Path) -> None:
    lines = "\n".join(f"X{x} Y{x % 2}" for x in range(1, 20))
    text = "G64 P{p}\nG1 F6000\n" + lines + "\nG1 X60 F{f}\nM2\n"
    part = program(tmp_path, text.format(p=0.005, f=600))
    rows = report_of(part, "-j", job, "--gains")["gains"]
    feed = max((row for row in rows if row["change"] == "feed"), key=lambda row: row["seconds"])
    assert (feed["line"], feed["now"], feed["then"]) == (22, 600.0, 750.0)
    own, machine_file = (
        program(tmp_path, text.format(p=0.02, f=600), "wide.ngc"),
        job.with_name("machine.toml"),
    )
    base, wide = (olp.retime(p, machine_file, job).lines for p in (part, own))
    tolerance = next(row for row in rows if row["change"] == "tolerance")
    assert (tolerance["now"], tolerance["then"]) == (5.0, 20.0)
    gained = base.seconds - wide.seconds
    assert tolerance["line"] == int(base.line[np.argmax(gained)])
    assert tolerance["seconds"] == pytest.approx(float(gained.max()), rel=1e-12)
    assert (
        f"line {tolerance['line']}: {gained.max():.3f} s for a tolerance of 20 instead of 5 um"
        in run("retime", part, "-j", job, "--gains").stdout
    )


def test_moves_of_other_axes_are_a_finding(job: Path, tmp_path: Path) -> None:
    report = report_of(program(tmp_path, "G1 X40 F600\nG1 A360\nG1 X0\nM2\n"), "-j", job)
    row = next(f for f in report["findings"] if f["code"] == "OLP208")
    assert (row["severity"], row["lines"]) == ("warning", [2])


def test_a_correction_states_what_it_costs_in_time(tmp_path: Path) -> None:
    words = ("correct", "-j", PROGRAMS / "nasty" / "job.toml", "-o", tmp_path / "c.ngc")
    result = run(*words, "--report", tmp_path / "r.json")
    assert result.exit_code == 0
    time = json.loads((tmp_path / "r.json").read_text())["time"]
    report = report_of(tmp_path / "c.ngc", "-m", BED, "--nominal", PROGRAMS / "nasty" / "modal.ngc")
    assert time == {
        "nominal_s": report["nominal"]["duration_s"], "corrected_s": report["duration_s"],
        "share": report["duration_s"] / report["nominal"]["duration_s"] - 1.0, "optimised": True,
    }  # fmt: skip
    assert abs(time["share"]) <= 0.0025
    assert f"Time, planned: nominal program {time['nominal_s']:.3f} s" in result.stdout


def test_a_long_program_is_planned_more_simply_and_one_without_limits_says_why(
    job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("olp.workflows.correct_time.MOST_OPTIMISED", 3)
    words = (
        "correct",
        program(tmp_path),
        "-j",
        job,
        "-o",
        tmp_path / "c.ngc",
        "--force",
        "--report",
        tmp_path / "r.json",
    )
    result = run(*words)
    time = json.loads((tmp_path / "r.json").read_text())["time"]
    assert not time["optimised"] and abs(time["share"]) <= 0.01
    assert "planned without optimised speeds" in result.stdout
    monkeypatch.setattr("olp.workflows.correct_time.MOST_UNASKED", 3)
    page = tmp_path / "r.html"
    run(*words, "--review", page)
    assert "--times" in json.loads((tmp_path / "r.json").read_text())["time"]["unknown"]
    assert Page(page.read_bytes()).manifest["time_source"] == "feed"
    run(*words, "--times", "--review", page)
    assert "share" in json.loads((tmp_path / "r.json").read_text())["time"]
    assert Page(page.read_bytes()).manifest["time_source"] == "retimed"
    monkeypatch.undo()
    file = job.with_name("machine.toml")
    file.write_text(
        "".join(line for line in file.read_text().splitlines(True) if not line.startswith("jerk_mm_s3"))
    )
    result = run(*words)
    assert "axes.X.jerk_mm_s3" in json.loads((tmp_path / "r.json").read_text())["time"]["unknown"]
    assert "Time, not known: " in result.stdout


def test_full_circles_are_compared_with_their_quarters_and_not_with_a_jog(job: Path, tmp_path: Path) -> None:
    quarters = (
        "G1 X9.996\nG3 X0 Y10 I-10 J0\nG1 Y9.996\nG3 X-10 Y0 I0 J-10\nG3 X0 Y-10 I10 J0\nG3 X10 Y0 I0 J10\n"
    )
    head, end = "G64 P0.02\nG1 X10 F900\n", "G1 X20\nM2\n"
    nominal = program(tmp_path, head + "G3 X10 Y0 I-10 J0\n" * 3 + end, "n.ngc")
    report = report_of(program(tmp_path, head + quarters * 3 + end), "-j", job, "--nominal", nominal)
    rows = {row["line"]: row for row in report["nominal"]["differences"]}
    for line in (3, 4, 5):
        assert rows[line]["corrected_s"] == pytest.approx(rows[line]["nominal_s"], rel=0.05)


# -- the trajectory --------------------------------------------------------------------------------------


def test_csv_holds_the_trajectory_to_the_last_bit(job: Path, tmp_path: Path) -> None:
    part, target = program(tmp_path), tmp_path / "out.csv"
    result = run("retime", part, "-j", job, "-o", target, "--cycle-ms", "4")
    assert result.exit_code == 0
    assert f"wrote {target}" in result.stderr
    head, rows = table(target)
    assert tuple(head) == COLUMNS
    values = np.array([[float(v) for v in row] for row in rows])
    timing = olp.retime(part, job.with_name("machine.toml"), job)
    position, velocity, acceleration, _, line = timing.trajectory.at(values[:, 0])
    np.testing.assert_array_equal(values[:, 1:4], position)
    np.testing.assert_array_equal(values[:, 4:7], velocity)
    np.testing.assert_array_equal(values[:, 7:10], acceleration)
    np.testing.assert_array_equal(values[:, 10], line)
    np.testing.assert_allclose(np.diff(values[:-1, 0]), 0.004, rtol=1e-9)
    assert values[-1, 0] == timing.duration_s
    assert not any("-0.0" in row for row in rows)


def test_every_format_says_the_same(job: Path, tmp_path: Path) -> None:
    timing = olp.retime(program(tmp_path), job.with_name("machine.toml"), job)
    times = timing.trajectory.sample_times(0.01)
    position, velocity, acceleration, _, line = timing.trajectory.at(times)
    for name in ("t.npz", "t.json"):
        assert timing.write(tmp_path / name, cycle_s=0.01) == [tmp_path / name]
    with np.load(tmp_path / "t.npz") as held:
        np.testing.assert_array_equal(held["t_s"], times)
        np.testing.assert_array_equal(held["position_mm"], position)
        np.testing.assert_array_equal(held["velocity_mm_s"], velocity)
        np.testing.assert_array_equal(held["acceleration_mm_s2"], acceleration)
        np.testing.assert_array_equal(held["line"], line)
        motion = timing.trajectory.motion
        for name, array in (
            ("start_s", motion.start_s), ("time", motion.time), ("path", motion.path),
            ("shape", motion.shape), ("line", motion.line),
        ):  # fmt: skip
            np.testing.assert_array_equal(held[f"piece_{name}"], array)
    message = json.loads((tmp_path / "t.json").read_text())
    assert message["joint_names"] == ["X", "Y", "Z"]
    points = message["points"]
    stamps = [p["time_from_start"] for p in points]
    assert all(0 <= s["nanosec"] < 10**9 for s in stamps)
    np.testing.assert_allclose([s["sec"] + s["nanosec"] * 1e-9 for s in stamps], times, atol=1e-9)
    np.testing.assert_allclose([p["positions"] for p in points], position * 1e-3, atol=1e-15)
    np.testing.assert_allclose([p["velocities"] for p in points], velocity * 1e-3, atol=1e-12)
    pvt = b"".join(timing.parts("pvt", 0.01)).decode().splitlines()
    values = np.array([[float(v) for v in row.split(",")] for row in pvt[1:]])
    np.testing.assert_allclose(np.cumsum(values[:, 0]), times, atol=1e-9)
    np.testing.assert_array_equal(values[:, 1::2], position)
    np.testing.assert_array_equal(values[:, 2::2], velocity)


def test_parquet_or_its_refusal(job: Path, tmp_path: Path) -> None:
    target = tmp_path / "t.parquet"
    result = run("retime", program(tmp_path), "-j", job, "-o", target)
    try:
        import pyarrow.parquet as pq
    except ImportError:
        assert result.exit_code == 3
        assert "pyarrow" in result.stderr
        assert not target.exists()
        return
    held = pq.read_table(target)
    assert tuple(held.column_names) == COLUMNS
    timing = olp.retime(program(tmp_path), job.with_name("machine.toml"), job)
    times = timing.trajectory.sample_times(1e-3)
    np.testing.assert_array_equal(held["t_s"].to_numpy(), times)
    np.testing.assert_array_equal(held["X_mm"].to_numpy(), timing.trajectory.at(times)[0][:, 0])


def test_an_unknown_ending_is_refused_with_the_list(job: Path, tmp_path: Path) -> None:
    part, target = program(tmp_path), tmp_path / "out.rsf"
    result = run("retime", part, "-j", job, "-o", target)
    assert result.exit_code == 2
    assert ".csv, .npz, .parquet, .json" in result.stderr
    assert not target.exists()
    with pytest.raises(UsageError, match=r"\.csv, \.npz"):
        olp.retime(part, job.with_name("machine.toml"), job).write(target)
    assert run("retime", part, "-j", job, "-o", target, "--format", "pvt").exit_code == 0


def test_long_files_are_made_in_parts(job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("olp.files.trajectory.ROWS", 500)
    timing = olp.retime(program(tmp_path), job.with_name("machine.toml"), job)
    for kind in ("csv", "npz", "ros", "pvt"):
        parts = list(timing.parts(kind, 1e-3))
        assert len(parts) > 5
        assert max(map(len, parts)) < 0.5 * sum(map(len, parts))
    times = timing.trajectory.sample_times(1e-3)
    with np.load(io.BytesIO(b"".join(timing.parts("npz", 1e-3)))) as held:
        np.testing.assert_array_equal(held["t_s"], times)
        np.testing.assert_array_equal(held["position_mm"], timing.trajectory.at(times)[0])


def test_a_stretch_each_where_the_control_moves_by_itself(job: Path, tmp_path: Path) -> None:
    part, target = program(tmp_path, CHANGES), tmp_path / "out.csv"
    result = run("retime", part, "-j", job, "-o", target)
    assert result.exit_code == 0
    assert not target.exists()
    names = [tmp_path / f"out-{n}.csv" for n in (1, 2, 3)]
    seconds = []
    for name in names:
        assert f"wrote {name}" in result.stderr
        _, rows = table(name)
        assert float(rows[0][0]) == 0.0
        assert [float(v) for v in rows[-1][4:10]] == pytest.approx([0.0] * 6, abs=1e-6)
        seconds.append(float(rows[-1][0]))
    report = report_of(part, "-j", job)
    assert [s["duration_s"] for s in report["stretches"]] == pytest.approx(seconds)
    assert [s["first_line"] for s in report["stretches"]] == [1, 4, 7]
    assert report["untimed"]["moves"] == 4
    assert report["untimed"]["lines"] == [2, 3, 5, 6]
    assert "Not timed: 4 moves" in result.stdout
    # one of them on request, by the name that was given
    assert run("retime", part, "-j", job, "-o", target, "--stretch", "2").exit_code == 0
    assert target.read_bytes() == names[1].read_bytes()
    streamed = run("retime", part, "-j", job, "-o", "-", "--stretch", "2")
    assert streamed.stdout.encode() == target.read_bytes()
    assert run("retime", part, "-j", job, "-o", "-", "--stretch", "4").exit_code == 2
    refused = run("retime", part, "-j", job, "-o", "-")
    assert refused.exit_code == 2
    assert refused.stdout == ""
    assert "3 stretches" in refused.stderr
    with pytest.raises(olp.CannotCompute, match="3 stretches"):
        _ = olp.retime(part, job.with_name("machine.toml"), job).trajectory


def test_streams(job: Path, tmp_path: Path) -> None:
    part, target = program(tmp_path), tmp_path / "out.csv"
    run("retime", part, "-j", job, "-o", target)
    result = run("retime", "-", "-j", job, "-o", "-", stdin=SQUARE.encode())
    assert result.exit_code == 0
    assert result.stdout.encode() == target.read_bytes()
    assert "Program     <stdin>" in result.stderr
    for wrong in (["-o", "-", "--json"], ["--nominal", "-"], ["--stretch", "1"]):
        refused = run("retime", "-", "-j", job, *wrong, stdin=SQUARE.encode())
        assert refused.exit_code == 2
        assert refused.stderr.startswith("olp: error: ")


@pytest.mark.slow
def test_a_reader_that_goes_is_no_error(job: Path, tmp_path: Path) -> None:
    words = ["retime", str(program(tmp_path)), "-j", str(job), "-o", "-", "--cycle-ms", "0.02"]
    call = [sys.executable, "-W", "error", "-m", "olp", *words]
    with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdout is not None and child.stderr is not None
        assert child.stdout.readline().decode().startswith("t_s,")
        child.stdout.close()
        messages = child.stderr.read().decode()
        assert child.wait(60) == 0
    assert "Traceback" not in messages
    assert "Program     part.ngc" in messages


# -- nothing half-written --------------------------------------------------------------------------------


def test_nothing_is_overwritten_without_force(job: Path, tmp_path: Path) -> None:
    part = program(tmp_path)
    names = {option: tmp_path / f"x{option}.json" for option in ("-o", "--lines", "--slow", "--report")}
    for option, name in names.items():
        name.write_text("mine")
        refused = run("retime", part, "-j", job, option, name)
        assert refused.exit_code == 2
        assert "--force" in refused.stderr
        assert name.read_text() == "mine"
        assert run("retime", part, "-j", job, option, name, "--force").exit_code == 0
        assert name.read_text() != "mine"
    for option in names:
        assert run("retime", part, "-j", job, option, part, "--force").exit_code == 2
    assert part.read_text() == SQUARE
    same = tmp_path / "same.csv"
    assert run("retime", part, "-j", job, "--lines", same, "--slow", same).exit_code == 2


@pytest.mark.parametrize("where", ["olp.trajectory.variants.plan", "olp.files.trajectory.rows"])
def test_an_interrupt_leaves_nothing(
    where: str, job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = program(tmp_path)
    before = sorted(p.name for p in tmp_path.iterdir())

    def stop(*args: object, **names: object) -> Iterator[object]:
        raise KeyboardInterrupt

    def one_and_stop(trajectory: Any, cycle_s: float) -> Iterator[object]:
        yield np.zeros((1, 10)), np.zeros(1, np.int64)
        raise KeyboardInterrupt

    monkeypatch.setattr(where, one_and_stop if where.endswith("rows") else stop)
    result = run("retime", part, "-j", job, "-o", tmp_path / "out.csv", "--lines", tmp_path / "lines.csv")
    assert result.exit_code == 130
    assert "interrupted" in result.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == before


# -- refusals --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ("G1 X5\n", 3, ":1: a feed move has no feed"),
        ("G1 X5 F60\nG41 D1 X7\n", 3, ":2: "),
        ("G1 X5 F60\nG4\n", 3, ":2: G4 needs P"),
        ("G1 X[#1 + 1] F60\n", 3, "--flatten"),
    ],
)
def test_refusals_name_file_and_line(text: str, code: int, words: str, job: Path, tmp_path: Path) -> None:
    part, target = program(tmp_path, text), tmp_path / "out.csv"
    result = run("retime", part, "-j", job, "-o", target)
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.startswith(f"olp: error: {part}:")
    assert words in result.stderr
    assert not target.exists()
    assert run("retime", "-", "-j", job, stdin=text.encode()).stderr.startswith("olp: error: <stdin>:")


def test_a_program_of_unknown_places_has_no_time(tmp_path: Path) -> None:
    bare = machine(tmp_path / "m", tables=TRUE_ZERO)
    result = run("retime", program(tmp_path, "G1 X5 F60\nX9\n"), "-m", bare)
    assert result.exit_code == 4
    assert "start_mm" in result.stderr


def test_a_program_without_moves_takes_no_time(job: Path, tmp_path: Path) -> None:
    part = program(tmp_path, "G21\nM2\n")
    assert report_of(part, "-j", job)["duration_s"] == 0.0
    assert run("retime", part, "-j", job).exit_code == 0
    assert run("retime", part, "-j", job, "-o", tmp_path / "out.csv").exit_code == 4


def test_a_cycle_that_makes_too_many_samples_is_refused(job: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.csv"
    result = run("retime", program(tmp_path), "-j", job, "-o", target, "--cycle-ms", "1e-9")
    assert result.exit_code == 2
    assert "too many samples" in result.stderr
    assert not target.exists()


# -- answers ---------------------------------------------------------------------------------------------


def test_the_report_adds_up(job: Path, tmp_path: Path) -> None:
    part = program(tmp_path)
    lines, slow = tmp_path / "lines.csv", tmp_path / "slow.csv"
    result = run("retime", part, "-j", job, "--lines", lines, "--slow", slow, "--report", tmp_path / "r.json")
    assert result.exit_code == 0
    report = json.loads((tmp_path / "r.json").read_text())
    assert report == report_of(part, "-j", job)
    assert report["dwell_s"] == 0.5
    head, rows = table(lines)
    assert tuple(head) == LINE_COLUMNS
    column = dict(zip(head, zip(*rows, strict=True), strict=True))
    assert [int(v) for v in column["line"]] == [3, 4, 5, 6, 8]
    total = sum(float(v) for v in (*column["seconds"], *column["dwell_s"]))
    assert total == pytest.approx(report["duration_s"], abs=1e-7)
    assert [float(v) for v in column["length_mm"]] == pytest.approx([40.0] * 4 + [26**0.5])
    assert [float(v) for v in column["feed_mm_s"]] == [50.0] * 4 + [1.0]
    assert {*column["limit"]} <= {*LIMITS}
    assert column["limit"][-1] == "feed"
    lost = sum(float(v) for v in column["lost_s"])
    feed = report["feed_moves"]
    assert feed["seconds"] - feed["seconds_at_programmed_feed"] == pytest.approx(lost, abs=1e-7)
    head, rows = table(slow)
    assert tuple(head) == SLOW_COLUMNS
    assert len(rows) == report["below_half_feed"]["places"] == 6
    assert sum(float(r[2]) for r in rows) == pytest.approx(report["below_half_feed"]["seconds"], abs=1e-5)
    for words in ("Time at a limit", "below half of the feed", "Lines that take longest", "20 um from the"):
        assert words in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 100


def test_nothing_exceeds_its_limit(job: Path, tmp_path: Path) -> None:
    report = report_of(program(tmp_path), "-j", job)
    share = report["largest_share_of_limit"]
    assert all(0.0 < part <= 1 + 1e-6 for part in share.values())
    assert min(share["jerk"], share["feed"]) > 0.999
    assert report["budget_um"]["blending"] <= 20.0


@pytest.fixture(scope="module")
def corrected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a nominal program, its correction, which has more blocks, and the report of that."""
    folder = tmp_path_factory.mktemp("corrected")
    nominal = program(folder, "G21 G90 G54 G64 P0.01 Q0\nG0 X10 Y10 Z5\nG1 X260 F3000\nY120\nX20\nM2\n")
    words = ("-o", folder / "out.ngc", "-q", "--report", folder / "proof.json")
    assert run("correct", nominal, "-m", BED, *words).exit_code == 0
    return folder


def test_corrected_against_nominal(corrected: Path, tmp_path: Path) -> None:
    nominal, target = corrected / "part.ngc", corrected / "out.ngc"
    assert len(target.read_text().splitlines()) > len(nominal.read_text().splitlines()) + 1
    result = run("retime", target, "-m", BED, "--nominal", nominal, "--report", tmp_path / "r.json")
    assert "Against part.ngc:" in result.stdout
    assert "Largest differences" in result.stdout
    against = json.loads((tmp_path / "r.json").read_text())["nominal"]
    alone = olp.retime(nominal, BED)
    assert against["lines_correspond"]
    assert against["duration_s"] == alone.duration_s
    change = [abs(row["corrected_s"] - row["nominal_s"]) for row in against["differences"]]
    assert change == sorted(change, reverse=True)
    by_line = dict(zip(alone.lines.line.tolist(), alone.lines.seconds.tolist(), strict=True))
    assert {row["line"] for row in against["differences"]} == by_line.keys() == {3, 4, 5}
    for row in against["differences"]:
        assert row["nominal_s"] == pytest.approx(by_line[row["line"]])
    other = run("retime", program(tmp_path, "G0 X10 Y10 Z5\nG1 X40 F60\n"), "-m", BED, "--nominal", nominal)
    assert other.exit_code == 0
    assert "do not correspond" in other.stdout


def test_the_budget_stands_beside_that_of_the_correction(corrected: Path, tmp_path: Path) -> None:
    target, proof = corrected / "out.ngc", tmp_path / "proof.json"
    proof.write_bytes((corrected / "proof.json").read_bytes())
    static = json.loads(proof.read_text())
    result = run("retime", target, "-m", BED, "--proof", proof, "--report", tmp_path / "r.json")
    assert "by the proof of part.ngc" in result.stdout
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["proof"]["budget_um"] == static["budget_um"]
    residual_um = static["deviation"]["path_max_um"]
    assert report["proof"]["at_most_um"] == pytest.approx(residual_um + sum(report["budget_um"].values()))
    for text, code in (("{", 3), ("[]", 2), ("{}", 2), (json.dumps(report), 2)):
        proof.write_text(text)
        refused = run("retime", target, "-m", BED, "--proof", proof)
        assert (refused.exit_code, refused.stdout) == (code, "")
    proof.write_text(json.dumps(static | {"machine": {"name": "another"}}))
    assert "another" in run("retime", target, "-m", BED, "--proof", proof).stderr


def test_a_wider_tolerance_saves_time_and_costs_path(job: Path, tmp_path: Path) -> None:
    study = report_of(program(tmp_path), "-j", job, "--blend-study")["blend_study"]
    assert [row["factor"] for row in study] == [0.25, 0.5, 1.0, 2.0, 4.0]
    assert [row["tolerance_um"] for row in study] == [[5.0], [10.0], [20.0], [40.0], [80.0]]
    seconds = [row["duration_s"] for row in study]
    assert seconds == sorted(seconds, reverse=True)
    assert seconds[0] > seconds[-1]
    assert all(0.0 < row["deviation_um"] <= row["tolerance_um"][0] for row in study)
    named = program(tmp_path, SQUARE.replace("P0.02", "P0.08"), "wide.ngc")
    assert report_of(named, "-j", job)["duration_s"] == pytest.approx(seconds[-1], rel=1e-9)
    assert "at other path" not in run("retime", named, "-j", job).stdout


@pytest.mark.slow
def test_the_machine_says_how_its_control_passes_corners(tmp_path: Path) -> None:
    text = "G1 X40. F3000.\nY40.\nX0.\nY0.\n"
    seconds: dict[str, float] = {}
    for name, keys in {
        "none": "",
        "fine": "[path]\nblend_mm = 0.001\n",
        "coarse": "[path]\nblend_mm = 0.1\n",
        "stop": '[path]\nmode = "exact-stop"\n',
    }.items():
        # each in two of four controls
        for control in ("fanuc", "linuxcnc") if name in ("none", "stop") else ("grbl", "haas"):
            where = tmp_path / f"{name}-{control}"
            job = machine(where, controller=control, tables=keys + TRUE_ZERO, job=START).with_name("job.toml")
            part = program(where, text)
            report = report_of(part, "-j", job)
            assert seconds.setdefault(name, report["duration_s"]) == report["duration_s"]
            path = report["path"]
            assert path["exact_stop_at_start"] == (name == "stop")
            if name == "none":
                assert (path["default_um"], path["default_from"]) == (10.0, "the default")
            elif name != "stop":
                assert path["default_from"] == "the machine file"
            # what the call says wins over the machine file
            wins = report_of(part, "-j", job, "--blend-mm", "0.1")
            assert wins["path"]["default_from"] == "the call"
            assert seconds.setdefault("call", wins["duration_s"]) == wins["duration_s"]
    assert seconds["stop"] > seconds["fine"] > seconds["none"] > seconds["coarse"] == seconds["call"]


def test_a_program_may_leave_the_exact_stop_of_the_machine(tmp_path: Path) -> None:
    tables = '[path]\nmode = "exact-stop"\nblend_mm = 0.05\n' + TRUE_ZERO
    job = machine(tmp_path / "m", controller="fanuc", tables=tables, job=START).with_name("job.toml")
    stop = report_of(program(tmp_path, "G1 X40. F3000.\nY40.\n"), "-j", job)
    blended = report_of(program(tmp_path, "G64 G1 X40. F3000.\nY40.\n"), "-j", job)
    assert stop["budget_um"]["blending"] == pytest.approx(0.0, abs=1e-6)
    assert 5.0 < blended["budget_um"]["blending"] <= 50.0
    assert blended["duration_s"] < stop["duration_s"]


def test_an_exact_path_has_no_tolerance(job: Path, tmp_path: Path) -> None:
    result = run("retime", program(tmp_path, "G61.1\nG1 X40 F3000\nY40\n"), "-j", job, "--blend-study")
    assert "Path tolerance: none" in result.stdout
    assert len({line.split()[-2] for line in result.stdout.splitlines() if line.startswith("  x ")}) == 1


def test_block_delete_and_flatten(job: Path, tmp_path: Path) -> None:
    part = program(tmp_path, "G1 X40 F3000\n/Y40\nX0\n")
    assert (
        report_of(part, "-j", job, "--block-delete")["duration_s"] < report_of(part, "-j", job)["duration_s"]
    )
    loop = "#1 = 0\no1 while [#1 lt 3]\nG1 X[40 - #1] F3000\n#1 = [#1 + 1]\no1 endwhile\n"
    plain = program(tmp_path, "G1 X40 F3000\nX39\nX38\n", "plain.ngc")
    unrolled = report_of(program(tmp_path, loop, "loop.ngc"), "-j", job, "--flatten")
    assert unrolled["duration_s"] == pytest.approx(report_of(plain, "-j", job)["duration_s"], rel=1e-12)


def test_quiet_is_quiet(job: Path, tmp_path: Path) -> None:
    result = run("retime", program(tmp_path), "-j", job, "-o", tmp_path / "out.csv", "-q")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


def test_progress_is_told(job: Path, tmp_path: Path) -> None:
    reported: list[tuple[str, float]] = []
    timing = olp.retime(
        program(tmp_path), job.with_name("machine.toml"), job, study_blend=True,
        progress=lambda what, share: reported.append((what, share)),
    )  # fmt: skip
    assert all(0.0 <= share <= 1.0 for _, share in reported)
    assert {what for what, _ in reported} == {"read", "plan", *(f"blend x{f:g}" for f in (0.25, 0.5, 2, 4))}
    plans = [share for what, share in reported if what == "plan"]
    assert plans == sorted(plans)
    assert plans[-1] == 1.0
    assert timing.report["blend_study"]


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_no_network_is_touched(job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: object, **more: object) -> None:
        raise AssertionError("a socket was opened")

    monkeypatch.setattr("socket.socket.connect", refuse)
    assert olp.retime(program(tmp_path), job.with_name("machine.toml"), job).duration_s > 0.0


# -- mistakes that a call or a file may hold --------------------------------------------------------------


@pytest.mark.parametrize("kind", ["csv", "npz", "ros", "pvt"])
@pytest.mark.parametrize("cycle_s", [1e-12, 0.0, -1e-3, float("nan"), float("inf")])
def test_every_format_refuses_a_cycle_that_cannot_be(
    job: Path, tmp_path: Path, kind: Format, cycle_s: float
) -> None:
    timing = timed(job, tmp_path)
    with pytest.raises(UsageError, match="cycle"):
        timing.parts(kind, cycle_s)
    with pytest.raises(UsageError, match="cycle"):
        timing.write(tmp_path / "out", kind, cycle_s)
    assert not (tmp_path / "out").exists()


_TIMED: dict[str, Retiming] = {}


def timed(job: Path, folder: Path) -> Retiming:
    """One plan for all that ask for no other."""
    if "square" not in _TIMED:
        _TIMED["square"] = olp.retime(program(folder), job.with_name("machine.toml"), job)
    return _TIMED["square"]


@pytest.mark.parametrize(
    "change",
    [
        {"budget_um": [1.0]},
        {"budget_um": {"rounding": None}},
        {"budget_um": {"rounding": float("nan")}},
        {"deviation": []},
        {"deviation": {"path_max_um": float("inf")}},
        {"machine": "m"},
        {"program": None},
    ],
)
def test_a_report_that_is_none_is_refused_before_the_work(
    job: Path, tmp_path: Path, change: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def planned(*_: object) -> None:
        raise AssertionError("planned before the proof was looked at")

    monkeypatch.setattr("olp.workflows.retime.planned", planned)
    good = {
        "schema": "olp-report-1", "machine": {"name": "m"}, "program": {"name": "part.ngc"},
        "deviation": {"path_max_um": 0.5}, "budget_um": {"rounding": 0.9},
    }  # fmt: skip
    proof = tmp_path / "proof.json"
    proof.write_text(json.dumps(good | change))
    result = run("retime", program(tmp_path), "-j", job, "--proof", proof)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "the proof is not the report of a correction" in result.stderr


@pytest.mark.slow
def test_names_are_no_mathematics_of_a_picture(tmp_path: Path) -> None:
    where = machine(tmp_path / "m", tables=TRUE_ZERO, job=START)
    where.write_text(where.read_text().replace('name = "m"', 'name = "cost $5 and $x_$"'))
    (where.with_name("calibration.toml")).write_text(
        where.with_name("calibration.toml")
        .read_text()
        .replace('machine = "m"', 'machine = "cost $5 and $x_$"')
    )
    job = where.with_name("job.toml")
    for words in (
        ["retime", program(tmp_path, name="a$b^$.ngc"), "-j", job, "--plot", tmp_path / "motion.svg"],
        ["inspect", "-j", job, "--plot", tmp_path / "curves.svg"],
    ):
        result = run(*words)
        assert result.exit_code == 0, result.stderr
        assert "cost $5 and $x_$" in words[-1].read_text()


@pytest.mark.slow
def test_beyond_travel_is_a_finding(tmp_path: Path) -> None:
    job = machine(tmp_path / "m", tables=TRUE_ZERO, job=START).with_name("job.toml")
    near = "G1 X1999.5 Y0 Z0 F30000\nG3 X1999.5 Y10 I0 J5\nG1 X0\n"
    target = tmp_path / "out.csv"
    for text, lines in ((near, [2]), (near.replace("1999.5", "1994.9"), [])):
        part = program(tmp_path, text)
        result = run("retime", part, "-j", job, "-o", target, "--force", "--report", tmp_path / "r.json")
        report = json.loads((tmp_path / "r.json").read_text())
        findings = [f for f in report["findings"] if f["code"] == "OLP402"]
        assert (result.exit_code, target.exists()) == (1 if lines else 0, True)
        assert [f["lines"] for f in findings] == ([lines] if lines else [])
        checked = json.loads(run("check", part, "-j", job, "--format", "json").stdout)["findings"]
        assert [f["message"] for f in findings] == [f["message"] for f in checked if f["code"] == "OLP402"]
        assert ("OLP402" in result.stdout) == bool(lines)
    part = program(tmp_path, near)
    assert run("retime", part, "-j", job, "--fail-on", "never").exit_code == 0


def test_what_ends_exact_stop_is_told_as_it_is_planned(tmp_path: Path) -> None:
    """G62 and G63 of ISO controls blend as G64 does, and a P of nothing or less is no tolerance."""
    job = machine(tmp_path / "m", controller="fanuc", tables=TRUE_ZERO, job=START).with_name("job.toml")
    path = report_of(program(tmp_path, "G61 G1 X40. F3000.\nG62 Y40.\nX0.\n"), "-j", job)["path"]
    assert (path["stated_um"], path["default_um"]) == ([], 10.0)
    path = report_of(program(tmp_path, "G61 G1 X40. F3000.\nY40.\nX0.\n"), "-j", job)["path"]
    assert (path["stated_um"], path["default_um"]) == ([], None)
    linux = machine(tmp_path / "l", tables=TRUE_ZERO, job=START).with_name("job.toml")
    for text, stated, default in (
        ("G64 P-0.02\n", [], 10.0), ("G64 P0\n", [], 10.0), ("G64 P0.02\n", [20.0], None),
    ):  # fmt: skip
        path = report_of(program(tmp_path, text + "G1 X40 F3000\nY40\n"), "-j", linux)["path"]
        assert (path["stated_um"], path["default_um"]) == (stated, default), text


def test_the_report_keeps_to_its_width_and_shows_no_small_value_as_none(job: Path, tmp_path: Path) -> None:
    modes = "".join(f"G64 P0.0{k}{k}{k}3\nX{k}\n" for k in range(1, 9))
    part = program(tmp_path, "G21 G90 G54 G1 F3000 X0\n" + modes + "Y5\n")
    proof = tmp_path / "proof.json"
    proof.write_text(json.dumps({
        "schema": "olp-report-1", "machine": {"name": "m"}, "program": {"name": "n" * 120 + ".ngc"},
        "deviation": {"path_max_um": 0.001}, "budget_um": {"rounding": 0.9},
    }))  # fmt: skip
    long = program(tmp_path, SQUARE, "l" * 100 + ".ngc")
    result = run("retime", part, "-j", job, "--proof", proof, "--nominal", long)
    assert result.exit_code == 0
    assert max(map(len, result.stdout.splitlines())) <= 100
    assert next(row for row in result.stdout.splitlines() if "by the proof of" in row).split()[-1] == "<0.01"


def test_the_time_of_a_control_is_stated_and_learned_from_a_log(job: Path, tmp_path: Path) -> None:
    """A log of the planned motion itself: the limits that it holds are those of the machine file."""
    args = (program(tmp_path, "G21 G90 G54\nG0 X90\nG0 X0\nG0 Y90\nG0 Y0\nM2\n"), "-j", job)
    assert "controller" not in report_of(*args)
    own = report_of(*args, "--controller", "grbl", "--setting", "junction_deviation_mm=0.05")["controller"]
    assert [one["stated"] for one in own["settings"]] == [True, False]
    assert run("retime", *args, "-q", "-o", tmp_path / "run.csv").exit_code == 0
    plan = report_of(*args, "--controller", "linuxcnc", "--log", tmp_path / "run.csv")
    log, limits = plan["controller"]["log"], plan["limits"]
    assert log["axes"] == ["X", "Y"]
    assert log["velocity_mm_s"] == pytest.approx(limits["velocity_mm_s"], rel=0.01)
    assert log["duration_s"] == pytest.approx(plan["duration_s"], abs=0.01)
    text = run("retime", *args, "--controller", "linuxcnc", "--log", tmp_path / "run.csv").stdout
    assert "On LinuxCNC 2.9: " in text
    assert "Learned from " in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: rows[: len(rows) // 2], "a whole run of this program, with positions in mm"),
        (lambda rows: [[t, *(v / 25.4 for v in p)] for t, *p in rows], "over 3.54"),
        (lambda rows: [[1000.0 * t, *p] for t, *p in rows], "with times in s"),
        (lambda rows: [*rows[:50], *rows[60:]], "its row 51 comes 0.011 s behind"),
        (lambda rows: rows[:20], "a whole run"),
        (lambda rows: rows[: int(0.85 * len(rows))], "end at other places"),
    ],
)  # fmt: skip
def test_a_log_of_something_else_is_refused(
    job: Path, tmp_path: Path, change: Callable[[list[list[float]]], list[list[float]]], message: str
) -> None:
    """Half of a run, inches, milliseconds, a gap, few rows, and a run without its last way back."""
    args = (program(tmp_path, "G21 G90 G54\nG0 X90\nG0 X0\nG0 Y90\nG0 Y0\nM2\n"), "-j", job)
    run("retime", *args, "-q", "-o", tmp_path / "run.csv")
    head, *lines = (tmp_path / "run.csv").read_text().splitlines()
    keep = [head.split(",").index(name) for name in ("t_s", "X_mm", "Y_mm", "Z_mm")]
    rows = change([[float(line.split(",")[k]) for k in keep] for line in lines])
    text = "\n".join(["t_s,X_mm,Y_mm,Z_mm", *(",".join(map(repr, row)) for row in rows), ""])
    (tmp_path / "other.csv").write_text(text)
    result = run("retime", *args, "--controller", "grbl", "--log", tmp_path / "other.csv")
    assert result.exit_code in (2, 4)
    assert message in result.stderr and "other.csv" in result.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--controller", "fanuk"), "expected one of linuxcnc, grbl"),
        (("--log", "run.csv"), "--controller"),
        (("--controller", "grbl", "--setting", "x"), "NAME=VALUE"),
        (("--controller", "grbl", "--setting", "servo_period_ms=1"), "no setting"),
    ],
)
def test_what_a_control_does_not_have_is_refused(
    job: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    result = run("retime", program(tmp_path), "-j", job, *options)
    assert result.exit_code == 2
    assert message in result.stderr
