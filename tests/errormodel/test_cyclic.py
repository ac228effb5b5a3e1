"""Angular cyclic errors that were measured elsewhere than the curves of their axis."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from judge.model import JudgeModel

from olp.core.errors import ConfigError
from olp.core.machine import CHAINS
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Cyclic
from olp.errormodel.uncertainty import fingerprint
from olp.files.calibration.reader import load_calibration

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
ROWS = {"x.csv": "X_mm,EXX_um,EBX_urad,ECX_urad\n-1000,-9,-20,10\n500,3,12,-5\n2000,4,-15,8\n"}
CURVES = """datum_mm = [20.0, -30.0, 40.0]
[[curves]]
file = "x.csv"
line_mm = { Y = 150.0, Z = -90.0 }
tool_mm = [10.0, 0.0, -70.0]
interpolation = "linear"
"""
#: What a term states of its own measurement.
STATED = {
    "nothing": "",
    "a line": "line_mm = { Y = -120.0 }\n",
    "a tool": "tool_mm = [0.0, 35.0, -200.0]\n",
    "a table": 'reference = "table"\n',
    "the tip": 'reference = "functional-point"\n',
    "all": 'line_mm = { Y = -120.0, Z = 10.0 }\ntool_mm = [5.0, 6.0, -7.0]\nreference = "table"\n',
}


def waves(stated: str) -> str:
    table = '[[cyclic]]\ncomponent = "{}"\nperiod_mm = {}\namplitude_urad = {}\nphase_rad = 0.3\n'
    parts = (("EAX", 45.0, 11.0), ("EBX", 40.0, 15.0), ("ECX", 50.0, -12.0))
    return "".join(table.format(*part) + stated for part in parts)


@pytest.mark.parametrize("chain", ["FXYZ", "XFYZ", "YXFZ", "ZXYF", "ZYFX"])
@pytest.mark.parametrize(
    "curves", ["", CURVES, CURVES + 'reference = "table"\n'], ids=["none", "tip", "table"]
)
@pytest.mark.parametrize("stated", STATED.values(), ids=STATED)
def test_a_cyclic_angle_acts_on_its_own_line(tmp_path: Path, stated: str, curves: str, chain: str) -> None:
    path = machine(
        tmp_path, (curves or "datum_mm = [20.0, -30.0, 40.0]\n") + waves(stated), ROWS,
        tables=TRUE_ZERO, chain=chain,
    )  # fmt: skip
    points = np.random.default_rng(5).uniform(-900.0, 1900.0, (200, 3))
    tool = np.array([20.0, -15.0, -120.0])
    model = build(load_calibration(path.with_name("calibration.toml")), chain)
    error = model.error(points, tool)
    # products of two angles and a lever arm of 3 m
    np.testing.assert_allclose(error, JudgeModel(path).error_mm(points, tool), atol=1e-5)
    # and to first order the sources add up to it
    np.testing.assert_allclose(sum(v for _, v in model.contributions(points, tool)), error, atol=1e-5)


def test_only_an_angle_has_a_lever_arm(tmp_path: Path) -> None:
    text = (
        '[[cyclic]]\ncomponent = "EXX"\nperiod_mm = 10.0\namplitude_um = 2.0\ntool_mm = [0.0, 0.0, -50.0]\n'
    )
    path = machine(tmp_path, text, ROWS, tables=TRUE_ZERO)
    with pytest.raises(ConfigError, match=r"cyclic\[0\]\.tool_mm does not fit component EXX"):
        load_calibration(path.with_name("calibration.toml"))
    with pytest.raises(ConfigError, match="cyclic EXX has no lever arm; expected no reference"):
        Cyclic("EXX", 10.0, 1e-3, reference="table")


def test_a_covariance_holds_for_one_place_of_the_measurement() -> None:
    term = Cyclic("EBX", 40.0, 15e-6, 0.3)
    elsewhere = [
        dataclasses.replace(term, line_mm=(0.0, 5.0, 0.0)),
        dataclasses.replace(term, tool_mm=(0.0, 0.0, -5.0)),
        dataclasses.replace(term, reference="table"),
    ]
    marks = {fingerprint(Calibration("m", BOX, cyclic=(t,))) for t in (term, *elsewhere)}
    assert len(marks) == 4


@pytest.mark.parametrize("chain", sorted(CHAINS))
def test_the_chord_bound_holds_with_a_line_of_its_own(chain: str) -> None:
    term = Cyclic("ECX", 40.0, 15e-6, 0.3, (0.0, 250.0, -300.0), (80.0, 0.0, -200.0), "table")
    model = build(Calibration("m", BOX, cyclic=(term,)), chain)
    rng = np.random.default_rng(6)
    start, end = rng.uniform(BOX[:, 0], BOX[:, 1], (2, 100, 3))
    delta = (end - start) * 10.0 ** rng.uniform(-3.0, 0.0, (100, 1))
    tool, share = np.array([20.0, -40.0, -150.0]), np.linspace(0.0, 1.0, 129)
    points = start[:, None, :] + share[None, :, None] * delta[:, None, :]
    error = model.error(points.reshape(-1, 3), tool).reshape(points.shape)
    chord = error[:, :1] + share[None, :, None] * (error[:, -1:] - error[:, :1])
    departure = np.linalg.norm(error - chord, axis=2).max(axis=1)
    assert np.all(departure <= model.chord_bound(delta, tool) * (1.0 + 1e-9) + 1e-13)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"component": "EXW"}, "cyclic component 'EXW'; expected a name such as EXX or EAX"),
        ({"period_mm": 0.0}, "cyclic EAX: period 0.0 mm; expected more than 0"),
        ({"period_mm": math.inf}, "cyclic EAX: period inf mm; expected more than 0"),
        ({"amplitude": math.nan}, "cyclic EAX: amplitude and phase must be finite"),
        ({"phase_rad": math.inf}, "cyclic EAX: amplitude and phase must be finite"),
        ({"component": "EXX", "tool_mm": (0, 0, 0)}, "cyclic EXX has no lever arm; expected no tool_mm"),
        (
            {"component": "EZX", "line_mm": (0, 0, 0), "reference": "table"},
            "cyclic EZX has no lever arm; expected no line_mm, reference",
        ),
    ],
)
def test_what_is_wrong_with_a_cyclic_term(options: dict[str, object], sentence: str) -> None:
    good = {"component": "EAX", "period_mm": 1e-9, "amplitude": 0.0}
    assert Cyclic(**good).measured() == {} and Cyclic(**good).phase_rad == 0.0
    with pytest.raises(ConfigError) as caught:
        Cyclic(**(good | options))
    assert caught.value.problems == (sentence,)
