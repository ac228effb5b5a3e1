"""Constants stand one a line, and no sentence is broken into single words."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest
from cases.fast import in_each
from house.trees import parsed

import olp

PACKAGE = Path(olp.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
#: A piece of a broken string that is not its last has at least so many words.
LEAST_WORDS = 3
_BETWEEN = (tokenize.NL, tokenize.COMMENT)


def several_in_a_line(tree: ast.Module) -> Iterator[int]:
    """Lines that assign several constants at once; in a class, all names are constants."""
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    for parent in (tree, *classes):
        for node in parent.body:
            if isinstance(node, ast.Assign):
                assigned = (n for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name))
                names = [n.id for n in assigned if isinstance(n.ctx, ast.Store)]
                if sum(name.isupper() or parent is not tree for name in names) > 1:
                    yield node.lineno


def tokens(source: str) -> Iterator[tokenize.TokenInfo]:
    """The tokens of a text, with an f-string as one string: from Python 3.12 on it has tokens of its own."""
    begins, ends = getattr(tokenize, "FSTRING_START", None), getattr(tokenize, "FSTRING_END", None)
    lines = source.splitlines(keepends=True)
    opened: list[tokenize.TokenInfo] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == begins:
            opened.append(token)
        elif token.type == ends:
            first = opened.pop()
            if not opened:
                text = "".join(lines[first.start[0] - 1 : token.end[0]])[first.start[1] :]
                text = text[: len(text) - len(lines[token.end[0] - 1]) + token.end[1]]
                yield tokenize.TokenInfo(tokenize.STRING, text, first.start, token.end, first.line)
        elif not opened:
            yield token


def broken_strings(source: str) -> Iterator[int]:
    """Lines of a piece of a sentence that a formatter left with a word or two."""
    held: tokenize.TokenInfo | None = None
    for token in tokens(source):
        if token.type == tokenize.STRING and "r" not in token.string.split(token.string[-1])[0].lower():
            if held is not None and held.start[0] != token.start[0]:
                text = held.string.strip("rbfRBF\"'")
                if len(text.split()) < LEAST_WORDS and not text.endswith(("\\n", "}")) and " " in text:
                    yield held.start[0]
            held = token
        elif token.type not in _BETWEEN:
            held = None


@pytest.mark.slow
@in_each(MODULES, lambda path: path.relative_to(PACKAGE).as_posix())
def test_a_constant_stands_on_a_line_of_its_own(path: Path) -> None:
    assert list(several_in_a_line(parsed(path))) == []


@pytest.mark.slow
@in_each(MODULES, lambda path: path.relative_to(PACKAGE).as_posix())
def test_no_sentence_is_broken_into_single_words(path: Path) -> None:
    assert list(broken_strings(path.read_text("utf-8"))) == []


def test_what_they_refuse() -> None:
    assert list(several_in_a_line(ast.parse("A, B = 1, 2\n"))) == [1]
    assert list(several_in_a_line(ast.parse("a, b = 1, 2\n"))) == []
    assert list(several_in_a_line(ast.parse("A[[1, B]] = 1\n"))) == []
    of_class = "class C:\n    a, b = 1, 2\n    c = d = 3\n    e = 4\n"
    assert list(several_in_a_line(ast.parse(of_class))) == [2, 3]
    assert list(broken_strings('x = (\n    "the path of a file, "\n    "a "\n    "b"\n)\n')) == [3]
    formatted = 'x = (\n    f"the {path} of a file, "\n    f"{a} b "\n    f"c {d}"\n)\n'
    assert list(broken_strings(formatted)) == [3]
    (whole,) = (t for t in tokens("x = f'''{a:{b}}\n c'''\n") if t.type == tokenize.STRING)
    assert whole.string == "f'''{a:{b}}\n c'''"
