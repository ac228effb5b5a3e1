"""Sentences of the papers and of the messages in the code, and the words that neither may use.

python tests/docs/prose.py [FILE...]     # what is too long in these files; in all without FILE
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Words of a sentence, at most.
LONGEST = 35
#: Words of a sentence in the mean, at most.
MEAN = 20


@dataclass(frozen=True)
class Sentence:
    """A sentence, and the line of the file where its paragraph begins."""

    path: Path
    line: int
    text: str

    @property
    def words(self) -> int:
        return len(self.text.split())


def papers() -> list[Path]:
    return [ROOT / "README.md", *sorted((ROOT / "olp" / "docs").rglob("*.md"))]


def modules() -> list[Path]:
    return sorted((ROOT / "olp").rglob("*.py"))


def of_paper(path: Path) -> Iterator[Sentence]:
    """Sentences of a page in Markdown: of paragraphs, items and cells, without code and headings."""
    for line, block in _blocks(path.read_text("utf-8")):
        yield from split(path, line, block)


def of_module(path: Path) -> Iterator[Sentence]:
    """Sentences of the strings of a module that a person may read: those of four words or more."""
    for node in ast.walk(_joined(ast.parse(path.read_text("utf-8")))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value.split()) > 3:
            for line, paragraph in _paragraphs(node.value):
                yield from split(path, node.lineno + line, paragraph)


def _paragraphs(text: str) -> Iterator[tuple[int, str]]:
    """Paragraphs and items of a string with the number of their first line; no formulas, markup or styles."""
    if re.search(r"</\w+>|\{[^}]*:[^}]*;", text):
        return
    lines = text.splitlines()
    body = min((len(row) - len(row.lstrip()) for row in lines[1:] if row.strip()), default=0)
    held, start = list[str](), 0
    for number, row in enumerate([*lines, ""]):
        bare = row.strip()
        formula = number > 0 and len(row) - len(row.lstrip()) >= body + 4
        if held and (not bare or formula or re.match(r"[-*] ", bare)):
            yield start, " ".join(held)
            held = []
        if bare and not formula:
            start = start if held else number
            held.append(re.sub(r"^[-*] ", "", bare))


def split(path: Path, line: int, text: str) -> Iterator[Sentence]:
    """The sentences of a paragraph; a colon before a list and a full stop inside a word end none."""
    bare = re.sub(r"`[^`]*`", "CODE", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text))
    for part in re.split(r"(?<=[.!?])[)\"*]*\s+(?=[A-Z0-9\"(*`])", bare):
        if part.strip():
            yield Sentence(path, line, part.strip())


def _blocks(text: str) -> Iterator[tuple[int, str]]:
    """Paragraphs, items and cells, each with the number of its first line."""
    fenced, held, start = False, list[str](), 0
    for number, line in enumerate([*text.splitlines(), ""], 1):
        bare = line.strip()
        fence = bare.startswith("```")
        ends = fenced or fence or not bare or bare[0] in "#|" or re.match(r"[-*] |\d+\. ", bare)
        if ends and held:
            yield start, " ".join(held)
            held = []
        if fence:
            fenced = not fenced
        elif fenced or not bare or bare.startswith("#") or re.fullmatch(r"[|:\- ]+", bare):
            continue
        elif bare.startswith("|"):
            yield from ((number, cell.strip()) for cell in bare.strip("|").split("|"))
        else:
            start = start if held else number
            held.append(re.sub(r"^([-*]|\d+\.) ", "", bare))


def _joined(tree: ast.Module) -> ast.Module:
    """f-strings as strings, with a word for each value."""

    class Join(ast.NodeTransformer):
        def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
            parts = (str(v.value) if isinstance(v, ast.Constant) else "VALUE" for v in node.values)
            return ast.copy_location(ast.Constant("".join(parts)), node)

    return Join().visit(tree)


def sentences(path: Path) -> list[Sentence]:
    return list(of_paper(path) if path.suffix == ".md" else of_module(path))


def main(names: list[str]) -> None:
    paths = [Path(name).resolve() for name in names] or [*papers(), *modules()]
    count = total = 0
    for path in paths:
        for sentence in sentences(path):
            count, total = count + 1, total + sentence.words
            if sentence.words > LONGEST:
                where = f"{path.relative_to(ROOT)}:{sentence.line}"
                sys.stdout.write(f"{where}: {sentence.words} words: {sentence.text}\n")
    sys.stdout.write(f"{count} sentences, {total / max(count, 1):.1f} words in the mean\n")


if __name__ == "__main__":
    main(sys.argv[1:])
