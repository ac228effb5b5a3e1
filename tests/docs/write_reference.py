"""The reference pages that the code writes itself: verbs, findings, keys of files, support of dialects.

    python tests/docs/write_reference.py        # writes olp/docs/reference/*.md again

A test says when one of them is stale.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from olp.cli import main
from olp.cli.late import LateGroup
from olp.files.described import described
from olp.files.json_schema import KINDS, json_schema
from olp.findings.catalogue import RULES
from olp.program import registry
from olp.review.features.registry import KINDS as KINDS_OF_FEATURES

FOLDER = Path(__file__).resolve().parents[2] / "olp" / "docs" / "reference"
#: Values of a key that are listed in full.
FEW = 6
_GENERATED = "This page is written by the code itself (`python tests/docs/write_reference.py`).\n"


def cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def table(head: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "".join(f"| {' | '.join(map(cell, row))} |\n" for row in lines) + "\n"


def verbs() -> str:
    """Every verb, its arguments and its options."""
    parts = [
        "# Verbs and options\n\nEvery verb with its arguments and options, as `--help` prints them.\n"
        f"{_GENERATED}\n"
    ]
    parts += _group(main, "olp")
    return "".join(parts)


def _group(group: LateGroup, path: str) -> Iterator[str]:
    context = click.Context(group, info_name=path)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, LateGroup):
            yield f"## {path} {name}\n\n{cell(command.help or '')}\n\n"
            yield from _group(command, f"{path} {name}")
        else:
            yield _verb(command, f"{path} {name}")


def _verb(command: click.Command, path: str) -> str:
    context = click.Context(command, info_name=path)
    usage = " ".join(command.collect_usage_pieces(context))
    about = "\n\n".join(" ".join(p.split()) for p in (command.help or "").replace("\b", "").split("\n\n"))
    options = (
        option
        for option in command.get_params(context)
        if isinstance(option, click.Option) and not option.hidden and "--help" not in option.opts
    )
    rows = (
        (f"`{name}`", text)
        for option in options
        for name, text in [option.get_help_record(context) or ("", "")]
    )
    return f"## {path}\n\n`{path} {usage}`\n\n{about}\n\n" + table(("option", "what it does"), rows)


def findings() -> str:
    """Every finding: why it matters, an example, what to do."""
    rows = ((f"[{r.code}](#{r.code.lower()})", r.severity.name.lower(), r.title) for r in RULES.values())
    head = (
        "# Findings\n\nA finding has a code and a severity. `olp explain CODE` prints what stands here.\n"
        f"{_GENERATED}\n"
    )
    body = (
        f"## {r.code}\n\n**{r.title}** ({r.severity.name.lower()})\n\n{r.why}\n\n"
        f"*Example.* {r.example}\n\n*What to do.* {r.remedy}\n\n"
        for r in RULES.values()
    )
    return head + table(("code", "severity", "what was found"), rows) + "".join(body)


def keys() -> str:
    """Every key of the files that people write."""
    parts = [
        "# Keys of the files\n\nEvery key of the TOML files that you write, from the schema that reads them. "
        "`olp schema KIND` prints it for an editor.\n[Files](files.md) shows examples.\n" + _GENERATED + "\n"
    ]
    for kind in KINDS:
        schema = json_schema(kind)
        parts.append(f"## {kind}\n\n")
        parts += _tables(schema, schema.get("$defs", {}), "", "", set())
    return "".join(parts)


def _tables(
    node: Mapping[str, Any], parts: Mapping[str, Any], path: str, titles: str, seen: set[str]
) -> Iterator[str]:
    """The table of a node, then those of the tables in it; tables of one form stand once."""
    rows, inner = [], dict[str, list[str]]()
    properties = dict(node.get("properties", {}))
    if len(node.get("patternProperties", {})) or isinstance(node.get("additionalProperties"), dict):
        named = [*node.get("patternProperties", {}).values(), node.get("additionalProperties")]
        properties["NAME"] = next(value for value in named if isinstance(value, dict))
    for key, value in properties.items():
        form = re.search(r"#/\$defs/(\w+)", str(value))
        if form is not None:
            inner.setdefault(form[1], []).append(f"{path}{key}")
        needed = "required" if key in node.get("required", ()) else _default(value)
        rows.append((f"`{key}`", _kind(value), needed, value.get("description", "")))
    if rows:
        yield f"{titles}{table(('key', 'kind', 'default', 'meaning'), iter(rows))}"
    for name, paths in inner.items():
        if name not in seen:
            seen.add(name)
            title = ", ".join(f"`{each}`" for each in paths)
            yield from _tables(parts[name], parts, f"{paths[0]}.", f"### {title}\n\n", seen)


def _default(value: Mapping[str, Any]) -> str:
    default = value.get("default", "")
    return "" if default in ("", None, [], {}) else f"`{default}`"


def _kind(value: Mapping[str, Any]) -> str:
    if "$ref" in value:
        return "table"
    if "enum" in value:
        names = [f'"{v}"' for v in value["enum"]]
        return f"one of {', '.join(names[:3])}, ..." if len(names) > FEW else " or ".join(names)
    if "const" in value:
        return f'"{value["const"]}"'
    if "anyOf" in value:
        return " or ".join(dict.fromkeys(_kind(v) for v in value["anyOf"]))
    kinds = {"string": "text", "number": "number", "integer": "integer", "boolean": "true or false",
             "array": "list", "object": "table"}  # fmt: skip
    return kinds.get(str(value.get("type", "")), "")


def dialects() -> str:
    """What becomes of each statement of each dialect."""
    shipped = [described(name) for name in registry.DESCRIBED]
    parts = [
        "# Dialects\n\nWhat `olp` makes of each statement of each dialect. `olp inspect PROGRAM` says it of "
        f"a program.\n{_GENERATED}\n"
    ]
    for dialect in [*registry.DIALECTS.values(), *(d for d in shipped if d is not None)]:
        parts.append(f"## {dialect.name}\n\n{dialect.title}.\n\n")
        rows = ((f"`{row.statement}`", row.support.title, row.why) for row in dialect.rows())
        parts.append(table(("statement", "what becomes of it", "why, or how"), rows))
    return "".join(parts)


def features() -> str:
    """The kinds of features of the page, and what their figures mean."""
    parts = [
        "# Features\n\nThe features that the page of [`olp view`](../howto/view.md) finds in a program, and "
        f"what is said of each.\nDeviations are in um, of the moves that count.\n{_GENERATED}\n"
    ]
    for kind in KINDS_OF_FEATURES:
        rows = ((figure.label, figure.meaning) for figure in kind.figures.values())
        parts.append(f"## {kind.label}\n\n" + table(("figure", "what it means"), rows))
    return "".join(parts)


PAGES = {
    "verbs.md": verbs, "findings.md": findings, "keys.md": keys, "dialects.md": dialects,
    "features.md": features,
}  # fmt: skip

if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, write in PAGES.items():
        (FOLDER / name).write_text(write(), "utf-8")
