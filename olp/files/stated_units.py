"""Numbers that a file states as text with a unit, for every key that ends in a unit of length or angle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args, get_origin

from olp.core.schema import Table, fields_of, is_table
from olp.core.units import unit_of_key


def in_units_of_keys(model: type[Table], values: Mapping[str, object]) -> dict[str, object]:
    """The values of a table with each text that is a quantity as a number in the unit of its key. Any other
    text is unchanged, and so refused by the model."""
    fields = {field.alias or name: field.annotation for name, field in fields_of(model).items()}
    return {key: _value(key, value, fields.get(key)) for key, value in values.items()}


def _value(key: str, value: object, annotation: object) -> object:
    unit = None if annotation is None else unit_of_key(key)
    return _inside(annotation, value) if unit is None else _numbers(value, unit)


def _inside(annotation: object, value: object) -> object:
    """The same for tables in a value, which the annotation of its key names."""
    if is_table(annotation):
        table: Any = annotation
        return in_units_of_keys(table, value) if isinstance(value, Mapping) else value
    inner = [part for part in get_args(annotation) if _names_table(part)]
    if not inner:
        return value
    origin = get_origin(annotation)
    if origin is dict and isinstance(value, Mapping):
        return {key: _inside(inner[-1], item) for key, item in value.items()}
    if origin is list and isinstance(value, list):
        return [_inside(inner[-1], item) for item in value]
    return value if origin in (dict, list) else _inside(inner[0], value)


def _names_table(annotation: object) -> bool:
    return is_table(annotation) or any(map(_names_table, get_args(annotation)))


def _numbers(value: object, unit: str) -> object:
    if isinstance(value, str):
        from olp.core.quantities import quantity

        try:
            return quantity(value, unit)
        except ValueError:
            return value
    if isinstance(value, list):
        return [_numbers(item, unit) for item in value]
    if isinstance(value, Mapping):
        return {key: _numbers(item, unit) for key, item in value.items()}
    return value


def not_a_quantity(path: tuple[str | int, ...], value: object) -> str | None:
    """What is wrong with a text below a key with a unit; None where the key has none, or the value is no
    text."""
    unit = next(filter(None, (unit_of_key(str(part)) for part in reversed(path))), None)
    if unit is None or not isinstance(value, str):
        return None
    from olp.core.quantities import quantity

    try:
        quantity(value, unit)
    except ValueError as error:
        return str(error)
    return None


def with_quantities(schema: dict[str, Any]) -> dict[str, Any]:
    """A JSON Schema in which every number below a key with a unit may also be a text with a unit."""
    shared: dict[str, str] = {}
    tables = {name: _table(table, shared) for name, table in schema.get("$defs", {}).items()}
    whole = _table(schema, shared)
    for name, unit in shared.items():
        tables[name] = _or_text(tables[name], unit, shared)
    return whole | ({"$defs": tables} if tables else {})


def _table(node: dict[str, Any], shared: dict[str, str]) -> dict[str, Any]:
    """`shared` collects the parts that keys with a unit refer to."""
    properties = {
        key: value if unit_of_key(key) is None else _or_text(value, unit_of_key(key) or "", shared)
        for key, value in node.get("properties", {}).items()
    }
    return node | ({"properties": properties} if properties else {})


def _or_text(node: Any, unit: str, shared: dict[str, str]) -> Any:
    if isinstance(node, list):
        return [_or_text(item, unit, shared) for item in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        shared[node["$ref"].rpartition("/")[2]] = unit
        return node
    if node.get("type") == "number":
        from olp.core.quantities import pattern

        kept = {key: node[key] for key in ("description", "default") if key in node}
        number = {key: value for key, value in node.items() if key not in kept}
        return {"anyOf": [number, {"type": "string", "pattern": pattern(unit)}]} | kept
    inner = ("items", "prefixItems", "anyOf", "additionalProperties")
    changed = {key: _or_text(node[key], unit, shared) for key in inner if key in node}
    if "properties" in node:
        changed["properties"] = {k: _or_text(v, unit, shared) for k, v in node["properties"].items()}
    return node | changed
