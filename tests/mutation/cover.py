"""Which tests run which lines: built once by running the tests under coverage, one context per test."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import coverage
import pytest
from mutation.sites import Site


class Recorder:
    """A plugin of pytest: lines of `files` by test, and the seconds that each test took."""

    def __init__(self, root: Path, files: Iterable[str]) -> None:
        self.root = root
        self.files = list(files)
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self.coverage = coverage.Coverage(data_file=None, include=[str(root / path) for path in self.files])
        self.coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.coverage.switch_context(item.nodeid)
        return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.outcome != "passed":
            self.failed.add(report.nodeid)

    def write(self, path: Path) -> None:
        """Put the tests that ran into the map at `path`. Those that fail or skip on the unchanged code, and
        those of the same files that are no more, are not in it."""
        self.coverage.stop()
        data = self.coverage.get_data()
        ran = {name.split("::")[0] for name in self.seconds}
        map_ = Map.read(path, self.root) if path.is_file() else Map(self.root, {}, {}, {})
        kept = {name: s for name, s in map_.seconds.items() if name.split("::")[0] not in ran}
        good = {name: s for name, s in self.seconds.items() if name not in self.failed}
        lines: dict[str, dict[int, set[str]]] = {}
        imported: dict[str, set[int]] = {}
        for file in self.files:
            contexts = data.contexts_by_lineno(str(self.root / file))
            held = map_.lines.get(file, {})
            lines[file] = {
                line: {*held.get(line, set()) & kept.keys(), *good.keys() & set(contexts.get(line, ()))}
                for line in sorted({*held, *contexts})
            }
            # coverage has the lines before the first test under an empty name
            imported[file] = {line for line, names in contexts.items() if "" in names}
            imported[file] |= map_.imported.get(file, set())
        Map(self.root, kept | good, lines, imported).write(path)


@dataclass(frozen=True, slots=True)
class Map:
    """Seconds of each test, and for each file the tests of each line, and the lines that imports run."""

    root: Path
    seconds: dict[str, float]
    lines: dict[str, dict[int, set[str]]]
    imported: dict[str, set[int]]

    @classmethod
    def read(cls, path: Path, root: Path) -> Map:
        value: dict[str, Any] = json.loads(path.read_text("utf-8"))
        names = list(value["seconds"])
        lines = {
            file: {int(line): {names[i] for i in tests} for line, tests in held.items()}
            for file, held in value["lines"].items()
        }
        imported = {file: set(held) for file, held in value["imported"].items()}
        return cls(root, value["seconds"], lines, imported)

    def write(self, path: Path) -> None:
        number = {name: i for i, name in enumerate(self.seconds)}
        lines = {
            file: {line: sorted(number[name] for name in tests) for line, tests in held.items()}
            for file, held in self.lines.items()
        }
        imported = {file: sorted(held) for file, held in self.imported.items()}
        value = {"seconds": self.seconds, "lines": lines, "imported": imported}
        path.write_text(json.dumps(value), "utf-8")

    def tests_of(self, site: Site, at_most_s: float) -> list[str]:
        """Tests that run a site, the nearest folder first and there the fastest, `at_most_s` seconds of them.

        Code that the import runs is met by all tests of its module, or where it has none, of the modules that
        import it, and by the tests of its folder.
        """
        met: set[str] = set()
        by_import = site.function is None
        if site.function is not None:
            met = self._within(site.path, *site.statement) or self._within(site.path, site.line, site.line)
            by_import = not met and site.line in self.imported.get(site.path, set())
        if by_import:
            met = self._met_by_import(site.path)
        chosen: list[str] = []
        spent = 0.0
        for test in sorted(met, key=lambda name: (-_near(name, site.path), self.seconds[name])):
            spent += self.seconds[test]
            if chosen and spent > at_most_s:
                break
            chosen.append(test)
        return chosen

    def _met_by_import(self, path: str) -> set[str]:
        paths, met = {path}, set[str]()
        while paths and not met:
            met = {test for one in paths for test in self._within(one, 1, 1 << 30)}
            paths = {importer for one in paths for importer in self._importers(one)}
        # a test of a table runs no line of it: those in the folder of the same name, or above
        folder, beside = PurePosixPath(path).parent, set[str]()
        while not beside and folder.name:
            tests = PurePosixPath("tests", *folder.parts[1:]).as_posix() + "/"
            beside, folder = {test for test in self.seconds if test.startswith(tests)}, folder.parent
        return met | beside

    def _within(self, path: str, first: int, last: int) -> set[str]:
        held = self.lines.get(path, {})
        return {test for line, tests in held.items() if first <= line <= last for test in tests}

    def _importers(self, path: str) -> Iterator[str]:
        name = ".".join(PurePosixPath(path).with_suffix("").parts)
        for other in self.lines:
            for node in ast.walk(ast.parse((self.root / other).read_text("utf-8"))):
                if isinstance(node, ast.ImportFrom) and name in (
                    node.module,
                    *(f"{node.module}.{alias.name}" for alias in node.names),
                ):
                    yield other


def _near(test: str, path: str) -> int:
    """Folders and names common to the path of a test and of a file."""
    names = {part.removeprefix("test_") for part in PurePosixPath(test.split("::")[0]).with_suffix("").parts}
    return len(names & set(PurePosixPath(path).with_suffix("").parts))
