"""The report of corrected results ("olp-results-1")."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from olp.core.arrays import Array
from olp.core.units import UM_PER_MM
from olp.findings.catalogue import Finding
from olp.results.forward import Forward
from olp.results.reported import Reported
from olp.workflows.doubt import accepted_of
from olp.workflows.session import Loaded

#: Why corrected results are right.
WHY = (
    "a measuring machine reports where its scales say that the tip is; the tip was there plus the error of "
    "the machine at that axis position and with that stylus",
    "so the error (actual - commanded) was added to every point; nothing was inverted, and no nominal value, "
    "tolerance or name was changed",
)
#: What corrected results do not prove.
DOES_NOT_PROVE = (
    "that the calibration still describes the machine: measure an artefact of known size, correct its "
    "results, and compare",
    "anything about the probing system (lobing, wear, wrong tip radius), which is not an error of the axes",
)


def report_of(
    reported: Reported,
    result: Forward,
    loaded: Loaded,
    name: str,
    text: bytes,
    rounding_mm: float,
    findings: Sequence[Finding],
) -> dict[str, Any]:
    """The report ("olp-results-1")."""
    added = result.added_mm * UM_PER_MM
    size = np.sqrt((added * added).sum(axis=1))
    sources = [
        {"name": source, **_size(part * UM_PER_MM)}
        for source, part in loaded.model.contributions(result.axis_mm, result.tool_vector_mm, result.play)
    ]
    return {
        "schema": "olp-results-1",
        "results": {
            "name": name,
            "sha256": hashlib.sha256(reported.data).hexdigest(),
            "dialect": reported.dialect,
            "points": len(reported),
            "frames": [frame for frame in reported.frames if frame is not None],
        },
        **loaded.heads(),
        "correction": {
            **_size(added),
            "max_by_axis_um": np.abs(added).max(axis=0, initial=0.0).tolist(),
            "rounding_um": rounding_mm * UM_PER_MM,
        },
        "sources": sorted(sources, key=lambda s: -float(s["max_um"])),
        "carried": [
            {"line": item.line, "name": item.name, "reason": item.reason} for item in reported.unchanged
        ],
        "points": [
            {"line": line, "name": label, "axis_mm": axis, "added_um": row, "size_um": away}
            for line, label, axis, row, away in zip(
                reported.line.tolist(), reported.names, result.axis_mm.tolist(), added.tolist(),
                size.tolist(), strict=True,
            )
        ],
        "corrected": {"sha256": hashlib.sha256(text).hexdigest()},
        "accepted": accepted_of(findings),
        "findings": [f.as_dict() for f in findings],
        "why": list(WHY),
        "does_not_prove": list(DOES_NOT_PROVE),
    }  # fmt: skip


def _size(rows_um: Array) -> dict[str, float]:
    size = np.sqrt((rows_um * rows_um).sum(axis=1))
    return {"max_um": float(size.max(initial=0.0)), "rms_um": float(np.sqrt(np.mean(size * size)))}
