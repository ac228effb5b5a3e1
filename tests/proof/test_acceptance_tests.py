"""Predicted acceptance tests of machines whose error is known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.proof.acceptance_tests import predicted

DIGIT_MM = 1e-4
TOOL = np.zeros(3)
PLANES = ("XY", "YZ", "ZX")


def machine(
    side_mm: float = 3000.0, slope: float = 0.0, axis: str = "X", backlash_um: float = 0.0
) -> ErrorModel:
    """A cube from -1000 mm on in which one axis is too long by `slope` of its position."""
    box = np.tile([-1000.0, -1000.0 + side_mm], (3, 1))
    nodes = box[0]
    curves = (Curve(axis, nodes, {f"E{axis}{axis}": slope * nodes}, interpolation="linear"),)
    play = tuple(1e-3 * backlash_um * (name == axis) for name in "XYZ")
    return build(Calibration("m", box, curves=curves, backlash_mm=play), "FXYZ")  # type: ignore[arg-type]


@pytest.mark.parametrize(("side_mm", "radius_mm"), [(3000.0, 150.0), (375.0, 150.0), (250.0, 100.0)])
def test_a_circle_fits_into_the_box(side_mm: float, radius_mm: float) -> None:
    circles = predicted(machine(side_mm), TOOL, DIGIT_MM)["circles"]
    assert [c["plane"] for c in circles] == list(PLANES)
    for circle in circles:
        assert circle["radius_mm"] == radius_mm
        assert circle["centre_mm"] == pytest.approx([-1000.0 + side_mm / 2] * 3)
        assert len(circle["before"]["radial_um"]) == 720


@pytest.mark.parametrize("axis", "XYZ")
def test_an_axis_that_is_too_long_makes_an_ellipse(axis: str) -> None:
    """100 um/m over a radius of 150 mm: 15 um at the two ends of the axis, and nothing across it."""
    for circle in predicted(machine(slope=1e-4, axis=axis), TOOL, DIGIT_MM)["circles"]:
        before, after, plane = circle["before"], circle["after"], circle["plane"]
        size = 15.0 if axis in plane else 0.0
        assert before["G_ccw_um"] == pytest.approx(size, abs=0.01)
        assert before["G_cw_um"] == pytest.approx(size, abs=0.01)
        assert before["H_um"] == pytest.approx(0.0, abs=0.01)
        # digits of 0.1 um are left
        assert max(after["G_ccw_um"], after["G_cw_um"]) < 0.2
        quarters = [before["radial_um"][k] for k in (0, 180, 360, 540)]
        ends = [size, 0.0, size, 0.0] if plane[0] == axis else [0.0, size, 0.0, size]
        assert quarters == pytest.approx(ends, abs=0.01)


def test_backlash_is_the_hysteresis_of_a_circle() -> None:
    circles = predicted(machine(backlash_um=10.0), TOOL, DIGIT_MM)["circles"]
    assert [c["before"]["H_um"] for c in circles] == pytest.approx([10.0, 0.0, 10.0], abs=0.1)
    # half of it on both sides of the circle
    assert [c["before"]["G_ccw_um"] for c in circles] == pytest.approx([10.0, 0.0, 10.0], abs=0.2)


def test_diagonals_of_an_axis_that_is_too_long() -> None:
    """Eighteen steps of 4.8 % of 3000 mm at 100 um/m, seen along a diagonal: 259.2 um / sqrt(3)."""
    diagonals = predicted(machine(slope=1e-4), TOOL, DIGIT_MM)["diagonals"]
    assert [row["name"] for row in diagonals["rows"]] == ["PPP", "NPP", "PNP", "NNP"]
    for row in diagonals["rows"]:
        assert row["length_mm"] == pytest.approx(3000.0 * 3**0.5)
        assert row["before"]["E_um"] == pytest.approx(259.2 / 3**0.5, abs=0.01)
        assert row["before"]["B_um"] == pytest.approx(0.0, abs=0.01)
        deviation = row["before"]["deviation_um"]
        assert len(deviation) == 21
        assert deviation[0] == 0.0
        assert deviation[-1] == pytest.approx(288.0 / 3**0.5, abs=0.01)
        assert row["after"]["E_um"] < 0.3
    assert diagonals["before"]["E_um"] == pytest.approx(259.2 / 3**0.5, abs=0.01)


def test_backlash_is_the_reversal_error_of_a_diagonal() -> None:
    diagonals = predicted(machine(backlash_um=10.0), TOOL, DIGIT_MM)["diagonals"]
    assert diagonals["before"]["B_um"] == pytest.approx(10.0 / 3**0.5, abs=0.01)
    assert diagonals["before"]["E_um"] == pytest.approx(10.0 / 3**0.5, abs=0.01)
    assert diagonals["after"]["B_um"] < 0.3


def test_the_tool_is_stated_without_its_payload() -> None:
    assert predicted(machine(), np.array([1.0, 2.0, -3.0, 40.0]), DIGIT_MM)["tool_mm"] == [1.0, 2.0, -3.0]


def straight(component: str, slope: float, box_mm: np.ndarray) -> ErrorModel:
    """An error that rises with the position of an axis, as EXY does."""
    nodes = box_mm["XYZ".index(component[2])]
    curve = Curve(component[2], nodes, {component: slope * nodes}, interpolation="linear")
    return build(Calibration("m", box_mm, curves=(curve,)), "FXYZ")


def test_each_circle_fits_into_its_own_sides_about_the_middle() -> None:
    box = np.array([[0.0, 200.0], [-300.0, 0.0], [100.0, 1100.0]])
    circles = predicted(straight("EXX", 0.0, box), TOOL, DIGIT_MM)["circles"]
    assert [circle["radius_mm"] for circle in circles] == [80.0, 120.0, 80.0]
    assert {tuple(circle["centre_mm"]) for circle in circles} == {(100.0, -150.0, 600.0)}


@pytest.mark.parametrize(("plane", "axis", "sign"), [(0, "X", 1), (0, "Y", -1), (1, "Z", -1), (2, "Z", 1)])
def test_backlash_steps_a_circle_where_its_axis_turns_round(plane: int, axis: str, sign: int) -> None:
    """Half of 10 um ahead in the first half of a turn, and behind in the second, as the cosine of the angle
    has it; the other way round for the second axis of a plane."""
    circle = predicted(machine(axis=axis, backlash_um=10.0), TOOL, DIGIT_MM)["circles"][plane]
    quarters = [circle["before"]["radial_um"][k] for k in (90, 270, 450, 630)]
    half = 5.0 / 2**0.5
    expected = [sign * half, -sign * half] * 2
    assert quarters == pytest.approx(expected, abs=0.05)
    for key in ("G_ccw_um", "G_cw_um", "H_um"):
        assert circle["before"][key] == pytest.approx(10.0, abs=0.1)
        assert circle["after"][key] < 0.5


def test_the_shift_of_a_circle_is_taken_out_and_its_size_is_not() -> None:
    """All axes 100 um/m too long, from an origin far away: the circle is 15 um larger."""
    box = np.tile([1000.0, 4000.0], (3, 1))
    curves = tuple(Curve(a, box[0], {f"E{a}{a}": 1e-4 * box[0]}, interpolation="linear") for a in "XYZ")
    model = build(Calibration("m", box, curves=curves), "FXYZ")
    for circle in predicted(model, TOOL, DIGIT_MM)["circles"]:
        assert circle["before"]["radial_um"] == pytest.approx([15.0] * 720, abs=1e-3)
        assert circle["before"]["G_cw_um"] == pytest.approx(0.0, abs=1e-3)


def test_a_circle_turned_the_other_way_has_its_own_figure() -> None:
    """Out of square by 100 urad an ellipse has the same figures in both directions, and no hysteresis."""
    circle = predicted(straight("EXY", 1e-4, np.tile([-1000.0, 2000.0], (3, 1))), TOOL, DIGIT_MM)["circles"][
        0
    ]
    # the radius changes by 100 urad x 150 mm x sin(2 angle) / 2
    assert [circle["before"][key] for key in ("G_ccw_um", "G_cw_um")] == pytest.approx([15.0] * 2, abs=0.01)
    assert circle["before"]["H_um"] == pytest.approx(0.0, abs=0.01)
    assert [circle["before"]["radial_um"][k] for k in (90, 270)] == pytest.approx([7.5, -7.5], abs=0.01)


def test_corrected_commands_have_so_many_digits() -> None:
    """With a last digit of 0.1 mm a command of an exact machine is up to 71 um off, and a good part of it."""
    after = predicted(machine(), TOOL, 0.1)["circles"][0]["after"]
    angle = 2 * np.pi * np.arange(720) / 720
    points = np.round(np.stack((500 + 150 * np.cos(angle), 500 + 150 * np.sin(angle))) / 0.1) * 0.1
    radial = 1e3 * (np.hypot(*(points - 500)) - 150)
    assert after["radial_um"] == pytest.approx(radial.tolist(), abs=5.0)
    assert after["G_ccw_um"] == pytest.approx(np.ptp(radial), abs=5.0)


@pytest.mark.parametrize(
    ("component", "signs"),
    [("EXX", (1, 1, 1, 1)), ("EXY", (1, -1, -1, 1)), ("EYZ", (1, 1, -1, -1)), ("EZX", (1, -1, 1, -1))],
)
def test_each_diagonal_goes_its_own_way(component: str, signs: tuple[int, ...]) -> None:
    """96 % of 3000 mm at 100 um/m, and how they lie along a diagonal that begins in each corner below."""
    rows = predicted(straight(component, 1e-4, np.tile([-1000.0, 2000.0], (3, 1))), TOOL, DIGIT_MM)[
        "diagonals"
    ]["rows"]
    ends = [row["before"]["deviation_um"][-1] for row in rows]
    assert ends == pytest.approx([sign * 288.0 / 3**0.5 for sign in signs], abs=0.05)
    middle = [row["before"]["deviation_um"][10] for row in rows]
    assert middle == pytest.approx([end / 2 for end in ends], abs=0.05)


def test_the_largest_of_the_diagonals_counts() -> None:
    """X 100 um/m too long and EXY as much: two of the diagonals have both, and two of them neither."""
    box = np.tile([-1000.0, 2000.0], (3, 1))
    curves = (
        Curve("X", box[0], {"EXX": 1e-4 * box[0]}, interpolation="linear"),
        Curve("Y", box[0], {"EXY": 1e-4 * box[0]}, interpolation="linear"),
    )
    diagonals = predicted(build(Calibration("m", box, curves=curves), "FXYZ"), TOOL, DIGIT_MM)["diagonals"]
    sizes = [row["before"]["E_um"] for row in diagonals["rows"]]
    assert sizes == pytest.approx([2 * 259.2 / 3**0.5, 0.0, 0.0, 2 * 259.2 / 3**0.5], abs=0.05)
    assert diagonals["before"]["E_um"] == pytest.approx(2 * 259.2 / 3**0.5, abs=0.05)
    assert diagonals["after"]["E_um"] == max(row["after"]["E_um"] for row in diagonals["rows"])


def test_backlash_is_taken_up_between_the_targets_of_a_diagonal() -> None:
    """One of 50 mm is taken up on the first target of 144 mm, as the tip moves in steps of 7.2 mm."""
    rows = predicted(machine(backlash_um=50e3), TOOL, DIGIT_MM)["diagonals"]["rows"]
    for row in rows:
        assert row["before"]["B_um"] == pytest.approx(50e3 / 3**0.5, rel=1e-6)
        assert row["before"]["E_um"] == pytest.approx(50e3 / 3**0.5, rel=1e-6)
