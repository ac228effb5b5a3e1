"""Who does the tasks of a batch: this process, processes of this machine, or a Dask cluster.

Each has the same few methods and gives the same outcomes. Processes are spawned and never forked. One that
is killed is replaced, and its task is done again.
"""

from __future__ import annotations

import contextlib
import os
import signal
from collections import deque
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Protocol

from olp.core.values import dataclass
from olp.workflows.batch_task import Config, Outcome, Task
from olp.workflows.batch_work import lost, perform

#: How often a task is begun whose process ends before it is done.
ATTEMPTS = 3
#: s that a process has to end by itself
_LEAVE_S = 5.0


class Pool(Protocol):
    """Workers. Tasks are called by a number of the caller's."""

    @property
    def capacity(self) -> int:
        """Tasks that may be under way."""
        ...

    def submit(self, number: int, config: Config, task: Task) -> None:
        """Begin a task."""
        ...

    def result(self) -> tuple[int, Outcome]:
        """Wait for a task that is done: its number and its outcome."""
        ...

    def close(self) -> None:
        """End the workers; what is under way is given up."""
        ...


class Here:
    """This process."""

    capacity = 1

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, Config, Task]] = deque()

    def submit(self, number: int, config: Config, task: Task) -> None:
        """Keep a task for `result`."""
        self._waiting.append((number, config, task))

    def result(self) -> tuple[int, Outcome]:
        """Do the oldest task."""
        number, config, task = self._waiting.popleft()
        return number, perform(config, task)

    def close(self) -> None:
        """Forget what is not begun."""
        self._waiting.clear()


@dataclass(slots=True, eq=False)
class _Worker:
    """A process with its pipe, the digests of the setups that it has, and what it does."""

    process: SpawnProcess
    pipe: Connection
    configs: set[str]
    number: int | None = None


class Processes:
    """Processes of this machine, which are started when there is work for them."""

    def __init__(self, count: int) -> None:
        self.capacity = max(count, 1)
        self._workers: list[_Worker] = []
        self._tasks: dict[int, tuple[Config, Task]] = {}
        self._attempts: dict[int, int] = {}

    def submit(self, number: int, config: Config, task: Task) -> None:
        """Give a task to a process that is free."""
        self._tasks[number] = (config, task)
        self._begin(number)

    def result(self) -> tuple[int, Outcome]:
        """As `Pool.result`; the task of a process that has ended is begun again, at most three times."""
        while True:
            busy = {worker.pipe: worker for worker in self._workers if worker.number is not None}
            for ready in wait(list(busy)):
                worker = busy[ready]  # type: ignore[index]
                number = worker.number
                assert number is not None
                try:
                    outcome: Outcome = worker.pipe.recv()
                except (EOFError, OSError):
                    given_up = self._lost(worker, number)
                    if given_up is None:
                        continue
                    outcome = given_up
                else:
                    worker.number = None
                del self._tasks[number]
                self._attempts.pop(number, None)
                return number, outcome

    def close(self) -> None:
        """End the processes: they write nothing, so that none has to be waited for."""
        for worker in self._workers:
            worker.pipe.close()
            if worker.number is not None:
                worker.process.terminate()
        for worker in self._workers:
            worker.process.join(_LEAVE_S)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
            worker.process.close()
        self._workers.clear()
        self._tasks.clear()

    def _begin(self, number: int) -> None:
        config, task = self._tasks[number]
        worker = next((w for w in self._workers if w.number is None), None) or self._start()
        worker.number = number
        # one that has ended is noticed where its outcome is waited for
        with contextlib.suppress(OSError):
            worker.pipe.send((config.digest, None if config.digest in worker.configs else config, task))
            worker.configs.add(config.digest)

    def _start(self) -> _Worker:
        from multiprocessing import get_context

        spawn = get_context("spawn")
        # ends of a pipe are of another class on Windows
        ends: Any = spawn.Pipe()
        here, there = ends
        process = spawn.Process(target=serve, args=(there,), daemon=True)
        process.start()
        there.close()
        worker = _Worker(process, here, set())
        self._workers.append(worker)
        return worker

    def _lost(self, worker: _Worker, number: int) -> Outcome | None:
        """Replace a process that has ended; the outcome of its task where that is given up."""
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.join()
        code = worker.process.exitcode
        worker.process.close()
        self._attempts[number] = self._attempts.get(number, 0) + 1
        if self._attempts[number] < ATTEMPTS:
            self._begin(number)
            return None
        return lost(
            f"{self._tasks[number][1].program}: its process ended {ATTEMPTS} times before it was done (exit "
            f"code {code}); it may need more memory than there is: use fewer workers, or split the program"
        )


def serve(pipe: Connection) -> None:
    """The life of a process: it does the tasks that come through the pipe until that is closed."""
    # an interrupt is for the process that writes; it closes the pipe
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    configs: dict[str, Config] = {}
    with contextlib.suppress(EOFError, OSError):
        while True:
            digest, config, task = pipe.recv()
            if config is not None:
                configs[digest] = config
            pipe.send(perform(configs[digest], task))


def opened(workers: int | None, cluster: str | None, tasks: int) -> Pool:
    """The workers for so many tasks: a cluster by its address, else as many as asked for, else one for each
    processor. Raises UsageError, CannotCompute."""
    if cluster is not None:
        from olp.workflows.batch_cluster import Cluster

        return Cluster(cluster)
    count = workers or min(os.cpu_count() or 1, max(tasks, 1))
    return Here() if count == 1 else Processes(count)


#: Opens workers for so many tasks.
Opener = Callable[[int], Pool]
