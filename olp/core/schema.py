"""Tables of files as classes: one attribute per key, with its type, its limits and a description.

A type is `float`, `int`, `bool`, `str`, `datetime.date`, a `Literal`, a table, or a list, tuple, dict or
union of them. `Annotated` adds limits (`Field`) and rules (`Before`, `After`, `Instead`). Types are looked at
when the first file is read, so that a table which no file has costs nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, dataclass_transform

from olp.core.schema_keys import NONE, After, Field, FieldInfo, Known, Rule, Wrong, WrongTable, refusal
from olp.core.schema_types import WRONG, Check, Path, check_of, limited, ruled

T = TypeVar("T", bound="Table")

#: Of a key its attribute, its field, the check of its type, and its rules.
_KeyCheck = tuple[str, FieldInfo, Check, list[Callable[[Any, Known], object]]]


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(Field,))
class Table:
    """A TOML table. `not_built` holds keys of the contract that this version cannot honour, and why.

    Raises WrongTable where the values do not fit. Values of a table never change.
    """

    not_built: ClassVar[dict[str, str]] = {}
    _fields: ClassVar[dict[str, FieldInfo]] = {}
    _rules: ClassVar[tuple[Rule, ...]] = ()
    _complete: ClassVar[bool] = False
    _checks: ClassVar[list[_KeyCheck] | None] = None
    __slots__ = ("__dict__", "_stated")
    if TYPE_CHECKING:
        _stated: frozenset[str]

    def __init_subclass__(cls) -> None:
        own = {
            name: vars(cls).get(name, NONE)
            for name, kind in vars(cls).get("__annotations__", {}).items()
            if not str(kind).startswith(("ClassVar", "typing.ClassVar"))
        }
        cls._fields = cls._fields | {
            name: stated if isinstance(stated, FieldInfo) else Field(default=stated)
            for name, stated in own.items()
        }
        for name in own:
            if name in vars(cls):
                delattr(cls, name)
        cls._rules = (*cls._rules, *(value for value in vars(cls).values() if isinstance(value, Rule)))
        cls._complete, cls._checks = False, None

    def __init__(self, **values: Any) -> None:
        wrongs: list[Wrong] = []
        made = _values(type(self), values, (), wrongs)
        if wrongs:
            raise WrongTable(wrongs)
        _fill(self, *made)

    @classmethod
    def check_value(cls, value: object, path: Path, wrongs: list[Wrong]) -> Any:
        """A value of a file as such a table."""
        if isinstance(value, cls):
            return value
        if not isinstance(value, Mapping):
            wrongs.append(("table", path, value, None))
            return WRONG
        before = len(wrongs)
        made = _values(cls, value, path, wrongs)
        if len(wrongs) > before:
            return WRONG
        table = object.__new__(cls)
        _fill(table, *made)
        return table

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot assign to {name!r} of a {type(self).__name__}")

    def __eq__(self, other: object) -> bool:
        return vars(self) == vars(other) if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash((type(self), *vars(self).values()))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in vars(self).items())})"

    def __reduce__(self) -> Any:
        return made, (type(self), vars(self), self._stated)


def _values(
    model: type[Table], stated: Mapping[str, Any], path: Path, wrongs: list[Wrong]
) -> tuple[dict[str, Any], frozenset[str]]:
    values: dict[str, Any] = {}
    known: dict[str, str] = {}
    for name, field, check, rules in _checks(model):
        key = field.alias or name
        known[key] = name
        inside = (*path, key)
        if key in stated:
            value = check(stated[key], inside, wrongs)
        elif field.required:
            wrongs.append(("missing", inside, stated, None))
            continue
        else:
            value = field.absent()
        if key in stated or not field.stated_only:
            for one in rules:
                value = ruled(partial(_seen, one, values), value, inside, wrongs)
        if value is not WRONG:
            values[name] = value
    wrongs += [("unknown", (*path, key), value, None) for key, value in stated.items() if key not in known]
    return values, frozenset(name for key, name in known.items() if key in stated)


def _checks(model: type[Table]) -> list[_KeyCheck]:
    """Of each key its attribute, its field, the check of its type and its rules: made once for each table."""
    if model._checks is None:
        model._checks = [
            (
                name,
                field,
                limited(check_of(field.annotation), field.limits),
                [r.check for r in model._rules if name in r.keys],
            )
            for name, field in fields_of(model).items()
        ]
    return model._checks


def _seen(one: Callable[[Any, Known], object], known: Known, value: Any) -> object:
    return one(value, known)


def _fill(table: Table, values: Mapping[str, Any], stated: frozenset[str]) -> None:
    """Gives a new table its values."""
    vars(table).update(values)
    object.__setattr__(table, "_stated", stated)


def made(model: type[T], values: Mapping[str, Any], stated: frozenset[str]) -> T:
    """A table of values that are known to fit; keys left out have their defaults. `stated` are the keys that
    a file stated."""
    table = object.__new__(model)
    defaults = {name: field.absent() for name, field in model._fields.items() if name not in values}
    _fill(table, {name: values.get(name, defaults.get(name)) for name in model._fields}, stated)
    return table


def copied(table: T, **changes: Any) -> T:
    """The table with other values that are known to fit."""
    return made(type(table), vars(table) | changes, table._stated | changes.keys())


def stated_keys(table: Table) -> frozenset[str]:
    """The attributes that were stated, not left to their defaults."""
    return table._stated


def stated_values(table: Table) -> dict[str, Any]:
    """The values of a table by key, without those that are None."""
    values = {field.alias or name: getattr(table, name) for name, field in table._fields.items()}
    return {key: value for key, value in values.items() if value is not None}


def fields_of(model: type[Table]) -> Mapping[str, FieldInfo]:
    """The keys of a table by attribute, those of its bases first, with their types."""
    if not model._complete:
        hints = {
            name: _type_named(kind, base.__module__) if isinstance(kind, str) else kind
            for base in reversed(model.__mro__)
            for name, kind in vars(base).get("__annotations__", {}).items()
            if name in model._fields
        }
        model._fields = {name: _with_type(field, hints[name]) for name, field in model._fields.items()}
        model._complete = True
    return model._fields


@cache
def _type_named(text: str, module: str) -> Any:
    """The type that a class of a module states as text. The standard library's `get_type_hints` gives the
    same, at four times the cost."""
    return eval(text, vars(sys.modules[module]))


def _with_type(field: FieldInfo, annotation: Any) -> FieldInfo:
    typed = FieldInfo(
        field.default, field.factory, field.alias, field.description, field.stated_only, field.limits,
        field.shown,
    )  # fmt: skip
    typed.annotation = annotation
    return typed


def with_keys(
    name: str, base: type[T], keys: Mapping[str, tuple[Any, Any]], words: str, module: str
) -> type[T]:
    """A table with the keys of `base` and more, each with its type and its `Field`."""
    body = {key: field for key, (_, field) in keys.items()}
    body |= {"__annotations__": {key: kind for key, (kind, _) in keys.items()}}
    return type(name, (base,), {**body, "__doc__": words, "__module__": module})


def is_table(annotation: Any) -> bool:
    """Whether a type is one of the tables."""
    return isinstance(annotation, type) and issubclass(annotation, Table)


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < pair[1]:
        raise refusal(
            f"= [{pair[0]:g}, {pair[1]:g}] mm is empty; expected [min, max] in mm with min below max"
        )
    return pair


Interval = Annotated[tuple[float, float], After(_ascending)]
Triple = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]


class Position(Table):
    """Axis positions in mm; the position of an axis that is left out is not known."""

    X: float | None = Field(default=None, description="a position of axis X in mm")
    Y: float | None = Field(default=None, description="a position of axis Y in mm")
    Z: float | None = Field(default=None, description="a position of axis Z in mm")

    @property
    def values(self) -> tuple[float | None, float | None, float | None]:
        return (self.X, self.Y, self.Z)

    @property
    def complete(self) -> tuple[float, float, float] | None:
        """The three positions, None where one is missing."""
        x, y, z = self.values
        return None if x is None or y is None or z is None else (x, y, z)
