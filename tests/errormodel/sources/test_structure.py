"""A structure that distorts with temperatures: what is refused, its temperatures, shapes and tables."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.distortion import SHAPES, lagged, shapes
from olp.errormodel.sources.structure import Distortion, Sensor, Structure

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
SPAN = (0.0, 800.0)
BEAM = Sensor("beam", 20.0, (15.0, 30.0), 600.0)
COLUMN = Sensor("column", 21.0, (16.0, 26.0))
EXX = Distortion("EXX", "beam", SPAN, 1e-3, 1e-5, 4e-3)


def structure(*distortions: Distortion, **degC: float) -> Structure:
    return Structure((BEAM, COLUMN), distortions or (EXX,), degC or None)


@pytest.mark.parametrize(
    ("sensors", "distortions", "sentence"),
    [
        ((BEAM, COLUMN, BEAM), (), "sensor beam is defined twice; expected each sensor once"),
        ((Sensor("a", math.nan, (1.0, 2.0)),), (), "sensor a: expected finite temperatures, an ascending"),
        ((Sensor("a", 1.0, (1.0, math.inf)),), (), "sensor a: expected finite temperatures"),
        ((Sensor("a", 1.0, (2.0, 1.0)),), (), "sensor a: expected finite temperatures"),
        ((Sensor("a", 1.0, (1.0, 2.0), math.nan),), (), "sensor a: expected finite temperatures"),
        ((BEAM,), (Distortion("EXW", "beam", SPAN),), "distortion of EXW by beam: expected an ISO"),
        ((BEAM,), (Distortion("EXX", "ram", SPAN),), "distortion of EXX by ram: expected an ISO 230-1 name"),
        ((BEAM,), (Distortion("EXX", "beam", (5.0, 5.0)),), "distortion of EXX by beam: expected an ISO"),
        ((BEAM,), (Distortion("EXX", "beam", (math.nan, 5.0)),), "distortion of EXX by beam: expected an"),
    ],
)  # fmt: skip
def test_a_structure_that_cannot_be_is_refused(sensors: Any, distortions: Any, sentence: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Structure(sensors, distortions)
    assert len(caught.value.problems) == 1
    assert caught.value.problems[0].startswith(sentence)


def test_a_range_of_one_temperature_and_a_lead_are_taken() -> None:
    one = Structure((Sensor("a", 20.0, (20.0, 20.0), -30.0), Sensor("b", 1.0, (1.0, 2.0))), ())
    assert one.temperatures_degC is None and one.sensors[1].lag_s == 0.0
    assert one.tables(hold=False) == () and one.rises(hold=False) == {} and one.outside() == {}


def test_temperatures_are_stated_for_each_sensor_and_no_other() -> None:
    now = structure().at({"beam": 24.0, "column": 20.0})
    assert dict(now.temperatures_degC or {}) == {"beam": 24.0, "column": 20.0}
    assert now.sensors == (BEAM, COLUMN) and now.distortions == (EXX,)
    assert now.rises(hold=False) == {"beam": 4.0, "column": -1.0}
    expected = "; expected a temperature of each of beam, column"
    for degC, what in (
        ({"beam": 20.0}, "no temperature of sensor column"),
        ({}, "no temperature of sensor beam"),
        ({"beam": 20.0, "column": 20.0, "ram": 20.0, "bed": 20.0}, "bed is not a sensor"),
        ({"column": 20.0, "ram": 20.0}, "no temperature of sensor beam"),
    ):
        with pytest.raises(ConfigError) as caught:
            structure().at(degC)
        assert str(caught.value) == what + expected


@pytest.mark.parametrize(("degC", "held"), [(15.0, 15.0), (30.0, 30.0), (14.9, 15.0), (30.1, 30.0)])
def test_the_ends_of_the_identified_range_are_in_it(degC: float, held: float) -> None:
    now = structure(beam=degC, column=20.0)
    assert now.outside() == ({} if degC == held else {"beam": degC})
    assert now.rises(hold=True) == {"beam": held - 20.0, "column": -1.0}
    if degC == held:
        assert now.rises(hold=False) == now.rises(hold=True)
        return
    with pytest.raises(ConfigError) as caught:
        now.rises(hold=False)
    assert str(caught.value).startswith(
        f"sensor beam: the structure is at {degC:.2f} degC; expected 15.00 to 30.00 degC, the range that was"
    )


def test_a_log_settles_to_its_end_or_to_a_time_in_it() -> None:
    """The column follows at once; the beam lags 600 s behind a step by exp(-t / 600)."""
    time = np.array([100.0, 700.0, 700.001, 1300.001])
    sensors = {"beam": np.array([20.0, 20.0, 25.0, 25.0]), "column": np.array([18.0, 19.0, 20.0, 21.0]),
               "room": np.full(4, 17.0)}  # fmt: skip

    def settled(at_s: float | None) -> dict[str, float]:
        return dict(structure().settled(time, sensors, at_s).temperatures_degC or {})

    end = {"beam": pytest.approx(25.0 - 5.0 * math.exp(-1.0), abs=1e-4), "column": 21.0}
    assert settled(None) == settled(1300.001) == end
    assert settled(700.0) == {"beam": 20.0, "column": 19.0}
    assert settled(100.0) == {"beam": 20.0, "column": 18.0}
    # the last reading before a time between two readings
    assert settled(699.0) == {"beam": 20.0, "column": 18.0}
    for outside in (99.9, 1300.1):
        with pytest.raises(
            ConfigError, match=rf"the time {outside:g} s is not in the log of temperatures, 100 to"
        ):
            settled(outside)


def test_the_shapes_over_a_span() -> None:
    """Middle 500, half 200: 1, q - 500 and 1 - ((q - 500) / 200)^2."""
    assert SHAPES == ("offset", "growth", "bow")
    expected = [[1, -200, 0], [1, -100, 0.75], [1, 0, 1], [1, 200, 0], [1, 400, -3]]
    np.testing.assert_allclose(
        shapes((300.0, 700.0), np.array([300.0, 400.0, 500.0, 700.0, 900.0])), expected
    )


def test_a_part_follows_its_sensor_with_its_lag() -> None:
    """A ramp of 0.1 K/s from 20 degC: 0.1 (t - lag (1 - exp(-t / lag))) above; a lead is ahead by as much."""
    time = np.array([0.0, 30.0, 50.0, 110.0])
    ramp = 20.0 + 0.1 * time
    behind = 0.1 * 40.0 * (1.0 - np.exp(-time / 40.0))
    np.testing.assert_allclose(lagged(time, ramp, 40.0), ramp - behind, rtol=1e-12)
    np.testing.assert_allclose(lagged(time, ramp, -40.0), ramp + behind, rtol=1e-12)
    np.testing.assert_array_equal(lagged(time, ramp, 0.0), ramp)
    for lag in (0.5, 1.0):
        behind = 0.1 * lag * (1.0 - np.exp(-time / lag))
        np.testing.assert_allclose(lagged(time, ramp, lag), ramp - behind, rtol=1e-12)
        np.testing.assert_allclose(lagged(time, ramp, -lag), ramp + behind, rtol=1e-12)
    # a step falls off with the lag, whatever the spacing
    step = np.array([20.0, 30.0, 30.0, 30.0])
    rest = lagged(np.array([0.0, 1e-6, 40.0, 80.0]), step, 40.0)
    np.testing.assert_allclose(
        rest[2:], [30.0 - 10.0 * math.exp(-1.0), 30.0 - 10.0 * math.exp(-2.0)], rtol=1e-6
    )


def test_tables_are_one_per_line_and_span_and_sensors_add() -> None:
    """Rises of 4 and -1 K; a parabola over three nodes."""
    line, tool = (0.0, 10.0, -20.0), (0.0, 0.0, -50.0)
    now = structure(
        EXX,
        Distortion("EXX", "column", SPAN, 2e-3),
        Distortion("EYX", "beam", SPAN, 0.0, 0.0, 1e-3),
        Distortion("EBX", "beam", SPAN, 1e-6, line_mm=line, tool_mm=tool),
        Distortion("EZX", "column", (-100.0, 900.0), 5e-3),
        Distortion("EYY", "beam", (-300.0, 300.0), 0.0),
        beam=24.0, column=20.0,
    )  # fmt: skip
    one, two, three = now.tables(hold=False)
    assert {table.name for table in (one, two, three)} == {"thermal distortion"}
    assert [(t.axis, t.arguments, t.line_mm, t.tool_mm) for t in (one, two, three)] == [
        ("X", ("X",), None, (0.0, 0.0, 0.0)), ("X", ("X",), line, tool), ("X", ("X",), None, (0.0, 0.0, 0.0)),
    ]  # fmt: skip
    assert one.knots_mm[0].tolist() == [0.0, 400.0, 800.0]
    assert three.knots_mm[0].tolist() == [-100.0, 400.0, 900.0]
    np.testing.assert_allclose(
        one.columns["EXX"], np.array([4 * -3.0 - 2.0, 4 * 5.0 - 2.0, 4 * 5.0 - 2.0]) * 1e-3
    )
    np.testing.assert_allclose(one.columns["EYX"], [0.0, 4e-3, 0.0])
    np.testing.assert_allclose(two.columns["EBX"], [4e-6] * 3)
    np.testing.assert_allclose(three.columns["EZX"], [-5e-3] * 3)
    assert (one.interpolation, one.reference) == ("cubic", "functional-point")
    # at the reference nothing is distorted, and no temperature is none
    assert structure(EXX, beam=20.0, column=30.0).tables(hold=True) == ()
    assert structure(EXX).tables(hold=False) == ()


def test_a_distortion_acts_on_the_lever_arms_of_its_line() -> None:
    """4 K times 1 urad about Y on the tool and on Z, from the line and the tool that it was measured with."""
    bend = Distortion("EBX", "beam", SPAN, 1e-6, line_mm=(0.0, 10.0, -20.0), tool_mm=(0.0, 0.0, -50.0))
    now = structure(bend, beam=24.0, column=20.0)
    points, tool = np.array([[100.0, 0.0, -90.0]]), np.array([7.0, 0.0, -60.0])
    model = build(Calibration("m", BOX, structure=now), "FXYZ")
    np.testing.assert_allclose(
        model.error(points, tool), [[4e-6 * (-90 + 20 - 10), 0.0, -4e-6 * 7.0]], atol=1e-15
    )
    # the equation of the paper knows no tool
    paper = build(Calibration("m", BOX, structure=now, model="huddersfield"), "FXYZ")
    np.testing.assert_allclose(paper.error(points, tool), [[4e-6 * (-90 + 20), 0.0, 0.0]], atol=1e-15)


def test_with_hold_a_structure_too_warm_is_taken_at_the_end_of_its_range() -> None:
    now = structure(Distortion("EYX", "beam", SPAN, 1e-3), beam=40.0, column=20.0)
    calibration = Calibration("m", BOX, structure=now)
    with pytest.raises(ConfigError, match=r"the structure is at 40\.00 degC"):
        build(calibration, "FXYZ")
    held = build(calibration, "FXYZ", outside="hold").error(np.array([[-50.0, 0.0, 0.0]]), np.zeros(3))
    np.testing.assert_allclose(held, [[0.0, 10e-3, 0.0]])
