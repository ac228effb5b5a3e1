"""The judge is judged: known errors, closed forms, and corrections that are right or wrong on purpose."""

from __future__ import annotations

import ast
import copy
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import linuxcnc, machines, programs
from judge.linuxcnc import ARC, CanonMoves, InterpreterError
from judge.machines import Recipe
from judge.model import COMPONENTS, JudgeModel, _Table
from judge.path import SHARED, _Curves, densify, deviation, judge_programs, match
from judge.splitter import chord_count, longest_chords

GOLDEN = ("cyclic", "double-table", "fxyz", "fxyz-offline", "moving-table", "moving-table-offline")
UM = 1e-3
BARE = Recipe(tools={1: {"Z_mm": 0.0}}, squareness=False)


def machine(
    folder: Path, calibration: str, curves: dict[str, str], chain: str = "FXYZ", extra: str = ""
) -> JudgeModel:
    """A machine with 2 m of travel all around, from the text that matters."""
    axes = "".join(f"[axes.{a}]\ntravel_mm = [-1000.0, 2000.0]\n" for a in "XYZ")
    (folder / "machine.toml").write_text(f'chain = "{chain}"\ncalibration = "c.toml"\n{extra}\n{axes}')
    box = "box_mm = [[-1000.0, 2000.0], [-1000.0, 2000.0], [-1000.0, 2000.0]]\n"
    (folder / "c.toml").write_text(box + calibration)
    for name, text in curves.items():
        (folder / name).write_text(text)
    return JudgeModel(folder)


@pytest.mark.slow
def test_judge_is_independent() -> None:
    for path in (Path(__file__).parents[1] / "judge").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [name for name in names if name.split(".")[0] == "olp"], path.name


@pytest.mark.parametrize("case", GOLDEN)
def test_golden_cases(golden: Path, case: str) -> None:
    expected = json.loads((golden / case / "expected.json").read_text())
    names = ("axis_mm", "tool_mm", "error_um")
    points, tools, errors = (np.array([row[name] for row in expected["points"]], float) for name in names)
    error = JudgeModel(golden / case).error_mm(points, tools) / UM
    assert np.abs(error - errors).max() <= expected["tolerance_um"]


@pytest.mark.parametrize(
    ("component", "expected"),
    [
        ("EXX", (10, 0, 0)),
        ("EYZ", (0, 10, 0)),
        ("EAX", (0, 0.4349, 4.3)),
        ("EBX", (-0.4349, 0, 0)),
        ("ECX", (-4.3, 0, 0)),
        ("EAY", (0, 0.4349, 1.3)),
        ("EBY", (-0.4349, 0, 0)),
        ("ECY", (-1.3, 0, 0)),
        ("EAZ", (0, 2.4349, 1.3)),
        ("EBZ", (-2.4349, 0, 0)),
        ("ECZ", (-1.3, 0, 0)),
    ],
)
def test_unit_errors_of_a_fixed_table(tmp_path: Path, component: str, expected: tuple[float, ...]) -> None:
    """10 um or 10 urad at P = (400, 300, 200), t = (0, 130, -243.4852): values published with a CMM model."""
    unit, axis = ("um" if component[1] in "XYZ" else "urad"), component[2]
    curve = f"{axis}_mm,{component}_{unit}\n-1000,10\n2000,10\n"
    model = machine(tmp_path, '[[curves]]\nfile = "a.csv"\n', {"a.csv": curve})
    error = model.error_mm(np.array([[400.0, 300.0, 200.0]]), (0.0, 130.0, -243.4852)) / UM
    assert error[0] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("reference", "expected"), [("", (-1.3, 4.0, 0.0)), ('reference = "table"\n', (-4.3, 4.0, 0.0))]
)
def test_moving_table_by_hand(tmp_path: Path, reference: str, expected: tuple[float, ...]) -> None:
    curve = "Y_mm,ECY_urad\n-1000,10\n2000,10\n"
    model = machine(tmp_path, f'[[curves]]\nfile = "a.csv"\n{reference}', {"a.csv": curve}, "YFXZ")
    error = model.error_mm(np.array([[400.0, 300.0, 200.0]]), (0.0, 130.0, -243.5)) / UM
    assert error[0] == pytest.approx(expected, abs=1e-4)


def test_squareness_tilts_the_line_and_never_the_tool(tmp_path: Path) -> None:
    text = "datum_mm = [0.0, 1000.0, 0.0]\n[squareness]\nC0Y_urad = 20.0\n"
    model = machine(tmp_path, text, {})
    points = np.array([[0.0, 1000.0, 0.0], [0.0, 0.0, 0.0]])
    for tool in ((0.0, 0.0, 0.0), (0.0, 0.0, -300.0), (0.0, 300.0, 0.0)):
        error = model.error_mm(points, tool) / UM
        assert error == pytest.approx(np.array([[0, 0, 0], [20, 0, 0]]), abs=1e-9)


def test_backlash_by_hand(tmp_path: Path) -> None:
    model = machine(tmp_path, "[backlash]\nX_um = 6.0\n", {})
    points = np.zeros((7, 3))
    points[:, 0] = [0.0, 10.0, 10.002, 9.999, 9.9, 9.9005, 12.0]
    states, known = model.play(points)
    error = model.error_mm(points, 0.0, states)[:, 0] / UM
    assert not known[0, 0] and known[1:].all()
    assert error == pytest.approx([0, -3, -3, 0, 3, 2.5, -3], abs=1e-9)


def test_over_compensated_backlash_follows_the_sign_of_motion(tmp_path: Path) -> None:
    model = machine(tmp_path, "[backlash]\nY_um = -4.0\n", {})
    points = np.zeros((5, 3))
    points[:, 1] = [0.0, 1.0, 1.0, 0.9999, 1.0]
    states, known = model.play(points)
    assert model.error_mm(points, 0.0, states)[1:, 1] / UM == pytest.approx([2, 2, -2, 2])
    assert known[:, 1].tolist() == [False, True, True, True, True]


def test_direction_column_and_backlash_say_the_same(tmp_path: Path) -> None:
    """Constant curves 3 um apart are a backlash of 3 um: -1.5 um moving in +."""
    rows = "".join(f"{q},{d},{5 - 1.5 * d}\n" for d in (1, -1) for q in (-1000, 2000))
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    both = "X_mm,direction,EXX_um\n" + rows
    directed = machine(tmp_path / "a", '[[curves]]\nfile = "a.csv"\n', {"a.csv": both})
    mean = "X_mm,EXX_um\n-1000,5\n2000,5\n"
    plain = machine(tmp_path / "b", '[[curves]]\nfile = "a.csv"\n[backlash]\nX_um = 3.0\n', {"a.csv": mean})
    points = np.zeros((200, 3))
    points[:, 0] = np.cumsum(np.random.default_rng(1).normal(size=200)) * 0.002
    states, known = directed.play(points)
    other, other_known = plain.play(points)
    assert states == pytest.approx(other, abs=1e-6) and (known == other_known).all()
    expected = plain.error_mm(points, 0.0, other)
    assert directed.error_mm(points, 0.0, states) == pytest.approx(expected, abs=1e-9)
    assert directed.error_mm(points, 0.0)[:, 0] / UM == pytest.approx(np.full(200, 5.0))


@pytest.mark.parametrize(("set_by", "expected"), [("touch", (100.0, 199.985)), ("true", (99.990, 199.975))])
def test_touch_off_by_hand(tmp_path: Path, set_by: str, expected: tuple[float, float]) -> None:
    curve = "X_mm,EXX_um\n0,10\n150,10\n199,25\n2000,25\n"
    offset = f'[work_offsets.G54]\nX_mm = 100.0\nset_by = "{set_by}"'
    text = '[[curves]]\nfile = "a.csv"\ninterpolation = "linear"\n'
    model = machine(tmp_path, text, {"a.csv": curve}, extra=offset)
    nominal = np.array([[100.0, 0.0, 0.0], [200.0, 0.0, 0.0]])
    command = model.command_for(nominal + model.zero_shift("G54"), 0.0)
    assert command[:, 0] == pytest.approx(expected, abs=1e-7)


def test_constant_and_zero_machines(tmp_path: Path) -> None:
    points = np.random.default_rng(0).uniform((0, 0, -400), (800, 600, 0), (50, 3))
    shifted = JudgeModel(machines.shift_machine(tmp_path / "s", (100.0, -50.0, 25.0)))
    error = shifted.error_mm(points, (0, 0, -120)) / UM
    assert error == pytest.approx(np.tile([100.0, -50.0, 25.0], (50, 1)))
    zero = JudgeModel(machines.zero_machine(tmp_path / "z"))
    assert not zero.error_mm(points, (5, 0, -120)).any()


@pytest.mark.parametrize("chain", some_fast(machines.CHAINS, 4))
def test_random_machines_are_as_large_as_asked_and_repeat(tmp_path: Path, chain: str) -> None:
    recipe = Recipe(chain=chain, off_datum=True, cyclic=False)
    first = machines.random_machine(tmp_path / "a", 5, recipe)
    second = machines.random_machine(tmp_path / "b", 5, recipe)
    points = np.random.default_rng(0).uniform((0, 0, -400), (800, 600, 0), (3000, 3))
    error = JudgeModel(first).error_mm(points, (0, 0, -120))
    assert 45.0 < np.linalg.norm(error, axis=1).max() / UM < 155.0
    assert (first.parent / "x.csv").read_bytes() == (second.parent / "x.csv").read_bytes()


@pytest.mark.parametrize("chain", machines.CHAINS)
def test_exact_product_agrees_with_the_linear_law(tmp_path: Path, chain: str) -> None:
    """e = sum over axes of E + eps x (L - L_line) plus squareness, within the second order."""
    model = JudgeModel(machines.random_machine(tmp_path, 11, Recipe(chain=chain, off_datum=True)))
    points = np.random.default_rng(2).uniform((0, 0, -400), (800, 600, 0), (40, 3))
    tool = np.array([10.0, -20.0, -150.0])
    q = points - model.datum
    y, z, square = q[:, 1], q[:, 2], model.square
    total = np.stack([-square["C0Y"] * y + square["B0Z"] * z, -square["A0Z"] * z, 0 * z], 1)
    for curve in model.curves:
        letter = "XYZ"[curve.axis]
        before = chain.index(letter) < chain.index("F")
        after = [i for i in range(3) if chain.index("XYZ"[i]) > chain.index(letter)]
        after += [curve.axis] if before else []
        value = {name: table.both(points[:, curve.axis])[0] for name, table in curve.tables.items()}
        line = np.tile(curve.line_mm, (40, 1))
        line[:, curve.axis] = q[:, curve.axis]
        tool_vector = np.tile(tool - curve.tool_mm, (40, 1))
        tool_vector[:, after] += (q - line)[:, after]
        angles = np.stack([value[f"E{c}{letter}"] for c in "ABC"], 1)
        total += np.stack([value[f"E{c}{letter}"] for c in "XYZ"], 1) + np.cross(angles, tool_vector)
    assert np.abs(model.error_mm(points, tool) - total).max() < 0.1 * UM


# -- path ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> JudgeModel:
    folder = tmp_path_factory.mktemp("machine")
    return JudgeModel(machines.random_machine(folder, 3, Recipe(chain="YFXZ", off_datum=True)))


def walk(seed: int, count: int = 300, step: float = 3.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(count, 3)) * [step, step, 0.3 * step]
    return np.asarray(np.cumsum(steps, axis=0) + np.array([400.0, 300.0, -200.0]))


def corrected_points(model: JudgeModel, points: np.ndarray, pieces: int) -> np.ndarray:
    part = np.tile(np.arange(1, pieces + 1) / pieces, len(points) - 1)[:, None]
    begin, end = np.repeat(points[:-1], pieces, axis=0), np.repeat(points[1:], pieces, axis=0)
    return model.command_for(
        np.vstack([points[:1], (1 - part) * begin + part * end]), model.tool_vector_mm(1)
    )


@pytest.mark.parametrize("pieces", [1, 3])
def test_inverted_path_has_no_deviation(model: JudgeModel, pieces: int) -> None:
    points = walk(1)
    nominal = CanonMoves.polyline(points, tool=1)
    corrected = CanonMoves.polyline(corrected_points(model, points, pieces), tool=1)
    result = deviation(corrected, nominal, model)
    assert result.vertex_max_um < 1e-4
    assert result.max_um < 0.05
    assert result.before.max_um > 3.0
    assert (result.groups == pieces * np.arange(1, len(points)) - 1).all()


def test_correction_with_the_wrong_sign_doubles_the_error(model: JudgeModel) -> None:
    points = walk(2)
    error = model.error_mm(points, model.tool_vector_mm(1))
    nominal = CanonMoves.polyline(points, tool=1)
    result = deviation(CanonMoves.polyline(points + error, tool=1), nominal, model)
    assert result.vertex_max_um == pytest.approx(2 * result.before.vertex_max_um, rel=1e-2)


@pytest.mark.parametrize("name", [*COMPONENTS, "C0Y", "B0Z", "A0Z"])
def test_a_single_wrong_sign_is_seen(model: JudgeModel, name: str) -> None:
    """A corrector with one of the 21 signs wrong fails, whichever it is."""
    mistaken = copy.copy(model)
    if name in model.square:
        mistaken.square = {**model.square, name: -model.square[name]}
    else:
        axis = "XYZ".index(name[2])
        curve = model.curves[axis]
        right = curve.tables[name]
        wrong = _Table(lambda q: -right.forward(q), lambda q: -right.backward(q))
        mistaken.curves = list(model.curves)
        mistaken.curves[axis] = replace(curve, tables={**curve.tables, name: wrong})
    points = np.random.default_rng(6).uniform((0, 0, -400), (800, 600, 0), (50, 3))
    tool = model.tool_vector_mm(2)
    command = mistaken.command_for(points, tool)
    nominal = CanonMoves.polyline(points, tool=2)
    result = deviation(CanonMoves.polyline(command, tool=2), nominal, model, spacing_mm=10.0)
    expected = model.error_mm(points[1:], tool) - mistaken.error_mm(points[1:], tool)
    assert result.vertex_max_um == pytest.approx(np.linalg.norm(expected, axis=1).max() / UM, rel=0.02)
    assert result.vertex_max_um > 0.5


def test_one_wrong_point_is_found_on_its_line(model: JudgeModel) -> None:
    points = walk(3)
    command = corrected_points(model, points, 1)
    across = np.cross(points[120] - points[119], points[121] - points[120])
    command[120] += 0.004 * across / np.linalg.norm(across)
    result = deviation(CanonMoves.polyline(command, tool=1), CanonMoves.polyline(points, tool=1), model)
    assert result.vertex_max_um == pytest.approx(4.0, abs=0.02)
    assert result.worst_line in (120, 121)
    assert np.flatnonzero(result.after.by_move_um > 0.5).tolist() == [119, 120]


def test_passes_over_the_same_place_are_not_mixed_up(tmp_path: Path) -> None:
    """Two passes 2 um apart, the second one corrected onto the first: nearest distance would see nothing."""
    zero = JudgeModel(machines.zero_machine(tmp_path))
    first, second = [[0, 0, 0], [100, 0, 0]], [[100, 0.002, 0], [0, 0.002, 0]]
    nominal = CanonMoves.polyline(np.array([*first, *second], float))
    wrong = CanonMoves.polyline(np.array([*first, *first[::-1]], float))
    assert deviation(wrong, nominal, zero).max_um == pytest.approx(2.0)


def test_a_skipped_point_is_seen(model: JudgeModel) -> None:
    points = walk(4)
    command = np.delete(corrected_points(model, points, 2), [99, 100, 101], axis=0)
    result = deviation(CanonMoves.polyline(command, tool=1), CanonMoves.polyline(points, tool=1), model)
    assert result.vertex_max_um > 500.0


def test_a_step_back_is_seen(tmp_path: Path) -> None:
    zero = JudgeModel(machines.zero_machine(tmp_path))
    nominal = CanonMoves.polyline(np.array([[0, 0, 0], [100.0, 0, 0]]))
    steps = CanonMoves.polyline(np.array([[0, 0, 0], [60.0, 0, 0], [50.0, 0, 0], [100.0, 0, 0]]))
    result = deviation(steps, nominal, zero)
    assert result.max_um == pytest.approx(0.0, abs=1e-9)
    assert result.after.backtrack_um == pytest.approx(10_000.0)


def test_nothing_judged_is_no_pass(model: JudgeModel) -> None:
    moves = CanonMoves.polyline(walk(7), tool=1)
    lost = replace(moves, known=np.zeros((len(moves), 3), bool))
    with pytest.raises(ValueError, match="no point"):
        deviation(lost, lost, model)


def test_a_tool_change_forgets_the_position(model: JudgeModel) -> None:
    points = walk(7, 20)
    moves = replace(CanonMoves.polyline(points), tool=np.repeat([1, 2], [10, 9]))
    command = np.vstack(
        [
            model.command_for(points[:11], model.tool_vector_mm(1)),
            model.command_for(points[11:], model.tool_vector_mm(2)),
        ]
    )
    corrected = replace(CanonMoves.polyline(command), tool=moves.tool)
    kept = deviation(corrected, moves, model)
    forgotten = deviation(corrected, moves, model, forget_at_tool_change=True)
    assert kept.max_um < 0.05 and forgotten.max_um < 0.05
    assert forgotten.after.left_out > kept.after.left_out


def test_unknown_axes_and_skipped_lines_are_left_out(model: JudgeModel) -> None:
    points = walk(5)
    command = corrected_points(model, points, 1)
    command[:11] = points[:11]
    moves = CanonMoves.polyline(points, tool=1)
    known = moves.known.copy()
    known[:10, 2] = False
    nominal = replace(moves, known=known)
    result = deviation(CanonMoves.polyline(command, tool=1), nominal, model)
    assert result.max_um < 0.05 and result.after.left_out >= 40
    result = deviation(CanonMoves.polyline(command, tool=1), moves, model, skip_lines=range(1, 11))
    assert result.max_um < 0.05
    assert deviation(CanonMoves.polyline(command, tool=1), moves, model).max_um > 1.0


def test_backlash_acts_along_the_path(tmp_path: Path) -> None:
    recipe = replace(BARE, backlash_um={"X": 8.0}, peak_um=(1e-9, 1e-9))
    model = JudgeModel(machines.random_machine(tmp_path, 0, recipe))
    points = np.array([[0, 0, -5], [50, 0, -5], [50, 40, -5], [10, 40, -5], [10, 60, -5.0]])
    nominal = CanonMoves.polyline(points)
    result = deviation(nominal, nominal, model)
    assert result.vertex_max_um == pytest.approx(4.0, abs=1e-3)
    command = points.copy()
    command[1:3, 0] += 0.004
    command[3:, 0] -= 0.004
    assert deviation(CanonMoves.polyline(command), nominal, model).vertex_max_um < 1e-3


def best_cost(ends: np.ndarray, vertices: np.ndarray) -> float:
    """The same minimum by trying every end for every vertex."""
    m = len(ends)
    total = [float(np.sum((end - vertices[0]) ** 2)) for end in ends]
    for vertex in vertices[1:]:
        before = [min([total[j] + SHARED, *total[:j]]) for j in range(m)]
        total = [float(np.sum((ends[j] - vertex) ** 2)) + before[j] for j in range(m)]
    return total[-1]


@given(st.integers(0, 10_000), st.integers(1, 12), st.integers(0, 20), st.booleans())
@settings(max_examples=60)
def test_match_is_the_best_in_order(seed: int, n: int, extra: int, fewer: bool) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(n, 3))
    ends = rng.normal(size=(max(1, n - extra) if fewer else n + extra, 3))
    groups = match(ends, vertices)
    assert (np.diff(groups) >= 0).all() and groups[-1] == len(ends) - 1
    cost = np.sum((ends[groups] - vertices) ** 2) + SHARED * np.sum(np.diff(groups) == 0)
    assert cost == pytest.approx(best_cost(ends, vertices))


def arc(
    plane: int, turns: int, begin: float, sweep: float, radii: tuple[float, float], rise: float
) -> CanonMoves:
    axes = [(0, 1, 2), (1, 2, 0), (2, 0, 1)][plane]
    points, centre = np.zeros((2, 3)), np.zeros(3)
    centre[list(axes)] = (7.0, -3.0, 2.0 + rise)
    for row, (angle, radius) in enumerate(zip((begin, begin + sweep), radii, strict=True)):
        points[row, list(axes)] = (7 + radius * np.cos(angle), -3 + radius * np.sin(angle), 2 + rise * row)
    moves = CanonMoves.polyline(points)
    ints = np.ones(1, int)
    return replace(moves, kind=ARC * ints, centre=centre[None], turns=turns * ints, plane=plane * ints)


@pytest.mark.slow
@given(
    st.integers(0, 2),
    st.sampled_from([-2, -1, 1, 3]),
    st.floats(-3.1, 3.1),
    st.floats(0.05, 6.2),
    st.floats(-0.01, 0.01),
    st.floats(-20.0, 20.0),
    st.integers(0, 1000),
)
@settings(max_examples=60)
def test_nearest_point_of_an_arc(
    plane: int, turns: int, begin: float, sweep: float, spiral: float, rise: float, seed: int
) -> None:
    sweep *= np.sign(turns)
    moves = arc(plane, turns, begin, sweep, (10.0, 10.0 + spiral), rise)
    curves = _Curves.of(moves)
    assert curves.sweep[0] == pytest.approx(sweep + 2 * np.pi * (turns - np.sign(turns)))
    assert curves.at(np.zeros(1, int), np.ones(1))[0] == pytest.approx(moves.axis[0], abs=1e-9)
    rng = np.random.default_rng(seed)
    own = rng.uniform(0, 1, 20)
    zeros = np.zeros(20, int)
    points = curves.at(zeros, own) + rng.normal(size=(20, 3)) * 0.01
    distance = np.linalg.norm(points - curves.at(zeros, curves.nearest(zeros, points)), axis=1)
    dense = curves.at(np.zeros(40_001, int), np.linspace(0, 1, 40_001))
    best = np.array([np.linalg.norm(dense - point, axis=1).min() for point in points])
    assert (distance < best + 1e-6).all() and (distance > best - 2e-3).all()


def test_full_circle_and_densify_spacing() -> None:
    moves = arc(0, 1, 0.3, 0.0, (25.0, 25.0), 0.0)
    assert _Curves.of(moves).lengths()[0] == pytest.approx(50 * np.pi)
    dense = densify(moves, 0.5)
    steps = np.linalg.norm(np.diff(np.vstack([moves.start[None], dense.points]), axis=0), axis=1)
    assert steps.max() <= 0.5
    assert np.hypot(dense.points[:, 0] - 7, dense.points[:, 1] + 3) == pytest.approx(25.0)


# -- chords ----------------------------------------------------------------------------------------


def test_a_linear_error_needs_one_chord(tmp_path: Path) -> None:
    curve = "X_mm,EXX_um,EYX_um\n-1000,-40,30\n2000,80,-60\n"
    model = machine(tmp_path, '[[curves]]\nfile = "a.csv"\ninterpolation = "linear"\n', {"a.csv": curve})
    assert chord_count((0, 0, 0), (1500, 200, 0), model, np.zeros(3), 1e-4) == 1


@pytest.mark.slow
def test_a_quadratic_error_needs_the_chords_of_a_parabola(tmp_path: Path) -> None:
    """A chord of length h leaves k h^2 / 4 of y = k x^2."""
    k, tolerance = 1e-6, 1e-3
    q = np.arange(-1000.0, 2000.5, 5.0)
    rows = "".join(f"{x:.3f},{1e3 * k * x * x:.9f}\n" for x in q)
    model = machine(tmp_path, '[[curves]]\nfile = "a.csv"\n', {"a.csv": "X_mm,EYX_um\n" + rows})
    ends = longest_chords((0, 0, 0), (900, 0, 0), model, np.zeros(3), tolerance)
    chord = np.sqrt(4 * tolerance / k)
    assert len(ends) == int(np.ceil(900 / chord))
    assert 900 * np.diff(ends[:-1], prepend=0.0) == pytest.approx(np.full(len(ends) - 1, chord), rel=0.02)


# -- programs and LinuxCNC -------------------------------------------------------------------------


def test_random_programs_repeat_and_differ() -> None:
    assert programs.random_program(1) == programs.random_program(1) != programs.random_program(2)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(12))
def test_random_programs_are_legal_and_stay_in_range(seed: int, tmp_path: Path) -> None:
    folder = machines.zero_machine(tmp_path).parent
    moves = linuxcnc.interpret(programs.random_program(seed), folder)
    assert moves.ended and len(moves) > 20 and moves.known[-1].all()
    settled = moves.known.all(axis=1)
    travel = np.array(machines.TRAVEL)
    assert (moves.axis[settled] >= travel[:, 0]).all() and (moves.axis[settled] <= travel[:, 1]).all()


@pytest.mark.oracle
@pytest.mark.parametrize("feature", programs.FEATURES)
def test_every_feature_alone_is_legal(feature: str) -> None:
    tools = {1: (0.0, 0.0, 120.0), 2: (0.0, 0.0, 85.5)}
    assert linuxcnc.accepts(programs.random_program(7, features=[feature], blocks=8), tools=tools)


@pytest.mark.oracle
def test_axis_positions_follow_offsets_tools_units_and_planes() -> None:
    text = b"""G21 G90 G17
G0 X1 Y2 Z3
G43 H1
G1 X10 F100
G2 X20 Y12 I10 J0
G18 G3 X10 I-5 K0
G92 X0
G1 X5
G92.1
G20 G1 X1
G55 G0 X0 Y0 Z0
G91 G1 Z1
M2
"""
    offsets = {"G54": (100.0, 200.0, -10.0), "G55": (7.0, 8.0, 9.0)}
    moves = linuxcnc.interpret(text, offsets=offsets, tools={1: (0.5, 0.0, 50.0)}, start_mm=(1, 2, 3))
    expected = [
        (101, 202, -7),
        (110.5, 202, -7),
        (120.5, 212, -7),
        (110.5, 212, -7),
        (115.5, 212, -7),
        (125.9, 212, -7),
        (7.5, 8, 59),
        (7.5, 8, 84.4),
    ]
    assert moves.axis == pytest.approx(np.array(expected))
    assert moves.line.tolist() == [2, 4, 5, 6, 8, 10, 11, 12]
    assert moves.centre[2] == pytest.approx([120.5, 202.0, -7.0]) and moves.turns[2] == -1
    assert moves.frame.tolist() == [0] * 6 + [1] * 2
    assert moves.begin[0] == pytest.approx([1, 2, 3])


@pytest.mark.oracle
def test_axes_are_unknown_until_commanded() -> None:
    moves = linuxcnc.interpret(b"G0 Z5\nG91 G1 X1 F10\nG90 Y3\nX0\nM2\n")
    only_z = [False, False, True]
    assert moves.known.tolist() == [only_z, only_z, [False, True, True], [True] * 3]


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("blocks", "x_mm"),
    [
        ("G21 G0 X1 Y0 Z5\nG2 X21 I10 F100", 21.0),
        ("G20 G0 X1 Y0 Z5\nG2 X3 I1 F100", 76.2),
        ("G21 G0 X1 Y0 Z5\nG20", 1.0),
        ("G21 G0 X1 Y0 Z5\nG55", 1.0),
        ("G21 G0 X1 Y0 Z5\nG92 X7", 1.0),
        ("G21 G0 X1 Y0 Z5\nG43 H1", 1.0),
        ("G21 G10 L2 P1 R90\nG0 X1 Y2 Z5\nG10 L2 P1 R0", -2.0),
    ],
)
def test_a_tool_change_leaves_the_axes_where_they_are(blocks: str, x_mm: float) -> None:
    """The library alone goes on from the last straight move, in the offsets that held then."""
    text = f"{blocks}\nT2 M6\nG0 Y5\nM2\n".encode()
    moves = linuxcnc.interpret(text, offsets={"G55": (100.0, 0.0, 0.0)}, tools={1: (8.0, 0, 9), 2: (0, 0, 9)})
    assert moves.axis[-1, 0] == pytest.approx(x_mm)
    assert moves.axis[-1, 2] == pytest.approx(moves.axis[0, 2])
    assert moves.tool[-1] == 2
    assert moves.kind.tolist()[0] == moves.kind.tolist()[-1] == linuxcnc.RAPID
    assert len(moves) == 2 + ("G2 " in blocks)


@pytest.mark.oracle
def test_a_known_start_and_the_default_tool_count(tmp_path: Path) -> None:
    recipe = Recipe(job_defaults={"tool": 2, "work_offset": "G55", "length_active": True})
    folder = machines.zero_machine(tmp_path, recipe).parent
    moves = linuxcnc.interpret(b"G0 X0\nM2\n", folder, start_mm=(3, 4, -5), find_known=False)
    assert moves.axis[0] == pytest.approx([420.0, 4.0, -5.0])
    assert moves.start_known and moves.known.all() and moves.tool.tolist() == [2]
    assert moves.length[0] == pytest.approx([0, 0, 85.5])


@pytest.mark.oracle
def test_refusals_name_a_line() -> None:
    with pytest.raises(InterpreterError, match="radius") as caught:
        linuxcnc.interpret(b"G0 X0 Y0\nG1 X1 F10\nG2 X9 Y5 R1\nM2\n")
    assert caught.value.line == 3
    assert not linuxcnc.accepts(b"G1 X1 F10\n")
    assert linuxcnc.accepts(b"G1 X1 F10\nM2\n")


@pytest.mark.oracle
def test_a_corrected_program_passes_and_an_uncorrected_one_fails(tmp_path: Path) -> None:
    folder = machines.random_machine(tmp_path, 9).parent
    model = JudgeModel(folder)
    offset = np.array([250.0, 200.0, -300.0])
    points = walk(8, 120, 5.0) - [400, 300, -200] + [20, 10, 30]
    part = model.command_for(points + offset, model.tool_vector_mm(1)) - offset
    nominal, corrected = programs.polyline_program(points), programs.polyline_program(part)
    result = judge_programs(nominal, corrected, folder)
    assert result.vertex_max_um < 2e-3 and result.max_um < 0.1
    same = judge_programs(nominal, nominal, folder)
    assert same.max_um == same.before.max_um == result.before.max_um > 10.0


@pytest.mark.oracle
@pytest.mark.parametrize("plane", ["planes", "circle", "helix", "radius"])
def test_arcs_written_as_inverted_chords_pass(plane: str, tmp_path: Path) -> None:
    """Nominal arcs against a program of many short lines: two texts that share nothing but the path."""
    folder = machines.random_machine(tmp_path, 21, Recipe(chain="XFYZ")).parent
    model, offset = JudgeModel(folder), np.array([250.0, 200.0, -300.0])
    nominal = programs.random_program(4, features=[plane, "lines"], blocks=3, inch=False)
    moves = linuxcnc.interpret(nominal, folder)
    dense = densify(moves, 0.05)
    first = int(np.flatnonzero(dense.last)[0])
    command = model.command_for(dense.points[first:], model.tool_vector_mm(1)) - offset
    result = judge_programs(nominal, programs.polyline_program(command), folder)
    assert result.max_um < 0.3 and result.vertex_max_um < 2e-3
    assert result.before.max_um > 10.0 and result.after.judged > 1000
    ignorant = model.command_for(dense.points[first:], np.zeros(3)) - offset
    assert judge_programs(nominal, programs.polyline_program(ignorant), folder).max_um > 1.0


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(4))
def test_a_program_equals_itself_on_a_machine_without_error(seed: int, tmp_path: Path) -> None:
    folder = machines.zero_machine(tmp_path).parent
    text = programs.random_program(seed)
    result = judge_programs(text, text, folder)
    assert result.max_um < 1e-3 and result.vertex_max_um < 1e-6 and result.after.judged > 1000


@pytest.mark.oracle
def test_a_constant_shift_is_measured_as_it_is(tmp_path: Path) -> None:
    folder = machines.shift_machine(tmp_path).parent
    text = programs.random_program(5)
    result = judge_programs(text, text, folder)
    assert result.vertex_max_um == pytest.approx(100 * np.sqrt(3), rel=1e-9)
