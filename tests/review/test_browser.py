"""The review page in a real browser: what is shown is what was packed, and its views follow one another."""

from __future__ import annotations

import re
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from judge import browser

import olp
from olp.review.job import Review, view
from olp.review.live import Server
from olp.review.pack import Arrays
from olp.review.page import page as packed

pytestmark = pytest.mark.slow
PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
GANTRY = PROGRAMS / "gantry-plate" / "machine.toml"
#: CRLF, blank lines, comments, and arcs that become several blocks
PROGRAM = """\
%
(first)

G21 G17 G90 G64 P0.01
G54
T1 M6
G43 H1
G0 X10 Y10 Z20
(down)
G1 Z-2 F600

G1 X400 Y10 F1800
G3 X450 Y60 I0 J50
G1 X450 Y300

G2 X400 Y350 I-50 J0
(back)
G1 X10
G1 Y10
G0 Z20
M2
%""".replace("\n", "\r\n").encode()


@pytest.fixture(autouse=True)
def needs_a_browser() -> None:
    browser.require()


@pytest.fixture(scope="module")
def play() -> Iterator[Any]:
    browser.require()
    with browser.driver() as driver:
        yield driver


@pytest.fixture(scope="module")
def chromium(play: Any) -> Iterator[Any]:
    with browser.launched(play, *browser.SOFTWARE_GL) as launched:
        yield launched


@pytest.fixture(scope="module")
def review() -> Review:
    return view(PROGRAM, GANTRY)


@pytest.fixture(scope="module")
def file(review: Review, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "review.html"
    review.write(path)
    return path


@pytest.fixture
def page(chromium: Any, file: Path) -> Iterator[Any]:
    with browser.opened(chromium, file) as opened:
        yield opened


def array(page: Any, name: str, columns: int = 1) -> np.ndarray:
    values = np.array(page.evaluate("name => Array.from(olp.arrays.get(name))", name), float)
    return values.reshape(-1, columns) if columns > 1 else values


def colourful(picture: np.ndarray) -> int:
    """How many pixels are far from grey."""
    return int((picture.max(axis=2) - picture.min(axis=2) > 70).sum())


def still(page: Any) -> None:
    """Waits until the picture has caught up with the page."""
    page.evaluate("() => { olp.app.scene.refill(); olp.app.scene.viewer.render(); }")


def middle_of_moves(review: Review) -> list[int]:
    """A sample inside each feed move."""
    samples = review.scene.samples
    kind = review.scene.nominal.toolpath.kind[samples.move]
    moves = np.unique(samples.move[kind != 0])
    return [int(np.median(np.flatnonzero(samples.move == move))) for move in moves]


# -- what is packed is what is there -----------------------------------------------------------------------


def test_positions_deviations_and_times_unpack_to_what_was_packed(page: Any, review: Review) -> None:
    scene = review.scene
    origin = np.array(page.evaluate("olp.manifest.origin_mm"))
    for name, truth, step in (
        ("P", scene.position_mm - origin, 1e-4),
        ("d_uncorrected", scene.samples.uncorrected, 1e-6),
        ("d_command", scene.samples.correction, 1e-6),
        ("d_corrected", scene.samples.corrected, 1e-6),
        ("t", scene.time_s[:, None], 1e-6),
        ("s", scene.samples.arc_mm[:, None], 1e-3),
    ):
        unpacked = array(page, name, truth.shape[1]).reshape(truth.shape)
        # "corrected" is a sum of three roundings
        share = 1.5 if name == "d_corrected" else 0.5
        assert np.abs(unpacked - truth).max() <= share * step * (1 + 1e-6), name


def test_ten_metres_of_axis_lose_nothing(chromium: Any, tmp_path: Path) -> None:
    machine = GANTRY.read_text().replace("1600.0]", "12000.0]")
    for name in ("calibration.toml", "x.csv", "y.csv", "z.csv"):
        (tmp_path / name).write_bytes((GANTRY.parent / name).read_bytes())
    (tmp_path / "machine.toml").write_text(machine)
    program = (
        b"G21 G90 G54 G64 P0.01\nT1 M6\nG43 H1\nG0 X0 Y0 Z0\nG1 X10000.0001 F6000\nY0.1237\nX0.0007\nM2\n"
    )
    review = view(program, tmp_path / "machine.toml", outside_box="hold", time=False)
    review.write(tmp_path / "long.html")
    scene = review.scene
    with browser.opened(chromium, tmp_path / "long.html") as page:
        origin = np.array(page.evaluate("olp.manifest.origin_mm"))
        assert np.ptp(scene.position_mm[:, 0]) > 9999.9
        assert np.abs(array(page, "P", 3) + origin - scene.position_mm).max() <= 0.5e-4 * (1 + 1e-6)
        assert np.abs(array(page, "d_uncorrected", 3) - scene.samples.uncorrected).max() <= 0.5e-6 * (
            1 + 1e-6
        )


def lines_of(data: bytes) -> list[str]:
    return re.split("\r\n|\r|\n", data.decode())


def test_rows_have_the_line_numbers_and_the_texts_of_both_files(page: Any) -> None:
    rows = page.evaluate(
        "() => Array.from({length: olp.app.listing.n}, (_, k) => "
        "[0, 1].map(side => [olp.app.listing.number(k, side), olp.app.listing.text(k, side)]))"
    )
    for side, data in enumerate((PROGRAM, olp.correct(PROGRAM, GANTRY).data)):
        shown = [tuple(row[side]) for row in rows if row[side][0]]
        assert shown == list(enumerate(lines_of(data), start=1))
    inserted = [row for row in rows if not row[0][0]]
    assert inserted, "the arcs were to be split"


def test_unrolled_lines_are_called_as_in_the_file(chromium: Any, tmp_path: Path) -> None:
    loop = b"G21 G90 G64 P0.01\n#1 = 0\n#1 = 1\no1 while [#1 lt 4]\nG1 X[#1 * 10] Y5 Z5 F600\n#1 = [#1 + 1]\n"
    review = view(loop + b"o1 endwhile\nG53 G0 X20\nM2\n", GANTRY, flatten=True)
    review.write(tmp_path / "unrolled.html")
    with browser.opened(chromium, tmp_path / "unrolled.html") as page:
        rows = page.evaluate(
            "[...Array(olp.app.listing.n).keys()].map(r => [0, 1].map(s => olp.app.listing.number(r, s)))"
        )
        named = [str(a) for a, _ in rows if a]
        assert named == ["1", "5", "5", "5", "8", "9"]
        # the corrected program has lines of its own
        assert [b for _, b in rows if b] == list(range(1, 1 + sum(b != "" for _, b in rows)))
        page.fill("#find", "8")
        page.press("#find", "Enter")
        assert page.evaluate("olp.app.listing.text(olp.state.row, 0)") == "G53 G0 X20"
        page.evaluate("document.querySelectorAll('details').forEach(d => (d.open = true))")
        page.click("#findings .warning")
        assert page.evaluate("olp.app.listing.number(olp.state.row, 0)") in ("5", "8")


def test_each_move_is_tied_to_its_line_of_the_file(page: Any, review: Review) -> None:
    scene = review.scene
    line = scene.nominal.toolpath.line[scene.samples.move]
    rows = array(page, "line").astype(int)
    numbers = array(page, "row_nominal").astype(int)[rows]
    text = [re.sub(r"\s", "", t) for t in lines_of(PROGRAM)]
    assert {text[n - 1] for n in numbers} == {
        "G0X10Y10Z20", "G1Z-2F600", "G1X400Y10F1800", "G3X450Y60I0J50", "G1X450Y300", "G2X400Y350I-50J0",
        "G1X10", "G1Y10", "G0Z20",
    }  # fmt: skip
    assert np.array_equal(numbers, line)


# -- layers, exaggeration, colours ---------------------------------------------------------------------------


def test_layers_come_and_go(page: Any) -> None:
    still(page)
    before = colourful(browser.picture(page))
    assert before > 500
    drawn = page.evaluate("olp.drawn")
    assert drawn["nominal"] > 0 and drawn["corrected"] > 0 and drawn["command"] == 0
    for name in ("nominal", "uncorrected", "corrected", "rapids", "tool", "machine"):
        page.uncheck(f"#layer-{name}")
    page.evaluate("() => { olp.state.callouts = []; olp.app.overlay.draw(); }")
    still(page)
    assert not any(page.evaluate("olp.drawn").values())
    assert colourful(browser.picture(page)) < before / 2
    page.check("#layer-command")
    still(page)
    assert page.evaluate("olp.drawn.command") > 0


def test_what_is_drawn_is_base_plus_k_times_deviation(page: Any, review: Review) -> None:
    sample = middle_of_moves(review)[3]
    delta = review.scene.samples.uncorrected[sample]

    def offset(k: float) -> np.ndarray:
        page.evaluate("k => olp.set_exaggeration(k)", k)
        ends = [page.evaluate("a => olp.project(...a)", [sample, n]) for n in ("uncorrected", "nominal")]
        return np.subtract(*ends)

    page.click("#view-top")
    scale = page.evaluate("olp.app.scene.view(0).scale")
    one, ten = offset(100.0), offset(1000.0)
    assert np.allclose(ten, 10 * one, rtol=1e-6, atol=1e-6)
    assert np.allclose(ten, 1000 * scale * delta[:2] * [1, -1], rtol=2e-3, atol=0.05)


def test_exaggeration_takes_numbers_as_people_write_them(page: Any) -> None:
    for text, value in (("1,234", 1234), ("×250", 250), ("7e9", 1e5), ("0.2", 1), ("12.5", 12.5)):
        page.fill("#exaggeration", text)
        page.press("#exaggeration", "Enter")
        assert page.evaluate("olp.state.exaggeration") == value
    page.evaluate("olp.set_exaggeration(1000)")
    assert float(page.input_value("#exaggeration-slider")) == pytest.approx(3.0)
    page.keyboard.press("Escape")
    page.locator("#listing").focus()
    page.keyboard.press("+")
    assert page.evaluate("olp.state.exaggeration") == 2000
    page.keyboard.press("-")
    page.keyboard.press("-")
    assert page.evaluate("olp.state.exaggeration") == 500


def test_at_first_the_largest_deviation_is_a_small_share_of_the_job(page: Any, review: Review) -> None:
    k = page.evaluate("olp.state.exaggeration")
    scene = review.scene
    feed = scene.nominal.toolpath.kind[scene.samples.move] != 0
    size = np.linalg.norm(np.ptp(scene.position_mm[feed], axis=0))
    share = k * np.linalg.norm(scene.samples.uncorrected[feed], axis=1).max() / size
    assert 0.01 < share <= 0.031


PARTS = ("magnitude", "x", "y", "z", "along", "normal")


def parts_of(review: Review, delta: np.ndarray) -> dict[str, np.ndarray]:
    step = np.diff(review.scene.position_mm, axis=0, prepend=np.nan)
    length = np.linalg.norm(step, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = np.einsum("ij,ij->i", delta, step) / length
        normal = np.linalg.norm(delta - along[:, None] * step / length[:, None], axis=1)
    return dict(zip(PARTS, (np.linalg.norm(delta, axis=1), *delta.T, along, normal), strict=True))


def test_metrics_are_the_parts_of_the_deviation(page: Any, review: Review) -> None:
    scene = review.scene
    rapid = array(page, "rapid") != 0
    for layer, delta in (("uncorrected", scene.samples.uncorrected), ("corrected", scene.samples.corrected)):
        for name, truth in parts_of(review, delta).items():
            page.evaluate("name => olp.set_metric(name)", name)
            shown = np.array(
                page.evaluate(
                    "layer => Array.from("
                    "olp.app.metrics.values(olp.app.metrics.find(olp.state.metric), layer),"
                    " v => Number.isNaN(v) ? null : v)", layer,
                ), float,
            )  # fmt: skip
            assert np.array_equal(np.isnan(shown), rapid)
            known = ~rapid & ~np.isnan(truth)
            # the direction of the shortest steps is known to their rounding only
            assert np.abs(shown - 1e3 * truth)[known].max() < 0.01


def test_the_path_is_coloured_by_band_and_by_probability(chromium: Any, tmp_path: Path) -> None:
    folder = tmp_path / "gantry"
    shutil.copytree(GANTRY.parent, folder)
    calibration = folder / "calibration.toml"
    text = calibration.read_text("utf-8")
    assert "[squareness]\n" in text
    calibration.write_text(text.replace("[squareness]\n", "[squareness]\nsigma_C0Y_urad = 20.0\n"), "utf-8")
    review = view(PROGRAM, folder / "machine.toml", part_tolerance_um=8.0)
    sure = review.scene.uncertainty
    assert sure is not None
    review.write(tmp_path / "sure.html")
    with browser.opened(chromium, tmp_path / "sure.html") as page:
        rapid = array(page, "rapid") != 0
        for name, truth in (("band", 1e3 * sure.band_mm), ("beyond", 100.0 * sure.beyond["corrected"])):
            page.select_option("#metric", name)
            shown = np.array(
                page.evaluate(
                    "Array.from(olp.app.metrics.values(olp.app.metrics.find(olp.state.metric), 'corrected'),"
                    " v => Number.isNaN(v) ? null : v)"
                ), float,
            )  # fmt: skip
            assert np.array_equal(np.isnan(shown), rapid)
            assert np.abs(shown - truth)[~rapid].max() <= max(truth.max() / 200, 0.051)
            still(page)
            assert page.evaluate("document.getElementById('legend-title').textContent") == (
                "uncertainty (k = 2), µm" if name == "band" else "probability beyond 8 µm, %"
            )
            assert colourful(browser.picture(page)) > 200


def test_the_scale_is_round_symmetric_where_signed_and_takes_numbers(page: Any) -> None:
    page.select_option("#metric", "magnitude")
    low, high = float(page.input_value("#scale-min")), float(page.input_value("#scale-max"))
    largest = page.evaluate(
        "Math.max(...['uncorrected', 'command', 'corrected']"
        ".map(n => olp.app.metrics.summary(olp.app.plot_metric(), n, 1).largest))"
    )
    assert low == 0 and largest <= high <= 1.7 * largest
    page.select_option("#metric", "z")
    assert float(page.input_value("#scale-min")) == -float(page.input_value("#scale-max"))
    page.fill("#scale-max", "7.5")
    page.press("#scale-max", "Enter")
    assert float(page.input_value("#scale-min")) == -7.5
    assert page.evaluate("olp.app.scene.lines.get('corrected').uniforms.high.value") == 7.5
    page.click("#scale-auto")
    assert float(page.input_value("#scale-max")) != 7.5
    page.select_option("#metric", "")
    assert page.is_hidden("#legend")
    assert page.evaluate("olp.app.scene.lines.get('corrected').uniforms.coloured.value") == 0


def lightness(rgb: np.ndarray) -> np.ndarray:
    """CIE L* of (n, 3) sRGB bytes."""
    linear = np.where(rgb <= 10.31, rgb / 255 / 12.92, ((rgb / 255 + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(y > 0.008856, 116 * np.cbrt(y) - 16, 903.3 * y)


def test_colour_maps_are_even_in_lightness_and_signed_ones_symmetric(page: Any) -> None:
    def table(**scheme: Any) -> np.ndarray:
        scheme = {"mode": "continuous", "map": "ember"} | scheme
        return np.array(page.evaluate("s => Array.from(OLP.colour.table(s))", scheme)).reshape(-1, 4)[:-1, :3]

    for theme in ("light", "dark"):
        for name in page.evaluate("Object.keys(OLP.colour.MAPS)"):
            steps = np.diff(lightness(table(kind="sequential", map=name, theme=theme))[::64])
            assert (steps > 0).all() and steps.max() < 2.2 * steps.min(), (name, theme, steps)
        signed = lightness(table(kind="diverging", theme=theme))
        half = len(signed) // 2
        direction = 1 if theme == "light" else -1
        assert (np.diff(signed[:half:32]) * direction > 0).all()
        assert (np.diff(signed[half::32]) * direction < 0).all()
        assert abs(signed[0] - signed[-1]) < 12
        assert len(np.unique(table(kind="sequential", mode="steps", theme=theme), axis=0)) == 10
    states = table(kind="sequential", mode="states", theme="light")
    assert len(np.unique(states, axis=0)) == 2
    assert (states[: len(states) // 2] == states[0]).all()
    assert (states[len(states) // 2 :] == states[-1]).all()


def test_statistics_are_those_of_the_proof(page: Any, review: Review) -> None:
    shown = page.locator("#statistics table").first.inner_text()
    proof = review.scene.report["deviation"]
    largest = review.scene.report["verdict"]["numerical"]["largest_um"]
    for value in (largest, proof["before"]["between"]["rms_um"], proof["after"]["waypoints"]["max_um"]):
        assert f"{value:.2f}" in shown
    allowed = review.scene.report["verdict"]["numerical"]["allowed_um"]
    assert page.inner_text("#allowed") == f"{allowed:.2f} µm, corrected"
    page.select_option("#metric", "magnitude")
    assert page.evaluate("olp.app.plots.deviation.limits.map(l => l.value)") == [allowed]


def test_pass_and_fail_are_the_states_of_the_table(page: Any, review: Review) -> None:
    page.select_option("#metric", "magnitude")
    page.select_option("#scale-mode", "states")
    table = review.scene.table.by_line()
    path, samples = review.scene.nominal.toolpath, review.scene.samples
    rapid = array(page, "rapid") != 0
    for layer, key in (("uncorrected", "uncorrected_state"), ("corrected", "corrected_state")):
        state = dict(zip(table["line"].tolist(), table[key].tolist(), strict=True))
        truth = np.array([state[line] for line in path.line[samples.move].tolist()])
        shown = page.evaluate(
            "n => Array.from(olp.app.layers.get(n).values, v => Number.isNaN(v) ? null : v)", layer
        )
        judged = [None if r or s > 1 else s + 1 for s, r in zip(truth.tolist(), rapid.tolist(), strict=True)]
        assert shown == judged
    assert page.evaluate("olp.app.layers.get('command').values") is None
    assert page.evaluate("document.getElementById('legend-title').textContent") == "line"
    # what the table does not judge has no pass and no fail
    page.select_option("#metric", "z")
    assert page.evaluate("olp.app.scale.scheme.mode") == "continuous"


# -- path, program and plots follow one another --------------------------------------------------------------


def test_a_click_on_the_path_finds_its_line(page: Any, review: Review) -> None:
    page.click("#view-iso")
    rows = array(page, "line")
    hits = 0
    for sample in middle_of_moves(review)[1:]:
        x, y = page.evaluate("s => olp.project(s, 'nominal')", sample)
        hit = page.evaluate("p => olp.pick(...p)", [x, y])
        assert hit["distance"] <= 0.5
        page.mouse.click(x, y)
        assert page.evaluate("olp.state.row") == rows[int(np.ceil(hit["sample"] - 1e-9))]
        if abs(hit["sample"] - sample) < 5:
            hits += 1
            assert page.evaluate("olp.state.row") == rows[sample]
        selected = page.locator(".row.selected:visible")
        assert selected.count() == 1
        assert int(selected.get_attribute("data-row")) == page.evaluate("olp.state.row")
        marks = page.evaluate("olp.app.plots.charts.map(c => c.marks.now)")
        assert marks == pytest.approx([page.evaluate("olp.state.time")] * len(marks))
    assert hits >= 4


def test_a_click_on_a_line_finds_its_moves(page: Any, review: Review) -> None:
    rows = array(page, "line").astype(int)
    numbers = array(page, "row_nominal").astype(int)
    for line in (11, 13, 14, 15):
        row = int(np.flatnonzero(numbers == line)[0])
        page.locator(f'.row[data-row="{row}"]:visible').click()
        mine = np.flatnonzero(rows == row)
        mine = mine[mine > 0]
        assert page.evaluate("olp.state.row") == row
        if len(mine) == 0:
            continue
        assert page.evaluate("olp.state.sample") == mine[-1]
        assert page.evaluate("olp.state.span") == [mine[0] - 1, mine[-1]]
        assert page.evaluate("olp.state.time") == pytest.approx(review.scene.time_s[mine[-1]], abs=1e-6)
        still(page)
        x, y = page.evaluate("s => olp.project(s, 'nominal')", int(mine[len(mine) // 2]))
        assert page.evaluate("p => olp.pick(...p)", [x, y])


def test_a_click_on_a_plot_finds_time_and_line(page: Any) -> None:
    rows, times = array(page, "line"), array(page, "t")
    for k in range(page.locator(".plot").count()):
        box = page.locator(".plot").nth(k).bounding_box()
        for share in (0.3, 0.6, 0.8):
            x = round(box["x"] + share * box["width"])
            page.mouse.move(x, box["y"] + 80)
            want = page.evaluate("([k, x]) => olp.app.plots.charts[k].x_at(x)", [k, x - box["x"]])
            assert page.evaluate("olp.app.plots.charts.map(c => c.marks.hover)") == pytest.approx([want] * 2)
            page.mouse.click(x, box["y"] + 80)
            assert page.evaluate("olp.state.time") == pytest.approx(want, abs=1e-6)
            assert page.evaluate("olp.state.row") == rows[np.searchsorted(times, want - 1e-9)]


def test_plots_zoom_together_about_the_pointer_and_come_back(page: Any) -> None:
    box = page.locator(".plot").first.bounding_box()
    whole = page.evaluate("olp.app.plots.charts[0].window")
    x = round(box["x"] + 0.5 * box["width"])
    page.mouse.move(x, box["y"] + 80)
    under = page.evaluate("x => olp.app.plots.charts[0].x_at(x)", x - box["x"])
    page.mouse.wheel(0, -600)
    browser.until(page, "olp.app.plots.charts[0].range !== null")
    first, second = page.evaluate("olp.app.plots.charts.map(c => c.window)")
    assert first == second and first[1] - first[0] < 0.6 * (whole[1] - whole[0])
    assert page.evaluate("x => olp.app.plots.charts[0].x_at(x)", x - box["x"]) == pytest.approx(under)
    page.mouse.down()
    page.mouse.move(x + 40, box["y"] + 80, steps=4)
    page.mouse.up()
    moved = page.evaluate("olp.app.plots.charts[0].window")
    assert moved[0] <= first[0] and moved[1] - moved[0] == pytest.approx(first[1] - first[0])
    page.mouse.dblclick(x, box["y"] + 80)
    assert page.evaluate("olp.app.plots.charts.map(c => c.window)") == [whole, whole]


def test_no_peak_is_lost_in_a_plot_of_a_million_points(page: Any) -> None:
    peaks = page.evaluate(
        """() => {
          const n = 1e6, x = Float64Array.from({length: n}, (_, i) => i), y = new Float32Array(n);
          y[123457] = 9; y[777777] = -4; y[500000] = NaN;
          const chart = olp.app.plots.deviation;
          const series = [{label: "s", colour: "#000", x, y}];
          chart.set({extent: [x[0], x[x.length - 1]], title: "t", unit: "", x_label: "", series, limits: []});
          const columns = chart.columns(series[0]), ends = [1, 2].map(k => columns.map(c => c[k]));
          return [columns.length, Math.max(...ends[1]), Math.min(...ends[0]), chart.wide];
        }"""
    )
    assert peaks[0] <= peaks[3] + 2
    assert peaks[1:3] == [9, -4]


def test_motion_plots_show_limits_and_ways(page: Any) -> None:
    for kind in ("velocity", "acceleration", "jerk", "share", "speed"):
        page.select_option("#motion", kind)
        chart = page.evaluate(
            "(() => { const c = olp.app.plots.movement;"
            " return {limits: c.limits.map(l => l.value), up: c.up, labels: c.series.map(s => s.label)}; })()"
        )
        if kind != "speed":
            assert chart["labels"] == ["X", "Y", "Z"]
            assert chart["limits"] and max(chart["limits"]) <= chart["up"]
    assert page.evaluate("olp.app.plots.movement.series.length") == 2
    page.select_option("#abscissa", "way")
    ends = page.evaluate("[olp.app.plots.movement.extent[1], olp.app.plots.deviation.extent[1]]")
    assert ends == pytest.approx([page.evaluate("olp.app.arc.at(-1)")] * 2, rel=1e-6)


# -- time ----------------------------------------------------------------------------------------------------


PLACE = "path => olp.app.scene.viewer.scene_tree.find(['olp', ...path]).object.position.toArray()"


def test_scrubbing_moves_tool_and_machine(page: Any, review: Review) -> None:
    scene = review.scene
    page.evaluate("olp.set_layer('corrected', false)")
    nodes = page.evaluate("olp.manifest.nodes")
    axes = array(page, "Q", 3)
    assert len(nodes) == 3
    for share in (0.2, 0.55, 0.9):
        moment = share * scene.time_s[-1]
        page.evaluate(
            "t => { const bar = document.getElementById('time');"
            " bar.value = t; bar.dispatchEvent(new Event('input')); }",
            moment,
        )
        assert page.evaluate("olp.state.time") == pytest.approx(moment, abs=1e-9)
        position = page.evaluate(PLACE, ["tool"])
        truth = [np.interp(moment, scene.time_s, scene.position_mm[:, j]) for j in range(3)]
        assert np.array(position) + page.evaluate("olp.manifest.origin_mm") == pytest.approx(truth, abs=1e-2)
        for node in nodes:
            axis = node["axis"]
            there = np.interp(moment, scene.time_s, axes[:, axis])
            assert page.evaluate(PLACE, node["path"])[axis] == pytest.approx(there, abs=1e-2)


def test_play_runs_on_its_rate_and_stops_at_the_end(page: Any) -> None:
    end = page.evaluate("olp.app.end")
    page.select_option("#rate", "10")
    page.click("#play")
    browser.until(page, "olp.state.time > 1")
    assert page.evaluate("olp.state.playing")
    page.click("#play")
    halted = page.evaluate("olp.state.time")
    page.wait_for_timeout(150)
    assert page.evaluate("olp.state.time") == halted < end
    page.select_option("#rate", "200")
    page.keyboard.press("Escape")
    page.locator("#listing").focus()
    page.keyboard.press(" ")
    browser.until(page, "!olp.state.playing")
    assert page.evaluate("olp.state.time") == end


def test_steps_go_from_block_to_block(page: Any) -> None:
    rows = array(page, "line").astype(int)
    ends = np.flatnonzero(np.append(np.diff(rows) != 0, True))
    page.evaluate("olp.set_time(0)")
    seen = []
    for _ in range(len(ends) + 2):
        page.click("#step-forward")
        seen.append(page.evaluate("olp.state.sample"))
    distinct = list(dict.fromkeys(seen))
    assert distinct == [int(e) for e in ends if e > 0]
    page.click("#step-back")
    assert page.evaluate("olp.state.sample") == ends[-2]


def test_only_the_travelled_path_on_demand(page: Any) -> None:
    page.evaluate("olp.set_time(olp.app.end / 2)")
    page.check("#trail")
    cut, here = "olp.app.scene.lines.get('nominal').uniforms.cut.value", page.evaluate("olp.state.sample_at")
    assert page.evaluate(cut) == here
    ahead = page.evaluate("olp.project(olp.app.samples - 40, 'nominal')")
    assert page.evaluate("p => olp.pick(...p)?.sample ?? 0", ahead) <= here + 1
    page.uncheck("#trail")
    assert page.evaluate(cut) == 1e9


# -- finding -------------------------------------------------------------------------------------------------


def test_the_worst_lines_of_the_table_come_in_order(page: Any, review: Review) -> None:
    table = review.scene.table.by_line()
    size = np.where(table["state"] == 2, 0.0, np.nan_to_num(table["corrected_um"]))
    order = np.lexsort((table["line"], -np.round(size, 2)))
    found = [page.evaluate("olp.worst()") for _ in range(4)]
    assert [f["value"] for f in found] == pytest.approx(size[order[:4]].tolist(), abs=0.0051)
    lines = [page.evaluate("row => olp.app.listing.number(row, 0)", f["row"]) for f in found]
    assert lines == table["line"][order[:4]].tolist()
    assert page.evaluate("olp.state.sample") == found[-1]["sample"]
    # by whatever paths are coloured
    page.select_option("#metric", "y")
    assert page.evaluate("olp.worst()")["value"] == found[0]["value"]
    page.evaluate("olp.worst()")
    page.evaluate("olp.worst()")
    back = page.evaluate("olp.worst(-1)")
    assert back["rank"] == 2
    page.click("#worst")
    assert page.evaluate("olp.state.worst") == 2
    assert f"Worst 3 of {found[0]['count']}: {size[order[2]]:.2f} µm" in page.inner_text("#toast")


def test_search_and_go_to_line(page: Any) -> None:
    numbers = array(page, "row_nominal").astype(int)
    page.fill("#find", "16")
    page.press("#find", "Enter")
    assert numbers[page.evaluate("olp.state.row")] == 16
    page.fill("#find", "g1 x")
    hits = []
    for _ in range(4):
        page.press("#find", "Enter")
        hits.append("".join(page.evaluate("[0, 1].map(side => olp.app.listing.text(olp.state.row, side))")))
    assert len(set(hits[:3])) == 3 and all("G1 X" in hit for hit in hits)
    page.fill("#find", "nowhere at all")
    page.press("#find", "Enter")
    assert page.inner_text("#toast") == "Not found"
    assert page.inner_text("#detail").count("\n") >= 1


def test_measuring_tells_true_distances_at_any_exaggeration(page: Any, review: Review) -> None:
    page.click("#view-top")
    a, b = middle_of_moves(review)[1], middle_of_moves(review)[3]
    page.click("#measure")
    for sample in (a, b):
        page.mouse.click(*page.evaluate("s => olp.project(s, 'nominal')", sample))
    points = np.array(page.evaluate("olp.app.overlay.measured.map(m => m.true_point)"))
    truth = review.scene.position_mm[[a, b]] - page.evaluate("olp.manifest.origin_mm")
    assert np.abs(points - truth).max() < 2.0
    shown = float(page.inner_text("#toast").split(" mm")[0])
    assert shown == pytest.approx(np.linalg.norm(points[1] - points[0]), abs=1e-3)
    page.evaluate("olp.set_exaggeration(1)")
    assert float(page.evaluate("olp.app.measure_text()").split(" mm")[0]) == shown
    page.keyboard.press("Escape")
    assert page.get_attribute("#measure", "aria-pressed") == "false"


# -- camera, theme, keys -------------------------------------------------------------------------------------


def test_standard_views_show_the_whole_path(page: Any, review: Review) -> None:
    box = page.locator("#pane").bounding_box()
    corners = middle_of_moves(review)
    for ortho in (True, False):
        assert page.get_attribute("#ortho", "aria-pressed") == str(ortho).lower()
        for name in ("iso", "top", "front", "side"):
            page.click(f"#view-{name}")
            pixels = np.array([page.evaluate("s => olp.project(s, 'nominal')", s) for s in corners])
            assert (pixels >= [box["x"], box["y"]]).all()
            assert (pixels <= [box["x"] + box["width"], box["y"] + box["height"]]).all()
            assert page.evaluate("olp.state.view") == name
        page.click("#ortho")


def test_switching_the_camera_keeps_what_is_looked_at(page: Any) -> None:
    page.evaluate("olp.app.camera.reveal([0, 0, 0])")
    target = page.evaluate("olp.app.camera.target_mm()")
    middle = "olp.app.scene.project(olp.app.camera.target_mm())"
    centre = page.evaluate(middle)
    page.click("#ortho")
    assert page.evaluate("olp.app.camera.target_mm()") == pytest.approx(target, abs=1e-6)
    assert page.evaluate(middle) == pytest.approx(centre, abs=1e-3)


def test_drags_and_wheels_turn_and_zoom(page: Any) -> None:
    page.keyboard.press("Escape")
    before = page.evaluate("olp.app.camera.save()")
    box = page.locator("#pane").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 120)
    page.mouse.down()
    page.mouse.move(box["x"] + 360, box["y"] + 150, steps=4)
    page.mouse.up()
    assert page.evaluate("olp.app.camera.save().position") != before["position"]
    page.mouse.wheel(0, -300)
    browser.until(page, f"olp.app.camera.save().zoom > {before['zoom']}")


def test_dark_and_light(chromium: Any, file: Path) -> None:
    shade = {}
    for theme in ("light", "dark"):
        with browser.opened(chromium, file, theme=theme) as page:
            assert page.evaluate("olp.state.theme") == theme
            still(page)
            shade[theme] = float(np.median(browser.picture(page, "body")))
            page.click("#theme")
            still(page)
            shade[f"not {theme}"] = float(np.median(browser.picture(page, "body")))
    assert shade["light"] > 200 > 80 > shade["dark"]
    assert shade["not light"] == pytest.approx(shade["dark"], abs=6)


def test_keys(page: Any) -> None:
    page.locator("#listing").focus()
    page.keyboard.press("?")
    assert page.is_visible("#help") and "next worst line" in page.inner_text("#help")
    page.keyboard.press("Escape")
    assert page.is_hidden("#help")
    row = page.evaluate("olp.state.row")
    page.keyboard.press("ArrowDown")
    assert page.evaluate("olp.state.row") == row + 1
    for key, folded in (("[", "#left"), ("]", "#right"), ("p", "#plots")):
        page.locator("#play").focus()
        page.keyboard.press(key)
        assert page.is_hidden(folded)
        page.keyboard.press(key)
        assert page.is_visible(folded)
    page.keyboard.press("/")
    assert page.evaluate("document.activeElement.id") == "find"
    page.keyboard.type("w1")
    assert page.input_value("#find").endswith("w1") and page.evaluate("olp.state.worst") == -1


@pytest.mark.parametrize("size", [(1280, 720), (1600, 1000), (1920, 1080)])
def test_nothing_overlaps_or_leaves_the_window(chromium: Any, file: Path, size: tuple[int, int]) -> None:
    with browser.opened(chromium, file, size=size) as page:
        assert page.evaluate("[document.body.scrollWidth, document.body.scrollHeight]") == list(size)
        for group in ("#bar > *", "#timeline > *", "#tools > *", "#legend, #views, #readout", "#left > *"):
            boxes = [
                page.locator(group).nth(k).bounding_box() for k in range(page.locator(group).count())
                if page.locator(group).nth(k).is_visible()
            ]  # fmt: skip
            for k, a in enumerate(boxes):
                assert a["x"] >= 0 and a["x"] + a["width"] <= size[0] + 0.5
                for b in boxes[k + 1 :]:
                    apart = (
                        a["x"] + a["width"] <= b["x"] + 0.5 or b["x"] + b["width"] <= a["x"] + 0.5
                        or a["y"] + a["height"] <= b["y"] + 0.5 or b["y"] + b["height"] <= a["y"] + 0.5
                    )  # fmt: skip
                    assert apart, (group, a, b)
        pane = page.locator("#pane").bounding_box()
        assert pane["width"] > 0.4 * size[0] and pane["height"] > 0.55 * size[1]


# -- notes, links, the fallback ------------------------------------------------------------------------------


def test_notes_survive_in_the_saved_file(chromium: Any, file: Path, tmp_path: Path) -> None:
    text = 'scratch here </script><script>window.pwned = 1</script> & "so" — ½ µm'
    with browser.opened(chromium, file) as page:
        page.evaluate("olp.set_time(3)")
        page.click("#callout")
        page.fill("#note-text", text)
        page.click("#note button.primary")
        browser.until(page, "document.querySelectorAll('#callouts .note').length === 3")
        notes = page.evaluate("olp.state.callouts")
        assert notes[-1]["text"] == text
        with page.expect_download() as download:
            page.click("#save")
        download.value.save_as(tmp_path / "kept.html")
        positions = array(page, "P")
    with browser.opened(chromium, tmp_path / "kept.html") as page:
        assert page.evaluate("olp.state.callouts") == notes
        assert text in page.inner_text("#callouts")
        assert page.evaluate("window.pwned ?? null") is None
        assert np.array_equal(array(page, "P"), positions)
        again = page.evaluate("olp.app.notes.html()")
    kept = (tmp_path / "kept.html").read_text(encoding="utf-8")
    assert again == kept
    with browser.opened(chromium, tmp_path / "kept.html") as page:
        page.locator("#callouts .note button.icon").last.click()
        assert page.evaluate("olp.state.callouts") == notes[:-1]


def test_a_view_can_be_sent_in_the_address(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file) as page:
        page.evaluate(
            "() => { olp.set_exaggeration(321); olp.set_metric('y'); olp.set_layer('command', true);"
            " olp.set_time(4.5); olp.app.set_view('front'); olp.app.set_theme('dark');"
            " olp.app.scale.set_range(-3, 3); }"
        )
        page.click("#share")
        address = page.evaluate("location.hash")
        want = page.evaluate("olp.app.notes.view()")
    with browser.opened(chromium, file, view=address) as page:
        got = page.evaluate("olp.app.notes.view()")
    camera = [view.pop("camera") for view in (want, got)]
    assert got == want
    assert camera[0]["position"] == pytest.approx(camera[1]["position"])
    for broken in ("#view=%%%", "#view=AAAA", "#else"):
        with browser.opened(chromium, file, view=broken) as page:
            assert page.evaluate("olp.state.exaggeration") != 321


def test_without_webgl_a_canvas_draws_the_same(play: Any, file: Path, review: Review) -> None:
    with browser.launched(play, *browser.WITHOUT_GL) as chromium, browser.opened(chromium, file) as page:
        assert page.evaluate("olp.app.scene.flat")
        still(page)
        before = colourful(browser.picture(page))
        assert before > 500
        sample = middle_of_moves(review)[3]
        x, y = page.evaluate("s => olp.project(s, 'nominal')", sample)
        page.mouse.click(x, y)
        hit = page.evaluate("p => olp.pick(...p)", [x, y])
        rows = array(page, "line")
        assert page.evaluate("olp.state.row") == rows[int(np.ceil(hit["sample"] - 1e-9))]
        page.click("#ortho")
        page.click("#view-top")
        page.evaluate("() => { for (const n of Object.keys(olp.state.layers)) olp.set_layer(n, false); }")
        page.evaluate("() => { olp.state.callouts = []; olp.app.set_span([-1, -1]); }")
        still(page)
        assert colourful(browser.picture(page)) < before / 2


# -- hostile and large input ---------------------------------------------------------------------------------

HOSTILE = (
    b"</script><script>window.pwned=1</script>",
    b"<!--<script>window.pwned=2</script>",
    b"<img src=x onerror=window.pwned=3>",
    b"<svg/onload=window.pwned=4> ]]> </textarea></title></style>",
    b"\\u003cscript>window.pwned=5\\u003c/script> @@DATA@@ @@MANIFEST@@ ${window.pwned=6}",
    b"\x00\x01\x07\x08\x1b[31m\x7f bell and escape",
    "\u202eright to left\u2028separator\ufeff mark \U0001f600".encode(),
    b"&lt;script&gt; &amp; &#60;b&#62;",
)


def test_a_hostile_program_is_text_and_nothing_else(chromium: Any, tmp_path: Path) -> None:
    comments = [b"(" + text.replace(b"(", b"[").replace(b")", b"]") + b")" for text in HOSTILE]
    comments.append(b"(" + b"A" * 1_000_000 + b")")
    # behind the end a control takes anything
    path = b"G21 G90 G54\nT1 M6\nG43 H1\nG0 X10 Y10 Z5\nG1 X50 F600\nM2"
    program = b"\n".join([path, *comments, b""])
    name = tmp_path / "<b>part&.ngc"
    name.write_bytes(program)
    view(name, GANTRY).write(tmp_path / "hostile.html")
    assert b"\x00" not in (tmp_path / "hostile.html").read_bytes()
    with browser.opened(chromium, tmp_path / "hostile.html") as page:
        scripts = page.evaluate("document.scripts.length")
        page.locator("#listing").focus()
        for key in ("Home", "End", "Home"):
            page.keyboard.press(key)
        rows = page.evaluate("olp.app.listing.n")
        for row in range(rows):
            page.evaluate("row => olp.select_row(row)", row)
        page.evaluate("() => { olp.app.listing.scroll_to(0); }")
        assert page.evaluate("window.pwned ?? null") is None
        assert page.evaluate("document.scripts.length") == scripts
        assert page.evaluate("document.querySelectorAll('#right img, #right svg, #right script').length") == 0
        tags = page.evaluate("[...document.querySelectorAll('#listing *')].map(e => e.tagName)")
        assert set(tags) <= {"B", "DIV", "SPAN"}
        first = page.evaluate("olp.app.listing.text(olp.app.listing.row_of_line(7), 0)")
        assert first == comments[0].decode()
        everything = page.evaluate(
            "Array.from({length: olp.app.listing.n}, (_, k) => olp.app.listing.text(k, 0))"
        )
        assert max(map(len, everything)) < 2100
        assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e\u2028]", "".join(everything))
        assert "<b>part&.ngc" in page.inner_text("#title") + page.inner_text("#subtitle")
        assert page.evaluate("document.body.scrollWidth") == 1280


def synthetic(rows: int, samples: int) -> tuple[dict[str, Any], bytes]:
    """A manifest of `rows` lines and `samples` points on a spiral, by hand."""
    arrays = Arrays()
    u = np.linspace(0, 40 * np.pi, samples)
    position = np.column_stack((200 * u / u[-1] * np.cos(u), 200 * u / u[-1] * np.sin(u), u / 10))
    arrays.quantised("P", position, 1e-4)
    arrays.quantised("d", np.column_stack((np.sin(u), np.cos(2 * u), np.sin(3 * u))) * 0.01, 1e-6)
    arrays.quantised("line", np.minimum(np.arange(samples) * rows // samples, rows - 1), 1.0)
    arrays.raw("rapid", np.zeros(samples), "u1")
    arrays.quantised("t", np.arange(samples) * 0.01, 1e-6)
    arrays.quantised("s", np.arange(samples) * 0.1, 1e-3)
    arrays.text("text", "\n".join(f"N{k} G1 X{k % 977}" for k in range(1, rows + 1)))
    arrays.quantised("number", np.arange(1, rows + 1), 1.0)
    arrays.raw("error", np.full(rows, 1.5), "f4")
    layer = {"base": "P", "index": None, "colour": "#cc5500", "width": 2, "visible": True}
    manifest: dict[str, Any] = {
        "schema": "olp-review-1", "title": "made up", "program": "part.ngc", "corrected": None,
        "machine": "m",
        "digest": "0" * 12, "compression": "deflate", "origin_mm": [0, 0, 0], "samples": samples,
        "base": "P", "line": "line", "rapid": "rapid", "time": "t", "way": "s", "tolerance_um": 5,
        "motion": None, "meshes": [], "nodes": [],
        "layers": [{"name": "nominal", "label": "nominal", "delta": None, **layer},
                   {"name": "uncorrected", "label": "uncorrected", "delta": "d", **layer}],
        "metrics": [{"name": "magnitude", "label": "deviation", "unit": "um", "kind": "sequential",
                     "of": "magnitude", "by_layer": {"uncorrected": None}, "judged": True}],
        "listing": {"nominal": "text", "corrected": None, "row_nominal": "number", "row_corrected": None,
                    "uncorrected_um": "error", "corrected_um": None},
        "statistics": [], "findings": [], "callouts": [], "frame": "machine", "tool_radius_mm": 3,
        "arrays": arrays.specs,
    }  # fmt: skip
    return manifest, arrays.encoded()


def test_a_million_lines_scroll_to_each_of_them(chromium: Any, tmp_path: Path) -> None:
    rows = 1_000_000
    (tmp_path / "long.html").write_bytes(b"".join(packed(*synthetic(rows, 20_000))))
    with browser.opened(chromium, tmp_path / "long.html") as page:
        assert page.evaluate("document.getElementById('listing-inner').offsetHeight") < 1.6e7
        for line in (1, 2, 345_678, 999_999, rows):
            page.fill("#find", str(line))
            page.press("#find", "Enter")
            row = page.locator(f'.row[data-row="{line - 1}"]')
            assert row.is_visible() and f"N{line} G1" in row.inner_text()
        page.mouse.move(*(page.locator("#listing").bounding_box()[k] + 60 for k in ("x", "y")))
        page.mouse.wheel(0, -95)
        browser.until(page, "Math.abs(olp.app.listing.top - (olp.app.listing.highest - 5)) < 1e-6")
        page.evaluate("(b => { b.scrollTop = b.scrollHeight / 2; })(document.getElementById('listing'))")
        browser.until(page, "Math.abs(olp.app.listing.top / 1e6 - 0.5) < 0.01")
        assert page.locator(".row:visible").count() < 60


def test_a_million_points_keep_their_peak_in_sight(chromium: Any, tmp_path: Path) -> None:
    (tmp_path / "many.html").write_bytes(b"".join(packed(*synthetic(1000, 1_000_000))))
    with browser.opened(chromium, tmp_path / "many.html") as page:
        drawn = page.evaluate("olp.drawn.uncorrected")
        assert 1000 < drawn < 400_000
        # a single sample far out: whatever is thinned, its value is drawn
        largest = page.evaluate(
            """() => {
              const path = olp.app.layers.get("uncorrected");
              path.values[654321] = 1000;
              olp.app.scene.refill();
              const values = Array.from({length: path.drawn}, (_, i) => path.buffer[i * 4 * OLP.FLOATS + 13]);
              return values.reduce((a, b) => Math.max(a, b));
            }"""
        )
        assert largest == 1000


def test_measured_paths_and_workpieces_stand_beside_the_rest(chromium: Any, tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_bytes(PROGRAM)
    trimesh.creation.box((440, 340, 20)).export(tmp_path / "part.stl")
    (tmp_path / "job.toml").write_text(
        f'schema = "olp-job-1"\nprogram = "part.ngc"\nmachine = "{GANTRY.as_posix()}"\n'
        '[[meshes]]\nfile = "part.stl"\nrole = "workpiece"\nframe = "G54"\n'
    )
    (tmp_path / "tip.csv").write_bytes(olp.simulate(PROGRAM, GANTRY, step_mm=2.0).to_csv())
    review = view(
        tmp_path / "part.ngc", GANTRY, tmp_path / "job.toml", measured=[tmp_path / "tip.csv"], time=False
    )
    review.write(tmp_path / "measured.html")
    with browser.opened(chromium, tmp_path / "measured.html") as page:
        assert page.evaluate("olp.drawn.measured") > 100
        uncorrected, measured = page.evaluate(
            "['uncorrected', 'measured']"
            ".map(n => olp.app.metrics.summary(olp.app.plot_metric(), n, 1).largest)"
        )
        # across the path the measured points are those of the uncompensated machine
        assert 0.2 * uncorrected < measured < 1.2 * uncorrected
        for name in ("nominal", "uncorrected", "corrected", "rapids"):
            page.evaluate("name => olp.set_layer(name, false)", name)
        page.click("#view-top")
        x, y = page.evaluate("(n => olp.project(olp.app.samples >> 1, n))('measured')")
        hit = page.evaluate("p => olp.pick(...p)", [x, y])
        assert hit["layer"] == "measured"
        page.mouse.click(x, y)
        assert page.evaluate("olp.state.row") == page.evaluate("olp.app.row_at()")
        still(page)
        before = browser.picture(page)
        page.uncheck("#layer-workpiece")
        still(page)
        assert (browser.picture(page) != before).any(axis=2).mean() > 0.05
        worst = page.evaluate("olp.worst()")
        most = olp.compare(tmp_path / "part.ngc", [tmp_path / "tip.csv"], GANTRY).report["worst"][0]
        assert (worst["layer"], worst["value"]) == ("measured", pytest.approx(most["max_um"], abs=0.0051))
        assert page.evaluate("row => olp.app.listing.number(row, 0)", worst["row"]) == most["line"]
        assert f"{most['max_um']:.2f}" in page.inner_text("#statistics")
        row = f'.row[data-row="{worst["row"]}"]'
        assert page.inner_text(row).endswith(f" → {most['max_um']:.2f}")


def test_a_live_page_follows_its_inputs_and_keeps_its_view(chromium: Any, tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_bytes(PROGRAM)
    server = Server(lambda: view(path, GANTRY, time=False), [str(path)], lambda text: None)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        with browser.opened(chromium, server.address) as page:
            page.evaluate("() => { olp.set_exaggeration(432); olp.set_metric('y'); }")
            digest = page.evaluate("olp.manifest.digest")
            path.write_bytes(PROGRAM.replace(b"G1 X10\r", b"G1 X12\r"))
            other = f"window.olp && olp.manifest.digest !== '{digest}'"
            browser.until(page, f"{other} && document.documentElement.dataset.ready === '1'")
            assert page.evaluate("[olp.state.exaggeration, olp.state.metric]") == [432, "y"]
            assert page.evaluate("olp.app.listing.text(olp.app.listing.row_of_line(18), 0)") == "G1 X12"
    finally:
        server.stop()
        thread.join()


@pytest.mark.parametrize(
    ("program", "job", "size", "theme"),
    [
        ("gantry-plate/plate.ngc", "gantry-plate/job.toml", (1280, 720), "dark"),
        ("bridge-cmm/housing.ngc", "bridge-cmm/job.toml", (1600, 1000), "light"),
        ("table-router/outline.ngc", "table-router/job-outline.toml", (1280, 720), "light"),
        ("haas-mill/bracket.nc", "haas-mill/job.toml", (1600, 1000), "dark"),
    ],
)
def test_shipped_jobs_open(
    chromium: Any, tmp_path: Path, program: str, job: str, size: tuple[int, int], theme: str
) -> None:
    folder = (PROGRAMS / program).parent
    review = view(PROGRAMS / program, folder / "machine.toml", PROGRAMS / job, time=False)
    review.write(tmp_path / "job.html")
    with browser.opened(chromium, tmp_path / "job.html", size=size, theme=theme) as page:
        still(page)
        assert colourful(browser.picture(page)) > 1000
        assert page.evaluate("olp.manifest.title") in page.title()
        assert page.evaluate("olp.worst()")["value"] > 0
        origin = np.array(page.evaluate("olp.manifest.origin_mm"))
        assert np.abs(array(page, "P", 3) + origin - review.scene.position_mm).max() <= 0.5e-4 * (1 + 1e-6)
