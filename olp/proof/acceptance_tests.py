"""Acceptance tests that you can run later, predicted from the error model: circles after ISO 230-4 and body
diagonals after ISO 230-6, on the uncompensated machine and with corrected commands."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.compensation.invert import invert
from olp.core.arrays import Array
from olp.core.units import UM_PER_MM
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays

#: mm; radius of the circles, at most.
_RADIUS_MM = 150.0
#: Radius of the circles as a share of the shorter side of the calibrated box, at most.
_SHARE = 0.4
#: Points of a circle.
_POINTS = 720
#: Targets of a diagonal.
_TARGETS = 21
#: Steps between targets of a diagonal, so that backlash is taken up as on the machine.
_STEPS = 20
#: The two axes of each circle.
_PLANES = {"XY": (0, 1), "YZ": (1, 2), "ZX": (2, 0)}


def predicted(model: ErrorModel, tool_mm: Array, digit_mm: float) -> dict[str, Any]:
    """What a ball-bar and a laser on the diagonals should show in the middle of the calibrated box, in um.

    `tool_mm` (3,) is the tool vector, or (4,) with the payload in kg, `digit_mm` the last digit of corrected
    commands. Following error and thermal drift are not part of it.
    """
    return {
        "tool_mm": tool_mm[:3].tolist(),
        "circles": [_circle(model, tool_mm, digit_mm, plane) for plane in _PLANES],
        "diagonals": _diagonals(model, tool_mm, digit_mm),
    }


def _runs(model: ErrorModel, target: Array, tool: Array, digit: float) -> dict[str, Array]:
    """Where the tip goes on targets (n, 3), with uncorrected and with corrected commands."""
    command = target
    for _ in range(2):
        # the side of the backlash depends on the corrected commands, and they on it
        command = invert(model, target, tool, plays(model, command))
    command = np.round(command / digit) * digit
    return {
        name: c + model.error(c, tool, plays(model, c))
        for name, c in (("before", target), ("after", command))
    }


def _circle(model: ErrorModel, tool: Array, digit: float, plane: str) -> dict[str, Any]:
    """Circular deviation G of each direction and hysteresis H (ISO 230-4, 3.2 to 3.4), the centre of the
    least-squares circle taken out as a ball-bar does."""
    first, second = _PLANES[plane]
    box = np.asarray(model.box_mm, float)
    centre = box.mean(axis=1)
    side = float(np.diff(box, axis=1)[[first, second]].min())
    radius = min(_RADIUS_MM, round(_SHARE * side))
    # a lap and a quarter: the first quarter takes up the unknown play
    angle = 2.0 * np.pi * np.arange(_POINTS * 5 // 4) / _POINTS
    result: dict[str, Any] = {"plane": plane, "radius_mm": radius, "centre_mm": centre.tolist()}
    radial: dict[str, list[Array]] = {"before": [], "after": []}
    for direction in (1.0, -1.0):
        target = np.tile(centre, (len(angle), 1))
        target[:, first] += radius * np.cos(direction * angle)
        target[:, second] += radius * np.sin(direction * angle)
        for name, actual in _runs(model, target, tool, digit).items():
            lap = (actual - centre)[-_POINTS:, [first, second]]
            order = np.argsort((direction * angle[-_POINTS:]) % (2 * np.pi))
            radial[name].append(_radial(lap, radius)[order])
    for name, (forward, backward) in radial.items():
        result[name] = {
            "G_ccw_um": float(np.ptp(forward)) * UM_PER_MM,
            "G_cw_um": float(np.ptp(backward)) * UM_PER_MM,
            "H_um": float(np.abs(forward - backward).max()) * UM_PER_MM,
            "radial_um": (forward * UM_PER_MM).tolist(),
        }
    return result


def _radial(lap: Array, radius: float) -> Array:
    """(n,) distance from the centre of the least-squares circle, minus the nominal radius."""
    system = np.column_stack((2.0 * lap, np.ones(len(lap))))
    x, y, _ = np.linalg.lstsq(system, (lap * lap).sum(axis=1), rcond=None)[0]
    return np.asarray(np.hypot(lap[:, 0] - x, lap[:, 1] - y) - radius)


def _diagonals(model: ErrorModel, tool: Array, digit: float) -> dict[str, Any]:
    """Deviation of positioning along the four body diagonals of the calibrated box, in both directions.
    Systematic deviation E and reversal error B of each, and the largest of them (ISO 230-6, after ISO
    230-2)."""
    box = np.asarray(model.box_mm, float)
    rows = []
    worst: dict[str, dict[str, float]] = {}
    for name in ("PPP", "NPP", "PNP", "NNP"):
        # each axis goes in its positive or in its negative direction
        positive = np.array([direction == "P" for direction in name])
        low, high = np.where(positive, box[:, 0], box[:, 1]), np.where(positive, box[:, 1], box[:, 0])
        share = np.linspace(0.02, 0.98, (_TARGETS - 1) * _STEPS + 1)
        target = low + np.concatenate((share, share[-2::-1]))[:, None] * (high - low)
        along = (high - low) / np.linalg.norm(high - low)
        row: dict[str, Any] = {"name": name, "length_mm": float(np.linalg.norm(high - low))}
        for side, actual in _runs(model, target, tool, digit).items():
            moved = ((actual - target) @ along) * UM_PER_MM
            moved -= moved[0]
            forward, backward = moved[: len(share)][::_STEPS], moved[len(share) - 1 :][::_STEPS][::-1]
            # the turning point belongs to both directions, and the first one has no direction yet
            both = np.stack((forward[1:-1], backward[1:-1]))
            figures = {"E_um": float(np.ptp(both)), "B_um": float(np.abs(both[0] - both[1]).max())}
            row[side] = figures | {"deviation_um": ((forward + backward) / 2).tolist()}
            kept = worst.setdefault(side, {"E_um": 0.0, "B_um": 0.0})
            for key, value in figures.items():
                kept[key] = max(kept[key], value)
        rows.append(row)
    return {"rows": rows, **worst}
