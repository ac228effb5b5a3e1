"""Deviation maps: what they interpolate, what is refused, and that the chord bound is never exceeded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline, RegularGridInterpolator

from olp.core.errors import ConfigError
from olp.core.grid_interpolation import Grid
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic
from olp.errormodel.sources.maps import DeviationMap
from olp.errormodel.total import total
from olp.files.calibration.grids import read_component_grid, read_map
from olp.files.calibration.reader import load_calibration

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
TOOL = np.array([10.0, -30.0, -150.0])


def knots(rng: np.random.Generator, sizes: tuple[int, int, int]) -> list[np.ndarray]:
    return [
        np.concatenate([[low], np.sort(rng.uniform(low, high, n - 2)), [high]])
        for (low, high), n in zip(BOX, sizes, strict=True)
    ]


def random_map(seed: int, interpolation: str, kind: str = "residual", sizes=(6, 4, 3)) -> DeviationMap:
    rng = np.random.default_rng(seed)
    return DeviationMap(
        tuple(knots(rng, sizes)), rng.normal(size=(*sizes, 3)) * 0.05, kind, interpolation=interpolation
    )


def places(seed: int, n: int = 200) -> np.ndarray:
    return np.random.default_rng(seed).uniform(BOX[:, 0], BOX[:, 1], (n, 3))


def model_of(*maps: DeviationMap, **more):
    return build(Calibration("m", BOX, maps=maps, **more), "FXYZ")


def test_linear_interpolation_agrees_with_scipy() -> None:
    described = random_map(1, "linear")
    expected = RegularGridInterpolator(described.knots_mm, described.values)(places(2))
    np.testing.assert_allclose(model_of(described).error(places(2), TOOL), expected, atol=1e-15)


def test_cubic_interpolation_agrees_with_scipy_axis_by_axis() -> None:
    described = random_map(3, "cubic", sizes=(6, 4, 2))
    points = places(4, 20)
    error = model_of(described).error(points, TOOL)
    for point, value in zip(points, error, strict=True):
        expected = described.values
        for x, q in zip(described.knots_mm, point, strict=True):
            slope = np.gradient(expected, x, axis=0, edge_order=min(2, len(x) - 1))
            expected = CubicHermiteSpline(x, expected, slope, axis=0)(q)
        np.testing.assert_allclose(value, expected, atol=1e-15)


def test_a_trilinear_field_is_reproduced_exactly_and_a_quadratic_one_by_the_cubic() -> None:
    rng = np.random.default_rng(5)
    levels = knots(rng, (5, 4, 3))
    nodes = np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1) / 1000.0
    points = places(6) / 1000.0

    def trilinear(p: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(p, -1, 0)
        return np.stack([0.01 + x - y * z, x * y + 0.5 * z, x * y * z], axis=-1) * 0.1

    def quadratic(p: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(p, -1, 0)
        return np.stack([x * x - y * z * z, y * y * z + x, (x * y * z) ** 2], axis=-1) * 0.1

    for law, interpolation in ((trilinear, "linear"), (trilinear, "cubic"), (quadratic, "cubic")):
        model = model_of(DeviationMap(tuple(levels), law(nodes), interpolation=interpolation))
        np.testing.assert_allclose(model.error(points * 1000.0, TOOL), law(points), atol=1e-15)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_a_node_returns_what_was_measured_and_maps_add(interpolation: str) -> None:
    one, two = random_map(7, interpolation), random_map(8, interpolation)
    nodes = np.stack(np.meshgrid(*one.knots_mm, indexing="ij"), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(model_of(one).error(nodes, TOOL), one.values.reshape(-1, 3), atol=1e-16)
    both = model_of(one, two)
    points = places(9)
    parts = [model_of(m).error(points, TOOL) for m in (one, two)]
    np.testing.assert_allclose(both.error(points, TOOL), sum(parts), atol=1e-16)
    np.testing.assert_allclose(sum(v for _, v in both.contributions(points, TOOL)), sum(parts), atol=1e-16)
    assert total([model_of(one)]).rotation(points).max() == 0.0


@pytest.mark.parametrize(("interpolation", "cells"), [("linear", 1), ("cubic", 2)])
def test_an_impulse_at_a_node_is_felt_in_the_cells_around_it(interpolation: str, cells: int) -> None:
    levels = tuple(np.linspace(low, high, 9) for low, high in BOX)
    values = np.zeros((9, 9, 9, 3))
    values[4, 4, 4, 1] = 1.0
    model = model_of(DeviationMap(levels, values, interpolation=interpolation))
    points = places(1, 3000)
    felt = model.error(points, TOOL)[:, 1]
    away = np.abs((points - [k[4] for k in levels]) / [k[1] - k[0] for k in levels]).max(axis=1)
    assert np.all(felt[away >= cells] == 0.0)
    assert np.all(felt[away < 0.5] > 0.1)
    assert not model.error(points, TOOL)[:, [0, 2]].any()


def departures(model, start: np.ndarray, delta: np.ndarray, tool: np.ndarray) -> np.ndarray:
    share = np.linspace(0.0, 1.0, 97)
    points = start[:, None, :] + share[None, :, None] * delta[:, None, :]
    error = model.error(points.reshape(-1, 3), tool).reshape(points.shape)
    chord = error[:, :1] + share[None, :, None] * (error[:, -1:] - error[:, :1])
    return np.linalg.norm(error - chord, axis=2).max(axis=1)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 10**6),
    st.sampled_from(["linear", "cubic"]),
    st.sampled_from([(2, 2, 2), (6, 3, 2), (9, 4, 5)]),
)
def test_the_chord_bound_is_never_exceeded(seed: int, interpolation: str, sizes) -> None:
    model = model_of(random_map(seed, interpolation, sizes=sizes))
    rng = np.random.default_rng(seed + 1)
    start, end = rng.uniform(BOX[:, 0], BOX[:, 1], (2, 60, 3))
    delta = (end - start) * 10.0 ** rng.uniform(-3.0, 0.0, (60, 1))
    bound = model.chord_bound(delta, TOOL)
    assert np.all(departures(model, start, delta, TOOL) <= bound * (1.0 + 1e-9) + 1e-15)
    assert np.all(model.chord_bound(0.6 * delta, TOOL) <= bound * (1.0 + 1e-12))


def test_a_bow_departs_by_its_whole_height() -> None:
    """Both ends equal, so the change over the move is nothing, and the departure all of the span."""
    values = np.zeros((3, 2, 2, 3))
    values[1, :, :, 2] = 0.04
    model = model_of(DeviationMap(([0.0, 400.0, 800.0], *BOX[1:]), values, interpolation="cubic"))
    start, delta = np.array([[0.0, 0.0, -100.0]]), np.array([[800.0, 0.0, 0.0]])
    departure = departures(model, start, delta, TOOL)
    np.testing.assert_allclose(departure, 0.04, rtol=1e-3)
    np.testing.assert_allclose(model.chord_bound(delta, TOOL), 0.04)


def test_the_bound_of_a_smooth_map_is_not_far_above_what_happens() -> None:
    levels = [np.linspace(low, high, 9) for low, high in BOX]
    x, y, z = np.meshgrid(*levels, indexing="ij")
    values = np.stack([x * x, x * y, y * z], axis=-1) * 1e-7
    model = model_of(DeviationMap(tuple(levels), values, interpolation="cubic"))
    start, delta = np.array([[100.0, 0.0, -200.0]]), np.array([[80.0, 60.0, -50.0]])
    departure = departures(model, start, delta, TOOL)
    assert departure <= model.chord_bound(delta, TOOL) <= 1.5 * departure


def test_an_unknown_axis_hides_only_what_depends_on_it_and_hold_keeps_the_face() -> None:
    levels = [np.array(pair) for pair in BOX]
    values = np.zeros((2, 2, 2, 3))
    values[1, :, :, 0], values[:, 1, :, 2] = 0.1, 0.2
    model = model_of(DeviationMap(tuple(levels), values))
    np.testing.assert_array_equal(model.depends_on, [[True, False, False], [False] * 3, [False, True, False]])
    point = np.array([[np.nan, 0.0, np.nan]])
    np.testing.assert_allclose(model.error(point, TOOL), [[np.nan, 0.0, 0.1]])
    held = build(Calibration("m", BOX, maps=(random_map(1, "cubic"),)), "FXYZ", outside="hold")
    outside = np.array([[900.0, 0.0, -500.0]])
    np.testing.assert_array_equal(
        held.error(outside, TOOL), held.error(np.array([[800.0, 0.0, -400.0]]), TOOL)
    )


def refused(**parts) -> str:
    with pytest.raises(ConfigError) as caught:
        build(Calibration("m", BOX, **parts), "FXYZ", skip_components=parts.pop("skip", frozenset()))
    return str(caught.value)


def test_a_total_map_stands_alone() -> None:
    whole = random_map(1, "linear", "total")
    curve = Curve("X", BOX[0], {"EXX": [0.0, 0.01]})
    assert "holds curves, squareness, cyclic already" in refused(
        maps=(whole,), curves=(curve,), squareness={"C0Y": 1e-5}, cyclic=(Cyclic("EXX", 10.0, 1e-3),)
    )
    assert "second map" in refused(maps=(whole, random_map(2, "linear", "total")))
    residual = random_map(1, "linear")
    model = model_of(residual, curves=(curve,))
    alone = model_of(residual).error(places(3), TOOL) + model_of(curves=(curve,)).error(places(3), TOOL)
    np.testing.assert_allclose(model.error(places(3), TOOL), alone, atol=1e-16)
    with pytest.raises(ConfigError, match="also holds EXX, which the control corrects"):
        build(Calibration("m", BOX, maps=(whole,)), "FXYZ", skip_components=frozenset({"EXX"}))


def test_a_map_covers_the_box_and_one_level_holds_only_where_said() -> None:
    x, y, _ = knots(np.random.default_rng(0), (3, 3, 3))
    values = np.zeros((3, 3, 1, 3))
    with pytest.raises(ConfigError, match=r'one level along Z.*holds_along = \["Z"\]'):
        DeviationMap((x, y, [-100.0]), values)
    flat = DeviationMap((x, y, [-100.0]), values + 0.01, holds_along=("Z",))
    np.testing.assert_allclose(model_of(flat).error(places(1), TOOL), 0.01)
    assert "runs from 0 to 700 mm along X" in refused(
        maps=(DeviationMap((x * 0.875, y, [-100.0]), values, holds_along=("Z",)),)
    )


HEADER = "X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um\n"


def rows(order: np.random.Generator | None = None) -> list[str]:
    lines = [
        f"{x},{y},{z},{x / 100},{y / 10},{z}" for x in (0, 400, 800) for y in (-300, 300) for z in (-400, 0)
    ]
    if order is not None:
        order.shuffle(lines)
    return lines


def written(folder: Path, text: str) -> Path:
    path = folder / "map.csv"
    path.write_text(text)
    return path


def test_a_map_file_is_read_in_any_order_of_rows_and_columns(tmp_path: Path) -> None:
    one = read_map(written(tmp_path, HEADER + "\n".join(rows())))
    two = read_map(written(tmp_path, "# any order\n" + HEADER + "\n".join(rows(np.random.default_rng(1)))))
    assert one.arguments == ("X", "Y", "Z")
    assert [k.tolist() for k in one.knots_mm] == [[0, 400, 800], [-300, 300], [-400, 0]]
    assert one.columns["DX"][2, 0, 0] == pytest.approx(0.008)
    for name in one.columns:
        np.testing.assert_array_equal(one.columns[name], two.columns[name])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda r: r[:-1], "line 12: the node X = 800, Y = 300, Z = 0 mm is missing beside this one"),
        (lambda r: [*r, r[2]], "line 14: the node X = 0, Y = 300, Z = -400 mm is in line 4 already"),
        (lambda r: [*r, "401,-300,0,1,2,3"], "line 14: X_mm = 401 is in 1 rows and other levels are in 4"),
        (lambda r: [f"{i},{i * 2},{i * 3},0,0,0" for i in range(9)], "expected positions on a grid"),
        (lambda r: [*r[:4], "0,1,2"], "line 6: 3 values under 6 columns"),
        (lambda r: [], "line 1: no rows follow the header"),
    ],
)
def test_a_map_file_that_is_no_grid_is_refused_with_its_line(tmp_path: Path, change, expected: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_map(written(tmp_path, HEADER + "\n".join(change(rows()))))
    assert expected in str(caught.value)
    assert "map.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("X_mm,Y_mm,Z_mm,DX_um,DY_um", "there is no column DZ_um"),
        ("X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_mm", "did you mean DZ_um?"),
        ("X_mm,Y_mm,X_mm,DX_um,DY_um,DZ_um", 'column 3 repeats "X_mm"'),
    ],
)
def test_a_header_of_a_map_is_checked(tmp_path: Path, header: str, expected: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_map(written(tmp_path, header + "\n1,2,3,4,5,6\n"))
    assert expected in str(caught.value)


def test_component_grids_name_one_axis_and_their_unit_per_kg(tmp_path: Path) -> None:
    text = "Y_mm,Z_mm,EZY_um_kg,EAY_urad_kg\n" + "\n".join(f"{y},{z},{y},{z}" for y in (0, 1) for z in (2, 3))
    table = read_component_grid(written(tmp_path, text))
    assert table.arguments == ("Y", "Z")
    np.testing.assert_allclose(table.columns["EZY"], [[0, 0], [1e-3, 1e-3]])
    np.testing.assert_allclose(table.columns["EAY"], [[2e-6, 3e-6], [2e-6, 3e-6]])
    for header, expected in (
        ("Y_mm,EZY_um", "did you mean EZY_um_kg?"),
        ("Y_mm,EZY_um_kg,EZX_um_kg", "errors of the axes X and Y"),
        ("EZY_um_kg,Y_mm", "expected X_mm, Y_mm or Z_mm"),
        ("Y_mm", "there is no error column"),
    ):
        with pytest.raises(ConfigError) as caught:
            read_component_grid(written(tmp_path, header + "\n" + "1," * header.count(",") + "1\n"))
        assert expected in str(caught.value)


def test_a_calibration_file_names_its_maps(tmp_path: Path) -> None:
    written(tmp_path, HEADER + "\n".join(rows()))
    (tmp_path / "calibration.toml").write_text(
        'schema = "olp-calibration-1"\nmachine = "m"\nmeasured = 2026-05-14\ntemperature_degC = 20.0\n'
        'sign = "actual-minus-commanded"\nmodel = "rigid-body"\ndatum_mm = [0, 0, 0]\n'
        "box_mm = [[0, 800], [-300, 300], [-400, 0]]\n"
        '[[maps]]\nfile = "map.csv"\nkind = "total"\ntool_mm = [0, 0, -120]\ninterpolation = "cubic"\n'
    )
    calibration = load_calibration(tmp_path / "calibration.toml")
    assert calibration.maps[0].tool_mm == (0, 0, -120)
    error = build(calibration, "FXYZ").error(np.array([[200.0, 150.0, -100.0]]), TOOL)
    np.testing.assert_allclose(error, [[0.002, 0.015, -0.1]], atol=1e-15)


def test_many_nodes_do_not_take_many_times_longer_to_bound() -> None:
    grid = Grid.through(
        [np.linspace(0, 1, 12)] * 3, np.random.default_rng(0).normal(size=(12, 12, 12, 3)), "cubic"
    )
    inside = np.random.default_rng(1).uniform(0, 1, (2000, 3))
    assert np.all(np.ptp(grid(inside), axis=0) <= grid.span())
