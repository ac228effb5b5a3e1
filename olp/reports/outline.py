"""Any summary as text: scalars as pairs, equal records as a table, the rest under its name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Any

from olp.core.units import AXES
from olp.reports.report import findings_text, pairs, printable, table
from olp.reports.shown import title as shown_title
from olp.reports.shown import unit_in

Summary = Mapping[str, Any]

#: Smaller numbers are rounding: no unit of a report is so large.
_ROUNDING = 1e-8
#: Titles of keys whose words are not those of the shop floor.
_TITLES = {"lost_motion_um": "backlash um"}


def outline(values: Summary) -> str:
    """A summary whose keys end in their units, as text; what is empty is left out."""
    findings = values.get("findings") or ()
    parts = ["\n".join(_section("", {k: v for k, v in values.items() if k not in ("findings", "schema")}))]
    if findings:
        parts.append("\n".join(findings_text(findings)))
    return "\n\n".join(part.strip("\n") for part in parts if part) + "\n"


def by_file(values: Summary) -> dict[str, Any]:
    """The same with the names of files, in place of their paths, in rows that are of files."""
    return {
        key: [_by_file(row) for row in value] if isinstance(value, list) else value
        for key, value in values.items()
    }


def _by_file(row: Any) -> Any:
    if not isinstance(row, Mapping) or "name" not in row:
        return row
    words = [row["name"], *([row["file"]] if "file" in row else [])]
    name = " ".join([*words[:-1], PurePath(words[-1]).name])
    return {"name": name} | {k: v for k, v in row.items() if k not in ("name", "file")}


def _section(title: str, values: Summary) -> Iterator[str]:
    plain = {key: item for key, item in values.items() if not _is_group(item)}
    groups = {key: item for key, item in values.items() if _is_group(item) and item}
    lines = list(pairs(((_title(key), _text(item)) for key, item in plain.items()), unit_in(title)))
    if title and lines:
        yield shown_title(title)
    yield from (("  " + line if title else line) for line in lines)
    for key, item in groups.items():
        name = f"{title}, {_title(key)}" if title else _title(key).capitalize()
        yield ""
        records = _records(item)
        if records is None:
            yield from _section(name, item)
        else:
            yield shown_title(name)
            yield from _table(*records, unit_in(name))


def _is_group(value: object) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value)
    )


def _records(value: Summary | Sequence[Summary]) -> tuple[list[str], list[Summary]] | None:
    """Row names and rows of a list of records, or of a mapping of nothing but records."""
    if not isinstance(value, Mapping):
        names = [str(row.get("name", "")) for row in value]
        return names, [{k: v for k, v in row.items() if k != "name"} for row in value]
    rows = list(value.values())
    if rows and all(isinstance(row, Mapping) and not any(map(_is_group, row.values())) for row in rows):
        return [str(key) for key in value], rows
    return None


def _table(names: Sequence[str], rows: Sequence[Summary], unit: str | None) -> Iterator[str]:
    keys = list(dict.fromkeys(key for row in rows for key in row))
    # Words to the left, numbers to the right.
    keys.sort(key=lambda key: not any(isinstance(row.get(key), str) for row in rows))
    words = sum(any(isinstance(row.get(key), str) for row in rows) for key in keys)
    header, columns = [""], [[printable(name) for name in names]]
    for key in keys:
        values = [row.get(key) for row in rows]
        if all(isinstance(value, list | tuple) and len(value) == len(AXES) for value in values):
            header += [f"{_title(key)} {axis}" for axis in AXES]
            columns += [[_text(value[axis]) for value in values if value] for axis in range(len(AXES))]
        else:
            header.append(_title(key))
            columns.append([_text(value) for value in values])
    yield from table(header, zip(*columns, strict=True), text_columns=1 + words, unit=unit)


def _title(key: object) -> str:
    return _TITLES.get(str(key)) or printable(str(key).replace("_", " "))


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        if _ROUNDING < abs(value) < 5e-4:
            return f"{value:.1e}"
        return f"{value:.3f}".rstrip("0").rstrip(".") if abs(value) > _ROUNDING else "0"
    if isinstance(value, list | tuple | set | frozenset):
        return ", ".join(map(_text, value))
    return printable(str(value))
