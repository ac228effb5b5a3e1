"""Measured points find their places on the path, in order, or are refused with their line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from judge.machines import Recipe, random_machine, zero_machine
from judge.unpacker import Page

import olp
from olp.comparison.nominal import CHORD_MM
from olp.core.errors import ConfigError, InputError
from olp.files.points import parse_points

ROOT = Path(__file__).resolve().parents[2]
NASTY = ROOT / "programs" / "nasty"
#: twice round the same square, then through it, with an arc
TEXT = (
    "G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nY80\nX0\nY0\nX100\nY80\nX0\nY0\nX100 Y80\n"
    "G3 X60 Y40 R40\nM2\n"
)


def written(folder: Path, text: str | bytes, name: str = "measured.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def csv(points: np.ndarray, frame: str = "G54") -> str:
    rows = [f"{x:.6f},{y:.6f},{z:.6f}" for x, y, z in points.tolist()]
    return "\n".join([f"# frame={frame}", "X_mm,Y_mm,Z_mm", *rows]) + "\n"


@pytest.mark.parametrize(
    "name", some_of_a_campaign(["modal", "full-circle", "g91-steps", "helix-turns", "planes", "inch"], 3)
)
@pytest.mark.slow
def test_what_simulate_writes_is_the_uncorrected_machine(name: str, tmp_path: Path) -> None:
    program, machine = NASTY / f"{name}.ngc", NASTY / "machine.toml"
    path = written(tmp_path, olp.simulate(program, machine, step_mm=0.7).to_csv())
    review = olp.view(program, machine, measured=[path], time=False)
    scene, page = review.scene, Page(review.html())
    layer = page.layer("measured")
    index = page.array(layer["index"]).astype(int)
    assert (np.diff(index) >= 0).all()
    delta = page.array(layer["delta"])
    # each is no farther from the path than from the sample that the model puts it to
    size = np.linalg.norm(delta, axis=1)
    size_mm = np.linalg.norm(scene.samples.uncorrected, axis=1)
    assert size.max() <= size_mm.max() + 1e-5
    assert np.median(size) > 0.002
    base = page.array(layer["base"]) + np.array(page.manifest["origin_mm"])
    points = np.loadtxt(path, delimiter=",", skiprows=2)[:, :3]
    np.testing.assert_allclose(base + delta, points, atol=0.6e-4)


def test_the_second_time_round_is_not_the_first(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    path = written(tmp_path, olp.simulate(TEXT.encode(), machine, step_mm=3.0).to_csv())
    scene = olp.view(TEXT.encode(), machine, measured=[path], time=False).scene
    lines = np.loadtxt(path, delimiter=",", skiprows=2)[:, 3]
    own_lines = scene.nominal.toolpath.line[scene.samples.move[scene.measured[0].index]]
    assert (own_lines == lines).all()
    assert np.abs(scene.measured[0].delta_mm).max() < 1e-6 + CHORD_MM


def test_parts_may_be_left_out(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    points = np.loadtxt(
        olp.simulate(TEXT.encode(), machine, step_mm=1.0).to_csv().decode().splitlines()[2:], delimiter=","
    )
    some = points[(points[:, 3] == 5) | (points[:, 3] >= 12)][:, :3] + [0.0, 0.0, 0.01]
    path = written(tmp_path, csv(some))
    scene = olp.view(TEXT.encode(), machine, measured=[path], time=False).scene
    np.testing.assert_allclose(
        scene.measured[0].delta_mm, np.tile([0.0, 0.0, 0.01], (len(some), 1)), atol=1e-6 + CHORD_MM
    )


def test_a_point_far_from_the_path_is_refused_with_its_line(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    path = written(
        tmp_path, csv(np.array([[0.0, 0.0, 20.0], [50.0, 0.0, 20.0], [50.0, 4.0, 20.0], [60.0, 0.0, 20.0]]))
    )
    with pytest.raises(InputError) as caught:
        olp.view(TEXT.encode(), machine, measured=[path], time=False)
    assert str(caught.value).startswith(f"{path}:5: the point is 4 mm from the path")


def test_points_against_the_order_are_shown_in_its_order(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    points = np.array([[80.0, 60.0, 20.0], [100.0, 79.0, 20.0], [100.0, 40.0, 20.0], [100.0, 1.0, 20.0]])
    path = written(tmp_path, csv(points + np.array((0.0, 0.0, 0.01))))
    program = b"G21 G90 G54\nG43 H1\nG0 X100 Y0 Z20\nG1 Y80 F600\nX60 Y40\nM2\n"
    scene = olp.view(program, machine, measured=[path], time=False).scene
    matched = scene.measured[0]
    np.testing.assert_allclose(matched.base_mm, points[::-1], atol=1e-6)
    assert (np.diff(matched.index) > 0).all()
    assert "OLP606" in [f["code"] for f in scene.report["findings"]]


@pytest.mark.slow
def test_the_page_pairs_as_compare_does_and_says_what_that_found(tmp_path: Path) -> None:
    machine = random_machine(tmp_path / "m", 3, Recipe())
    program = written(tmp_path, TEXT, "part.ngc")
    rows = olp.simulate(program, machine, step_mm=1.0).points_mm.copy()
    rows[200] += (0.0, 0.0, 3.0)
    turned = rows @ np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))) + np.array(
        (500.0, 9.0, 0.0)
    )
    for points, codes in ((rows, {"OLP602"}), (turned, {"OLP602", "OLP611"})):
        path = written(tmp_path, csv(points))
        review = olp.view(program, machine, measured=[path], time=False)
        compared = olp.compare(program, [path], machine)
        run = compared.runs[0]
        matched = review.scene.measured[0]
        delta_mm = (run.points_mm - run.nominal_mm)[run.good]
        np.testing.assert_allclose(matched.delta_mm, delta_mm, atol=1e-9)
        assert len(matched.index) == len(points) - 1
        shown = {f["code"] for f in Page(review.html()).manifest["findings"]}
        assert codes <= shown
        assert {f.code for f in compared.findings} <= shown
        assert {f.code for f in compared.findings} <= codes | {"OLP603", "OLP604"}


def test_frames_are_told_apart(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    offsets = np.array([[250.0, 200.0, -300.0], [420.0, 310.0, -280.0]])
    points = np.array([[0.0, 0.0, 20.0], [100.0, 0.0, 20.0]])
    for frame, shift in (("G54", 0 * offsets[0]), ("machine", offsets[0]), ("G55", offsets[0] - offsets[1])):
        path = written(tmp_path, csv(points + shift, frame))
        scene = olp.view(TEXT.encode(), machine, measured=[path], time=False).scene
        assert np.abs(scene.measured[0].delta_mm).max() < 1e-6
    with pytest.raises(ConfigError, match="'G59' is not an unrotated work offset"):
        olp.view(TEXT.encode(), machine, measured=[written(tmp_path, csv(points, "G59"))], time=False)


@pytest.mark.slow
def test_frames_lie_where_they_were_touched_off(tmp_path: Path) -> None:
    """Several offsets, touched off on the uncompensated machine: the same run stated in the first, in the
    other, and in the machine's own axes."""
    program, machine = NASTY / "work-offsets.ngc", NASTY / "machine.toml"
    run = olp.simulate(program, machine, step_mm=1.0)
    zero = {}
    setup = olp.load_setup(machine)
    for name in ("G54", "G55"):
        offset = np.array(setup.work_offset(name).offset_mm)  # type: ignore[union-attr]
        origin_mm = offset + np.array((0.0, 0.0, setup.tool(1).length_mm[2]))  # type: ignore[union-attr]
        zero[name] = offset + np.array(olp.error_at(machine, tuple(origin_mm), 1)["error_um"]) * 1e-3
    assert np.abs(np.subtract(zero["G54"], zero["G55"]) - (-120.0, -30.0, 0.0)).max() > 1e-4
    first, *others = (
        olp.view(program, machine, measured=[written(tmp_path, csv(points, frame))], time=False).scene
        for frame, points in (
            ("G54", run.points_mm),
            ("G55", run.points_mm + zero["G54"] - zero["G55"]),
            ("machine", run.points_mm + zero["G54"]),
        )
    )
    for other in others:
        np.testing.assert_allclose(other.measured[0].delta_mm, first.measured[0].delta_mm, atol=2e-6)
        np.testing.assert_allclose(other.measured[0].base_mm, first.measured[0].base_mm, atol=2e-6)
    # the places are those that the page shows
    near = first.position_mm[first.measured[0].index] - first.measured[0].base_mm
    assert np.linalg.norm(near, axis=1).max() < 0.5
    size = np.linalg.norm(first.measured[0].delta_mm, axis=1).max()
    assert size <= np.linalg.norm(first.samples.uncorrected, axis=1).max() + 1e-5


@pytest.mark.slow
def test_several_measurements_are_layers_each(tmp_path: Path) -> None:
    machine = random_machine(tmp_path / "m", 3, Recipe())
    path = written(tmp_path, olp.simulate(TEXT.encode(), machine, step_mm=5.0).to_csv())
    other = written(tmp_path, path.read_bytes(), "second.csv")
    page = Page(olp.view(TEXT.encode(), machine, measured=[path, other], time=False).html())
    names = [layer["name"] for layer in page.manifest["layers"]]
    assert names == ["nominal", "uncorrected", "command", "corrected", "measured-1", "measured-2"]
    assert {"measured-1", "measured-2"} <= set(page.manifest["metrics"][0]["by_layer"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# frame=G54\n", ": does not show which columns"),
        ("# frame=G54\nX_mm,Y_mm,Z_mm\n", ": holds no points"),
        ("# frame=G54\nX_mm,Y_mm\n1,2\n", ": does not show which columns"),
        ("# frame=G54\nX_mm,Y_mm,Z_mm\n1,2,3\n1,2\n", ":4: 2 columns; expected at least 3"),
        ("# frame=G54\nX_mm,Y_mm,Z_mm\n1,2,3\n\n1,2,x\n", ':5: column 3 is "x"; expected a number'),
        ("# frame=G54\nX_mm,Y_mm,Z_mm\n1,2,nan\n", ":3: a number is not finite"),
        ("# frame=G54\n# frame=G55\nX_mm,Y_mm,Z_mm\n1,2,3\n", ":2: the frame is G55 here and G54 before"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(text: str, message: str, tmp_path: Path) -> None:
    machine, path = zero_machine(tmp_path / "m"), written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        olp.view(TEXT.encode(), machine, measured=[path], time=False)
    assert str(caught.value).startswith(f"{path}{message}")


def test_columns_may_come_in_any_order() -> None:
    points = parse_points(
        b"\xef\xbb\xbf# a tracker\r\n#frame = G54\r\nt_s,Z_mm,Y_mm,X_mm\r\n0,3,2,1\r\n1,6,5,4\r\n", "m.csv"
    )
    assert points.frame == "G54"
    assert points.points_mm.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert points.time_s is not None and points.time_s.tolist() == [0, 1]


@pytest.mark.slow
def test_noise_finds_the_same_places(tmp_path: Path) -> None:
    """A spiral of close turns, measured with noise, at random places along it."""
    rng = np.random.default_rng(2)
    turn = np.linspace(0.0, 40 * np.pi, 8000)
    spiral = np.stack((3 / np.pi * turn * np.cos(turn), 3 / np.pi * turn * np.sin(turn), 0 * turn), axis=1)
    lines = [f"G1 X{x:.6f} Y{y:.6f} F600" for x, y, _ in spiral.tolist()]
    program = "\n".join(["G21 G90 G54", "G43 H1", "G0 X0 Y0 Z0", *lines, "M2", ""]).encode()
    chosen = np.sort(rng.choice(len(spiral), 4000, replace=False))
    noise = rng.normal(0.0, 0.01, (len(chosen), 3))
    path = written(tmp_path, csv(spiral[chosen] + noise))
    scene = olp.view(program, zero_machine(tmp_path / "m"), measured=[path], time=False, step_mm=50.0).scene
    matched = scene.measured[0]
    line = scene.nominal.toolpath.line[scene.samples.move[matched.index]]
    assert np.abs(line - (chosen + 4)).max() <= 2
    # the nearest place is no farther than where the point was taken
    assert (np.linalg.norm(matched.delta_mm, axis=1) <= np.linalg.norm(noise, axis=1) + 1e-5).mean() > 0.98
    assert np.linalg.norm(matched.delta_mm, axis=1).max() <= 2 * np.linalg.norm(noise, axis=1).max()
