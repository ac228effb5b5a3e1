"""Constants stand one a line, and no sentence is broken into single words."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

import olp

PACKAGE = Path(olp.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
#: A piece of a broken string that is not its last has at least so many words.
LEAST_WORDS = 3
_BETWEEN = (tokenize.NL, tokenize.COMMENT)


def several_in_a_line(tree: ast.Module) -> Iterator[int]:
    """Lines that assign several constants at once."""
    for node in tree.body:
        if isinstance(node, ast.Assign):
            names = [n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)]
            if len([name for name in names if name.isupper()]) > 1:
                yield node.lineno


def broken_strings(source: str) -> Iterator[int]:
    """Lines of a piece of a sentence that a formatter left with a word or two."""
    held: tokenize.TokenInfo | None = None
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.STRING and "r" not in token.string.split(token.string[-1])[0].lower():
            if held is not None and held.start[0] != token.start[0]:
                text = held.string.strip("rbfRBF\"'")
                if len(text.split()) < LEAST_WORDS and not text.endswith(("\\n", "}")) and " " in text:
                    yield held.start[0]
            held = token
        elif token.type not in _BETWEEN:
            held = None


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_a_constant_stands_on_a_line_of_its_own(path: Path) -> None:
    assert list(several_in_a_line(ast.parse(path.read_text("utf-8")))) == []


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_no_sentence_is_broken_into_single_words(path: Path) -> None:
    assert list(broken_strings(path.read_text("utf-8"))) == []


def test_what_they_refuse() -> None:
    assert list(several_in_a_line(ast.parse("A, B = 1, 2\n"))) == [1]
    assert list(broken_strings('x = (\n    "the path of a file, "\n    "a "\n    "b"\n)\n')) == [3]
