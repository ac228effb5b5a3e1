"""Every refusal of a program carries the code of a row that explains it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import olp
from olp.findings.catalogue import GATE_CODES, RULES

PACKAGE = Path(olp.__file__).parent
NAMES = {"ProgramError", "AlreadyCorrected"}


def refusals(source: str) -> Iterator[tuple[int, ast.expr | None]]:
    """The line of every refusal that a text makes, and the value of its `code`."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in NAMES:
            yield node.lineno, next((k.value for k in node.keywords if k.arg == "code"), None)


def codes_of(value: ast.expr | None) -> Iterator[str]:
    """The codes that the value of `code` may have; that of another refusal, or a parameter, has its own."""
    if isinstance(value, ast.IfExp):
        yield from codes_of(value.body)
        yield from codes_of(value.orelse)
    elif isinstance(value, ast.Constant):
        yield str(value.value)
    elif not isinstance(value, (ast.Attribute, ast.Name)):
        yield "none"


MODULES = [path for path in PACKAGE.rglob("*.py") if any(name in path.read_text("utf-8") for name in NAMES)]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_every_refusal_has_a_code_of_a_refusal(path: Path) -> None:
    stated = [(line, c) for line, value in refusals(path.read_text("utf-8")) for c in codes_of(value)]
    assert [(line, c) for line, c in stated if c not in RULES or RULES[c].topic != "refusal"] == []


def test_a_refusal_without_a_code_is_found() -> None:
    source = 'raise ProgramError("x", line=1)\nraise ProgramError("x", code="OLP101")\n'
    found = [c for _, value in refusals(source) for c in codes_of(value)]
    assert found == ["none", "OLP101"]
    assert RULES["OLP101"].topic != "refusal"


def test_a_gate_does_not_choose_among_refusals() -> None:
    assert not any(RULES[code].topic == "refusal" for code in GATE_CODES)
