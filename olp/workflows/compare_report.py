"""Parts of the report of a comparison: what was compared, the frame, figures of runs, the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from olp.comparison import figures, iso9283, runs
from olp.comparison.path import Path
from olp.core.units import UM_PER_MM
from olp.files.points import Points
from olp.findings.catalogue import Finding
from olp.proof import judgement
from olp.proof.measured import Measured

#: Most lines of a finding.
_WORST = 10


def head(
    nominal: Mapping[str, Any],
    machine: Mapping[str, Any],
    measured: Sequence[Points],
    before: Sequence[Points],
) -> dict[str, Any]:
    """What was compared, with the hashes of all files; `machine` are the parts on it and its calibration."""
    return {
        "schema": "olp-comparison-1",
        "nominal": dict(nominal),
        "measured": [_described(points) for points in measured],
        "measured_before": [_described(points) for points in before],
        **machine,
    }


def _described(points: Points) -> dict[str, Any]:
    return {
        "name": FilePath(points.file).name,
        "points": len(points),
        "duration_s": None if points.time_s is None else float(np.ptp(points.time_s)),
        "frame": points.frame,
        "positions": points.profile.positions,
        "unit": points.profile.unit,
        "sha256": points.sha256,
    }


def frame(placed: runs.Placed) -> dict[str, Any]:
    """The transform of the first run into the nominal frame, and the order of the points of all."""
    rigid = placed.rigid[0]
    return {
        "fitted": placed.fitted,
        "shift_mm": rigid.shift_mm.tolist(),
        "angles_deg": list(rigid.angles_deg),
        "not_determined": list(placed.loose),
        "order": list(placed.orders),
    }


def group(
    path: Path, members: Sequence[figures.Run], right: Sequence[bool], layer: Measured
) -> dict[str, Any]:
    """Figures of the runs of a group, of each and of all; None for a run whose pairing is wrong. `layer` is
    that of the table."""
    rows: list[dict[str, Any]] = [
        run.figures(path) if good else {"name": run.name, "points": len(run.points_mm), "across_um": None}
        for run, good in zip(members, right, strict=True)
    ]
    if not all(right):
        return {"runs": rows, "iso_9283": None}
    report: dict[str, Any] = {"runs": rows, "iso_9283": _iso_9283(path, members)}
    sizes: list[dict[str, float]] = [row["across_um"] for row in rows if row["across_um"]]
    if sizes:
        report["across_um"] = {
            "max": layer.largest_um(),
            "rms": float(np.sqrt(np.mean([s["rms"] ** 2 for s in sizes]))),
            "mean": float(np.mean([s["mean"] for s in sizes])),
            "q95": max(s["q95"] for s in sizes),
        }
    report["worst"] = layer.worst()
    return report


def _iso_9283(path: Path, members: Sequence[figures.Run]) -> dict[str, Any]:
    places = figures.stations(path)
    command, segment = path.at(places)
    each = iso9283.repeated(command, np.stack([run.at(path, places) for run in members]))
    report: dict[str, Any] = {"cycles": len(members), "places": len(places)}
    for name, values in (("AT", each.accuracy), ("RT", each.repeatability)):
        worst = iso9283.largest(values)
        report[f"{name}_um"] = worst.value_mm * UM_PER_MM
        report[f"{name}_line"] = int(path.line[segment[worst.place]]) if worst.place >= 0 else None
    return report


def verdict(layer: Measured) -> tuple[dict[str, Any], list[Finding]]:
    """The verdict on measured runs, and the finding where they are not within the part tolerance."""
    sizes = [(name, layer.largest_um(k)) for k, name in enumerate(layer.names)]
    result = judgement.measured(sizes, layer.tolerance_um)
    found = []
    lines = tuple(layer.lines_over())
    if lines:
        message = f"{layer.largest_um():.2f} um off the nominal path, {layer.tolerance_um:g} um allowed"
        found.append(Finding("OLP609", message, lines[0], lines[:_WORST], len(lines)))
    missing = result["measured"]["not_verified"]
    if missing and layer.tolerance_um is not None:
        names = ", ".join(missing)
        message = f"no measured point of {names} counts, so {layer.tolerance_um:g} um cannot be verified"
        found.append(Finding("OLP609", message))
    return result, found


def cycles(groups: Mapping[str, Sequence[figures.Run]]) -> list[Finding]:
    """Findings on groups with fewer runs than ISO 9283 asks for; a single run gives none."""
    return [
        Finding("OLP607", f"{len(members)} runs {name}; ISO 9283 asks for {iso9283.PATH_CYCLES}")
        for name, members in groups.items()
        if 1 < len(members) < iso9283.PATH_CYCLES
    ]
