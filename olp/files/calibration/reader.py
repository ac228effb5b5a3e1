"""Loads a calibration file with its curve files."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import TypeVar

import numpy as np

from olp.core.errors import ConfigError, InputError
from olp.core.machine import SQUARENESS, Machine, Vector
from olp.core.schema import Position
from olp.core.units import AXES, shifted
from olp.errormodel.beams import Beam, tube_mm4
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.errormodel.gridded import ComponentTable, DeviationMap
from olp.errormodel.structure import Structure
from olp.files.calibration.gridded_schema import BeamTable, ComplianceTable, MapTable
from olp.files.calibration.grids import read_component_grid, read_map
from olp.files.calibration.structure import load_structure
from olp.files.problems import config_error, validate
from olp.files.schemas import CalibrationFile, CurveTable, CyclicTable, ThermalTable
from olp.files.tables import read_curves
from olp.files.toml_text import Path, dotted, line_of, read_toml
from olp.files.write import PathLike, Reader, read_bytes

#: The workpiece's size holds at this temperature (ISO 1) where the job states none.
REFERENCE_DEGC = 20.0


T = TypeVar("T", CurveTable, MapTable, ComplianceTable)
V = TypeVar("V")


def files_beside(path: PathLike, read: Reader = read_bytes) -> list[FilePath]:
    """The files that a calibration file names, as far as it can be read; its loader says what is wrong with
    it."""
    try:
        values = tomllib.loads(read(path).decode("utf-8-sig"))
        names = [t["file"] for name in ("curves", "maps", "compliance") for t in values.get(name, ())]
        structure = values.get("thermal", {}).get("structure")
        covariance = values.get("covariance", {}).get("file")
        names += [name for name in (structure, covariance) if name]
        return [FilePath(path).parent / name for name in names]
    except (ValueError, TypeError, KeyError, AttributeError):
        return []


def load_calibration(
    path: PathLike,
    machine: Machine | None = None,
    temperatures_degC: Mapping[str, float] | None = None,
    read: Reader = read_bytes,
) -> Calibration:
    """The calibration of an olp-calibration-1 file.

    With `machine` it must belong to that machine. `temperatures_degC` are the job's: a scale that they
    leave out is at the calibration's temperature, the workpiece at 20 degC. Raises InputError where the
    file cannot be read, and ConfigError with all problems of it and of its curve files. `read` opens every
    file.
    """
    values, lines = read_toml(read(path), str(path))
    file = validate(CalibrationFile, values, lines, str(path))
    found = [(line_of(key, lines), sentence) for key, sentence in _mismatches(file, machine)]
    errors: list[ConfigError] = []

    def each(
        name: str, tables: Sequence[T], make: Callable[[FilePath, T, Vector, Reader], V]
    ) -> tuple[V, ...]:
        """What the tables [[name]] and their files hold."""
        made = []
        for index, table in enumerate(tables):
            key: Path = (name, index, "file")
            try:
                made.append(make(FilePath(path).parent / table.file, table, file.datum_mm, read))
            except ConfigError as error:
                errors.append(error)
            except InputError as error:
                found.append((line_of(key, lines), f'{dotted(key)} = "{table.file}": {error.message}'))
        return tuple(made)

    curves = each("curves", file.curves, _curve)
    maps = each("maps", file.maps, _map)
    compliance = each("compliance", file.compliance, _compliance)
    structure: Structure | None = None
    if file.thermal is not None and file.thermal.structure is not None:
        key = ("thermal", "structure")
        try:
            structure = load_structure(FilePath(path).parent / file.thermal.structure, file.machine, read)
        except ConfigError as error:
            errors.append(error)
        except InputError as error:
            found.append(
                (line_of(key, lines), f'{dotted(key)} = "{file.thermal.structure}": {error.message}')
            )
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
            curves=curves,
            maps=maps,
            compliance=compliance,
            beams=tuple(_beam(table, file.datum_mm) for table in file.compliance_beam),
            payload_kg=file.payload_kg,
            squareness={name: shifted(getattr(file.squareness, f"{name}_urad"), -6) for name in SQUARENESS},
            backlash_mm=_vector([shifted(getattr(file.backlash, f"{axis}_um"), -3) for axis in AXES]),
            repeatability_mm=None
            if file.repeatability is None
            else _vector([shifted(getattr(file.repeatability, f"{axis}_um"), -3) for axis in AXES]),
            cyclic=tuple(_cyclic(table) for table in file.cyclic),
            structure=structure,
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


def _curve(path: FilePath, table: CurveTable, datum_mm: Vector, read: Reader) -> Curve:
    columns = read_curves(path, read)
    both = columns.forward is not None
    try:
        return Curve(
            axis=columns.axis,
            position_mm=columns.position_mm,
            columns={} if both else columns.columns,
            forward=columns.forward or {},
            backward=columns.backward or {},
            line_mm=_line(table.line_mm, datum_mm),
            tool_mm=table.tool_mm,
            reference=table.reference,
            interpolation=table.interpolation,
        )
    except ConfigError as error:
        raise error.in_file(str(path)) from None


def _line(stated: Position, datum_mm: Vector) -> Vector:
    """Where the other axes stood; an axis left out stood at the datum."""
    return _vector([datum if at is None else at for at, datum in zip(stated.values, datum_mm, strict=True)])


def _map(path: FilePath, table: MapTable, datum_mm: Vector, read: Reader) -> DeviationMap:
    grid = read_map(path, read)
    order = [grid.arguments.index(axis) for axis in AXES]
    values = np.stack([grid.columns[f"D{axis}"].transpose(order) for axis in AXES], axis=-1)
    sigma = None
    if "sigma_DX" in grid.columns:
        sigma = np.stack([grid.columns[f"sigma_D{axis}"].transpose(order) for axis in AXES], axis=-1)
    x, y, z = (grid.knots_mm[k] for k in order)
    try:
        return DeviationMap(
            knots_mm=(x, y, z),
            values=values,
            kind=table.kind,
            tool_mm=table.tool_mm,
            interpolation=table.interpolation,
            holds_along=tuple(table.holds_along),
            name=f"map {table.file}",
            sigma=sigma,
        )
    except ConfigError as error:
        raise error.in_file(str(path)) from None


def _compliance(path: FilePath, table: ComplianceTable, datum_mm: Vector, read: Reader) -> ComponentTable:
    grid = read_component_grid(path, read)
    try:
        return ComponentTable(
            axis=next(iter(grid.columns))[2],
            arguments=grid.arguments,
            knots_mm=grid.knots_mm,
            columns=grid.columns,
            line_mm=_line(table.line_mm, datum_mm),
            tool_mm=table.tool_mm,
            reference=table.reference,
            interpolation=table.interpolation,
            name=f"compliance {table.file}",
        )
    except ConfigError as error:
        raise error.in_file(str(path)) from None


def _beam(table: BeamTable, datum_mm: Vector) -> Beam:
    second_moment = table.second_moment_mm4
    if second_moment is None:
        assert table.section_mm is not None
        second_moment = tube_mm4(*table.section_mm)
    return Beam(
        axis=table.axis,
        support=table.support,
        span_mm=table.span_mm,
        youngs_modulus_GPa=table.youngs_modulus_GPa,
        second_moment_mm4=second_moment,
        direction=table.direction,
        line_mm=_line(table.line_mm, datum_mm),
        tool_mm=table.tool_mm,
    )


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
