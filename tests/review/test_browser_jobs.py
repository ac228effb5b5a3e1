"""Every shipped job, and a measured one, in the browser: the page says what the report of the job says."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from cases.fast import left_to_a_campaign
from cases.pages import GANTRY, PROGRAM, PROGRAMS, array, colourful, still
from judge import browser

from olp.core.arrays import Array, Index
from olp.core.errors import InputError
from olp.core.units import UM_PER_MM
from olp.review.job import Review, view

pytestmark = pytest.mark.slow

WORDS = {True: "PASS", False: "FAIL", None: "NOT JUDGED"}
UM = "\N{MICRO SIGN}m"
#: um and share: what the proof may miss between two of its samples, which the page may draw.
MISSED_UM, MISSED = 0.1, 0.01
#: um: what is listed is rounded to 0.01.
LISTED_UM = 0.0051
#: Shows a review; returns the page.
Show = Callable[..., Any]
#: program, machine, job, size and theme of the page
JOBS = [
    ("gantry-plate/plate.ngc", "gantry-plate", "job.toml", (1280, 720), "dark"),
    ("gantry-plate/bracket.mpf", "gantry-plate", "job-bracket.toml", (1280, 720), "light"),
    ("heidenhain-plate/flange.h", "gantry-plate", "job.toml", (1024, 640), "dark"),
    ("haas-mill/bracket.nc", "haas-mill", "job.toml", (1600, 1000), "dark"),
    ("haas-mill/manifold.nc", "haas-mill", "job-manifold.toml", (1280, 720), "light"),
    ("table-router/front.ngc", "table-router", "job.toml", (390, 844), "dark"),
    ("table-router/outline.ngc", "table-router", "job-outline.toml", (1280, 720), "light"),
    ("table-router/drill.ngc", "table-router", "job-drill.toml", (1280, 720), "dark"),
    ("bridge-cmm/housing.ngc", "bridge-cmm", "job.toml", (1600, 1000), "light"),
    ("dmis-housing/housing.dmi", "bridge-cmm", "job.toml", (390, 844), "light"),
]
#: folder of short programs with one job file, machine, how many at least are no refusal
SHORT = [("apt-flavours", "gantry-plate", 5), ("nasty", "nasty", 20)]


class Layer(NamedTuple):
    """What the table states of a layer: of each of its lines the deviation, and the part of it that an
    unknown side of the backlash may be; the largest of what counts."""

    line: Index
    um: Array
    side: Array
    largest_um: float | None


@pytest.fixture(scope="module")
def shown(play: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Show]:
    """Shows a review. All are shown by one tab without WebGL: a browser that has read the scripts of a page
    once opens the next one three times as fast."""
    path = tmp_path_factory.mktemp("pages") / "job.html"
    view(PROGRAM, GANTRY, time=False).write(path)
    with (
        browser.launched(play, *browser.WITHOUT_GL) as launched,
        browser.opened(launched, path) as page,
    ):

        def show(review: Review, size: tuple[int, int] = (1280, 720), theme: str = "light") -> Any:
            review.write(path, force=True)
            page.set_viewport_size({"width": size[0], "height": size[1]})
            page.emulate_media(color_scheme=theme)
            page.goto(path.as_uri())
            page.wait_for_selector("html[data-ready],html[data-error]", state="attached")
            assert page.evaluate("olp.manifest.digest") == review.scene.digest
            still(page)
            return page

        yield show


@pytest.mark.parametrize(
    ("program", "machine", "job", "size", "theme"),
    left_to_a_campaign(JOBS, JOBS[:1]),
    ids=[j[0] for j in JOBS],
)
def test_the_page_of_a_shipped_job_says_what_its_report_says(
    shown: Show, program: str, machine: str, job: str, size: tuple[int, int], theme: str
) -> None:
    path = PROGRAMS / program
    review = view(path, PROGRAMS / machine / "machine.toml", path.parent / job, time=False)
    page = shown(review, size, theme)
    assert colourful(browser.picture(page)) > 100
    assert page.evaluate("olp.manifest.title") in page.title()
    origin = np.array(page.evaluate("olp.manifest.origin_mm"))
    assert np.abs(array(page, "P", 3) + origin - review.scene.position_mm).max() <= 0.5e-4 * (1 + 1e-6)
    says_what_its_report_says(page, review)


@pytest.mark.parametrize(("folder", "machine", "least"), SHORT, ids=[s[0] for s in SHORT])
def test_the_pages_of_short_programs_say_what_their_reports_say(
    shown: Show, folder: str, machine: str, least: int
) -> None:
    count = 0
    for path in programs(folder):
        try:
            review = view(path, PROGRAMS / machine / "machine.toml", path.parent / "job.toml", time=False)
        except InputError:
            continue
        count += 1
        says_what_its_report_says(shown(review), review)
    assert count >= least


def test_the_page_of_a_measured_job_says_what_its_report_says(shown: Show, tmp_path: Path) -> None:
    program = tmp_path / "part.ngc"
    program.write_text(
        "G21 G90 G54\nT1 M6\nG43 H1\nG0 X10 Y10 Z20\nG1 Z-2 F600\nX400\nY300\nX10\nY10\nG0 Z20\nM2\n"
    )
    runs = []
    for name, off_um in (("cmm-run.csv", 35.0), ("second.csv", 9.0)):
        along = np.linspace(20.0, 390.0, 40)
        across = 10.01 + 1e-3 * off_um * np.sin(along / 50.0)
        rows = [f"{x:.5f},{y:.6f},-2" for x, y in zip(along, across, strict=True)]
        runs.append(tmp_path / name)
        runs[-1].write_text("\n".join(["# frame=G54", "X_mm,Y_mm,Z_mm", *rows, ""]))
    review = view(program, GANTRY, measured=runs, part_tolerance_um=40.0, time=False)
    page = shown(review)
    figures = page.locator("#statistics").text_content()
    for run in review.scene.report["measured"]["runs"]:
        for key in ("max", "rms"):
            assert f"{run['across_um'][key]:.2f}" in figures
    says_what_its_report_says(page, review)


def programs(folder: str) -> list[Path]:
    return [p for p in sorted((PROGRAMS / folder).iterdir()) if p.suffix not in (".csv", ".toml")]


def layers(review: Review) -> dict[str, Layer]:
    table, lines = review.scene.table, review.scene.table.by_line()
    stated = {
        name: Layer(
            lines["line"],
            lines[f"{name}_um"],
            lines.get(f"{name}_side_um", np.zeros(len(lines["line"]))),
            float(np.nanmax(getattr(table, name)[table.judged], initial=-1.0)) * UM_PER_MM,
        )
        for name in ("uncorrected", "corrected")
    }
    runs = table.measured
    for k in range(0 if runs is None else len(runs.names)):
        own = runs.by_line(k)
        name = f"measured-{k + 1}" if len(runs.names) > 1 else "measured"
        stated[name] = Layer(own["line"], own["measured_um"], np.zeros(len(own["line"])), runs.largest_um(k))
    return stated


def says_what_its_report_says(page: Any, review: Review) -> None:
    stated = layers(review)
    verdict_and_figures(page, review, stated)
    tree(page, review)
    for name, layer in stated.items():
        listing(page, review, name, layer)
    readout(page, review, stated)
    strip(page, stated)


def verdict_and_figures(page: Any, review: Review, stated: dict[str, Layer]) -> None:
    verdict, deviation = review.scene.report["verdict"], review.scene.report["deviation"]
    assert page.inner_text("#verdict") == WORDS[verdict["ok"]]
    card = page.inner_text("#card")
    for question in verdict["questions"]:
        assert re.sub(r"\bum\b", UM, question["sentence"]) in card
    page.click("#tab-display")
    figures = page.inner_text("#statistics")
    for layer in stated.values():
        if layer.largest_um >= 0.0:
            assert listed(layer.largest_um) in card and listed(layer.largest_um) in figures
    if verdict["numerical"] is not None:
        assert listed(verdict["numerical"]["largest_um"]) in card
    for side in ("before", "after"):
        assert listed(deviation[side]["waypoints"]["max_um"]) in figures


def listed(um: float) -> str:
    return "<0.01" if 0.0 < um < 0.005 else f"{um:.2f}"


def tree(page: Any, review: Review) -> None:
    roots = page.evaluate(
        "olp.app.tree.nodes.filter(n => n.parent === null && n.holds !== null)"
        ".map(n => [n.largest_um.uncorrected, n.largest_um.corrected, n.holds])"
    )
    stated = review.scene.report["judgement"]["operations"]
    assert roots == [
        [pytest.approx(row["uncorrected_um"]), pytest.approx(row["corrected_um"]), row["holds"]]
        for row in stated
    ]


def listing(page: Any, review: Review, name: str, layer: Layer) -> None:
    # what is told of a line stands in the row that shows its number
    rows = np.array(
        page.evaluate(
            "lines => lines.map(line => olp.app.listing.numbers[0].indexOf(line))", layer.line.tolist()
        )
    )
    shown = page.evaluate(
        "([n, rows]) => rows.map(row => [olp.app.stated_um(n, row), olp.app.side_um(n, row)])",
        [name, rows.tolist()],
    )
    stated, side = np.array(shown, float).T
    assert stated == pytest.approx(layer.um, abs=LISTED_UM, nan_ok=True)
    assert side == pytest.approx(layer.side, abs=LISTED_UM)
    page.evaluate("n => olp.show_picture(olp.app.pictures.list.findIndex(p => p.name === n))", name)
    worst = page.evaluate("olp.worst()")
    if worst is None:
        assert not layer.um.size or np.nanmax(layer.um) < LISTED_UM
        return
    at = int(np.flatnonzero(rows == worst["row"])[0])
    assert worst["value"] == pytest.approx(layer.um[at], abs=LISTED_UM)
    if layer.largest_um >= 0.0:
        assert worst["value"] == pytest.approx(layer.largest_um, abs=LISTED_UM)


def readout(page: Any, review: Review, stated: dict[str, Layer]) -> None:
    for name, layer in stated.items():
        page.evaluate("n => olp.show_picture(olp.app.pictures.list.findIndex(p => p.name === n))", name)
        page.evaluate("olp.app.state.worst = -1")
        worst = page.evaluate("olp.worst()")
        if worst is None:
            continue
        line = page.evaluate("row => olp.app.listing.numbers[0][row]", worst["row"])
        at = int(np.flatnonzero(layer.line == line)[0])
        label = page.evaluate("n => olp.app.pictures.of_layer(n).label", name)
        head = page.get_by_role("rowheader", name=f"{label}, {UM}", exact=True)
        cells = page.locator("#readout tr").filter(has=head).locator("td").all_text_contents()
        *_, here, stated_there = cells
        assert stated_there == listed(layer.um[at])
        assert float(here.replace("<", "")) <= layer.um[at] + MISSED_UM + MISSED * layer.um[at]
        told = page.locator("#readout td.side").all_inner_texts()
        assert told == [] if layer.side[at] < 0.005 else listed(layer.side[at]) in told[0]


def strip(page: Any, stated: dict[str, Layer]) -> None:
    """The highest of each picture is the largest deviation that the report states, without what an unknown
    side of the backlash may be of it."""
    page.select_option("#strip", "pictures")
    highest = page.evaluate(
        "olp.app.plots.strip.lanes.map(l => l.series[0].y.reduce((most, v) => (v > most ? v : most), 0))"
    )
    counted = page.evaluate(
        "Object.fromEntries(Object.entries(olp.manifest.listing.by_layer).map(([n, o]) =>"
        " [n, Array.from(olp.arrays.get(o.state)).filter(s => s < 3)]))"
    )
    for (name, layer), drawn in zip(stated.items(), highest, strict=True):
        size = (layer.um - layer.side)[np.array(counted[name]) < (3 if name.startswith("measured") else 2)]
        most = float(np.nanmax(size, initial=0.0))
        assert drawn == pytest.approx(most, abs=MISSED_UM, rel=MISSED), name
