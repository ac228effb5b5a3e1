"""Several measured runs, and runs of which nothing counts: each is said and drawn by itself."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.pages import array, still
from judge import browser
from judge.machines import zero_machine

from olp.review.job import Review, view
from olp.review.judged import pictures

TEXT = b"G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nY80\nX0\nY0\nG0 X0 Y0 Z60\nM2\n"
#: line 4 is along X, line 5 along Y: how far each run is off on them, um
OFF = {"first.csv": {4: 30.0, 5: 10.0}, "second.csv": {4: 5.0, 5: 22.0, 6: 21.0}}


def points(off: dict[int, float]) -> bytes:
    """Points on lines 4 to 6, off by whole amounts across the line."""
    rows = []
    for line, um in off.items():
        for share in np.linspace(0.1, 0.9, 9):
            x, y = {
                4: (100 * share, um / 1e3),
                5: (100 - um / 1e3, 80 * share),
                6: (100 - 100 * share, 80 - um / 1e3),
            }[line]
            rows.append(f"{x:.6f},{y:.6f},20")
    return "\n".join(["# frame=G54", "X_mm,Y_mm,Z_mm", *rows, ""]).encode()


def reviewed(folder: Path, files: dict[str, bytes], **options: Any) -> Review:
    paths = []
    for name, data in files.items():
        (folder / name).write_bytes(data)
        paths.append(folder / name)
    return view(TEXT, zero_machine(folder / "m"), measured=paths, time=False, **options)


@pytest.fixture
def two(tmp_path: Path) -> Review:
    return reviewed(
        tmp_path, {name: points(off) for name, off in OFF.items()}, part_tolerance_um=20.0, step_mm=50.0
    )


def test_each_run_has_its_own_flag_rms_and_lines_above(two: Review) -> None:
    shown = {p["label"]: p for p in pictures(two.scene)}
    first, second = shown["measured: first.csv"], shown["measured: second.csv"]
    assert [p["layers"] for p in (first, second)] == [["measured-1"], ["measured-2"]]
    assert (first["flag"]["line"], first["lines_above"]) == ("4", 1)
    assert (second["flag"]["line"], second["lines_above"]) == ("5", 2)
    assert [p["largest_um"] for p in (first, second)] == pytest.approx([30.0, 22.0], abs=1e-3)
    assert [p["rms_um"] for p in (first, second)] == pytest.approx(
        [np.sqrt((900 + 100) / 2), np.sqrt((25 + 484 + 441) / 3)], abs=1e-3
    )
    assert [p["flag"]["layer"] for p in (first, second)] == ["measured-1", "measured-2"]
    assert first["flag"]["direction"] == pytest.approx([0, 1, 0], abs=1e-3)
    assert second["flag"]["direction"] == pytest.approx([-1, 0, 0], abs=1e-3)
    assert all(p["note"] is None for p in shown.values())


def test_without_a_part_tolerance_no_line_of_a_run_is_above(tmp_path: Path) -> None:
    review = reviewed(tmp_path, {"one.csv": points(OFF["first.csv"])})
    run = next(p for p in pictures(review.scene) if p["name"] == "measured")
    assert (run["label"], run["lines_above"], run["tolerance_um"]) == ("measured", None, None)


def test_lines_above_of_the_model_are_those_of_the_table(two: Review) -> None:
    table = two.scene.table.by_line()
    for picture in list(pictures(two.scene))[:2]:
        assert picture["lines_above"] == (table[f"{picture['name']}_state"] == 1).sum()


def test_a_run_on_rapids_alone_is_not_judged_and_says_so(tmp_path: Path) -> None:
    review = reviewed(tmp_path, {"up.csv": RAPIDS}, part_tolerance_um=20.0)
    assert not review.scene.measured[0].counted.any()
    run = list(pictures(review.scene))[-1]
    assert (run["name"], run["largest_um"], run["flag"], run["rms_um"]) == ("measured", None, None, None)
    assert run["lines_above"] is None and "not judged" in run["note"]


#: a run beside the rapid of line 8
RAPIDS = "\n".join(["# frame=G54", "X_mm,Y_mm,Z_mm", *(f"0.01,0,{z}" for z in range(22, 60, 2)), ""]).encode()


@pytest.mark.slow
def test_the_page_names_each_run(two: Review, chromium: Any, tmp_path: Path) -> None:
    two.write(tmp_path / "two.html")
    with browser.opened(chromium, tmp_path / "two.html", size=(1440, 900)) as page:
        # what fails is read first, and no control covers another
        assert page.locator("#card .answer").first.inner_text() == "NO"
        blend, views = (page.locator(box).bounding_box() for box in ("#blend", "#views"))
        assert blend["x"] + blend["width"] <= views["x"] or blend["y"] >= views["y"] + views["height"]
        rows = page.locator("#card table tr").all_inner_texts()
        for name, largest, line, above in (("first", "30.00", 4, 1), ("second", "22.00", 5, 2)):
            text = next(row for row in rows if f"{name}.csv" in row).split()
            assert largest in text and text[-2:] == [str(line), str(above)]
        for k, (name, line) in enumerate((("first", "4"), ("second", "5")), start=1):
            page.click(f"#picture-measured-{k}")
            assert f"measured: {name}.csv" in page.get_attribute("#pane", "aria-label")
            page.evaluate("olp.app.go_to_flag()")
            assert str(page.evaluate("olp.app.listing.number(olp.state.row, 0)")) == line
            still(page)
            marks = page.evaluate("n => olp.app.overlay.marks.get(n).length", f"measured-{k}")
            assert marks == k
            stated = two.scene.table.measured.largest_um(k - 1)
            read = page.locator("#readout tr", has_text=f"{name}.csv").locator("td").last
            assert read.inner_text() == f"{stated:.2f}"
        page.click("#tab-display")
        page.evaluate("olp.app.choose([])")
        page.evaluate("olp.set_metric('magnitude')")
        heads = page.locator("#statistics thead th").all_inner_texts()
        assert heads[-2:] == ["measured: first.csv", "measured: second.csv"]


@pytest.mark.slow
def test_csv_has_each_measured_point_once(two: Review, chromium: Any, tmp_path: Path) -> None:
    two.write(tmp_path / "two.html")
    with browser.opened(chromium, tmp_path / "two.html") as page:
        index = array(page, "i_measured-1").astype(int)
        body = page.evaluate("OLP.csv(olp.app)").split("\r\n", 1)[1]
        page.evaluate("olp.app.go_to_line(4)")
        some = page.evaluate("OLP.csv(olp.app)").split("\r\n", 1)[1]
    rows = list(csv.DictReader(io.StringIO(body)))
    assert sum(row["of"] == "program" for row in rows) == len(two.scene.samples)
    for k, name in enumerate(OFF):
        run = two.scene.measured[k]
        own = [row for row in rows if row["of"] == f"measured: {name}"]
        assert len(own) == len(run.index) == 9 * len(OFF[name])
        place = np.array([[float(row[f"{a}_mm"]) for a in "XYZ"] for row in own])
        delta = np.array([[float(row[f"measured_D{a}_um"]) for a in "XYZ"] for row in own])
        assert np.abs(place - run.base_mm).max() < 2e-4
        assert np.abs(delta - 1e3 * run.delta_mm).max() < 2e-3
        assert all(row["uncorrected_DX_um"] == "" for row in own)
        for row, counted in zip(own, run.counted, strict=True):
            assert row["kind"] == ("counts" if counted else "does not count")
    assert {row["measured_DX_um"] for row in rows if row["of"] == "program"} == {""}
    # points of the path are far apart on this straight line, so measured ones share them
    assert len(np.unique(index)) < len(index)
    chosen = [row for row in csv.DictReader(io.StringIO(some)) if row["of"] == "measured: first.csv"]
    assert len(chosen) == 9 and {row["line"] for row in chosen} == {"4"}


@pytest.mark.slow
def test_a_run_that_is_not_judged_is_drawn(chromium: Any, tmp_path: Path) -> None:
    review = reviewed(tmp_path, {"up.csv": RAPIDS}, part_tolerance_um=20.0)
    review.write(tmp_path / "up.html")
    with browser.opened(chromium, tmp_path / "up.html") as page:
        assert page.evaluate("olp.app.pictures.current.name") == "measured"
        page.evaluate("olp.set_layer('rapids', false)")
        still(page)
        assert page.evaluate("olp.drawn.measured") > 5
        looks = page.evaluate(
            "() => { const p = olp.app.layers.get('measured'), s = 4 * OLP.FLOATS;"
            " return [...new Set(Array.from({length: p.drawn}, (_, i) => p.buffer[i * s + 15]))]; }"
        )
        assert 0 in looks and 1 not in looks
        assert "shown and not judged" in page.inner_text("#card")
        with_run = browser.picture(page)
        hide = "['olp', 'measured'], 'visible', false"
        page.evaluate(f"() => olp.app.scene.viewer.set_property({hide})")
        still(page)
        assert (browser.picture(page) != with_run).any(axis=2).sum() > 20
        page.evaluate("olp.app.report()")
        assert "shown and not judged" in page.evaluate("document.getElementById('print').textContent")
