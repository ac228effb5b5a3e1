"""Tables of files: what fits a type, what is said of what does not, and values that are made from others."""

from __future__ import annotations

import datetime
import math
import pickle
import re
from typing import Annotated, Any, Literal, get_type_hints

import pytest

from olp.core.schema import (
    Interval,
    NotNegative,
    Position,
    Positive,
    Table,
    Text,
    Triple,
    copied,
    fields_of,
    made,
    stated_keys,
    stated_values,
    with_keys,
)
from olp.core.schema_keys import After, Before, Field, Instead, Known, WrongTable, refusal, rule
from olp.files import schemas
from olp.files.calibration.schema import CalibrationFile


def _even(value: int) -> int:
    if value % 2:
        raise refusal(f"= {value} is odd")
    return value


@pytest.mark.parametrize("model", [schemas.MachineFile, schemas.JobFile, CalibrationFile, schemas.CheckTable])
def test_types_of_keys_are_those_of_the_standard_library(model: type[Table]) -> None:
    hints = get_type_hints(model, include_extras=True)
    found = {name: field.annotation for name, field in fields_of(model).items()}
    # limits are values of their own each time
    assert _plain(found) == _plain({name: hints[name] for name in found})


def _plain(hints: dict[str, Any]) -> dict[str, str]:
    return {name: re.sub(r" at 0x[0-9a-f]+", "", repr(kind)) for name, kind in hints.items()}


class Part(Table):
    name: Text = Field(description="the name")
    size_mm: Positive = Field(default=1.0)


class Whole(Table):
    schema_: Literal["whole"] = Field(alias="schema", default="whole")
    number: float = 0.5
    count: int | None = None
    on: bool = False
    day: datetime.date | None = None
    kind: Literal["a", "b", "c"] = "a"
    column: Text | Annotated[int, Field(ge=1)] = "X"
    sign: Annotated[int, Field(ge=-1, le=1)] = 1
    span_mm: Interval = (0.0, 1.0)
    vector: Triple | None = None
    weights: list[NotNegative] = Field(default=[])
    parts: list[Part] = Field(default=[])
    named: dict[Annotated[str, After(str.upper)], Part] = Field(default={})
    at_mm: Position = Field(default_factory=Position)
    even: Annotated[int, After(_even)] = 0
    doubled: Annotated[int, Before(lambda v: 2 * v)] = 0
    any_way: Annotated[str, Instead(str)] = ""
    last: float | None = Field(default=None, check_default=True)

    @rule("last")
    @staticmethod
    def _with_count(value: float | None, known: Known) -> float | None:
        if value is None and known.get("count") == 7:
            raise refusal("is missing, but count is 7")
        return value


def wrongs(**values: Any) -> list[tuple[str, tuple[str | int, ...]]]:
    with pytest.raises(WrongTable) as caught:
        Whole(**values)
    return [(kind, path) for kind, path, _, _ in caught.value.wrongs]


def test_values_are_kept_in_the_type_of_their_key() -> None:
    whole = Whole(number=3, vector=[1, 2, 3], span_mm=[0, 2], count=4, doubled=3, any_way=5)  # type: ignore[arg-type]
    assert (whole.number, type(whole.number)) == (3.0, float)
    assert whole.vector == (1.0, 2.0, 3.0) and whole.span_mm == (0.0, 2.0)
    assert (whole.count, whole.doubled, whole.any_way) == (4, 6, "5")
    tables = Whole(parts=[{"name": "p", "size_mm": 2}], named={"q": {"name": "q"}}, at_mm={"Y": 1})  # type: ignore
    assert tables.parts == [Part(name="p", size_mm=2.0)]
    assert tables.named == {"Q": Part(name="q", size_mm=1.0)}
    assert tables.at_mm.values == (None, 1.0, None)


@pytest.mark.parametrize(("key", "value", "kind"), [
    ("number", "1", "float"), ("number", True, "float"), ("number", math.nan, "finite"),
    ("number", math.inf, "finite"), ("number", 10**400, "float"),
    ("count", 1.0, "int"), ("count", False, "int"), ("on", 1, "bool"),
    ("day", datetime.datetime(2026, 1, 1), "date"), ("day", "2026-01-01", "date"),
    ("kind", "d", "literal"), ("kind", ["a"], "literal"), ("schema", "hole", "literal"),
    ("column", "", "short"), ("column", 0, "ge"), ("column", 1.5, "any"), ("column", True, "any"),
    ("sign", 2, "le"), ("sign", -2, "ge"),
    ("span_mm", [2, 1], "refused"), ("span_mm", [1, 2, 3], "long"), ("vector", "abc", "tuple"),
    ("weights", (1.0,), "array"), ("parts", {"name": "p"}, "array"), ("named", [1], "dict"),
    ("at_mm", 3.0, "table"), ("even", 3, "refused"), ("schema_", "whole", "unknown"),
    ("colour", 1, "unknown"),
])  # fmt: skip
def test_what_does_not_fit_is_named(key: str, value: object, kind: str) -> None:
    assert wrongs(**{key: value}) == [(kind, (key,))]


def test_wrongs_inside_have_their_path_and_come_together_in_order() -> None:
    found = wrongs(
        colour=1, vector=[1.0, "x"], parts=[{"size_mm": 0}, {"name": "p", "sise_mm": 1}], weights=[0, -1]
    )
    assert found == [
        ("float", ("vector", 1)), ("missing", ("vector", 2)), ("ge", ("weights", 1)),
        ("missing", ("parts", 0, "name")), ("gt", ("parts", 0, "size_mm")),
        ("unknown", ("parts", 1, "sise_mm")),
        ("unknown", ("colour",)),
    ]  # fmt: skip


def test_a_rule_sees_the_values_before_and_a_default_where_it_asks_to() -> None:
    assert wrongs(count=7) == [("refused", ("last",))]
    assert Whole(count=7, last=1.0).last == 1.0
    # a wrong value is not known to the rules behind it
    assert wrongs(count=7.5) == [("int", ("count",))]


def test_defaults_are_not_shared() -> None:
    first, second = Whole(), Whole()
    first.weights.append(1.0)
    assert second.weights == [] and Whole().weights == []


def test_a_table_does_not_change_and_says_what_was_stated() -> None:
    whole = Whole(count=2)
    with pytest.raises(AttributeError, match="count"):
        whole.count = 3  # type: ignore[misc]
    assert stated_keys(whole) == {"count"}
    changed = copied(whole, number=2.0)
    assert (changed.number, changed.count, whole.number) == (2.0, 2, 0.5)
    assert stated_keys(changed) == {"count", "number"}
    assert made(Whole, {"count": 2}, frozenset({"count"})) == whole
    again = pickle.loads(pickle.dumps(whole))
    assert again == whole and stated_keys(again) == {"count"}


def test_keys_are_those_of_the_file() -> None:
    assert list(stated_values(Position(X=1.0, Z=2.0))) == ["X", "Z"]
    assert next(iter(stated_values(Whole()))) == "schema"
    more = with_keys("More", Part, {"colour": (Text, Field(default="red"))}, "A part.", __name__)
    assert list(fields_of(more)) == ["name", "size_mm", "colour"]
    assert "colour" not in fields_of(Part)
    assert more(name="p") != Part(name="p") and more(name="p").size_mm == 1.0
