"""Tasks of a batch on an existing Dask cluster. Inputs travel as bytes: no disk is shared."""

from __future__ import annotations

import contextlib
import logging
import queue
from collections import Counter
from typing import TYPE_CHECKING, Any

from olp.core.errors import CannotCompute, UsageError
from olp.workflows.batch_task import Config, Outcome, Task
from olp.workflows.batch_work import lost, perform

if TYPE_CHECKING:
    from distributed import Client, Future

#: s to find the scheduler, and to wait for a first worker
_PATIENCE_S = 30.0
#: s after which it is looked whether there are workers at all
_LOOK_S = 2.0
#: times that a task is begun again
_AGAIN = 3
#: Tasks for each thread of the workers, so that none waits for the next one.
_AHEAD = 2


def _same(config: Config) -> Config:
    """A setup as the result of a task: where all workers that have it are lost, it is made again."""
    return config


class Cluster:
    """The workers of a scheduler, such as tcp://192.168.0.5:8786."""

    def __init__(self, address: str) -> None:
        """Raises UsageError without the package or the scheduler, CannotCompute without workers."""
        try:
            from distributed import Client
        except ImportError:
            raise UsageError(
                "--cluster needs the package distributed; install it: pip install 'olp-corrector[cluster]'"
            ) from None
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        self._address = address
        try:
            self._client: Client = Client(address, timeout=_PATIENCE_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise UsageError(
                f"--cluster {address}: no scheduler answers there ({type(error).__name__}); start one with "
                "dask scheduler, or correct the address, such as tcp://192.168.0.5:8786"
            ) from None
        self._done: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._futures: dict[int, Future] = {}
        self._tasks: dict[int, tuple[Config, Task]] = {}
        #: by task, how often it was begun again
        self._again: Counter[int] = Counter()
        self._configs: dict[str, Future] = {}
        try:
            self._client.wait_for_workers(1, timeout=_PATIENCE_S)
        except TimeoutError:
            self.close()
            raise self._alone() from None

    @property
    def capacity(self) -> int:
        """Tasks that may be under way: two for each thread of the workers there are now."""
        threads: dict[str, int] = self._client.nthreads()
        return max(_AHEAD * sum(threads.values()), 1)

    def submit(self, number: int, config: Config, task: Task) -> None:
        """Begin a task; its setup goes to the cluster once."""
        if config.digest not in self._configs:
            self._configs[config.digest] = self._client.submit(_same, config, pure=False)
        future = self._client.submit(perform, self._configs[config.digest], task, pure=False)
        self._futures[number], self._tasks[number] = future, (config, task)
        future.add_done_callback(lambda _, number=number: self._done.put(number))

    def result(self) -> tuple[int, Outcome]:
        """As `Pool.result`. Raises CannotCompute where the cluster has gone."""
        while True:
            number = self._next()
            future, (config, task) = self._futures.pop(number), self._tasks.pop(number)
            if not self._begun_again(number, future, config, task):
                return number, self._outcome(future, task)

    def _next(self) -> int:
        """The number of the next task that has ended."""
        waited = 0.0
        while True:
            try:
                return self._done.get(timeout=_LOOK_S)
            except queue.Empty:
                waited = waited + _LOOK_S if self._without_workers() else 0.0
                if waited > _PATIENCE_S:
                    raise self._alone() from None

    def _begun_again(self, number: int, future: Future, config: Config, task: Task) -> bool:
        """Begin a task again that ended without an outcome, as what only a lost worker had is cancelled with
        it. Not where no worker is left, nor more than a few times."""
        if future.status in {"finished", "error"} or self._again[number] == _AGAIN or self._without_workers():
            return False
        self._again[number] += 1
        if self._configs[config.digest].status not in {"finished", "pending"}:
            del self._configs[config.digest]
        self.submit(number, config, task)
        return True

    def close(self) -> None:
        """Give up what is under way, and leave the cluster."""
        with contextlib.suppress(Exception):
            self._client.cancel([*self._futures.values(), *self._configs.values()])
        with contextlib.suppress(Exception):
            self._client.close(timeout=_PATIENCE_S)

    def _outcome(self, future: Future, task: Task) -> Outcome:
        if future.status == "finished":
            outcome: Outcome = future.result()
            return outcome
        if future.status == "error":
            error: Any = future.exception()
            what = type(error).__name__
            return lost(
                f"{task.program}: no worker of the cluster did it ({what}); its workers may have too little "
                "memory, or another version of olp or Python"
            )
        raise CannotCompute(
            f"the cluster {self._address} has gone; what is done stays, and the same call goes on"
        )

    def _without_workers(self) -> bool:
        try:
            return not self._client.nthreads()
        except Exception:
            return True

    def _alone(self) -> CannotCompute:
        return CannotCompute(
            f"the cluster {self._address} has no workers; start one with dask worker {self._address}. "
            "What is done stays, and the same call goes on"
        )
