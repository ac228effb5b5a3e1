"""A bar on stderr for runs that take a while, on terminals only."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from olp.cli.common import is_terminal

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

Report = Callable[[str, float], None]

#: Seconds; shorter runs show nothing, and do not import rich.
PATIENCE_S = 1.0


class _Bar:
    def __init__(self) -> None:
        self._began = time.monotonic()
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __call__(self, stage: str, fraction: float) -> None:
        if self._bar is None:
            if time.monotonic() - self._began < PATIENCE_S:
                return
            from rich.console import Console
            from rich.progress import Progress

            self._bar = Progress(console=Console(stderr=True), transient=True)
            self._bar.start()
            self._task = self._bar.add_task(stage, total=1.0)
        if self._task is not None:
            self._bar.update(self._task, description=stage, completed=fraction)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.stop()


@contextlib.contextmanager
def progress(quiet: bool) -> Iterator[Report | None]:
    """What the library calls with (stage, fraction of it done); None where stderr is not a terminal."""
    if quiet or not is_terminal(sys.stderr):
        yield None
        return
    bar = _Bar()
    try:
        yield bar
    finally:
        bar.close()
