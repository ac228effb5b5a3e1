"""The pictures: bands, flags, whiskers, blending, sections. Colours say what the table of judgements says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.pages import array, colourful, middle_of_moves, still
from judge import browser

from olp.review.job import Review
from olp.review.palette import COLOURS, bands, colours

pytestmark = pytest.mark.slow


def test_layers_come_and_go(page: Any) -> None:
    still(page)
    before = colourful(browser.picture(page))
    assert before > 500
    drawn = page.evaluate("olp.drawn")
    assert drawn["nominal"] > 0 and drawn["corrected"] > 0
    assert drawn["command"] == drawn["uncorrected"] == 0
    page.click("#tab-display")
    for name in ("nominal", "whiskers", "rapids", "tool"):
        page.uncheck(f"#layer-{name}")
    still(page)
    assert page.evaluate("olp.drawn.nominal") == 0
    # whiskers are drawn with their path
    assert 0 < page.evaluate("olp.drawn.corrected") < drawn["corrected"]
    page.check("#layer-command")
    still(page)
    assert page.evaluate("olp.drawn.command") > 0


def test_what_is_drawn_is_base_plus_k_times_deviation(page: Any, review: Review) -> None:
    sample = middle_of_moves(review)[3]
    delta = review.scene.samples.uncorrected[sample]

    def offset(k: float) -> np.ndarray:
        page.evaluate("k => { olp.show_picture(0); olp.set_exaggeration(k); }", k)
        ends = [page.evaluate("a => olp.project(...a)", [sample, n]) for n in ("uncorrected", "nominal")]
        return np.subtract(*ends)

    page.select_option("#view-six", "top")
    scale = page.evaluate("olp.app.scene.view(0).scale")
    one, ten = offset(100.0), offset(1000.0)
    assert np.allclose(ten, 10 * one, rtol=1e-6, atol=1e-6)
    assert np.allclose(ten, 1000 * scale * delta[:2] * [1, -1], rtol=2e-3, atol=0.05)


def test_exaggeration_takes_numbers_as_people_write_them(page: Any) -> None:
    page.click("#tab-display")
    for text, value in (("1,234", 1234), ("×250", 250), ("7e9", 1e5), ("0.2", 1), ("12.5", 12.5)):
        page.fill("#exaggeration", text)
        page.press("#exaggeration", "Enter")
        assert page.evaluate("olp.app.pictures.exaggeration()") == value
    page.evaluate("olp.set_exaggeration(1000)")
    assert float(page.input_value("#exaggeration-slider")) == pytest.approx(3.0)
    page.keyboard.press("Escape")
    page.locator("#listing").focus()
    page.keyboard.press("+")
    assert page.evaluate("olp.app.pictures.exaggeration()") == 2000
    page.keyboard.press("-")
    page.keyboard.press("-")
    assert page.evaluate("olp.app.pictures.exaggeration()") == 500


def test_at_first_the_largest_deviation_is_a_small_share_of_the_job(page: Any, review: Review) -> None:
    scene = review.scene
    feed = scene.nominal.toolpath.kind[scene.samples.move] != 0
    size = np.linalg.norm(np.ptp(scene.position_mm[feed], axis=0))
    stated = {p["name"]: p["largest_um"] for p in page.evaluate("olp.manifest.pictures")}
    for name, delta in (("uncorrected", scene.samples.uncorrected), ("corrected", scene.samples.corrected)):
        k = page.evaluate("n => olp.app.pictures.exaggeration(olp.app.pictures.of_layer(n))", name)
        most = max(np.linalg.norm(delta[feed], axis=1).max(), stated[name] * 1e-3)
        # each picture has its own
        assert 0.01 < k * most / size <= 0.031


def scale_of(page: Any, name: str) -> dict[str, Any]:
    """Edges, colours and unit of the bands of a picture."""
    return dict(page.evaluate("n => olp.app.pictures.list.find(p => p.name === n).scale", name))


def test_bands_and_colours_are_those_of_the_palette(page: Any) -> None:
    """The page and live views have one palette and one rule, written twice."""
    cases = [
        (largest, tolerance)
        for tolerance in (None, 1.0, 1.87, 20.0)
        for largest in (
            0.0,
            1e-7,
            0.004,
            0.3,
            0.999,
            1.0,
            1.87,
            1.8700000001,
            2.0,
            4.2,
            20.0,
            51.2,
            1e3,
            7.7e5,
        )
    ]
    shown = page.evaluate(
        "cases => cases.map(([l, t]) => { const e = OLP.colour.bands(l, t);"
        " return [e, OLP.colour.shades(e, t, olp.manifest.palette.dark)]; })",
        cases,
    )
    for (largest, tolerance), (edges, shades) in zip(cases, shown, strict=True):
        expected = bands(largest, tolerance)
        assert edges == pytest.approx(expected, rel=1e-12)
        assert shades == colours(expected, tolerance, "dark")
    # of nothing the bands go to what is allowed, and not to a millionth of it
    assert bands(0.0, 1.87)[-1] == pytest.approx(1.87)


def test_each_picture_has_bands_in_units_of_what_it_is_judged_by(page: Any, review: Review) -> None:
    allowed = review.scene.report["verdict"]["numerical"]["allowed_um"]
    pictures = {p["name"]: p for p in page.evaluate("olp.manifest.pictures")}
    for name in ("uncorrected", "corrected"):
        scale = scale_of(page, name)
        largest = pictures[name]["largest_um"]
        shown = page.evaluate("n => olp.app.metrics.summary(olp.app.distance, n).largest", name)
        assert scale["tolerance"] == allowed
        assert scale["edges"] == pytest.approx(bands(max(largest, shown), allowed))
        assert scale["shades"] == colours(scale["edges"], allowed, "light")
        lines = page.evaluate(
            "n => { const u = olp.app.scene.lines.get(n).uniforms; return [u.bands.value,"
            " Array.from(u.edges.value), u.shades.value.map(c => '#' + c.getHexString())]; }", name,
        )  # fmt: skip
        count = len(scale["shades"])
        assert lines[0] == count
        assert lines[1][:count] == pytest.approx(scale["edges"][1:], rel=1e-6)
        assert lines[2][:count] == scale["shades"]


def test_a_display_tolerance_changes_colours_and_nothing_else(page: Any) -> None:
    said = [page.inner_text(box) for box in ("#card", "#verdict")]
    rows = page.evaluate("Array.from(olp.arrays.get(olp.manifest.listing.state))")
    flags = page.evaluate("olp.app.pictures.list.map(p => p.flag)")
    page.click("#tab-display")
    page.fill("#display-um", "7,5".replace(",", "."))
    page.press("#display-um", "Enter")
    assert page.input_value("#basis") == "display"
    scale = scale_of(page, "corrected")
    assert scale["tolerance"] == 7.5
    browser.until(page, "!olp.app.legend.waiting")
    assert "display tolerance, colours only" in page.get_attribute("#legend-canvas", "aria-label")
    assert [page.inner_text(box) for box in ("#card", "#verdict")] == said
    assert page.evaluate("Array.from(olp.arrays.get(olp.manifest.listing.state))") == rows
    assert page.evaluate("olp.app.pictures.list.map(p => p.flag)") == flags
    for wrong in ("-3", "nothing", ""):
        page.fill("#display-um", wrong)
        page.press("#display-um", "Enter")
        assert page.evaluate("olp.app.pictures.basis") == "own"


def test_signed_parts_have_bands_about_zero_and_no_tolerance(page: Any) -> None:
    page.click("#tab-display")
    page.select_option("#metric", "z")
    scale = scale_of(page, "uncorrected")
    assert scale["tolerance"] is None
    assert scale["edges"] == pytest.approx([-edge for edge in reversed(scale["edges"])])
    minus, plus = scale["shades"][: len(scale["shades"]) // 2], scale["shades"][len(scale["shades"]) // 2 :]
    assert set(minus) <= set(COLOURS["light"]["minus"]) and set(plus) <= set(COLOURS["light"]["open"])
    assert page.is_disabled("#display-um")


def test_pictures_switch_and_blend(page: Any) -> None:
    def opacity() -> list[float]:
        return list(page.evaluate(
            "['uncorrected', 'corrected'].map(n => olp.app.layers.get(n).visible"
            " ? olp.app.scene.lines.get(n).uniforms.opacity.value : 0)"
        ))  # fmt: skip

    assert opacity() == [0, 1]
    assert page.get_attribute("#picture-corrected", "aria-checked") == "true"
    page.click("#picture-uncorrected")
    assert opacity() == [1, 0]
    page.evaluate("b => { b = document.getElementById('blend'); b.value = 0.25; b.oninput({target: b}); }")
    first, second = opacity()
    assert first > second > 0
    page.locator("#listing").focus()
    page.keyboard.press("e")
    assert opacity() == [0, 1]
    page.keyboard.press("b")
    assert opacity() == [1, 0]
    page.keyboard.press("b")
    assert all(value > 0 for value in opacity())


def test_layers_tell_themselves_apart_by_style(page: Any) -> None:
    styles = page.evaluate("olp.manifest.layers.map(l => [l.width, ...l.dashes])")
    assert len({tuple(style) for style in styles}) == len(styles)


def test_the_flag_is_the_worst_place_of_the_table(page: Any, review: Review) -> None:
    table, path = review.scene.table, review.scene.nominal.toolpath
    for name, values in (("uncorrected", table.uncorrected), ("corrected", table.corrected)):
        flag = page.evaluate("n => olp.app.pictures.list.find(p => p.name === n).flag", name)
        move = int(np.where(table.judged, np.nan_to_num(values), -1).argmax())
        assert flag["um"] == pytest.approx(1e3 * float(values[move]))
        assert flag["line"] == str(path.line[move])
        assert review.scene.samples.move[flag["sample"]] == move
        delta = getattr(review.scene.samples, name)[flag["sample"]]
        assert flag["direction"] == pytest.approx((delta / np.linalg.norm(delta)).tolist(), abs=1e-4)
        assert (
            page.evaluate("n => olp.app.pictures.list.find(p => p.name === n).largest_um", name) == flag["um"]
        )
    page.click("#card button.line >> nth=1")
    assert page.evaluate("olp.state.sample") == flag["sample"]


def test_the_readout_says_what_the_table_states_of_the_line(page: Any, review: Review) -> None:
    table = review.scene.table.by_line()
    for sample in middle_of_moves(review):
        line = int(review.scene.nominal.toolpath.line[review.scene.samples.move[sample]])
        at = int(np.searchsorted(table["line"], line))
        page.evaluate("sample => olp.app.set_sample(sample)", sample)
        heads, _, *rows = page.locator("#readout tr").all()
        assert heads.locator("th").first.inner_text() == f"line {line}"
        for row, layer in zip(rows, ("uncorrected", "corrected"), strict=True):
            here, stated = row.locator("td").all_inner_texts()[-2:]
            assert row.locator("th").inner_text() == f"{layer}, µm"
            assert stated == f"{table[f'{layer}_um'][at]:.2f}"
            # of a move alone on its line, no point is farther off
            assert float(here) <= float(stated) + 0.011


def test_whiskers_lead_from_the_nominal_path(page: Any) -> None:
    still(page)
    found = page.evaluate(
        """() => {
          const path = olp.app.layers.get("corrected"), b = path.buffer, step = 4 * OLP.FLOATS, out = [];
          for (let i = 0; i < path.drawn; i++)
            if (b[i * step + 15] === OLP.WHISKER) out.push(Array.from(b.slice(i * step, i * step + 16)));
          return [out, olp.app.scene.origin, Array.from(path.P), Array.from(path.D)];
        }"""
    )
    whiskers, origin, base, delta = found[0], *(np.array(v) for v in found[1:])
    base, delta = base.reshape(-1, 3), delta.reshape(-1, 3)
    assert 20 < len(whiskers) <= 2500
    for whisker in whiskers:
        sample = int(whisker[14])
        assert whisker[0:3] == whisker[3:6] == pytest.approx((base[sample] - origin).tolist(), abs=1e-3)
        assert whisker[6:9] == [0, 0, 0]
        assert whisker[9:12] == pytest.approx(delta[sample].tolist(), rel=1e-5, abs=1e-9)


def test_a_section_leaves_out_what_is_beyond(page: Any, review: Review) -> None:
    page.click("#tab-display")
    page.select_option("#view-six", "top")
    page.select_option("#section-axis", "X")
    page.fill("#section-at", "200")
    page.press("#section-at", "Enter")
    still(page)
    x = review.scene.position_mm[:, 0]
    feed = review.scene.nominal.toolpath.kind[review.scene.samples.move] != 0
    for sample in np.flatnonzero(feed)[20::97].tolist():
        if abs(x[sample] - 200) < 12:
            continue
        hit = page.evaluate(
            "s => olp.app.scene.pick(...olp.app.scene.project(olp.app.point_of(s, 'nominal')))", sample
        )
        assert (hit is not None) == (x[sample] < 200), x[sample]
    left = colourful(browser.picture(page, "#view"))
    page.click("#section-flip")
    still(page)
    assert page.evaluate("olp.app.scene.plane") == [
        -1,
        0,
        0,
        pytest.approx(-200 + page.evaluate("olp.manifest.origin_mm[0]")),
    ]
    page.select_option("#section-axis", "")
    still(page)
    assert page.evaluate("olp.app.scene.plane") is None
    assert colourful(browser.picture(page, "#view")) > left


def test_pass_and_fail_are_the_states_of_the_table(page: Any, review: Review) -> None:
    page.click("#tab-display")
    page.select_option("#metric", "state")
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
    within, above = scale_of(page, "corrected")["shades"]
    assert within in COLOURS["light"]["within"] and above in COLOURS["light"]["above"]


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2 of a colour #rrggbb."""
    value = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(a: str, b: str) -> float:
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_words_and_lines_have_the_contrast_of_wcag_aa(chromium: Any, file: Path, theme: str) -> None:
    with browser.opened(chromium, file, theme=theme) as page:
        names = ("ink", "soft", "panel", "raised", "ground", "hover", "mark", "scene-high", "scene-low",
                 "rapid", "nominal", "pass", "pass-ground", "fail", "fail-ground")  # fmt: skip
        colour = page.evaluate(
            "names => { const s = getComputedStyle(document.documentElement);"
            " return Object.fromEntries(names.map(n => [n, s.getPropertyValue('--' + n).trim()])); }", names,
        )  # fmt: skip
    for ground in ("panel", "raised", "ground", "hover", "mark", "scene-high", "scene-low"):
        assert contrast(colour["ink"], colour[ground]) >= 7, ground
        assert contrast(colour["soft"], colour[ground]) >= 4.5, ground
    for word in ("pass", "fail"):
        assert contrast(colour[word], colour[f"{word}-ground"]) >= 4.5
        assert contrast(colour[word], colour["panel"]) >= 4.5
    for ground in ("scene-high", "scene-low"):
        for line in ("rapid", "nominal"):
            assert contrast(colour[line], colour[ground]) >= 3, (line, ground)
        for family in COLOURS[theme].values():  # type: ignore[index]
            assert min(contrast(shade, colour[ground]) for shade in family) >= 3


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_colours_grow_in_contrast_and_families_do_not_meet(theme: Any) -> None:
    ground = {"light": "#fafbfd", "dark": "#1a222b"}[theme]
    for family in COLOURS[theme].values():
        sizes = [contrast(shade, ground) for shade in family]
        assert sizes == sorted(sizes)
    # one meaning per colour
    every = [shade for family in COLOURS[theme].values() for shade in family]
    assert len(set(every)) == len(every)
