"""What touches of an artefact showed, as the files that `olp calibrate fit` reads."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from olp.calibration.design.probing import Probing, face_axis
from olp.calibration.observations.touched import Touched
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.machine import Machine
from olp.core.units import AXES, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.calibration import PLACEHOLDER_DATE
from olp.files.measurements.plan_files import PLAN
from olp.files.measurements.point_readings import AXIS, COVARIANCE
from olp.files.toml_text import comment, toml_lines

#: Decimals of places in mm.
_MM = 6
#: Decimals of covariances in um^2.
_UM2 = 4
#: Decimals of readings in um.
_UM = 4
#: Faces are on one line where they are beside it by less than this share of its length.
_BESIDE = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Faces of one pose that are on one line, as readings of a component: their rows of `Touched`."""

    component: str
    pose: int
    rows: Index


def rows_of_faces(probing: Probing, touched: Touched) -> tuple[Row, ...]:
    """Faces by pose and by the axis that they are square to: a distance along that axis where they are apart
    along it, else a straightness. Raises CannotCompute where they are not on a line along an axis."""
    rows: list[Row] = []
    for pose in range(len(probing.poses)):
        own = [
            k
            for k in np.flatnonzero(touched.pose == pose).tolist()
            if probing.features[touched.feature[k]].kind == "face"
        ]
        across = [face_axis(probing, pose, int(touched.feature[k]))[0] for k in own]
        for axis in sorted(set(across)):
            some = np.array([k for k, a in zip(own, across, strict=True) if a == axis])
            rows.append(_row(probing, touched, pose, axis, some))
    return tuple(rows)


def _row(probing: Probing, touched: Touched, pose: int, axis: int, rows: Index) -> Row:
    place = touched.place_mm[rows]
    wide = np.ptp(place, axis=0) if len(rows) > 1 else np.zeros(3)
    along = int(wide.argmax())
    where = f"pose {pose + 1}: the faces square to {AXES[axis]}"
    if len(rows) < 2 or not wide[along] > 0.0:
        raise CannotCompute(f"{where} are at one place; expected two faces or more on a line")
    if max(wide[k] for k in range(3) if k != along) > _BESIDE * wide[along]:
        raise CannotCompute(
            f"{where} are not on a line along an axis of the machine; expected that within "
            f"{_BESIDE:g} of its length"
        )
    return Row(f"E{AXES[axis]}{AXES[along]}", pose, rows)


def touched_files(
    machine: Machine, probing: Probing, touched: Touched, date: datetime.date | None
) -> Iterator[tuple[str, bytes]]:
    """(name, bytes) of measurements.toml and the files that it names. Raises CannotCompute where what was
    touched is no source of a calibration."""
    lines = rows_of_faces(probing, touched)
    round_ = np.array([probing.features[k].kind != "face" for k in touched.feature])
    text = [*comment(f"{probing.name}, touched by the probe of the machine. Then: olp calibrate fit.")]
    text += toml_lines({"schema": "olp-measurements-1", "machine": machine.name, "chain": machine.chain})
    text.append(f"measured = {date or PLACEHOLDER_DATE}  # the day of measuring")
    text.append("temperature_degC = 20.0  # of the scales while measuring")
    text.append("active_during_measurement = []  # errors that the control corrected meanwhile")
    straight = any(row.component[1] != row.component[2] for row in lines)
    if straight:
        sigma = max(f.sigma_mm for f in probing.features if f.kind == "face") * UM_PER_MM
        text += ["", "[[straightedges]]", *toml_lines({"name": probing.name, "sigma_um": sigma or None})]
    if round_.any():
        text += ["", "[[artefacts]]"]
        text += toml_lines(
            {"file": "centres.csv", "certificate": "balls.csv", "tool_mm": list(probing.tool_mm)}
        )
        yield "centres.csv", _centres(probing, touched, round_)
        yield "balls.csv", _certificate(probing)
    for number, row in enumerate(lines, start=1):
        name = f"{row.component.lower()}-{number}.csv"
        text += ["", *_line_table(probing, touched, row, name)]
        yield name, _line(probing, touched, row)
    yield PLAN, ("\n".join(text) + "\n").encode()


def _centres(probing: Probing, touched: Touched, use: np.ndarray) -> bytes:
    """Axis positions at the centres of balls and holes, with their covariances."""
    first, second = np.triu_indices(3)
    lines = [",".join(("pose", "ball", *AXIS, *COVARIANCE))]
    for k in np.flatnonzero(use).tolist():
        axis = touched.place_mm[k] - np.array(probing.tool_mm)
        spread = (touched.covariance_mm2[k] * UM_PER_MM**2)[first, second]
        cells = [f"{v:.{_MM}f}" for v in axis] + [f"{v:.{_UM2}f}" for v in spread]
        name = probing.features[touched.feature[k]].name
        lines.append(",".join([str(touched.pose[k] + 1), name, *cells]))
    return ("\n".join(lines) + "\n").encode()


def _certificate(probing: Probing) -> bytes:
    lines = [",".join(("ball", *AXIS, "sigma_um"))]
    for feature in probing.features:
        if feature.kind != "face":
            cells = [f"{v:.{_MM}f}" for v in feature.place_mm]
            lines.append(",".join([feature.name, *cells, f"{feature.sigma_mm * UM_PER_MM:g}"]))
    return ("\n".join(lines) + "\n").encode()


def _along(probing: Probing, touched: Touched, row: Row) -> tuple[Array, Index, Array]:
    """Axis positions (n, 3) in the order of time, the sides from which they were touched (n,), and actual
    minus commanded in mm (n,) but for a constant."""
    axis, along = AXES.index(row.component[1]), AXES.index(row.component[2])
    commanded: Array = touched.place_mm[row.rows] - np.array(probing.tool_mm)
    features = touched.feature[row.rows].tolist()
    sides = np.array([face_axis(probing, row.pose, k)[1] for k in features])
    if axis != along:
        return commanded, np.ones(len(sides), np.int64), -commanded[:, axis]
    # faces at certified distances, which count along their own direction
    drawn = np.array([probing.features[k].place_mm for k in features])
    out = np.array(probing.features[features[0]].direction) * sides[0]
    actual = (drawn - drawn[0]) @ out / abs(probing.poses[row.pose].frame.rotation @ out)[axis]
    return commanded, np.asarray(-sides, np.int64), actual - (commanded[:, axis] - commanded[0, axis])


def _line(probing: Probing, touched: Touched, row: Row) -> bytes:
    commanded, sides, value = _along(probing, touched, row)
    along = AXES.index(row.component[2])
    lines = ["target_mm,run,direction,value_um"]
    columns = zip(commanded[:, along].tolist(), sides.tolist(), (value * UM_PER_MM).tolist(), strict=True)
    lines += [f"{q:.{_MM}f},1,{side},{reading:.{_UM}f}" for q, side, reading in columns]
    return ("\n".join(lines) + "\n").encode()


def _line_table(probing: Probing, touched: Touched, row: Row, name: str) -> list[str]:
    axis, along = AXES.index(row.component[1]), AXES.index(row.component[2])
    commanded = touched.place_mm[row.rows] - np.array(probing.tool_mm)
    sides = {face_axis(probing, row.pose, k)[1] for k in touched.feature[row.rows].tolist()}
    # one effective radius is common to all faces that look to one side
    radius = float(touched.sigma_radius_mm.max()) if len(sides) > 1 else 0.0
    spread = float(np.hypot(touched.sigma_mm, radius))
    certified = max(probing.features[k].sigma_mm for k in touched.feature[row.rows].tolist())
    straight = axis != along
    sigma = spread if straight else float(np.hypot(spread, certified))
    middle = commanded.mean(axis=0)
    values: dict[str, object] = {
        "file": name,
        "component": row.component,
        "line_mm": {a: round(float(middle[k]), 3) for k, a in enumerate(AXES) if k != along},
        "tool_mm": list(probing.tool_mm),
        "sense": "actual-minus-commanded",
        "straightedge": probing.name if straight else None,
        "turned_over": probing.poses[row.pose].turned_over if straight else None,
        "sigma_um": round(sigma * UM_PER_MM, 4),
        "instrument": "straightedge" if straight else "other",
    }
    return ["[[lines]]", *toml_lines(values)]


def touched_rows(probing: Probing, touched: Touched) -> list[Mapping[str, object]]:
    """Every centre and face as a row of a report."""
    sigma = np.sqrt(np.diagonal(touched.covariance_mm2, axis1=1, axis2=2)) * UM_PER_MM
    axis = touched.place_mm - np.array(probing.tool_mm)
    shown: Sequence[tuple[int, int]] = list(zip(touched.pose.tolist(), touched.feature.tolist(), strict=True))
    rows: list[Mapping[str, object]] = []
    for k, (pose, feature) in enumerate(shown):
        one = probing.features[feature]
        free = [a for a in range(3) if one.kind != "face" or a == face_axis(probing, pose, feature)[0]]
        rows.append(
            {"pose": pose + 1, "feature": one.name, "kind": one.kind}
            | {f"{a}_mm": float(axis[k, n]) for n, a in enumerate(AXES)}
            | {f"sigma_{a}_um": float(sigma[k, n]) if n in free else None for n, a in enumerate(AXES)}
        )
    return rows
