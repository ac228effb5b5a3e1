"""An option of several verbs is defined in one place."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import olp

FOLDER = Path(olp.__file__).parent / "cli"
SHARED = FOLDER / "options.py"


def options_in(source: str) -> set[str]:
    """The long names of the options that a text defines."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    named = (call.args for call in calls if ast.unparse(call.func) == "click.option")
    return {
        argument.value
        for arguments in named
        for argument in arguments
        if isinstance(argument, ast.Constant) and str(argument.value).startswith("--")
    }


SHARED_OPTIONS = options_in(SHARED.read_text("utf-8")) | {"--date"}


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.name)
def test_a_shared_option_is_defined_once(path: Path) -> None:
    defined = set() if path == SHARED else options_in(path.read_text("utf-8")) & SHARED_OPTIONS
    assert defined == set()


def test_a_second_definition_is_seen() -> None:
    assert options_in('@click.option("-f", "--force", is_flag=True)\ndef f(): ...') & SHARED_OPTIONS
    assert len(SHARED_OPTIONS) > 15
