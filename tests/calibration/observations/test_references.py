"""Squares and straightedges that are turned over: their errors and those of the machine come out apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.calibration import case

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.curves import calibration_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.summary import summary
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.references import Square, Straightedge
from olp.core.errors import ConfigError
from olp.files.measurements.reader import load_measurements

UM = 1e-3


def form_mm(q: np.ndarray) -> np.ndarray:
    """A straightedge far worse than the machine: a bow, a wave and a step."""
    return 0.03 * ((q - 900.0) / 900.0) ** 2 + 0.008 * np.sin(q / 170.0) + 0.01 * (q > 1300.0)


def against(line: Line, name: str, turned: bool, seed: int) -> Line:
    """A line read against a straightedge of that form, with noise of its own."""
    form = form_mm(line.target_mm) * (-1.0 if turned else 1.0)
    noise = np.random.default_rng(seed).normal(0.0, 0.3 * UM, len(form))
    source = f"{line.component}-{'turned' if turned else 'direct'}.csv"
    return replace(
        line, value=line.value + form + noise, straightedge=name, turned=turned, square=None, source=source
    )


def reversed_case() -> tuple[Fit, Fit]:
    """A machine whose EYX was read against a bad straightedge in both ways; and against a perfect one."""
    _, measurements = case(3, "smooth", "FXYZ")
    others = [line for line in measurements.lines if line.component != "EYX"]
    own = replace(next(line for line in measurements.lines if line.component == "EYX"), square=None)
    edges = (Straightedge("granite"),)
    both = [against(own, "granite", turned, k) for k, turned in enumerate((False, True))]
    bad = replace(measurements.with_lines((*others, *both)), straightedges=edges)
    return fit(bad, "FXYZ"), fit(measurements.with_lines((*others, own)), "FXYZ")


@pytest.mark.slow
def test_a_straightedge_that_is_turned_over_need_not_be_straight() -> None:
    bad, good = reversed_case()
    q = np.linspace(*bad.box_mm[0], 60)
    found, wanted = (one.curve("EYX", q) @ one.theta for one in (bad, good))
    assert np.ptp(form_mm(q)) > 40 * UM
    assert np.abs(found - wanted).max() < 0.8 * UM
    assert len(bad.prior.shapes["EYX"].features) == len(good.prior.shapes["EYX"].features)
    rows = summary(bad, calibration_of(bad), [])["straightedges"]
    at = np.array([row["target_mm"] for row in rows])
    form = form_mm(at) - np.polyval(np.polyfit(at, form_mm(at), 1), at)
    rest = np.array([row["form_um"] for row in rows]) * UM - form
    assert np.sqrt(np.mean(rest**2)) < 0.5 * UM
    assert 0.05 < np.mean([row["sigma_um"] for row in rows]) < 0.5


@pytest.mark.slow
def test_a_square_that_is_turned_over_need_not_be_square() -> None:
    """Its angle is unknown to 1 mrad and 300 urad off; it comes out beside the squareness of the machine."""
    _, measurements = case(3, "smooth", "FXYZ")
    pair = [line for line in measurements.lines if line.square and set(line.component[1:]) == {"X", "Y"}]
    name = pair[0].square
    off = 300e-6
    lines: list[Line] = [line for line in measurements.lines if line not in pair]
    for line in pair:
        for turned in (False, True):
            slope = (-off if turned else off) if line.component == "EXY" else 0.0
            own = line.value + slope * (line.target_mm - line.target_mm.mean())
            lines.append(replace(line, value=own, turned=turned, source=f"{line.component}{turned}.csv"))
    squares = [Square(s.name, 0.0, 1e-3) if s.name == name else s for s in measurements.squares]
    turned = fit(replace(measurements.with_lines(lines), squares=tuple(squares)), "FXYZ")
    known = fit(measurements, "FXYZ")
    found, wanted = (float(one.squareness("C0Y") @ one.theta) for one in (turned, known))
    sigma = float(np.sqrt(known.squareness("C0Y") @ known.covariance @ known.squareness("C0Y")))
    assert abs(found - wanted) < 4.0 * sigma
    row = next(r for r in summary(turned, calibration_of(turned), [])["squares"] if r["name"] == name)
    assert row["error_urad"] == pytest.approx(off / 1e-6, abs=12.0)
    assert row["sigma_urad"] < 3.0


READINGS = "target_mm,run,direction,value_um\n0,1,1,0\n50,1,1,1\n99,1,1,2\n"
PLAN = """schema = "olp-measurements-1"
machine = "m"
chain = "FXYZ"
measured = 2026-05-14
temperature_degC = 20.0
{straightedges}
[defaults]
sense = "actual-minus-commanded"
tool_mm = [0.0, 0.0, -100.0]
line_mm = {{ X = 0.0, Y = 0.0, Z = 0.0 }}
sigma_um = 0.5
{lines}
"""
EDGE = '[[straightedges]]\nname = "granite"\n'
LINE = '[[lines]]\nfile = "a.csv"\ncomponent = "{}"\n{}\n'


@pytest.mark.parametrize(
    ("edges", "lines", "words"),
    [
        ("", [("EYX", 'straightedge = "granite"')], 'straightedge "granite" is not defined'),
        (EDGE, [("EYX", 'straightedge = "granite"')], "expected one with turned_over the other way"),
        (EDGE, [("EZX", 'straightedge = "granite"\nturned_over = true')], "still sags by its own weight"),
        (EDGE, [("EXX", 'straightedge = "granite"')], "EXX is not a straightness"),
        (EDGE, [("EYX", "turned_over = true")], "turned_over is stated without a square or straightedge"),
        (EDGE, [("EYX", 'straightedge = "granite"\nsquare = "s"')], "are both stated"),
    ],
)
def test_what_a_straightedge_cannot_be(
    edges: str, lines: list[tuple[str, str]], words: str, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text(READINGS, "utf-8")
    text = PLAN.format(straightedges=edges, lines="".join(LINE.format(*line) for line in lines))
    (tmp_path / "measurements.toml").write_text(text, "utf-8")
    with pytest.raises(ConfigError, match=words):
        load_measurements([tmp_path])


def test_a_reversal_is_read_from_a_plan(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(READINGS, "utf-8")
    lines = [('straightedge = "granite"\nturned_over = ' + way) for way in ("true", "false")]
    text = PLAN.format(straightedges=EDGE, lines="".join(LINE.format("EYX", line) for line in lines))
    (tmp_path / "measurements.toml").write_text(text, "utf-8")
    taken: Measurements = load_measurements([tmp_path])
    assert [line.turned for line in taken.lines] == [True, False]
    assert taken.straightedges == (Straightedge("granite"),)


def test_a_line_against_a_straightedge_put_right_has_the_same_targets() -> None:
    """The form is known at its targets only, so no other order of them is tried."""
    q = np.linspace(0.0, 900.0, 4)
    one = np.ones(4, np.int64)
    line = Line("EYX", q, 0.0 * q, one, one, (0.0, 0.0, 0.0), sigma=UM, straightedge="granite")
    assert "order" not in {other.kind for other in line.alternatives()}
    assert all(np.array_equal(other.observation.target_mm, q) for other in line.alternatives())
