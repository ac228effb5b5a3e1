"""Reads and writes the thermal structure of a machine (olp-thermal-1), and reads logs of temperatures and
drift."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

from olp.calibration.thermal.drift import DriftLog
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.schema import Table
from olp.core.units import AXES, shifted
from olp.errormodel.sources.structure import Structure, ThermalFile, structure_of, structure_tables
from olp.files.problems import Problem, config_error, validate
from olp.files.tables import decoded, headed
from olp.files.toml_text import comment, line_of, read_toml, toml_document
from olp.files.write import PathLike, Reader, read_bytes

T = TypeVar("T", bound=Table)

_READING = re.compile(r"(E[A-Z]{2})@([-+]?\d+(?:\.\d+)?)_(um|urad)")
_DATA = re.compile(r"\s*#\s*(line_mm|tool_mm)\s*=\s*(.+?)\s*")


def load_structure(path: PathLike, machine: str | None = None, read: Reader = read_bytes) -> Structure:
    """The structure of an olp-thermal-1 file. Raises InputError where it cannot be read, ConfigError with all
    problems."""
    try:
        return structure_of(read_document(path, ThermalFile, machine, read))
    except ConfigError as error:
        raise error.in_file(str(path)) from None


def read_document(path: PathLike, schema: type[T], machine: str | None, read: Reader) -> T:
    """A TOML file by its schema, whose key `machine` must be that of the machine file. Raises InputError,
    ConfigError."""
    values, lines = read_toml(read(path), str(path))
    file = validate(schema, values, lines, str(path))
    named = getattr(file, "machine", None)
    if machine is not None and named != machine:
        sentence = f'machine = "{named}" is not the name in the machine file; expected "{machine}"'
        raise config_error([(line_of(("machine",), lines), sentence)], str(path))
    return file


def structure_text(structure: Structure, machine: str, notes: Sequence[str] = ()) -> bytes:
    """An olp-thermal-1 file that reads back the same; notes become comments."""
    above = "".join(f"{line}\n" for note in notes for line in comment(note))
    return (above + toml_document(structure_tables(structure, machine))).encode()


def read_drift_log(path: PathLike, read: Reader = read_bytes) -> DriftLog:
    """A log: `t_s`, sensors `NAME_degC`, and readings of drift `EXX@500_um` (component @ axis position in
    mm); a reading may be empty. Comment lines `# tool_mm = [0, 0, -120]` and `# line_mm = [0, 500, -300]` say
    with what and where it was read.

    Raises InputError where it cannot be read, ConfigError with every problem and its line.
    """
    return parse_drift_log(read(path), str(path))


def parse_drift_log(data: bytes, file: str) -> DriftLog:
    """As `read_drift_log`, from the bytes of the file."""
    expected = "t_s, NAME_degC ..., EXX@500_um ..."
    line, header, records = headed(data, file, expected, _header_problems)
    rows, found = _rows(header, records)
    placed, wrong = _placed(decoded(data, file))
    found += wrong
    if len(rows) < 2 and not found:
        found.append((line, f"{len(rows)} rows follow the header; expected at least 2"))
    if found:
        raise config_error(found, file)
    table = np.array(rows)
    sensors = {n.removesuffix("_degC"): table[:, i] for i, n in enumerate(header) if n.endswith("_degC")}
    readings: dict[tuple[str, float], Array] = {}
    for i, name in enumerate(header):
        match = _READING.fullmatch(name)
        if match:
            readings[match[1], float(match[2])] = table[:, i]
    line_mm = placed.get("line_mm")
    return DriftLog(table[:, 0], sensors, readings, line_mm, placed.get("tool_mm", ZERO), file)


def _header_problems(line: int, header: Sequence[str]) -> list[Problem]:
    problems: list[Problem] = []
    if header[0] != "t_s":
        problems.append((line, f'column 1 is "{header[0]}"; expected t_s, the time in s'))
    for number, name in enumerate(header[1:], 2):
        match = _READING.fullmatch(name)
        if header.index(name) < number - 1:
            problems.append((line, f'column {number} repeats "{name}"; expected each column once'))
        elif match:
            unit = "um" if match[1][1] in AXES else "urad"
            if match[1] not in COMPONENTS or match[3] != unit:
                problems.append(
                    (
                        line,
                        f'column {number} is "{name}"; expected an ISO 230-1 name and its unit, {unit} here',
                    )
                )
        elif not (name.endswith("_degC") and len(name) > len("_degC")):
            problems.append(
                (
                    line,
                    f'column {number} is "{name}"; expected a sensor such as beam_degC, or a reading such as '
                    "EXX@500_um",
                )
            )
    if not problems and not any(name.endswith("_degC") for name in header):
        problems.append((line, "there is no sensor; expected columns such as beam_degC"))
    return problems


def _rows(
    header: Sequence[str], records: Sequence[tuple[int, list[str]]]
) -> tuple[list[list[float]], list[Problem]]:
    rows: list[list[float]] = []
    problems: list[Problem] = []
    for line, cells in records:
        if len(cells) != len(header):
            problems.append(
                (line, f"{len(cells)} values under {len(header)} columns; expected one value a column")
            )
            continue
        row = []
        for name, cell in zip(header, cells, strict=True):
            reading = _READING.fullmatch(name)
            power = 0 if reading is None else -3 if reading[3] == "um" else -6
            try:
                value = math.nan if reading and not cell else shifted(cell, power)
                good = math.isfinite(value) or (reading is not None and not cell)
            except ValueError:
                value, good = math.nan, False
            if not good:
                problems.append((line, f'{name} = "{cell}" is no number; expected a finite number'))
            row.append(value)
        if rows and not row[0] > rows[-1][0]:
            problems.append((line, f"t_s = {row[0]:g} comes after {rows[-1][0]:g}; expected ascending times"))
        rows.append(row)
    return rows, problems


def _placed(text: str) -> tuple[dict[str, Vector], list[Problem]]:
    """What comment lines say of line and tool."""
    found: dict[str, Vector] = {}
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
            found[match[1]] = (x, y, z)
        except (ValueError, TypeError):
            problems.append((number, f"{match[1]} = {match[2]}; expected three lengths, [X, Y, Z] in mm"))
    return found, problems


def sensors_of(log: DriftLog, names: Mapping[str, object]) -> dict[str, Array]:
    """The sensors of a log that a structure has. Raises ConfigError where one is missing."""
    missing = [name for name in names if name not in log.sensors_degC]
    if missing:
        raise ConfigError(
            f"has no column {missing[0]}_degC; expected one for each sensor of the structure", file=log.name
        )
    return {name: log.sensors_degC[name] for name in names}
