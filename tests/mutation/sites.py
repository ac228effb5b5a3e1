"""The changes of the code that may be drawn, made by the operators of mutmut.

A site is a node of the syntax tree that mutmut changes. Every site is as likely as any other, and one of its
changes is drawn. Not drawn, because no test should notice them: annotations and aliases of types, decorators,
imports, docstrings, `__all__`, text in a `raise`, and sentences (text with two words side by side), also
where a call would lose its sentence. Not drawn either: None in place of a value, as the first call ends in
a TypeError, and that would flatter the figure.
"""

from __future__ import annotations

import functools
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import libcst as cst
import libcst.matchers as m
from libcst.metadata import MetadataWrapper, PositionProvider
from mutmut.mutation.mutators import mutation_operators

#: Rooms that are drawn as a whole.
ROOMS = ("program", "errormodel", "compensation", "proof")
#: What escapes the text of reports and pages: file to its functions.
ESCAPING = {
    "olp/review/page.py": {"page", "as_json", "_script"},
    "olp/reports/document.py": {"_text", "_html", "_mark", "_markdown"},
    "olp/reports/handbook_site.py": {"_title", "_page"},
}
_SENTENCE = re.compile(r"[A-Za-z]{2,}[,:;.]? \S")
_STRING = m.SimpleString() | m.ConcatenatedString() | m.FormattedString()
#: Names whose calls or subscripts at the top of a module say something to the type checker only.
_TYPES = {
    "TypeVar",
    "NewType",
    "ParamSpec",
    "Callable",
    "Literal",
    "dict",
    "tuple",
    "list",
    "Mapping",
    "Sequence",
}


@dataclass(frozen=True, slots=True)
class Site:
    """Where a node stands: `path` relative to the checkout, `number` of the node among the sites of its file,
    lines of its statement and of the function around it (both None: run by the import)."""

    path: str
    number: int
    line: int
    statement: tuple[int, int]
    function: tuple[int, int] | None
    changes: int


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: the lines before and after it, and the whole text of the changed file."""

    site: Site
    before: str
    after: str
    text: str

    @property
    def room(self) -> str:
        return "escaping" if self.site.path in ESCAPING else self.site.path.split("/")[1]


class _Sites(cst.CSTVisitor):
    """Collects (node, changed nodes, statement, function) of one module."""

    METADATA_DEPENDENCIES = (PositionProvider,)

    def __init__(self, functions: set[str] | None) -> None:
        super().__init__()
        self.functions = functions
        self.found: list[tuple[cst.CSTNode, list[cst.CSTNode], cst.CSTNode | None, cst.CSTNode | None]] = []
        self.statements: list[cst.CSTNode] = []
        self.defined: list[cst.FunctionDef] = []
        self.bodies: list[cst.CSTNode] = []
        self.raising = 0

    def on_visit(self, node: cst.CSTNode) -> bool:
        if _not_drawn(node, top=not self.defined) or (self.raising and m.matches(node, _STRING)):
            return False
        if isinstance(node, cst.FunctionDef):
            self.defined.append(node)
        if isinstance(node, cst.BaseSuite) and self.defined and node is self.defined[-1].body:
            self.bodies.append(self.defined[-1])
        if isinstance(node, cst.BaseSmallStatement | cst.BaseCompoundStatement):
            self.statements.append(node)
        self.raising += isinstance(node, cst.Raise)
        named = self.functions is None or bool(self.defined and self.defined[0].name.value in self.functions)
        changed = [new for new in _changed(node) if not _loses_a_sentence(node, new)] if named else []
        if changed:
            statement = self.statements[-1] if self.statements else None
            self.found.append((node, changed, statement, self.bodies[-1] if self.bodies else None))
        return True

    def on_leave(self, node: cst.CSTNode) -> None:
        self.raising -= isinstance(node, cst.Raise)
        if self.statements and self.statements[-1] is node:
            self.statements.pop()
        if self.defined and self.defined[-1] is node:
            self.defined.pop()
        if self.bodies and self.bodies[-1].body is node:  # type: ignore[attr-defined]
            self.bodies.pop()


def _changed(node: cst.CSTNode) -> Iterator[cst.CSTNode]:
    for kind, operator in mutation_operators:
        if isinstance(node, kind):
            yield from (new for new in operator(node) if not _is_none_for_a_value(node, new))


def _is_none_for_a_value(node: cst.CSTNode, changed: cst.CSTNode) -> bool:
    if isinstance(changed, cst.Assign | cst.AnnAssign):
        return changed.value is not None and m.matches(changed.value, m.Name("None"))
    if isinstance(changed, cst.Lambda):
        return m.matches(changed.body, m.Name("None"))
    if not (isinstance(node, cst.Call) and isinstance(changed, cst.Call)):
        return False
    pairs = zip(node.args, changed.args, strict=False)
    return len(node.args) == len(changed.args) and any(
        a is not b and m.matches(b.value, m.Name("None")) for a, b in pairs
    )


def _not_drawn(node: cst.CSTNode, *, top: bool) -> bool:
    if isinstance(node, cst.Annotation | cst.Decorator | cst.Import | cst.ImportFrom):
        return True
    if isinstance(node, cst.Expr) and m.matches(node.value, _STRING):
        return True
    if isinstance(node, cst.If) and m.matches(node.test, m.Name("TYPE_CHECKING")):
        return True
    if isinstance(node, cst.Arg) and m.matches(node.keyword, m.Name("description")):
        return True
    if m.matches(node, _STRING):
        return bool(_SENTENCE.search(_text(node)))
    return top and isinstance(node, cst.Assign) and _for_types(node)


def _for_types(node: cst.Assign) -> bool:
    target, value = node.targets[0].target, node.value
    if m.matches(target, m.Name("__all__")):
        return True
    name = (
        value.func
        if isinstance(value, cst.Call)
        else value.value
        if isinstance(value, cst.Subscript)
        else None
    )
    return (
        isinstance(name, cst.Name) and name.value in _TYPES and not m.matches(value, m.Call(m.Name("dict")))
    )


def _text(node: cst.CSTNode) -> str:
    """The fixed text of a string, its parts in one."""
    return " ".join(
        str(part.value) for part in m.findall(node, m.SimpleString() | m.FormattedStringText())
    ).replace("\\n", " ")


def _loses_a_sentence(node: cst.CSTNode, changed: cst.CSTNode) -> bool:
    if not (isinstance(node, cst.Call) and isinstance(changed, cst.Call)):
        return False
    lost = [arg for arg in node.args if not any(arg is other for other in changed.args)]
    return any(
        m.matches(arg.keyword, m.Name("description"))
        or (m.matches(arg.value, _STRING) and _SENTENCE.search(_text(arg.value)))
        for arg in lost
    )


@functools.cache
def _visited(root: Path, path: str) -> tuple[MetadataWrapper, _Sites]:
    wrapper = MetadataWrapper(cst.parse_module((root / path).read_text("utf-8")), unsafe_skip_copy=True)
    sites = _Sites(ESCAPING.get(path))
    wrapper.visit(sites)
    return wrapper, sites


def files(root: Path) -> list[str]:
    """Files that are drawn from, relative to the checkout `root`."""
    modules = [path for room in ROOMS for path in sorted((root / "olp" / room).rglob("*.py"))]
    return [path.relative_to(root).as_posix() for path in modules] + list(ESCAPING)


def sites(root: Path, path: str) -> list[Site]:
    """All sites of one file, in the order of its text."""
    wrapper, visitor = _visited(root, path)
    positions = wrapper.resolve(PositionProvider)

    def lines(node: cst.CSTNode) -> tuple[int, int]:
        held = positions[node]
        return held.start.line, held.end.line

    listed = []
    for number, (node, changed, statement, function) in enumerate(visitor.found):
        own = lines(node)
        simple = isinstance(statement, cst.BaseSmallStatement)
        span = lines(statement) if simple and statement is not None else own
        listed.append(
            Site(path, number, own[0], span, None if function is None else lines(function), len(changed))
        )
    return listed


def mutant(root: Path, site: Site, change: int) -> Mutant:
    """The file with the given change of a site made."""
    wrapper, visitor = _visited(root, site.path)
    node, changed, _, _ = visitor.found[site.number]
    module = wrapper.module
    text = module.deep_replace(node, changed[change]).code  # type: ignore[union-attr]
    old, new = module.code.splitlines(), text.splitlines()
    head = next(
        (i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), min(len(old), len(new))
    )
    tail = 0
    while tail < min(len(old), len(new)) - head and old[-1 - tail] == new[-1 - tail]:
        tail += 1
    before, after = (" ".join(line.strip() for line in text[head : len(text) - tail]) for text in (old, new))
    return Mutant(site, before, after, text)


def drawn(root: Path, count: int, seed: int, only: str = "") -> list[tuple[Site, int]]:
    """`count` different sites in files whose path contains `only`, and which of its changes each has, in the
    order of the draw."""
    listed = [site for path in files(root) if only in path for site in sites(root, path)]
    generator = random.Random(seed)
    chosen = generator.sample(listed, min(count, len(listed)))
    return [(site, generator.randrange(site.changes)) for site in chosen]
