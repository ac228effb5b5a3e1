"""The rooms of the house: one direction of imports, no circles, and the page that is generated from them."""

from __future__ import annotations

import ast
import graphlib
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from cases.fast import in_each
from house.trees import nodes, parsed
from house.write_page import PAGE, WHERE, page, purpose

import olp

PACKAGE = Path(olp.__file__).parent
#: The rooms of the house, the lowest first: a room imports only from rooms above it in this list.
ROOMS = (
    *("core", "kinematics", "findings", "program", "errormodel", "compensation", "proof", "clearance"),
    *("checks", "trajectory", "calibration", "comparison", "uncertainty", "results", "files", "reports"),
    *("workflows", "review", "cli"),
)
ROW = {name: row for row, name in enumerate(ROOMS)}
FRONT = {"__init__", "__main__"}
MODULES = sorted(PACKAGE.rglob("*.py"))


def top(path: Path) -> str:
    """The module or package directly below `olp` that a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and name of everything of ours that a module imports, also inside functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = [f"{node.module}.{a.name}" for a in node.names] if node.module == "olp" else [node.module]
        elif isinstance(node, ast.ImportFrom):
            names = ["olp.(relative)"]
        else:
            continue
        yield from ((node.lineno, name) for name in names if name.split(".")[0] == "olp")


def violations(own: str, tree: ast.Module) -> list[str]:
    forbidden = []
    for line, name in imported(tree):
        other = [*name.split("."), "__init__"][1]
        if other == own or (other in ROW and ROW[other] < ROW[own]):
            continue
        forbidden.append(f"line {line}: {own} (row {ROW[own]}) imports {name}")
    return forbidden


def test_every_room_is_in_the_list_and_nothing_lies_loose() -> None:
    assert {top(path) for path in MODULES} - FRONT == ROW.keys()
    assert {path.stem for path in PACKAGE.glob("*.py")} == FRONT


@pytest.mark.slow
def test_the_page_of_the_house_is_the_house() -> None:
    """Stale: run python tests/house/write_page.py."""
    assert PAGE.read_text("utf-8") == page(ROOMS)
    assert [path for path in WHERE.values() if not (PACKAGE / path).is_file()] == []


@pytest.mark.slow
@in_each(MODULES, lambda path: path.relative_to(PACKAGE).as_posix())
def test_every_module_says_what_it_holds(path: Path) -> None:
    assert purpose(path)


def files_imported(modules: Mapping[str, ast.Module]) -> dict[str, set[str]]:
    """Module to the modules that its text imports, also for types and in functions; packages do not count."""
    graph: dict[str, set[str]] = {}
    for name, tree in modules.items():
        graph[name] = set()
        for node in ast.walk(tree):
            wanted = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module:
                wanted = [f"{node.module}.{alias.name}" for alias in node.names] + [node.module]
            graph[name] |= {other for other in wanted if other in modules and other != name}
    return graph


@pytest.mark.slow
def test_there_is_no_circle_of_files() -> None:
    modules = {
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): parsed(path)
        for path in MODULES
        if path.name != "__init__.py"
    }
    graphlib.TopologicalSorter(files_imported(modules)).prepare()


def test_a_circle_would_be_found() -> None:
    texts = {"olp.a": "def late():\n    from olp import b", "olp.b": "from olp.c import x"}
    texts |= {"olp.c": "import olp.a"}
    modules = {name: ast.parse(text) for name, text in texts.items()}
    with pytest.raises(graphlib.CycleError):
        graphlib.TopologicalSorter(files_imported(modules)).prepare()


@pytest.mark.slow
@in_each(MODULES, lambda path: path.relative_to(PACKAGE).as_posix())
def test_imports_go_one_way(path: Path) -> None:
    if top(path) not in FRONT:
        assert violations(top(path), parsed(path)) == []


WRONG = ("from olp.cli import main", "import olp.proof.deviation", "from olp import cli", "from . import x")
RIGHT = ("from olp.core.units import AXES", "import olp.program.registry")


@pytest.mark.parametrize("line", WRONG)
def test_an_import_the_wrong_way_is_found(line: str) -> None:
    assert len(violations("errormodel", ast.parse(f"def late():\n    {line}\n"))) == 1


@pytest.mark.parametrize("line", RIGHT)
def test_an_import_the_right_way_is_free(line: str) -> None:
    assert violations("errormodel", ast.parse(line)) == []


#: Libraries that are imported inside functions only, and those of them that one layer alone may use.
ONLY_IN = {"ruckig": "trajectory", "meshcat": "review"}
LATE = {"scipy", "matplotlib", "trimesh", "rich", *ONLY_IN}
#: A package that is imported late as a whole (tests/house/test_public_names.py), and what it may import
#: at once.
LATE_ITSELF = {"trajectory": {"ruckig", "scipy"}}
OPENERS = {"open", "read_bytes", "read_text", "write_bytes", "write_text"}


@pytest.mark.slow
@in_each(MODULES, lambda path: path.relative_to(PACKAGE).as_posix())
def test_large_libraries_are_imported_late_and_files_opened_in_one_layer(path: Path) -> None:
    tree = parsed(path)
    outer = (*tree.body, *(n for c in tree.body if isinstance(c, ast.ClassDef) for n in c.body))
    inside = {id(n) for f in outer if isinstance(f, ast.FunctionDef) for n in ast.walk(f)}
    for node in nodes(path):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        for library in {name.split(".")[0] for name in names} & LATE:
            assert ONLY_IN.get(library, top(path)) == top(path), f"line {node.lineno}: {library}"
            late = id(node) in inside or library in LATE_ITSELF.get(top(path), set())
            assert late or _for_types(tree, node), f"line {node.lineno}: {library}"
        if isinstance(node, ast.Call) and top(path) not in ("files", "cli"):
            function = node.func
            builtin = isinstance(function, ast.Name) and function.id == "open"
            method = isinstance(function, ast.Attribute) and function.attr in OPENERS
            assert not (builtin or method), f"line {node.lineno}: only olp.files opens files"


def _for_types(tree: ast.Module, node: ast.AST) -> bool:
    """The import stands under `if TYPE_CHECKING:`."""
    blocks = [n for n in ast.walk(tree) if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]
    return any(node is inner for block in blocks for inner in ast.walk(block))


def test_what_moved_is_where_the_page_says() -> None:
    rows = re.findall(r"^\| `(\S+)` \| `(\S+)` \|$", PAGE.with_name("moved.md").read_text("utf-8"), re.M)
    assert len(rows) > 250
    beside = {"olp": PACKAGE.parent, "tests": PAGE.parents[3]}
    assert [new for _, new in rows if not (beside[new.split("/")[0]] / new).is_file()] == []
