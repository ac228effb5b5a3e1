"""Hostile, large, measured, live and shipped inputs in the browser."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import Any

import pytest
import trimesh
from cases.pages import GANTRY, PROGRAM, still, synthetic
from judge import browser

import olp
from olp.review.job import view
from olp.review.live import Server
from olp.review.page import page as packed

pytestmark = pytest.mark.slow


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
        assert page.evaluate("document.querySelectorAll('#panel-program :is(img, svg, script)').length") == 0
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
        page.evaluate("olp.app.report()")
        assert page.evaluate("window.pwned ?? null") is None
        assert page.evaluate("document.querySelectorAll('#print :is(svg, script)').length") == 0


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
        assert page.evaluate("olp.app.pictures.current.name") == "measured"
        assert page.evaluate("olp.drawn.measured") > 100
        uncorrected, measured = page.evaluate(
            "['uncorrected', 'measured'].map(n => olp.app.metrics.summary(olp.app.distance, n).largest)"
        )
        # across the path the measured points are those of the uncompensated machine
        assert 0.2 * uncorrected < measured < 1.2 * uncorrected
        page.click("#tab-display")
        for name in ("nominal", "rapids", "whiskers"):
            page.evaluate("name => olp.set_layer(name, false)", name)
        page.select_option("#view-six", "top")
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
        assert f"{most['max_um']:.2f}" in page.inner_text("#card")
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
            assert page.evaluate("[olp.app.pictures.exaggeration(), olp.state.metric]") == [432, "y"]
            assert page.evaluate("olp.app.listing.text(olp.app.listing.row_of_line(18), 0)") == "G1 X12"
    finally:
        server.stop()
        thread.join()
