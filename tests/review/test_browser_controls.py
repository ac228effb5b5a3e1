"""Ranges on the strip, keys and fingers on charts, the edge of the program, radio buttons, links."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.pages import PROGRAMS, array
from judge import browser

from olp.review.job import Review, view

pytestmark = pytest.mark.slow
HAAS = PROGRAMS / "haas-mill"
LINES = "() => ['filter-first', 'filter-last'].map(id => document.getElementById(id).value)"
WINDOW = "olp.app.plots.strip.window"


@pytest.fixture(scope="module")
def drilled() -> Review:
    """A job with two tools, holes and contours."""
    return view(HAAS / "bracket.nc", HAAS / "machine.toml", HAAS / "job.toml", time=False)


@pytest.fixture(scope="module")
def drilled_file(drilled: Review, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("controls") / "drilled.html"
    drilled.write(path)
    return path


@pytest.fixture
def two_tools(chromium: Any, drilled_file: Path) -> Iterator[Any]:
    with browser.opened(chromium, drilled_file, size=(1440, 900)) as page:
        yield page


def mask(page: Any) -> np.ndarray:
    return np.array(page.evaluate("olp.app.mask && Array.from(olp.app.mask)"), bool)


def points(page: Any) -> list[dict[str, str]]:
    body = page.evaluate("OLP.csv(olp.app)").split("\r\n", 1)[1]
    return list(csv.DictReader(io.StringIO(body)))


def pixel(page: Any, sample: int) -> float:
    """Where a sample is on the strip, in px of the page."""
    at = page.evaluate("i => olp.app.plots.strip.px(olp.app.plots.axis[i])", sample)
    return float(page.locator(".plot").first.bounding_box()["x"] + at)


def middle(samples: np.ndarray, arc: np.ndarray) -> int:
    """The sample nearest to half of the way of some."""
    return int(samples[np.abs(arc[samples] - (arc[samples[0]] + arc[samples[-1]]) / 2).argmin()])


def lines_of(review: Review) -> np.ndarray:
    return np.asarray(review.scene.nominal.toolpath.line[review.scene.samples.move])


def kept_lines(page: Any) -> list[int]:
    """The nominal lines that the listing marks when it shows them, and no other."""
    marked = page.evaluate("[...document.querySelectorAll('.row.kept')].map(r => +r.dataset.row).sort()")
    shown = page.evaluate(
        "[...document.querySelectorAll('.row')].map(r => +r.dataset.row)"
        ".filter(k => olp.app.filter.rows[k]).sort()"
    )
    assert marked == shown and marked
    return list(
        page.evaluate(
            "Array.from(olp.app.filter.rows, (on, k) => on && olp.app.listing.number(k, 0)).filter(Boolean)"
        )
    )


def follows(page: Any, review: Review, first: int, last: int) -> None:
    """Filter, listing, summary, statistics and CSV are those of the lines from first to last."""
    lines, inside = lines_of(review), mask(page)
    assert page.evaluate(LINES) == [str(first), str(last)]
    assert np.array_equal(inside, (lines >= first) & (lines <= last))
    assert {int(row["line"]) for row in points(page)} == set(lines[inside].tolist())
    assert kept_lines(page) == list(range(first, last + 1))
    said = page.inner_text("#selection")
    assert f"Filtered, lines {first} to {last}: {inside.sum():,} points of" in said
    table = review.scene.table.by_line()
    rows = (table["line"] >= first) & (table["line"] <= last) & (table["corrected_state"] < 2)
    largest = f"{table['corrected_um'][rows].max():.2f}"
    assert f"corrected {largest}" in said
    page.click("#tab-display")
    assert "moves that count, filtered" in page.inner_text("#statistics caption")
    cells = page.locator("#statistics tr", has_text="largest").first.locator("td").all_inner_texts()
    assert cells[-1] == largest
    page.click("#tab-parts")


def test_a_drag_on_the_strip_keeps_its_lines(page: Any, review: Review) -> None:
    lines, arc = lines_of(review), array(page, "s")
    ends = [middle(np.flatnonzero(lines == line), arc) for line in (12, 16)]
    y = page.locator(".plot").first.bounding_box()["y"] + 60
    for from_, to in (ends, ends[::-1]):
        page.mouse.move(pixel(page, from_), y)
        page.mouse.down()
        page.mouse.move(pixel(page, to), y, steps=5)
        assert len(page.evaluate("olp.app.plots.strip.bands")) == 1
        assert page.evaluate("olp.app.mask") is None
        page.mouse.up()
        follows(page, review, 12, 16)
        assert page.evaluate("olp.app.plots.strip.bands.length") == 1
        page.locator(".plot canvas").first.focus()
        page.keyboard.press("Escape")
        assert page.evaluate("olp.app.mask") is None and page.evaluate(LINES) == ["", ""]
        assert page.locator(".row.kept").count() == 0


def test_keys_on_the_strip_keep_lines(page: Any, review: Review) -> None:
    page.evaluate("olp.app.go_to_line(14)")
    page.locator(".plot canvas").first.focus()
    page.keyboard.press("Shift+ArrowRight")
    # a blank line has no move, so the end goes over it
    follows(page, review, 14, 16)
    page.locator(".plot canvas").first.focus()
    page.keyboard.press("Shift+ArrowLeft")
    page.keyboard.press("Shift+ArrowLeft")
    follows(page, review, 13, 14)
    page.locator(".plot canvas").first.focus()
    for _ in range(30):
        page.keyboard.press("Shift+ArrowLeft")
    assert page.evaluate(LINES)[1] == "14"
    assert int(page.evaluate(LINES)[0]) == lines_of(review).min()


def test_a_range_of_touch_is_the_same(chromium: Any, file: Path, review: Review) -> None:
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, has_touch=True)
    page = context.new_page()
    page.goto(file.as_uri())
    page.wait_for_selector("html[data-ready]", state="attached", timeout=120_000)
    touch = context.new_cdp_session(page)

    def send(kind: str, *xs: float) -> None:
        spots = [{"x": x, "y": y, "id": k} for k, x in enumerate(xs)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": spots})
        # the browser hands moves of fingers on with the next frame
        page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    box = page.locator(".plot").first.bounding_box()
    y = box["y"] + 60
    lines, arc = lines_of(review), array(page, "s")
    a, b = (pixel(page, middle(np.flatnonzero(lines == line), arc)) for line in (12, 16))
    send("touchStart", a)
    for share in (0.3, 0.6, 1.0):
        send("touchMove", a + share * (b - a))
    send("touchEnd")
    assert page.evaluate(LINES) == ["12", "16"]
    # two fingers apart enlarge, and what was under them stays under them
    left = box["x"]
    p, q = left + 150, left + 210
    at = "x => olp.app.plots.strip.x_at(x)"
    under = [page.evaluate(at, x - left) for x in (p, q)]
    send("touchStart", p, q)
    for far in (20, 40, 60):
        send("touchMove", p - far, q + far)
    assert [page.evaluate(at, x - left) for x in (p - 60, q + 60)] == pytest.approx(under, rel=1e-3)
    window = page.evaluate(WINDOW)
    whole = page.evaluate("olp.app.plots.strip.extent")
    assert window[1] - window[0] == pytest.approx((whole[1] - whole[0]) / 3, rel=1e-3)
    # moved together they move the window along
    for far in (20, 40):
        send("touchMove", p - 60 - far, q + 60 - far)
    send("touchEnd")
    moved = page.evaluate(WINDOW)
    assert moved[0] > window[0] and moved[1] - moved[0] == pytest.approx(window[1] - window[0])
    assert page.evaluate("olp.app.plots.charts.map(c => c.window)") == [moved] * 2
    assert page.evaluate(LINES) == ["12", "16"]
    # the edge of the program
    width = page.locator("#panel-program").bounding_box()["width"]
    edge = page.locator("#grip").bounding_box()
    x, y = edge["x"] + edge["width"] / 2, edge["y"] + 200
    send("touchStart", x)
    for far in (20, 40, 60):
        send("touchMove", x - far)
    send("touchEnd")
    assert page.locator("#panel-program").bounding_box()["width"] == pytest.approx(width + 60, abs=12)
    context.close()


@pytest.mark.parametrize("chart", [0, 1])
def test_keys_zoom_charts_and_move_them_along(page: Any, chart: int) -> None:
    whole = page.evaluate(WINDOW)
    page.evaluate("olp.set_time(olp.app.end / 2)")
    row, position = page.evaluate("[olp.state.row, olp.app.camera.save().position]")
    factor = page.evaluate("olp.app.pictures.exaggeration()")
    page.locator(".plot canvas[role=img]").nth(chart).focus()
    now = page.evaluate("olp.app.plots.strip.marks.now")
    page.keyboard.press("+")
    page.keyboard.press("=")
    near = page.evaluate(WINDOW)
    assert near[1] - near[0] == pytest.approx((whole[1] - whole[0]) / 2.25)
    assert near[0] < now < near[1]
    page.keyboard.press("ArrowRight")
    right = page.evaluate(WINDOW)
    assert right == pytest.approx([v + 0.1 * (near[1] - near[0]) for v in near])
    page.keyboard.press("ArrowLeft")
    assert page.evaluate(WINDOW) == pytest.approx(near)
    for _ in range(60):
        page.keyboard.press("ArrowLeft")
    assert page.evaluate(WINDOW)[0] == pytest.approx(whole[0], abs=1e-6)
    page.keyboard.press("-")
    assert page.evaluate("olp.app.plots.charts.map(c => c.window)")[0][1] > near[1] - near[0]
    page.keyboard.press("Home")
    assert page.evaluate("olp.app.plots.charts.map(c => c.window)") == [whole, whole]
    # none of it reached the keys of the page
    assert page.evaluate("[olp.state.row, olp.app.camera.save().position]") == [row, position]
    assert page.evaluate("olp.app.pictures.exaggeration()") == factor


def test_a_drag_with_shift_moves_the_window_along(page: Any) -> None:
    page.locator(".plot canvas").first.focus()
    for _ in range(3):
        page.keyboard.press("+")
    page.evaluate(
        "() => { const {extent: [a, b]} = olp.app.plots.strip; const d = (b - a) / 8;"
        " olp.app.plots.charts.forEach(c => c.set_range([a + 3 * d, a + 5 * d])); }"
    )
    before = page.evaluate(WINDOW)
    box = page.locator(".plot").first.bounding_box()
    x, y = box["x"] + 200, box["y"] + 60
    page.mouse.move(x, y)
    page.keyboard.down("Shift")
    page.mouse.down()
    page.mouse.move(x + 40, y, steps=4)
    page.mouse.up()
    page.keyboard.up("Shift")
    wide = page.evaluate("olp.app.plots.strip.wide")
    shift = 40 / wide * (before[1] - before[0])
    assert page.evaluate(WINDOW) == pytest.approx([v - shift for v in before], rel=1e-3)
    assert page.evaluate("olp.app.mask") is None


def test_the_edge_of_the_program_moves_by_keys(page: Any) -> None:
    def value(name: str) -> int:
        return int(page.get_attribute("#grip", f"aria-value{name}"))

    width = "document.getElementById('panel-program').offsetWidth"
    assert page.get_attribute("#grip", "role") == "separator"
    browser.until(page, f"{width} === +document.getElementById('grip').getAttribute('aria-valuenow')")
    before = value("now")
    time = page.evaluate("olp.state.time")
    page.locator("#grip").focus()
    for key, want in (
        ("ArrowLeft", before + 16),
        ("ArrowRight", before),
        ("Home", value("min")),
        ("End", value("max")),
    ):
        page.keyboard.press(key)
        assert page.evaluate(width) == value("now") == want, key
    assert page.evaluate("olp.state.time") == time


def test_pictures_switch_by_all_four_arrows(page: Any) -> None:
    page.locator("#picture-uncorrected").focus()
    row = page.evaluate("olp.state.row")
    at = page.evaluate("() => { olp.show_picture(0); return olp.app.pictures.at; }")
    assert at == 0
    for key, want in (
        ("ArrowDown", 1),
        ("ArrowDown", 0),
        ("ArrowUp", 1),
        ("ArrowLeft", 0),
        ("ArrowRight", 1),
    ):
        page.keyboard.press(key)
        assert page.evaluate("olp.app.pictures.at") == want, key
        names = ("picture-uncorrected", "picture-corrected")
        assert page.evaluate("document.activeElement.id") == names[want]
        checked = [page.get_attribute(f"#{name}", "aria-checked") for name in names]
        assert checked == [str(k == want).lower() for k in range(2)]
    assert page.evaluate("olp.state.row") == row


@pytest.mark.parametrize(
    ("which", "says", "why"), [("page", "", "planned"), ("two_tools", "by feed", "feed")]
)
def test_the_clock_says_where_its_times_come_from(
    which: str, says: str, why: str, request: pytest.FixtureRequest
) -> None:
    clock = request.getfixturevalue(which).locator("#time-value")
    assert clock.inner_text().partition(" / ")[2].partition(" ")[2] == says
    assert why in clock.get_attribute("title")


def test_a_tool_and_an_operation_keep_their_rapids(two_tools: Any, drilled: Review) -> None:
    path, samples = drilled.scene.nominal.toolpath, drilled.scene.samples
    tools = np.array([-1 if f.tool is None else f.tool for f in path.frames])[path.frame[samples.move]]
    aside = array(two_tools, "rapid") == 1
    two_tools.evaluate("document.getElementById('filter').open = true")
    two_tools.select_option("#filter-kind", "rapid")
    for tool in np.unique(tools[aside & (tools >= 0)]).tolist():
        two_tools.select_option("#filter-tool", str(tool))
        assert np.array_equal(mask(two_tools), aside & (tools == tool)) and mask(two_tools).sum() > 2
    two_tools.select_option("#filter-tool", "")
    operation = drilled.scene.table.operation[samples.move]
    roots = two_tools.evaluate("olp.app.tree.roots.map(n => [n.id, n.samples[0][0]])")
    for number, first in roots:
        two_tools.select_option("#filter-operation", str(number))
        assert np.array_equal(mask(two_tools), aside & (operation == operation[first]))
    two_tools.select_option("#filter-kind", "")
    own = mask(two_tools)
    assert np.array_equal(own, operation == operation[roots[-1][1]])


SET = """() => {
  olp.app.plots.set_abscissa("time"); olp.app.plots.set_motion("jerk"); olp.app.set_trail(true);
  olp.app.filter.restore({text: "o", tool: "1", lines: [12, 16], kind: "feed", only: [[3, 60]]});
}"""


def test_links_keep_filter_abscissa_motion_and_travelled(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file) as page:
        page.evaluate(SET)
        page.click("#share")
        address, want = page.evaluate("[location.hash, olp.app.notes.view()]")
        inside = mask(page)
        assert inside.any() and not inside.all()
        assert want["filter"] == {
            "text": "o", "tool": "1", "operation": "", "lines": [12, 16], "kind": "feed", "only": [[3, 60]],
        }  # fmt: skip
    with browser.opened(chromium, file, view=address) as page:
        got = page.evaluate("olp.app.notes.view()")
        for key in ("filter", "abscissa", "motion", "trail"):
            assert got[key] == want[key]
        assert np.array_equal(mask(page), inside)
        fields = {"filter-text": "o", "filter-first": "12", "motion": "jerk", "abscissa": "time"}
        assert {name: page.input_value(f"#{name}") for name in fields} == fields
        assert page.is_checked("#trail")
        assert page.evaluate("olp.app.scene.lines.get('corrected').uniforms.cut.value") < 1e9


#: Values that no key of a link expects.
WRONG: list[Any] = [
    None, 7, -1, "x", [None, "x"], [[1, "x"]], {"toString": 1, "valueOf": 1}, [{"toString": 1}], [[0, 1e9]],
]  # fmt: skip
PARTS = ("text", "tool", "operation", "lines", "kind", "only")


def test_each_key_of_a_link_alone_and_wrong_leaves_the_page_whole(page: Any) -> None:
    keys = page.evaluate("Object.keys(olp.app.notes.view())")
    assert {"filter", "abscissa", "motion", "trail", "strip"} <= set(keys)
    wrong = [{key: value} for key in keys for value in WRONG]
    wrong += [{"filter": {part: value}} for part in PARTS for value in WRONG]
    for view_ in wrong:
        error = page.evaluate("v => { try { olp.app.notes.apply(v); } catch (e) { return e.stack; } }", view_)
        assert error is None, (json.dumps(view_), error)
        again = page.evaluate("olp.app.notes.view()")
        assert again["abscissa"] in ("way", "time") and again["trail"] in (True, False)
        assert page.evaluate("olp.app.plots.strip.lanes.length") > 0
        assert all(value is None or value >= 1 for value in again["filter"]["lines"])
    page.evaluate("olp.app.report()")
    one = page.evaluate("olp.app.notes.view()")
    for key in one:
        page.evaluate("v => olp.app.notes.apply(v)", {key: one[key]})
    assert page.evaluate("document.documentElement.dataset.error ?? null") is None
