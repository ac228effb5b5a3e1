"""Path, program, plots and time follow one another."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases.pages import array, middle_of_moves, still
from judge import browser

from olp.review.job import Review

pytestmark = pytest.mark.slow


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
        assert marks == pytest.approx([page.evaluate("olp.app.plots.x_of(olp.state.time)")] * len(marks))
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
        assert page.evaluate("olp.state.chosen") == [[mine[0], mine[-1]]]
        assert page.evaluate("olp.state.time") == pytest.approx(review.scene.time_s[mine[-1]], abs=1e-6)
        still(page)
        x, y = page.evaluate("s => olp.project(s, 'nominal')", int(mine[len(mine) // 2]))
        assert page.evaluate("p => olp.pick(...p)", [x, y])


def test_a_click_on_a_plot_finds_time_and_line(page: Any) -> None:
    page.select_option("#abscissa", "time")
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
          const chart = olp.app.plots.strip;
          const series = [{label: "s", x, y}];
          const lanes = [{title: "t", unit: "", series, limits: []}];
          chart.set({extent: [x[0], x[x.length - 1]], x_label: "", lanes});
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
            "(() => { const [c] = olp.app.plots.movement.lanes;"
            " return {limits: c.limits.map(l => l.value), up: c.up, labels: c.series.map(s => s.label)}; })()"
        )
        if kind != "speed":
            assert chart["labels"] == ["X", "Y", "Z"]
            assert chart["limits"] and max(chart["limits"]) <= chart["up"]
    assert page.evaluate("olp.app.plots.movement.lanes[0].series.length") == 2
    page.select_option("#abscissa", "way")
    ends = page.evaluate("[olp.app.plots.movement.extent[1], olp.app.plots.strip.extent[1]]")
    assert ends == pytest.approx([page.evaluate("olp.app.arc.at(-1)")] * 2, rel=1e-6)


PLACE = "path => olp.app.scene.viewer.scene_tree.find(['olp', ...path]).object.position.toArray()"


def test_scrubbing_moves_tool_and_machine(page: Any, review: Review) -> None:
    scene = review.scene
    page.evaluate("olp.set_exaggeration(1)")
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


def test_the_worst_lines_of_the_table_come_in_order(page: Any, review: Review) -> None:
    table = review.scene.table.by_line()
    size = np.where(table["state"] == 2, 0.0, np.nan_to_num(table["corrected_um"]))
    order = np.lexsort((table["line"], -np.round(size, 2)))
    found = [page.evaluate("olp.worst()") for _ in range(4)]
    assert [f["value"] for f in found] == pytest.approx(size[order[:4]].tolist(), abs=0.0051)
    lines = [page.evaluate("row => olp.app.listing.number(row, 0)", f["row"]) for f in found]
    assert lines == table["line"][order[:4]].tolist()
    assert page.evaluate("olp.state.sample") == found[-1]["sample"]
    # the ranking is the table's, by whatever paths are coloured
    page.click("#tab-display")
    page.select_option("#metric", "y")
    assert page.evaluate("olp.worst()")["rank"] == 5
    assert page.evaluate("olp.worst(-1)")["value"] == found[3]["value"]
    assert page.evaluate("olp.worst(-1)")["rank"] == 3
    page.evaluate("olp.worst(-1)")
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
    page.select_option("#view-six", "top")
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
