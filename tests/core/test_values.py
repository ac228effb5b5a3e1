"""Value types behave as dataclasses of the standard library, which is the judge here."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import re
import threading
from collections.abc import Callable
from dataclasses import field
from pathlib import Path
from typing import Any, ClassVar

import pytest

import olp
from olp.core import values

Decorator = Callable[..., Callable[[type], type]]


def classes(dataclass: Decorator) -> tuple[Any, Any, Any, Any]:
    """A class, one that inherits it with keywords alone, one that may be changed, one without equality."""

    @dataclass(frozen=True, slots=True)
    class Point:
        """Two numbers."""

        kind: ClassVar[str] = "point"
        x: float
        y: float = 2.0
        tags: list[str] = field(default_factory=list, repr=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "x", 10.0 * self.x)

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Named(Point):
        """A point with a name."""

        name: str
        y: float = 7.0

        def __repr__(self) -> str:
            return f"<{self.name}>"

    @dataclass(slots=True)
    class Count:
        """A number that grows, and what it has seen."""

        number: int = 0
        seen: list[int] = field(default_factory=list, init=False)

    @dataclass(frozen=True, slots=True, eq=False)
    class Alone:
        """A value that equals itself alone."""

        x: int

    return Point, Named, Count, Alone


OURS = classes(values.dataclass)  # type: ignore[arg-type]
STANDARD = classes(dataclasses.dataclass)
#: class and arguments of calls, right and wrong
CALLS: list[tuple[int, tuple[Any, ...], dict[str, Any]]] = [
    (0, (1,), {}),
    (0, (1, 5.0, ["a"]), {}),
    (0, (), {"y": 3.0, "x": 0}),
    (0, (), {}),
    (0, (1, 2, [], 4), {}),
    (0, (1,), {"z": 4}),
    (1, (1,), {"name": "n"}),
    (1, (1, ["b"]), {"name": "n", "y": 0.0}),
    (1, (1, 2.0, ["b"]), {"name": "n"}),
    (1, (1,), {}),
    (2, (), {}),
    (2, (4,), {}),
    (2, (4, [5]), {}),
]


def outcome(made: type, args: tuple[Any, ...], words: dict[str, Any]) -> tuple[Any, ...]:
    """What a call gives: the fields and the text of the value, or the kind of error."""
    try:
        value = made(*args, **words)
    except TypeError:
        return (TypeError,)
    return dataclasses.asdict(value), repr(value).rpartition("<locals>.")[2]


@pytest.mark.parametrize(("which", "args", "words"), CALLS)
def test_a_value_is_made_as_the_standard_library_makes_it(
    which: int, args: tuple[Any, ...], words: dict[str, Any]
) -> None:
    assert outcome(OURS[which], args, words) == outcome(STANDARD[which], args, words)


@pytest.mark.parametrize("which", range(4))
def test_fields_slots_and_patterns_are_those_of_the_standard_library(which: int) -> None:
    ours, standard = OURS[which], STANDARD[which]
    assert dataclasses.is_dataclass(ours)
    own, expected = (
        [(f.name, f.type, f.default, f.init, f.kw_only) for f in dataclasses.fields(c)]
        for c in (ours, standard)
    )
    assert own == expected
    assert ours.__match_args__ == standard.__match_args__
    # the standard library leaves out a slot that a base has; a second one is harmless
    assert set(standard.__slots__) <= set(ours.__slots__)
    words: dict[str, Any] = ({"x": 1}, {"x": 1, "name": ""}, {}, {"x": 1})[which]
    assert not hasattr(ours(**words), "__dict__")
    assert ours.__doc__ == standard.__doc__


def test_the_signature_is_known_once_a_value_was_made() -> None:
    OURS[0](1), STANDARD[0](1)
    names = [list(inspect.signature(c.__init__).parameters) for c in (OURS[0], STANDARD[0])]
    assert names[0] == names[1]


def test_values_compare_and_hash_as_the_standard_library_does() -> None:
    for point, named, count, alone in (OURS, STANDARD):
        assert point(1) == point(1.0) != point(2)
        assert point(1) != named(1, name="n", y=2.0)
        assert (point(1) == 1) is False
        assert named(1, name="n") == named(1, name="n") != named(1, name="m")
        one = alone(1)
        assert one != alone(1)
        assert len({one, one, alone(1)}) == 2
        assert hash(point(1, 2.0, ())) == hash(point(1, 2.0, ()))
        assert count.__hash__ is None
        assert count(2) == count(2) != count(3)


def test_a_frozen_value_refuses_changes_and_another_takes_them() -> None:
    value = OURS[0](1)
    with pytest.raises(dataclasses.FrozenInstanceError, match="'x'"):
        value.x = 2
    with pytest.raises(dataclasses.FrozenInstanceError, match="'x'"):
        del value.x
    with pytest.raises(dataclasses.FrozenInstanceError, match="'z'"):
        value.z = 2
    assert value.x == 10.0
    count = OURS[2]()
    count.number += 1
    assert count.number == 1
    with pytest.raises(AttributeError):
        count.other = 1


def test_each_value_has_a_list_of_its_own() -> None:
    one, other = OURS[0](1), OURS[0](1)
    one.tags.append("a")
    assert other.tags == []


def test_replace_and_copies_keep_the_fields() -> None:
    value = OURS[1](1, ["a"], name="n")
    assert dataclasses.asdict(dataclasses.replace(value, x=3)) == {**dataclasses.asdict(value), "x": 30.0}
    for twin in (copy.copy(value), copy.deepcopy(value)):
        assert dataclasses.asdict(twin) == dataclasses.asdict(value)
    setup = olp.Finding("OLP101", "message")
    assert pickle.loads(pickle.dumps(setup)) == setup


def test_fields_are_known_before_a_value_is_made_and_after() -> None:
    for first in (lambda made: made(1), dataclasses.fields):
        point = classes(values.dataclass)[0]  # type: ignore[arg-type]
        first(point)
        assert dataclasses.asdict(point(1)) == {"x": 10.0, "y": 2.0, "tags": []}


def test_a_class_without_slots_is_refused() -> None:
    with pytest.raises(ValueError, match="slots=True"):
        values.dataclass(slots=False)


def test_threads_that_ask_at_once_get_the_same_fields() -> None:
    point = classes(values.dataclass)[0]  # type: ignore[arg-type]
    gate = threading.Barrier(8)
    seen: list[int] = []

    def ask() -> None:
        gate.wait()
        seen.append(len(dataclasses.fields(point)) + len(dataclasses.fields(point(1))))

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert seen == [6] * 8


@pytest.fixture(autouse=True, params=[0, 6], ids=["constructor", "first values"])
def few(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """All that is true of values that a constructor made is true of the first ones too."""
    monkeypatch.setattr(values, "_FEW", request.param)


def test_a_class_compiles_nothing_until_it_has_a_few_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(values, "_FEW", 2)
    compiled: list[str] = []
    write = values._constructor
    monkeypatch.setattr(values, "_constructor", lambda made: compiled.append(made.__name__) or write(made))
    point, named, *_ = classes(values.dataclass)  # type: ignore[arg-type]
    assert compiled == []
    named(1, name="n")
    named(2, name="n")
    point(1)
    assert compiled == []
    point(1, 3)
    assert named(3, name="m").x == 30.0
    point(1)
    assert compiled == ["Named", "Point"]


def test_every_dataclass_of_the_package_is_such_a_value_type() -> None:
    standard = re.compile(r"^from dataclasses import .*\bdataclass\b|@dataclasses\.dataclass", re.M)
    own = Path(values.__file__)
    others = [module for module in Path(olp.__file__).parent.rglob("*.py") if module != own]
    assert [module for module in others if standard.search(module.read_text("utf-8"))] == []


def test_a_class_of_the_standard_library_may_inherit_from_a_frozen_one() -> None:
    @values.dataclass(frozen=True, slots=True)
    class Base:
        a: int

    @dataclasses.dataclass(frozen=True, slots=True)
    class Standard(Base):
        b: int = 2

    value = Standard(1)
    assert (value.a, value.b) == (1, 2) and [f.name for f in dataclasses.fields(value)] == ["a", "b"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        value.a = 3  # type: ignore[misc]


def test_a_frozen_value_with_many_fields_is_one_of_its_class_when_it_is_made() -> None:
    names = [f"n{k}" for k in range(values._MANY + 1)]
    body = {"__annotations__": dict.fromkeys(names, "int"), "n6": 7}
    made = values.dataclass(frozen=True, slots=True)(type("Wide", (), dict(body)))
    seen: list[type] = []
    body |= {"__post_init__": lambda self: seen.append(type(self))}
    checked = values.dataclass(frozen=True, slots=True)(type("Checked", (), body))
    plain = type("Plain", (made,), {})
    for cls in [made, checked, plain] * (values._FEW + 2):
        value: Any = cls(*range(6))
        assert type(value) is cls
        assert dataclasses.astuple(value) == (*range(6), 7)
        with pytest.raises(dataclasses.FrozenInstanceError):
            value.n0 = 3
    assert set(seen) == {checked}
