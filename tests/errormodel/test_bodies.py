"""The bodies of a chain: their order, what they carry, and how long the series of their turns are."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.bodies import Body, build_bodies
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.chain import RigidBody
from olp.errormodel.sources.cyclic import Cyclic

BOX = np.array([[0.0, 100.0], [-300.0, 300.0], [-400.0, 0.0]])
NONE: frozenset[str] = frozenset()
X = np.array([0.0, 25.0, 50.0, 100.0])


def body(axis: str = "X", chain: str = "FXYZ", skip: frozenset[str] = NONE, **parts: Any) -> Body:
    bodies = build_bodies(Calibration("m", BOX, **parts), chain, skip)
    return next(b for b in bodies if b.axis == "XYZ".index(axis))


def test_bodies_come_from_tool_to_workpiece() -> None:
    calibration = Calibration(
        "m", BOX, datum_mm=(1.0, 2.0, 3.0), squareness={"C0Y": 1e-3, "B0Z": 2e-3, "A0Z": 4e-3}
    )
    bodies = build_bodies(calibration, "YXFZ", NONE)
    assert [b.axis for b in bodies] == [2, 0, 1]
    assert [b.carries_workpiece for b in bodies] == [False, True, True]
    assert [b.datum_mm for b in bodies] == [3.0, 1.0, 2.0]
    assert [b.shear for b in bodies] == [(2e-3, -4e-3, 0.0), (0.0, 0.0, 0.0), (-1e-3, 0.0, 0.0)]
    skipped = build_bodies(calibration, "FXYZ", frozenset({"A0Z", "C0Y"}))
    assert [b.shear for b in skipped] == [(2e-3, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    for chain in ("XYZ", "FXY", "FXYZZ", ""):
        with pytest.raises(ConfigError, match=f"chain '{chain}'; expected X, Y, Z and F"):
            build_bodies(calibration, chain, NONE)


@pytest.mark.parametrize(
    ("angle", "terms"),
    # on 1 m of tool: the third power over 6 or the fourth over 8 of the angle times 1 m is 2e-11 mm
    [(0.0, 1), (4.9316e-5, 1), (4.934e-5, 2), (6.3e-4, 2), (6.35e-4, 0), (-6.35e-4, 0), (0.1, 0)],
)
def test_short_series_are_taken_where_they_are_exact(angle: float, terms: int) -> None:
    turned = Curve("Z", BOX[2], {"EAZ": [angle, angle]})
    assert body("Z", curves=(turned,)).sine_terms == terms
    assert body("X", curves=(turned,)).sine_terms == 1


def test_the_farthest_lever_arm_decides_how_long_a_series_is() -> None:
    """An angle of X acts on 1 m of tool and 400 mm of Z: 1.4 m."""
    for angle, terms in ((4.40e-5, 1), (4.42e-5, 2), (5.80e-4, 2), (5.83e-4, 0)):
        assert body(curves=(Curve("X", BOX[0], {"EBX": [0.0, angle]}),)).sine_terms == terms


@pytest.mark.parametrize("angle", [4e-5, 4.4e-4, 5e-3])
def test_series_and_sines_are_the_same_turn(angle: float) -> None:
    """A turn about Z of Z: (cos c - 1) x - sin c y, with a tool of 1 m."""
    model = build(Calibration("m", BOX, curves=(Curve("Z", BOX[2], {"ECZ": [angle, angle]}),)), "FXYZ")
    error = model.error(np.zeros((1, 3)), np.array([1000.0, -700.0, 0.0]))
    c, s = -2.0 * math.sin(0.5 * angle) ** 2, math.sin(angle)
    np.testing.assert_allclose(error, [[c * 1000.0 + s * 700.0, s * 1000.0 - c * 700.0, 0.0]], atol=4e-11)


def test_sines_are_tabled_where_they_are_exact_between_nodes_too() -> None:
    """The sine of an angle that rises over one cell leaves its chord by a sixteenth of the third power, times
    1 m of tool. What has a direction or repeats is more than a table."""
    for most, tabled in ((6e-5, True), (8e-5, False)):
        straight = Curve("Z", [-400.0, 0.0], {"EAZ": [0.0, most]}, interpolation="linear")
        both = body("Z", curves=(straight,))
        assert both.sine_terms == 2
        assert (both.sines is not None) == tabled
    fine = Curve("Z", BOX[2], {"EAZ": [2e-4, 2e-4]})
    assert body("Z", curves=(fine,)).sines is not None
    played = Curve("Z", BOX[2], forward={"EAZ": [2e-4, 2e-4]}, backward={"EAZ": [1e-4, 2e-4]})
    assert body("Z", curves=(played,)).sines is None
    assert body("Z", curves=(fine,), cyclic=(Cyclic("EXZ", 10.0, 1e-3),)).sines is None


def test_tabled_sines_turn_as_the_series_does() -> None:
    """Over a curve that bends, at places that are no nodes."""
    knots = np.linspace(-400.0, 0.0, 9)
    angles = 3e-4 * np.sin(knots / 60.0)
    curve = Curve("Z", knots, {"EAZ": angles, "EBZ": -angles, "ECZ": 0.5 * angles})
    calibration = Calibration("m", BOX, curves=(curve,))
    model = build(calibration, "FXYZ")
    bodies = build_bodies(calibration, "FXYZ", NONE)
    assert [b.sines is not None for b in bodies] == [True, False, False]
    series = RigidBody(BOX, False, tuple(replace(b, sines=None) for b in bodies))
    place = np.random.default_rng(4).uniform(BOX[:, 0], BOX[:, 1], (500, 3))
    tool = np.array([900.0, -700.0, 800.0])
    np.testing.assert_allclose(model.error(place, tool), series.error(place, tool), atol=2e-11, rtol=0)
    assert np.array_equal(model.rotation(place), series.rotation(place))
    # to first order the angles themselves turn
    first, other = (RigidBody(BOX, False, some, exact=False) for some in (bodies, series.bodies))
    assert np.array_equal(first.error(place, tool), other.error(place, tool))
