"""Checks of the error model against the job: tools of maps, payloads, temperatures."""

from __future__ import annotations

import numpy as np

from olp.checks.base import finding, first_lines, lines_of
from olp.core.machine import Sanity
from olp.core.toolpath import Kind, Toolpath
from olp.core.units import UM_PER_MM
from olp.errormodel.base import ErrorModel
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import Finding

#: mm; how far the tool in use may be from that of a total map.
_SAME_TOOL_MM = 1.0


def model_findings(
    path: Toolpath, calibration: Calibration, model: ErrorModel, sanity: Sanity, tolerance_mm: float
) -> list[Finding]:
    """Tools other than those of a map, and payloads that change before a cut or that the calibration does not
    know."""
    return [
        *_map_tools(path, calibration, sanity),
        *_payloads(path, calibration),
        *_jumps(path, model, tolerance_mm),
        *_structure(calibration),
    ]


def _structure(calibration: Calibration) -> list[Finding]:
    structure = calibration.structure
    if structure is None:
        return []
    names = ", ".join(sensor.name for sensor in structure.sensors)
    if structure.temperatures_degC is None:
        return [
            finding(
                "OLP423", f"the job states no temperatures of {names}; their distortion is left uncorrected"
            )
        ]
    far = [f"{name} {value:.2f} degC" for name, value in structure.outside().items()]
    if not far:
        return []
    return [finding("OLP424", f"{', '.join(far)}: the end of the identified range was used")]


def _map_tools(path: Toolpath, calibration: Calibration, sanity: Sanity) -> list[Finding]:
    findings = []
    lines = first_lines(path) if calibration.maps else {}
    for described in calibration.maps:
        within = _SAME_TOOL_MM if described.kind == "total" else sanity.tool_within_mm
        away = {
            number: float(np.linalg.norm(np.subtract(path.frames[number].tool_mm, described.tool_mm)))
            for number in lines
        }
        far = {number: tool_vector for number, tool_vector in away.items() if tool_vector > within}
        if not far:
            continue
        worst = max(far, key=far.__getitem__)
        tool = path.frames[worst].tool
        name = "no tool" if tool is None else f"tool {tool}"
        what = (
            f"the tip of {name} is {far[worst]:.4g} mm from where it was when {described.name} was measured; "
            f"10 urad of an axis' rotation are {far[worst] * 1e-5 * UM_PER_MM:.3g} um there, which the map "
            "does not include"
        )
        findings.append(finding("OLP420", what, [min(lines[number] for number in far)]))
    return findings


def _payloads(path: Toolpath, calibration: Calibration) -> list[Finding]:
    if calibration.compliance or calibration.beams or not len(path):
        return []
    lines = first_lines(path)
    other = {
        number: path.frames[number].payload_kg
        for number in lines
        if path.frames[number].payload_kg != calibration.payload_kg
    }
    if not any(other.values()):
        return []
    what = (
        f"a payload of {max(other.values()):g} kg is stated; the calibration is for "
        f"{calibration.payload_kg:g} kg and has no compliance"
    )
    return [finding("OLP422", what, [min(lines[number] for number in other)])]


def _jumps(path: Toolpath, model: ErrorModel, tolerance_mm: float) -> list[Finding]:
    payload = np.array([f.payload_kg for f in path.frames])
    if len(path) < 2 or not payload.any():
        return []
    moves = np.flatnonzero(np.diff(payload[path.frame]) != 0.0) + 1
    moves = moves[(path.kind[moves] != Kind.RAPID) & np.isfinite(path.end_mm[moves - 1]).all(axis=1)]
    if not moves.size:
        return []
    place = path.end_mm[moves - 1]
    after = path.tools_mm()[path.frame[moves]]
    before = after.copy()
    before[:, 3] = payload[path.frame[moves - 1]]
    jump = np.linalg.norm(model.error(place, after) - model.error(place, before), axis=1)
    wide = jump > tolerance_mm
    if not wide.any():
        return []
    what = (
        f"the tip moves by up to {jump.max() * UM_PER_MM:.3g} um where the payload changes, and a feed move "
        "starts there"
    )
    return [finding("OLP421", what, lines_of(path, moves[wide]))]
