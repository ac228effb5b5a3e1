"""Clearance: distances that are known, contacts made on purpose, and an independent library (coal)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.coal import Scene
from cases.gate import TRUE_ZERO, Call, block, clamp, tool
from hypothesis import example, given, settings
from hypothesis import strategies as st

import olp
from olp.clearance.distance import Swept, nearest
from olp.clearance.parts import parts_of
from olp.clearance.search import CLOSE_MM, CONTACT_MM, Best, search
from olp.clearance.tree import LEAF, Tree
from olp.core.machine import HolderPart, Tool

UM = 1e-3
#: Spacing of the sampled points: how much more than the least distance they may say.
SAMPLED_MM = 0.05
SEEDS = st.integers(0, 2**32 - 1)
few = settings(max_examples=25)


def swept_parts(rng: np.random.Generator, count: int, span: float = 50.0) -> Swept:
    """Frusta of all sizes on segments of all lengths; some are discs, needles, cones, some stand still."""
    level = np.sort(rng.uniform(0.0, 100.0, (count, 2)), axis=1)
    level[rng.random(count) < 0.1, 1] = level[rng.random(count) < 0.1, 0].mean() if count > 50 else 100.0
    level.sort(axis=1)
    radius = rng.uniform(0.0, 20.0, (count, 2))
    radius[rng.random((count, 2)) < 0.1] = 0.0
    travel = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-3.0, 2.0, (count, 1))
    travel[rng.random(count) < 0.1] = 0.0
    return Swept(rng.uniform(-span, span, (count, 3)), travel, level, radius)


def triangles(rng: np.random.Generator, count: int, span: float = 60.0) -> np.ndarray:
    """Triangles of all sizes, needles among them."""
    size = 10.0 ** rng.uniform(-2.0, 1.5, (count, 1, 1))
    corners = rng.uniform(-span, span, (count, 1, 3)) + rng.normal(size=(count, 3, 3)) * size
    thin = rng.random(count) < 0.2
    corners[thin, 2] = corners[thin, 1] + 1e-3 * rng.normal(size=(int(thin.sum()), 3))
    return corners


def surface_points(rng: np.random.Generator, swept: Swept) -> np.ndarray:
    """(n, 3) a point somewhere within each swept frustum."""
    t, z, angle, r = (rng.random(len(swept)) for _ in range(4))
    radius = (swept.radius[:, 0] + z * (swept.radius[:, 1] - swept.radius[:, 0])) * np.sqrt(r)
    point = swept.start + t[:, None] * swept.travel
    point[:, 0] += radius * np.cos(2 * np.pi * angle)
    point[:, 1] += radius * np.sin(2 * np.pi * angle)
    point[:, 2] += swept.level[:, 0] + z * (swept.level[:, 1] - swept.level[:, 0])
    return point


def on_triangles(rng: np.random.Generator, triangle: np.ndarray) -> np.ndarray:
    weight = rng.dirichlet((1.0, 1.0, 1.0), len(triangle))
    return np.asarray(np.einsum("ij,ijk->ik", weight, triangle))


# -- one part and one triangle ---------------------------------------------------------------------------


@few
@given(SEEDS)
def test_no_two_points_are_nearer_and_no_plane_separates_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    swept, triangle = swept_parts(rng, 200), triangles(rng, 200)
    result = nearest(swept, triangle)
    for _ in range(20):
        away = np.linalg.norm(surface_points(rng, swept) - on_triangles(rng, triangle), axis=1)
        assert (result.distance_mm <= away + CLOSE_MM).all()
        direction = rng.normal(size=(200, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        assert (result.distance_mm >= swept.gap(triangle, direction) - 1e-9).all()


@few
@given(SEEDS)
def test_a_point_in_common_is_a_contact(seed: int) -> None:
    """Wherever on the segment they meet."""
    rng = np.random.default_rng(seed)
    swept, triangle = swept_parts(rng, 300), triangles(rng, 300)
    triangle += (surface_points(rng, swept) - on_triangles(rng, triangle))[:, None]
    assert nearest(swept, triangle).distance_mm.max() <= CLOSE_MM


@pytest.mark.slow
@few
@given(SEEDS)
def test_a_bound_hides_nothing_below_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    swept, triangle = swept_parts(rng, 200), triangles(rng, 200)
    whole = nearest(swept, triangle).distance_mm
    bound = rng.uniform(0.0, 2.0, 200) * (whole + 0.1)
    distance = nearest(swept, triangle, bound).distance_mm
    below = whole < bound - CLOSE_MM
    np.testing.assert_allclose(distance[below], whole[below], atol=2 * CLOSE_MM)
    assert (distance >= np.minimum(whole, bound) - 2 * CLOSE_MM).all()


@pytest.mark.parametrize(("corner", "expected"), [
    ((20.0, 0.0, 30.0), 10.0),
    ((0.0, 0.0, -4.0), 4.0),
    ((13.0, 0.0, -4.0), 5.0),
    ((0.0, -13.0, 64.0), 5.0),
    ((9.0, 0.0, 30.0), 0.0),
])  # fmt: skip
def test_distances_worked_by_hand(corner: tuple[float, float, float], expected: float) -> None:
    """A cylinder of radius 10 mm and 60 mm, and a triangle that is a point: side, face, rim."""
    swept = Swept(np.zeros((1, 3)), np.zeros((1, 3)), np.array([[0.0, 60.0]]), np.array([[10.0, 10.0]]))
    triangle = np.tile(np.array(corner), (1, 3, 1))
    assert nearest(swept, triangle).distance_mm[0] == pytest.approx(expected, abs=CLOSE_MM)


# -- many parts and a mesh -------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=6)
@given(SEEDS, st.integers(1, 400))
def test_the_search_finds_what_looking_at_all_finds(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    swept, triangle = swept_parts(rng, 120, 150.0), triangles(rng, count, 150.0)
    best = Best.of(40)
    owner = np.arange(120) // 3
    tree = Tree.of(triangle)
    assert sorted(set(tree.index.tolist())) == list(range(count))
    assert len(tree.triangle) == LEAF * len(tree.low[-1])
    search(tree, swept, owner, best, 7)
    every = np.stack([nearest(swept, np.broadcast_to(one, (120, 3, 3))).distance_mm for one in triangle[:40]])
    least = every.min(axis=0).reshape(40, 3).min(axis=1)
    assert (best.distance_mm <= least + 2 * CLOSE_MM).all()
    if count <= 40:
        np.testing.assert_allclose(best.distance_mm, least, atol=2 * CLOSE_MM)
    assert (best.tag == 7).all()


@pytest.mark.slow
@few
@given(SEEDS)
@example(9998)
@example(99)
def test_no_contact_between_waypoints_is_missed(seed: int) -> None:
    """Small triangles, each somewhere in the path of a fast move, among many that are not."""
    rng = np.random.default_rng(seed)
    swept = swept_parts(rng, 100, 1000.0)
    hit = triangles(rng, 100) * 0.01
    hit += (surface_points(rng, swept) - on_triangles(rng, hit))[:, None]
    best = Best.of(100)
    search(Tree.of(np.concatenate((triangles(rng, 500, 1000.0), hit))), swept, np.arange(100), best, 0)
    assert best.distance_mm.max() <= CONTACT_MM


@pytest.mark.slow
@settings(max_examples=8)
@given(SEEDS, st.sampled_from(["cylinder", "cone"]))
@example(228, "cylinder")
def test_it_agrees_with_coal_to_a_micrometre(seed: int, shape: str) -> None:
    """coal measures a standing cylinder or cone against the whole mesh. The least distance over the segment
    is bounded from both sides, as it changes by no more than the distance travelled."""
    scene = Scene.of(np.random.default_rng(seed), shape)
    swept, owner = scene.swept(), np.arange(len(scene.start))
    best = Best.of(len(owner))
    search(Tree.of(scene.triangle), swept, owner, best, 0)
    for k in range(len(owner)):
        low, high = scene.least(k, UM / 2)
        assert best.distance_mm[k] <= high + UM / 2
        if best.distance_mm[k] < low - UM / 2:
            assert scene.sampled(k) <= best.distance_mm[k] + SAMPLED_MM


# -- tools, frames, roles --------------------------------------------------------------------------------


def test_a_tool_is_stacked_from_its_tip_to_the_gauge_point() -> None:
    holder = (HolderPart(30.0, 12.0, 20.0), HolderPart(20.0, 20.0, 20.0))
    parts = parts_of(Tool(1, (0.0, 0.0, 120.0), 5.0, cutting_length_mm=25.0, holder=holder))
    assert [(p.name, *p.level_mm, *p.radius_mm, p.cuts) for p in parts] == [
        ("tool", 0.0, 25.0, 5.0, 5.0, True), ("shank", 25.0, 70.0, 5.0, 5.0, False),
        ("holder", 70.0, 100.0, 12.0, 20.0, False), ("holder", 100.0, 120.0, 20.0, 20.0, False),
    ]  # fmt: skip
    assert parts_of(Tool(1, (0.0, 0.0, -80.0), 5.0)) == ()


def cleared(folder: Path, call: Call) -> Any:
    result = call.run(folder)
    assert result.clearances is not None
    return result.clearances


def least(folder: Path, call: Call) -> dict[int, float]:
    clearances = cleared(folder, call)
    return dict(zip(clearances.line.tolist(), clearances.clearance_mm.tolist(), strict=True))


def test_each_block_has_its_clearance_and_its_place(tmp_path: Path) -> None:
    call = Call(b"G0 Z30\nG0 X100\nG1 Z5\nG1 X70\n", tables=tool(50.0), **clamp(20.0))
    clearances = cleared(tmp_path, call)
    # clearances of lines 4 to 7: beside the clamp, above it, beside it
    expected = {4: 35.0, 5: 10.0, 6: 35.0, 7: 5.0}
    assert least(tmp_path, call) == pytest.approx(expected, abs=UM)
    row = next(r for r in clearances.rows() if r["line"] == 7)
    assert row["point_mm"][0] == pytest.approx(60.0, abs=UM)
    assert (row["part"], row["mesh"], row["role"], row["frame"]) == ("tool", "clamp.stl", "fixture", "G54")


def test_an_arc_is_measured_along_its_bulge(tmp_path: Path) -> None:
    """A helix of 30 mm radius about the clamp's far side leaves it by the same everywhere."""
    pin = {"files": {"clamp.stl": block((100.0, 0.0, -50.0), (100.0, 0.0, 50.0))}}
    call = Call(b"G0 X70\nG2 I30 Z10\n", tables=tool(50.0), **(clamp(0.0) | pin))
    assert least(tmp_path, call)[5] == pytest.approx(25.0, abs=UM)


def test_a_mesh_stands_where_its_frame_is(tmp_path: Path) -> None:
    frame = '[work_offsets.G55]\nX_mm = 30.0\nC_deg = 90.0\nset_by = "true"\n'
    # about Z by 90 degrees: X40..60 becomes Y40..60
    call = Call(b"G0 X30\nG1 Y20\n", tables=tool(50.0) + frame, **clamp(0.0, frame="G55"))
    clearances = cleared(tmp_path, call)
    assert least(tmp_path, call)[5] == pytest.approx(15.0, abs=UM)
    points = {r["line"]: r["point_mm"] for r in clearances.rows()}
    assert points[5][0] == pytest.approx(40.0, abs=UM)


@pytest.mark.parametrize(("chain", "expected"), [("FXYZ", 40.0), ("YFXZ", 15.0)])
def test_a_machine_mesh_stands_still_while_the_table_moves(
    tmp_path: Path, chain: str, expected: float
) -> None:
    """On a moving table, a move in Y brings the tool no nearer to what is bolted to the frame."""
    post = {"files": {"clamp.stl": block((-10.0, 20.0, -90.0), (10.0, 40.0, 90.0))}}
    call = Call(
        b"G1 Y-25\n", tables=tool(50.0), swap={'"FXYZ"': f'"{chain}"'},
        **(clamp(0.0, "machine", "machine") | post),
    )  # fmt: skip
    by_line = least(tmp_path, call)
    assert by_line[4] == pytest.approx(15.0, abs=UM), "its start is nearest"
    back = Call(
        b"G1 Y-25\nG1 X1\n", tables=tool(50.0), swap={'"FXYZ"': f'"{chain}"'},
        **(clamp(0.0, "machine", "machine") | post),
    )  # fmt: skip
    assert least(tmp_path, back)[5] == pytest.approx(expected, abs=UM)


CUT = b"G0 X0 Y30\nG0 Z2\nG1 Z-5\nG1 X100\nG0 Z30\n"
PLATE = {"files": {"clamp.stl": block((-20.0, 0.0, -30.0), (120.0, 60.0, 0.0))}}


START = "X = 0.0, Y = -30.0, Z = 30.0"


def contacts(folder: Path, call: Call) -> list[tuple[str, tuple[int, ...]]]:
    return [(f.code, f.lines) for f in call.run(folder).findings if f.code.startswith("OLP7")]


def test_what_cuts_may_touch_the_workpiece_in_feed_moves_alone(tmp_path: Path) -> None:
    work = clamp(0.0, "workpiece") | PLATE
    head = b"G21 G90 G54 G64 P0.0001 Q0\nG0 X0 Y-30 Z30\nF600\n"
    # in the plate up to its middle: the retract touches its walls
    assert contacts(tmp_path / "a", Call(CUT, head=head, tables=tool(50.0), start=START, **work)) == [
        ("OLP701", (8,))
    ]
    fixture = clamp(0.0, "fixture") | PLATE
    touched = contacts(tmp_path / "b", Call(CUT, head=head, tables=tool(50.0), start=START, **fixture))
    assert touched[0] == ("OLP701", (6, 7, 8))
    shank = tool(50.0, "cutting_length_mm = 3.0\n")
    assert contacts(tmp_path / "c", Call(CUT, head=head, tables=shank, start=START, **work))[0] == (
        "OLP701", (6, 7, 8),
    )  # fmt: skip


def test_a_retract_from_what_was_cut_is_free(tmp_path: Path) -> None:
    """The tool stands on the bottom of the pocket that it cut, beside its wall."""
    pocket = {"files": {"clamp.stl": block((5.0, -60.0, -30.0), (120.0, 60.0, 0.0))}}
    call = Call(b"G1 Z-5\nG0 Z30\nG0 X-5\n", tables=tool(50.0), **(clamp(0.0, "workpiece") | pocket))
    assert contacts(tmp_path, call) == [("OLP703", (2,))]


def test_a_holder_counts_where_the_tool_is_free(tmp_path: Path) -> None:
    holder = "[[tools.1.holder]]\nlength_mm = 40.0\nradius_mm = 30.0\n"
    call = Call(b"G0 Z-20\nG0 X20\n", tables=tool(60.0), **clamp(20.0))
    assert least(tmp_path / "bare", call)[5] == pytest.approx(15.0, abs=UM)
    tables = tool(60.0).replace("[job_defaults]", holder + "[job_defaults]")
    clearances = cleared(tmp_path / "held", Call(b"G0 Z-20\nG0 X20\n", tables=tables, **clamp(20.0)))
    assert {r["line"]: r["part"] for r in clearances.rows()}[5] == "holder"
    assert clearances.clearance_mm.min() == 0.0


def test_a_mesh_that_is_none_is_refused(tmp_path: Path) -> None:
    job = clamp(0.0) | {"files": {"clamp.stl": b"solid nothing\nendsolid nothing\n"}}
    with pytest.raises(olp.InputError, match=r"clamp\.stl"):
        Call(tables=tool(50.0), **job).run(tmp_path)


def test_without_meshes_nothing_is_measured(tmp_path: Path) -> None:
    assert Call(tables=TRUE_ZERO).run(tmp_path).clearances is None
