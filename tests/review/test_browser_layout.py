"""Views, themes, keys, sizes of screen, names for readers of the screen, links and saved pages."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.pages import array, colourful, middle_of_moves, still
from judge import browser

from olp.review.job import Review

pytestmark = pytest.mark.slow


def test_standard_views_show_the_whole_path(page: Any, review: Review) -> None:
    box = page.locator("#pane").bounding_box()
    corners = middle_of_moves(review)
    for ortho in (True, False):
        assert page.get_attribute("#ortho", "aria-pressed") == str(ortho).lower()
        for key, name in enumerate(("iso", "top", "bottom", "front", "back", "left", "right"), start=1):
            page.locator("#listing").focus()
            page.keyboard.press(str(key))
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
    page.locator("#play").focus()
    page.keyboard.press("p")
    assert page.is_hidden("#plots") and page.get_attribute("#toggle-plots", "aria-expanded") == "false"
    page.keyboard.press("p")
    assert page.is_visible("#plots")
    for key, panel in (("[", "parts"), ("\\", "display"), ("n", "findings")):
        page.locator("#play").focus()
        page.keyboard.press(key)
        assert page.is_visible(f"#panel-{panel}") and page.is_visible("#panel-program")
        assert page.get_attribute(f"#tab-{panel}", "aria-selected") == "true"
    position = page.evaluate("olp.app.camera.save().position")
    page.locator("#pane").focus()
    page.keyboard.press("Shift+ArrowLeft")
    assert page.evaluate("olp.app.camera.save().position") != position
    zoom = page.evaluate("olp.app.camera.save().zoom")
    page.keyboard.press("PageUp")
    assert page.evaluate("olp.app.camera.save().zoom") == pytest.approx(1.25 * zoom)
    page.keyboard.press("/")
    assert page.evaluate("document.activeElement.id") == "find"
    page.keyboard.type("w1")
    assert page.input_value("#find").endswith("w1") and page.evaluate("olp.state.worst") == -1


SIZES = [(390, 844), (768, 1024), (1024, 640), (1280, 720), (1440, 900), (1920, 1080), (3840, 2160)]


@pytest.mark.parametrize("size", SIZES, ids="{0[0]}x{0[1]}".format)
def test_nothing_overlaps_or_leaves_the_window(chromium: Any, file: Path, size: tuple[int, int]) -> None:
    with browser.opened(chromium, file, size=size) as page:
        width, height = page.evaluate("[document.body.scrollWidth, document.body.scrollHeight]")
        assert width == size[0]
        assert height == size[1] or size[0] < 900
        page.evaluate("olp.set_time(olp.app.end / 2)")
        for group in (
            "#bar > *",
            "#timeline > *",
            "#tools > *",
            "#switch, #views, #readout",
            "#app > *",
        ):
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
        assert pane["width"] > 0.4 * size[0] and pane["height"] > 0.42 * size[1]
        # what is always to be seen
        for always in ("#verdict", "#card", "#legend", "#pictures"):
            assert page.is_visible(always), always
        legend, view = (page.locator(box).bounding_box() for box in ("#legend", "#view"))
        assert legend["y"] >= view["y"] + view["height"] - 0.5


@pytest.mark.parametrize("size", [(390, 844), (1024, 640)])
def test_every_panel_is_reached_on_a_small_screen(chromium: Any, file: Path, size: tuple[int, int]) -> None:
    with browser.opened(chromium, file, size=size) as page:
        for name in ("parts", "program", "display", "findings"):
            page.click(f"#tab-{name}")
            assert page.is_visible(f"#panel-{name}")
            assert page.locator(".panel:visible").count() == 1
        page.click("#tab-program")
        assert page.locator(".row:visible").count() >= 4
        assert page.evaluate("document.body.scrollWidth") == size[0]


def test_a_phone_has_the_readout_below_the_picture(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file, size=(390, 844)) as page:
        assert page.is_hidden("#readout")
        before = page.locator("#pane").bounding_box()
        page.evaluate("olp.set_time(olp.app.end / 2)")
        readout, pane, legend = (page.locator(box).bounding_box() for box in ("#readout", "#pane", "#legend"))
        assert pane == before
        assert readout["y"] >= pane["y"] + pane["height"] - 0.5
        assert legend["y"] >= readout["y"] + readout["height"] - 0.5
        assert page.evaluate("document.body.scrollWidth") == 390
        overlay = page.locator("#overlay").bounding_box()
        assert (overlay["width"], overlay["height"]) == (pane["width"], pane["height"])


CHOICES = """k => {
  const {host, over} = olp.app.plots.charts[k], bottom = e => e.getBoundingClientRect().bottom;
  return [bottom(host.querySelector(".choices")) - host.getBoundingClientRect().top, over];
}"""


@pytest.mark.parametrize("size", [(390, 844), (1024, 640), (1440, 900)])
def test_numbers_of_a_chart_are_apart_and_nothing_covers_it(
    chromium: Any, file: Path, size: tuple[int, int]
) -> None:
    with browser.opened(chromium, file, size=size) as page:
        for strip in ("frame", "pictures"):
            page.select_option("#strip", strip)
            for chart in range(2):
                written = np.sort(page.evaluate("k => olp.app.plots.charts[k].written", chart))
                assert len(written) >= 2 and np.diff(written).min() >= 11.0
                choices, top = page.evaluate(CHOICES, chart)
                assert choices <= top + 0.5


def test_a_scale_has_two_numbers_or_more(page: Any) -> None:
    ends = [(low, low + span) for low in (-1.0, -0.38, 0.0, 2.7) for span in (1e-3, 0.74, 1.0, 1.9, 9.9, 4e4)]
    for low, high in ends:
        for count in (1, 2, 3, 7):
            shown = page.evaluate("a => OLP.colour.ticks(...a)", [low, high, count])
            assert len(shown) >= 2, (low, high, count)
            step = shown[1] - shown[0]
            assert np.diff(shown) == pytest.approx(step)
            assert low - 1e-6 * step <= shown[0] < low + step
            assert high - step < shown[-1] <= high + 1e-6 * step
            assert f"{step:.0e}"[0] in "125"


def test_a_text_that_has_no_room_is_cut_and_not_squeezed(page: Any) -> None:
    for text in ("measured: a very long name of a run.csv", "short"):
        shown, wide = page.evaluate(
            "text => { const c = olp.app.legend.canvas.getContext('2d'); const s = OLP.fitted(c, text, 90);"
            " return [s, c.measureText(s).width]; }",
            text,
        )
        assert wide <= 90
        assert shown == text or (shown.endswith("…") and text.startswith(shown[:-1]) and len(shown) > 5)


def test_no_label_hides_the_tool(page: Any) -> None:
    boxes = page.evaluate(
        """() => {
          const {overlay, samples} = olp.app, out = [];
          for (let k = 0; k < 60; k++) {
            olp.app.set_sample(Math.floor((k * samples) / 60));
            overlay.show();
            out.push([overlay.taken.at(-1), overlay.at(olp.app.tool_point())]);
          }
          return out;
        }"""
    )
    for (left, top, right, bottom), (x, y) in boxes:
        assert right - left > 100, "the label of the flag"
        assert x + 9 < left or x - 9 > right or y + 9 < top or y - 9 > bottom


def test_the_page_opens_at_the_first_point(page: Any) -> None:
    assert page.evaluate("[olp.state.sample_at, olp.state.row]") == [0, page.evaluate("olp.app.rows[0]")]
    assert page.is_hidden("#readout")


@pytest.mark.parametrize("width", [1200, 1440, 1920])
def test_the_listing_shows_whole_words(chromium: Any, file: Path, width: int) -> None:
    with browser.opened(chromium, file, size=(width, 900)) as page:
        page.evaluate("olp.app.listing.scroll_to(9)")
        rows = page.evaluate(
            "[...document.querySelectorAll('.row')].filter(r => !r.hidden).map(r => [+r.dataset.row,"
            " ...[1, 3].map(k => r.children[k]).map(c => [c.textContent, c.scrollWidth <= c.clientWidth])])"
        )
        assert len(rows) > 8
        for row, *cells in rows:
            for side, (text, fits) in enumerate(cells):
                whole = page.evaluate("([r, s]) => olp.app.listing.text(r, s)", [row, side])
                assert fits, text
                if text != whole:
                    assert text.endswith(" …") and whole.startswith(text[:-2])
                    assert whole[len(text) - 2] in " ,", (text, whole)


def test_all_that_acts_has_a_name_and_a_state(page: Any) -> None:
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, textarea, [role]")]
          .filter(e => !e.closest(".dg") && !e.hidden)
          .filter(e => !["presentation", "status", "group"].includes(e.getAttribute("role")))
          .filter(e => !(e.getAttribute("aria-label") || e.getAttribute("aria-labelledby") || e.labels?.length
            || e.textContent.trim() || e.title))
          .map(e => e.outerHTML.slice(0, 120))"""
    )
    assert nameless == []
    assert page.get_attribute("#pane", "aria-label").startswith(
        "Picture corrected: the largest deviation is "
    )
    assert page.locator("canvas[role=img]:not([aria-label])").count() == 0
    assert page.locator("[role=tab][aria-selected=true]").count() == 1
    assert page.locator("[role=radio][aria-checked=true]").count() == 1
    # the order of the keyboard is that of the page
    seen = []
    page.locator("#measure").focus()
    for _ in range(14):
        seen.append(page.evaluate("document.activeElement.id || document.activeElement.className"))
        page.keyboard.press("Tab")
    assert seen[:8] == [
        "measure",
        "callout",
        "picture",
        "print-report",
        "share",
        "save",
        "theme",
        "help-open",
    ]


def test_notes_survive_in_the_saved_file(chromium: Any, file: Path, tmp_path: Path) -> None:
    text = 'scratch here </script><script>window.pwned = 1</script> & "so" — ½ µm'
    with browser.opened(chromium, file) as page:
        page.evaluate("olp.set_time(3)")
        page.click("#callout")
        page.fill("#note-text", text)
        page.click("#note button.primary")
        browser.until(page, "document.querySelectorAll('#notes .note').length === 1")
        notes = page.evaluate("olp.state.notes")
        assert notes[-1]["text"] == text
        with page.expect_download() as download:
            page.click("#save")
        download.value.save_as(tmp_path / "kept.html")
        positions = array(page, "P")
    with browser.opened(chromium, tmp_path / "kept.html") as page:
        assert page.evaluate("olp.state.notes") == notes
        page.click("#tab-findings")
        assert text in page.inner_text("#notes")
        assert page.evaluate("window.pwned ?? null") is None
        assert np.array_equal(array(page, "P"), positions)
        again = page.evaluate("olp.app.notes.html()")
    kept = (tmp_path / "kept.html").read_text(encoding="utf-8")
    assert again == kept
    with browser.opened(chromium, tmp_path / "kept.html") as page:
        page.click("#tab-findings")
        page.locator("#notes .note button.icon").last.click()
        assert page.evaluate("olp.state.notes") == notes[:-1]


def test_a_view_can_be_sent_in_the_address(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file) as page:
        page.evaluate(
            "() => { olp.set_exaggeration(321); olp.set_metric('y'); olp.set_layer('command', true);"
            " olp.set_time(4.5); olp.app.set_view('front'); olp.app.set_theme('dark');"
            " olp.show_picture(0.25); olp.app.pictures.set_basis('display', 7);"
            " olp.app.display.set_section({axis: 'Y', at: 100, flip: true});"
            " olp.app.plots.set_strip('axes'); }"
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
            assert page.evaluate("olp.app.pictures.exaggeration()") != 321


WRONG: list[Any] = [
    None, 7, "x", [], {"picture": "no"},
    {"picture": 1e9, "metric": "none", "theme": 5, "layers": {"x": 1, "__proto__": 2}},
    {"time": "late", "chosen": [[5, 1], [-3, 4], ["a", "b"], 9]},
    {"notes": [None, {"sample": -1}, {"sample": 3, "text": 5}]},
    {"camera": {"position": [0, 0], "target": "x", "half": -1, "zoom": 0}},
    {"camera": {"position": [1, 2, 3], "target": [1, 2, 3], "half": 1, "zoom": 1}},
    {"enlargement": [-5, "x", 1e99, 3], "basis": "other", "display_um": -4, "same": "yes", "strip": "none"},
    {"section": {"axis": "Q", "at": "x", "flip": 3}}, {"section": {"axis": "X", "at": None}},
]  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_a_view_with_wrong_values_opens_the_page(chromium: Any, file: Path, wrong: Any) -> None:
    text = base64.urlsafe_b64encode(json.dumps(wrong).encode()).decode().rstrip("=")
    with browser.opened(chromium, file, view=f"#view={text}") as page:
        still(page)
        assert colourful(browser.picture(page)) > 500
        factors = page.evaluate("olp.app.pictures.list.map(p => olp.app.pictures.exaggeration(p))")
        assert all(1 <= k <= 1e5 for k in factors)
        assert page.evaluate("olp.app.pictures.at") in (0, 1)


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
        page.select_option("#view-six", "top")
        page.evaluate("() => { for (const n of Object.keys(olp.state.layers)) olp.set_layer(n, false); }")
        page.evaluate("() => { olp.app.choose([]); olp.app.display.set_section({axis: 'X', at: -1e6}); }")
        still(page)
        assert colourful(browser.picture(page)) < before / 2
