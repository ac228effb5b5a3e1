"""The tree of operations and features, the filter, and what leaves the page: CSV, pictures, prints."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.pages import GANTRY, PROGRAM, PROGRAMS, still
from judge import browser
from PIL import Image

import olp
from olp.review.job import Review, view

pytestmark = pytest.mark.slow
HAAS = PROGRAMS / "haas-mill"
#: What the page calls a verdict.
VERDICTS = {True: "within", False: "above", None: "not judged"}


@pytest.fixture(scope="module")
def drilled() -> Review:
    """A job with two tools, holes and contours."""
    return view(HAAS / "bracket.nc", HAAS / "machine.toml", HAAS / "job.toml", time=False)


@pytest.fixture(scope="module")
def drilled_file(drilled: Review, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tree") / "drilled.html"
    drilled.write(path)
    return path


@pytest.fixture
def tree(chromium: Any, drilled_file: Path) -> Iterator[Any]:
    with browser.opened(chromium, drilled_file, size=(1440, 900)) as page:
        yield page


def um(value: float | None) -> str:
    """A deviation as every report prints it."""
    if value is None:
        return "–"
    return "<0.01" if 0 < abs(value) < 0.005 else f"{value:.2f}".replace("-", "−")


def rows(page: Any) -> list[dict[str, Any]]:
    return list(
        page.evaluate(
            "[...document.querySelectorAll('.node')].map(n => ({id: +n.dataset.id, text: n.innerText,"
            " mark: n.querySelector('[role=img]').getAttribute('aria-label'),"
            " open: n.getAttribute('aria-expanded'), selected: n.getAttribute('aria-selected')}))"
        )
    )


def open_all(page: Any) -> None:
    page.evaluate("() => { for (const n of olp.app.tree.nodes) n.open = true; olp.app.tree.draw(); }")


def test_the_tree_says_what_the_table_says(tree: Any, drilled: Review) -> None:
    stated = drilled.scene.report["judgement"]["operations"]
    nodes = {
        node["id"]: node for node in tree.evaluate("olp.app.tree.nodes.map(({children, ...node}) => node)")
    }
    open_all(tree)
    shown = rows(tree)
    assert [row["id"] for row in shown] == list(nodes)
    for row in shown:
        node = nodes[row["id"]]
        sizes = [node["largest_um"][name] for name in ("uncorrected", "corrected")]
        assert f"largest {' → '.join(map(um, sizes))}" in row["text"]
        assert row["mark"] == VERDICTS[node["holds"]]
        for figure in node["figures"]:
            values = [figure["by_layer"].get(name) for name in ("uncorrected", "corrected")]
            told = " → ".join(um(value) for value in values if value is not None)
            assert not told or f"{figure['label']} {told}" in row["text"]
    roots = [node for node in nodes.values() if node["parent"] is None]
    judged = [node for node in roots if node["holds"] is not None]
    assert [(n["largest_um"]["uncorrected"], n["largest_um"]["corrected"], n["holds"]) for n in judged] == [
        (pytest.approx(row["uncorrected_um"]), pytest.approx(row["corrected_um"]), row["holds"])
        for row in stated
    ]
    assert {node["kind"] for node in nodes.values()} > {"operation", "hole"}


def test_a_click_on_a_feature_goes_there(tree: Any) -> None:
    open_all(tree)
    nodes = tree.evaluate("olp.app.tree.nodes.map(({children, ...node}) => node)")
    for node in [n for n in nodes if n["parent"] is not None and n["samples"]][::7][:6]:
        tree.evaluate("id => document.querySelector(`.node[data-id='${id}']`).click()", node["id"])
        assert tree.evaluate("olp.state.chosen") == node["samples"]
        worst = node["worst_sample"]["corrected"]
        assert worst is None or tree.evaluate("olp.state.sample") == worst
        still(tree)
        box = tree.locator("#pane").bounding_box()
        middle = node["samples"][0][0]
        x, y = tree.evaluate("s => olp.project(s, 'nominal')", middle)
        assert box["x"] < x < box["x"] + box["width"] and box["y"] < y < box["y"] + box["height"]
        selected = [row["id"] for row in rows(tree) if row["selected"] == "true"]
        assert selected == [node["id"]]
        chosen = tree.evaluate(
            "() => { const p = olp.app.layers.get('corrected'), s = 4 * OLP.FLOATS; let n = 0;"
            " for (let i = 0; i < p.drawn; i++) if (p.buffer[i * s + 15] >= OLP.CHOSEN) n++; return n; }"
        )
        assert chosen > 0


def test_the_tree_is_walked_by_keys(tree: Any) -> None:
    tree.evaluate("() => { for (const n of olp.app.tree.nodes) n.open = false; olp.app.tree.draw(); }")
    tree.locator(".node").first.focus()
    focused = "+document.activeElement.dataset.id"
    first = tree.evaluate(focused)
    tree.keyboard.press("ArrowRight")
    assert rows(tree)[0]["open"] == "true"
    tree.keyboard.press("ArrowRight")
    child = tree.evaluate(focused)
    assert child != first
    tree.keyboard.press("Enter")
    assert tree.evaluate("olp.state.chosen.length") > 0
    tree.keyboard.press("ArrowLeft")
    tree.keyboard.press("ArrowLeft")
    assert tree.evaluate(focused) == first
    tree.keyboard.press("End")
    assert tree.evaluate(focused) == rows(tree)[-1]["id"]


def mask(page: Any) -> np.ndarray:
    return np.array(page.evaluate("olp.app.mask && Array.from(olp.app.mask)"), bool)


def test_filters_keep_what_they_name(tree: Any, drilled: Review) -> None:
    path, samples = drilled.scene.nominal.toolpath, drilled.scene.samples
    line, feed = path.line[samples.move], path.kind[samples.move] != 0
    tools = np.array([-1 if f.tool is None else f.tool for f in path.frames])[path.frame[samples.move]]
    tree.evaluate("document.getElementById('filter').open = true")
    tree.fill("#filter-first", "30")
    tree.fill("#filter-last", "60")
    tree.press("#filter-last", "Enter")
    kept = (line >= 30) & (line <= 60)
    assert np.array_equal(mask(tree)[1:], kept[1:])
    tree.select_option("#filter-kind", "feed")
    assert np.array_equal(mask(tree)[1:], (kept & feed & samples.joined)[1:])
    tree.click("#filter-clear")
    assert tree.evaluate("olp.app.mask") is None
    tool = int(tools[feed][-1])
    tree.select_option("#filter-tool", str(tool))
    inside = mask(tree)
    assert inside.any() and (tools[inside] == tool).all()
    assert np.array_equal(inside[1:] & feed[1:], (feed & samples.joined & (tools == tool))[1:])
    # what is outside is drawn faintly, and not picked
    still(tree)
    looks = tree.evaluate(
        "() => { const p = olp.app.layers.get('corrected'), s = 4 * OLP.FLOATS;"
        " return [...new Set(Array.from({length: p.drawn}, (_, i) => p.buffer[i * s + 15]))]; }"
    )
    assert 4 in looks
    assert "Filtered: " in tree.inner_text("#selection")
    assert all(
        row["text"] for row in rows(tree)
    ) and {n["tool"] for n in tree.evaluate("olp.app.tree.roots.filter(n => n.shown)")} == {tool}  # fmt: skip
    tree.click("#filter-clear")
    tree.fill("#filter-text", "hole")
    names = [row["text"].lower() for row in rows(tree)]
    assert any(name.startswith("hole") for name in names)
    assert mask(tree).any()


def test_a_filter_by_lines_names_the_lines_that_it_keeps(tree: Any) -> None:
    tree.evaluate("document.getElementById('filter').open = true")
    tree.fill("#filter-first", "abc")
    tree.press("#filter-first", "Enter")
    assert "No line abc" in tree.inner_text("#toast")
    tree.fill("#filter-last", "30")
    tree.press("#filter-last", "Enter")
    assert tree.input_value("#filter-first") == ""
    assert "lines first to 30" in tree.inner_text("#selection")
    tree.fill("#filter-first", "31")
    tree.press("#filter-first", "Enter")
    assert "after the last" in tree.inner_text("#toast")


def test_the_largest_of_a_selection_is_that_of_its_lines(tree: Any, drilled: Review) -> None:
    table = drilled.scene.table.by_line()
    by_line = dict(zip(table["line"].tolist(), table["corrected_um"].tolist(), strict=True))
    found = [line for line, state in zip(table["line"].tolist(), table["state"], strict=True) if state < 2]
    for chosen in (found[2], found[len(found) // 2]):
        tree.evaluate("line => olp.app.go_to_line(line)", chosen)
        assert f"corrected {um(by_line[chosen])}" in tree.inner_text("#selection").replace("\n", " ")


def test_csv_has_the_points_that_are_selected(tree: Any, drilled: Review) -> None:
    samples = drilled.scene.samples
    nodes = tree.evaluate("olp.app.tree.nodes.map(({children, ...node}) => node)")
    node = next(n for n in nodes if n["kind"] == "hole")
    tree.evaluate("id => olp.app.tree.go(olp.app.tree.nodes.find(n => n.id === id))", node["id"])
    tree.evaluate("document.getElementById('filter').open = true")
    with tree.expect_download() as download:
        tree.click("#export")
    assert download.value.suggested_filename == "bracket-points.csv"
    text = download.value.path().read_bytes().decode("utf-8")
    head, body = text.split("\r\n", 1)
    assert head.startswith('"# ') and "frame=" in head
    found = list(csv.DictReader(io.StringIO(body)))
    index = np.concatenate([np.arange(a, b + 1) for a, b in node["samples"]])
    assert len(found) == len(index)
    for row, i in zip(found, index.tolist(), strict=True):
        assert int(row["line"]) == drilled.scene.nominal.toolpath.line[samples.move[i]]
        for j, axis in enumerate("XYZ"):
            assert float(row[f"{axis}_mm"]) == pytest.approx(drilled.scene.position_mm[i, j], abs=1e-4)
            assert float(row[f"uncorrected_D{axis}_um"]) == pytest.approx(
                1e3 * samples.uncorrected[i, j], abs=2e-3
            )
            assert float(row[f"corrected_D{axis}_um"]) == pytest.approx(
                1e3 * samples.corrected[i, j], abs=3e-3
            )
    # without a selection, all of them
    tree.keyboard.press("Escape")
    tree.locator("#pane").focus()
    tree.keyboard.press("Escape")
    assert len(tree.evaluate("OLP.csv(olp.app)").splitlines()) == 2 + len(samples)


def test_cells_of_csv_are_no_formulas(page: Any) -> None:
    """A program's name for a line may begin as a formula of a spreadsheet does."""
    first = page.evaluate(
        "() => { olp.app.listing.number = () => '=cmd(\"a\",1)'; olp.app.choose([[3, 3]]);"
        " return OLP.csv(olp.app).split('\\r\\n')[2]; }"
    )
    assert first.startswith('"\'=cmd(""a"",1)",')


def test_the_strip_shows_the_parts_of_the_error_of_the_picture(page: Any, review: Review) -> None:
    for at, layer in ((0, "uncorrected"), (1, "corrected")):
        page.evaluate("k => olp.show_picture(k)", at)
        lanes = page.evaluate(
            "olp.app.plots.strip.lanes.map(l => [l.title,"
            " Array.from(l.series[0].y, v => v !== v ? null : v)])"
        )
        assert [title for title, _ in lanes] == ["normal, to the left", "binormal, upwards", "along the path"]
        size = np.sqrt(sum(np.square(np.array(values, float)) for _, values in lanes))
        delta = 1e3 * np.linalg.norm(getattr(review.scene.samples, layer), axis=1)
        known = np.isfinite(size)
        assert known.any() and np.abs(size - delta)[known].max() < 0.01
        said = page.get_attribute("#plots .plot canvas[role=img]", "aria-label")
        assert "normal, to the left, µm: from " in said
    page.select_option("#strip", "pictures")
    titles = page.evaluate("olp.app.plots.strip.lanes.map(l => l.title)")
    assert titles == ["uncorrected", "corrected"]
    # each picture has its own scale: the residual is seen beside what was removed
    ups = page.evaluate("olp.app.plots.strip.lanes.map(l => l.up)")
    assert ups[0] > 5 * ups[1]


def test_a_picture_of_the_view_is_saved(page: Any, tmp_path: Path) -> None:
    still(page)
    with page.expect_download() as download:
        page.click("#picture")
    assert download.value.suggested_filename.endswith("-corrected.png")
    download.value.save_as(tmp_path / "view.png")
    with Image.open(tmp_path / "view.png") as image:
        pixels = np.asarray(image.convert("RGB"), int)
    pane = page.locator("#pane").bounding_box()
    assert pixels.shape[1] == round(pane["width"]) and pixels.shape[0] > pane["height"] + 80
    path = pixels[60 : int(pane["height"])]
    assert (path.max(axis=2) - path.min(axis=2) > 70).sum() > 500
    legend = pixels[44 + int(pane["height"]) :]
    assert (legend.max(axis=2) - legend.min(axis=2) > 70).sum() > 500


def test_a_print_is_a_report_of_a4_pages(page: Any, review: Review, tmp_path: Path) -> None:
    before = page.evaluate("[olp.app.pictures.at, olp.state.theme]")
    page.evaluate("olp.app.set_theme('dark')")
    page.evaluate("olp.app.report()")
    page.emulate_media(media="print")
    text = page.inner_text("#print")
    verdict = review.scene.report["verdict"]
    assert page.is_hidden("#app")
    # also behind the first sheet
    assert page.evaluate("getComputedStyle(document.documentElement).backgroundColor") == "rgb(255, 255, 255)"
    assert {True: "PASS", False: "FAIL", None: "NOT JUDGED"}[verdict["ok"]] in text
    assert verdict["questions"][0]["question"] in text
    assert um(verdict["numerical"]["largest_um"]) in text
    assert page.locator("#print img").count() == 2
    sizes = page.evaluate(
        "[...document.querySelectorAll('#print img')].map(i => [i.naturalWidth, i.naturalHeight])"
    )
    assert min(min(size) for size in sizes) > 200
    assert page.evaluate(
        "document.querySelector('#print').scrollWidth <= document.documentElement.clientWidth"
    )
    # what the reader had is there again
    assert page.evaluate("[olp.app.pictures.at, olp.state.theme]") == [before[0], "dark"]
    paper = page.pdf(prefer_css_page_size=True)
    (tmp_path / "report.pdf").write_bytes(paper)
    assert (
        paper.startswith(b"%PDF") and 1 <= paper.count(b"/Type /Page\n") + paper.count(b"/Type /Page ") <= 12
    )


def test_a_job_that_fails_says_so_everywhere(chromium: Any, tmp_path: Path) -> None:
    review = view(PROGRAM, GANTRY, part_tolerance_um=0.05, time=False)
    assert review.scene.report["verdict"]["ok"] is False
    asked = review.scene.report["verdict"]["questions"]
    assert asked[0]["ok"] is True
    review.write(tmp_path / "failed.html")
    with browser.opened(chromium, tmp_path / "failed.html") as page:
        assert page.inner_text("#verdict") == "FAIL"
        assert page.locator("#card .answer.fail").inner_text() == "NO"
        assert "ABOVE the part tolerance of 0.05 µm" in page.inner_text("#card")
        page.evaluate("olp.app.report()")
        assert "FAIL" in page.evaluate("document.getElementById('print').textContent")
        # on paper, too, what fails is read first
        questions = page.locator("#print > p > b").all_text_contents()[:2]
        assert questions == page.locator("#card dt").all_text_contents()
        assert questions[0] == next(q["question"] for q in asked if q["ok"] is False)


def test_a_line_above_is_flagged_in_tree_listing_and_picture(chromium: Any, tmp_path: Path) -> None:
    """A cut that is left uncorrected is above, and only that."""
    program = PROGRAM.replace(b"G1 X450 Y300", b"(olp off)\r\nG1 X450 Y300\r\n(olp on)")
    corrected = olp.correct(PROGRAM, GANTRY).data
    path = tmp_path / "part.ngc"
    path.write_bytes(program)
    review = view(path, GANTRY, time=False)
    assert corrected and review.scene.report["verdict"]["ok"] is False
    review.write(tmp_path / "above.html")
    over = {int(n) for n in review.scene.table.line[review.scene.table.over]}
    with browser.opened(chromium, tmp_path / "above.html", size=(1440, 900)) as page:
        flagged = page.evaluate(
            "() => { const s = olp.arrays.get(olp.manifest.listing.state);"
            " return [...s.keys()].filter(r => s[r] === 1).map(r => olp.app.listing.number(r, 0)); }"
        )
        assert set(flagged) == over and over
        page.evaluate("line => olp.app.go_to_line(line)", min(over))
        assert page.locator(".row.selected .error.over").count() == 1
        open_all(page)
        marks = {row["mark"] for row in rows(page)}
        assert "above" in marks
        samples = page.evaluate("olp.app.overlay.marks.get('corrected')")
        lines = review.scene.nominal.toolpath.line[review.scene.samples.move[samples]]
        assert {int(line) for line in lines} == over
        # each stands where its line is farthest off
        for sample in samples:
            here, stated = page.evaluate(
                "i => [olp.app.metrics.values(olp.app.distance, 'corrected')[i],"
                " olp.app.stated_um('corrected', olp.app.rows[i])]",
                sample,
            )
            assert here == pytest.approx(stated, abs=0.1, rel=0.01)
