"""Messages for what is wrong in a file: the key, its line, and what was expected."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar, get_args, get_origin

from olp.core.errors import ConfigError
from olp.core.schema import Table, fields_of, is_table
from olp.core.schema_keys import Wrong, WrongTable
from olp.files.fields import nearest, shown
from olp.files.stated_units import in_units_of_keys, not_a_quantity
from olp.files.toml_text import Path, dotted, line_of

#: A line, where it is known, and a message.
Problem = tuple[int | None, str]
T = TypeVar("T", bound=Table)

#: At most this many problems are listed; further ones are counted.
MOST_PROBLEMS = 40

#: Format to the kind of file, and where such a file is given.
KINDS = {
    "olp-machine-1": ("a machine file", ", as -m and olp inspect take it"),
    "olp-job-1": ("a job file", ", as -j takes it"),
    "olp-calibration-1": ("a calibration", ", which the machine file names"),
    "olp-measurements-1": ("a file of measurements", ", as olp calibrate fit takes it"),
    "olp-artefact-1": ("an artefact to be touched", ", as olp calibrate probe takes it"),
    "olp-thermal-1": ("a thermal model", ", which the calibration names"),
    "olp-dialect-1": ("the description of a dialect", ", as --dialect takes it"),
    "olp-points-1": ("the layout of a list of positions", ", as --profile takes it"),
    "olp-line-profile-1": ("the layout of an instrument's file", ""),
}

_WANTED = {
    "float": "a number",
    "finite": "a finite number",
    "int": "an integer",
    "bool": "true or false",
    "str": "text in quotes",
    "short": "text that is not empty",
    "tuple": "a list in brackets",
    "array": "an array of tables, written with [[ ]]",
    "dict": "a table",
    "table": "a table",
    "date": "a date without quotes, such as 2026-05-14",
}
_LIMITS = {
    "gt": "a number above {:g}",
    "ge": "a number of {:g} or above",
    "le": "a number of {:g} or below",
    "long": "{} values",
}


def validate(model: type[T], values: Mapping[str, object], lines: Mapping[Path, int], file: str) -> T:
    """The typed file; texts such as "0.002 in" become numbers in the unit of their key. Raises one
    ConfigError that lists every problem in the order of lines; of a file of another kind that is the only
    one."""
    _refuse_other_kind(model, values, lines, file)
    try:
        return model(**in_units_of_keys(model, values))
    except WrongTable as error:
        wrongs = error.wrongs
    # A misspelt key is one problem, not also a missing one.
    meant = {_meant(model, path) for kind, path, _, _ in wrongs if kind == "unknown"}
    kept = [wrong for wrong in wrongs if wrong[0] != "missing" or wrong[1] not in meant]
    raise config_error([_problem(model, wrong, lines) for wrong in kept], file)


def _refuse_other_kind(
    model: type[Table], values: Mapping[str, object], lines: Mapping[Path, int], file: str
) -> None:
    """Raises ConfigError where a file says that it is of another kind than the one expected."""
    stated = values.get("schema")
    field = fields_of(model).get("schema_")
    expected = next((name for name in get_args(field.annotation) if name in KINDS), None) if field else None
    if expected is None or stated == expected or not isinstance(stated, str) or stated not in KINDS:
        return
    wanted, where = KINDS[expected]
    sentence = f"this is {KINDS[stated][0]} ({stated}); expected {wanted} ({expected}){where}"
    raise config_error([(line_of(("schema",), lines), sentence)], file)


def config_error(problems: Iterable[Problem], file: str | None) -> ConfigError:
    """One error from (line, message) pairs, sorted by line. Each message begins with its line."""
    ordered = sorted(dict.fromkeys(problems), key=lambda item: item[0] or 0)
    sentences = tuple(f"line {line}: {text}" if line else text for line, text in ordered)
    if len(sentences) > MOST_PROBLEMS:
        more = len(sentences) - MOST_PROBLEMS
        sentences = (
            *sentences[:MOST_PROBLEMS],
            f"and {more} more problems; correct the first ones and try again",
        )
    return ConfigError("; ".join(sentences), file=file, line=ordered[0][0], problems=sentences)


def _problem(model: type[Table], wrong: Wrong, lines: Mapping[Path, int]) -> Problem:
    kind, path, stated, limit = wrong
    owner, description = _field(model, path)
    key = dotted(path)
    line = line_of(path, lines)
    if kind == "missing":
        wanted = _list_wanted(path, description) or description
        return line, f"{key} is missing; expected {wanted}"
    if kind == "unknown":
        return line, _unknown(owner, path, key, stated)
    if kind == "refused":
        return line, f"{key} {limit}"
    value = shown(stated)
    unfit = not_a_quantity(path, stated) if kind == "float" else None
    if unfit is not None:
        return line, f"{key} = {value}; {unfit}; it is {description}"
    wanted = _wanted(kind, limit)
    if kind == "literal" and wanted in description:
        return line, f"{key} = {value}; expected {description}"
    return line, f"{key} = {value}; expected {wanted}: {description}"


def _wanted(kind: str, limit: Any) -> str:
    if kind == "literal":
        *most, last = [f'"{name}"' for name in limit]
        return f"one of {', '.join(most)} or {last}" if most else last
    if kind == "any":
        return " or ".join(_WANTED[one] for one in limit)
    if kind in _LIMITS:
        return _LIMITS[kind].format(limit)
    return _WANTED[kind]


def _list_wanted(path: Path, description: str) -> str:
    """The message for a list that is too short: the path of the missing item ends in a number."""
    return f"one more value: {description}" if isinstance(path[-1], int) else ""


def _field(model: type[Table], path: Path) -> tuple[type[Table], str]:
    """The table model that a path ends in, and the description of the last key that it names."""
    owner: type[Table] = model
    description = ""
    inside: Any = model
    for part in path:
        if is_table(inside):
            owner = inside
            field = {f.alias or name: f for name, f in fields_of(owner).items()}.get(str(part))
            if field is None:
                break
            description = field.description or ""
            inside = field.annotation
            # The next part of the path names one of many tables, not a key.
            if get_origin(inside) in (dict, list):
                continue
        inside = next(_tables(inside), inside)
    return owner, description


def _tables(annotation: Any) -> Iterator[Any]:
    """The table models named anywhere in an annotation such as `dict[str, ToolTable]`."""
    if is_table(annotation):
        yield annotation
    for part in get_args(annotation):
        yield from _tables(part)


def _unknown(owner: type[Table], path: Path, key: str, value: object) -> str:
    name = str(path[-1])
    if name in owner.not_built:
        return (
            f"{key} ({owner.not_built[name]}) is part of the format, but this version of olp does not "
            "support it; remove it from the file if the correction does not need it"
        )
    if isinstance(value, dict) and len(path) > 1 and name.isdigit() and "work_offsets" in path:
        return f'{key} is split at the point; expected quotes: [work_offsets."{path[-2]}.{name}"]'
    known = _keys(owner)
    near = nearest(name, known)
    return f"{key} is not a known key; " + (
        f"did you mean {near}?" if near else f"expected one of {', '.join(known)}"
    )


def _keys(table: type[Table]) -> list[str]:
    return [field.alias or name for name, field in fields_of(table).items()]


def _meant(model: type[Table], path: Path) -> Path:
    """The path that an unknown key most likely means; the path itself where nothing is near."""
    owner, _ = _field(model, path)
    return (*path[:-1], nearest(str(path[-1]), _keys(owner)) or path[-1])
