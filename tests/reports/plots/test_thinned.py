"""Figures of a path: what they keep of points that come in parts."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import olp
from olp.comparison.figures import Run
from olp.comparison.nominal import nominal_of
from olp.comparison.pairing import Pairing, beside, pair
from olp.comparison.path import Path
from olp.core.progress import silent
from olp.files.config import load_job
from olp.proof import deviation
from olp.proof.deviation import Tracer
from olp.reports.plots import thinned
from olp.reports.plots.thinned import COLUMNS, EDGES_UM, FLOOR_UM, Canvas, Thinned, painted, widened
from olp.workflows import report
from olp.workflows.correct import CorrectOptions
from olp.workflows.correct import run as correct
from olp.workflows.session import opened

PROGRAMS = FilePath(__file__).resolve().parents[3] / "programs"


def wavy(count: int) -> Path:
    u = np.linspace(0.0, 9.0, count)
    return Path.through(np.column_stack((50.0 * u, 40.0 * np.sin(u), 0.0 * u)))


def measured(path: Path, count: int, seed: int = 1) -> Run:
    rng = np.random.default_rng(seed)
    points = path.at(np.linspace(0.0, path.length_mm, count))[0] + rng.normal(0.0, 0.004, (count, 3))
    return Run.of("run", path, points, pair(path, points, "forward"), 1.0)


def parts(run: Run, cuts: list[int]) -> list[Run]:
    """The same points in several runs."""
    edges = [0, *sorted(cuts), len(run.points_mm)]
    columns = ("points_mm", "nominal_mm", "stop", "size_mm", "good", "counted")
    return [
        Run(
            name="",
            pairing=Pairing(*(getattr(run.pairing, k)[a:b] for k in Pairing.__slots__)),
            deviation=run.deviation, **{k: getattr(run, k)[a:b] for k in columns},
        )
        for a, b in pairwise(edges)
    ]  # fmt: skip


@pytest.mark.slow
def test_columns_counts_and_pixels_are_those_of_all_points() -> None:
    path = wavy(60)
    run = measured(path, 5000)
    group = Thinned(path, Canvas(path))
    group.add(run)
    size = np.maximum(run.size_mm[run.counted] * 1e3, FLOOR_UM)
    column = np.minimum(run.pairing.s_mm[run.counted] / path.length_mm * COLUMNS, COLUMNS - 1).astype(int)
    for k in range(COLUMNS):
        own = size[column == k]
        assert np.array_equal(group.high[k], own.max() if len(own) else np.nan, equal_nan=True)
        assert np.array_equal(group.low[k], own.min() if len(own) else np.nan, equal_nan=True)
    assert group.points == len(size)
    assert np.abs(np.cumsum(group.count) - np.searchsorted(np.sort(size), EDGES_UM[1:])).max() <= 1
    assert group.largest_um == size.max()


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(st.lists(st.integers(1, 399), max_size=4))
def test_points_in_parts_make_the_figure_of_all_at_once(cuts: list[int]) -> None:
    path = wavy(60)
    run = measured(path, 400)
    whole, other = Thinned(path, Canvas(path)), Thinned(path, Canvas(path))
    whole.add(run)
    for part in parts(run, cuts):
        other.add(part)
    assert np.array_equal(whole.low, other.low, equal_nan=True)
    assert np.array_equal(whole.high, other.high, equal_nan=True)
    assert np.array_equal(whole.count, other.count)
    # a part begins with no line from the one before it
    assert (other.pixels <= whole.pixels).all()
    assert other.largest_um == whole.largest_um


@pytest.mark.slow
def test_ten_times_the_points_need_no_more_memory() -> None:
    path = wavy(60)
    sizes = []
    for count in (500, 5000):
        group = Thinned(path, Canvas(path))
        group.add(measured(path, count))
        sizes.append(sum(value.nbytes for value in vars(group).values() if isinstance(value, np.ndarray)))
    assert sizes[0] == sizes[1]


def test_a_line_is_painted_without_gaps_and_widened_all_round() -> None:
    path = Path.through(np.array([[0.0, 0.0, 0.0], [100.0, 63.0, 0.0], [100.0, -20.0, 5.0]]))
    canvas = Canvas(path)
    pixels = painted(path, canvas)
    rows, columns = np.nonzero(pixels)
    assert columns.max() - columns.min() >= 420
    assert pixels.any(axis=0)[columns.min() : columns.max() + 1].all()
    single = np.zeros((9, 9))
    single[4, 4] = 3.0
    wide = widened(single)
    assert wide[4, 2] == wide[2, 4] == wide[6, 4] == wide[5, 5] == 3.0
    assert wide[2, 2] == wide[4, 7] == 0.0
    assert rows.size


def test_a_canvas_has_the_places_of_the_path() -> None:
    path = wavy(30)
    canvas = Canvas(path)
    pixel, line = canvas.lines(path.vertex_mm[:1, :2], path.vertex_mm[:1, :2])
    left, right, bottom, top = canvas.extent_mm
    x = left + (pixel % canvas.shape[1] + 0.5) * canvas.size_mm
    y = bottom + (pixel // canvas.shape[1] + 0.5) * canvas.size_mm
    assert np.abs(np.array([x[0], y[0]]) - path.vertex_mm[0, :2]).max() <= canvas.size_mm
    assert left < path.vertex_mm[:, 0].min() < path.vertex_mm[:, 0].max() < right
    assert bottom < path.vertex_mm[:, 1].min() < path.vertex_mm[:, 1].max() < top
    assert line.max() == 0


@pytest.mark.slow
def test_points_beside_a_known_segment_are_at_the_nearest_place_about_it() -> None:
    path = wavy(40)
    rng = np.random.default_rng(3)
    s = np.sort(rng.uniform(0.0, path.length_mm, 300))
    place, segment = path.at(s)
    points = place + rng.normal(0.0, 0.05, place.shape)
    paired = beside(path, points, np.clip(segment + rng.integers(-1, 2, 300), 0, len(path) - 1))
    dense = path.at(np.linspace(0.0, path.length_mm, 200_000))[0]
    nearest = np.array([np.sqrt(((dense - p) ** 2).sum(axis=1)).min() for p in points])
    # next to a corner the segment that a point is beside is taken, though the other may be a hair nearer
    assert np.abs(paired.distance_mm - nearest).max() < 1e-3
    assert np.median(np.abs(paired.distance_mm - nearest)) < 1e-5
    assert np.abs(path.at(paired.s_mm)[0] - paired.foot_mm).max() < 1e-9
    assert not paired.beyond.any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("job", "holes"), [("gantry-plate/job.toml", True), ("table-router/job-outline.toml", False)]
)
def test_figures_of_a_correction_show_what_the_proof_states(job: str, holes: bool) -> None:
    """Each point is set beside the move that it belongs to; a matching along the whole path agrees."""
    file = PROGRAMS / job
    stated = load_job(file)
    session, source = opened(stated.program, stated.machine, file)  # type: ignore[arg-type]
    options = CorrectOptions()
    result = correct(session, source, options)
    drawn = {}

    def kept(path: object, groups: dict[str, Thinned], *_: object) -> dict[str, bytes]:
        drawn.update(groups)
        return {}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "_path_plots", kept)
        report._predicted_plots(result, source, session, options, silent)
    between = {side: result.report["deviation"][side]["between"]["max_um"] for side in ("before", "after")}
    largest = result.report["verdict"]["numerical"]["largest_um"]
    for side, group in drawn.items():
        # the proof judges strokes of holes across their axis alone
        assert holes or np.nanmax(group.high) <= max(between[side], largest) * 1.001 + 0.01
        assert np.nanmax(group.high) >= 0.7 * between[side]
    loaded = session.loaded("hold").reading(source)
    way = nominal_of(
        olp.program.registry.read(source.data, loaded.setup, loaded.dialect).toolpath, loaded.model, "tip"
    )
    points = olp.simulate(stated.program, stated.machine, file, step_mm=0.5).points_mm  # type: ignore[arg-type]
    reach = 10.0 * between["before"] * 1e-3 + 0.1
    other = Thinned(way.path, Canvas(way.path))
    other.add(Run.of("", way.path, points, pair(way.path, points, "forward"), reach))
    both = np.isfinite(other.high) & np.isfinite(drawn["before"].high)
    assert both.sum() > 0.9 * np.isfinite(other.high).sum()
    assert np.median(np.abs(other.high - drawn["before"].high)[both]) < 1e-3


@pytest.mark.parametrize("block", [1, 7, 50])
def test_the_tip_in_parts_is_the_tip_at_once(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    session, source = opened(
        PROGRAMS / "table-router" / "outline.ngc", PROGRAMS / "table-router" / "machine.toml", None
    )
    loaded = session.loaded("hold").reading(source)
    path = olp.program.registry.read(source.data, loaded.setup, loaded.dialect).toolpath
    tip, move = Tracer.trace(path, loaded.model, 5.0)
    monkeypatch.setattr(deviation, "_BLOCK", block)
    again, of = Tracer.trace(path, loaded.model, 5.0)
    assert np.array_equal(tip, again, equal_nan=True)
    assert np.array_equal(move, of)
    assert len(list(Tracer.traced(path, loaded.model, 5.0))) > 3
    assert thinned.COLUMNS == COLUMNS
