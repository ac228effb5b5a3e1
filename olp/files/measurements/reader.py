"""Reads the measurements of a calibration: a plan (olp-measurements-1), or files that describe themselves.

A plan is a TOML file, named in the call or standing in a folder as `measurements.toml`. In a folder without
one, every CSV file says in comments `# key = value` what it holds. What a line of the plan and its file both
state must agree; [defaults] fill in what neither does. Nothing about a sense, a place or a lever is assumed.
"""

from __future__ import annotations

import datetime
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line, Square
from olp.calibration.observations.measurements import MapWish, Measurements
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points, polar_points
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.errors import ConfigError, InputError
from olp.core.machine import Vector
from olp.core.units import AXES, MM_PER_UM, RAD_PER_URAD
from olp.files.measurements.instruments import read_circles, read_diagonal
from olp.files.measurements.line_profile import load_line_profile, read_line
from olp.files.measurements.point_readings import (
    LENGTH,
    POLAR,
    PointReadings,
    directions,
    read_point_readings,
)
from olp.files.measurements.readings import Readings, check_component, parse_readings, stated_keys
from olp.files.measurements.schemas import (
    InstrumentTable,
    LineKeys,
    LineTable,
    MeasurementsFile,
    PodsTable,
    PointsTable,
    PolarTable,
    SquarenessReadingTable,
    SquareTable,
    Stated,
    StationTable,
)
from olp.files.problems import Problem, config_error, validate
from olp.files.schema_base import Position
from olp.files.tables import decoded
from olp.files.toml_text import Path, dotted, line_of, read_toml
from olp.files.write import PathLike, read_bytes

PLAN = "measurements.toml"
#: um/m to 1
PER_UNIT = 1e-6

_Scattered = PointsTable | PolarTable | StationTable | PodsTable
_KINDS = ("lines", "points", "polar", "stations", "pods", "diagonals", "ballbars")
_LINE_KEYS = tuple(LineKeys.model_fields)
_PLANES = {"C0Y": "XY", "B0Z": "XZ", "A0Z": "YZ"}


@dataclass(slots=True)
class _Gathered:
    """What the files said so far, and what is wrong with them."""

    chain: str | None
    lines: list[Line] = field(default_factory=list)
    points: list[Points] = field(default_factory=list)
    lengths: list[Lengths] = field(default_factory=list)
    pods: list[Pods] = field(default_factory=list)
    squares: dict[str, Square] = field(default_factory=dict)
    squareness: list[SquarenessReading] = field(default_factory=list)
    periods: dict[str, set[float]] = field(default_factory=lambda: {axis: set() for axis in AXES})
    whole: dict[str, tuple[Any, str]] = field(default_factory=dict)
    errors: list[ConfigError] = field(default_factory=list)
    diagonals: list[Diagonal] = field(default_factory=list)
    circles: list[Circles] = field(default_factory=list)
    map: MapWish | None = None

    def state(self, key: str, value: Any, file: str, line: int | None) -> None:
        """Take what holds for the whole calibration; two files must not contradict each other."""
        known = self.whole.setdefault(key, (value, file))
        if known[0] != value:
            sentence = f"{key} = {_word(value)}, but {known[1]} says {_word(known[0])}"
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
        lines=tuple(found.lines),
        squares=tuple(found.squares.values()),
        squareness=tuple(found.squareness),
        periods_mm=(x, y, z),
        temperature_degC=found.whole["temperature_degC"][0],
        active_during_measurement=found.whole.get("active_during_measurement", (frozenset(), ""))[0],
        measured=found.whole["measured"][0],
        chain=found.chain,
        points=tuple(found.points),
        lengths=tuple(found.lengths),
        pods=tuple(found.pods),
        map=found.map,
        diagonals=tuple(found.diagonals),
        circles=tuple(found.circles),
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
            for table in (t for kind in _KINDS for t in stated.get(kind, ())):
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
    for index, table in enumerate(plan.squareness):
        key = ("squareness", index)
        wrong = _squareness(table, plan.defaults, str(path), found)
        problems += [(line_of(key, places), f"{dotted(key)}: {sentence}") for sentence in wrong]
    tables: list[tuple[Path, LineTable | _Scattered | InstrumentTable]] = [
        *((("lines", k), table) for k, table in enumerate(plan.lines)),
        *((("points", k), table) for k, table in enumerate(plan.points)),
        *((("polar", k), table) for k, table in enumerate(plan.polar)),
        *((("stations", k), table) for k, table in enumerate(plan.stations)),
        *((("pods", k), table) for k, table in enumerate(plan.pods)),
        *((("diagonals", k), table) for k, table in enumerate(plan.diagonals)),
        *((("ballbars", k), table) for k, table in enumerate(plan.ballbars)),
    ]
    for key, item in tables:
        try:
            if isinstance(item, LineTable):
                _line(path, item, plan.defaults, plan.vertical, found)
            elif isinstance(item, PointsTable):
                found.points.append(_points(path, item, plan.defaults))
            elif isinstance(item, InstrumentTable):
                if key[0] == "diagonals":
                    found.diagonals.append(read_diagonal(path.parent / item.file))
                else:
                    found.circles.append(read_circles(path.parent / item.file))
            elif isinstance(item, PolarTable):
                found.points.append(_polar(path, item, plan.defaults))
            elif isinstance(item, StationTable):
                found.lengths.append(_lengths(path, item, plan.defaults))
            else:
                found.pods.append(_pods(path, item, plan.defaults))
        except ConfigError as error:
            if error.file not in (None, str(path)):
                found.errors.append(error)
            else:
                at = line_of(key, places)
                problems += [(at, f"{dotted(key)} ({item.file}): {text}") for text in error.problems]
        except InputError as error:
            sentence = f'{dotted(key)}.file = "{item.file}": {error.message}'
            problems.append((line_of((*key, "file"), places), sentence))
    if problems:
        found.errors.append(config_error(problems, str(path)))


def _line(plan: FilePath, table: LineTable, defaults: LineKeys, vertical: str, found: _Gathered) -> None:
    path = plan.parent / table.file
    profile = table.profile or defaults.profile
    readings = _read(path, plan.parent / profile if profile else None)
    stated, places = _stated(readings.keys, str(path))
    component = table.component or stated.component or readings.component
    if component is None:
        raise ConfigError("component is missing; expected a name such as EXX in the plan or the file")
    check_component(readings, component)
    said = _merged(table, stated, defaults, places, str(path))
    if readings.sense_known and table.sense is not None:
        raise ConfigError("sense is stated by the profile and by the line; expected it once", file=str(plan))
    found.lines.append(_as_line(readings, component, said, vertical, found.chain, str(path)))


def _read(path: FilePath, profile: FilePath | None) -> Readings:
    return read_line(path, None if profile is None else load_line_profile(profile))


def _points(plan: FilePath, table: PointsTable, defaults: LineKeys) -> Points:
    readings = read_point_readings(plan.parent / table.file)
    return Points(
        axis_mm=readings.axis_mm,
        tool_mm=_tools(readings, table, defaults),
        measured_mm=readings.measured,
        sigma=table.sigma_um * MM_PER_UM,
        sigma_scale=table.sigma_scale_um_m * PER_UNIT,
        source=readings.file,
        row=readings.row,
        known_frame=table.frame == "known",
    )


def _polar(plan: FilePath, table: PolarTable, defaults: LineKeys) -> Points:
    readings = read_point_readings(plan.parent / table.file, POLAR)
    distance = readings.measured[:, 0]
    short = np.flatnonzero(distance <= 0.0)
    if len(short):
        raise config_error(
            [(int(readings.row[k]), f"distance_mm = {distance[k]:g}; expected one above 0") for k in short],
            readings.file,
        )
    angles = np.radians(readings.measured[:, 1:])
    return polar_points(
        readings.axis_mm,
        _tools(readings, table, defaults),
        distance,
        angles[:, 0],
        angles[:, 1],
        sigma_mm=table.sigma_distance_um * MM_PER_UM + table.sigma_um_m * PER_UNIT * distance,
        sigma_rad=table.sigma_angle_urad * RAD_PER_URAD,
        sigma_scale=table.sigma_scale_um_m * PER_UNIT,
        source=readings.file,
        row=readings.row,
    )


def _lengths(plan: FilePath, table: StationTable, defaults: LineKeys) -> Lengths:
    readings = read_point_readings(plan.parent / table.file, LENGTH)
    length = readings.measured[:, 0]
    return Lengths(
        axis_mm=readings.axis_mm,
        tool_mm=_tools(readings, table, defaults),
        length_mm=length,
        sigma_mm=table.sigma_um * MM_PER_UM + table.sigma_um_m * PER_UNIT * np.abs(length),
        sigma_scale=table.sigma_scale_um_m * PER_UNIT,
        source=readings.file,
        row=readings.row,
    )


def _pods(plan: FilePath, table: PodsTable, defaults: LineKeys) -> Pods:
    readings = read_point_readings(plan.parent / table.file, directions(table.pods))
    angles = np.radians(readings.measured)
    wrong = [b.between for b in table.baselines if max(b.between) > table.pods or len(set(b.between)) < 2]
    if wrong:
        raise ConfigError(f"baselines between {list(wrong[0])}; expected two of the pods 1 to {table.pods}")
    return Pods(
        axis_mm=readings.axis_mm,
        tool_mm=_tools(readings, table, defaults),
        azimuth_rad=angles[:, 0::2],
        elevation_rad=angles[:, 1::2],
        sigma=table.sigma_urad * RAD_PER_URAD,
        baselines=tuple(
            (b.between[0] - 1, b.between[1] - 1, b.length_mm, b.sigma_um * MM_PER_UM) for b in table.baselines
        ),
        source=readings.file,
    )


def _tools(readings: PointReadings, table: _Scattered, defaults: LineKeys) -> npt.NDArray[np.float64]:
    """The vector of each point, from the file or from the plan."""
    tool = table.tool_mm or defaults.tool_mm
    if readings.tool_mm is not None:
        if table.tool_mm is not None:
            raise ConfigError("tool_mm is stated here and in columns of the file; expected it once")
        return readings.tool_mm
    if tool is None:
        raise ConfigError("tool_mm is missing; expected it here, or the columns tool_X_mm ... in the file")
    return np.array(tool)


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
        stated, places = _stated(keys, str(path))
        if stated.component is None:
            sentence = 'does not say what it holds; expected a comment such as # component = "EXX", or a plan'
            raise ConfigError(sentence, file=str(path))
        check_component(readings, stated.component)
        line = _as_line(readings, stated.component, stated, "Z", found.chain, str(path))
    except ConfigError as error:
        found.errors.append(error)
        return
    found.lines.append(line)
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


def _stated(keys: Mapping[str, tuple[str, int]], file: str) -> tuple[Stated, dict[str, int]]:
    """The typed comments of a file, and their lines; words need no quotes there."""
    values: dict[str, object] = {}
    places: dict[Path, int] = {}
    for key, (text, line) in keys.items():
        try:
            values[key] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            values[key] = text
        places[(key,)] = line
    return validate(Stated, values, places, file), {str(key[0]): line for key, line in places.items()}


# -- one line --------------------------------------------------------------------------------------------


def _merged(
    table: LineTable, stated: Stated, defaults: LineKeys, places: Mapping[str, int], file: str
) -> LineKeys:
    """The plan's word and the file's, which must agree, then the defaults."""
    problems: list[Problem] = []
    values: dict[str, Any] = {}
    for key in _LINE_KEYS:
        given = [getattr(part, key) for part in (table, stated) if key in part.model_fields_set]
        if key == "line_mm" and given:
            given = [_together(given)]
        if len(given) == 2 and given[0] != given[1]:
            sentence = f"{key} = {_word(given[1])}, but the plan says {_word(given[0])}"
            problems.append((places.get(key), sentence))
        if given:
            values[key] = given[0]
        elif key in defaults.model_fields_set:
            values[key] = getattr(defaults, key)
    if "line_mm" in values and "line_mm" in defaults.model_fields_set:
        values["line_mm"] = _together([values["line_mm"], defaults.line_mm])
    if problems:
        raise config_error(problems, file)
    return LineKeys.model_construct(set(values), **values)


def _together(positions: Sequence[Any]) -> Any:
    """The first position, axes that it does not name taken from the later ones."""
    values = {
        axis: next((v for p in positions if (v := getattr(p, axis)) is not None), None) for axis in AXES
    }
    return type(positions[0]).model_construct(set(values), **values)


def _as_line(
    readings: Readings, component: str, said: LineKeys, vertical: str, chain: str | None, file: str
) -> Line:
    problems = list(_line_problems(component, said, vertical, chain, readings.sense_known))
    if problems:
        raise ConfigError("; ".join(problems), file=file, problems=tuple(problems))
    angular = component[1] in "ABC"
    known = readings.sense_known or said.sense is None
    value = readings.value if known else readings.with_sense(str(said.sense)).value
    place = [0.0 if at is None else at for at in said.line_mm.values]
    sigma = (said.sigma_urad or 0.0) * RAD_PER_URAD if angular else (said.sigma_um or 0.0) * MM_PER_UM
    return Line(
        component=component,
        target_mm=readings.target_mm,
        value=value,
        run=readings.run,
        direction=readings.direction,
        line_mm=(place[0], place[1], place[2]),
        tool_mm=said.tool_mm or (0.0, 0.0, 0.0),
        reference=said.reference or "functional-point",
        square=said.square,
        sigma=sigma,
        sigma_scale=(said.sigma_scale_um_m or 0.0) * PER_UNIT,
        source=file,
        row=readings.line,
        instrument=said.instrument or "",
    )


def _line_problems(
    component: str, said: LineKeys, vertical: str, chain: str | None, sense_known: bool
) -> Iterator[str]:
    axis, angular = component[2], component[1] in "ABC"
    if said.sense is None and not sense_known:
        yield (
            "sense is missing; expected what the values mean, such as sense = "
            '"actual-minus-commanded" (of the tool relative to the workpiece)'
        )
    if not angular:
        missing = [a for a in AXES if a != axis and getattr(said.line_mm, a) is None]
        if missing:
            names = ", ".join(f"line_mm.{a}" for a in missing)
            yield f"{names} is missing; expected where the other axes stood: angles act by their levers"
        if said.tool_mm is None:
            yield "tool_mm is missing; expected [X, Y, Z] from the gauge point to the reflector, in mm"
    if said.instrument == "level" and angular and AXES["ABC".index(component[1])] == vertical:
        yield (
            f"{component} is a turn about the vertical {vertical}, which a level cannot see; measure the "
            f"straightness of {axis} twice with the reflector at two offsets across it, or leave {component} "
            f"out: it is then reported as unobserved, with what that costs"
        )
    if said.square is not None and (angular or component[1] == axis):
        yield f"square belongs to straightness, and {component} is none; leave it out"
    if said.sigma_scale_um_m and component[1] != axis:
        yield f"sigma_scale_um_m belongs to positioning, and {component} is none; leave it out"
    if (said.sigma_um if angular else said.sigma_urad) is not None and (
        said.sigma_urad if angular else said.sigma_um
    ) is None:
        wanted = "sigma_urad" if angular else "sigma_um"
        yield f"the uncertainty of {component} is stated in the other unit; expected {wanted}"
    if chain is not None and chain.index(axis) > chain.index("F"):
        if said.sense is not None and said.sense.startswith("table-motion"):
            yield f'sense = "{said.sense}", but axis {axis} of the chain {chain} carries the tool, no table'
        if said.reference == "table":
            yield f'reference = "table", but axis {axis} of the chain {chain} carries the tool, no table'


def _square(table: SquareTable) -> Square:
    return Square(table.name, table.error_urad * RAD_PER_URAD, table.sigma_urad * RAD_PER_URAD)


def _squareness(
    table: SquarenessReadingTable, defaults: LineKeys, file: str, found: _Gathered
) -> Iterator[str]:
    """Takes the reading, or yields what is wrong with it."""
    plane = _PLANES[table.component]
    line = _together([table.line_mm, defaults.line_mm])
    tool = table.tool_mm or defaults.tool_mm
    spans = [getattr(table.span_mm, axis) for axis in plane]
    missing = [axis for axis in AXES if getattr(line, axis) is None]
    if missing:
        yield f"line_mm.{', line_mm.'.join(missing)} is missing; expected where the axes stood"
    if tool is None:
        yield "tool_mm is missing; expected [X, Y, Z] from the gauge point to the probe, in mm"
    if None in spans:
        yield f"span_mm is incomplete; expected the lengths measured along {plane[0]} and {plane[1]}"
    if not missing and tool is not None and None not in spans:
        place: Vector = (line.X, line.Y, line.Z)
        value, sigma = table.value_urad * RAD_PER_URAD, table.sigma_urad * RAD_PER_URAD
        found.squareness.append(
            SquarenessReading(table.component, value, place, (spans[0], spans[1]), tool, sigma, file)
        )


def _undefined_squares(found: _Gathered) -> Iterator[ConfigError]:
    for line in found.lines:
        if line.square is not None and line.square not in found.squares:
            yield ConfigError(
                f'square "{line.square}" is not defined; expected a table [[squares]] with its sigma_urad or '
                "square_sigma_urad in the file",
                file=line.source,
            )


def _word(value: object) -> str:
    if isinstance(value, Position):
        return str({axis: at for axis, at in zip(AXES, value.values, strict=True) if at is not None})
    return value.isoformat() if isinstance(value, datetime.date) else repr(value)
