"""What the browser unpacks is what was packed, and what the proof says."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.pages import GANTRY, PROGRAM, array, colourful, still
from judge import browser

import olp
from olp.review.job import Review, view

pytestmark = pytest.mark.slow


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
        page.click("#tab-findings")
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


PARTS = ("magnitude", "x", "y", "z", "along", "normal", "binormal", "across")


def parts_of(review: Review, delta: np.ndarray) -> dict[str, np.ndarray]:
    position = review.scene.position_mm
    step = np.diff(position, axis=0, prepend=np.nan)
    waypoint = review.scene.waypoint
    for i in np.flatnonzero(~waypoint[1:-1]) + 1:
        step[i] = position[i + 1] - position[i - 1]
    length = np.linalg.norm(step, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = np.einsum("ij,ij->i", delta, step) / length
        unit = step / length[:, None]
        left = np.cross([0.0, 0.0, 1.0], unit)
        side = left / np.linalg.norm(left, axis=1)[:, None]
        side[np.linalg.norm(left, axis=1) < 1e-6] = [0.0, 1.0, 0.0]
    normal = np.einsum("ij,ij->i", delta, side)
    binormal = np.einsum("ij,ij->i", delta, np.cross(unit, side))
    across = np.linalg.norm(delta - along[:, None] * unit, axis=1)
    assert np.allclose(np.hypot(normal, binormal)[1:], across[1:], equal_nan=True)
    # what counts: at waypoints the distance from the nominal point, between them that from the path of the
    # move, from its end where the tip is beyond it, and from its start where it is behind
    distance = np.where(waypoint, np.linalg.norm(delta, axis=1), across)
    share = review.scene.samples.share
    for i in np.flatnonzero(~waypoint[1:-1]) + 1:
        to_end = np.linalg.norm(position[i + 1] - position[i]) if waypoint[i + 1] else np.inf
        from_start = np.linalg.norm(position[i] - position[i - 1]) if share[i - 1] in (0.0, 1.0) else np.inf
        beyond = max(along[i] - to_end, -along[i] - from_start, 0.0)
        distance[i] = np.hypot(across[i], beyond)
    parts = (distance, *delta.T, along, normal, binormal, across)
    return dict(zip(PARTS, parts, strict=True))


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
            # the direction of the shortest steps is known to their rounding only, and so is their length
            off = np.abs(shown - 1e3 * truth)[known]
            assert off.max() < (0.1 if name == PARTS[0] else 0.01) and (off < 0.01).mean() > 0.99


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
        page.click("#tab-display")
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
            browser.until(page, "!olp.app.legend.waiting")
            assert page.get_attribute("#legend-canvas", "aria-label").startswith(
                "corrected: "
                + ("uncertainty (k = 2), µm" if name == "band" else "probability beyond 8 µm, %")
            )
            assert colourful(browser.picture(page)) > 200


def test_statistics_are_those_of_the_proof(page: Any, review: Review) -> None:
    page.click("#tab-display")
    shown = page.locator("#statistics table").first.inner_text()
    proof = review.scene.report["deviation"]
    largest = review.scene.report["verdict"]["numerical"]["largest_um"]
    for value in (largest, proof["before"]["between"]["rms_um"], proof["after"]["waypoints"]["max_um"]):
        assert f"{value:.2f}" in shown
    allowed = review.scene.report["verdict"]["numerical"]["allowed_um"]
    page.select_option("#strip", "pictures")
    limits = page.evaluate("olp.app.plots.strip.lanes.map(lane => lane.limits.map(l => l.value))")
    assert limits == [[allowed], [allowed]]
