"""Merges the keys of one line from a plan, its defaults and a file into a `Line`."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from olp.calibration.observations.lines import Line
from olp.core.errors import ConfigError
from olp.core.schema import Position, fields_of, made, stated_keys
from olp.core.units import AXES, MM_PER_UM, RAD_PER_URAD
from olp.files.measurements.air import compensated, environment_problems
from olp.files.measurements.instruments.base import PER_UNIT
from olp.files.measurements.line_keys import LineKeys, LineTable, Stated
from olp.files.measurements.readings import Readings
from olp.files.measurements.stated import Written, stated_as
from olp.files.problems import Problem, config_error

_KEYS = tuple(fields_of(LineKeys))


def stated_of(keys: Mapping[str, Written], file: str) -> tuple[Stated, dict[str, int]]:
    """The typed comments of a file, and their lines."""
    return stated_as(keys, Stated, file), {key: line for key, (_, line) in keys.items()}


def merged(
    table: LineTable, stated: Stated, defaults: LineKeys, lines: Mapping[str, int], file: str
) -> LineKeys:
    """The keys of the plan and of the file, which must agree, then the defaults. `lines` are those of the
    keys in the file. Raises ConfigError."""
    problems: list[Problem] = []
    values: dict[str, Any] = {}
    for key in _KEYS:
        given = [getattr(part, key) for part in (table, stated) if key in stated_keys(part)]
        if key == "line_mm" and given:
            given = [together(given)]
        if len(given) == 2 and given[0] != given[1]:
            sentence = f"{key} = {word(given[1])}, but the plan says {word(given[0])}; expected the same"
            problems.append((lines.get(key), sentence))
        if given:
            values[key] = given[0]
        elif key in stated_keys(defaults):
            values[key] = getattr(defaults, key)
    if "line_mm" in values and "line_mm" in stated_keys(defaults):
        values["line_mm"] = together([values["line_mm"], defaults.line_mm])
    if problems:
        raise config_error(problems, file)
    return made(LineKeys, values, frozenset(values))


def together(positions: Sequence[Any]) -> Any:
    """The first position. The later ones supply the axes that it does not name."""
    values = {
        axis: next((v for p in positions if (v := getattr(p, axis)) is not None), None) for axis in AXES
    }
    return made(type(positions[0]), values, frozenset(values))


def as_line(
    readings: Readings, component: str, keys: LineKeys, vertical: str, chain: str | None, file: str
) -> Line:
    """The line of these readings, with the merged keys. Raises ConfigError with every problem."""
    problems = list(_line_problems(component, keys, vertical, chain, readings.sense_known))
    problems += environment_problems(readings, component, keys)
    problems += _sensor_problems(readings, component, keys)
    if problems:
        raise ConfigError("; ".join(problems), file=file, problems=tuple(problems))
    angular = component[1] in "ABC"
    readings = compensated(readings, keys)
    known = readings.sense_known or keys.sense is None
    value = readings.value if known else readings.with_sense(str(keys.sense)).value
    line_mm = [0.0 if position is None else position for position in keys.line_mm.values]
    sigma = (keys.sigma_urad or 0.0) * RAD_PER_URAD if angular else (keys.sigma_um or 0.0) * MM_PER_UM
    return Line(
        component=component,
        target_mm=readings.target_mm,
        value=value,
        run=readings.run,
        direction=readings.direction,
        line_mm=(line_mm[0], line_mm[1], line_mm[2]),
        tool_mm=keys.tool_mm or (0.0, 0.0, 0.0),
        reference=keys.reference or "functional-point",
        square=keys.square,
        straightedge=keys.straightedge,
        turned=bool(keys.turned_over),
        sigma=sigma,
        sigma_scale=(keys.sigma_scale_um_m or 0.0) * PER_UNIT,
        source=file,
        row=readings.line,
        instrument=keys.instrument or "",
        sensors_degC=readings.sensors,
    )


def _line_problems(
    component: str, keys: LineKeys, vertical: str, chain: str | None, sense_known: bool
) -> Iterator[str]:
    axis, angular = component[2], component[1] in "ABC"
    if keys.sense is None and not sense_known:
        yield (
            "sense is missing; expected the sign convention of the values, such as sense = "
            '"actual-minus-commanded" (of the tool relative to the workpiece)'
        )
    if not angular:
        missing = [a for a in AXES if a != axis and getattr(keys.line_mm, a) is None]
        if missing:
            names = ", ".join(f"line_mm.{a}" for a in missing)
            yield f"{names} is missing; expected the position, because angles act over lever arms"
        if keys.tool_mm is None:
            yield "tool_mm is missing; expected [X, Y, Z] from the gauge point to the reflector, in mm"
    if keys.instrument == "level" and angular and AXES["ABC".index(component[1])] == vertical:
        yield (
            f"{component} is a rotation about the vertical {vertical}, which a level cannot measure. Measure "
            f"the straightness of {axis} twice, with the reflector at two offsets across it. Or leave "
            f"{component} out; the report then lists it as not observed, with its possible effect"
        )
    yield from _artefact_problems(component, keys, vertical)
    if keys.sigma_scale_um_m and component[1] != axis:
        yield f"sigma_scale_um_m is for positioning only, and {component} is not a positioning; leave it out"
    if (keys.sigma_um if angular else keys.sigma_urad) is not None and (
        keys.sigma_urad if angular else keys.sigma_um
    ) is None:
        wanted = "sigma_urad" if angular else "sigma_um"
        yield f"the uncertainty of {component} has the wrong unit; expected {wanted}"
    if chain is not None and chain.index(axis) > chain.index("F"):
        if keys.sense is not None and keys.sense.startswith("table-motion"):
            yield f'sense = "{keys.sense}", but axis {axis} of the chain {chain} moves the tool, not a table'
        if keys.reference == "table":
            yield f'reference = "table", but axis {axis} of the chain {chain} moves the tool, not a table'


def _sensor_problems(readings: Readings, component: str, keys: LineKeys) -> Iterator[str]:
    """What is missing beside sensors: axes at rest turn with temperature, too."""
    places = [a for a in AXES if a != component[2] and getattr(keys.line_mm, a) is None]
    if readings.sensors and component[1] in "ABC" and places:
        names = ", ".join(f"line_mm.{a}" for a in places)
        yield f"{names} is missing; expected the position, because axes at rest turn with temperature, too"


def _artefact_problems(component: str, keys: LineKeys, vertical: str) -> Iterator[str]:
    """What is wrong with the square or straightedge of a line."""
    artefacts = [name for name in ("square", "straightedge") if getattr(keys, name) is not None]
    for name in artefacts:
        if component[1] not in AXES or component[1] == component[2]:
            yield f"{name} is for straightness only, and {component} is not a straightness; leave it out"
    if len(artefacts) > 1:
        yield "square and straightedge are both stated; expected what the line was read against"
    if keys.turned_over is not None and not artefacts:
        yield "turned_over is stated without a square or straightedge; leave it out, or name one"
    if keys.turned_over and keys.straightedge is not None and component[1] == vertical:
        yield (
            f"a straightedge that is turned over still sags by its own weight, which {component} reads along "
            f"with its form; state sigma_um of the straightedge and leave turned_over out"
        )


def word(value: object) -> str:
    """A value as a message states it."""
    if isinstance(value, Position):
        given = zip(AXES, value.values, strict=True)
        return str({axis: position for axis, position in given if position is not None})
    return value.isoformat() if isinstance(value, datetime.date) else repr(value)
