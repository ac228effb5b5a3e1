"""A calibration as the text of its files: an olp-calibration-1 file and one CSV file a curve."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import SQUARENESS, ZERO, Vector
from olp.core.units import AXES, shifted
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import covariance_bytes
from olp.files.calibration.gridded_writer import (
    beam_lines,
    compliance_csv,
    compliance_lines,
    map_csv,
    map_lines,
)
from olp.files.calibration.structure import structure_text
from olp.files.fields import SIGN
from olp.files.toml_text import comment, toml_lines

#: Neighbours of a number that are tried until one reads back exactly.
_NEIGHBOURS = 3


def calibration_files(
    calibration: Calibration,
    target: Path,
    *,
    sigma: Mapping[str, Array] | None = None,
    covariance: Uncertainty | None = None,
    notes: Sequence[str] = (),
) -> dict[Path, bytes]:
    """The bytes of `target`, an olp-calibration-1 file, and of its curves `<stem>-x.csv` ..., maps
    `<stem>-map.csv` and loads `<stem>-load.csv` beside it.

    `sigma` holds standard uncertainties by component, (n,) in mm or rad at the positions of its curve, and
    `covariance` becomes `<stem>-covariance.npz`; notes become comments. Curves read back as the very same
    doubles; so does every other number of 15 digits or fewer in the unit of its key, longer ones within the
    last bit. The temperatures of a job are no part of a calibration and are not written. Raises ConfigError
    where it has no date of measuring, or where a sigma fits no curve.
    """
    if calibration.measured is None:
        raise ConfigError("the calibration has no date of measuring; give it, such as 2026-05-14")
    sigmas = dict(sigma or {})
    files: dict[Path, bytes] = {}
    names: list[str] = []
    for curve in calibration.curves:
        name = _unused(f"{target.stem}-{curve.axis.lower()}", names)
        names.append(name)
        own = {component: sigmas.pop(component) for component in curve.names if component in sigmas}
        files[target.with_name(name)] = _csv(curve, own).encode()
    if sigmas:
        raise ConfigError(f"sigma of {', '.join(sorted(sigmas))} fits no curve; expected names of its curves")
    tables: list[str] = []
    for described in calibration.maps:
        names.append(_unused(f"{target.stem}-map", names))
        files[target.with_name(names[-1])] = map_csv(described, in_unit_text).encode()
        tables += map_lines(described, names[-1])
    for table in calibration.compliance:
        names.append(_unused(f"{target.stem}-load", names))
        files[target.with_name(names[-1])] = compliance_csv(table, in_unit_text).encode()
        tables += compliance_lines(table, names[-1])
    warm, structure = calibration.thermal is not None or calibration.structure is not None, None
    if calibration.structure is not None:
        structure = f"{target.stem}-thermal.toml"
        text = structure_text(calibration.structure, calibration.machine, in_unit)
        files[target.with_name(structure)] = text
    lines = [
        *(line for note in notes for line in comment(note)),
        *_head(calibration),
        *(
            line
            for curve, name in zip(calibration.curves, names, strict=False)
            for line in _curve(curve, name)
        ),
        *_squareness(calibration.squareness),
        *_backlash(calibration.backlash_mm),
        *_repeatability(calibration.repeatability_mm),
        *(line for cyclic in calibration.cyclic for line in _cyclic(cyclic)),
        *tables,
        *(line for beam in calibration.beams for line in beam_lines(beam)),
        *(_thermal(calibration.thermal or Thermal(), structure) if warm else ()),
    ]
    if covariance is not None:
        archive = target.with_name(f"{target.stem}-covariance.npz")
        files[archive] = covariance_bytes(covariance)
        lines += ["", "[covariance]", *toml_lines({"file": archive.name})]
    return {target: ("\n".join(lines) + "\n").encode(), **files}


def in_unit(value: float, power: int) -> float:
    """The number of units of ten to `power` base units that reads back as `value`: 1e-4 mm is 0.1 um."""
    number = shifted(value, -power)
    low = high = number
    for _ in range(_NEIGHBOURS):
        for candidate in (low, high):
            if shifted(candidate, power) == value:
                return candidate
        low, high = math.nextafter(low, -math.inf), math.nextafter(high, math.inf)
    return number


def in_unit_text(value: float, power: int) -> str:
    """The shortest decimal of a double in units of ten to `power`; read as text it is the same double."""
    text = format(Decimal(repr(float(value))).scaleb(-power), "f")
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text


def _unused(stem: str, names: Sequence[str]) -> str:
    count = sum(name.startswith((f"{stem}.", f"{stem}-")) for name in names)
    return f"{stem}.csv" if not count else f"{stem}-{count + 1}.csv"


def _head(calibration: Calibration) -> Iterator[str]:
    active = sorted(calibration.active_during_measurement)
    yield from comment(
        "Errors of the machine: actual minus commanded, of the tool relative to the workpiece."
    )
    yield from toml_lines(
        {
            "schema": "olp-calibration-1",
            "machine": calibration.machine,
            "measured": calibration.measured,
            "valid_until": calibration.valid_until,
            "temperature_degC": calibration.temperature_degC,
            "sign": SIGN,
            "model": calibration.model,
            "datum_mm": calibration.datum_mm,
            "box_mm": calibration.box_mm.tolist(),
            "payload_kg": calibration.payload_kg or None,
            "active_during_measurement": "all" if active == ["all"] else active,
        }
    )


def _curve(curve: Curve, name: str) -> Iterator[str]:
    line = None
    if curve.line_mm is not None:
        line = {a: float(v) for a, v in zip(AXES, curve.line_mm, strict=True) if a != curve.axis}
    yield from ("", "[[curves]]")
    yield from toml_lines(
        {
            "file": name,
            "line_mm": line,
            "tool_mm": _floats(curve.tool_mm),
            "reference": None if curve.reference == "functional-point" else curve.reference,
            "interpolation": curve.interpolation,
        }
    )


def _squareness(squareness: Mapping[str, float]) -> Iterator[str]:
    yield from ("", "[squareness]")
    yield from toml_lines({f"{name}_urad": in_unit(squareness.get(name, 0.0), -6) for name in SQUARENESS})


def _backlash(backlash_mm: Vector) -> Iterator[str]:
    if any(backlash_mm):
        yield from ("", "[backlash]")
        yield from toml_lines({f"{a}_um": in_unit(b, -3) for a, b in zip(AXES, backlash_mm, strict=True)})


def _repeatability(repeatability_mm: Vector | None) -> Iterator[str]:
    if repeatability_mm is not None:
        yield from ("", "[repeatability]")
        yield from toml_lines(
            {f"{a}_um": in_unit(s, -3) for a, s in zip(AXES, repeatability_mm, strict=True)}
        )


def _cyclic(cyclic: Cyclic) -> Iterator[str]:
    angular = cyclic.component[1] in "ABC"
    yield from ("", "[[cyclic]]")
    yield from toml_lines(
        {
            "component": cyclic.component,
            "period_mm": cyclic.period_mm,
            "amplitude_um": None if angular else in_unit(cyclic.amplitude, -3),
            "amplitude_urad": in_unit(cyclic.amplitude, -6) if angular else None,
            "phase_rad": cyclic.phase_rad,
        }
    )


def _thermal(thermal: Thermal, structure: str | None) -> Iterator[str]:
    scales = zip(AXES, thermal.scale_per_K, strict=True)
    yield from ("", "[thermal]")
    yield from toml_lines({f"{axis}_scale_um_m_K": in_unit(scale, -6) for axis, scale in scales})
    yield from toml_lines(
        {
            "structure": structure,
            "workpiece_um_m_K": in_unit(thermal.workpiece_per_K, -6),
            "fixed_at_mm": None if thermal.fixed_at_mm == ZERO else _floats(thermal.fixed_at_mm),
            "clamped_at_mm": None if thermal.clamped_at_mm == ZERO else _floats(thermal.clamped_at_mm),
        }
    )


def _csv(curve: Curve, sigma: Mapping[str, Array]) -> str:
    for component, values in sigma.items():
        if np.shape(values) != curve.position_mm.shape or not np.all(np.asarray(values) >= 0.0):
            raise ConfigError(
                f"sigma of {component} has shape {np.shape(values)}; expected a number of 0 or above at each "
                f"of {len(curve.position_mm)} positions"
            )
    units = {name: ("um", -3) if name[1] in AXES else ("urad", -6) for name in curve.names}
    both = bool(curve.forward)
    header = [f"{curve.axis}_mm", *(["direction"] if both else [])]
    header += [f"{name}_{unit}" for name, (unit, _) in units.items()]
    header += [f"sigma_{name}_{units[name][0]}" for name in sigma]
    positions = [in_unit_text(position, 0) for position in curve.position_mm.tolist()]
    rows = [",".join(header)]
    for direction, columns in (("+1", curve.forward), ("-1", curve.backward), ("", curve.columns)):
        if columns:
            cells = [positions, *([[direction] * len(positions)] if both else [])]
            cells += [_column(columns[name], power) for name, (_, power) in units.items()]
            cells += [_column(values, units[name][1]) for name, values in sigma.items()]
            rows += [",".join(row) for row in zip(*cells, strict=True)]
    return "\n".join(rows) + "\n"


def _column(values: Array, power: int) -> list[str]:
    return [in_unit_text(value, power) for value in np.asarray(values, float).tolist()]


def _floats(vector: Vector) -> list[float]:
    return [float(value) for value in vector]
