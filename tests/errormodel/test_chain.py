"""The rigid-body chain against matrices written from the definition, and the laws every model obeys."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import ConfigError, UsageError
from olp.core.machine import CHAINS, COMPONENTS, SQUARENESS, Vector
from olp.errormodel.bodies import build_bodies
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.errormodel.total import total

Array = npt.NDArray[np.float64]
BOX = np.array([[-400.0, 600.0], [-300.0, 500.0], [-450.0, 50.0]])
P = np.array([[400.0, 300.0, -200.0], [-350.0, 120.0, 40.0], [10.0, -250.0, -440.0]])
TOOL = np.array([15.0, 130.0, -243.4852])
DATUM: Vector = (50.0, -40.0, 20.0)


def constant(axis: str, values: dict[str, float], **options: object) -> Curve:
    j = "XYZ".index(axis)
    columns = {name: np.full(2, value) for name, value in values.items()}
    return Curve(axis, BOX[j], columns, **options)


def random_calibration(
    seed: int, angle: float = 40e-6, length: float = 20e-3, interpolation: str = "pchip", **options: object
) -> Calibration:
    rng = np.random.default_rng(seed)
    curves = []
    for axis, (low, high) in zip("XYZ", BOX, strict=True):
        size = {d: length if d in "XYZ" else angle for d in "XYZABC"}
        columns = {f"E{d}{axis}": rng.normal(size=9) * size[d] for d in "XYZABC"}
        line = tuple(float(rng.uniform(*b)) for b in BOX)
        reference = str(rng.choice(["table", "functional-point"]))
        tool = tuple(rng.normal(size=3) * 50.0)
        knots = np.linspace(low, high, 9)
        curves.append(
            Curve(
                axis,
                knots,
                columns,
                line_mm=line,
                tool_mm=tool,
                reference=reference,
                interpolation=interpolation,
            )
        )
    square = dict(zip(SQUARENESS, rng.normal(size=3) * angle, strict=True))
    return Calibration("m", BOX, datum_mm=DATUM, curves=tuple(curves), squareness=square, **options)


def random_points(seed: int, n: int = 200) -> Array:
    return np.random.default_rng(seed).uniform(BOX[:, 0], BOX[:, 1], (n, 3))


def turn(axis: int, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    p, q = [(1, 2), (2, 0), (0, 1)][axis]
    matrix[p, p], matrix[p, q], matrix[q, p], matrix[q, q] = c, -s, s, c
    return matrix


def shift(vector: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix


def by_matrices(chain: str, e: dict[str, float], p: Array, tool: Array, datum: Array) -> Array:
    """Tool in the workpiece's frame by the product of all matrices, minus the nominal one.

    Frame to tool: each axis moves, then turns. Frame to workpiece: its axes move and turn oppositely.
    Errors are those of a reflector on the table (table side) or at the origin an axis carries (tool side).
    """
    direction = {
        "X": np.array([1.0, 0.0, 0.0]),
        "Y": np.array([-e.get("C0Y", 0.0), 1.0, 0.0]),
        "Z": np.array([e.get("B0Z", 0.0), -e.get("A0Z", 0.0), 1.0]),
    }

    def body(axis: str, sign: float) -> Array:
        q = (p - datum)["XYZ".index(axis)]
        moved = q * direction[axis] + np.array([e.get(f"E{d}{axis}", 0.0) for d in "XYZ"])
        a, b, c = (sign * e.get(f"E{d}{axis}", 0.0) for d in "ABC")
        return shift(sign * moved) @ turn(2, c) @ turn(1, b) @ turn(0, a)

    frame = chain.index("F")
    workpiece, to_tool = np.eye(4), np.eye(4)
    for axis in reversed(chain[:frame]):
        workpiece = workpiece @ body(axis, -1.0)
    for axis in chain[frame + 1 :]:
        to_tool = to_tool @ body(axis, 1.0)
    tip = np.linalg.inv(workpiece) @ to_tool @ np.array([*tool, 1.0])
    return tip[:3] - (p - datum + tool)


@pytest.mark.parametrize("chain", sorted(CHAINS))
@pytest.mark.parametrize("name", (*COMPONENTS, *SQUARENESS))
def test_impulse_of_each_error_is_the_matrix_product(chain: str, name: str) -> None:
    size = 1e-3
    if name in SQUARENESS:
        calibration = Calibration("m", BOX, datum_mm=DATUM, squareness={name: size})
    else:
        curve = constant(name[2], {name: size}, line_mm=DATUM, reference="table")
        calibration = Calibration("m", BOX, datum_mm=DATUM, curves=(curve,))
    expected = [by_matrices(chain, {name: size}, p, TOOL, np.array(DATUM)) for p in P]
    np.testing.assert_allclose(build(calibration, chain).error(P, TOOL), expected, atol=1e-10, rtol=0)
    assert np.abs(expected).max() > 0.0


@pytest.mark.parametrize("size", [3e-5, 3e-4, 3e-3])
@pytest.mark.parametrize("chain", sorted(CHAINS))
def test_all_errors_together_are_the_exact_product(chain: str, size: float) -> None:
    """Translations on the tool side only: in the matrices a table's own angle turns its translation too."""
    rng = np.random.default_rng(7)
    e = {name: float(rng.normal() * size) for name in (*COMPONENTS, *SQUARENESS) if name[1] in "ABC0"}
    e |= {f"E{d}{a}": float(rng.normal() * 0.02) for d in "XYZ" for a in chain[chain.index("F") + 1 :]}
    curves = tuple(
        constant(
            a, {n: v for n, v in e.items() if n[2] == a and n[0] == "E"}, line_mm=DATUM, reference="table"
        )
        for a in "XYZ"
    )
    square = {name: e[name] for name in SQUARENESS}
    model = build(Calibration("m", BOX, datum_mm=DATUM, curves=curves, squareness=square), chain)
    expected = [by_matrices(chain, e, p, TOOL, np.array(DATUM)) for p in P]
    np.testing.assert_allclose(model.error(P, TOOL), expected, atol=1e-10, rtol=0)


#: Displacement in um of 10 urad or 10 um at P = (400, 300, 200), t = (0, 130, -243.4852), by the program of a
#: metrology institute, for F-X-Y-Z, F-Y-X-Z, table Y, table X; of moving tables signed by the table's motion.
UNIT_CHAINS = ("FXYZ", "FYXZ", "YFXZ", "XFYZ")
UNIT_ANGLES = {
    "EAX": ((0, 0.4349, 4.3), (0, 0.4349, 1.3), (0, 0.4349, 1.3), (0, -0.4349, -4.3)),
    "EBX": ((-0.4349, 0, 0), (-0.4349, 0, 0), (-0.4349, 0, 0), (0.4349, 0, 4.0)),
    "ECX": ((-4.3, 0, 0), (-1.3, 0, 0), (-1.3, 0, 0), (4.3, -4.0, 0)),
    "EAY": ((0, 0.4349, 1.3), (0, 0.4349, 1.3), (0, -0.4349, -4.3), (0, 0.4349, 1.3)),
    "EBY": ((-0.4349, 0, 0), (-0.4349, 0, -4.0), (0.4349, 0, 4.0), (-0.4349, 0, 0)),
    "ECY": ((-1.3, 0, 0), (-1.3, 4.0, 0), (4.3, -4.0, 0), (-1.3, 0, 0)),
    "EAZ": ((0, 2.4349, 1.3),) * 4,
    "EBZ": ((-2.4349, 0, 0),) * 4,
    "ECZ": ((-1.3, 0, 0),) * 4,
}


@pytest.mark.parametrize("name", COMPONENTS)
@pytest.mark.parametrize("column", range(4))
def test_unit_errors_of_an_independent_program(name: str, column: int) -> None:
    chain, axis = UNIT_CHAINS[column], name[2]
    table_motion = -1.0 if chain.index(axis) < chain.index("F") else 1.0
    if name in UNIT_ANGLES:
        size, expected = 10e-6, np.array(UNIT_ANGLES[name][column])
    else:
        size, expected = 10e-3, table_motion * 10.0 * (np.arange(3) == "XYZ".index(name[1]))
    box = np.array([[0.0, 1000.0]] * 3)
    curve = Curve(axis, [0.0, 1000.0], {name: np.full(2, table_motion * size)}, reference="table")
    model = build(Calibration("m", box, curves=(curve,)), chain)
    error_um = model.error(np.array([[400.0, 300.0, 200.0]]), np.array([0.0, 130.0, -243.4852]))[0] * 1e3
    np.testing.assert_allclose(error_um, expected, atol=1.2e-4, rtol=0)


@pytest.mark.parametrize("chain", sorted(CHAINS))
def test_a_curve_returns_its_value_on_its_own_line(chain: str) -> None:
    """Whatever the other components of the axis do, at the line and tool of a measurement it reads so."""
    for axis in "XYZ":
        full = random_calibration(11)
        old = full.curves_of(axis)[0]
        lengths = Curve(
            axis,
            old.position_mm,
            {n: v for n, v in old.columns.items() if n[1] in "XYZ"},
            line_mm=(11.0, 22.0, -33.0),
            tool_mm=(4.0, 5.0, -60.0),
        )
        angles = Curve(
            axis,
            old.position_mm,
            {n: v for n, v in old.columns.items() if n[1] in "ABC"},
            line_mm=(0.0, 400.0, 0.0),
            tool_mm=(0.0, 0.0, -1.0),
        )
        model = build(Calibration("m", BOX, datum_mm=DATUM, curves=(lengths, angles)), chain)
        points = np.tile([11.0, 22.0, -33.0], (9, 1))
        points[:, "XYZ".index(axis)] = old.position_mm
        expected = np.stack([old.columns[f"E{d}{axis}"] for d in "XYZ"], axis=1)
        np.testing.assert_allclose(model.error(points, np.array([4.0, 5.0, -60.0])), expected, atol=1e-12)


@pytest.mark.parametrize("chain", ["FXYZ", "YFXZ", "XYFZ", "ZYXF"])
def test_files_of_one_axis_may_be_split_by_component(chain: str) -> None:
    whole = random_calibration(3)
    halves = [
        Curve(
            c.axis,
            c.position_mm,
            {n: v for n, v in c.columns.items() if n[1] in group},
            line_mm=c.line_mm,
            tool_mm=c.tool_mm,
            reference=c.reference,
        )
        for c in whole.curves
        for group in ("XYZ", "ABC")
    ]
    split = Calibration("m", BOX, datum_mm=DATUM, curves=tuple(halves), squareness=whole.squareness)
    points = random_points(1)
    np.testing.assert_allclose(
        build(split, chain).error(points, TOOL), build(whole, chain).error(points, TOOL), atol=1e-13
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(sorted(CHAINS)))
def test_small_errors_add(seed: int, chain: str) -> None:
    """Contributions add up to the error to first order, 0.1 um at angles of 40 urad."""
    calibration = random_calibration(seed, cyclic=(Cyclic("EAX", 8.0, 5e-6, 0.4), Cyclic("EYY", 3.0, 2e-3)))
    model = build(calibration, chain)
    points, play = random_points(seed, 50), np.sign(random_points(seed + 1, 50))
    parts = dict(model.contributions(points, TOOL, play))
    assert {"EXX", "ECZ", "C0Y", "cyclic EAX"} <= set(parts)
    np.testing.assert_allclose(sum(parts.values()), model.error(points, TOOL, play), atol=1e-4)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(sorted(CHAINS)), st.tuples(*[st.floats(-500.0, 500.0)] * 3))
def test_coordinates_may_count_from_anywhere(seed: int, chain: str, origin: Vector) -> None:
    """Moving every position (box, knots, lines, datum, points) by the same vector changes nothing."""
    old = random_calibration(seed, interpolation="linear")
    by = np.array(origin)
    curves = tuple(
        Curve(
            c.axis,
            c.position_mm + by["XYZ".index(c.axis)],
            c.columns,
            line_mm=tuple(np.array(c.line_mm) + by),
            tool_mm=c.tool_mm,
            reference=c.reference,
            interpolation="linear",
        )
        for c in old.curves
    )
    datum = tuple(np.array(DATUM) + by)
    new = Calibration("m", BOX + by[:, None], datum_mm=datum, curves=curves, squareness=old.squareness)
    points = random_points(seed, 40)
    np.testing.assert_allclose(
        build(new, chain).error(points + by, TOOL), build(old, chain).error(points, TOOL), atol=1e-10
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(sorted(CHAINS)))
def test_the_command_that_reaches_a_target_is_found_by_iteration(seed: int, chain: str) -> None:
    model = build(random_calibration(seed), chain)
    target = random_points(seed, 50)
    command = target.copy()
    for _ in range(6):
        command = target - model.error(command, TOOL)
    np.testing.assert_allclose(command + model.error(command, TOOL), target, atol=1e-10)


@pytest.mark.parametrize("chain", ["FXYZ", "YFXZ"])
def test_a_model_without_errors_is_exactly_zero(chain: str) -> None:
    model = build(Calibration("m", BOX, curves=(constant("X", {"EXX": 0.0, "ECX": 0.0}),)), chain)
    assert not model.error(P, TOOL).any()
    assert not model.depends_on.any()
    assert model.backlash_at(P) is None
    assert not model.chord_bound(P, TOOL).any()
    assert not list(model.contributions(P, TOOL))


def test_integer_positions_equal_floats() -> None:
    model = build(
        random_calibration(5, thermal=Thermal((1e-5, 0.0, 0.0), scale_degC=(22.0, 20.0, 20.0))), "YFXZ"
    )
    whole = np.array([[100, 200, -300], [-7, 3, 11]])
    tool = np.array([1, 2, -100])
    for method in (model.error, model.chord_bound):
        np.testing.assert_array_equal(method(whole, tool), method(whole.astype(float), tool.astype(float)))
    np.testing.assert_array_equal(model.rotation(whole), model.rotation(whole.astype(float)))
    assert np.abs(model.error(whole, tool)).min() > 0.0


def test_a_tool_per_point_equals_one_tool() -> None:
    model = build(random_calibration(6), "XFYZ")
    points = random_points(2)
    np.testing.assert_allclose(
        model.error(points, np.tile(TOOL, (200, 1))), model.error(points, TOOL), atol=1e-13
    )


def test_blocks_do_not_show() -> None:
    model = build(random_calibration(6), "FXYZ")
    points = random_points(2, 40_000)
    np.testing.assert_array_equal(
        model.error(points, TOOL)[16000:16500], model.error(points[16000:16500], TOOL)
    )


@settings(max_examples=40, deadline=None)
@given(
    st.sets(st.sampled_from((*COMPONENTS, *SQUARENESS)), max_size=5),
    st.sets(st.sampled_from(COMPONENTS), max_size=5),
    st.sampled_from(sorted(CHAINS)),
    st.booleans(),
)
def test_depends_on_is_what_the_error_does(
    varying: set[str], fixed: set[str], chain: str, table: bool
) -> None:
    """False: moving that axis changes nothing, nor does not knowing it; otherwise not knowing gives NaN."""
    columns = {n: np.full(5, 3e-3) for n in fixed}
    columns |= {n: np.array([1.0, 3.0, -2.0, 2.0, 0.5]) * 1e-3 for n in varying if n not in SQUARENESS}
    curves = tuple(
        Curve(
            a, np.linspace(*BOX["XYZ".index(a)], 5), own, reference="table" if table else "functional-point"
        )
        for a in "XYZ"
        if (own := {n: v for n, v in columns.items() if n[2] == a})
    )
    calibration = Calibration(
        "m", BOX, curves=curves, squareness={n: 1e-3 for n in varying if n in SQUARENESS}
    )
    model = build(calibration, chain)
    depends = model.depends_on
    for j in range(3):
        moved, unknown = P.copy(), P.copy()
        moved[:, j] += np.array([-77.7, 88.8, 60.6]) * [1.0, 1.0, 0.3]
        unknown[:, j] = np.nan
        change = np.abs(model.error(moved, TOOL) - model.error(P, TOOL)).max(axis=0)
        assert np.array_equal(change > 1e-11, depends[:, j])
        blind = model.error(unknown, TOOL)
        assert np.array_equal(np.isnan(blind).any(axis=0), depends[:, j])
        keep = ~depends[:, j]
        np.testing.assert_allclose(blind[:, keep], model.error(P, TOOL)[:, keep], atol=1e-11)


def test_a_constant_shift_depends_on_nothing() -> None:
    model = build(Calibration("m", BOX, curves=(constant("X", {"EXX": 0.01, "EYX": -0.02}),)), "FXYZ")
    assert not model.depends_on.any()
    np.testing.assert_array_equal(model.error(np.full((1, 3), np.nan), TOOL), [[0.01, -0.02, 0.0]])


def test_hold_evaluates_at_the_face() -> None:
    model = build(random_calibration(8), "YFXZ", outside="hold")
    outside = np.array([[700.0, 0.0, -500.0]])
    face = np.array([[600.0, 0.0, -450.0]])
    np.testing.assert_array_equal(model.error(outside, TOOL), model.error(face, TOOL))
    np.testing.assert_array_equal(
        model.inside(np.vstack([outside, face])), [[False, True, False], [True] * 3]
    )
    assert not model.inside(np.full((1, 3), np.nan)).any()


@pytest.mark.parametrize("name", ["EXX", "EAY", "C0Y"])
def test_a_skipped_component_is_absent(name: str) -> None:
    calibration = random_calibration(9, cyclic=(Cyclic("EXX", 5.0, 1e-3),))
    model = build(calibration, "FXYZ", skip_components=frozenset({name}))
    kept = dict(model.contributions(P, TOOL))
    everything = dict(build(calibration, "FXYZ").contributions(P, TOOL))
    assert set(kept) == {n for n in everything if n.removeprefix("cyclic ") != name}
    for source, value in kept.items():
        np.testing.assert_allclose(value, everything[source], atol=1e-15)


@pytest.mark.parametrize("chain", ["FXYZ", "XYFZ"])
def test_rotation_is_the_sum_of_the_angles(chain: str) -> None:
    calibration = random_calibration(10)
    at_knots = np.stack([c.position_mm for c in calibration.curves], axis=1)
    expected = sum(np.stack([c.columns[f"E{d}{c.axis}"] for d in "ABC"], axis=1) for c in calibration.curves)
    np.testing.assert_allclose(build(calibration, chain).rotation(at_knots), expected, atol=1e-18)


def test_a_sum_of_models_is_a_model() -> None:
    one, two = (
        build(random_calibration(12), "FXYZ"),
        build(random_calibration(13, backlash_mm=(4e-3, 0, 0)), "FXYZ"),
    )
    both = total([one, two])
    points, play = random_points(3, 20), np.ones((20, 3))
    np.testing.assert_array_equal(
        both.error(points, TOOL, play), one.error(points, TOOL, play) + two.error(points, TOOL, play)
    )
    np.testing.assert_array_equal(both.rotation(points), one.rotation(points) + two.rotation(points))
    np.testing.assert_array_equal(both.backlash_at(points), two.backlash_at(points))
    np.testing.assert_array_equal(
        both.chord_bound(points, TOOL), one.chord_bound(points, TOOL) + two.chord_bound(points, TOOL)
    )
    names = [name for model in (one, two) for name, _ in model.contributions(points, TOOL, play)]
    assert [name for name, _ in both.contributions(points, TOOL, play)] == names
    np.testing.assert_array_equal(both.box_mm, BOX)
    assert total([one]) is one


def test_wrong_calls_are_refused() -> None:
    model = build(random_calibration(1), "FXYZ")
    for call in (
        lambda: model.error(np.zeros(3), TOOL),
        lambda: model.error(P, np.zeros(2)),
        lambda: total([]),
    ):
        with pytest.raises(UsageError):
            call()
    with pytest.raises(ConfigError):
        build(random_calibration(1), "XYZ")
    with pytest.raises(ConfigError):
        build(random_calibration(1), "FXYZ", skip_components=frozenset({"EXQ"}))


def test_every_chain_is_tested() -> None:
    assert {"".join(p) for p in itertools.permutations("FXYZ")} == CHAINS


#: Slopes per mm of a polynomial machine, and what the same program of a metrology institute gives in um.
POLYNOMIAL = {
    "EXX": 1.33e-5, "EXY": -1.12e-5, "EYY": -5.09e-6, "EXZ": 2.6e-5, "EYZ": 4.6e-6, "EZZ": 3.34e-8,
    "EAX": 7.49e-9, "EBX": 1.54e-8, "ECX": 5e-9, "EAY": -4.58e-9, "EBY": -1.43e-8, "ECY": 2.19e-8,
    "EAZ": 2.49e-9, "EBZ": -7.94e-10, "ECZ": 4.78e-8,
}  # fmt: skip


@pytest.mark.parametrize(
    ("chain", "expected_um"),
    [
        ("FYXZ", (4.76043681, 2.21285477, 1.9982946)),
        ("FXYZ", (4.16044141, -0.41518477, 1.18109427)),
        ("YFXZ", (2.78944684, 2.2128327, 1.58608228)),
        ("XFYZ", (4.16044141, 0.38482587, -1.2829385)),
    ],
)
def test_polynomial_machine_of_an_independent_program(chain: str, expected_um: Vector) -> None:
    """A linear curve signed by the table's motion, at the negative coordinate, is the same signed by the
    coordinate."""
    curves = tuple(
        Curve(
            axis,
            [0.0, 1000.0],
            {name: [0.0, 1000.0 * slope] for name, slope in POLYNOMIAL.items() if name[2] == axis},
            reference="table",
            interpolation="linear",
        )
        for axis in "XYZ"
    )
    model = build(Calibration("m", np.array([[0.0, 1000.0]] * 3), curves=curves), chain)
    error = model.error(np.array([[400.0, 300.0, 200.0]]), np.array([0.0, 130.0, -243.4852]))
    np.testing.assert_allclose(error[0] * 1e3, expected_um, atol=5e-5, rtol=0)


@pytest.mark.parametrize(
    ("angle", "terms"), [(1e-6, 1), (1e-4, 2), (1.0, 0), (1e78, 0), (1e160, 0), (1e308, 0)]
)
def test_angles_too_large_for_a_series_take_sine_and_cosine(angle: float, terms: int) -> None:
    """Also where a power of the angle is no number any more."""
    calibration = Calibration("m", BOX, curves=(constant("X", {"EAX": angle}),))
    bodies = build_bodies(calibration, "FXYZ", frozenset())
    assert [body.sine_terms for body in bodies] == [terms if body.axis == 0 else 1 for body in bodies]


# -- contributions to first order, by hand -------------------------------------------------------------------

#: FXYZ with the datum at (50, -40, 20), at P = (100, 60, -80) with a tool of (5, -6, -90).
PLACE, SHORT = np.array([[100.0, 60.0, -80.0]]), np.array([5.0, -6.0, -90.0])
UNIT = 1e-6


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("EXX", (1, 0, 0)), ("EYX", (0, 1, 0)), ("EZX", (0, 0, 1)),
        # on X all that is behind it: t_x, y + 40 + t_y, z - 20 + t_z
        ("EAX", (0, 190, 94)), ("EBX", (-190, 0, -5)), ("ECX", (-94, 5, 0)),
        ("EAY", (0, 190, -6)), ("EBY", (-190, 0, -5)), ("ECY", (6, 5, 0)),
        ("EAZ", (0, 90, -6)), ("EBZ", (-90, 0, -5)), ("ECZ", (6, 5, 0)),
        # squareness from the datum: -C0Y y + B0Z z, -A0Z z
        ("C0Y", (-100, 0, 0)), ("B0Z", (-100, 0, 0)), ("A0Z", (0, 100, 0)),
    ],
)  # fmt: skip
def test_what_one_unit_of_each_error_contributes(name: str, expected: Vector) -> None:
    if name in SQUARENESS:
        calibration = Calibration("m", BOX, datum_mm=DATUM, squareness={name: UNIT})
    else:
        calibration = Calibration("m", BOX, datum_mm=DATUM, curves=(constant(name[2], {name: UNIT}),))
    ((source, value),) = build(calibration, "FXYZ").contributions(PLACE, SHORT)
    assert source == name
    np.testing.assert_allclose(value, UNIT * np.array([expected]), atol=1e-18)
    np.testing.assert_allclose(
        build(calibration, "FXYZ").error(PLACE, SHORT), UNIT * np.array([expected]), atol=1e-9
    )


def test_contributions_come_axis_by_axis_and_only_where_they_are_not_zero() -> None:
    curves = (
        constant("Z", {"EBZ": UNIT, "EXZ": 0.0}), constant("X", {"EXX": UNIT, "ECX": UNIT}),
        Curve("Y", BOX[1], {"EYY": [0.0, 1e-3]}, interpolation="linear"),
    )  # fmt: skip
    calibration = Calibration(
        "m", BOX, datum_mm=DATUM, curves=curves, squareness={"A0Z": UNIT, "B0Z": UNIT, "C0Y": UNIT},
        backlash_mm=(0.0, 0.0, 4e-3), cyclic=(Cyclic("EYX", 8.0, UNIT, 1.0),),
    )  # fmt: skip
    model = build(calibration, "ZYFX")
    play = np.array([[1.0, 1.0, 0.5]])
    names = [name for name, _ in model.contributions(PLACE, SHORT, play)]
    assert names == ["EXX", "ECX", "cyclic EYX", "EYY", "C0Y", "EBZ", "backlash Z", "B0Z", "A0Z"]
    parts = dict(model.contributions(PLACE, SHORT, play))
    np.testing.assert_allclose(parts["backlash Z"], [[0.0, 0.0, -1e-3]])
    assert "backlash Z" not in dict(model.contributions(PLACE, SHORT))
    # at the datum squareness moves nothing, and at the lower face of Y its curve does not
    face = np.array([[100.0, -300.0, 20.0]])
    assert [name for name, _ in model.contributions(face, SHORT)] == [
        "EXX",
        "ECX",
        "cyclic EYX",
        "C0Y",
        "EBZ",
    ]
    # each row has its own tool
    rows = np.array([SHORT, np.zeros(3)])
    turned = dict(model.contributions(np.repeat(PLACE, 2, axis=0), rows))["EBZ"]
    one, two = (dict(model.contributions(PLACE, tool))["EBZ"][0] for tool in rows)
    np.testing.assert_array_equal(turned, [one, two])
    assert not np.array_equal(one, two)


def test_angles_of_a_turn_with_the_play_and_of_rows_that_are_not_known() -> None:
    """EAX 10 to 30 urad forward and 20 to 60 backward, EBX the same everywhere, ECZ along Z."""
    curves = (
        Curve(
            "X", BOX[0], forward={"EAX": [1e-5, 3e-5], "EBX": [4e-6, 4e-6]},
            backward={"EAX": [2e-5, 6e-5], "EBX": [4e-6, 4e-6]}, interpolation="linear",
        ),
        Curve("Z", BOX[2], {"ECZ": [0.0, 5e-6]}, interpolation="linear"),
    )  # fmt: skip
    model = build(Calibration("m", BOX, curves=curves), "FXYZ")
    nan = np.nan
    points = np.array([[100.0, 0.0, 50.0], [600.0, 0.0, -450.0], [nan, 0.0, 50.0], [100.0, nan, nan]])
    mean = model.rotation(points)
    np.testing.assert_allclose(
        mean, [[3e-5, 4e-6, 5e-6], [4.5e-5, 4e-6, 0], [nan, 4e-6, 5e-6], [3e-5, 4e-6, nan]]
    )
    play = np.array([[1.0, 0, 0], [-1.0, 0, 0], [1.0, 0, 0], [0.5, 0, 0]])
    forward = model.rotation(points, play)[:, 0]
    np.testing.assert_allclose(forward, [2e-5, 6e-5, nan, 2.5e-5])


def test_the_play_of_each_row_counts_across_blocks_and_beside_unknown_rows() -> None:
    model = build(Calibration("m", BOX, backlash_mm=(2e-3, 0.0, 0.0)), "FXYZ")
    n = 40_000
    play = np.zeros((n, 3))
    play[:, 0] = np.linspace(-1.0, 1.0, n)
    points = np.tile(PLACE, (n, 1))
    points[::7] = np.nan
    np.testing.assert_allclose(model.error(points, SHORT, play), -1e-3 * play * [1.0, 0.0, 0.0])
    tools = np.tile(SHORT, (n, 1)) * np.linspace(0.0, 1.0, n)[:, None]
    turned = build(Calibration("m", BOX, curves=(constant("Z", {"EBZ": UNIT}),)), "FXYZ")
    np.testing.assert_allclose(
        turned.error(np.tile(PLACE, (n, 1)), tools)[:, 0], UNIT * tools[:, 2], atol=1e-12
    )


def test_bounds_are_kept_by_tool_and_stay_right_for_many_tools() -> None:
    curve = Curve("X", [-400.0, 100.0, 600.0], {"EBX": [0.0, 1e-5, 0.0]}, interpolation="linear")
    model = build(Calibration("m", BOX, curves=(curve,)), "FXYZ")
    delta = np.array([[30.0, 0.0, 0.0]])
    alone = [
        build(Calibration("m", BOX, curves=(curve,)), "FXYZ").chord_bound(delta, np.array([0.0, 0.0, -z]))[0]
        for z in range(80)
    ]
    for _ in range(2):
        again = [model.chord_bound(delta, np.array([0.0, 0.0, -float(z)]))[0] for z in range(80)]
        np.testing.assert_array_equal(again, alone)
    assert len(set(alone)) == 80
    assert "AxisBound" not in repr(model)
    assert model.chord_bound(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_a_model_of_first_order_is_the_linear_part_of_the_exact_one() -> None:
    """Huddersfield's equation against contributions, with all 21 errors at once and a payload column."""
    calibration = random_calibration(4, model="huddersfield")
    model = build(calibration, "FXYZ")
    points, tool = random_points(5, 20), np.array([*TOOL, 12.0])
    parts = sum(value for _, value in model.contributions(points, tool))
    np.testing.assert_allclose(model.error(points, tool), parts, atol=1e-15)
    np.testing.assert_array_equal(model.error(points, tool), model.error(points, np.zeros(3)))
    assert model.depends_on.tolist() == [[True, True, True], [True, True, True], [True, True, True]]
    delta = np.array([[30.0, 20.0, 10.0]])
    assert model.chord_bound(delta, tool)[0] == model.chord_bound(delta, np.zeros(3))[0] > 0.0
    few = Curve("X", BOX[0], {"EXX": [0.0, 1e-3], "ECX": [1e-5, 1e-5]}, interpolation="linear")
    small = build(Calibration("m", BOX, model="huddersfield", curves=(few,)), "FXYZ")
    # dX = EXX - ECX y; dY = ECX x, of which X has none without a tool
    assert small.depends_on.tolist() == [[True, True, False], [False] * 3, [False] * 3]
    turned = Curve("Y", BOX[1], {"EAY": [0.0, 1e-5], "EBY": [1e-5, 1e-5]}, interpolation="linear")
    small = build(Calibration("m", BOX, model="huddersfield", curves=(turned,)), "FXYZ")
    # dX = EBY z; dY = -EAY z; dZ = EAY times the y that Y itself does not move
    assert small.depends_on.tolist() == [[False, False, True], [False, True, True], [False] * 3]
