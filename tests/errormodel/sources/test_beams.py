"""A beam under a moving load, by the formulas of a handbook, and the table that is made of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.sources.beams import Beam, tube_mm4

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
#: E I in N mm2: one kg bends by 9.80665 / E I.
STIFFNESS = 200e3 * 5e6
UNIT = 9.80665 / STIFFNESS


def beam(
    axis: str = "X", support: Any = "simple", span: tuple[float, float] = (-200.0, 1000.0), **more: Any
) -> Beam:
    return Beam(axis, support, span, 200.0, 5e6, **more)


#: Length 1200, the load at a = 300 from the first end, b = 900 from the second: deflection and slope.
BY_HAND = {
    "simple": (300.0**2 * 900.0**2 / (3 * 1200.0), 300.0 * 900.0 * 600.0 / (3 * 1200.0)),
    "fixed": (300.0**3 * 900.0**3 / (3 * 1200.0**3), 300.0**2 * 900.0**2 * 600.0 / (2 * 1200.0**3)),
    "cantilever": (300.0**3 / 3.0, 300.0**2 / 2.0),
}


@pytest.mark.parametrize("support", BY_HAND)
def test_deflection_and_slope_of_each_support(support: str) -> None:
    deflection, slope = beam(support=support).bends(np.array([100.0]))
    assert (deflection[0], slope[0]) == pytest.approx([UNIT * v for v in BY_HAND[support]], rel=1e-12)
    # the other way round: 300 mm from the first end again, and the slope falls along the axis
    deflection, slope = beam(support=support, span=(1000.0, -200.0)).bends(np.array([700.0]))
    expected = UNIT * BY_HAND[support][0], -UNIT * BY_HAND[support][1]
    assert (deflection[0], slope[0]) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("support", BY_HAND)
@pytest.mark.parametrize("span", [(-200.0, 1000.0), (1000.0, -200.0)])
def test_a_beam_is_symmetric_and_rests_on_its_ends(support: str, span: tuple[float, float]) -> None:
    one = beam(support=support, span=span)
    deflection, slope = one.bends(np.array([-200.0, 400.0, 700.0, 100.0, 1000.0]))
    if support == "cantilever":
        first = 0 if span[0] < span[1] else -1
        assert deflection[first] == slope[first] == 0.0
        return
    assert deflection[0] == deflection[-1] == slope[1] == 0.0
    assert deflection[2] == pytest.approx(deflection[3]) and slope[2] == pytest.approx(-slope[3])
    assert deflection[1] > deflection[2] > 0.0


@pytest.mark.parametrize(
    ("chain", "axis", "direction", "error", "angle"),
    # the weight goes along: the tool lowers, a table that carries the workpiece lifts the tool against it;
    # turns are about axis x direction, the sag growing along the axis
    [
        ("FXYZ", "X", "-Z", ("EZX", -1.0), ("EBX", 1.0)),
        ("XFYZ", "X", "-Z", ("EZX", 1.0), ("EBX", 1.0)),
        ("FXYZ", "X", "+Z", ("EZX", 1.0), ("EBX", -1.0)),
        ("FXYZ", "X", "+Y", ("EYX", 1.0), ("ECX", 1.0)),
        ("XFYZ", "X", "-Y", ("EYX", 1.0), ("ECX", -1.0)),
        ("FXYZ", "Y", "-Z", ("EZY", -1.0), ("EAY", -1.0)),
        ("FXYZ", "Y", "+X", ("EXY", 1.0), ("ECY", -1.0)),
        ("FXYZ", "Z", "+X", ("EXZ", 1.0), ("EBZ", 1.0)),
        ("FXYZ", "Z", "-Y", ("EYZ", -1.0), ("EAZ", 1.0)),
    ],
)
def test_the_table_of_a_beam(
    chain: str, axis: str, direction: str, error: tuple[str, float], angle: tuple[str, float]
) -> None:
    line, tool = (1.0, 2.0, 3.0), (0.0, 0.0, -80.0)
    one = beam(axis, "cantilever", (-500.0, 1000.0), direction=direction, line_mm=line, tool_mm=tool)
    table = one.table(BOX, chain)
    low, high = BOX["XYZ".index(axis)]
    assert (table.axis, table.arguments, table.name) == (axis, (axis,), f"beam of axis {axis}")
    assert (table.line_mm, table.tool_mm, table.reference) == (line, tool, "functional-point")
    assert table.interpolation == "cubic"
    np.testing.assert_allclose(table.knots_mm[0], np.linspace(low, high, 65))
    a = table.knots_mm[0] + 500.0
    assert list(table.columns) == [error[0], angle[0]]
    np.testing.assert_allclose(table.columns[error[0]], error[1] * UNIT * a**3 / 3.0, rtol=1e-12)
    np.testing.assert_allclose(table.columns[angle[0]], angle[1] * UNIT * a**2 / 2.0, rtol=1e-12)


def test_beams_bend_with_the_payload_beyond_the_calibration_each_on_its_own_lever_arms() -> None:
    """One below the other: the tip of the tool is 80 mm below one neutral line and 30 mm below the other."""
    two = beam(tool_mm=(0.0, 0.0, 0.0)), beam(support="fixed", tool_mm=(0.0, 0.0, -50.0))
    model = build(Calibration("m", BOX, beams=two, payload_kg=4.0), "FXYZ")
    points = np.array([[100.0, 20.0, 0.0]])
    tool = np.array([0.0, 0.0, -80.0, 14.0])
    (one, turn), (other, bend) = ([float(v[0]) for v in b.bends(np.array([100.0]))] for b in two)
    # between nodes of the table a cubic is within 1e-4
    expected = 10.0 * np.array([[turn * -80.0 + bend * -30.0, 0.0, -one - other]])
    np.testing.assert_allclose(model.error(points, tool), expected, rtol=1e-4)
    np.testing.assert_allclose(
        model.rotation(points, None, 14.0), [[0.0, 10.0 * (turn + bend), 0.0]], rtol=1e-4
    )
    names = [name for name, _ in model.contributions(points, tool)]
    assert names == ["load EZX", "load EBX"] * 2


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"axis": "A"}, "beam of axis A with weight along -Z; expected a direction across it"),
        ({"direction": "-W"}, "beam of axis X with weight along -W; expected a direction across it"),
        ({"direction": "+X"}, "beam of axis X with weight along +X; expected a direction across it"),
        ({"span_mm": (5.0, 5.0)}, "beam of axis X: expected two different ends, and modulus and section"),
        ({"youngs_modulus_GPa": 0.0}, "beam of axis X: expected two different ends"),
        ({"second_moment_mm4": 0.0}, "beam of axis X: expected two different ends"),
        ({"second_moment_mm4": -1.0}, "beam of axis X: expected two different ends"),
    ],
)
def test_a_beam_that_cannot_be_is_refused(options: dict[str, Any], sentence: str) -> None:
    good = {
        "axis": "X", "support": "simple", "span_mm": (0.0, 1e-9), "youngs_modulus_GPa": 0.5,
        "second_moment_mm4": 1e-9,
    }  # fmt: skip
    assert Beam(**good).direction == "-Z" and Beam(**good).tool_mm == (0.0, 0.0, 0.0)
    assert Beam(**(good | {"direction": "-Y"})).line_mm is None
    with pytest.raises(ConfigError) as caught:
        Beam(**(good | options))
    assert str(caught.value).startswith(sentence)


def test_sections_of_tubes_by_hand() -> None:
    assert tube_mm4(40.0, 60.0, 5.0) == pytest.approx((40.0 * 60.0**3 - 30.0 * 50.0**3) / 12.0)
    # a wall of half the width or half the height leaves no hole
    assert tube_mm4(40.0, 60.0, 20.0) == tube_mm4(40.0, 60.0, 30.0) == 40.0 * 60.0**3 / 12.0
    assert tube_mm4(60.0, 40.0, 20.0) == tube_mm4(60.0, 40.0, 25.0) == 60.0 * 40.0**3 / 12.0
    assert tube_mm4(60.0, 40.0, 19.5) == pytest.approx((60.0 * 40.0**3 - 21.0) / 12.0)
