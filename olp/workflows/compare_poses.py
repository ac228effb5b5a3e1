"""Measured poses against nominal ones: ISO 9283 AP and RP, and the frame of a part from measured points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from olp.comparison import iso9283
from olp.comparison.runs import Align, absorbed_finding
from olp.core.arrays import Array, Mask
from olp.core.errors import InputError
from olp.core.rigid_fit import Rigid, fit_frame
from olp.core.units import UM_PER_MM
from olp.files.points import Points
from olp.files.toml_text import comment, toml_key, toml_lines
from olp.findings.catalogue import Finding


def cycles(nominal: Points, files: Sequence[Points]) -> Array:
    """(n, m, 3) attained positions of the m nominal poses in n cycles, NaN where one is missing.

    Points are paired by name where both sides have names, else by row; a file may hold several cycles one
    after the other. Raises InputError where neither fits.
    """
    attained: list[Array] = []
    for points in files:
        if nominal.names is not None and points.names is not None:
            attained += _by_name(nominal.names, nominal.file, points)
            continue
        if len(points) % len(nominal):
            raise InputError(
                f"has {len(points)} points, not an integer number of cycles of {len(nominal)} poses, and no "
                "names; expected one row per pose, or a column of names on both sides",
                file=points.file,
            )
        attained += list(points.points_mm.reshape(-1, len(nominal), 3))
    return np.stack(attained)


def _by_name(names: Sequence[str], nominal: str, points: Points) -> list[Array]:
    index = {name: i for i, name in enumerate(names)}
    if len(index) < len(names):
        twice = next(name for i, name in enumerate(names) if index[name] != i)
        raise InputError(f'the nominal pose "{twice}" is defined twice; expected it once', file=nominal)
    attained: list[Array] = []
    seen: dict[str, int] = {}
    assert points.names is not None
    for name, point_mm in zip(points.names, points.points_mm, strict=True):
        if name not in index:
            continue
        cycle = seen[name] = seen.get(name, -1) + 1
        if cycle == len(attained):
            attained.append(np.full((len(names), 3), np.nan))
        attained[cycle][index[name]] = point_mm
    if not attained:
        raise InputError(
            f'has no name of a nominal pose, such as "{names[0]}"; expected the same names in both files',
            file=points.file,
        )
    return attained


def poses_report(
    nominal: Points, measured: Sequence[Points], before: Sequence[Points], *, align: Align, reach_mm: float
) -> tuple[dict[str, Any], list[Finding]]:
    """Figures of poses, "after" and, where given, "before", in one common frame; and the findings."""
    groups = {"after": cycles(nominal, measured)}
    if before:
        groups["before"] = cycles(nominal, before)
    command = nominal.points_mm
    stated = {name: _distance(command, attained) for name, attained in groups.items()}
    fitted = align in ("fit", "each") or (align == "auto" and float(np.median(stated["after"])) > reach_mm)
    rigid = Rigid.identity()
    findings: list[Finding] = []
    if fitted:
        mean, there = _means(groups["after"])
        rigid = fit_frame(mean[there], command[there])
        groups = {
            name: rigid(attained.reshape(-1, 3)).reshape(attained.shape) for name, attained in groups.items()
        }
        x, y, z = rigid.shift_mm.tolist()
        rest = _rms(_distance(command, groups["after"]))
        findings.append(Finding(
            "OLP611",
            f"shift {x:.4f}, {y:.4f}, {z:.4f} mm, turn {np.degrees(rigid.angle_rad):.6f} deg; rms residual "
            f"{rest:.3g} um",
        ))  # fmt: skip
        if float(stated["after"].max()) < reach_mm:
            findings += absorbed_finding(_rms(stated["after"]), rest, "as measured")
    report: dict[str, Any] = {
        "frame": {
            "fitted": fitted, "shift_mm": rigid.shift_mm.tolist(), "angles_deg": list(rigid.angles_deg),
        }
    }  # fmt: skip
    names = nominal.names or tuple(str(i + 1) for i in range(len(nominal)))
    for name, attained in groups.items():
        report[name], more = _group(names, command, attained, reach_mm)
        findings += more
        if not 1 < len(attained) < iso9283.POSE_CYCLES:
            continue
        findings.append(Finding(
            "OLP607", f"{len(attained)} cycles {name}; ISO 9283 asks for {iso9283.POSE_CYCLES}"
        ))  # fmt: skip
    return report, findings


def _group(
    names: Sequence[str], command: Array, attained: Array, reach_mm: float
) -> tuple[dict[str, Any], list[Finding]]:
    distance = np.sqrt(((attained - command) ** 2).sum(axis=2))
    far = np.nanmax(np.where(np.isfinite(distance), distance, -1.0), axis=0)
    if (far > reach_mm).any():
        worst = int(far.argmax())
        return {"poses": None, "iso_9283": None}, [Finding(
            "OLP601",
            f"{int((far > reach_mm).sum())} of {len(names)} poses lie farther than {reach_mm:g} mm from "
            f"their command, {names[worst]} by {far[worst]:.4g} mm; no figures are given",
        )]  # fmt: skip
    findings = []
    missing = ~np.isfinite(distance).any(axis=0)
    if missing.any():
        which = ", ".join(name for name, gone in zip(names, missing.tolist(), strict=True) if gone)
        findings.append(Finding("OLP603", f"not measured: {which}", count=int(missing.sum())))
    each = iso9283.repeated(command, attained)
    rows = [
        {
            "name": name,
            "AP_um": ap * UM_PER_MM,
            "RP_um": rp * UM_PER_MM,
            "bias_um": [v * UM_PER_MM for v in bias],
        }
        for name, ap, rp, bias in zip(
            names, each.accuracy.tolist(), each.repeatability.tolist(), each.bias.tolist(), strict=True
        )
    ]
    ap, rp = iso9283.largest(each.accuracy), iso9283.largest(each.repeatability)
    return {
        "poses": rows,
        "iso_9283": {
            "cycles": len(attained),
            "AP_um": ap.value_mm * UM_PER_MM, "AP_pose": names[ap.place] if ap.place >= 0 else None,
            "RP_um": rp.value_mm * UM_PER_MM, "RP_pose": names[rp.place] if rp.place >= 0 else None,
        },
    }, findings  # fmt: skip


def _means(attained: Array) -> tuple[Array, Mask]:
    """(m, 3) means of cycles (n, m, 3), and (m,) which of them have a measured point."""
    there = np.asarray(np.isfinite(attained).all(axis=2), bool)
    count = there.sum(axis=0)
    total = np.where(there[:, :, None], attained, 0.0).sum(axis=0)
    return np.asarray(total / np.maximum(count, 1)[:, None], float), np.asarray(count > 0, bool)


def _distance(command: Array, attained: Array) -> Array:
    size = np.sqrt(((attained - command) ** 2).sum(axis=2)).ravel()
    return np.asarray(size[np.isfinite(size)], float)


def _rms(distance_mm: Array) -> float:
    return float(np.sqrt(np.mean(distance_mm**2))) * UM_PER_MM


def part_frame(nominal: Points, measured: Sequence[Points], name: str) -> str:
    """A table [work_offsets.NAME] for a job file: the frame of the part, from three or more of its points.

    The nominal points are those of the program, the measured ones axis positions in the machine frame without
    tool length; position = Rz(C) Ry(B) Rx(A) point + offset. Raises CannotCompute for fewer points, or
    points on a line.
    """
    mean, there = _means(cycles(nominal, measured))
    rigid = fit_frame(nominal.points_mm[there], mean[there])
    away = np.sqrt(((rigid(nominal.points_mm[there]) - mean[there]) ** 2).sum(axis=1)) * UM_PER_MM
    angles = {f"{axis}_deg": round(v, 9) for axis, v in zip("ABC", rigid.angles_deg, strict=True)}
    offset = {f"{axis}_mm": round(v, 6) for axis, v in zip("XYZ", rigid.shift_mm.tolist(), strict=True)}
    fit = (
        f"best fit of {int(there.sum())} measured points: {away.max():.2f} um at most, "
        f"{float(np.sqrt(np.mean(away**2))):.2f} um rms residual"
    )
    lines = [
        *comment(fit),
        f"[work_offsets.{toml_key(name)}]",
        *toml_lines(offset | angles | {"set_by": "true"}),
    ]
    return "\n".join(lines) + "\n"
