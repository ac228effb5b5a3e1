"""Whether a value of a file is of the type that its table states: each type as a function on one value.

Such a function takes a value and its path, adds what is wrong to a list, and returns the value as it is kept.
An integer is kept as float where a float is expected, a list as tuple where a tuple is.
"""

from __future__ import annotations

import datetime
import math
import types
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from olp.core.schema_keys import After, Before, FieldInfo, Instead, RefusedValue, Wrong

Path = tuple[str | int, ...]
Check = Callable[[Any, Path, list[Wrong]], Any]

#: What a check returns for a value that is wrong.
WRONG: Any = object()


def check_of(kind: Any) -> Check:
    """The check of a type."""
    if kind in _PLAIN:
        return _PLAIN[kind]
    own: Check | None = getattr(kind, "check_value", None)
    if own is not None:  # a table
        return own
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _annotated(parts[0], parts[1:])
    if origin in (Union, types.UnionType):
        return _union(parts)
    if origin is Literal:
        return lambda value, path, wrongs: _literal(parts, value, path, wrongs)
    inner = [check_of(part) for part in parts]
    if origin is list:
        return lambda value, path, wrongs: _list(inner[0], value, path, wrongs)
    if origin is tuple:
        return lambda value, path, wrongs: _tuple(inner, value, path, wrongs)
    if origin is dict:
        return lambda value, path, wrongs: _dict(inner[0], inner[1], value, path, wrongs)
    raise TypeError(f"{kind} is no type of a key; expected one that olp.core.schema names")


def _wrong(kind: str, path: Path, value: object, wrongs: list[Wrong], limit: object = None) -> Any:
    wrongs.append((kind, path, value, limit))
    return WRONG


def ruled(one: Callable[[Any], object], value: Any, path: Path, wrongs: list[Wrong]) -> Any:
    """The value after a rule; a value that is wrong already is not shown to it."""
    if value is WRONG:
        return value
    try:
        return one(value)
    except RefusedValue as error:
        return _wrong("refused", path, value, wrongs, str(error))


def _float(value: object, path: Path, wrongs: list[Wrong]) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return _wrong("float", path, value, wrongs)
    try:
        number = float(value)
    except OverflowError:
        return _wrong("float", path, value, wrongs)
    return number if math.isfinite(number) else _wrong("finite", path, value, wrongs)


def _date(value: object, path: Path, wrongs: list[Wrong]) -> Any:
    right = isinstance(value, datetime.date) and not isinstance(value, datetime.datetime)
    return value if right else _wrong("date", path, value, wrongs)


def _int(value: object, path: Path, wrongs: list[Wrong]) -> Any:
    right = isinstance(value, int) and not isinstance(value, bool)
    return value if right else _wrong("int", path, value, wrongs)


def _of(kind: type) -> Check:
    def check(value: object, path: Path, wrongs: list[Wrong]) -> Any:
        return value if isinstance(value, kind) else _wrong(kind.__name__, path, value, wrongs)

    return check


_PLAIN: dict[Any, Check] = {
    float: _float,
    int: _int,
    datetime.date: _date,
    str: _of(str),
    bool: _of(bool),
    type(None): _of(type(None)),
}


def _literal(names: tuple[object, ...], value: object, path: Path, wrongs: list[Wrong]) -> Any:
    right = isinstance(value, str) and value in names
    return value if right else _wrong("literal", path, value, wrongs, names)


def _list(inner: Check, value: object, path: Path, wrongs: list[Wrong]) -> Any:
    if not isinstance(value, list):
        return _wrong("array", path, value, wrongs)
    items = [inner(item, (*path, k), wrongs) for k, item in enumerate(value)]
    return WRONG if WRONG in items else items


def _tuple(inner: list[Check], value: object, path: Path, wrongs: list[Wrong]) -> Any:
    if not isinstance(value, list | tuple):
        return _wrong("tuple", path, value, wrongs)
    if len(value) > len(inner):
        return _wrong("long", path, value, wrongs, len(inner))
    items = [
        check(value[k], (*path, k), wrongs)
        if k < len(value)
        else _wrong("missing", (*path, k), value, wrongs)
        for k, check in enumerate(inner)
    ]
    return WRONG if WRONG in items else tuple(items)


def _dict(key_check: Check, inner: Check, value: object, path: Path, wrongs: list[Wrong]) -> Any:
    if not isinstance(value, Mapping):
        return _wrong("dict", path, value, wrongs)
    before = len(wrongs)
    items = {
        key_check(key, (*path, key), wrongs): inner(item, (*path, key), wrongs) for key, item in value.items()
    }
    return WRONG if len(wrongs) > before else items


def _union(parts: tuple[Any, ...]) -> Check:
    """The first type that fits. Of several that do not, the limit that was not kept, or all types."""
    inner = [check_of(part) for part in parts if part is not type(None)]
    optional = len(inner) < len(parts)

    def check(value: object, path: Path, wrongs: list[Wrong]) -> Any:
        if value is None and optional:
            return None
        if len(inner) == 1:
            return inner[0](value, path, wrongs)
        tried: list[Wrong] = []
        for one in inner:
            made = one(value, path, tried)
            if made is not WRONG:
                return made
        limited = [wrong for wrong in tried if wrong[0] not in ("str", "int", "float", "bool")]
        wrongs.append(limited[0] if limited else ("any", path, value, [wrong[0] for wrong in tried]))
        return WRONG

    return check


def _annotated(kind: Any, more: tuple[Any, ...]) -> Check:
    """A type with limits and rules."""
    check = next((_instead(item.rule) for item in more if isinstance(item, Instead)), None) or check_of(kind)
    for item in more:
        if isinstance(item, FieldInfo):
            check = limited(check, item.limits)
        elif isinstance(item, After):
            check = _after(check, item.rule)
        elif isinstance(item, Before) and not isinstance(item, Instead):
            check = _before(check, item.rule)
    return check


def _instead(one: Callable[[Any], object]) -> Check:
    return lambda value, path, wrongs: ruled(one, value, path, wrongs)


def _after(inner: Check, one: Callable[[Any], object]) -> Check:
    def check(value: object, path: Path, wrongs: list[Wrong]) -> Any:
        return ruled(one, inner(value, path, wrongs), path, wrongs)

    return check


def _before(inner: Check, one: Callable[[Any], object]) -> Check:
    def check(value: object, path: Path, wrongs: list[Wrong]) -> Any:
        kept = ruled(one, value, path, wrongs)
        return kept if kept is WRONG else inner(kept, path, wrongs)

    return check


def limited(check: Check, limits: Mapping[str, Any]) -> Check:
    broken: list[tuple[str, Any, Callable[[Any], bool]]] = []
    if "gt" in limits:
        broken.append(("gt", limits["gt"], lambda v: not v > limits["gt"]))
    if "ge" in limits:
        broken.append(("ge", limits["ge"], lambda v: not v >= limits["ge"]))
    if "le" in limits:
        broken.append(("le", limits["le"], lambda v: not v <= limits["le"]))
    if "min_length" in limits:
        broken.append(("short", limits["min_length"], lambda v: len(v) < limits["min_length"]))

    def within(value: object, path: Path, wrongs: list[Wrong]) -> Any:
        kept = check(value, path, wrongs)
        for kind, limit, is_broken in broken:
            if kept is not WRONG and is_broken(kept):
                return _wrong(kind, path, value, wrongs, limit)
        return kept

    return within
