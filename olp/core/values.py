"""Value types: dataclasses with slots, whose constructor is written when it has made a few values.

The standard decorator compiles up to six methods per class while a module is imported, half a millisecond
each class, and a run makes values of a few classes only. Here all classes share what can be shared, and only
the constructor is compiled, where a class has more than a few values. `dataclasses.fields`, `replace` and the
like work as on any dataclass, and type checkers see the standard decorator.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

T = TypeVar("T")

#: So many values of a class are made without its constructor: to compile that takes as long as some twenty.
_FEW = 6

#: A frozen value with more fields than this gets them while it is one of a class that is not frozen.
_MANY = 6

_LOCK = threading.RLock()
_FIELDS = "__dataclass_fields__"
_STATED = "__stated_class__"


def _stated(cls: type) -> dict[str, Any]:
    """What a class states of each field of its own: a default, a `Field`, or that there is none."""
    kinds: dict[str, str] = inspect.get_annotations(cls)
    names = [name for name, kind in kinds.items() if not kind.startswith("ClassVar")]
    return {name: vars(cls).get(name, dataclasses.MISSING) for name in names}


def _slotted(cls: type[T], names: Iterable[str], added: Mapping[str, Any]) -> type[T]:
    """The class with a slot for each field of its own, without their defaults, which would hide them, and
    with those methods that it does not define."""
    left_out = {*names, "__dict__", "__weakref__"}
    body = {name: value for name, value in vars(cls).items() if name not in left_out}
    kind: Any = type(cls)
    made: type[T] = kind(cls.__name__, cls.__bases__, {**added, **body, "__slots__": tuple(names)})
    made.__qualname__ = cls.__qualname__
    return made


@functools.cache
def _declared(cls: type) -> dict[str, tuple[Any, Any, bool, bool]]:
    """Of each field of a class and its bases the default, the factory, whether calls give it, and whether
    they name it."""
    fields: dict[str, tuple[Any, Any, bool, bool]] = {}
    for base in reversed(cls.__mro__):
        stated, kw_only = vars(base).get(_STATED, ({}, False))
        for name, value in stated.items():
            if isinstance(value, dataclasses.Field):
                fields[name] = (value.default, value.default_factory, value.init, kw_only)
            else:
                fields[name] = (value, dataclasses.MISSING, True, kw_only)
    return fields


def _constructor(cls: type) -> Callable[..., None]:
    """The `__init__` of a class: defaults, factories, then `__post_init__`."""
    known: dict[str, Any] = {"_MADE": dataclasses.MISSING}
    plain = not any("__setattr__" in vars(base) for base in cls.__mro__[:-1])
    open_twin = None if plain or len(_declared(cls)) <= _MANY else _open_twin(cls)
    positional: list[str] = []
    named: list[str] = []
    fields: dict[str, str] = {}
    for name, (default, factory, init, kw_only) in _declared(cls).items():
        value = parameter = name
        if default is not dataclasses.MISSING:
            known[f"_default_{name}"] = default
            parameter = f"{name}=_default_{name}"
        elif factory is not dataclasses.MISSING:
            known[f"_make_{name}"] = factory
            parameter = f"{name}=_MADE"
            value = f"_make_{name}() if {name} is _MADE else {name}" if init else f"_make_{name}()"
        if init:
            (named if kw_only else positional).append(parameter)
        if init or parameter != name:
            fields[name] = value
    lines = [f"    self.{name} = {value}" for name, value in fields.items()]
    if open_twin is not None:
        known |= {
            "_Own": cls,
            "_Open": open_twin,
            "_become": vars(object)["__class__"].__set__,
            "_fill": _fill,
        }
        words = ", ".join(f"{name}={value}" for name, value in fields.items())
        lines = [
            "    if self.__class__ is _Own:",
            "        _become(self, _Open)",
            *(f"    {line}" for line in lines),
            "        self.__class__ = _Own",
            f"    else: _fill(self, dict({words}))",
        ]
    elif not plain:
        # into its slot, as the class refuses an assignment
        known |= {f"_set_{name}": getattr(cls, name).__set__ for name in fields}
        lines = [f"    _set_{name}(self, {value})" for name, value in fields.items()]
    if hasattr(cls, "__post_init__"):
        lines.append("    self.__post_init__()")
    parameters = ", ".join(("self", *positional, *(["*", *named] if named else [])))
    exec(f"def __init__({parameters}):\n" + "\n".join(lines or ["    pass"]), known)
    made: Callable[..., None] = known["__init__"]
    made.__qualname__ = f"{cls.__qualname__}.__init__"
    return made


def _fill(self: Any, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        object.__setattr__(self, name, value)


def _open_twin(cls: type) -> type | None:
    """A class with the slots of a frozen one, whose values take assignments: each takes a fourth of the time
    of a call that sets a slot. None where a class is none of plain Python."""
    if type(cls) is not type:
        return None
    slots = vars(cls)["__slots__"]
    return type(cls.__name__, cls.__bases__, {"__slots__": slots, "__setattr__": object.__setattr__})


@functools.cache
def _positional(cls: type) -> list[str]:
    """What a call of a class gives by position."""
    return [name for name, (_, _, init, kw_only) in _declared(cls).items() if init and not kw_only]


def _filled(self: Any, args: tuple[Any, ...], words: dict[str, Any]) -> bool:
    """Gives a value its fields as the constructor does; False, and nothing done, where a call does not fit:
    the constructor says why."""
    cls = self.__class__
    given = dict(zip(_positional(cls), args, strict=False)) | words
    if len(given) < len(args) + len(words):
        return False
    values: dict[str, Any] = {}
    for name, (default, factory, init, _) in _declared(cls).items():
        if init and name in given:
            values[name] = given.pop(name)
        elif default is not dataclasses.MISSING:
            values[name] = default
        elif factory is not dataclasses.MISSING:
            values[name] = factory()
        elif init:
            return False
    if given:
        return False
    _fill(self, values)
    if hasattr(cls, "__post_init__"):
        self.__post_init__()
    return True


def _state(self: Any) -> tuple[Any, ...]:
    return tuple([getattr(self, name) for name in _declared(self.__class__)])


def _set_state(self: Any, state: tuple[Any, ...]) -> None:
    for name, value in zip(_declared(self.__class__), state, strict=True):
        object.__setattr__(self, name, value)


def _repr(self: Any) -> str:
    shown = (f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self) if f.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _eq(self: Any, other: object) -> bool:
    return _state(self) == _state(other) if type(other) is type(self) else NotImplemented


def _hash(self: Any) -> int:
    return hash(_state(self))


def _refuse_set(self: Any, name: str, value: object) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_delete(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def _described(made: type, stated: dict[str, Any], frozen: bool, kw_only: bool) -> dict[str, Any]:
    """What the standard decorator says of a class: its fields, those of its bases first, and how it was
    decorated. Only a class without methods is decorated for it: of a frozen one it would compile some."""
    body = {name: value for name, value in stated.items() if value is not dataclasses.MISSING}
    body |= {"__annotations__": dict.fromkeys(stated, object), "__module__": made.__module__}
    # without words of its own the standard library writes some, from the signature
    bare: Any = type(made.__name__, (), {**body, "__doc__": made.__name__})
    dataclasses.dataclass(init=False, repr=False, eq=False, kw_only=kw_only)(bare)
    fields: dict[str, Any] = {}
    for base in reversed(made.__mro__[1:]):
        fields |= getattr(base, _FIELDS, {})
    own = getattr(bare, _FIELDS)
    kinds = inspect.get_annotations(made)
    for name, field in own.items():
        field.type = kinds[name]
    fields |= own
    params = bare.__dataclass_params__
    params.frozen = frozen
    names = tuple(name for name, field in fields.items() if field.init and not field.kw_only)
    return {_FIELDS: fields, "__dataclass_params__": params, "__match_args__": names}


class _Fields:
    """Stands for the fields until they are asked for."""

    def __init__(self, complete: Callable[[], None]) -> None:
        self.complete = complete

    def __get__(self, value: object, owner: type) -> object:
        self.complete()
        return getattr(owner, _FIELDS)


def _value_type(
    *, slots: bool, frozen: bool = False, eq: bool = True, kw_only: bool = False
) -> Callable[[type[T]], type[T]]:
    """As `dataclasses.dataclass`. Raises ValueError without slots."""
    if not slots:
        raise ValueError("a value type has slots; expected slots=True")
    shared: dict[str, Any] = {"__repr__": _repr, "__getstate__": _state, "__setstate__": _set_state}
    if eq:
        shared |= {"__eq__": _eq, "__hash__": _hash if frozen else None}
    if frozen:
        shared |= {"__setattr__": _refuse_set, "__delattr__": _refuse_delete}

    def decorated(cls: type[T]) -> type[T]:
        def complete() -> None:
            with _LOCK:
                if isinstance(vars(made)[_FIELDS], _Fields):  # no other thread was first
                    for name, value in _described(made, stated, frozen, kw_only).items():
                        setattr(made, name, value)

        made_values = 0

        def __init__(self: Any, *args: Any, **words: Any) -> None:
            nonlocal made_values
            made_values += 1
            if made_values > _FEW or not _filled(self, args, words):
                made.__init__ = _constructor(made)  # type: ignore[method-assign]
                self.__init__(*args, **words)

        stated = _stated(cls)
        own = {"__init__": __init__, _STATED: (stated, kw_only), _FIELDS: _Fields(complete)}
        made = _slotted(cls, stated, {**shared, **own})
        return made

    return decorated


if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:
    dataclass = _value_type
