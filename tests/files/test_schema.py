"""The exported JSON Schemas take good files, refuse what the loaders refuse, and describe every key."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from olp.core.errors import UsageError
from olp.files.json_schema import json_schema, json_schema_text
from olp.files.schemas import FILES
from olp.files.starter import starter_machine, starter_set
from olp.files.toml_text import read_toml

GOOD = Path(__file__).parents[1] / "broken" / "good"
TYPES: dict[str, Any] = {
    "object": dict, "array": list, "string": (str, datetime.date), "boolean": bool, "integer": int,
    "number": (int, float),
}  # fmt: skip
KNOWN = {
    "$defs", "$id", "$ref", "$schema", "additionalProperties", "anyOf", "const", "default", "description",
    "enum", "exclusiveMinimum", "format", "items", "maxItems", "minItems", "minLength", "minimum",
    "pattern", "patternProperties", "prefixItems", "properties", "propertyNames", "required", "title", "type",
}  # fmt: skip


def faults(value: Any, schema: dict[str, Any], root: dict[str, Any], path: str = "") -> Iterator[str]:
    """Where a value breaks a schema, for the keywords in KNOWN."""
    assert schema.keys() <= KNOWN
    if "$ref" in schema:
        yield from faults(value, root["$defs"][schema["$ref"].rpartition("/")[2]], root, path)
    if "type" in schema and (
        not isinstance(value, TYPES[schema["type"]])
        or (isinstance(value, bool) and schema["type"] in ("number", "integer"))
    ):
        yield path
        return
    if "anyOf" in schema and all(list(faults(value, option, root)) for option in schema["anyOf"]):
        yield path
    if "const" in schema and value != schema["const"]:
        yield path
    if "enum" in schema and value not in schema["enum"]:
        yield path
    if isinstance(value, int | float) and not (
        value >= schema.get("minimum", value) and value > schema.get("exclusiveMinimum", value - 1)
    ):
        yield path
    if isinstance(value, str) and len(value) < schema.get("minLength", 0):
        yield path
    if isinstance(value, str) and not re.search(schema.get("pattern", ""), value):
        yield path
    if isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            yield path
        for index, item in enumerate(value):
            prefix = schema.get("prefixItems", [])
            inner = prefix[index] if index < len(prefix) else schema.get("items", {})
            yield from faults(item, inner, root, f"{path}[{index}]")
    if isinstance(value, dict):
        yield from (f"{path}.{key}" for key in schema.get("required", []) if key not in value)
        for key, item in value.items():
            yield from faults(item, _of_key(key, schema), root, f"{path}.{key}")


def _of_key(key: str, schema: dict[str, Any]) -> dict[str, Any]:
    if key in schema.get("properties", {}):
        return dict(schema["properties"][key])
    for pattern, inner in schema.get("patternProperties", {}).items():
        if re.search(pattern, key):
            return dict(inner)
    rest = schema.get("additionalProperties", True)
    return dict(rest) if isinstance(rest, dict) else {} if rest else {"enum": []}


def values_of(text: str) -> dict[str, Any]:
    return read_toml(text.encode(), "t")[0]


@pytest.mark.parametrize("kind", FILES)
def test_schema_takes_the_good_file_and_the_starter_file(kind: str) -> None:
    schema = json_schema(kind)
    starter = starter_set(starter_machine("mill", "XFYZ", dict.fromkeys("XYZ", (0.0, 100.0))))
    for text in ((GOOD / f"{kind}.toml").read_text(), starter[f"{kind}.toml"]):
        assert list(faults(values_of(text), schema, schema)) == []


@pytest.mark.parametrize(
    ("kind", "old", "new", "path"),
    [
        ("machine", '"FXYZ"', '"XYZ"', ".chain"),
        ("machine", "= 500.0", "= 0", ".axes.X.velocity_mm_s"),
        ("machine", "[0.0, 2000.0]", "[0.0]", ".axes.X.travel_mm"),
        ("machine", "[tools.1]", "[tools.T1]", ".tools.T1"),
        ("machine", '["EXX", "C0Y"]', '["EXW"]', ".compensated_by_controller"),
        ("machine", "radius_mm", "radius", ".tools.1.radius"),
        ("calibration", "actual-minus", "nominal-minus", ".sign"),
        ("calibration", "[squareness]", "[[maps]]\nfile = 'm.csv'\n[squareness]", ".maps[0].kind"),
        ("calibration", "[10.0, 0.0, -5.0]", '[10.0, 0.0, "z"]', ".datum_mm[2]"),
        ("calibration", "measured = 2026-05-14\n", "", ".measured"),
        ("job", "= 12.5", "= -1", ".payload_kg"),
        ("job", 'role = "fixture"', 'role = "vice"', ".meshes[0].role"),
        ("job", "X = 0.0,", "X = false,", ".start_mm.X"),
    ],
)
def test_schema_refuses_a_fault_at_its_place(kind: str, old: str, new: str, path: str) -> None:
    schema = json_schema(kind)
    text = (GOOD / f"{kind}.toml").read_text()
    assert old in text
    assert list(faults(values_of(text.replace(old, new, 1)), schema, schema)) == [path]


@pytest.mark.parametrize("kind", FILES)
def test_every_key_is_described_and_a_key_with_unit_names_its_unit(kind: str) -> None:
    schema = json_schema(kind)
    units = {
        "_mm": "mm",
        "_um": "um",
        "_urad": "urad",
        "_deg": "degrees",
        "_kg": "kg",
        "_degC": "degC",
        "_rad": "rad",
    }
    tables = [schema, *schema["$defs"].values()]
    keys = [(key, inner) for table in tables for key, inner in table["properties"].items()]
    assert len(keys) > 20
    for key, inner in keys:
        assert inner["description"].strip(), key
        for suffix, unit in units.items():
            if key.endswith(suffix):
                assert f"{unit}" in inner["description"], key


def test_schema_text_is_json_and_the_same_each_time() -> None:
    assert json.loads(json_schema_text("job")) == json_schema("job")
    assert json_schema_text("job") == json_schema_text("job")


def test_schema_of_an_unknown_kind_is_a_wrong_call() -> None:
    with pytest.raises(UsageError, match="expected one of machine, calibration, job"):
        json_schema("tool")
