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
        """The map as JSON; tests that fail or skip on the unchanged code are not in it."""
        self.coverage.stop()
        data = self.coverage.get_data()
        good = sorted(self.seconds.keys() - self.failed)
        number = {name: i for i, name in enumerate(good)}
        lines: dict[str, dict[int, list[int]]] = {}
        for file in self.files:
            contexts = data.contexts_by_lineno(str(self.root / file))
            lines[file] = {
                line: sorted(number[name] for name in names if name in number)
                for line, names in contexts.items()
            }
        value = {"tests": good, "seconds": [self.seconds[name] for name in good], "lines": lines}
        path.write_text(json.dumps(value), "utf-8")


@dataclass(frozen=True, slots=True)
class Map:
    """Tests, their seconds, and for each file the tests of each line."""

    root: Path
    tests: list[str]
    seconds: list[float]
    lines: dict[str, dict[int, list[int]]]

    @classmethod
    def read(cls, path: Path, root: Path) -> Map:
        value: dict[str, Any] = json.loads(path.read_text("utf-8"))
        lines = {
            file: {int(line): tests for line, tests in held.items()} for file, held in value["lines"].items()
        }
        return cls(root, value["tests"], value["seconds"], lines)

    def tests_of(self, site: Site, at_most_s: float) -> list[str]:
        """Tests that run a site, the nearest folder first and there the fastest, `at_most_s` seconds of them.

        Code that the import runs is met by every test of its module, or where the module has no functions, of
        the modules that import it.
        """
        if site.function is not None:
            met = self._within(site.path, *site.statement) or self._within(site.path, site.line, site.line)
        else:
            met = self._within(site.path, 1, 1 << 30)
            for path in () if met else self._importers(site.path):
                met |= self._within(path, 1, 1 << 30)
        chosen: list[str] = []
        spent = 0.0
        for test in sorted(met, key=lambda i: (-_near(self.tests[i], site.path), self.seconds[i])):
            spent += self.seconds[test]
            if chosen and spent > at_most_s:
                break
            chosen.append(self.tests[test])
        return chosen

    def _within(self, path: str, first: int, last: int) -> set[int]:
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
