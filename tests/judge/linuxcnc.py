"""LinuxCNC's own interpreter as the reader of programs: `interpret` gives axis positions of every move."""

from __future__ import annotations

import atexit
import functools
import json
import os
import subprocess
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

SYSTEM_PYTHON = "/usr/bin/python3"
DRIVER = Path(__file__).with_name("canon_driver.py")
FRAMES = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
#: Kinds of rows of `canon_driver`.
RAPID = 0
FEED = 1
ARC = 2
PROBE = 3
DWELL = 4
KINDS = ("rapid", "feed", "arc", "probe", "dwell")
NO_END = "File ended with no percent sign or program end"
COLUMNS = 22
#: masks of axes
XYZ = 0b111
ALL_AXES = 0b1_1111_1111
Point = Sequence[float]


class InterpreterError(Exception):
    """The interpreter refuses the program; `line` counts from 1, one too far for blocks it cannot read."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(f"line {line}: {message}")
        self.line = line


@dataclass(frozen=True, slots=True)
class CanonMoves:
    """Canonical moves in order. Positions in mm, axis = tip + active tool offset, absolute in the machine."""

    start: np.ndarray  # (3,) axis position before the first move
    line: np.ndarray  # (n,) source line, from 1
    kind: np.ndarray  # (n,) index into KINDS
    tip: np.ndarray  # (n, 3) controlled point at the end of the move
    length: np.ndarray  # (n, 3) active tool offset
    tool: np.ndarray  # (n,) tool in the spindle, -1 none
    frame: np.ndarray  # (n,) index into FRAMES
    feed: np.ndarray  # (n,) mm/min
    centre: np.ndarray  # (n, 3) arc centre as an axis position, at the height of the end
    turns: np.ndarray  # (n,) arcs: > 0 counter-clockwise, |turns| circles begun
    plane: np.ndarray  # (n,) 0 XY, 1 YZ, 2 XZ
    seconds: np.ndarray  # (n,) of dwells
    g92: np.ndarray  # (n, 3)
    known: np.ndarray  # (n, 3) axis position at the end does not depend on the start position
    feed_mode: np.ndarray  # (n,) 0 `feed` counts by the minute, 1 by the turn
    speed: np.ndarray  # (n,) turns of the spindle per minute, NaN where it changes beside the move
    start_known: bool = True
    ended: bool = True
    messages: list[Any] = field(default_factory=list)

    @classmethod
    def polyline(cls, axis_mm: np.ndarray, *, tool: int = -1, lines: np.ndarray | None = None) -> CanonMoves:
        """Straight feed moves through axis positions (n + 1, 3) in G54 without a tool length; all known."""
        points = np.asarray(axis_mm, float)
        n = len(points) - 1
        nil, ints = np.zeros((n, 3)), np.zeros(n, int)
        return cls(
            start=points[0],
            line=np.arange(1, n + 1) if lines is None else lines,
            kind=np.full(n, FEED),
            tip=points[1:],
            length=nil,
            tool=np.full(n, tool),
            frame=ints,
            feed=np.full(n, 1000.0),
            centre=nil,
            turns=ints,
            plane=ints,
            seconds=np.zeros(n),
            g92=nil,
            known=np.ones((n, 3), bool),
            feed_mode=ints,
            speed=np.zeros(n),
        )

    @property
    def axis(self) -> np.ndarray:
        """(n, 3) axis position at the end of each move."""
        return np.asarray(self.tip + self.length)

    @property
    def begin(self) -> np.ndarray:
        """(n, 3) axis position at the begin of each move."""
        return np.vstack([self.start[None], self.axis[:-1]]) if len(self.line) else np.zeros((0, 3))

    def __len__(self) -> int:
        return len(self.line)

    def pick(self, keep: np.ndarray) -> CanonMoves:
        """The same with some rows only; the kept rows must still join (dwells may be dropped)."""
        single = ("start", "start_known", "ended", "messages")
        rows = [item.name for item in fields(self) if item.name not in single]
        return replace(self, **{name: getattr(self, name)[keep] for name in rows})


@functools.cache
def available() -> bool:
    """LinuxCNC's interpreter can be run here."""
    if not Path(SYSTEM_PYTHON).exists():
        return False
    done = subprocess.run([SYSTEM_PYTHON, "-c", "import gcode"], capture_output=True, check=False, timeout=60)
    return done.returncode == 0


def interpret(
    data: bytes,
    machine: str | Path | None = None,
    *,
    offsets: Mapping[str, Point] | None = None,
    tools: Mapping[int, Point] | None = None,
    g92_mm: Point | None = None,
    start_mm: Point = (0.0, 0.0, 0.0),
    find_known: bool = True,
    deletes: bool = False,
    axes: int = XYZ,
    seconds: float = 300.0,
) -> CanonMoves:
    """Canonical moves of a program with the offsets and tools of a machine folder; arguments override it.

    With `find_known` the start counts as unknown, and a second run from elsewhere shows which axis positions
    depend on it; without, the machine really stands at `start_mm` and all is known.

    `deletes` is the block-delete switch: it takes out blocks with `/`. `axes` is a mask of what the machine
    has, as other words are refused. Raises InterpreterError where LinuxCNC
    refuses; a missing program end alone is let pass (`ended`). Raises InterpreterFailure where it crashes or
    takes longer than `seconds`.
    """
    setup = _setup(machine, offsets or {}, tools or {}, g92_mm)
    how = {"deletes": deletes, "axes": axes, "seconds": seconds}
    moves = _run(data, setup, start_mm, **how)
    if not find_known or not len(moves):
        return moves
    other = _run(data, setup, [value - 7.0 for value in start_mm], **how)
    if len(other) != len(moves):
        raise RuntimeError("the moves depend on the start position: give start_mm and find_known=False")
    return replace(moves, known=np.abs(other.axis - moves.axis) < 1e-6, start_known=False)


def accepts(data: bytes, machine: str | Path | None = None, **setup: Any) -> bool:
    """LinuxCNC reads the whole program without an error."""
    try:
        return interpret(data, machine, find_known=False, **setup).ended
    except InterpreterError:
        return False


@dataclass(frozen=True)
class _Setup:
    offsets: dict[str, tuple[float, float, float, float]]
    tools: dict[int, tuple[float, float, float, float]]
    g92: Point | None
    tool: int | None
    frame: str
    length_active: bool
    homes: Mapping[int, Mapping[str, float]]


@functools.lru_cache(maxsize=16)
def _parsed(text: str) -> dict[str, Any]:
    return tomllib.loads(text)


def _setup(
    machine: str | Path | None, offsets: Mapping[str, Point], tools: Mapping[int, Point], g92: Point | None
) -> _Setup:
    text: dict[str, Any] = {}
    if machine is not None:
        path = Path(machine)
        text = _parsed((path / "machine.toml" if path.is_dir() else path).read_text())
    frames: dict[str, tuple[float, float, float, float]] = {}
    for name, entry in text.get("work_offsets", {}).items():
        if entry.get("A_deg") or entry.get("B_deg"):
            raise NotImplementedError("LinuxCNC turns a frame about Z only")
        x, y, z = (float(entry.get(f"{a}_mm", 0.0)) for a in "XYZ")
        frames[name] = (x, y, z, float(entry.get("C_deg", 0.0)))
    for name, (x, y, z) in offsets.items():
        frames[name] = (x, y, z, 0.0)
    table: dict[int, tuple[float, float, float, float]] = {}
    for number, entry in text.get("tools", {}).items():
        x, y, z = (float(entry.get(f"{a}_mm", 0.0)) for a in "XYZ")
        table[int(number)] = (x, y, z, 2.0 * float(entry.get("radius_mm", 0.0) + entry.get("wear_mm", 0.0)))
    for tool, (x, y, z) in tools.items():
        table[tool] = (x, y, z, 0.0)
    defaults = text.get("job_defaults", {})
    return _Setup(
        frames,
        table,
        g92,
        defaults.get("tool"),
        defaults.get("work_offset", "G54"),
        bool(defaults.get("length_active", False)),
        {5161: text.get("home_mm", {}), 5181: text.get("second_home_mm", {})},
    )


class InterpreterFailure(RuntimeError):
    """LinuxCNC neither accepted nor refused: it crashed, or did not come to an end (`failed` is "time")."""

    def __init__(self, failed: str) -> None:
        super().__init__(f"the interpreter stopped: {failed}")
        self.failed = failed


#: The interpreter relies on zeros where it sets nothing, as for its spindles. A process that has freed much
#: memory would give it used memory: so large blocks always come fresh.
_FRESH_MEMORY = {"MALLOC_MMAP_THRESHOLD_": "16384"}


class _Server:
    """LinuxCNC's interpreter in a process of its own, which answers one program after the other."""

    def __init__(self) -> None:
        self.folder = tempfile.TemporaryDirectory(prefix="canon_")
        self.process = subprocess.Popen(
            [SYSTEM_PYTHON, "-I", str(DRIVER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=self.folder.name,
            env={"HOME": self.folder.name, "PATH": os.environ.get("PATH", ""), **_FRESH_MEMORY},
        )
        self.owner = os.getpid()
        atexit.register(self.close)

    def close(self) -> None:
        if self.owner == os.getpid():
            self.process.communicate()
            self.folder.cleanup()

    def ask(self, request: Mapping[str, Any], data: bytes) -> tuple[dict[str, Any], np.ndarray]:
        """The report and the rows (n, COLUMNS) of a program. Raises InterpreterFailure."""
        into, out = self.process.stdin, self.process.stdout
        assert into is not None
        assert out is not None
        into.write(json.dumps({**request, "size": len(data)}).encode() + b"\n" + data)
        into.flush()
        report = json.loads(out.readline())
        rows = np.frombuffer(out.read(report["size"])).reshape(-1, COLUMNS)
        if "failed" in report:
            raise InterpreterFailure(report["failed"])
        return report, rows


@functools.cache
def _server(process: int) -> _Server:
    """One for each `process`: a fork must not share the pipes of its parent."""
    return _Server()


def _run(
    data: bytes, setup: _Setup, start_mm: Point, *, deletes: bool, axes: int, seconds: float
) -> CanonMoves:
    x, y, z = (float(value) for value in start_mm)
    begin = f"G53 G0 X{x:.9f} Y{y:.9f} Z{z:.9f}"
    if setup.tool in setup.tools:
        activate = f"G43 H{setup.tool}" if setup.length_active else ""
        begin = f"T{setup.tool} M6 {activate} {begin}"
    table = "".join(f"T{n} P{n} X{x!r} Y{y!r} Z{z!r} D{d!r}\n" for n, (x, y, z, d) in setup.tools.items())
    request = {
        "table": table,
        "variables": _parameters(setup),
        "start": begin,
        "unit": "G21",
        "deletes": deletes,
        "axes": axes,
        "seconds": seconds,
    }
    try:
        report, rows = _server(os.getpid()).ask(request, data)
    except InterpreterFailure as failure:
        if not failure.failed.startswith("SIG"):
            raise
        # a crash counts where it comes again
        report, rows = _server(os.getpid()).ask(request, data)
    if report["error"] not in (None, NO_END):
        raise InterpreterError(report["error"], report["error_line"])
    rows = rows[1:]  # the first row goes to the start position
    tip, length = rows[:, 2:5], rows[:, 5:8]
    return CanonMoves(
        np.array(start_mm, float),
        rows[:, 0].astype(int),
        rows[:, 1].astype(int),
        tip,
        length,
        rows[:, 8].astype(int),
        rows[:, 9].astype(int) - 1,
        rows[:, 10],
        rows[:, 11:14] + length,
        rows[:, 14].astype(int),
        rows[:, 15].astype(int) - 1,
        rows[:, 16],
        rows[:, 17:20],
        np.ones(tip.shape, bool),
        feed_mode=rows[:, 20].astype(int),
        speed=rows[:, 21],
        ended=report["error"] is None,
        messages=report["messages"],
    )


def _parameters(setup: _Setup) -> str:
    """Parameter file: 5161.. G28, 5181.. G30, 5210 G92 in force, 5211.. G92, 5220 active frame, 5221 +
    20 k frames, 5230 + 20 k R."""
    values = {5210: 0.0, 5220: float(FRAMES.index(setup.frame) + 1)}
    for first, home in setup.homes.items():
        values |= {first + i: float(home.get(axis, 0.0)) for i, axis in enumerate("XYZ")}
    if setup.g92 is not None:
        values[5210] = 1.0
        values.update({5211 + i: float(value) for i, value in enumerate(setup.g92)})
    for name, (x, y, z, turn) in setup.offsets.items():
        base = 5221 + 20 * FRAMES.index(name)
        values.update({base: x, base + 1: y, base + 2: z, base + 9: turn})
    return "".join(f"{number}\t{value!r}\n" for number, value in sorted(values.items()))


def require() -> None:
    """Skip the running test without LinuxCNC; fail it where OLP_REQUIRE_ORACLE=1 promises one."""
    import pytest

    if available():
        return
    if os.environ.get("OLP_REQUIRE_ORACLE") == "1":
        pytest.fail("OLP_REQUIRE_ORACLE=1, but LinuxCNC's interpreter cannot be run")
    pytest.skip("needs LinuxCNC: apt-get install --no-install-recommends linuxcnc-uspace")
