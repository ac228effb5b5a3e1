"""The verdict on a part of a machine with rotary joints: is it good, as far as the calibration knows."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.checks.base import finding
from olp.compensation.joints.path import JointPath
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.findings.catalogue import Finding
from olp.proof.joints import JointProof
from olp.proof.judgement import ENOUGH, every, part_answer, part_of, part_sentence


def judge_part(
    report: dict[str, Any], path: JointPath, proof: JointProof, tolerance_um: float
) -> list[Finding]:
    """Adds the verdict on the part to a report with its uncertainty, and gives what speaks against the
    part."""
    off_mm = np.where(proof.judged, proof.after.distance_mm, 0.0)
    largest_um = float(off_mm.max()) * UM_PER_MM
    within = report["uncertainty"]["within"] if "uncertainty" in report else None
    probability = None if within is None else float(within["after"]["program"])
    part = part_of(largest_um, tolerance_um, probability)
    report["part"] = part | {"sentence": part_sentence(part)}
    report["verdict"]["ok"] = every((proof.holds, part_answer(part)))
    line, found = path.program.original_lines(path.line), []
    above = off_mm > tolerance_um * MM_PER_UM
    if above.any():
        what = (
            f"{int(above.sum())} moves are above the part tolerance: {largest_um:.2f} um, "
            f"{tolerance_um:g} um allowed"
        )
        found.append(finding("OLP108", what, line[above].tolist()))
    if within is not None and probability is not None and probability < ENOUGH:
        what = (
            f"all waypoints are within {tolerance_um:g} um with a probability of {100.0 * probability:.1f} %"
        )
        found.append(finding("OLP433", what, within["lines"], count=max(len(within["lines"]), 1)))
    return found
