"""A Dask scheduler with its workers on this machine, each a process of its own."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

#: s to start all of it
PATIENCE_S = 60.0


@dataclass
class Cluster:
    """The address of a scheduler, and the processes of its workers."""

    address: str
    workers: list[subprocess.Popen[bytes]]


@contextlib.contextmanager
def cluster(folder: Path, *, workers: int) -> Iterator[Cluster]:
    """A scheduler and its workers, which work in empty folders of their own; all are killed at the end."""
    folder.mkdir(parents=True, exist_ok=True)
    processes: list[subprocess.Popen[bytes]] = []

    def start(name: str, *words: str) -> Path:
        own, log = folder / name, folder / f"{name}.log"
        own.mkdir()
        command = [sys.executable, "-m", "distributed.cli.dask_" + name.split("-")[0], *words]
        with log.open("wb") as stream:
            processes.append(subprocess.Popen(command, stdout=stream, stderr=stream, cwd=own, env=os.environ))
        return log

    try:
        log = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        address = _found(log, r"Scheduler at:\s+(tcp://[\d.:]+)", processes)
        for number in range(workers):
            name = f"worker-{number}"
            words = ["--no-nanny", "--nthreads", "1", "--no-dashboard", "--memory-limit", "0", "--name", name]
            _found(start(name, address, *words), r"Registered to:\s+(\S+)", processes)
        yield Cluster(address, processes[1:])
    finally:
        # nothing is to be saved, and after a worker was killed the others took a minute to end by themselves
        for process in processes:
            process.kill()
            process.wait()


def _found(log: Path, pattern: str, processes: list[subprocess.Popen[bytes]]) -> str:
    """What a process says of itself in its log, once it does."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until and processes[-1].poll() is None:
        match = re.search(pattern, log.read_text("utf-8", "replace"))
        if match:
            return match[1]
        time.sleep(0.1)
    raise RuntimeError(f"{log.name} does not start: {log.read_text('utf-8', 'replace')[-2000:]}")
