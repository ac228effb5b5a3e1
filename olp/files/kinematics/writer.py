"""The calibration file of a machine of any joints, from the unknowns of a fit, and with some changed."""

from __future__ import annotations

import copy
import datetime
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from olp.calibration.joints.adjustment import JointFit
from olp.calibration.joints.candidates import Unknown
from olp.core.units import MM_PER_UM
from olp.files.fields import SIGN
from olp.files.kinematics.covariance import JointCovariance, joint_covariance_bytes
from olp.files.kinematics.numbers import number_of, put_number
from olp.files.toml_text import comment, toml_document, toml_key, toml_lines
from olp.files.write import PathLike

#: A table of numbers by name of the axis: a value of the file, no table.
_INLINE = "box"
#: Decimals of a misfit, um.
_DECIMALS = 3


def fitted_values(
    fit: JointFit,
    box: Mapping[str, tuple[float, float]],
    measured: datetime.date,
    valid_until: datetime.date | None,
    temperature_degC: float,
) -> dict[str, Any]:
    """The keys of the calibration of a fit. `box` are the calibrated values by name of the axis with its
    unit."""
    model = fit.model
    values: dict[str, Any] = {
        "schema": "olp-calibration-1",
        "machine": model.structure.name,
        "measured": measured,
        "valid_until": valid_until,
        "temperature_degC": temperature_degC,
        "sign": SIGN,
        "model": "rigid-body",
        "datum_mm": list(model.datum_mm),
        "box": {name: list(ends) for name, ends in box.items()},
    }
    for unknown, number in zip(model.unknowns, fit.theta.tolist(), strict=True):
        put_number(values, unknown, number)
    values |= _held(fit)
    if model.masses:
        values["masses"] = [
            {"on": mass.on, "kg": mass.kg, "centre_mm": list(mass.centre_mm)} for mass in model.masses
        ]
    return values


def _held(fit: JointFit) -> dict[str, Any]:
    """The payload of all readings, where the fit does not say what a payload bends."""
    loads = {source.start.reading.payload for source in fit.sources}
    if fit.model.yields or len(loads) != 1:
        return {}
    (held,) = loads
    return {"payload_kg": held.kg, "payload_centre_mm": list(held.centre_mm)} if held.kg else {}


def changed_values(
    values: Mapping[str, Any],
    changes: Iterable[tuple[Unknown, float]],
    measured: datetime.date,
    moved: tuple[PathLike, PathLike],
) -> dict[str, Any]:
    """The keys of a calibration with changes of unknowns, in mm and rad, added to what it states. Files that
    it names are named from where the new file will be: `moved` are the old file and the new one."""
    old, new = (Path(path).resolve().parent for path in moved)
    changed = copy.deepcopy({key: value for key, value in values.items() if key != "covariance"})
    changed["measured"] = measured
    for unknown, change in changes:
        put_number(changed, unknown, number_of(changed, unknown) + change)
    for curve in changed.get("curves", ()):
        curve["file"] = Path(os.path.relpath(old / curve["file"], new)).as_posix()
    return changed


def named_by(calibration: PathLike, values: Mapping[str, Any]) -> list[Path]:
    """The files that a calibration with these keys names."""
    tables = (*values.get("curves", ()), values.get("covariance", {}))
    return [Path(calibration).parent / table["file"] for table in tables if "file" in table]


def joint_calibration_files(
    target: PathLike,
    values: Mapping[str, Any],
    known: JointCovariance | None,
    growth_per_year: float = 0.0,
    notes: Sequence[str] = (),
    misfit_mm: float = 0.0,
) -> dict[Path, bytes]:
    """The bytes of an olp-calibration-1 file and of its covariance beside it; notes become comments.
    `misfit_mm` is what its numbers do not explain."""
    path = Path(target)
    if known is None:
        return {path: joint_calibration_text(values, notes)}
    archive = path.with_name(f"{path.stem}-covariance.npz")
    stated: dict[str, Any] = {"file": archive.name}
    if growth_per_year:
        stated["growth_per_year"] = growth_per_year
    if misfit_mm:
        stated["misfit_um"] = round(misfit_mm / MM_PER_UM, _DECIMALS)
    text = joint_calibration_text({**values, "covariance": stated}, notes)
    return {path: text, archive: joint_covariance_bytes(known, values)}


def joint_calibration_text(values: Mapping[str, Any], notes: Sequence[str] = ()) -> bytes:
    """The bytes of a calibration file of these keys."""
    head: dict[str, object] = {}
    tables: dict[str, Mapping[str, object]] = {}
    many: list[tuple[str, Mapping[str, object]]] = []
    for key, value in values.items():
        if isinstance(value, dict) and key != _INLINE:
            parts = {name: part for name, part in value.items() if isinstance(part, dict)}
            tables |= {f"[{key}.{toml_key(name)}]": part for name, part in parts.items()}
            if len(parts) < len(value):
                tables[f"[{key}]"] = {name: part for name, part in value.items() if name not in parts}
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            many += [(f"[[{key}]]", row) for row in value]
        else:
            head[key] = value
    above = [line for note in notes for line in comment(note)]
    return (
        "\n".join([*above, *toml_lines(head)]) + "\n" + toml_document([*sorted(tables.items()), *many])
    ).encode()
