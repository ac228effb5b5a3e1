"""What a table of a file states of one key: its default, its description, its limits, and the rules on its
value; and what is said where a value breaks them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

#: What is wrong with one value: its kind, its path, the value, and the limit or the names
#: that it had to keep.
Wrong = tuple[str, tuple[str | int, ...], object, Any]

#: The values of the keys before one, by attribute; keys whose values are wrong are not there.
Known = Mapping[str, Any]

#: Stands for a default that is not there.
NONE: Any = object()


class RefusedValue(ValueError):
    """A rule refuses a value. Its sentence is complete: it is shown after the key path as it stands."""


class WrongTable(ValueError):
    """Values that do not make a table. `wrongs` are all that is wrong, in the order of keys."""

    def __init__(self, wrongs: list[Wrong]) -> None:
        super().__init__("; ".join(f"{path}: {kind}" for kind, path, _, _ in wrongs))
        self.wrongs = wrongs


def refusal(sentence: str) -> RefusedValue:
    """An error whose sentence is complete: it is shown after the key path as it stands."""
    return RefusedValue(sentence)


class FieldInfo:
    """What a table states of one key. `shown` is what the JSON Schema says beside the type, `annotation` the
    type, known when the table is first used."""

    __slots__ = ("alias", "annotation", "default", "description", "factory", "limits", "shown", "stated_only")

    def __init__(
        self,
        default: Any,
        factory: Callable[[], Any] | None,
        alias: str | None,
        description: str,
        stated_only: bool,
        limits: dict[str, Any],
        shown: Mapping[str, Any],
    ) -> None:
        self.default, self.factory, self.alias, self.description = default, factory, alias, description
        self.stated_only, self.limits, self.shown = stated_only, limits, shown
        self.annotation: Any = None

    @property
    def required(self) -> bool:
        return self.default is NONE and self.factory is None

    def absent(self) -> Any:
        """The value of a key that is not stated."""
        if self.factory is not None:
            return self.factory()
        return self.default.copy() if isinstance(self.default, list | dict) else self.default


def Field(
    *,
    default: Any = NONE,
    default_factory: Callable[[], Any] | None = None,
    alias: str | None = None,
    description: str = "",
    check_default: bool = False,
    shown: Mapping[str, Any] | None = None,
    **limits: float,
) -> Any:
    """A key of a table, or limits of a type: `gt`, `ge`, `le` of a number, `min_length` of a text.

    `alias` is its name in the file where that is another one. The rules of a key see its default too where
    `check_default` is True.
    """
    return FieldInfo(default, default_factory, alias, description, not check_default, limits, shown or {})


class Before:
    """A rule that sees a value before its type is looked at: it returns the value, or raises `refusal`."""

    __slots__ = ("rule",)

    def __init__(self, rule: Callable[[Any], object]) -> None:
        self.rule = rule


class After(Before):
    """A rule that sees a value of the right type."""

    __slots__ = ()


class Instead(Before):
    """A rule that makes the value, whatever its type says."""

    __slots__ = ()


class Shown:
    """What the JSON Schema says instead of the type."""

    __slots__ = ("schema",)

    def __init__(self, schema: Mapping[str, Any]) -> None:
        self.schema = schema


class Rule:
    """A rule on keys of a table."""

    __slots__ = ("check", "keys")

    def __init__(self, keys: tuple[str, ...], check: Callable[[Any, Known], object]) -> None:
        self.keys, self.check = keys, check


def rule(*keys: str) -> Callable[[Any], Any]:
    """A static method (value, the values of the keys before) is a rule on `keys`: it returns the value, or
    raises `refusal`. It does not see values of a wrong type."""
    return lambda method: Rule(keys, method.__func__)
