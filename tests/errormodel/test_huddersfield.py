"""The paper's equation (1) in its own names and signs, decoded into ISO 230-1 names."""

from __future__ import annotations

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Thermal

BOX = np.array([[0.0, 1000.0]] * 3)
P = np.array([[0.0, 0.0, 0.0], [400.0, 300.0, 200.0], [1000.0, 950.0, 777.0]])
TOOL = np.array([10.0, 130.0, -243.5])


def seed_equation(s: dict[str, float], p: np.ndarray) -> np.ndarray:
    """Equation (1): in x, y and z with the paper's signs."""
    _, y, z = p.T
    return np.stack(
        [
            s["X_lin"]
            + s["Y_strX"]
            + s["Z_strX"]
            + (s["X_pitch"] + s["Y_roll"] + s["XZ"]) * z
            + (s["X_yaw"] + s["XY"]) * y,
            s["Y_lin"] + s["X_strY"] + s["Z_strY"] + (s["X_roll"] + s["Y_pitch"] + s["YZ"]) * z,
            s["Z_lin"] + s["X_strZ"] + s["Y_strZ"] - s["X_roll"] * y,
        ],
        axis=1,
    )


def decoded(e: dict[str, float]) -> dict[str, float]:
    return {
        "X_lin": e["EXX"], "X_strY": e["EYX"], "X_strZ": e["EZX"], "X_roll": -e["EAX"], "X_pitch": e["EBX"],
        "X_yaw": -e["ECX"], "Y_strX": e["EXY"], "Y_lin": e["EYY"], "Y_strZ": e["EZY"], "Y_pitch": -e["EAY"],
        "Y_roll": e["EBY"], "Z_strX": e["EXZ"], "Z_strY": e["EYZ"], "Z_lin": e["EZZ"], "XY": -e["C0Y"],
        "XZ": e["B0Z"], "YZ": -e["A0Z"],
    }  # fmt: skip


def calibration(e: dict[str, float], **options: object) -> Calibration:
    curves = tuple(
        Curve(
            a,
            [0.0, 1000.0],
            {n: [v, v] for n, v in e.items() if n[2] == a and n[0] == "E"},
            tool_mm=(0, 0, -99.0),
        )
        for a in "XYZ"
    )
    square = {n: e[n] for n in SQUARENESS}
    return Calibration("m", BOX, model="huddersfield", curves=curves, squareness=square, **options)


@pytest.mark.parametrize("seed", range(20))
def test_equals_the_equation_for_any_tool(seed: int) -> None:
    rng = np.random.default_rng(seed)
    e = {n: float(rng.normal() * (0.02 if n[1] in "XYZ" else 5e-5)) for n in (*COMPONENTS, *SQUARENESS)}
    expected = seed_equation(decoded(e), P)
    for tool in (np.zeros(3), TOOL, np.tile(TOOL, (3, 1))):
        np.testing.assert_allclose(build(calibration(e), "FXYZ").error(P, tool), expected, atol=1e-12)


@pytest.mark.parametrize("name", ["ECY", "EAZ", "EBZ", "ECZ"])
def test_four_angles_move_nothing_and_still_turn_the_tool(name: str) -> None:
    e = dict.fromkeys((*COMPONENTS, *SQUARENESS), 0.0) | {name: 5e-5}
    model = build(calibration(e), "FXYZ")
    assert not model.error(P, TOOL).any()
    assert not model.depends_on.any()
    assert np.abs(model.rotation(P)).max() == 5e-5


def test_agrees_with_the_rigid_body_without_a_tool() -> None:
    """0.1 um at 50 urad and 1 m: what the equation leaves out is second order."""
    rng = np.random.default_rng(1)
    e = {n: float(rng.normal() * (0.02 if n[1] in "XYZ" else 2e-5)) for n in (*COMPONENTS, *SQUARENESS)}
    curves = tuple(Curve(c.axis, c.position_mm, c.columns) for c in calibration(e).curves)
    rigid = Calibration("m", BOX, curves=curves, squareness={n: e[n] for n in SQUARENESS})
    zero = np.zeros(3)
    np.testing.assert_allclose(
        build(rigid, "FXYZ").error(P, zero), build(calibration(e), "FXYZ").error(P, zero), atol=1e-4
    )


def test_contributions_add_up_exactly() -> None:
    e = {n: 1e-5 * (k + 1) for k, n in enumerate((*COMPONENTS, *SQUARENESS))}
    model = build(calibration(e, thermal=Thermal((1e-5, 0.0, 0.0), scale_degC=(25.0, 20.0, 20.0))), "FXYZ")
    parts = dict(model.contributions(P, TOOL))
    np.testing.assert_allclose(sum(parts.values()), model.error(P, TOOL), atol=1e-12)
    assert "scale expansion X" in parts


def test_another_chain_is_refused() -> None:
    with pytest.raises(ConfigError, match="FXYZ"):
        build(calibration(dict.fromkeys((*COMPONENTS, *SQUARENESS), 0.0)), "FYXZ")
