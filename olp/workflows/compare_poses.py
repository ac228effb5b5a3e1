"""Measured poses against nominal ones: ISO 9283 AP and RP, and the frame of a part from measured points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from olp.comparison import iso9283
from olp.comparison.runs import Align, absorbed_finding
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import InputError
from olp.core.rigid_fit import Rigid, fit_frame
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.files.points import Points
from olp.files.toml_text import comment, toml_key, toml_lines
from olp.findings.catalogue import Finding
from olp.kinematics.poses import rotation_vector, rotations


@dataclass(frozen=True, slots=True, eq=False)
class Attained:
    """(n, m, 3) attained positions of the m nominal poses in n cycles in mm, and (n, m, 3, 3) orientations,
    None where files do not state them; NaN where a pose is missing."""

    points_mm: Array
    rotation: Array | None

    def moved(self, rigid: Rigid) -> Attained:
        """The same in the frame that a best fit gives."""
        points = rigid(self.points_mm.reshape(-1, 3)).reshape(self.points_mm.shape)
        return Attained(points, None if self.rotation is None else rigid.rotation @ self.rotation)

    def turns(self, nominal: Points, *, symmetric: bool) -> Array | None:
        """(n, m, 3) rotation vectors from the nominal orientations in rad, without the turn about the tool
        where that is `symmetric`; None where orientations are not known on both sides."""
        if self.rotation is None or nominal.rotation is None:
            return None
        turns = rotation_vector(self.rotation @ np.swapaxes(nominal.rotation, -1, -2))
        if symmetric:
            along = nominal.rotation[:, :, 2]
            turns = turns - (turns * along).sum(axis=-1, keepdims=True) * along
        return np.asarray(turns)


def cycles(nominal: Points, files: Sequence[Points]) -> Attained:
    """What was attained in each cycle.

    Points are paired by name where both sides have names, else by row; a file may hold several cycles one
    after the other. Raises InputError where neither fits, and where some files state orientations and others
    do not.
    """
    points_mm: list[Array] = []
    rotation: list[Array] = []
    for points in files:
        rows = _rows(nominal, points)
        missing = rows < 0
        there = points.points_mm[rows]
        there[missing] = np.nan
        points_mm += list(there)
        own = _rotation(nominal, points, rows)
        if own is not None:
            own[missing] = np.nan
            rotation += list(own)
    if rotation and len(rotation) < len(points_mm):
        raise InputError(
            "some of the measured files state orientations and others do not; expected columns A_deg, B_deg, "
            "C_deg, or RX_urad, RY_urad, RZ_urad, in all of them or in none",
            file=next(points.file for points in files if points.rotation is None and points.turn_rad is None),
        )
    return Attained(np.stack(points_mm), np.stack(rotation) if rotation else None)


def _rotation(nominal: Points, points: Points, rows: Index) -> Array | None:
    """(n, m, 3, 3) orientations of cycles of rows (n, m)."""
    if points.rotation is not None:
        return points.rotation[rows]
    if points.turn_rad is None or nominal.rotation is None:
        return None
    turned = rotations(points.turn_rad)[rows]
    return np.asarray(turned @ nominal.rotation)


def _rows(nominal: Points, points: Points) -> Index:
    """(n, m) the row of each nominal pose in each cycle of a file, -1 where it is missing."""
    if nominal.names is not None and points.names is not None:
        return _by_name(nominal.names, nominal.file, points)
    if len(points) % len(nominal):
        raise InputError(
            f"has {len(points)} points, not an integer number of cycles of {len(nominal)} poses, and no "
            "names; expected one row per pose, or a column of names on both sides",
            file=points.file,
        )
    return np.arange(len(points)).reshape(-1, len(nominal))


def _by_name(names: Sequence[str], nominal: str, points: Points) -> Index:
    index = {name: i for i, name in enumerate(names)}
    if len(index) < len(names):
        twice = next(name for i, name in enumerate(names) if index[name] != i)
        raise InputError(f'the nominal pose "{twice}" is defined twice; expected it once', file=nominal)
    rows: list[list[int]] = []
    seen: dict[str, int] = {}
    assert points.names is not None
    for row, name in enumerate(points.names):
        if name not in index:
            continue
        cycle = seen[name] = seen.get(name, -1) + 1
        if cycle == len(rows):
            rows.append([-1] * len(names))
        rows[cycle][index[name]] = row
    if not rows:
        raise InputError(
            f'has no name of a nominal pose, such as "{names[0]}"; expected the same names in both files',
            file=points.file,
        )
    return np.array(rows)


def poses_report(
    nominal: Points, measured: Sequence[Points], before: Sequence[Points], *, align: Align, reach_mm: float,
    symmetric: bool = False,
) -> tuple[dict[str, Any], list[Finding]]:  # fmt: skip
    """Figures of poses, "after" and, where given, "before", in one common frame; and the findings. With a
    `symmetric` tool its turn about its own axis is in no figure."""
    groups = {"after": cycles(nominal, measured)}
    if before:
        groups["before"] = cycles(nominal, before)
    command = nominal.points_mm
    stated = {name: _distance(command, attained.points_mm) for name, attained in groups.items()}
    fitted = align in ("fit", "each") or (align == "auto" and float(np.median(stated["after"])) > reach_mm)
    rigid = Rigid.identity()
    findings: list[Finding] = []
    if fitted:
        mean, there = _means(groups["after"].points_mm)
        rigid = fit_frame(mean[there], command[there])
        groups = {name: attained.moved(rigid) for name, attained in groups.items()}
        x, y, z = rigid.shift_mm.tolist()
        rest = _rms(_distance(command, groups["after"].points_mm))
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
        report[name], more = _group(names, command, attained.points_mm, reach_mm)
        findings += more
        turns = attained.turns(nominal, symmetric=symmetric)
        if turns is not None and report[name]["poses"] is not None:
            _add_orientation(report[name], turns)
        count = len(attained.points_mm)
        if not 1 < count < iso9283.POSE_CYCLES:
            continue
        findings.append(Finding(
            "OLP607", f"{count} cycles {name}; ISO 9283 asks for {iso9283.POSE_CYCLES}"
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


def _add_orientation(report: dict[str, Any], turns: Array) -> None:
    """Add the figures of the orientation about X, Y and Z in urad: of each pose, and the largest ones."""
    each = iso9283.turned(turns)
    for name, values in (("AP", each.accuracy), ("RP", each.repeatability)):
        urad = values / RAD_PER_URAD
        for row, value in zip(report["poses"], urad.tolist(), strict=True):
            row[f"{name}_turn_urad"] = value
        known = np.isfinite(urad).any(axis=0)
        largest = np.where(known, np.nanmax(np.where(known, np.abs(urad), 0.0), axis=0), np.nan)
        report["iso_9283"][f"{name}_turn_urad"] = largest.tolist()


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
    mean, there = _means(cycles(nominal, measured).points_mm)
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
