"""The calibration file of a machine of any joints, from the unknowns of a fit."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence

from olp.calibration.joints.adjustment import JointFit
from olp.files.fields import SIGN
from olp.files.toml_text import comment, toml_document, toml_key, toml_lines

#: Decimals of um and urad: a thousandth of a digit of any control.
_DECIMALS = 4


def joint_calibration_file(
    fit: JointFit,
    box: Mapping[str, tuple[float, float]],
    measured: datetime.date,
    valid_until: datetime.date | None,
    temperature_degC: float,
    notes: Sequence[str] = (),
) -> bytes:
    """The bytes of an olp-calibration-1 file. `box` are the calibrated values by name of the axis with its
    unit, notes become comments."""
    model = fit.model
    head = {
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
    tables: dict[str, dict[str, object]] = {}
    legs: dict[tuple[str, int], dict[str, object]] = {}
    for unknown, value in zip(model.unknowns, fit.theta.tolist(), strict=True):
        number = round(value / unknown.scale, _DECIMALS) + 0.0
        if unknown.leg:
            leg = legs.setdefault((unknown.part, unknown.leg), {"platform": unknown.part, "leg": unknown.leg})
            _put(leg, unknown.key, number)
        else:
            header = f"[{unknown.table}.{toml_key(unknown.part)}]"
            tables.setdefault(header, {})[unknown.key] = number
    rows: list[tuple[str, Mapping[str, object]]] = [
        *sorted(tables.items()),
        *(("[[legs]]", leg) for leg in legs.values()),
    ]
    rows += [
        ("[[masses]]", {"on": mass.on, "kg": mass.kg, "centre_mm": list(mass.centre_mm)})
        for mass in model.masses
    ]
    above = [line for note in notes for line in comment(note)]
    return ("\n".join([*above, *toml_lines(head)]) + "\n" + toml_document(rows)).encode()


def _put(leg: dict[str, object], key: str, number: float) -> None:
    """An error of a leg: its length, or one coordinate of an end such as base_X_um."""
    end, letter, _ = key.split("_") if key.count("_") == 2 else ("", "", "")
    if not end:
        leg[key] = number
        return
    vector = leg.setdefault(f"{end}_um", [0.0, 0.0, 0.0])
    assert isinstance(vector, list)
    vector["XYZ".index(letter)] = number
