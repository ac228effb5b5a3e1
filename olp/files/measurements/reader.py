"""Reads the measurements of a calibration: a plan (olp-measurements-1), or files that describe themselves.

A plan is a TOML file, named in the call or standing in a folder as `measurements.toml`. In a folder without
one, every CSV file says in comments `# key = value` what it holds. What a line of the plan and its file both
state must agree; [defaults] fill in what neither does. Nothing about a sense, a place or a lever is assumed.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

from olp.calibration.observations.base import Observation
from olp.calibration.observations.lines import Line, Square
from olp.calibration.observations.measurements import MapWish, Measurements
from olp.core.errors import ConfigError, InputError
from olp.core.units import AXES, MM_PER_UM, RAD_PER_URAD
from olp.files.columns import decoded
from olp.files.measurements.instruments.base import Plan
from olp.files.measurements.instruments.registry import INSTRUMENTS, rank_of
from olp.files.measurements.lines_said import as_line, stated_of, word
from olp.files.measurements.readings import check_component, parse_readings
from olp.files.measurements.schemas import MeasurementsFile, SquareTable
from olp.files.measurements.stated import stated_keys
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import Path, dotted, line_of, read_toml
from olp.files.write import PathLike, read_bytes

PLAN = "measurements.toml"


@dataclass(slots=True)
class _Gathered:
    """What the files said so far, and what is wrong with them."""

    chain: str | None
    observations: list[Observation] = field(default_factory=list)
    squares: dict[str, Square] = field(default_factory=dict)
    periods: dict[str, set[float]] = field(default_factory=lambda: {axis: set() for axis in AXES})
    whole: dict[str, tuple[Any, str]] = field(default_factory=dict)
    errors: list[ConfigError] = field(default_factory=list)
    map: MapWish | None = None

    def state(self, key: str, value: Any, file: str, line: int | None) -> None:
        """Take what holds for the whole calibration; two files must not contradict each other."""
        known = self.whole.setdefault(key, (value, file))
        if known[0] != value:
            sentence = f"{key} = {word(value)}, but {known[1]} says {word(known[0])}"
            self.errors.append(config_error([(line, sentence)], file))


def load_measurements(sources: Sequence[PathLike], chain: str | None = None) -> Measurements:
    """All readings of plans, folders and self-describing files together.

    With `chain` what is said of moving tables is checked against it. Raises InputError where a file cannot
    be read, and ConfigError with every problem of all files.
    """
    found = _Gathered(chain)
    for source in sources:
        path = FilePath(source)
        if path.is_dir():
            if (path / PLAN).is_file():
                _plan(path / PLAN, found)
            else:
                _folder(path, found)
        elif path.suffix.lower() == ".toml":
            _plan(path, found)
        else:
            _alone(path, found)
    if not found.errors:
        found.errors += _undefined_squares(found)
        found.errors += [
            config_error(
                [(None, f"{key} is stated nowhere; expected it in the plan or in a file")], "measurements"
            )
            for key in ("machine", "measured", "temperature_degC")
            if key not in found.whole
        ]
    if found.errors:
        problems = tuple(text for error in found.errors for text in str(error).split("\n"))
        raise ConfigError("; ".join(problems), problems=problems)
    x, y, z = (tuple(sorted(found.periods[axis])) for axis in AXES)
    return Measurements(
        machine=found.whole["machine"][0],
        observations=tuple(sorted(found.observations, key=rank_of)),
        squares=tuple(found.squares.values()),
        periods_mm=(x, y, z),
        temperature_degC=found.whole["temperature_degC"][0],
        active_during_measurement=found.whole.get("active_during_measurement", (frozenset(), ""))[0],
        measured=found.whole["measured"][0],
        chain=found.chain,
        map=found.map,
    )


def files_of_measurements(sources: Sequence[PathLike]) -> tuple[str, ...]:
    """Every file that `load_measurements` would read, as far as the plans can be read."""
    names: list[FilePath] = []
    for source in sources:
        path = FilePath(source)
        plan = path / PLAN if path.is_dir() else path
        if path.is_dir() and not plan.is_file():
            names += sorted(path.glob("*.csv"))
            continue
        names.append(plan)
        if plan.suffix.lower() != ".toml":
            continue
        try:
            stated = tomllib.loads(read_bytes(plan).decode("utf-8-sig"))
            for table in (t for instrument in INSTRUMENTS for t in stated.get(instrument.key, ())):
                names += [plan.parent / table[key] for key in ("file", "profile") if key in table]
        except (InputError, ValueError, TypeError, AttributeError):
            # The loader says what is wrong with it.
            continue
    return tuple(str(name) for name in names)


# -- plans -----------------------------------------------------------------------------------------------


def _plan(path: FilePath, found: _Gathered) -> None:
    values, places = read_toml(read_bytes(path), str(path))
    try:
        plan = validate(MeasurementsFile, values, places, str(path))
    except ConfigError as error:
        found.errors.append(error)
        return
    for name in ("machine", "measured", "temperature_degC", "active_during_measurement"):
        found.state(name, getattr(plan, name), str(path), line_of((name,), places))
    if plan.chain is not None:
        found.state("chain", plan.chain, str(path), line_of(("chain",), places))
        if found.chain is not None and found.chain != plan.chain:
            sentence = f'chain = "{plan.chain}", but the machine file says "{found.chain}"'
            found.errors.append(config_error([(line_of(("chain",), places), sentence)], str(path)))
        found.chain = found.chain or plan.chain
    if plan.map is not None:
        found.map = MapWish(plan.map.noise, plan.map.within_um * MM_PER_UM)
    for axis in AXES:
        found.periods[axis].update(getattr(plan.periods_mm, axis))
    problems: list[Problem] = []
    for index, square in enumerate(plan.squares):
        if square.name in found.squares:
            key: Path = ("squares", index, "name")
            problems.append((line_of(key, places), f'{dotted(key)} = "{square.name}" is defined twice'))
        found.squares[square.name] = _square(square)
    problems += _readings(plan, path, places, found)
    if problems:
        found.errors.append(config_error(problems, str(path)))


def _readings(
    plan: MeasurementsFile, path: FilePath, places: Mapping[Path, int], found: _Gathered
) -> Iterator[Problem]:
    """Takes the readings of all tables, and yields what is wrong with the tables."""
    whole = Plan(path, plan.defaults, plan.vertical, found.chain)
    for instrument in INSTRUMENTS:
        for index, table in enumerate(getattr(plan, instrument.key)):
            key: Path = (instrument.key, index)
            file: str | None = getattr(table, "file", None)
            try:
                found.observations.append(instrument.read(table, whole))
            except ConfigError as error:
                if error.file not in (None, str(path)):
                    found.errors.append(error)
                    continue
                name = dotted(key) if file is None else f"{dotted(key)} ({file})"
                yield from ((line_of(key, places), f"{name}: {text}") for text in error.problems)
            except InputError as error:
                sentence = f'{dotted(key)}.file = "{file}": {error.message}'
                yield line_of((*key, "file"), places), sentence


# -- files that describe themselves ----------------------------------------------------------------------


def _folder(folder: FilePath, found: _Gathered) -> None:
    files = sorted(folder.glob("*.csv"))
    if not files:
        sentence = f"holds neither {PLAN} nor CSV files; expected one of them"
        found.errors.append(ConfigError(sentence, file=str(folder)))
    for path in files:
        _alone(path, found)


def _alone(path: FilePath, found: _Gathered) -> None:
    try:
        data = read_bytes(path)
        keys = dict(stated_keys(decoded(data, str(path))))
        readings = parse_readings(data, str(path))
        stated, places = stated_of(keys, str(path))
        if stated.component is None:
            sentence = 'does not say what it holds; expected a comment such as # component = "EXX", or a plan'
            raise ConfigError(sentence, file=str(path))
        check_component(readings, stated.component)
        line = as_line(readings, stated.component, stated, "Z", found.chain, str(path))
    except ConfigError as error:
        found.errors.append(error)
        return
    found.observations.append(line)
    for key in ("machine", "measured", "temperature_degC", "active_during_measurement"):
        if getattr(stated, key) is not None:
            found.state(key, getattr(stated, key), str(path), places.get(key))
    found.periods[stated.component[2]].update(stated.period_mm)
    if stated.square is not None and stated.square_sigma_urad is not None:
        deviation = (stated.square_error_urad or 0.0) * RAD_PER_URAD
        square = Square(stated.square, deviation, stated.square_sigma_urad * RAD_PER_URAD)
        if found.squares.setdefault(stated.square, square) != square:
            sentence = f'square "{stated.square}" is stated otherwise in another file'
            found.errors.append(config_error([(places.get("square"), sentence)], str(path)))


def _square(table: SquareTable) -> Square:
    return Square(table.name, table.error_urad * RAD_PER_URAD, table.sigma_urad * RAD_PER_URAD)


def _undefined_squares(found: _Gathered) -> Iterator[ConfigError]:
    for line in found.observations:
        if isinstance(line, Line) and line.square is not None and line.square not in found.squares:
            yield ConfigError(
                f'square "{line.square}" is not defined; expected a table [[squares]] with its sigma_urad or '
                "square_sigma_urad in the file",
                file=line.source,
            )
