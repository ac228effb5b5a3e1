"""Seconds of `olp batch` on a folder of 500 programs of 2,000 lines, in three states, and of a Dask cluster.

    python tests/benchmarks/bench_batch.py [programs [lines]]

Prints wall and CPU seconds of whole commands, start of Python included: all programs the first time, again
with nothing changed, and again with one program changed. Then the same folder on a cluster of two workers
(needs the package distributed), of which one is killed on the way, and whether all bytes are the same.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases.clusters import cluster

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("raster", "contour", "raster", "contour", "holes")


def programs(folder: Path, count: int, lines: int) -> None:
    """A tree of folders with different programs of about as many lines each."""
    sys.path.insert(0, str(ROOT / "programs"))
    from generate import program

    texts = {kind: "\n".join(program(kind, lines)) + "\n" for kind in set(KINDS)}
    for number in range(count):
        place = folder / f"cell-{number % 10}" / f"part-{number:03}.ngc"
        place.parent.mkdir(parents=True, exist_ok=True)
        text = texts[KINDS[number % len(KINDS)]]
        place.write_text(text.replace("\n", f"\n(PART {number})\n", 1))


def call(folder: Path, output: Path, *words: str) -> float:
    """Run the verb; the seconds that it took."""
    machine = ROOT / "programs" / "gantry-plate" / "machine.toml"
    command = [sys.executable, "-m", "olp", "batch", str(folder), "-m", str(machine), "-o", str(output)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.monotonic()
    done = subprocess.run([*command, "-q", *words], env=os.environ, check=False)
    seconds = time.monotonic() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if done.returncode not in (0, 1):
        raise SystemExit(f"olp batch ended with {done.returncode}")
    print(f"  {seconds:.1f} s, {cpu:.1f} s CPU of the call and its processes", flush=True)
    return seconds


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder by their path."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def killed_on_the_way(output: Path, kill: Callable[[], None]) -> threading.Thread:
    """Kills a worker when a tenth of the programs is written."""

    def wait() -> None:
        while len(list(output.rglob("*.ngc"))) < 10:
            time.sleep(0.1)
        kill()

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    return thread


def on_a_cluster(folder: Path, here: Path, output: Path) -> None:
    with cluster(output.parent / "dask", workers=2) as running:
        killed = killed_on_the_way(output, lambda: os.kill(running.workers[0].pid, signal.SIGKILL))
        call(folder, output, "--cluster", running.address)
        killed.join(1.0)
        state = running.workers[0].poll()
    mine, theirs = contents(here), contents(output)
    mine.pop("index.html"), theirs.pop("index.html")
    print(f"  worker killed: {state == -signal.SIGKILL}, same bytes: {mine == theirs} ({len(mine)} files)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("programs", nargs="?", type=int, default=500)
    parser.add_argument("lines", nargs="?", type=int, default=2000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, output = Path(name, "parts"), Path(name, "out")
        programs(folder, options.programs, options.lines)
        print(f"{options.programs} programs of {options.lines} lines, {os.cpu_count()} processors")
        print("first time:")
        call(folder, output)
        print("nothing changed:")
        call(folder, output)
        print("one program changed:")
        changed = folder / "cell-0" / "part-000.ngc"
        changed.write_text(changed.read_text() + "(CHANGED)\n")
        call(folder, output)
        print("on a Dask cluster of two workers, one of them killed:")
        on_a_cluster(folder, output, Path(name, "cluster"))


if __name__ == "__main__":
    main()
