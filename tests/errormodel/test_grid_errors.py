"""Errors over a grid by load or temperature, by hand: what each component does, depends on and is called."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from olp.core.errors import UsageError
from olp.errormodel.grid_errors import GridErrors
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.sources.maps import DeviationMap, MapErrors
from olp.errormodel.total import total

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
ZERO = (0.0, 0.0, 0.0)
LINE, TOOL_THEN = (0.0, 10.0, -20.0), (1.0, 2.0, -50.0)
POINT = np.array([[100.0, 40.0, -60.0]])
TOOL = np.array([5.0, -6.0, -90.0])


def table(
    axis: str, columns: dict[str, float], arguments: tuple[str, ...] = (), **more: Any
) -> ComponentTable:
    """Each component the same everywhere."""
    over = arguments or (axis,)
    knots = tuple(BOX["XYZ".index(a)] for a in over)
    values = {name: np.full((2,) * len(over), value) for name, value in columns.items()}
    options = {"line_mm": LINE, "tool_mm": TOOL_THEN, "interpolation": "linear"} | more
    return ComponentTable(axis, over, knots, values, **options)


def errors(*tables: ComponentTable, chain: str = "FXYZ", **more: Any) -> GridErrors:
    return GridErrors.of("load", tables, chain, ZERO, BOX, hold=False, **more)


@pytest.mark.parametrize(
    ("name", "error"),
    # arms on FXYZ: x 5 - 1; y 40 - 6 - 10 - 2; z -60 - 90 + 20 + 50
    [
        ("EXX", (1, 0, 0)), ("EYX", (0, 1, 0)), ("EZX", (0, 0, 1)),
        ("EAX", (0, 80, 22)), ("EBX", (-80, 0, -4)), ("ECX", (-22, 4, 0)),
    ],
)  # fmt: skip
def test_what_one_component_per_kg_does(name: str, error: tuple[float, ...]) -> None:
    model = errors(table("X", {name: 1e-6}), mass_kg=4.0)
    for mass, factor in ((10.0, 6.0), (1.0, -3.0), (4.0, 0.0)):
        tool = np.array([*TOOL, mass])
        expected = 1e-6 * factor * np.array([error])
        np.testing.assert_allclose(model.error(POINT, tool), expected, atol=1e-18)
        parts = list(model.contributions(POINT, tool))
        assert [part for part, _ in parts] == ([f"load {name}"] if factor else [])
        for _, value in parts:
            np.testing.assert_allclose(value, expected, atol=1e-18)
        turn = np.zeros((1, 3))
        if name[1] in "ABC":
            turn[0, "ABC".index(name[1])] = 1e-6 * factor
        np.testing.assert_allclose(model.rotation(POINT, None, mass), turn, atol=1e-18)
        np.testing.assert_allclose(model.rotation(POINT, None, np.array([mass])), turn, atol=1e-18)
    # a payload per row, none without a fourth column
    rows = np.column_stack([np.tile(TOOL, (3, 1)), [4.0, 5.0, 1.0]])
    expected = 1e-6 * np.outer([0.0, 1.0, -3.0], error)
    np.testing.assert_allclose(model.error(np.tile(POINT, (3, 1)), rows), expected, atol=1e-18)
    np.testing.assert_allclose(model.error(POINT, TOOL), -4e-6 * np.array([error]), atol=1e-18)
    assert model.backlash_at(POINT) is None
    # without a payload none is on the machine
    np.testing.assert_array_equal(model.rotation(POINT), model.rotation(POINT, None, 0.0))
    np.testing.assert_array_equal(total([model, model]).rotation(POINT), 2.0 * model.rotation(POINT))


def test_without_a_mass_the_payload_does_not_matter_and_without_tool_terms_neither_does_the_tool() -> None:
    one = table("X", {"EBX": 1e-6})
    warm = errors(one)
    for tool in (TOOL, np.array([*TOOL, 0.0]), np.array([*TOOL, 70.0])):
        np.testing.assert_allclose(warm.error(POINT, tool), [[-80e-6, 0.0, -4e-6]], atol=1e-18)
    assert warm.rotation(POINT).tolist() == [[0.0, 1e-6, 0.0]]
    paper = errors(one, tool_terms=False)
    for tool in (TOOL, np.zeros(3)):
        np.testing.assert_allclose(paper.error(POINT, tool), [[-40e-6, 0.0, 0.0]], atol=1e-18)
    delta = np.array([[10.0, 0.0, 7.0]])
    assert paper.chord_bound(delta, TOOL)[0] == paper.chord_bound(delta, np.zeros(3))[0]


def test_a_table_may_hold_all_three_angles() -> None:
    model = errors(table("Z", {"EAZ": 1e-6, "EBZ": 2e-6, "ECZ": 3e-6}), table("Y", {"EBY": 5e-6}))
    np.testing.assert_allclose(model.rotation(POINT), [[1e-6, 7e-6, 3e-6]])


def test_tables_of_one_axis_share_their_lever_arms_and_those_apart_do_not() -> None:
    """EBX was measured 60 mm above the line of EZX and EXX."""
    straight = table("X", {"EXX": 1e-3, "EZX": 2e-3})
    pitch = table("X", {"EBX": 1e-6}, line_mm=(0.0, 10.0, 40.0), tool_mm=(11.0, 2.0, -50.0))
    other = table("Y", {"EZY": 5e-3})
    together = errors(straight, pitch, other).error(POINT, TOOL)
    np.testing.assert_allclose(together, [[1e-3 - 80e-6, 0.0, 7e-3 - 4e-6]], atol=1e-18)
    apart = GridErrors.of("load", [straight, other], "FXYZ", ZERO, BOX, hold=False, apart=[pitch])
    np.testing.assert_allclose(apart.error(POINT, TOOL), [[1e-3 - 140e-6, 0.0, 7e-3 + 6e-6]], atol=1e-18)
    assert [part for part, _ in apart.contributions(POINT, TOOL)] == [
        "load EXX", "load EZX", "load EZY", "load EBX",
    ]  # fmt: skip
    np.testing.assert_allclose(apart.rotation(POINT), [[0.0, 1e-6, 0.0]])


@pytest.mark.parametrize(
    ("chain", "reference", "error"),
    # Y carries the workpiece: a turn about Z acts on the tool and X and Z behind it, and on its own y when
    # that was seen from a reflector on the table, from the datum on
    [
        ("FYXZ", "functional-point", (-22 + 40 - 10, 100 + 4, 0)),
        ("YFXZ", "functional-point", (8.0, 104.0, 0)),
        ("YFXZ", "table", (8.0 - 40.0, 104.0, 0)),
        ("YXFZ", "functional-point", (8.0, 104.0, 0)),
        ("XYFZ", "functional-point", (8.0, 4.0, 0)),
        ("FXYZ", "functional-point", (8.0, 4.0, 0)),
    ],
)
def test_what_an_angle_acts_on_by_chain(chain: str, reference: Any, error: tuple[float, ...]) -> None:
    model = errors(table("Y", {"ECY": 1e-6}, reference=reference), chain=chain)
    np.testing.assert_allclose(model.error(POINT, TOOL), 1e-6 * np.array([error]), atol=1e-18)


def test_what_a_component_depends_on() -> None:
    """By X and Z, growing along X alone; EBX on FXYZ has an arm along Y and, but for the argument Z, none."""
    grows = np.array([[0.0, 0.0], [1e-6, 1e-6]])
    knots = (BOX[0], BOX[2])

    def of(columns: dict[str, Any], **more: Any) -> GridErrors:
        return errors(ComponentTable("X", ("X", "Z"), knots, columns, interpolation="linear", **more))

    yes, no = True, False
    assert of({"EYX": grows}).depends_on.tolist() == [[no] * 3, [yes, no, no], [no] * 3]
    assert of({"EYX": grows.T}).depends_on.tolist() == [[no] * 3, [no, no, yes], [no] * 3]
    # rows Y (arm z) and Z (arm y)
    assert of({"EAX": grows}).depends_on.tolist() == [[no] * 3, [yes, no, no], [yes, yes, no]]
    constant = np.full((2, 2), 1e-6)
    assert of({"EAX": constant}).depends_on.tolist() == [[no] * 3, [no] * 3, [no, yes, no]]
    assert of({"EAX": 0.0 * constant}).depends_on.tolist() == [[no] * 3] * 3
    # rows X (arm y) and Y (arm x)
    assert of({"ECX": grows, "EXX": grows.T}).depends_on.tolist() == [
        [yes, yes, yes],
        [yes, no, no],
        [no] * 3,
    ]
    body = of({"ECX": grows, "EAX": constant, "EXX": grows.T}).bodies[0]
    assert body.turns_with().tolist() == [[no] * 3, [no] * 3, [yes, no, no]]


def kinked(name: str, jump: float, **more: Any) -> ComponentTable:
    """Along X, with one kink of `jump` per mm at 400."""
    options = {"line_mm": LINE, "tool_mm": TOOL_THEN, "interpolation": "linear"} | more
    knots = (np.array([0.0, 400.0, 800.0]),)
    return ComponentTable("X", ("X",), knots, {name: np.array([0.0, 0.0, 400.0 * jump])}, **options)


def test_bounds_of_several_angles_and_tables_add_row_by_row() -> None:
    """EBX and ECX on rows X, Y and Z, a kink of EXX in a table of its own, and one of the axis Z."""
    tables = kinked("EBX", 1e-8), kinked("ECX", 2e-8), kinked("EXX", 3e-6)
    other = ComponentTable(
        "Z", ("Z",), (np.array([-400.0, -200.0, 0.0]),), {"EYZ": [0.0, 0.0, 4e-4]}, interpolation="linear"
    )
    delta = np.array([[20.0, 5.0, -30.0]])
    # arms with this tool, at most in the box: x 4; y 282 or -318; z -420 or -20
    row_x = 5.0 * (1e-8 * 420.0 + 2e-8 * 318.0 + 3e-6) + 0.25 * 20.0 * (1e-8 * 30.0 + 2e-8 * 5.0)
    row_y, row_z = 5.0 * 2e-8 * 4.0 + 0.25 * 30.0 * 2e-6, 5.0 * 1e-8 * 4.0
    expected = (row_x**2 + row_y**2 + row_z**2) ** 0.5
    model = errors(*tables, other)
    assert model.chord_bound(delta, TOOL)[0] == pytest.approx(expected, rel=1e-12)
    # all of them are hidden where X is not known, whichever table comes last
    unknown = np.array([[np.nan, 0.0, 0.0]])
    for several in (tables, tables[::-1], (*tables, other)):
        np.testing.assert_array_equal(np.isnan(errors(*several).rotation(unknown)), [[False, True, True]])


def test_wrong_rows_are_named() -> None:
    model = errors(table("X", {"EBX": 1e-6}))
    maps = MapErrors.of(DeviationMap(tuple(BOX), np.ones((2, 2, 2, 3)), name="a"), BOX, False)  # type: ignore[arg-type]
    for one in (model, maps):
        with pytest.raises(UsageError, match="delta_mm has shape"):
            one.chord_bound(np.zeros(3), TOOL)
        for call in (
            one.error,
            lambda p, t, m=one: m.rotation(p),
            lambda p, t, m=one: list(m.contributions(p, t)),
        ):
            with pytest.raises(UsageError, match="axis_mm has shape"):
                call(np.zeros(3), TOOL)
    with pytest.raises(UsageError, match="tool_mm has shape"):
        model.chord_bound(POINT, np.zeros(2))
    assert [name for name, _ in maps.contributions(POINT, TOOL)] == ["a"]
    assert maps.rotation(POINT).tolist() == [[0.0, 0.0, 0.0]] and maps.backlash_at(POINT) is None


def test_outside_the_box_the_end_holds_also_without_hold() -> None:
    tilt = ComponentTable("X", ("X",), (BOX[0],), {"EZX": [0.0, 8e-3]}, interpolation="linear")
    outside = np.array([[900.0, 0.0, 0.0], [-100.0, 0.0, 0.0]])
    for hold in (False, True):
        model = GridErrors.of("load", [tilt], "FXYZ", ZERO, BOX, hold=hold)
        np.testing.assert_allclose(model.error(outside, TOOL)[:, 2], [8e-3, 0.0])
    # lever arms go on without it, and are clamped with it
    turn = table("X", {"EAX": 1e-6}, line_mm=ZERO, tool_mm=ZERO)
    far = np.array([[0.0, 500.0, 100.0]])
    free = GridErrors.of("load", [turn], "FXYZ", ZERO, BOX, hold=False)
    held = GridErrors.of("load", [turn], "FXYZ", ZERO, BOX, hold=True)
    np.testing.assert_allclose(free.error(far, np.zeros(3)), [[0.0, -1e-4, 5e-4]])
    np.testing.assert_allclose(held.error(far, np.zeros(3)), [[0.0, 0.0, 3e-4]])
