"""The samples say what the machine would do: held against the judge's own model, the proof, and sums by
hand."""

from __future__ import annotations

import dataclasses
import math
import shutil
import tracemalloc
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from judge.machines import Recipe, random_machine, shift_machine, zero_machine
from judge.model import JudgeModel

import olp
from olp.core.errors import CannotCompute
from olp.core.toolpath import Flag, Kind
from olp.review.job import Review
from olp.review.manifest import rapid
from olp.review.samples import away_mm

ROOT = Path(__file__).resolve().parents[2]
NASTY = ROOT / "programs" / "nasty"
REFUSED = {"block-delete-depends.ngc"}
PROGRAMS = sorted(path.name for path in NASTY.glob("*.ngc") if path.name not in REFUSED)
HEAD = "G21 G17 G90 G94 G54 G64 P0.01 Q0\nG43 H1\nG0 X0 Y0 Z20\n"


@cache
def nasty(name: str) -> Review:
    return olp.view(NASTY / name, NASTY / "machine.toml", time=False)


def viewed(folder: Path, machine: Path, text: str, **options: object) -> Review:
    path = folder / "part.ngc"
    path.write_text(HEAD + text)
    return olp.view(path, machine, time=False, **options)  # type: ignore[arg-type]


def size_um(delta: np.ndarray) -> np.ndarray:
    return np.linalg.norm(delta, axis=1) * 1e3


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_is_shown_where_its_words_say(name: str) -> None:
    """Every waypoint of a known position is a sample, and its place is the axis position less frame and
    length."""
    scene = nasty(name).scene
    path, samples = scene.nominal.toolpath, scene.samples
    ends = np.flatnonzero(samples.share == 1.0)
    known = np.flatnonzero(np.isfinite(path.end_mm).all(axis=1))
    assert samples.move[ends].tolist() == known.tolist()
    np.testing.assert_array_equal(samples.axis_mm[ends], path.end_mm[known])
    length = np.array([path.frames[f].length_mm for f in path.frame[known]])
    np.testing.assert_allclose(
        scene.position_mm[ends], path.end_mm[known] - length - np.array(scene.frame.origin_mm), atol=1e-12
    )
    assert (np.diff(samples.move) >= 0).all()
    assert (np.diff(samples.move + samples.share) >= 0).all()
    assert (np.diff(samples.part) >= 0).all()
    assert (np.diff(samples.arc_mm) >= 0).all()
    assert (np.diff(scene.time_s) >= 0).all()


@pytest.mark.parametrize("name", PROGRAMS)
def test_what_is_left_is_what_the_proof_says(name: str) -> None:
    """On feed moves that the proof judges no sample is farther off than the proof allows; at the ends of
    moves, the largest is the proof's."""
    scene = nasty(name).scene
    path, samples = scene.nominal.toolpath, scene.samples
    if any(f["code"] in ("OLP102", "OLP103", "OLP306") for f in scene.report["findings"]):
        pytest.skip("the proof leaves out moves that are shown")
    plain = (path.kind != Kind.RAPID) & ((path.flag & np.uint8(Flag.CYCLE | Flag.WHOLE | Flag.PASS)) == 0)
    feed = plain[samples.move]
    after, before = (size_um(delta)[feed] for delta in (samples.corrected, samples.uncorrected))
    deviation = scene.report["deviation"]
    assert after.max(initial=0.0) <= deviation["allowed_um"] + 1e-3
    ends = (samples.share == 1.0)[feed]
    assert before[ends].max(initial=0.0) <= deviation["before"]["waypoints"]["max_um"] + 1e-3
    assert after[ends].max(initial=0.0) <= deviation["after"]["waypoints"]["max_um"] + 1e-3


@pytest.mark.parametrize("name", ["modal.ngc", "planes.ngc", "tool-offset.ngc", "work-offsets.ngc"])
def test_the_uncorrected_machine_is_the_judges(name: str, tmp_path: Path) -> None:
    """The error at the nominal axis position, less what the touch-off holds."""
    folder = tmp_path / "nasty"
    shutil.copytree(NASTY, folder)
    for path in (folder / "machine.toml", folder / "calibration.toml"):
        text = path.read_text().replace("touch_tool = 1", 'set_by = "true"')
        path.write_text(text.partition("[backlash]")[0])
    scene = olp.view(folder / name, folder / "machine.toml", time=False).scene
    judge = JudgeModel(folder / "machine.toml")
    path, samples = scene.nominal.toolpath, scene.samples
    for frame in np.unique(path.frame):
        mine = path.frame[samples.move] == frame
        error = judge.error_mm(samples.axis_mm[mine], np.array(path.frames[frame].tool_mm))
        np.testing.assert_allclose(samples.uncorrected[mine], error, atol=1e-7)
        command = judge.error_mm(samples.command_mm[mine], np.array(path.frames[frame].tool_mm))
        np.testing.assert_allclose(samples.corrected[mine], samples.correction[mine] + command, atol=1e-7)


def test_no_error_no_deviation(tmp_path: Path) -> None:
    scene = viewed(tmp_path, zero_machine(tmp_path / "m"), "G1 X100 Y50 F600\nG2 X140 Y90 I40 J0\nM2\n").scene
    for delta in (scene.samples.uncorrected, scene.samples.correction, scene.samples.corrected):
        assert np.abs(delta).max() == 0.0
    assert scene.sources == ()


def test_a_machine_that_is_off_everywhere(tmp_path: Path) -> None:
    machine = shift_machine(tmp_path / "m", (30.0, -20.0, 10.0))
    scene = viewed(tmp_path, machine, "G1 X100 Y50 F600\nM2\n").scene
    np.testing.assert_allclose(
        scene.samples.uncorrected * 1e3, np.tile([30.0, -20.0, 10.0], (len(scene.samples), 1))
    )
    np.testing.assert_allclose(
        scene.samples.correction * 1e3, np.tile([-30.0, 20.0, -10.0], (len(scene.samples), 1))
    )
    assert np.abs(scene.samples.corrected).max() < 1e-9
    assert [name for name, _ in scene.sources] == ["EXX", "EYY", "EZZ"]
    assert [part.largest for _, part in scene.sources] == pytest.approx([30.0, 20.0, 10.0])


def test_sources_add_up_to_the_error(tmp_path: Path) -> None:
    """Each is no more than the whole of them, and no less than what they leave to explain."""
    machine = random_machine(tmp_path / "m", 5, Recipe(backlash_um={"X": 4.0}, cyclic=True))
    scene = viewed(tmp_path, machine, "G1 X100 Y50 Z-20 F600\nX-90\nM2\n").scene
    total = np.sum([part.values() for _, part in scene.sources], axis=0) * 1e-3
    within = sum(part.step for _, part in scene.sources) * 1e-3
    assert (np.linalg.norm(scene.samples.uncorrected, axis=1) <= total * (1 + 1e-3) + within).all()
    sizes = [part.largest for _, part in scene.sources]
    assert sizes == sorted(sizes, reverse=True)
    assert {"EXX", "cyclic EXX", "backlash X"} <= {name for name, _ in scene.sources}


def test_between_way_points_the_tip_is_beside_the_path(tmp_path: Path) -> None:
    """The residual there is the distance of the path, not the delay of the tip."""
    machine = random_machine(tmp_path / "m", 8)
    scene = viewed(
        tmp_path, machine, "G1 X300 Y100 F900\nG3 X300 Y180 I0 J40\nG2 X120 Y180 I-90 J30\nM2\n"
    ).scene
    samples, path = scene.samples, scene.nominal.toolpath
    inner = np.flatnonzero((samples.share[1:-1] < 1.0) & (samples.within[1:-1] < 1.0)) + 1
    inner = inner[
        (path.kind[samples.move[inner]] != Kind.RAPID) & (samples.move[inner] == samples.move[inner - 1])
    ]
    step = samples.axis_mm[inner + 1] - samples.axis_mm[inner - 1]
    along = np.einsum("ij,ij->i", samples.corrected[inner], step) / np.linalg.norm(step, axis=1)
    # except for the rounding of waypoints
    ends = np.linalg.norm(samples.corrected[samples.within == 1.0], axis=1)
    assert np.abs(along).max() < min(ends.max() + 1e-5, 0.87e-3)
    assert size_um(samples.corrected[inner]).max() > 0.05


def test_a_program_that_is_left_as_it_is_deviates_as_before(tmp_path: Path) -> None:
    """On a machine that is off by the same everywhere, on arcs too."""
    machine = shift_machine(tmp_path / "m", (30.0, -20.0, 10.0))
    text = HEAD + "G1 X100 Y50 F600\nG2 X140 Y90 I40 J0\nM2\n"
    samples = olp.view(text.encode(), machine, corrected=text.encode(), time=False).scene.samples
    np.testing.assert_allclose(samples.corrected, samples.uncorrected, atol=1e-9)
    assert not samples.correction.any()


def test_chords_of_arcs_are_fine_enough_to_look_round(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    scene = viewed(
        tmp_path, machine, "G1 X0.5 F600\nG2 X0.5 I-0.5\nG2 X0.5 Y200 I0 J100\nM2\n", step_mm=500.0
    ).scene
    samples = scene.samples
    for move in np.flatnonzero(scene.nominal.toolpath.kind == Kind.ARC_CW):
        turn = np.diff(samples.share[samples.move == move]).max() * np.abs(
            scene.nominal.toolpath.arcs.sweep_rad[0]
        )
        assert turn <= np.pi / 36 + 1e-9


def test_the_step_is_what_was_asked_for(tmp_path: Path) -> None:
    scene = viewed(tmp_path, zero_machine(tmp_path / "m"), "G1 X100 F600\nM2\n", step_mm=0.25).scene
    feed = scene.nominal.toolpath.kind[scene.samples.move] == Kind.LINE
    np.testing.assert_allclose(np.diff(scene.samples.arc_mm[feed]), 0.25, atol=1e-7)


def test_a_gap_is_no_line(tmp_path: Path) -> None:
    """After a tool change the positions of the axes are unknown until they are commanded."""
    scene = viewed(
        tmp_path, zero_machine(tmp_path / "m"), "G1 X10 F600\nT2 M6\nG43 H2\nG0 X0 Y0 Z20\nG1 X10\nM2\n"
    ).scene
    samples = scene.samples
    lines = scene.nominal.toolpath.line[samples.move]
    behind = np.flatnonzero(~samples.joined)
    assert lines[behind].tolist() == [3, 7]


def test_one_work_offset_is_the_frame_and_several_are_the_machine() -> None:
    assert nasty("modal.ngc").scene.frame.offset == "G54"
    assert nasty("work-offsets.ngc").scene.frame.offset == "machine"
    assert nasty("g52.ngc").scene.frame.offset == "machine"


def test_a_program_without_positions_has_nothing_to_show(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    path = tmp_path / "part.ngc"
    path.write_text("G21 G90 G54\nG0 Z20\nM2\n")
    with pytest.raises(CannotCompute, match="nothing to show"):
        olp.view(path, machine, time=False)


@pytest.mark.parametrize(
    ("folder", "program", "job"),
    [
        ("nasty", "modal.ngc", "job.toml"),
        ("nasty", "planes.ngc", "job.toml"),
        ("nasty", "cycles.ngc", "job.toml"),
        ("gantry-plate", "plate.ngc", "job.toml"),
        ("gantry-plate", "bracket.mpf", "job-bracket.toml"),
        ("haas-mill", "bracket.nc", "job.toml"),
        ("haas-mill", "manifold.nc", "job-manifold.toml"),
        pytest.param("table-router", "front.ngc", "job.toml", marks=pytest.mark.slow),
        ("table-router", "outline.ngc", "job-outline.toml"),
        ("table-router", "drill.ngc", "job-drill.toml"),
        pytest.param("bridge-cmm", "housing.ngc", "job.toml", marks=pytest.mark.slow),
    ],
)
def test_what_is_drawn_of_a_line_is_what_the_table_states(folder: str, program: str, job: str) -> None:
    """Without what an unknown side of the backlash may add, which the table tells, within what the proof may
    miss between two of its samples. Every line that counts is drawn."""
    where = ROOT / "programs" / folder
    scene = olp.view(where / program, where / "machine.toml", where / job, time=False).scene
    samples, table = scene.samples, scene.table
    lines = table.by_line()
    counts = np.flatnonzero(lines["state"] < 2)
    row = np.searchsorted(lines["line"], table.line[samples.move])
    drawn_there = table.judged[samples.move] & (rapid(scene) != 1)
    for layer in ("uncorrected", "corrected"):
        away = away_mm(scene.position_mm, samples.share, scene.waypoint, getattr(samples, layer))
        drawn = np.full(len(lines["line"]), -np.inf)
        np.maximum.at(drawn, row[drawn_there], 1e3 * away[drawn_there])
        side = lines.get(f"{layer}_side_um", np.zeros(len(drawn)))
        stated = lines[f"{layer}_um"] - side
        assert (np.abs(drawn - stated) < 0.1 + 0.01 * stated)[counts].all(), layer
        close = np.abs(drawn - stated) < 0.02 + 0.005 * stated
        assert close[counts].mean() > 0.8, layer


@pytest.mark.slow
def test_an_unknown_side_of_the_backlash_is_told_of_each_line() -> None:
    """On the plate, whose axes have 3 um of backlash, until they have moved by it."""
    where = ROOT / "programs" / "gantry-plate"
    scene = olp.view(where / "plate.ngc", where / "machine.toml", where / "job.toml", time=False).scene
    lines = scene.table.by_line()
    told = lines["line"][lines["uncorrected_side_um"] > 0.005].tolist()
    assert 849 in told and 900 not in told and len(told) < 20
    assert lines["uncorrected_side_um"][lines["line"] == 849] == pytest.approx(3.0, abs=0.01)
    # the corrected program takes it up first
    assert "corrected" not in scene.table.side


def test_how_far_a_sample_is_off_by_its_place_in_the_move() -> None:
    """On a path to the right, then up: the deviation is (-3, 4) at the end of the first move, at the start of
    the second one, within it and at its end."""
    position = np.array([[0.0, 0, 0], [9, 0, 0], [9, 0, 0], [9, 9, 0], [9, 18, 0]])
    share = np.array([0.0, 1.0, 0.0, 0.5, 1.0])
    delta = np.tile([-3.0, 4.0, 0.0], (5, 1))
    # the start of the path lies behind the nominal point, that of the second move ahead of it
    assert away_mm(position, share, share == 1.0, delta).tolist() == [5.0, 5.0, 3.0, 3.0, 5.0]
    assert away_mm(position, share, share == 1.0, -delta).tolist() == [4.0, 5.0, 5.0, 3.0, 5.0]
    # the end of a stroke above the bottom counts as what is between
    assert away_mm(position, share, np.array([0, 1, 0, 0, 0], bool), delta)[-1] == 3.0


def test_beyond_the_end_of_a_short_move_it_is_off_from_there() -> None:
    """Moves of 2 to the right, which are shorter than the tip is off, (3, 4)."""
    position = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    share, delta = np.array([0.0, 0.5, 1.0]), np.tile([3.0, 4.0, 0.0], (3, 1))
    away = away_mm(position, share, share == 1.0, delta)
    assert away.tolist() == pytest.approx([4.0, math.hypot(2, 4), 5.0])
    assert away_mm(position, share, share == 1.0, -delta)[1] == pytest.approx(math.hypot(2, 4))


def test_samples_become_others_one_column_at_a_time() -> None:
    """A long program has no room for all columns twice: each is freed before the next is copied."""
    samples = nasty(PROGRAMS[0]).scene.samples
    names = [field.name for field in dataclasses.fields(samples)]
    present = {name: getattr(samples, name) for name in names if getattr(samples, name) is not None}
    count = 20_000
    tracemalloc.start()
    try:
        copies = {name: np.resize(values, (count, *values.shape[1:])) for name, values in present.items()}
        whole = sum(values.nbytes for values in copies.values())
        expected = {name: values[::-1][:1000].copy() for name, values in copies.items()}
        many = dataclasses.replace(samples, **copies)
        del copies
        tracemalloc.reset_peak()
        many.become(np.arange(count)[::-1])
        assert tracemalloc.get_traced_memory()[1] < 1.6 * whole
    finally:
        tracemalloc.stop()
    for name, values in expected.items():
        np.testing.assert_array_equal(getattr(many, name)[:1000], values)
