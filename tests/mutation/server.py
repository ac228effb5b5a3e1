"""Runs tests on a copy of the checkout, in child processes that find the large libraries imported."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest
from mutation.cover import Recorder
from mutation.sites import Mutant

#: Imported before the fork: none of them is changed.
LIBRARIES = (
    *("numpy", "scipy.optimize", "scipy.spatial", "scipy.interpolate", "click", "hypothesis"),
    *("matplotlib.figure", "trimesh", "markdown_it", "rich.progress"),
)
#: s; a test that hangs is a test that notices. Generous, as other work may take the machine.
TIMEOUT_S = 240.0
_PASSED, _FAILED, _NOT_COLLECTED = 0, 1, (2, 4)


@dataclass(frozen=True, slots=True)
class Outcome:
    """`word` is killed or survived."""

    word: str
    why: str = ""


class Server:
    """One copy of the checkout, in `root`."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for name in LIBRARIES:
            importlib.import_module(name)
        gc.freeze()

    def warm_up(self, folders: list[str]) -> None:
        """Compiles the copy once, as each run of tests imports all of it."""

        def child() -> int:
            sys.dont_write_bytecode = False
            return int(pytest.main([*_OPTIONS, "--collect-only", *folders]))

        self._ended(child, float("inf"), self.root.with_suffix(".log"))

    def record(self, folders: list[str], files: Iterable[str], to: Path) -> None:
        """Runs whole folders on the unchanged copy, and writes the map of tests by line."""

        def child() -> int:
            sys.dont_write_bytecode = False
            recorder = Recorder(self.root, files)
            pytest.main([*_OPTIONS, *folders], plugins=[recorder])
            recorder.write(to)
            return 0

        if self._ended(child, float("inf"), to.with_suffix(".log")) != 0:
            raise RuntimeError(f"the map could not be built; see {to.with_suffix('.log')}")

    def judge(self, mutant: Mutant, tests: list[str]) -> Outcome:
        """Whether one of the tests fails on the changed file."""
        path = self.root / mutant.site.path
        stamp = path.stat()
        unchanged = path.read_bytes()
        path.write_text(mutant.text, "utf-8")
        try:
            code = self._run(tests)
            if code in _NOT_COLLECTED:
                # the name of a case may come from the changed code: all cases then
                code = self._run(list(dict.fromkeys(test.split("[")[0] for test in tests)))
        finally:
            path.write_bytes(unchanged)
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
        return Outcome("survived" if code == _PASSED else "killed")

    def _run(self, tests: list[str]) -> int:
        def child() -> int:
            sys.dont_write_bytecode = True
            return int(pytest.main([*_OPTIONS, "-x", *tests]))

        return self._ended(child, TIMEOUT_S, self.root.with_suffix(".log"))

    def _ended(self, work: Callable[[], int], within_s: float, log: Path) -> int:
        """The exit code of `work` in a child process, -1 where it hangs or dies."""
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            self._become_child(work, log)
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.02)
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return -1

    def _become_child(self, work: Callable[[], int], log: Path) -> None:
        code = 70
        try:
            os.setsid()
            stream = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            for number in (1, 2):
                os.dup2(stream, number)
            os.chdir(self.root)
            sys.path[:] = [str(self.root), str(self.root / "tests"), *sys.path[1:]]
            os.environ["PYTHONPATH"] = f"{self.root}{os.pathsep}{self.root / 'tests'}"
            code = work()
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)


_OPTIONS = (
    *("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--hypothesis-seed=0", "--tb=line", "--no-header"),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
)
