"""Groups of verbs whose modules are imported when they are called."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import click

#: The verb that a call without one most likely means.
_FIRST = "correct"


class LateGroup(click.Group):
    """`verbs` maps a verb to what it does; its module (`module` with the verb put in) holds `command`."""

    def __init__(self, verbs: Mapping[str, str], module: str, **settings: Any) -> None:
        super().__init__(**settings)
        self._verbs = verbs
        self._module = module

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self._verbs)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in self._verbs:
            return None
        module = importlib.import_module(self._module.format(name.replace("-", "_")))
        command: click.Command = module.command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in self._verbs and not name.startswith("-"):
            import difflib

            near = difflib.get_close_matches(name, self._verbs, 1)
            hint = f"did you mean {near[0]}?" if near else f"see {ctx.command_path} --help"
            if _FIRST in self._verbs and PurePath(name).suffix:
                hint = f"name the verb before the file, such as {ctx.command_path} {_FIRST} {name}"
            ctx.fail(f"there is no verb {name!r}; {hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl(list(self._verbs.items()))
