"""Reads and writes the thermal structure of a machine (olp-thermal-1), and reads logs of temperatures and
drift."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.patterns import pattern
from olp.core.schema import Table
from olp.core.units import AXES, shifted
from olp.errormodel.sources.structure import Structure, ThermalFile, structure_of, structure_tables
from olp.files.columns import Row, Wanted, names, read_sheet
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import comment, line_of, read_toml, toml_document
from olp.files.write import PathLike, Reader, read_bytes
from olp.program.text.rows import LOOSE_CSV

if TYPE_CHECKING:
    from olp.calibration.thermal.drift import DriftLog

T = TypeVar("T", bound=Table)

_READING = pattern(r"(E[A-Z]{2})@([-+]?\d+(?:\.\d+)?)_(um|urad)")
_DATA = pattern(r"\s*#\s*(line_mm|tool_mm)\s*=\s*(.+?)\s*")


def load_structure(path: PathLike, machine: str | None = None, read: Reader = read_bytes) -> Structure:
    """The structure of an olp-thermal-1 file. Raises InputError where the file cannot be read, ConfigError
    with all problems."""
    try:
        return structure_of(read_document(path, ThermalFile, machine, read))
    except ConfigError as error:
        raise error.in_file(str(path)) from None


def read_document(path: PathLike, schema: type[T], machine: str | None, read: Reader) -> T:
    """A TOML file by its schema. Its key `machine` must be the name in the machine file. Raises InputError,
    ConfigError."""
    values, lines = read_toml(read(path), str(path))
    file = validate(schema, values, lines, str(path))
    named = getattr(file, "machine", None)
    if machine is not None and named != machine:
        sentence = f'machine = "{named}" is not the name in the machine file; expected "{machine}"'
        raise config_error([(line_of(("machine",), lines), sentence)], str(path))
    return file


def structure_text(structure: Structure, machine: str, notes: Sequence[str] = ()) -> bytes:
    """An olp-thermal-1 file that reads back as an equal structure. Notes become comments."""
    above = "".join(f"{line}\n" for note in notes for line in comment(note))
    return (above + toml_document(structure_tables(structure, machine))).encode()


def read_drift_log(path: PathLike, read: Reader = read_bytes) -> DriftLog:
    """A log: `t_s`, sensors `NAME_degC`, and readings of drift `EXX@500_um` (component @ axis position in
    mm). A reading may be empty.

    Comment lines `# tool_mm = [0, 0, -120]` and `# line_mm = [0, 500, -300]` state the tool vector and the
    positions of the axes. Raises InputError where the file cannot be read, ConfigError with every problem and
    its line.
    """
    return parse_drift_log(read(path), str(path))


def parse_drift_log(data: bytes, file: str) -> DriftLog:
    """As `read_drift_log`, from the bytes of the file."""
    from olp.calibration.thermal.drift import DriftLog

    sheet = read_sheet(data, file, _LOG)
    vectors, wrong = _stated_vectors(sheet.text)
    problems = [*sheet.problems, *_time_problems(sheet.rows), *wrong]
    if len(sheet.rows) < 2 and not problems:
        problems.append((sheet.line, f"{len(sheet.rows)} rows follow the header; expected at least 2"))
    if problems:
        raise config_error(problems, file)
    columns = sheet.columns
    sensors = {name.removesuffix("_degC"): columns[name] for name in columns if name.endswith("_degC")}
    readings: dict[tuple[str, float], Array] = {}
    for name in columns:
        match = _READING.fullmatch(name)
        if match:
            readings[match[1], float(match[2])] = columns[name]
    line_mm = vectors.get("line_mm")
    return DriftLog(columns["t_s"], sensors, readings, line_mm, vectors.get("tool_mm", ZERO), file)


def _header_problems(line: int, header: Sequence[str]) -> list[Problem]:
    problems: list[Problem] = []
    if header[0] != "t_s":
        problems.append((line, f'column 1 is "{header[0]}"; expected t_s, the time in s'))
    problems += names(line, header, _column_problem, 2)
    if not problems and not any(name.endswith("_degC") for name in header):
        problems.append((line, "there is no sensor; expected columns such as beam_degC"))
    return problems


def _column_problem(_: int, name: str) -> str | None:
    """What is wrong with the name of a column behind the time, or None."""
    match = _READING.fullmatch(name)
    if match:
        unit = "um" if match[1][1] in AXES else "urad"
        right = match[1] in COMPONENTS and match[3] == unit
        return None if right else f"expected an ISO 230-1 name and its unit, {unit} here"
    if name.endswith("_degC") and len(name) > len("_degC"):
        return None
    return "expected a sensor such as beam_degC, or a reading such as EXX@500_um"


def _number(name: str, cell: str) -> tuple[float, str | None]:
    """The number in a cell; a reading may be empty."""
    reading = _READING.fullmatch(name)
    if reading and not cell:
        return math.nan, None
    try:
        value = shifted(cell, 0 if reading is None else -3 if reading[3] == "um" else -6)
    except ValueError:
        value = math.nan
    good = math.isfinite(value)
    return value, None if good else f'{name} = "{cell}" is not a number; expected a finite number'


def _time_problems(rows: Sequence[Row]) -> Iterator[Problem]:
    for (_, before), (line, row) in pairwise(rows):
        if not row[0] > before[0]:
            yield line, f"t_s = {row[0]:g} comes after {before[0]:g}; expected ascending times"


_LOG = Wanted(
    "holds no header; expected t_s, NAME_degC ..., EXX@500_um ...",
    _header_problems,
    _number,
    "; expected one value per column",
    form=LOOSE_CSV,
)


def _stated_vectors(text: str) -> tuple[dict[str, Vector], list[Problem]]:
    """`line_mm` and `tool_mm` from comment lines."""
    vectors: dict[str, Vector] = {}
    problems: list[Problem] = []
    for number, line in enumerate(text.splitlines(), 1):
        match = _DATA.fullmatch(line)
        if not match:
            continue
        try:
            value = tomllib.loads(f"v = {match[2]}")["v"]
            if isinstance(value, dict) and match[1] == "line_mm":
                value = [value.get(axis) for axis in AXES]
            x, y, z = (float(v) for v in value)
            vectors[match[1]] = (x, y, z)
        except (ValueError, TypeError):
            problems.append((number, f"{match[1]} = {match[2]}; expected three lengths, [X, Y, Z] in mm"))
    return vectors, problems


def sensors_of(log: DriftLog, names: Mapping[str, object]) -> dict[str, Array]:
    """The columns of a log for the sensors of a structure. Raises ConfigError where one is missing."""
    missing = [name for name in names if name not in log.sensors_degC]
    if missing:
        raise ConfigError(
            f"has no column {missing[0]}_degC; expected one column per sensor of the structure", file=log.name
        )
    return {name: log.sensors_degC[name] for name in names}
