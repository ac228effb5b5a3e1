"""Nothing outside the registry and the files of the dialects decides by the name of a dialect."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from cases.fast import in_each

import olp
from olp.program import registry

PACKAGE = Path(olp.__file__).parent
#: Words that once stood for groups of dialects.
FAMILIES = {"rs274", "described"}
NAMES = {*registry.DIALECTS, *registry.DESCRIBED, *FAMILIES}
#: Attributes that hold the name of a dialect, and values whose `name` is one.
HOLDS_A_NAME = {"controller", "dialect", "family"}
HAS_A_NAME = {"dialect", "profile", "control", "control_of"}
TABLES = {"DIALECTS", "PROFILES", "REGISTERED", "READERS"}
DEFINES = {Path(str(import_module(known.module).__file__)) for known in registry._KNOWN.values()}
FREE = DEFINES | {Path(str(registry.__file__))}
FILES = sorted(set(PACKAGE.rglob("*.py")) - FREE)


def _texts(node: ast.AST) -> Iterator[object]:
    """The constants that a value is or holds, also those of the other case of letters."""
    if isinstance(node, ast.Constant):
        yield node.value.lower() if isinstance(node.value, str) else node.value
    elif isinstance(node, ast.Tuple | ast.List | ast.Set):
        for item in node.elts:
            yield from _texts(item)
    elif isinstance(node, ast.Dict):
        for key in node.keys:
            if key is not None:
                yield from _texts(key)
    elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("set", "frozenset", "tuple", "dict"):
        for item in node.args:
            yield from _texts(item)


def _last(node: ast.AST) -> str:
    """The last name of `a.b.c`, of `c` and of a call of them."""
    if isinstance(node, ast.Call):
        return _last(node.func)
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def _is_name(node: ast.AST) -> bool:
    """Whether a value is, by its own name, the name of a dialect: `machine.controller`, `profile.name`."""
    if not isinstance(node, ast.Attribute):
        return False
    return node.attr in HOLDS_A_NAME - {"dialect"} or (
        node.attr == "name" and _last(node.value) in HAS_A_NAME
    )


def _asks(node: ast.AST) -> bool:
    """Whether a node of a program text decides by the name of a dialect."""
    if isinstance(node, ast.Compare):
        sides = [node.left, *node.comparators]
        none = any(isinstance(side, ast.Constant) and side.value is None for side in sides)
        return any(text in NAMES for side in sides for text in _texts(side)) or (
            not none and any(_is_name(side) for side in sides)
        )
    if isinstance(node, ast.Dict):
        return any(text in NAMES for key in node.keys if key is not None for text in _texts(key))
    if isinstance(node, ast.Match):
        patterns = [p for case in node.cases for p in ast.walk(case.pattern)]
        values = [p.value for p in patterns if isinstance(p, ast.MatchValue)]
        return _is_name(node.subject) or any(text in NAMES for v in values for text in _texts(v))
    if isinstance(node, ast.Subscript):
        return _last(node.value) in TABLES or any(text in NAMES for text in _texts(node.slice))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        own = node.func.attr
        if own == "get" and _last(node.func.value) in TABLES:
            return True
        if own in ("get", "startswith", "endswith", "fullmatch", "match", "__eq__"):
            return any(text in NAMES for a in node.args for text in _texts(a)) or (
                own != "get" and _is_name(node.func.value)
            )
    return (
        isinstance(node, ast.Call)
        and _last(node.func) in ("find", "named")
        and any(text in NAMES for a in node.args for text in _texts(a))
    )


def questions(source: str) -> list[int]:
    """The lines of a text that decide by the name of a dialect."""
    return sorted({node.lineno for node in ast.walk(ast.parse(source)) if _asks(node)})  # type: ignore[attr-defined]


@pytest.mark.slow
@in_each(FILES, lambda path: path.relative_to(PACKAGE).as_posix())
def test_no_name_of_a_dialect_decides(path: Path) -> None:
    assert questions(path.read_text("utf-8")) == []


PLANTED = (
    'if dialect.name == "linuxcnc": pass',
    'if "linuxcnc" != x: pass',
    'like = "fanuc" == profile',
    'if name in ("fanuc", "haas"): pass',
    'if name not in {"grbl"}: pass',
    'if name in frozenset(["apt"]): pass',
    'if "dmis" in (a, b): pass',
    'if kind == "rs274": pass',
    'if name == "kawasaki-as": pass',
    'if name.lower() == "APT": pass',
    "x = 1 if machine.controller == own else 2",
    "x = program.dialect.name in chosen",
    "same = control_of(setup).name == other",
    'match name:\n    case "haas": pass',
    'match name:\n    case "x" | "list": pass',
    "match profile.name:\n    case _: pass",
    'LEVELS = {"linuxcnc": 1, "fanuc": 2}',
    'x = TABLE["grbl"]',
    "x = DIALECTS[name]",
    "x = DIALECTS.get(name)",
    'x = table.get("dmis", 0)',
    'if name.startswith("linuxcnc"): pass',
    "if profile.name.startswith(x): pass",
    'x = find("apt")',
    'x = registry.named("apt")',
    "def late():\n    return [d for d in all_ if d.family == mine]",
)
INNOCENT = (
    'machine(controller="linuxcnc")',
    "if profile.g10_adds: pass",
    'report = {"dialect": dialect.name}',
    'if what == "lines": pass',
    "dialect = find(setup.machine.controller)",
    "if setup.job.dialect is None: pass",
    'title = f"{dialect.name}: {machine.controller}"',
    'format_ = Format("linuxcnc", "LinuxCNC")',
    "if isinstance(dialect, Profile): pass",
)


@pytest.mark.parametrize("line", PLANTED)
def test_a_question_for_a_name_is_found(line: str) -> None:
    assert questions(line)


@pytest.mark.parametrize("line", INNOCENT)
def test_what_asks_for_no_name_is_free(line: str) -> None:
    assert questions(line) == []


def test_the_files_that_are_free_are_those_of_the_dialects_alone() -> None:
    assert len(DEFINES) == len(registry.DIALECTS)
    assert all(path.is_relative_to(PACKAGE / "program") for path in FREE)


def test_shipped_descriptions_are_those_of_the_folder() -> None:
    folder = PACKAGE / "program" / "described" / "shipped"
    assert sorted(registry.DESCRIBED) == sorted(path.stem for path in folder.glob("*.toml"))
