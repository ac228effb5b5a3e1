"""Mutated inputs of all dialects and all kinds of side files: python tests/fuzz/mutated.py --count N --seed S

Each input is made from the seed and its number alone, so that it can be made again. It is given to a public
function in a forked process of bounded memory, with a time limit. An error of `olp` or success is good;
any other exception, a crash, or more time or memory is a defect. Prints every kind of defect once, with the
smallest input found; ends with 1 if there was any. `--write` keeps these inputs.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import mmap
import os
import pickle
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fuzz.mutations import mutated
from fuzz.targets import Target, targets

from olp.core.errors import OlpError

#: seconds of processor time that an input may take, and bytes of memory of the process
LIMIT_S, LIMIT_BYTES = 8.0, 3 << 30
#: inputs of one process
_BATCH = 400
#: runs of a function while a defect is made smaller
_SHRINKING = 150


class _TooSlow(BaseException):
    """The time of an input is over."""


@dataclass(frozen=True)
class Defect:
    """`kind` is the exception and where it was raised; `number` makes the input again."""

    target: str
    kind: str
    number: int
    data: bytes
    trace: str = ""


def input_of(seed: int, number: int, all_targets: Sequence[Target]) -> tuple[Target, bytes]:
    """The target of an input and its bytes."""
    draw = random.Random(f"{seed} {number}")
    target = draw.choices(all_targets, [t.share for t in all_targets])[0]
    return target, mutated(draw, draw.choice(target.inputs), target.inputs)


def tried(target: Target, data: bytes) -> tuple[str, str]:
    """What is wrong with the outcome of an input and its traceback, ("", "") for nothing."""
    signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT_S)
    try:
        target.call(data)
    except OlpError as error:
        text = str(error)
        return ("", "") if text and len(text) < 20_000 else (f"a message of {len(text)} characters", "")
    except _TooSlow:
        return f"takes more than {LIMIT_S:g} s", traceback.format_exc(limit=-4)
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        ours = [f for f in frames if "/olp/" in f.filename] or frames
        return (
            f"{type(error).__name__} in {Path(ours[-1].filename).name}:{ours[-1].name}",
            traceback.format_exc(),
        )
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    return "", ""


def smaller(target: Target, data: bytes, kind: str) -> bytes:
    """The input with stretches taken out, as long as the same defect is there."""
    left, size = _SHRINKING, max(len(data) // 2, 1)
    while size and left:
        place = 0
        while place < len(data) and left:
            left -= 1
            shorter = data[:place] + data[place + size :]
            if tried(target, shorter)[0] == kind:
                data = shorter
            else:
                place += size
        size //= 2
    return data


def _late(_: int, __: FrameType | None) -> None:
    raise _TooSlow


def _batch(seed: int, numbers: range, all_targets: Sequence[Target], present: mmap.mmap) -> list[Defect]:
    """Try inputs in this process; `present` holds the number of the one that is tried."""
    faulthandler.disable()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGVTALRM, _late)
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_BYTES, LIMIT_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    defects: dict[tuple[str, str], Defect] = {}
    for number in numbers:
        present[:8] = number.to_bytes(8, "little")
        target, data = input_of(seed, number, all_targets)
        kind, trace = tried(target, data)
        if kind and (target.name, kind) not in defects:
            least = data if kind.startswith("takes") else smaller(target, data, kind)
            defects[target.name, kind] = Defect(target.name, kind, number, least, trace)
    return list(defects.values())


def defects_of(seed: int, numbers: range, all_targets: Sequence[Target]) -> Iterator[Defect]:
    """Defects of inputs, each batch in a forked process; a process that ends is a defect of its input."""
    present = mmap.mmap(-1, 8)
    begin = numbers.start
    while begin < numbers.stop:
        part = range(begin, min(begin + _BATCH, numbers.stop))
        reader, writer = os.pipe()
        child = os.fork()
        if not child:
            try:
                os.close(reader)
                with os.fdopen(writer, "wb") as stream:
                    stream.write(pickle.dumps(_batch(seed, part, all_targets, present)))
                os._exit(0)
            finally:
                # whatever has gone wrong here is not for the parent's code
                os._exit(1)
        os.close(writer)
        with os.fdopen(reader, "rb") as stream:
            answer = stream.read()
        _, status = os.waitpid(child, 0)
        begin = part.stop
        if answer:
            yield from pickle.loads(answer)
        if status or not answer:
            number = int.from_bytes(present[:8], "little")
            target, data = input_of(seed, number, all_targets)
            yield Defect(target.name, f"the process ended with status {status}", number, data)
            begin = number + 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--only", default="", help="targets whose names begin so")
    parser.add_argument("--write", type=Path, help="folder for the inputs of defects")
    options = parser.parse_args()
    known: set[tuple[str, str]] = set()
    done, last = options.first, options.first + options.count
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(KeyboardInterrupt):
        chosen = [t for t in targets(Path(folder)) if t.name.startswith(options.only)]
        begun = time.monotonic()
        while done < last:
            part = range(done, min(done + _BATCH, last))
            for defect in defects_of(options.seed, part, chosen):
                if (defect.target, defect.kind) not in known:
                    known.add((defect.target, defect.kind))
                    _show(defect, options.seed, options.write)
            done = part.stop
    count = done - options.first
    print(f"{count} inputs, {len(known)} kinds of defects, {count / (time.monotonic() - begun):.0f} a second")
    return int(bool(known))


def _show(defect: Defect, seed: int, folder: Path | None) -> None:
    print(f"{defect.number} {defect.target}: {defect.kind}\n  {defect.data[:300]!r}")
    print("".join(f"  {line}\n" for line in defect.trace.strip().split("\n")[-7:]), flush=True)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{seed}-{defect.number}").write_bytes(defect.data)


if __name__ == "__main__":
    sys.exit(main())
