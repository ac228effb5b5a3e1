"""What a plan, its defaults and a file say of one line, brought together into a `Line`."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from olp.calibration.observations.lines import Line
from olp.core.errors import ConfigError
from olp.core.schema import Position
from olp.core.units import AXES, MM_PER_UM, RAD_PER_URAD
from olp.files.measurements.instruments.base import PER_UNIT
from olp.files.measurements.line_keys import LineKeys, LineTable, Stated
from olp.files.measurements.readings import Readings
from olp.files.measurements.stated import Said, stated_as
from olp.files.problems import Problem, config_error

_KEYS = tuple(LineKeys.model_fields)


def stated_of(keys: Mapping[str, Said], file: str) -> tuple[Stated, dict[str, int]]:
    """The typed comments of a file, and their lines."""
    return stated_as(keys, Stated, file), {key: line for key, (_, line) in keys.items()}


def merged(
    table: LineTable, stated: Stated, defaults: LineKeys, places: Mapping[str, int], file: str
) -> LineKeys:
    """The plan's word and the file's, which must agree, then the defaults."""
    problems: list[Problem] = []
    values: dict[str, Any] = {}
    for key in _KEYS:
        given = [getattr(part, key) for part in (table, stated) if key in part.model_fields_set]
        if key == "line_mm" and given:
            given = [together(given)]
        if len(given) == 2 and given[0] != given[1]:
            sentence = f"{key} = {word(given[1])}, but the plan says {word(given[0])}"
            problems.append((places.get(key), sentence))
        if given:
            values[key] = given[0]
        elif key in defaults.model_fields_set:
            values[key] = getattr(defaults, key)
    if "line_mm" in values and "line_mm" in defaults.model_fields_set:
        values["line_mm"] = together([values["line_mm"], defaults.line_mm])
    if problems:
        raise config_error(problems, file)
    return LineKeys.model_construct(set(values), **values)


def together(positions: Sequence[Any]) -> Any:
    """The first position, axes that it does not name taken from the later ones."""
    values = {
        axis: next((v for p in positions if (v := getattr(p, axis)) is not None), None) for axis in AXES
    }
    return type(positions[0]).model_construct(set(values), **values)


def as_line(
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


def word(value: object) -> str:
    if isinstance(value, Position):
        return str({axis: at for axis, at in zip(AXES, value.values, strict=True) if at is not None})
    return value.isoformat() if isinstance(value, datetime.date) else repr(value)
