"""The pictures of a review in a visualizer of meshcat's: what is put where, in which colours, how framed."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judge import visualizer as judge
from judge.machines import random_machine, shift_machine

import olp
from olp.core.errors import UsageError
from olp.core.toolpath import Kind
from olp.review import palette
from olp.review.job import Review
from olp.review.notebook import drawing, framing, keys, legend, pictures
from olp.review.notebook.framing import View

# meshcat brings IPython, which warns of what it uses itself
pytestmark = pytest.mark.filterwarnings("ignore")

TEXT = b"G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nT2 M6\nG43 H2\nG0 X0 Y50 Z20\nG1 X100\nM2\n"
WAVY = (
    b"G21 G90 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z20\nG1 Z0 F900\nG1 X300\nG2 X400 Y100 I0 J100\nG1 Y200 Z-30\nM2\n"
)
MEASURED = "# frame=G54\nX_mm,Y_mm,Z_mm\n0,0,20.01\n50,0,20.02\n100,0,20.01\n0,50,20.01\n100,50,20.01\n"
PREDICTED = ("uncorrected", "corrected")


@pytest.fixture(scope="module")
def shifted(tmp_path_factory: pytest.TempPathFactory) -> Review:
    """Two paths with a tool change between them, off by a known amount, and a measured run."""
    folder = tmp_path_factory.mktemp("shifted")
    machine = shift_machine(folder / "m", (30.0, -20.0, 10.0))
    run = folder / "run.csv"
    run.write_text(MEASURED)
    return olp.view(TEXT, machine, measured=[run], part_tolerance_um=15.0, time=False)


@pytest.fixture(scope="module")
def wavy(tmp_path_factory: pytest.TempPathFactory) -> Review:
    return olp.view(WAVY, random_machine(tmp_path_factory.mktemp("wavy") / "m", 3))


def added(review: Review, **options: Any) -> tuple[olp.Layers, judge.Window]:
    visualizer, window = judge.visualizer()
    return olp.add_layers(visualizer, review, **options), window


@pytest.fixture(scope="module")
def enlarged(shifted: Review) -> tuple[olp.Layers, judge.Window]:
    return added(shifted, exaggeration=1000.0)


@pytest.fixture(scope="module")
def shown(wavy: Review) -> tuple[olp.Layers, judge.Window]:
    return added(wavy)


def pairs(window: judge.Window, node: str) -> np.ndarray:
    """(m, 2, 3) the ends of the segments of a node, in mm."""
    return judge.attribute(window.objects[f"/meshcat/olp/{node}"], "position").reshape(-1, 2, 3)


def colours(window: judge.Window, node: str) -> list[str]:
    """The colour of each segment of a node; both of its ends have it."""
    ends = judge.attribute(window.objects[f"/meshcat/olp/{node}"], "color").reshape(-1, 2, 3)
    assert (ends[:, 0] == ends[:, 1]).all()
    return judge.hexadecimal(ends[:, 0])


def feed_ends(review: Review) -> np.ndarray:
    """(m, 2) the samples at both ends of each segment of a feed move, one by one."""
    samples, kind = review.scene.samples, review.scene.nominal.toolpath.kind
    rows = [k for k in range(len(samples)) if samples.joined[k] and kind[samples.move[k]] != Kind.RAPID]
    return np.array([[k - 1, k] for k in rows])


# -- where things are --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", PREDICTED)
def test_a_picture_is_the_nominal_path_plus_its_deviations_enlarged(
    shown: tuple[olp.Layers, judge.Window], wavy: Review, name: str
) -> None:
    layers, window = shown
    ends = feed_ends(wavy)
    factor = layers.legends[name].exaggeration
    delta = getattr(wavy.scene.samples, name)
    np.testing.assert_allclose(pairs(window, "nominal"), wavy.scene.position_mm[ends], atol=1e-4)
    there = wavy.scene.position_mm + factor * delta
    np.testing.assert_allclose(pairs(window, f"{name}/path"), there[ends], atol=1e-3)


@pytest.mark.slow
def test_known_errors_are_drawn_as_large_as_they_are_enlarged(
    enlarged: tuple[olp.Layers, judge.Window],
) -> None:
    _, window = enlarged
    nominal = pairs(window, "nominal")
    away = pairs(window, "uncorrected/path") - nominal
    np.testing.assert_allclose(away, np.broadcast_to([30.0, -20.0, 10.0], away.shape), atol=1e-4)
    np.testing.assert_allclose(pairs(window, "corrected/path"), nominal, atol=1e-4)
    np.testing.assert_allclose(pairs(window, "command"), nominal - away, atol=1e-4)


@pytest.mark.parametrize("name", PREDICTED)
def test_whiskers_lead_from_the_nominal_path_to_the_enlarged_one_at_equal_distances(
    shown: tuple[olp.Layers, judge.Window], wavy: Review, name: str
) -> None:
    layers, window = shown
    scene, whiskers = wavy.scene, pairs(window, f"{name}/whiskers")
    away = np.linalg.norm(scene.position_mm[:, None] - whiskers[None, :, 0], axis=2)
    rows = away.argmin(axis=0)
    assert away.min(axis=0).max() < 1e-4
    factor = layers.legends[name].exaggeration
    delta = getattr(scene.samples, name)[rows]
    np.testing.assert_allclose(whiskers[:, 1] - whiskers[:, 0], factor * delta, atol=1e-3)
    step = np.diff(scene.samples.arc_mm[rows])
    between = np.diff(scene.samples.arc_mm).max()
    wanted = 0.01 * View.of(scene).job_mm
    assert len(rows) > 50
    assert np.abs(step - wanted).max() <= between + 1e-9


def test_the_measured_run_is_a_picture_from_its_nominal_points(
    enlarged: tuple[olp.Layers, judge.Window],
) -> None:
    layers, window = enlarged
    both = pairs(window, "measured/whiskers")
    np.testing.assert_allclose(both[:, 0, 2], 20.0, atol=1e-3)
    np.testing.assert_allclose(both[:, 1, 2] - both[:, 0, 2], [10.0, 20.0, 10.0, 10.0, 10.0], atol=1e-2)
    assert layers.legends["measured"].tolerance_um == 15.0
    assert len(pairs(window, "measured/path")) == 3


def test_rapids_are_in_no_picture(tmp_path: Path) -> None:
    text = b"G21 G90 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z20\nG1 X50 F900\nG0 X90\nG1 X100\nM2\n"
    scene = olp.view(text, shift_machine(tmp_path / "m", (30.0, 0.0, 0.0)), time=False).scene
    for picture in pictures.pictures_of(scene, 100.0, 1.0):
        x = scene.position_mm[picture.path(1000)[0], 0]
        assert np.abs(x[:, 1] - x[:, 0]).sum() == pytest.approx(60.0)
        assert not ((x > 50.0) & (x < 90.0)).any()


def test_no_measured_line_crosses_a_rapid_that_was_not_measured(shifted: Review) -> None:
    run = shifted.scene.measured[0]
    every = dataclasses.replace(run, counted=np.ones(len(run.counted), bool))
    scene = dataclasses.replace(shifted.scene, measured=(every,))
    *_, picture = pictures.pictures_of(scene, 100.0, 1.0)
    assert picture.path(1000)[0].tolist() == [[0, 1], [1, 2], [3, 4]]


@pytest.mark.parametrize("most", [200_000, 50])
def test_no_line_crosses_a_gap(shifted: Review, most: int) -> None:
    """After the tool change a new path begins, also where samples are left out."""
    scene = shifted.scene
    picture = next(pictures.pictures_of(scene, 100.0, 0.0))
    ends, _ = picture.path(most)
    both = scene.position_mm[ends]
    assert np.abs(both[:, 0, 1] - both[:, 1, 1]).max() < 1e-9
    assert np.linalg.norm(both[:, 1] - both[:, 0], axis=1).sum() == pytest.approx(200.0, abs=1e-6)
    assert len(ends) <= most + 10
    dots, _ = picture.dots(100.0, most)
    assert len(dots) <= most + 10


def test_dots_lie_on_the_enlarged_path_about_a_pixel_apart(wavy: Review) -> None:
    scene = wavy.scene
    picture = next(pictures.pictures_of(scene, 400.0, 500.0))
    dots, band = picture.dots(400.0, 200_000)
    apart = np.linalg.norm(np.diff(dots, axis=0), axis=1)
    assert apart.max() <= 0.6 + 1e-9 and len(band) == len(dots)
    ends, _ = picture.path(200_000)
    a, b = (picture.enlarged_mm[ends[:, i]] for i in (0, 1))
    # the start of a cut is a point twice
    long = np.linalg.norm(b - a, axis=1) > 0.0
    a, b = a[long], b[long]
    off = [np.linalg.norm(np.cross(b - a, d - a), axis=1) / np.linalg.norm(b - a, axis=1) for d in dots[::50]]
    assert max(o.min() for o in off) < 1e-9


def test_a_probed_point_that_no_line_leads_to_is_a_dot_with_a_whisker(shifted: Review) -> None:
    *_, run = pictures.pictures_of(shifted.scene, 100.0, 1000.0)
    alone = dataclasses.replace(run, drawn=np.zeros(len(run.drawn), bool))
    dots, band = alone.dots(100.0, 1000)
    np.testing.assert_allclose(dots, alone.enlarged_mm)
    assert band.tolist() == alone.bands(alone.size_um).tolist()
    assert len(alone.whiskers(100.0, 1000)) == len(dots)
    assert len(alone.whiskers(100.0, 3)) == 3


# -- colours -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PREDICTED)
def test_each_segment_has_the_colour_of_the_band_of_its_larger_end(
    shown: tuple[olp.Layers, judge.Window], wavy: Review, name: str
) -> None:
    _, window = shown
    ends = feed_ends(wavy)
    size = 1000.0 * np.linalg.norm(getattr(wavy.scene.samples, name), axis=1)
    allowed = 1000.0 * wavy.scene.table.allowed_mm
    edges = palette.bands(float(size[ends].max()), allowed)
    wanted = palette.colours(edges, allowed, "light")
    larger = size[ends].max(axis=1)
    expected = [next(c for c, top in zip(wanted, edges[1:], strict=True) if v <= top) for v in larger]
    assert colours(window, f"{name}/path") == expected
    assert len(set(expected)) > 1


def test_a_thinned_path_keeps_the_colour_of_its_largest_deviation() -> None:
    size = np.array([1.0, 1.0, 9.0, 1.0, 1.0, 1.0])
    delta = np.zeros((6, 3))
    delta[:, 0] = 1e-3 * size
    base = np.arange(18.0).reshape(6, 3)
    one = pictures.Picture(
        "p", "P", base, delta, np.arange(6) > 0, np.ones(6, bool), np.arange(6.0), "allowed", 2.0, 1.0
    )
    ends, band = one.path(2)
    assert ends.tolist() == [[0, 3], [3, 5]]
    assert band.tolist() == one.bands(np.array([9.0, 1.0])).tolist()


@pytest.mark.parametrize("tolerance", [None, 2.0])
def test_an_edge_belongs_to_the_band_below_it(tolerance: float | None) -> None:
    delta = np.zeros((3, 3))
    delta[:, 2] = 0.0, 2e-3, 7e-3
    shown = np.ones(3, bool)
    one = pictures.Picture(
        "p", "P", delta, delta, np.arange(3) > 0, shown, np.arange(3.0), "allowed", tolerance, 1.0
    )
    edges = one.edges_um
    assert one.bands(np.array(edges[1:])).tolist() == list(range(len(edges) - 1))
    assert one.bands(np.array([0.0])).tolist() == [0]
    assert one.bands(np.array(edges[1:-1]) + 1e-6).tolist() == list(range(1, len(edges) - 1))


@pytest.mark.parametrize("name", [*PREDICTED, "measured"])
def test_the_legend_has_the_bands_of_the_palette_and_what_the_report_says(shifted: Review, name: str) -> None:
    scene = shifted.scene
    own = next(
        legend.Legend.of(one, scene) for one in pictures.pictures_of(scene, 100.0, None) if one.name == name
    )
    runs = scene.table.measured
    assert runs is not None
    tolerance = runs.tolerance_um if name == "measured" else 1000.0 * scene.table.allowed_mm
    delta = scene.measured[0].delta_mm if name == "measured" else getattr(scene.samples, name)
    feed = np.unique(feed_ends(shifted)) if name != "measured" else np.arange(len(delta))
    edges = palette.bands(1000.0 * float(np.linalg.norm(delta[feed], axis=1).max()), tolerance)
    assert [(b.low_um, b.high_um) for b in own.bands] == list(itertools.pairwise(edges))
    assert [b.colour for b in own.bands] == palette.colours(edges, tolerance, "light")
    assert [b.high for b in own.bands] == [top / tolerance for top in edges[1:]]
    assert own.verdict == " ".join(scene.report["verdict"]["sentences"]).replace(" um", " µm")
    assert "µm" in own.verdict
    assert own.ok is scene.report["verdict"]["ok"]
    text = own._repr_html_()
    assert all(f"background:{b.colour}" in text and b.text in text for b in own.bands)
    assert own.worst in text and own.verdict in text and own.enlarged in text


def test_without_a_tolerance_the_legend_says_so() -> None:
    own = legend.Legend(
        "measured", "Measured: <b>", 2000.0, "part tolerance", None,
        (legend.Band("#123456", 0.0, 5.0, None, None),), "", "", None,
    )  # fmt: skip
    text = own._repr_html_()
    assert "no tolerance is stated" in text and "tolerances" not in text
    assert "&lt;b&gt;" in text and "deviations × 2,000" in text


def test_the_worst_place_is_flagged_where_the_table_says(
    enlarged: tuple[olp.Layers, judge.Window],
) -> None:
    layers, window = enlarged
    for name in ("uncorrected", "measured"):
        place = window.transforms[f"/meshcat/olp/{name}/worst"][:3, 3]
        line = pairs(window, f"{name}/whiskers" if name == "measured" else f"{name}/path")[:, 1]
        assert np.linalg.norm(line - place, axis=1).min() < 1e-3
    assert "37.42 µm, line 4" in layers.legends["uncorrected"].worst
    assert "20.00 µm, line 4" in layers.legends["measured"].worst
    # the measured point with the largest deviation
    place = window.transforms["/meshcat/olp/measured/worst"][:3, 3]
    np.testing.assert_allclose(place, [50.0, 0.0, 40.0], atol=1e-2)


# -- enlargement and pictures ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("largest_mm", "job_mm", "factor"),
    [
        (0.030, 1000.0, 1000.0), (0.031, 1000.0, 500.0), (0.030, 100.0, 100.0), (0.012, 1000.0, 2000.0),
        (1e-9, 1000.0, 1e5), (0.0, 1000.0, 1.0), (50.0, 100.0, 1.0), (0.04, 20.0, 10.0),
    ],
)  # fmt: skip
def test_the_factor_is_round_and_makes_the_largest_deviation_three_per_cent(
    largest_mm: float, job_mm: float, factor: float
) -> None:
    assert pictures.factor_of(largest_mm, job_mm) == factor


def test_each_picture_has_a_factor_of_its_own_unless_one_is_given(
    shown: tuple[olp.Layers, judge.Window], wavy: Review
) -> None:
    own = {name: one.exaggeration for name, one in shown[0].legends.items()}
    assert own["corrected"] > own["uncorrected"] >= 1.0
    assert {one.exaggeration for one in pictures.pictures_of(wavy.scene, 400.0, 7.0)} == {7.0}


@pytest.mark.parametrize("wrong", [-1.0, float("nan"), float("inf"), "auto"])
def test_an_exaggeration_that_cannot_be(shifted: Review, wrong: Any) -> None:
    with pytest.raises(UsageError, match="expected a number of 0 or above"):
        added(shifted, exaggeration=wrong)


def test_a_picture_that_is_not_there_is_refused_with_those_that_are(
    wavy: Review, enlarged: tuple[olp.Layers, judge.Window]
) -> None:
    with pytest.raises(UsageError, match=r"'measured'; expected one of uncorrected, corrected$"):
        added(wavy, picture="measured")
    layers, _ = enlarged
    with pytest.raises(UsageError, match=r"expected one of uncorrected, corrected, measured$"):
        layers.show("command")


@pytest.mark.slow
def test_one_picture_is_shown_at_a_time_and_the_command_is_there_unseen(shifted: Review) -> None:
    layers, window = added(shifted, picture="measured")

    def seen() -> dict[str, bool]:
        names = (*PREDICTED, "measured")
        return {name: window.properties[f"/meshcat/olp/{name}"]["visible"] for name in names}

    assert seen() == {"uncorrected": False, "corrected": False, "measured": True}
    assert "Measured: run.csv" in layers._repr_html_()
    layers.show("uncorrected")
    assert seen() == {"uncorrected": True, "corrected": False, "measured": False}
    assert layers.shown == "uncorrected" and "Uncorrected" in layers._repr_html_()
    assert window.properties["/meshcat/olp/command"]["visible"] is False


@pytest.mark.slow
def test_a_second_review_takes_the_place_of_the_first(shifted: Review, wavy: Review) -> None:
    visualizer, window = judge.visualizer()
    olp.add_layers(visualizer, shifted, under="job")
    assert "measured/path" in window.under("/meshcat/job")
    olp.add_layers(visualizer, wavy, under="job")
    assert not any(name.startswith("measured") for name in window.under("/meshcat/job"))
    bodies = {name.rpartition("/")[2] for name in window.under("/meshcat/job")}
    assert {body.name for body in wavy.scene.bodies} <= bodies


# -- the camera --------------------------------------------------------------------------------------------


def test_the_direction_is_that_of_the_page() -> None:
    text = (Path(__file__).resolve().parents[2] / "viewer" / "static" / "camera.js").read_text("utf-8")
    assert "iso: [-1, -1.5, 1.05]" in text
    np.testing.assert_allclose(framing.TOWARD * np.linalg.norm([-1, -1.5, 1.05]), [-1, -1.5, 1.05])


def corners(box: np.ndarray) -> np.ndarray:
    return np.array([[x, y, z] for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]])


@pytest.mark.parametrize("aspect", [4 / 3, 16 / 9, 9 / 4])
@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((0, 0, -2), (20, 8, 3)), ((0, 0, -900), (10_000, 4000, 100)), ((-300, 50, 7), (300, 450, 7)),
        ((5, 5, -80), (5, 5, 0)), ((0, 0, 0), (0, 4000, 0)), ((0, 0, 0), (900, 0, 0)), ((3, 4, 5), (3, 4, 5)),
    ],
)  # fmt: skip
def test_the_job_fills_the_view_beside_the_legend(
    wavy: Review, low: tuple[float, ...], high: tuple[float, ...], aspect: float
) -> None:
    """Small, large, flat, straight and a single point: none is a speck, none is cut off."""
    box = np.array([low, high], float)
    share = np.linspace(0.0, 1.0, len(wavy.scene.samples))[:, None]
    position = box[0] + share * (box[1] - box[0])
    view = View.of(dataclasses.replace(wavy.scene, position_mm=position, bodies=()))
    matrix, camera = view.matrix, drawing.camera(view).lower()
    at = judge.windowed(camera, corners(box) @ matrix[:3, :3].T + matrix[:3, 3], aspect)
    beside = 2.0 * framing.LEGEND[1] / aspect
    assert (at[:, 0] > beside).all() and (np.abs(at) < 1.0).all()
    # in units of half the window's height
    room = 2.0 * np.array([framing.ROOM[0], framing.ROOM[1]])
    used = np.ptp(at * [aspect, 1.0], axis=0) / 2.0 / room
    if np.ptp(box, axis=0).any():
        assert used.max() > 0.7
    middle = judge.windowed(camera, np.zeros((1, 3)), aspect)[0]
    np.testing.assert_allclose(middle, [2.0 * framing.SHIFT / aspect, 0.0], atol=1e-9)


def test_lights_and_planes_are_those_of_a_metre_whatever_the_size(wavy: Review) -> None:
    for size in (0.05, 1.0, 25.0):
        scene = dataclasses.replace(wavy.scene, position_mm=size * wavy.scene.position_mm)
        view = View.of(scene)
        assert view.job_mm * view.matrix[0, 0] == pytest.approx(1.0)
        data = drawing.camera(view).lower()["object"]
        assert 0.01 < data["near"] < 0.2 and data["far"] > 3.0


def test_where_the_view_says_a_point_is_the_projection_puts_it(
    shown: tuple[olp.Layers, judge.Window], wavy: Review
) -> None:
    view = View.of(wavy.scene)
    _, window = shown
    np.testing.assert_allclose(window.transforms["/meshcat/olp"], view.matrix)
    points = wavy.scene.position_mm[::40]
    scaled = points @ view.matrix[:3, :3].T + view.matrix[:3, 3]
    camera = window.objects["/Cameras/default/rotated"]
    at = judge.windowed(camera, scaled, 1.0) / 2.0
    np.testing.assert_allclose([view.window(p) for p in points], at, atol=1e-9)


def test_the_grid_and_the_axes_of_meshcat_are_hidden(shown: tuple[olp.Layers, judge.Window]) -> None:
    _, window = shown
    assert window.properties["/Grid"]["visible"] is False
    assert window.properties["/Axes"]["visible"] is False


def test_images_keep_their_size_in_the_window_and_their_place_beside_the_job(
    shown: tuple[olp.Layers, judge.Window], wavy: Review
) -> None:
    """The middle of the legend's image is where the camera turns."""
    view = View.of(wavy.scene)
    _, window = shown
    for name in PREDICTED:
        matrix = window.transforms[f"/meshcat/olp/{name}/legend"]
        np.testing.assert_allclose(matrix[:3, 3], view.middle_mm)
        width = matrix[0, 0] * view.unit / (2.0 * np.tan(np.radians(15.0)))
        assert width / 2.0 == pytest.approx(framing.SHIFT - framing.LEGEND[0])
        shape = window.objects[f"/meshcat/olp/{name}/legend"]
        assert shape["object"]["type"] == "Sprite"
        assert shape["materials"][0]["sizeAttenuation"] is False
        assert shape["materials"][0]["depthTest"] is False


# -- the motion --------------------------------------------------------------------------------------------


def played(window: judge.Window, path: str, name: str, times: np.ndarray) -> np.ndarray:
    """Values of a track at times, straight between its keys; a frame is a second."""
    clip = next(a["clip"] for a in window.animation["animations"] if a["path"] == path)
    assert clip["fps"] == 1
    keys_of = next(track["keys"] for track in clip["tracks"] if track["name"] == name)
    at = [key["time"] for key in keys_of]
    assert (np.diff(at) >= 0.0).all()
    values = np.array([key["value"] for key in keys_of], float).reshape(len(keys_of), -1)
    return np.stack([np.interp(times, at, values[:, i]) for i in range(values.shape[1])], axis=1)


def test_the_animation_has_the_tip_and_the_machine_where_they_are_at_each_time(
    shown: tuple[olp.Layers, judge.Window], wavy: Review
) -> None:
    _, window = shown
    scene = wavy.scene
    half_a_pixel = 0.0005 * View.of(scene).job_mm
    tip = played(window, "/meshcat/olp/tool", ".position", scene.time_s)
    assert np.linalg.norm(tip - scene.position_mm, axis=1).max() <= half_a_pixel * 1.001
    order = scene.nodes[-1].path[1:]
    for k, axis in enumerate(order):
        i = "XYZ".index(axis)
        path = "/meshcat/olp/machine/" + "/".join(order[: k + 1])
        moved = played(window, path, ".position", scene.time_s)[:, i]
        wanted = scene.samples.axis_mm[:, i] - scene.samples.axis_mm[0, i]
        assert np.abs(moved - wanted).max() <= half_a_pixel * 1.001
    assert window.animation["options"]["play"] is False
    assert window.properties["/meshcat/olp/tool"]["position"] == scene.position_mm[0].tolist()


@pytest.mark.slow
def test_the_motion_starts_at_once_where_asked(wavy: Review) -> None:
    _, window = added(wavy, play=True)
    assert window.animation["options"] == {"play": True, "repetitions": 1}


def test_key_frames_are_few_and_close_enough() -> None:
    time = np.linspace(0.0, 10.0, 20_001)
    value = np.stack((np.cos(time), np.sin(time), np.zeros_like(time)), axis=1)
    kept = keys.key_frames(time, value, 1e-3)
    line = np.stack([np.interp(time, time[kept], value[kept, i]) for i in range(3)], axis=1)
    assert np.linalg.norm(line - value, axis=1).max() <= 1e-3
    # a chord of an arc of radius 1 is off by t²/8
    assert 10.0 / np.sqrt(8e-3) <= len(kept) <= 4 * 10.0 / np.sqrt(8e-3)
    assert keys.key_frames(time, time[:, None], 1e-9).tolist() == [0, 20_000]


def test_key_frames_keep_a_rest_a_peak_and_their_number() -> None:
    time = np.array([0.0, 1.0, 3.0, 3.0, 4.0, 4.5, 5.0])
    value = np.array([0.0, 1.0, 1.0, 1.0, 2.0, 9.0, 3.0])[:, None]
    kept = keys.key_frames(time, value, 1e-6)
    np.testing.assert_allclose(np.interp(time, time[kept], value[kept, 0]), value[:, 0])
    noise = np.random.default_rng(0).normal(size=(5000, 3))
    assert len(keys.key_frames(np.arange(5000.0), noise, 1e-6, most=300)) == 300
