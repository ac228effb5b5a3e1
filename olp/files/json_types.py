"""The JSON Schema of a table: of its keys with their types, limits, defaults and descriptions."""

from __future__ import annotations

import datetime
import types
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from olp.core.schema import Table, fields_of, is_table
from olp.core.schema_keys import NONE, FieldInfo, Shown

Schema = dict[str, Any]

_PLAIN: dict[Any, Schema] = {
    float: {"type": "number"},
    int: {"type": "integer"},
    bool: {"type": "boolean"},
    str: {"type": "string"},
    datetime.date: {"format": "date", "type": "string"},
}
_LIMITS = {"gt": "exclusiveMinimum", "ge": "minimum", "le": "maximum", "min_length": "minLength"}


def table_schema(model: type[Table]) -> Schema:
    """The schema of a table, with those of the tables in it under "$defs"."""
    inner: dict[str, Schema] = {}
    whole = _table(model, inner)
    return {"$defs": {name: inner[name] for name in sorted(inner)}, **whole}


def _table(model: type[Table], inner: dict[str, Schema]) -> Schema:
    fields = {field.alias or name: field for name, field in fields_of(model).items()}
    schema: Schema = {"additionalProperties": False}
    if model.__doc__ and model.__doc__ != Table.__doc__:
        schema["description"] = _dedented(model.__doc__)
    schema["properties"] = {key: _key(field, inner) for key, field in fields.items()}
    required = [key for key, field in fields.items() if field.required]
    return {**schema, **({"required": required} if required else {}), "type": "object"}


def _key(field: FieldInfo, inner: dict[str, Schema]) -> Schema:
    more: Schema = {}
    if field.default is not NONE and field.default is not None:
        default = field.default
        if isinstance(default, frozenset | tuple):
            default = sorted(default) if isinstance(default, frozenset) else list(default)
        more["default"] = default
    if field.description:
        more["description"] = field.description
    schema = _type(field.annotation, inner)
    if "anyOf" in schema:
        return more | schema
    optional = type(None) in get_args(field.annotation)
    return schema | more if optional else dict(sorted((schema | more).items()))


def _type(kind: Any, inner: dict[str, Schema]) -> Schema:
    """The schema of a type; the tables that it names are added to `inner`."""
    if kind in _PLAIN:
        return dict(_PLAIN[kind])
    if is_table(kind):
        if kind.__name__ not in inner:
            inner[kind.__name__] = {}
            inner[kind.__name__] = _table(kind, inner)
        return {"$ref": f"#/$defs/{kind.__name__}"}
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _annotated(parts[0], parts[1:], inner)
    if origin in (Union, types.UnionType):
        options = [_type(part, inner) for part in parts if part is not type(None)]
        return options[0] if len(options) == 1 else {"anyOf": options}
    if origin is Literal:
        names = {"const": parts[0]} if len(parts) == 1 else {"enum": list(parts)}
        return {**names, "type": "string"}
    if origin is tuple:
        items = [_type(part, inner) for part in parts]
        return {"maxItems": len(items), "minItems": len(items), "prefixItems": items, "type": "array"}
    if origin is list:
        return {"items": _type(parts[0], inner), "type": "array"}
    return _dict(_type(parts[0], inner), _type(parts[1], inner))


def _dict(names: Schema, values: Schema) -> Schema:
    names = {key: value for key, value in names.items() if key != "type"}
    if "pattern" in names:
        return {
            "additionalProperties": False,
            "patternProperties": {names["pattern"]: values},
            "type": "object",
        }
    return {"additionalProperties": values, **({"propertyNames": names} if names else {}), "type": "object"}


def _annotated(kind: Any, more: tuple[Any, ...], inner: dict[str, Schema]) -> Schema:
    stated = next((dict(item.schema) for item in more if isinstance(item, Shown)), None)
    schema = _type(kind, inner) if stated is None else stated
    for item in more:
        if isinstance(item, FieldInfo):
            schema |= {_LIMITS[name]: limit for name, limit in item.limits.items()} | dict(item.shown)
    return dict(sorted(schema.items()))


def _dedented(words: str) -> str:
    return "\n".join(line.strip() for line in words.strip().split("\n"))
