"""A batch that is repeated whenever a file of its folders changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from olp.core.progress import Progress
from olp.files.folders import state_of
from olp.workflows.batch import Batch, BatchOptions, run
from olp.workflows.batch_find import Where, looked
from olp.workflows.batch_pool import Opener

#: s between two looks. A change counts when it is over: when two looks find the same.
POLL_S = 1.0


def watch(
    where: Where, options: BatchOptions, opener: Opener, passed: Callable[[Batch], None],
    progress: Progress | None = None, *, pause: Callable[[], None] = lambda: time.sleep(POLL_S),
) -> None:  # fmt: skip
    """Run a batch, and again after each change of a program, a job, a machine or a calibration, until an
    interrupt ends it. Programs that are refused do not end it. `passed` is called after each run, `pause`
    between two looks at the files. Raises as `olp.workflows.batch.run`."""
    where, options = replace(where, may_be_empty=True), replace(options, keep_going=True)
    inputs: tuple[str, ...] = ()
    while True:
        # files count as they were before the run, so that no change is missed that comes while it lasts
        before = state_of({*inputs, *map(str, looked(where))})
        result = run(where, options, opener, progress)
        passed(result)
        inputs = result.looked
        state = state_of(inputs) | before
        _wait_for_change(where, result, state, pause)


def _wait_for_change(
    where: Where, result: Batch, state: dict[str, tuple[int, int] | None], pause: Callable[[], None]
) -> None:
    """Return when files differ from their `state`, and differ no more from one look to the next."""
    last = state
    while True:
        pause()
        now = state_of({*result.looked, *map(str, looked(where))})
        if now != state and now == last:
            return
        last = now
