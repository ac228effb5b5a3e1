"""Loads dialects that a file describes: olp-dialect-1 (a language of motion), olp-points-1 (a list of
positions), and those that come with `olp`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from olp.core.errors import ConfigError
from olp.core.schema import Table, Text
from olp.core.schema_keys import Field
from olp.files.fields import SHIPPED
from olp.files.point_profile import PointProfile
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import line_of, read_toml
from olp.files.write import PathLike, Reader, read_bytes
from olp.program.described.forms import Form, form
from olp.program.described.language import DOES, Rule, UserDialect
from olp.program.described.reader import read_described
from olp.program.dialect import Dialect
from olp.program.pointlist.dialect import with_layout

FOLDER = Path(__file__).parents[1] / "program" / "described" / "shipped"

Does = Literal[
    "line", "rapid", "point", "away", "tool", "frame", "unit", "speed", "section", "carry", "refuse"
]
Speed = Literal["mm/s", "mm/min", "m/s", "m/min", "inch/min"]


class StatementTable(Table):
    form: Text = Field(description="how the statement is written, such as LMOVE TRANS({x}, {y}, {z})")
    does: Does = Field(description="what it does: " + ", ".join(DOES))
    why: Text | None = Field(default=None, description="why it is refused, or how it is treated")
    inside: str | None = Field(
        default=None, description="the section where the form is valid; all if left out"
    )
    enters: str | None = Field(
        default=None, description='the section that the statement begins, "" for the one at the start'
    )
    frame: Text | None = Field(default=None, description="the frame that the statement makes active")
    unit: Literal["mm", "um", "m", "inch"] | None = Field(
        default=None, description="the unit that the statement makes active"
    )
    speed_unit: Speed | None = Field(
        default=None, description="the unit of its speed; the dialect's if left out"
    )
    incremental: bool = Field(default=False, description="whether its numbers are distances")


class DialectFile(Table):
    """olp-dialect-1: a line-oriented language of motion."""

    schema_: Literal["olp-dialect-1"] = Field(alias="schema", description='the format, "olp-dialect-1"')
    name: Text = Field(description="the name of the dialect")
    title: Text = Field(description="the name of the dialect in reports")
    about: Text | None = Field(default=None, description="what is known of the language and what is not")
    unit: Literal["mm", "um", "m", "inch"] | None = Field(
        default=None, description="the unit of positions, where no statement sets it"
    )
    speed_unit: Speed | None = Field(default=None, description="the unit of speeds; unknown if left out")
    comments: list[Text] = Field(
        default=[], description="the marks that begin a comment, up to the end of its line"
    )
    stamp: list[str] = Field(
        default=[], description="the marks before and behind the comment that marks a corrected program"
    )
    quote: str = Field(default="", description="the mark around texts; there is no comment inside them")
    continuation: str = Field(
        default="", description="the mark at the end of a line that continues on the next"
    )
    terminator: str = Field(default="", description="the mark at the end of a statement")
    label: Text | None = Field(
        default=None, description="the form of what may come before a statement, such as a line number"
    )
    ignore_case: bool = Field(default=True, description="whether upper and lower case are the same")
    path_mode: Text = Field(
        default="not stated", description="how the control moves from block to block, for reports"
    )
    carry: list[Text] = Field(
        default=[], description="forms of statements without effect on the path, kept as written"
    )
    refuse: dict[str, Text] = Field(default={}, description="forms of statements that are refused, and why")
    statements: list[StatementTable] = Field(description="tables [[statements]], tried in their order")


def load_described(path: PathLike, read: Reader = read_bytes) -> Dialect:
    """The dialect in a file. Raises InputError, and ConfigError with all problems of the file."""
    values, lines = read_toml(read(path), str(path))
    if values.get("schema") == "olp-points-1":
        return with_layout(validate(PointProfile, values, lines, str(path)).layout)
    file = validate(DialectFile, values, lines, str(path))
    problems: list[Problem] = []

    def formed(text: str, key: tuple[str | int, ...]) -> Form | None:
        try:
            return form(text, ignore_case=file.ignore_case)
        except ConfigError as error:
            problems.append((line_of(key, lines), error.message))
            return None

    rules: list[Rule] = []
    for index, table in enumerate(file.statements):
        made = formed(table.form, ("statements", index, "form"))
        if made is None:
            continue
        wrong = _problem(table, made)
        if wrong is not None:
            problems.append((line_of(("statements", index), lines), f'the form "{table.form}" {wrong}'))
        rules.append(Rule(
            made, table.does, table.why or "", table.inside, table.enters, table.frame, table.unit,
            table.speed_unit, table.incremental,
        ))  # fmt: skip
    for text, why in file.refuse.items():
        made = formed(text, ("refuse", text))
        if made is not None:
            rules.append(Rule(made, "refuse", why))
    for index, text in enumerate(file.carry):
        made = formed(text, ("carry", index))
        if made is not None:
            rules.append(Rule(made, "carry"))
    label = formed(file.label, ("label",)) if file.label else None
    if len(file.stamp) not in (0, 2) or (not file.stamp and not file.comments):
        problems.append((line_of(("stamp",), lines), 'stamp needs two marks, such as ["; ", ""]'))
    if problems:
        raise config_error(problems, str(path))
    stamp = file.stamp or [file.comments[0] + " ", ""]
    return UserDialect(
        name=file.name, title=file.title, path_mode=file.path_mode, reader=read_described,
        about=file.about or "",
        comment=(stamp[0].encode(), stamp[1].encode()), statements=tuple(rules), unit=file.unit,
        speed_unit=file.speed_unit,
        comments=tuple(file.comments), quote=file.quote, continuation=file.continuation,
        terminator=file.terminator, label=re.compile(label.pattern) if label else None,
        ignore_case=file.ignore_case, by_word=_by_word(rules),
    )  # fmt: skip


def described(name: str, path: PathLike | None = None, read: Reader = read_bytes) -> Dialect | None:
    """The dialect of a name, where a file describes it: a dialect that comes with `olp`, or a path. `path` is
    where the file is read from instead. None for other names. Raises InputError."""
    if name in SHIPPED:
        # a part of olp itself, and no input of a run
        return load_described(FOLDER / f"{name}.toml", read_bytes)
    return load_described(path or name, read) if name.endswith(".toml") else None


def _problem(table: StatementTable, made: Form) -> str | None:
    """What is missing in a form for what the statement does."""
    position = {"x", "y", "z"} & made.fields
    if table.does in ("line", "rapid") and not position and "target" not in made.fields:
        return "moves, but has neither fields {x}, {y}, {z} nor {target}"
    if table.does == "point" and ("target" not in made.fields or position != {"x", "y", "z"}):
        return "defines a position; expected the fields {target}, {x}, {y} and {z}"
    if table.does == "tool" and "tool" not in made.fields:
        return "selects a tool; expected the field {tool}"
    if table.does == "unit" and table.unit is None:
        return 'sets the unit; expected the key unit, such as unit = "inch"'
    if table.does == "section" and table.enters is None:
        return 'begins a section; expected the key enters, "" for the section at the start'
    return None


def _by_word(rules: list[Rule]) -> dict[str, tuple[Rule, ...]]:
    """Rules by the first word of their forms, in their order. Rules that may begin with any word are under
    every word."""
    words = {rule.form.first for rule in rules}
    return {word: tuple(r for r in rules if r.form.first in ("", word)) for word in words | {""}}
