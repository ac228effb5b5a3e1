"""Figures of the report along the whole path: not below what a dense sampling of the same path finds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp
from olp.checks import along as module
from olp.checks.along import Along
from olp.checks.correction import orientation, sources
from olp.core.toolpath import Arcs, Flag, Frame, Kind, Toolpath
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic
from olp.program.text import columns

BOX = np.array([[-1000.0, 2000.0]] * 3)
HEAD = "G21 G90 G54 G64 P0.001 Q0\n"


def dense(path: Toolpath, count: int = 200_000) -> np.ndarray:
    """Points all along the lines of a path, and its waypoints."""
    share = np.linspace(0.0, 1.0, count)[:, None]
    return np.vstack(
        [s + share * (e - s) for s, e in zip(path.starts_mm()[1:], path.end_mm[1:], strict=True)]
    )


def lines(*ends: tuple[float, float, float], kind: int = Kind.LINE) -> Toolpath:
    n = len(ends)
    kinds = np.full(n, kind, np.uint8)
    kinds[0] = Kind.RAPID
    return Toolpath(
        kinds, np.zeros(n, np.uint8), np.arange(1, n + 1, dtype=np.int32), np.zeros(n, np.int32),
        np.array(ends, float), (Frame(tool_mm=(0.0, 0.0, -100.0)),),
    )  # fmt: skip


def largest(path: Toolpath, model: olp.ErrorModel, points: np.ndarray) -> dict[str, float]:
    tool = path.tool_mm()
    return {n: 1e3 * np.linalg.norm(v, axis=1).max() for n, v in model.contributions(points, tool)}


def test_an_arc_whose_largest_error_lies_between_its_ends(tmp_path: Path) -> None:
    """By hand: a circle from X 0 back to X 0 through X 200. EXX is 5 um, and at X 200 it is 8 um higher; the
    tool turns by 30 urad and 12 urad more."""
    curve = "X_mm,EXX_um,EBX_urad\n-1000,5,30\n0,5,30\n200,13,42\n400,5,30\n2000,5,30\n"
    path = machine(
        tmp_path, '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n', {"x.csv": curve}, tables=TRUE_ZERO
    )
    program = f"{HEAD}G0 X0 Y0 Z0\nG2 X0 Y0 I100 J0 F600\nM2\n".encode()
    report = olp.correct(program, path).report
    found = {row["name"]: row["max_um"] for row in report["sources"]}
    assert found["EXX"] == pytest.approx(13.0, rel=0.001)
    assert report["orientation"]["max_urad"] == pytest.approx(42.0, rel=0.001)
    assert 30.0 < report["orientation"]["rms_urad"] < 42.0


@pytest.mark.parametrize("turns", [1, 3])
def test_helices_count_all_along(turns: int) -> None:
    arcs = Arcs(
        np.array([1]), np.array([[100.0, 0.0, 0.0]]), np.zeros(1, np.int8), np.array([2.0 * np.pi * turns])
    )
    path = Toolpath(
        np.array([Kind.RAPID, Kind.ARC_CCW], np.uint8), np.zeros(2, np.uint8), np.array([1, 2], np.int32),
        np.zeros(2, np.int32), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 30.0]]), (Frame(),), arcs,
    )  # fmt: skip
    peak = Curve(
        "Y", [-1000.0, 70.0, 71.0, 72.0, 2000.0], {"EYY": [0.0, 0.0, 6e-3, 0.0, 0.0]}, interpolation="linear"
    )
    model = build(Calibration("m", BOX, curves=(peak,)), "FXYZ")
    (row,) = sources(Along.of(path), model)
    assert row["max_um"] == pytest.approx(6.0, rel=0.02)


@pytest.mark.parametrize("period_mm", [10.0, 0.4, 1000.0 / 8192, 2000.0 / 8192])
def test_periods_keep_no_step_with_the_samples(period_mm: float) -> None:
    path = lines((0.0, 0.0, 0.0), (1000.0, 0.0, 0.0))
    model = build(
        Calibration("m", BOX, cyclic=(Cyclic("EXX", period_mm, 2e-3), Cyclic("EBX", 7.0, 1e-5))), "FXYZ"
    )
    found = {row["name"]: row for row in sources(Along.of(path), model)}
    assert found["cyclic EXX"]["max_um"] == pytest.approx(2.0, rel=0.02)
    assert found["cyclic EXX"]["rms_um"] == pytest.approx(2.0 / np.sqrt(2.0), rel=0.05)
    assert orientation(Along.of(path), model)["max_urad"] == pytest.approx(10.0, rel=0.02)


@pytest.mark.slow
def test_a_long_path_of_a_machine_of_many_sources() -> None:
    """Ten lines of some metres; a dense sampling of each finds no more than 2 % above what is stated."""
    rng = np.random.default_rng(8)
    x = np.linspace(-1000.0, 2000.0, 61)
    curves = tuple(
        Curve(a, x, {f"E{d}{a}": rng.normal(size=61) * (5e-3 if d in "XYZ" else 2e-5) for d in "XYZABC"})
        for a in "XYZ"
    )
    model = build(Calibration("m", BOX, curves=curves, squareness={"C0Y": 3e-5}), "FXYZ")
    path = lines(*map(tuple, rng.uniform(-900.0, 1900.0, (11, 3))))
    points = dense(path)
    expected = largest(path, model, points)
    found = {row["name"]: row["max_um"] for row in sources(Along.of(path), model)}
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert 0.98 * value <= found[name] <= 1.001 * value, name
    angle = 1e6 * np.linalg.norm(model.rotation(points), axis=1).max()
    assert 0.98 * angle <= orientation(Along.of(path), model)["max_urad"] <= 1.001 * angle


@pytest.mark.parametrize("peak_mm", [487.0, 500.0, 512.0])
def test_a_narrow_peak_that_one_move_of_a_long_path_meets(peak_mm: float) -> None:
    """290 m along Z and one move across: samples are 36 mm apart, and the peak falls off within 200 mm."""
    knots = [-1000.0, peak_mm - 200.0, peak_mm, peak_mm + 200.0, 2000.0]
    peak = Curve("Y", knots, {"EYY": [0.0, 0.0, 6e-3, 0.0, 0.0]}, interpolation="linear")
    model = build(Calibration("m", BOX, curves=(peak,)), "FXYZ")
    path = lines(*((0.0, -900.0, z) for z in (-900.0, 2000.0) * 50), (0.0, 1900.0, 2000.0))
    (row,) = sources(Along.of(path), model)
    assert row["max_um"] == pytest.approx(6.0, rel=0.02)


def test_rapids_and_moves_that_are_left_as_they_are_count_with_their_ends() -> None:
    step = Curve(
        "X",
        [-1000.0, 400.0, 500.0, 600.0, 2000.0],
        {"EXX": [1e-3, 1e-3, 9e-3, 1e-3, 1e-3]},
        interpolation="linear",
    )
    model = build(Calibration("m", BOX, curves=(step,)), "FXYZ")
    ends = ((0.0, 0.0, 0.0), (1000.0, 0.0, 0.0))
    left = lines(*ends)
    left.flag.flags.writeable = True
    left.flag[1] = Flag.PASS
    for path in (lines(*ends, kind=Kind.RAPID), left):
        (row,) = sources(Along.of(path), model)
        assert row["max_um"] == row["rms_um"] == pytest.approx(1.0)


def test_a_path_of_which_nothing_is_known_has_no_figures() -> None:
    model = build(Calibration("m", BOX, squareness={"C0Y": 1e-5}), "FXYZ")
    nowhere = lines((np.nan, 0.0, 0.0), (np.nan, 5.0, 0.0))
    assert sources(Along.of(nowhere), model) == []
    assert orientation(Along.of(nowhere), model) == {"max_urad": 0.0, "rms_urad": 0.0}
    assert Along.of(nowhere).figures(lambda points, move: []) == []


def test_waypoints_of_a_long_path_are_even_among_the_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = np.random.default_rng(5).random(300) < 0.7
    ends = np.where(known[:, None], np.arange(300.0)[:, None], np.nan) * [1.0, 0.0, 0.0]
    path = lines(*(tuple(end) for end in ends))
    monkeypatch.setattr(columns, "_MOST", 17)
    monkeypatch.setattr(module, "_WAYPOINTS", 50)
    rows = np.flatnonzero(known)
    expected = rows[np.linspace(0, len(rows) - 1, 50).astype(int)]
    figures = Along.of(path)
    assert figures._places.move[: len(expected)].tolist() == expected.tolist()


def test_tools_at_moves_are_those_of_the_path() -> None:
    path = lines((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    frames = tuple(Frame(tool_mm=(0.0, 0.0, z)) for z in (1.0, 2.0))
    for frame in ([0, 1, 1], [1, 1, 1]):
        one = replace(path, frames=frames, frame=np.array(frame, np.int32))
        tool, move = one.tool_mm(), np.array([2, 0])
        assert np.array_equal(one.tool_at(move), tool if tool.ndim == 1 else tool[move])
