"""Loads a calibration file with the files that it names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, TypeVar

import numpy as np

from olp.core.errors import ConfigError, InputError
from olp.core.machine import Machine
from olp.core.schema import Table
from olp.errormodel.calibration import Calibration
from olp.errormodel.sources.base import NamesFile
from olp.errormodel.sources.registry import SOURCES
from olp.files.calibration.grids import GridTable, read_component_grid, read_map
from olp.files.calibration.schema import CalibrationFile, CalibrationHead, quality_of
from olp.files.calibration.structure import read_document
from olp.files.problems import Problem, config_error, validate
from olp.files.tables import CurveTable, read_curves
from olp.files.toml_text import Path, dotted, line_of, read_toml
from olp.files.write import PathLike, Reader, read_bytes

F = TypeVar("F", bound=NamesFile)
T = TypeVar("T", bound=Table)
S = TypeVar("S")
V = TypeVar("V")


def files_beside(path: PathLike, read: Reader = read_bytes) -> list[FilePath]:
    """The files that a calibration file names, none where it cannot be read: its loader reports what is
    wrong."""
    data = read(path)
    try:
        values: Any = read_toml(data, str(path))[0]
        names = [name for source in SOURCES for name in source.named(values)]
        covariance = values.get("covariance", {}).get("file")
        names += [covariance] if covariance else []
        return [FilePath(path).parent / name for name in names]
    except (ConfigError, TypeError, KeyError, AttributeError):
        return []


def load_calibration(
    path: PathLike,
    machine: Machine | None = None,
    temperatures_degC: Mapping[str, float] | None = None,
    read: Reader = read_bytes,
) -> Calibration:
    """The calibration of an olp-calibration-1 file.

    With `machine` it must belong to that machine. `temperatures_degC` are those of the job. The default of a
    scale is the temperature of the calibration, that of the workpiece 20 degC. `read` opens every file.
    Raises InputError where the file cannot be read, and ConfigError with all problems of it and of the files
    that it names.
    """
    reading = CalibrationReading(path, temperatures_degC or {}, read)
    file = reading.file
    reading.refuse(_mismatches(file, machine))
    values = {source: source.read(source.stated(file), reading) for source in SOURCES}
    reading.finish()
    try:
        return Calibration(
            machine=file.machine,
            box_mm=np.array(file.box_mm),
            model=file.model,
            datum_mm=file.datum_mm,
            payload_kg=file.payload_kg,
            temperature_degC=file.temperature_degC,
            measured=file.measured,
            valid_until=file.valid_until,
            active_during_measurement=file.active_during_measurement,
            quality=quality_of(file),
            more=tuple((source.key, value) for source, value in values.items() if not source.field and value),
            **{source.field: value for source, value in values.items() if source.field},
        )
    except ConfigError as error:
        raise error.in_file(str(path)) from None


class CalibrationReading:
    """A calibration file while it is read. It collects what is wrong with the files that it names, and raises
    InputError and ConfigError for the file itself."""

    def __init__(self, path: PathLike, temperatures_degC: Mapping[str, float], read: Reader) -> None:
        values, self._lines = read_toml(read(path), str(path))
        self.file = validate(CalibrationFile, values, self._lines, str(path))
        self.machine, self.datum_mm = self.file.machine, self.file.datum_mm
        self.temperature_degC = self.file.temperature_degC
        self.temperatures_degC = temperatures_degC
        self._path, self._read = path, read
        self._problems: list[Problem] = []
        self._errors: list[ConfigError] = []

    def refuse(self, problems: Iterator[tuple[Path, str]]) -> None:
        """Take keys and what is wrong with them."""
        self._problems += [(line_of(key, self._lines), sentence) for key, sentence in problems]

    def finish(self) -> None:
        """Raises ConfigError where anything was wrong."""
        errors = list(self._errors)
        if self._problems:
            errors.insert(0, config_error(self._problems, str(self._path)))
        if errors:
            raise _merged(errors)

    def each(self, key: str, tables: Sequence[F], make: Callable[[F], V]) -> tuple[V, ...]:
        made = [
            self._made((key, index, "file"), table.file, make, table) for index, table in enumerate(tables)
        ]
        return tuple(one for one in made if one is not None)

    def one(self, key: tuple[str, ...], file: str, make: Callable[[str], V]) -> V | None:
        return self._made(key, file, make, file)

    def _made(self, key: Path, file: str, make: Callable[[S], V], of: S) -> V | None:
        try:
            return make(of)
        except ConfigError as error:
            self._errors.append(error)
            error.in_file(str(self._beside(file)))
        except InputError as error:
            where = line_of(key, self._lines)
            self._problems.append((where, f'{dotted(key)} = "{file}": {error.message}'))
        return None

    def content(self, file: str) -> bytes:
        return self._read(self._beside(file))

    def curve(self, file: str) -> CurveTable:
        return read_curves(self._beside(file), self._read)

    def deviations(self, file: str) -> GridTable:
        return read_map(self._beside(file), self._read)

    def components(self, file: str) -> GridTable:
        return read_component_grid(self._beside(file), self._read)

    def document(self, file: str, schema: type[T]) -> T:
        return read_document(self._beside(file), schema, self.machine, self._read)

    def _beside(self, file: str) -> FilePath:
        return FilePath(self._path).parent / file


def _mismatches(file: CalibrationHead, machine: Machine | None) -> Iterator[tuple[Path, str]]:
    """Where the calibration contradicts the machine file."""
    if machine is None:
        return
    if file.machine != machine.name:
        yield (
            ("machine",),
            f'machine = "{file.machine}" is not the name in the machine file; expected "{machine.name}", '
            "because a calibration belongs to one machine",
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
            "the machine file; expected each in one of them, because the curves do not hold errors that the "
            "control corrected while measuring",
        )


def _merged(errors: Sequence[ConfigError]) -> ConfigError:
    """One error for several files. Each problem names its file."""
    if len(errors) == 1:
        return errors[0]
    problems = tuple(problem for error in errors for problem in str(error).split("\n"))
    return ConfigError("; ".join(problems), problems=problems)
