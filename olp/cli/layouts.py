"""The layout of a table that a call asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import click

from olp.cli.common import STREAM, Given, files_of
from olp.core.errors import InputError, UsageError
from olp.core.spool import whole

if TYPE_CHECKING:
    from olp.files.sources import Source, Sources
    from olp.program.text.delimited import Layout

F = TypeVar("F", bound=Callable[..., Any])


def layout_options(
    profile: str, unit: str, columns: str = "Column of X, Y, Z, I, J, K, ..."
) -> Callable[[F], F]:
    """--profile, --column and --unit, with their helps: the layout of a table."""

    def add(function: F) -> F:
        units = click.Choice(["mm", "um", "m", "inch"])
        function = click.option("--unit", type=units, help=unit)(function)
        function = click.option("--column", "columns", multiple=True, metavar="X=NAME", help=columns)(
            function
        )
        return click.option("--profile", metavar="NAME|FILE", help=profile)(function)

    return add


def layout_of(
    profile: str | None, columns: tuple[str, ...], unit: str | None, table: Source, sources: Sources
) -> Layout | None:
    """The layout that a call asks for, None where it is detected from the table."""
    from olp.core.schema import copied
    from olp.files.point_profile import BUILT_IN, from_layout, load_profile, with_options
    from olp.program.text.delimited import detected_layout, first_lines

    if profile is None and not columns and unit is None:
        return None
    if profile:
        return with_options(load_profile(profile, sources.read), columns, unit=unit).layout
    layout = detected_layout(first_lines(whole(table.data)))
    if layout is None and not columns:
        raise InputError(
            "does not show which columns hold X, Y and Z; give their names with --column X=.. and so on",
            file=table.name or None,
        )
    if not columns and layout is not None:
        return replace(layout, unit=unit or layout.unit)
    start = BUILT_IN["olp"] if layout is None else from_layout(layout)
    if layout is None and all(item.partition("=")[2].isdigit() for item in columns):
        start = copied(start, header=False)
    stated = unit or (layout.unit if layout else None)
    return replace(with_options(start, columns).layout, unit=stated)


def with_layout_of(call: Given, profile: str | None, columns: tuple[str, ...], unit: str | None) -> Given:
    """A call about a list of positions, with the layout that it states; unchanged where it states none."""
    if profile is None and not columns and unit is None:
        return call
    if call.program == STREAM:
        raise UsageError("a list of positions on stdin takes its layout from --dialect FILE.toml")
    session = call.session
    layout = layout_of(profile, columns, unit, call.source, session.sources)
    assert layout is not None
    from olp.program.pointlist.dialect import with_layout

    job = replace(call.setup.job, described=with_layout(layout))
    session = session.of(replace(call.setup, job=job))
    return replace(call, session=session, inputs=(*call.inputs, *files_of(profile)))
