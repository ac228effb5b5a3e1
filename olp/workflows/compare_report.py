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
from olp.workflows.session import Loaded

#: Number of lines with the largest deviations in a report.
_WORST = 10


def head(
    nominal: Mapping[str, Any], loaded: Loaded | None, measured: Sequence[Points], before: Sequence[Points]
) -> dict[str, Any]:
    """What was compared, with the hashes of all files."""
    report: dict[str, Any] = {
        "schema": "olp-comparison-1",
        "nominal": dict(nominal),
        "measured": [_described(points) for points in measured],
        "measured_before": [_described(points) for points in before],
    }
    if loaded is not None:
        report |= loaded.heads()
    return report


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


def group(path: Path, members: Sequence[figures.Run], right: Sequence[bool]) -> dict[str, Any]:
    """Figures of the runs of a group, of each and of all; None for a run whose pairing is wrong."""
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
            "max": max(s["max"] for s in sizes),
            "rms": float(np.sqrt(np.mean([s["rms"] ** 2 for s in sizes]))),
            "mean": float(np.mean([s["mean"] for s in sizes])),
            "q95": max(s["q95"] for s in sizes),
        }
    worst: dict[int, float] = {}
    for run in members:
        for line, size in run.largest_by_line(path).items():
            worst[line] = max(worst.get(line, 0.0), size)
    top = sorted(worst.items(), key=lambda item: (-item[1], item[0]))[:_WORST]
    report["worst"] = [{"line": line, "max_um": size} for line, size in top]
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


def verdict(report: dict[str, Any], tolerance_um: float | None) -> list[Finding]:
    """The finding where the measured path is not within tolerance; sets `verdict`, and `holds` where a
    tolerance is stated."""
    size = (report["after"].get("across_um") or {}).get("max")
    report["verdict"] = judgement.measured(size, tolerance_um)
    if tolerance_um is None:
        return []
    report["holds"] = report["verdict"]["ok"]
    if size is None:
        message = f"no measured point of a cutting move counts, so {tolerance_um:g} um cannot be verified"
        return [Finding("OLP609", message)]
    if report["verdict"]["ok"]:
        return []
    lines = tuple(row["line"] for row in report["after"]["worst"] if row["max_um"] > tolerance_um)
    message = f"{size:.2f} um off the nominal path, {tolerance_um:g} um allowed"
    return [Finding("OLP609", message, lines[0], lines, len(lines))]


def cycles(groups: Mapping[str, Sequence[figures.Run]]) -> list[Finding]:
    """Findings on groups with fewer runs than ISO 9283 asks for; a single run gives none."""
    return [
        Finding("OLP607", f"{len(members)} runs {name}; ISO 9283 asks for {iso9283.PATH_CYCLES}")
        for name, members in groups.items()
        if 1 < len(members) < iso9283.PATH_CYCLES
    ]
