"""Reads the measurements of a calibration: a plan (olp-measurements-1), or files that describe themselves.

A plan is a TOML file, named in the call or found in a folder as `measurements.toml`. In a folder without
one, every file states in comments `# key = value` what it holds. A line of the plan and its file must
agree in the keys that both state. [defaults] apply to keys that neither states. No sign convention, position
or tool vector is ever assumed.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from olp.calibration.observations.base import Observation
from olp.calibration.observations.copies import refuse_copies
from olp.calibration.observations.lines import SAME_MM, Line, targets_of
from olp.calibration.observations.measurements import MapWish, Measurements
from olp.calibration.observations.references import Square, Straightedge
from olp.core.errors import ConfigError, InputError
from olp.core.units import AXES, MM_PER_UM, RAD_PER_URAD
from olp.core.values import dataclass
from olp.files.measurements.instruments.base import Plan
from olp.files.measurements.instruments.registry import INSTRUMENTS, rank_of
from olp.files.measurements.line_merging import as_line, stated_of, word
from olp.files.measurements.line_profile import read_line
from olp.files.measurements.readings import check_component
from olp.files.measurements.schemas import MeasurementsFile, SquareTable
from olp.files.measurements.seen import known_of
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import Path, dotted, line_of, read_toml
from olp.files.write import PathLike, read_bytes

#: The name of the plan in a folder.
PLAN = "measurements.toml"
#: Endings of files in a folder without a plan that may describe themselves.
ALONE = (".csv", ".rtl")
#: Endings of what lies beside readings and never is some: settings, papers, pictures.
BESIDE = (".toml", ".json", ".md", ".html", ".pdf", ".png", ".jpg", ".jpeg", ".svg")
#: The format of calibrations.
CALIBRATION = "olp-calibration-1"
#: Keys of tables that name a file.
_FILES = ("file", "profile", "certificate")
#: What to do where comments do not describe a file.
_A_PLAN = "a plan: olp calibrate fit FOLDER --propose PLAN.toml writes one"
#: Files that a sentence lists, at most.
_LISTED = 6


@dataclass(slots=True)
class _Gathered:
    """The contents of the files read so far, and what is wrong with them."""

    chain: str | None
    observations: list[Observation] = field(default_factory=list)
    squares: dict[str, Square] = field(default_factory=dict)
    straightedges: dict[str, Straightedge] = field(default_factory=dict)
    periods: dict[str, set[float]] = field(default_factory=lambda: {axis: set() for axis in AXES})
    whole: dict[str, tuple[Any, str]] = field(default_factory=dict)
    errors: list[ConfigError] = field(default_factory=list)
    map: MapWish | None = None

    def state(self, key: str, value: Any, file: str, line: int | None) -> None:
        """Take a value for the whole calibration. Two files must not contradict each other."""
        known = self.whole.setdefault(key, (value, file))
        if known[0] != value:
            sentence = f"{key} = {word(value)}, but {known[1]} says {word(known[0])}; expected the same"
            self.errors.append(config_error([(line, sentence)], file))


def load_measurements(sources: Sequence[PathLike], chain: str | None = None) -> Measurements:
    """All readings of plans, folders and self-describing files together.

    With `chain`, keys about moving tables are checked against it. Raises InputError where a file cannot be
    read, and ConfigError with every problem of all files.
    """
    gathered = _Gathered(chain)
    for source in sources:
        path = FilePath(source)
        if path.is_dir():
            if (path / PLAN).is_file():
                _plan(path / PLAN, gathered)
            else:
                _folder(path, gathered)
        elif path.suffix.lower() == ".toml":
            _plan(path, gathered)
        else:
            _alone(path, gathered)
    if not gathered.errors:
        gathered.errors += _undefined_squares(gathered)
        gathered.errors += _open_straightedges(gathered)
        gathered.errors += refuse_copies(gathered.observations)
        gathered.errors += [
            config_error([(None, f"{key} is missing; expected it in the plan or in a file")], "measurements")
            for key in ("machine", "measured", "temperature_degC")
            if key not in gathered.whole
        ]
    if gathered.errors:
        problems = tuple(text for error in gathered.errors for text in str(error).split("\n"))
        raise ConfigError("; ".join(problems), problems=problems)
    x, y, z = (tuple(sorted(gathered.periods[axis])) for axis in AXES)
    return Measurements(
        machine=gathered.whole["machine"][0],
        observations=tuple(sorted(gathered.observations, key=rank_of)),
        squares=tuple(gathered.squares.values()),
        straightedges=tuple(gathered.straightedges.values()),
        periods_mm=(x, y, z),
        temperature_degC=gathered.whole["temperature_degC"][0],
        active_during_measurement=gathered.whole.get("active_during_measurement", (frozenset(), ""))[0],
        measured=gathered.whole["measured"][0],
        chain=gathered.chain,
        map=gathered.map,
    )


def files_of_measurements(sources: Sequence[PathLike]) -> tuple[str, ...]:
    """Every file that `load_measurements` would read, as far as the plans can be read."""
    names: list[FilePath] = []
    for source in sources:
        path = FilePath(source)
        plan = path / PLAN if path.is_dir() else path
        if path.is_dir() and not plan.is_file():
            names += _alone_in(path)
            continue
        names.append(plan)
        if plan.suffix.lower() != ".toml":
            continue
        try:
            stated = tomllib.loads(read_bytes(plan).decode("utf-8-sig"))
            tables = [t for instrument in INSTRUMENTS for t in stated.get(instrument.key, ())]
            for table in (*tables, stated.get("defaults", {})):
                names += [plan.parent / table[key] for key in _FILES if key in table]
        except (InputError, ValueError, TypeError, AttributeError):
            # The loader reports what is wrong with it.
            continue
    return tuple(str(name) for name in names)


def files_left_out(sources: Sequence[PathLike]) -> tuple[str, ...]:
    """Files of folders without a plan that may hold readings, and that `load_measurements` does not read."""
    folders = [path for path in map(FilePath, sources) if path.is_dir() and not (path / PLAN).is_file()]
    files = (file for folder in folders for file in readings_in(folder))
    return tuple(str(file) for file in files if file.suffix.lower() not in ALONE)


def readings_in(folder: FilePath) -> list[FilePath]:
    """The files of a folder that may hold readings, as far as names tell: those of a calibration that was
    written there do not."""
    calibrated = {name for path in folder.glob("*.toml") for name in _made(path)}
    return [
        path
        for path in sorted(folder.iterdir())
        if path.is_file()
        and not path.name.startswith(".")
        and path.suffix.lower() not in BESIDE
        and path.name not in calibrated
    ]


def _made(path: FilePath) -> Iterator[str]:
    """The files that a calibration names; none where a file is no calibration."""
    try:
        stated = tomllib.loads(read_bytes(path).decode("utf-8-sig"))
    except (InputError, ValueError):
        return
    if stated.get("schema") == CALIBRATION:
        for value in stated.values():
            for table in value if isinstance(value, list) else [value]:
                if isinstance(table, dict):
                    yield from (str(table[key]) for key in _FILES if key in table)


def listed(files: Sequence[str]) -> str:
    """The first files by name, and how many more there are."""
    more = len(files) - _LISTED
    return ", ".join(files[:_LISTED]) + (f" and {more} more" if more > 0 else "")


# -- plans -----------------------------------------------------------------------------------------------


def _plan(path: FilePath, gathered: _Gathered) -> None:
    values, key_lines = read_toml(read_bytes(path), str(path))
    try:
        plan = validate(MeasurementsFile, values, key_lines, str(path))
    except ConfigError as error:
        gathered.errors.append(error)
        return
    for name in ("machine", "measured", "temperature_degC", "active_during_measurement"):
        gathered.state(name, getattr(plan, name), str(path), line_of((name,), key_lines))
    if plan.chain is not None:
        gathered.state("chain", plan.chain, str(path), line_of(("chain",), key_lines))
        if gathered.chain is not None and gathered.chain != plan.chain:
            sentence = (
                f'chain = "{plan.chain}", but the machine file says "{gathered.chain}"; expected the same'
            )
            gathered.errors.append(config_error([(line_of(("chain",), key_lines), sentence)], str(path)))
        gathered.chain = gathered.chain or plan.chain
    if plan.map is not None:
        gathered.map = MapWish(plan.map.noise, plan.map.within_um * MM_PER_UM)
    for axis in AXES:
        gathered.periods[axis].update(getattr(plan.periods_mm, axis))
    problems: list[Problem] = []
    for index, square in enumerate(plan.squares):
        if square.name in gathered.squares:
            key: Path = ("squares", index, "name")
            problems.append(
                (
                    line_of(key, key_lines),
                    f'{dotted(key)} = "{square.name}" is defined twice; expected it once',
                )
            )
        gathered.squares[square.name] = _square(square)
    for straightedge in plan.straightedges:
        sigma = (straightedge.sigma_um or 0.0) * MM_PER_UM
        gathered.straightedges[straightedge.name] = Straightedge(straightedge.name, sigma)
    problems += _readings(plan, path, key_lines, gathered)
    if problems:
        gathered.errors.append(config_error(problems, str(path)))


def _readings(
    plan: MeasurementsFile, path: FilePath, key_lines: Mapping[Path, int], gathered: _Gathered
) -> Iterator[Problem]:
    """Take the readings of all tables, and yield what is wrong with the tables."""
    whole = Plan(path, plan.defaults, plan.vertical, gathered.chain)
    for instrument in INSTRUMENTS:
        for index, table in enumerate(getattr(plan, instrument.key)):
            key: Path = (instrument.key, index)
            file: str | None = getattr(table, "file", None)
            try:
                gathered.observations.append(instrument.read(table, whole))
            except ConfigError as error:
                if error.file not in (None, str(path)):
                    gathered.errors.append(error)
                    continue
                name = dotted(key) if file is None else f"{dotted(key)} ({file})"
                yield from ((line_of(key, key_lines), f"{name}: {text}") for text in error.problems)
            except InputError as error:
                own = file is not None and error.file == str(whole.beside(file)) and error.line is None
                what = f'.file = "{file}": {error.message}' if own else f": {error}"
                yield line_of((*key, "file"), key_lines), dotted(key) + what


# -- files that describe themselves ----------------------------------------------------------------------


def _folder(folder: FilePath, gathered: _Gathered) -> None:
    files = _alone_in(folder)
    if not files:
        others = [path.name for path in readings_in(folder)]
        what = (
            f"; {listed(others)}: other layouts need a profile (olp-line-profile-1) and a plan"
            if others
            else ""
        )
        sentence = f"holds neither {PLAN} nor files {' or '.join(ALONE)}; expected one of them{what}"
        gathered.errors.append(ConfigError(sentence, file=str(folder)))
    known = len(gathered.errors)
    for path in files:
        _alone(path, gathered)
    gathered.errors[known:] = _joined(gathered.errors[known:], folder)


def _joined(errors: Sequence[ConfigError], folder: FilePath) -> Iterator[ConfigError]:
    """Each sentence once, with the files that it is about."""
    files: dict[tuple[str, ...], list[ConfigError]] = {}
    for error in errors:
        files.setdefault(error.problems, []).append(error)
    for problems, alike in files.items():
        if len(alike) == 1:
            yield alike[0]
            continue
        sentence = f"{listed([FilePath(str(error.file)).name for error in alike])}: {problems[0]}"
        yield ConfigError(sentence, file=str(folder), problems=(sentence, *problems[1:]))


def _alone_in(folder: FilePath) -> list[FilePath]:
    return [path for path in readings_in(folder) if path.suffix.lower() in ALONE]


def _alone(path: FilePath, gathered: _Gathered) -> None:
    try:
        _is_a_line(path)
        readings = read_line(path)
        stated, key_lines = stated_of(readings.keys, str(path))
        component = stated.component or readings.component
        if component is None:
            sentence = f'states no component; expected a comment such as # component = "EXX", or {_A_PLAN}'
            raise ConfigError(sentence, file=str(path))
        check_component(readings, component)
        line = as_line(readings, component, stated, "Z", gathered.chain, str(path))
    except ConfigError as error:
        gathered.errors.append(error)
        return
    gathered.observations.append(line)
    for key in ("machine", "measured", "temperature_degC", "active_during_measurement"):
        if getattr(stated, key) is not None:
            gathered.state(key, getattr(stated, key), str(path), key_lines.get(key))
    gathered.periods[component[2]].update(stated.period_mm)
    if stated.square is not None and stated.square_sigma_urad is not None:
        deviation = (stated.square_error_urad or 0.0) * RAD_PER_URAD
        square = Square(stated.square, deviation, stated.square_sigma_urad * RAD_PER_URAD)
        if gathered.squares.setdefault(stated.square, square) != square:
            sentence = f'square "{stated.square}" has other values in another file; expected the same'
            gathered.errors.append(config_error([(key_lines.get("square"), sentence)], str(path)))


def _is_a_line(path: FilePath) -> None:
    """Raise ConfigError for a file of another instrument."""
    known = known_of(path)
    if known is not None and known[0].key != "lines":
        sentence = f"holds readings of a table [[{known[0].key}]], which comments do not describe; expected"
        raise ConfigError(f"{sentence} {_A_PLAN}", file=str(path))


def _square(table: SquareTable) -> Square:
    return Square(table.name, table.error_urad * RAD_PER_URAD, table.sigma_urad * RAD_PER_URAD)


def _undefined_squares(gathered: _Gathered) -> Iterator[ConfigError]:
    for line in gathered.observations:
        if isinstance(line, Line) and line.square is not None and line.square not in gathered.squares:
            yield ConfigError(
                f'square "{line.square}" is not defined; expected a table [[squares]] with its sigma_urad or '
                "square_sigma_urad in the file",
                file=line.source,
            )


def _open_straightedges(gathered: _Gathered) -> Iterator[ConfigError]:
    """Straightedges that no plan defines, and those whose form neither a value nor a reversal shows."""
    against = [line for line in gathered.observations if isinstance(line, Line) and line.straightedge]
    for line in against:
        known = gathered.straightedges.get(line.straightedge or "")
        if known is None:
            yield ConfigError(
                f'straightedge "{line.straightedge}" is not defined; expected a table [[straightedges]]',
                file=line.source,
            )
            continue
        others = [
            np.abs(other.target_mm[:, None] - targets_of(line)).min(axis=0) <= SAME_MM
            for other in against
            if other.straightedge == line.straightedge and other.turned != line.turned
        ]
        if not known.sigma_mm and not (others and np.any(others, axis=0).sum() > 2):
            yield ConfigError(
                f'the form of straightedge "{known.name}" is unknown, and no other line was read at the same '
                "targets with it turned over; expected one with turned_over the other way, or sigma_um in "
                "[[straightedges]]",
                file=line.source,
            )
