"""An option of several verbs is defined in one place."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from click.testing import CliRunner

import olp
from olp.cli import main

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


RENAMED = {
    ("correct", "--within-um", "5"): "--part-tolerance-um",
    ("verify", "--within-um", "5"): "--part-tolerance-um",
    ("check", "--within-um", "5"): "--part-tolerance-um",
    ("view", "--within-um", "5"): "--part-tolerance-um",
    ("compare", "--tolerance-um", "5"): "--part-tolerance-um",
    ("correct", "--results"): "the verb olp results",
    ("correct", "--frame", "G54"): "an option of olp results",
    ("correct", "--tool", "1"): "an option of olp results",
    ("correct", "--tip-radius-mm", "1"): "an option of olp results",
    ("correct", "--decimals", "4"): "an option of olp results",
    ("calibrate doctor", "--tool", "0", "0", "-50"): "--reflector",
    ("calibrate refine", "--tool", "0", "0", "-50"): "--reflector",
    ("calibrate squareness", "--frame", "C0Y=140.4,142.8,99.8"): "--drawn-frame",
}


@pytest.mark.parametrize("words", RENAMED, ids=" ".join)
def test_a_renamed_option_names_the_new_one(words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(main, [*words[0].split(), *words[1:]])
    assert result.exit_code == 2
    assert f"{words[1]} is now {RENAMED[words]}." in result.output


@pytest.mark.parametrize("verb", ("correct", "retime", "results", "compare", "calibrate fit"))
def test_a_report_of_an_unknown_form_is_refused_before_anything_is_read(verb: str) -> None:
    result = CliRunner().invoke(main, [*verb.split(), "absent.ngc", "--report", "report.pdf"])
    assert result.exit_code == 2
    assert "report.pdf: is not a form of this report; expected " in str(result.exception) + result.output
