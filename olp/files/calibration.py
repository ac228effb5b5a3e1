"""Loads a calibration file with its curve files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath

import numpy as np

from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.exceptions import ConfigError, InputError
from olp.files.problems import config_error, validate
from olp.files.schemas import CalibrationFile, CurveTable, CyclicTable, ThermalTable
from olp.files.tables import read_curves
from olp.files.toml_text import Path, dotted, line_of, read_toml
from olp.files.write import PathLike, read_bytes
from olp.machine import SQUARENESS, Machine, Vector
from olp.units import AXES, shifted

#: The workpiece's size holds at this temperature (ISO 1) where the job states none.
REFERENCE_DEGC = 20.0


def load_calibration(
    path: PathLike, machine: Machine | None = None, temperatures_degC: Mapping[str, float] | None = None
) -> Calibration:
    """The calibration of an olp-calibration-1 file.

    With `machine` it must belong to that machine. `temperatures_degC` are the job's: a scale that they
    leave out is at the calibration's temperature, the workpiece at 20 degC. Raises InputError where the
    file cannot be read, and ConfigError with all problems of it and of its curve files.
    """
    values, lines = read_toml(read_bytes(path), str(path))
    file = validate(CalibrationFile, values, lines, str(path))
    found = [(line_of(key, lines), sentence) for key, sentence in _mismatches(file, machine)]
    errors: list[ConfigError] = []
    curves: list[Curve] = []
    for index, table in enumerate(file.curves):
        key: Path = ("curves", index, "file")
        try:
            curves.append(_curve(FilePath(path).parent / table.file, table, file.datum_mm))
        except ConfigError as error:
            errors.append(error)
        except InputError as error:
            found.append((line_of(key, lines), f'{dotted(key)} = "{table.file}": {error.message}'))
    if found:
        errors.insert(0, config_error(found, str(path)))
    if errors:
        raise _merged(errors)
    try:
        return Calibration(
            machine=file.machine,
            box_mm=np.array(file.box_mm),
            model=file.model,
            datum_mm=file.datum_mm,
            curves=tuple(curves),
            squareness={name: shifted(getattr(file.squareness, f"{name}_urad"), -6) for name in SQUARENESS},
            backlash_mm=_vector([shifted(getattr(file.backlash, f"{axis}_um"), -3) for axis in AXES]),
            cyclic=tuple(_cyclic(table) for table in file.cyclic),
            thermal=_thermal(file.thermal, file.temperature_degC, temperatures_degC or {}),
            temperature_degC=file.temperature_degC,
            measured=file.measured,
            valid_until=file.valid_until,
            active_during_measurement=file.active_during_measurement,
        )
    except ConfigError as error:
        raise error.in_file(str(path)) from None


def _mismatches(file: CalibrationFile, machine: Machine | None) -> Iterator[tuple[Path, str]]:
    """Where the calibration contradicts the machine file."""
    if machine is None:
        return
    if file.machine != machine.name:
        yield (
            ("machine",),
            f'machine = "{file.machine}" is not the name in the machine file; expected "{machine.name}": '
            "a calibration belongs to one machine",
        )
    if file.model == "huddersfield" and machine.chain != "FXYZ":
        yield (
            ("model",),
            f'model = "huddersfield" does not fit the chain {machine.chain}; expected chain = "FXYZ", or '
            'model = "rigid-body"',
        )
    both = sorted(file.active_during_measurement & machine.compensated_by_controller)
    if both:
        yield (
            ("active_during_measurement",),
            f"active_during_measurement names {', '.join(both)}, and so does compensated_by_controller of "
            "the machine file; expected each in one of them: the curves do not hold what the control "
            "corrected while measuring",
        )


def _curve(path: FilePath, table: CurveTable, datum_mm: Vector) -> Curve:
    columns = read_curves(path)
    both = columns.forward is not None
    line = [datum if at is None else at for at, datum in zip(table.line_mm.values, datum_mm, strict=True)]
    try:
        return Curve(
            axis=columns.axis,
            position_mm=columns.position_mm,
            columns={} if both else columns.columns,
            forward=columns.forward or {},
            backward=columns.backward or {},
            line_mm=_vector(line),
            tool_mm=table.tool_mm,
            reference=table.reference,
            interpolation=table.interpolation,
        )
    except ConfigError as error:
        raise error.in_file(str(path)) from None


def _cyclic(table: CyclicTable) -> Cyclic:
    if table.amplitude_um is not None:
        amplitude = shifted(table.amplitude_um, -3)
    else:
        amplitude = shifted(table.amplitude_urad or 0.0, -6)
    return Cyclic(table.component, table.period_mm, amplitude, table.phase_rad)


def _thermal(
    table: ThermalTable | None, calibrated_at_degC: float, temperatures_degC: Mapping[str, float]
) -> Thermal | None:
    if table is None:
        return None
    return Thermal(
        scale_per_K=_vector([shifted(getattr(table, f"{axis}_scale_um_m_K"), -6) for axis in AXES]),
        fixed_at_mm=table.fixed_at_mm,
        workpiece_per_K=shifted(table.workpiece_um_m_K, -6),
        clamped_at_mm=table.clamped_at_mm,
        calibrated_at_degC=calibrated_at_degC,
        scale_degC=_vector([temperatures_degC.get(f"{axis}_scale", calibrated_at_degC) for axis in AXES]),
        workpiece_degC=temperatures_degC.get("workpiece", REFERENCE_DEGC),
    )


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = values
    return (x, y, z)


def _merged(errors: Sequence[ConfigError]) -> ConfigError:
    """One error for several files; each problem names its own."""
    if len(errors) == 1:
        return errors[0]
    problems = tuple(problem for error in errors for problem in str(error).split("\n"))
    return ConfigError("; ".join(problems), problems=problems)
