"""What of a measured run counts: the distance from the path, or from the point where points count."""

from __future__ import annotations

import json
from pathlib import Path as File

import numpy as np
import pytest
from cli.test_cli import PROGRAMS, run
from judge.machines import Recipe, random_machine, zero_machine

import olp
from olp.comparison.figures import Run
from olp.comparison.nominal import counting
from olp.comparison.pairing import pair
from olp.comparison.path import Path
from olp.proof.proof import Counts

HEAD = b"G21 G90 G17 G54 G94 G61\n"


def table(points: np.ndarray, frame: str = "") -> str:
    rows = [f"{x:.6f},{y:.6f},{z:.6f}" for x, y, z in points]
    return "\n".join([*([f"# frame={frame}"] if frame else []), "X_mm,Y_mm,Z_mm", *rows]) + "\n"


@pytest.mark.slow
def test_an_overshoot_at_the_end_of_a_slot_is_a_distance() -> None:
    """There and back along X: 50 um too far has no part across any line."""
    path = Path.through(np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    x = np.concatenate((np.linspace(0.0, 100.05, 1500), np.linspace(100.05, 0.0, 1500)))
    points = np.column_stack((x, 0 * x, 0 * x))
    one = Run.of("a", path, points, pair(path, points, "forward"), 1.0)
    assert one.figures(path)["across_um"]["max"] == pytest.approx(50.0, abs=0.01)


def test_where_a_rapid_takes_up_backlash_nothing_is_cut() -> None:
    """The rapid goes 10 um past the place where the plunge begins, on every axis, and comes back."""
    corners = np.array([[0.0, 0.0, 4.0], [80.0, 60.0, 4.0], [80.0, 60.0, -3.0], [0.0, 60.0, -3.0]])
    path = Path.through(corners, cutting=np.array([False, False, True, True]))
    past = corners[1] + np.array([0.01, 0.01, -0.01])

    def between(a: np.ndarray, b: np.ndarray, count: int) -> np.ndarray:
        return a + np.linspace(0.0, 1.0, count)[1:, None] * (b - a)

    off = np.array([0.0, 0.003, 0.0])
    points = np.concatenate((
        corners[:1], between(corners[0], past, 200), between(past, corners[1], 9),
        between(corners[1], corners[2], 400) + off, between(corners[2] + off, corners[3] + off, 400),
    ))  # fmt: skip
    one = Run.of("a", path, points, pair(path, points, "forward"), 1.0)
    assert one.size_mm.max() > 0.01
    assert one.size_mm[one.counted].max() == pytest.approx(0.003, abs=1e-6)
    # a cut that is off from its first point on is counted but for that point
    assert one.counted.sum() == pytest.approx(798, abs=3)


def test_a_stop_counts_by_the_nearest_point_that_was_measured() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [50.0, 40.0, 0.0]])
    path = Path.through(corners, cutting=np.zeros(3, bool), stop=np.ones(3, bool))
    points = corners + np.array([[0.01, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.0, 0.03]])
    between = np.array([[25.0, 0.5, 0.0]])
    points = np.concatenate((points[:1], between, points[1:]))
    one = Run.of("a", path, points, pair(path, points, "forward"), 1.0)
    assert one.stop.tolist() == [0, -1, 1, 2]
    assert one.size_mm[one.counted] == pytest.approx([0.01, 0.02, 0.03])
    assert one.line(path).tolist() == [1, 2, 2, 3]
    assert one.covered(path) == 1.0


@pytest.mark.parametrize("text", [
    HEAD + b"G0 X100 Y100 Z50\nG1 Z20 F600\nX400 Y180\nG53 G1 X420\nG0 Z50\nM2\n",
    HEAD + b"G0 X100 Y100 Z50\nX300\nY200\nM2\n",
    HEAD + b"G0 X100 Y100 Z50\nG81 X150 Y150 Z-60 R10 F300\nG80\nG1 X200 F600\nG28 Z0\nM2\n",
])  # fmt: skip
def test_what_counts_measured_is_what_counts_predicted(text: bytes, tmp_path: File) -> None:
    recipe = Recipe(work_offsets={"G54": {"Z_mm": -100.0, "set_by": "true"}})
    path = random_machine(tmp_path, 4, recipe)
    review = olp.view(text, path, time=False)
    nominal = review.scene.nominal
    along, at_end = counting(nominal.toolpath, points=nominal.dialect.points)
    counts = review.scene.table.counts
    assert (along | at_end)[counts <= Counts.LEFT].all()
    assert not (along & at_end).any()
    assert at_end[counts == Counts.POINT].all()
    assert not (along | at_end)[counts == Counts.RAPID].any()


def test_points_of_a_program_of_points_count(tmp_path: File) -> None:
    """Two rapids: neither is a path, and both ends are points. 30 um along the way is 30 um."""
    machine = zero_machine(tmp_path / "m")
    program, attained = tmp_path / "p.ngc", tmp_path / "m.csv"
    program.write_bytes(HEAD + b"G0 X0 Y0 Z20\nX100\nY80\nM2\n")
    attained.write_text(table(np.array([[0.0, 0, 20], [99.97, 0, 20], [100.0, 80, 20]]), "G54"))
    result = run("compare", program, attained, "-m", machine, "--part-tolerance-um", 20, "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == 1
    assert report["worst"][0]["line"] == 3
    assert report["worst"][0]["max_um"] == pytest.approx(30.0, abs=1e-6)
    review = olp.view(program, machine, measured=[attained], part_tolerance_um=20, time=False)
    assert review.scene.report["measured"]["across_um"]["max"] == report["after"]["across_um"]["max"]
    assert review.scene.report["verdict"]["ok"] is False


def test_a_list_with_its_machine_is_a_program_of_points(tmp_path: File) -> None:
    machine = zero_machine(tmp_path / "m")
    nominal, attained = tmp_path / "n.csv", tmp_path / "m.csv"
    points = np.array([[0.0, 0, 20], [100, 0, 20], [100, 80, 20], [0, 80, 20]])
    nominal.write_text(table(points, "G54"))
    attained.write_text(table(points + np.array([[0, 0, 0], [-0.03, 0, 0], [0, 0, 0], [0, 0, 0.0]]), "G54"))

    def largest(*words: object) -> float:
        report = json.loads(run("compare", nominal, attained, *words, "--json").stdout)
        return float(report["after"]["across_um"]["max"])

    assert largest("-m", machine) == pytest.approx(30.0, abs=1e-6)
    assert largest() == pytest.approx(0.0, abs=1e-6)
    review = olp.view(nominal, machine, measured=[attained], time=False)
    assert review.scene.report["measured"]["across_um"]["max"] == pytest.approx(30.0, abs=1e-6)


@pytest.mark.slow
def test_a_run_without_a_point_that_counts_is_said_and_is_no_pass(tmp_path: File) -> None:
    machine = zero_machine(tmp_path / "m")
    program, good, idle = tmp_path / "p.ngc", tmp_path / "good.csv", tmp_path / "idle.csv"
    program.write_bytes(HEAD + b"G0 X0 Y0 Z20\nX100 Y80\nG1 X0 F600\nM2\n")
    good.write_bytes(olp.simulate(program, machine).to_csv())
    idle.write_text(table(np.linspace((0.0, 0.0, 20.0), (90.0, 72.0, 20.0), 40), "G54"))
    for tolerance, ok in ((5.0, False), (None, None)):
        done = olp.compare(program, [good, idle], machine, part_tolerance_um=tolerance)
        assert done.report["verdict"]["ok"] is ok
        said = "Not verified: no measured point of idle.csv counts."
        assert done.report["verdict"]["sentences"][-1] == said
        assert "idle.csv: no measured point counts" in [f.message for f in done.findings]
        assert ("OLP609" in {f.code for f in done.findings}) is (tolerance is not None)
        review = olp.view(program, machine, measured=[good, idle], part_tolerance_um=tolerance, time=False)
        assert review.scene.report["verdict"]["ok"] is ok
        assert review.scene.report["verdict"]["sentences"][-1] == said


@pytest.mark.slow
def test_several_runs_share_one_frame_on_the_page_as_in_compare(tmp_path: File) -> None:
    """Runs in another frame, the second shifted against the first: one fit for both leaves the shift."""
    machine = zero_machine(tmp_path / "m")
    program = tmp_path / "p.ngc"
    program.write_bytes(HEAD + b"G0 X0 Y0 Z20\nG1 X100 F600\nY80\nX60 Y95\nX0 Y20 Z35\nM2\n")
    points = olp.simulate(program, machine, step_mm=2.0).points_mm
    files = []
    for name, shift in (("a.csv", 0.0), ("b.csv", 0.04)):
        files.append(tmp_path / name)
        files[-1].write_text(table(points + np.array((300.0, 20.0, shift))))
    done = olp.compare(program, files, machine, part_tolerance_um=10)
    review = olp.view(program, machine, measured=files, part_tolerance_um=10, time=False)
    sizes = [row["across_um"]["max"] for row in done.report["after"]["runs"]]
    assert max(sizes) > 15.0
    assert [row["across_um"]["max"] for row in review.scene.report["measured"]["runs"]] == sizes
    assert review.scene.report["verdict"]["ok"] is done.report["verdict"]["ok"] is False


@pytest.mark.slow
def test_compare_knows_how_the_frames_of_a_program_lie(tmp_path: File) -> None:
    """The same run stated in the first work offset, in another one, and in the machine's own axes."""
    program, machine = PROGRAMS / "nasty" / "work-offsets.ngc", PROGRAMS / "nasty" / "machine.toml"
    simulated = olp.simulate(program, machine, step_mm=2.0)
    setup = olp.load_setup(machine)
    zero = {}
    for name in ("G54", "G55"):
        offset = np.array(setup.work_offset(name).offset_mm)  # type: ignore[union-attr]
        origin_mm = offset + np.array((0.0, 0.0, setup.tool(1).length_mm[2]))  # type: ignore[union-attr]
        zero[name] = offset + np.array(olp.error_at(machine, tuple(origin_mm), 1)["error_um"]) * 1e-3
    stated = tmp_path / "m.csv"
    sizes = []
    for frame, shift in (("G54", 0.0), ("G55", zero["G54"] - zero["G55"]), ("machine", zero["G54"])):
        stated.write_text(table(simulated.points_mm + shift, frame))
        done = olp.compare(program, [stated], machine)
        assert not done.report["frame"]["fitted"]
        sizes.append(done.report["after"]["across_um"]["max"])
    assert sizes == pytest.approx(sizes[:1] * 3, abs=2e-3)
    stated.write_text(table(simulated.points_mm, "G59"))
    with pytest.raises(olp.OlpError, match="'G59' is not an unrotated work offset"):
        olp.compare(program, [stated], machine)
