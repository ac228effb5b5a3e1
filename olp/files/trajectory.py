"""Trajectories as files: CSV, NPZ, Parquet, ROS JointTrajectory as JSON, PVT points, and tables of lines and
slow stretches.

Every file is written in parts, so that a long one never has to be in memory.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from olp.core.errors import ConfigError, UsageError
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.origin import Files, Origin
from olp.trajectory.plan import Trajectory
from olp.trajectory.usage import LIMITS, LineUse, SlowStretches


@dataclass(frozen=True, slots=True)
class Columns:
    """The axes of a trajectory in order, and the unit of each, "mm" or "deg"."""

    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def of_place(self) -> list[str]:
        return [f"{name}_{unit}" for name, unit in zip(self.names, self.units, strict=True)]

    @property
    def of_speed(self) -> list[str]:
        return [f"V{column}_s" for column in self.of_place]

    @property
    def all(self) -> tuple[str, ...]:
        """The columns of the samples."""
        return ("t_s", *self.of_place, *self.of_speed, *(f"A{c}_s2" for c in self.of_place), "line")


LINEAR = Columns(tuple(AXES), ("mm",) * len(AXES))
COLUMNS = LINEAR.all
LINE_COLUMNS = (
    "line", "seconds", "dwell_s", "length_mm", "feed_mm_s", "achieved_mm_s", "fastest_mm_s", "lost_s",
    "limit", "at_limit_s",
)  # fmt: skip
SLOW_COLUMNS = (
    "stretch", "t_s", "seconds", "lost_s", "line", "X_mm", "Y_mm", "Z_mm", "slowest_mm_s", "feed_mm_s",
    "limit",
)  # fmt: skip
#: Rows in memory at a time.
ROWS = 1 << 14
#: A cycle that gives more samples than this is refused as a mistake.
MOST_SAMPLES = 200_000_000
#: Nanoseconds per second.
_NANO = 1_000_000_000


def check_cycle(trajectory: Trajectory, cycle_s: float) -> None:
    """Raises UsageError for a cycle that is not above 0, or so short that samples would be too many."""
    if not 0.0 < cycle_s < math.inf:
        raise UsageError(f"the cycle is {cycle_s:g} s; expected a time above 0")
    if trajectory.duration_s / cycle_s > MOST_SAMPLES:
        raise UsageError(
            f"a cycle of {cycle_s:g} s cuts {trajectory.duration_s:.1f} s into too many samples; expected at "
            f"most {MOST_SAMPLES}"
        )


def _times(trajectory: Trajectory, cycle_s: float) -> np.ndarray:
    check_cycle(trajectory, cycle_s)
    return trajectory.sample_times(cycle_s)


def rows(trajectory: Trajectory, cycle_s: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(numbers (n, 1 + 3 axes), lines (n,)) of the samples at the control's cycle, a block at a time.
    Raises as `check_cycle`."""
    times = _times(trajectory, cycle_s)
    for a in range(0, len(times), ROWS):
        t = times[a : a + ROWS]
        position, velocity, acceleration, _, line = trajectory.at(t)
        yield np.column_stack((t, position, velocity, acceleration)), line


def csv(trajectory: Trajectory, cycle_s: float, columns: Columns = LINEAR) -> Iterator[bytes]:
    """The samples as CSV. Every number has the digits that read back exactly."""
    yield (",".join(columns.all) + "\n").encode()
    for numbers, lines in rows(trajectory, cycle_s):
        # adding 0.0 makes 0 of -0
        text = (
            ",".join(map(repr, row)) + f",{line}\n"
            for row, line in zip((numbers + 0.0).tolist(), lines.tolist(), strict=True)
        )
        yield "".join(text).encode()


class _Parts(io.RawIOBase):
    """Keeps what is written until `take`."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data: object) -> int:
        part = bytes(memoryview(data))  # type: ignore[arg-type]
        self._parts.append(part)
        return len(part)

    def take(self) -> bytes:
        done, self._parts = b"".join(self._parts), []
        return done


def npz(trajectory: Trajectory, cycle_s: float, columns: Columns = LINEAR) -> Iterator[bytes]:
    """The samples, and the pieces of motion that they come from (see `olp.trajectory.motion.Motion`)."""
    motion, axes = trajectory.motion, len(columns.names)
    count = len(_times(trajectory, cycle_s))

    def part(a: int, b: int | None) -> Iterator[np.ndarray]:
        return (n[:, a] if b is None else n[:, a:b] for n, _ in rows(trajectory, cycle_s))

    # axes of several units have their names and units beside them
    names = ("position_mm", "velocity_mm_s", "acceleration_mm_s2")
    if columns is not LINEAR:
        names = ("position", "velocity", "acceleration")
    sampled: dict[str, tuple[tuple[int, ...], npt.DTypeLike, Callable[[], Iterator[np.ndarray]]]] = {
        "t_s": ((count,), np.float64, lambda: part(0, None)),
        **{
            name: ((count, axes), np.float64, partial(part, 1 + k * axes, 1 + (k + 1) * axes))
            for k, name in enumerate(names)
        },
        "line": ((count,), np.int64, lambda: (lines for _, lines in rows(trajectory, cycle_s))),
    }
    pieces = {
        "piece_start_s": motion.start_s, "piece_time": motion.time, "piece_path": motion.path,
        "piece_shape": motion.shape, "piece_line": motion.line,
    }  # fmt: skip
    if columns is not LINEAR:
        pieces |= {"axes": np.array(columns.names), "units": np.array(columns.units)}
    sink = _Parts()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, (shape, kind, blocks) in sampled.items():
            yield from _member(archive, sink, name, shape, kind, blocks())
        for name, array in pieces.items():
            parts = (array[a : a + ROWS] for a in range(0, len(array), ROWS))
            yield from _member(archive, sink, name, array.shape, array.dtype, parts)
    yield sink.take()


def _member(
    archive: zipfile.ZipFile, sink: _Parts, name: str, shape: tuple[int, ...], kind: npt.DTypeLike,
    blocks: Iterator[np.ndarray],
) -> Iterator[bytes]:  # fmt: skip
    """One array of an NPZ file, written block by block in numpy's own format."""
    entry = zipfile.ZipInfo(f"{name}.npy")
    entry.compress_type = zipfile.ZIP_DEFLATED
    with archive.open(entry, "w", force_zip64=True) as member:
        header = {"descr": np.dtype(kind).str, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(member, header)
        for block in blocks:
            member.write(np.ascontiguousarray(block, kind).tobytes())
            yield sink.take()


def parquet(trajectory: Trajectory, cycle_s: float, columns: Columns = LINEAR) -> Iterator[bytes]:
    """The columns of the CSV. Raises ConfigError where pyarrow is not installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise ConfigError("Parquet needs pyarrow, which is not installed; install it or write CSV") from None
    sink = _Parts()
    schema = pa.schema([(name, pa.int64() if name == "line" else pa.float64()) for name in columns.all])
    with pq.ParquetWriter(sink, schema) as writer:
        for numbers, lines in rows(trajectory, cycle_s):
            table = dict(zip(columns.all, [*numbers.T, lines], strict=True))
            writer.write_table(pa.table(table, schema=schema))
            yield sink.take()
    yield sink.take()


def ros(trajectory: Trajectory, cycle_s: float, columns: Columns = LINEAR) -> Iterator[bytes]:
    """A trajectory_msgs/JointTrajectory in JSON: metres and radians, and times from the start."""
    before = '{"joint_names": ' + json.dumps(list(columns.names)) + ', "points": [\n'
    axes = len(columns.names)
    factor = [1e-3 if unit == "mm" else math.pi / 180.0 for unit in columns.units]

    def scaled(values: list[float]) -> list[float]:
        return [value * one for value, one in zip(values, factor, strict=True)]

    for numbers, _ in rows(trajectory, cycle_s):
        points = []
        for row in (numbers + 0.0).tolist():
            seconds, nanosec = divmod(round(row[0] * _NANO), _NANO)
            points.append(
                json.dumps(
                    {
                        "positions": scaled(row[1 : 1 + axes]),
                        "velocities": scaled(row[1 + axes : 1 + 2 * axes]),
                        "accelerations": scaled(row[1 + 2 * axes :]),
                        "time_from_start": {"sec": seconds, "nanosec": nanosec},
                    }
                )
            )
        yield (before + ",\n".join(points)).encode()
        before = ",\n"
    yield b"\n]}\n"


def pvt(trajectory: Trajectory, cycle_s: float, columns: Columns = LINEAR) -> Iterator[bytes]:
    """Position, velocity and time of each cycle, as PVT controls take them: times count from the point
    before."""
    pairs = zip(columns.of_place, columns.of_speed, strict=True)
    yield (",".join(("dt_s", *(name for pair in pairs for name in pair))) + "\n").encode()
    axes, before = len(columns.names), 0.0
    for numbers, _ in rows(trajectory, cycle_s):
        lines = []
        for t, *row in (numbers + 0.0).tolist():
            both = zip(row[:axes], row[axes : 2 * axes], strict=True)
            lines.append(",".join(map(repr, (t - before, *(v for pair in both for v in pair)))) + "\n")
            before = t
        yield "".join(lines).encode()


def _head(columns: Sequence[str], origin: Origin | None) -> bytes:
    more = Files(origin).head
    names = (f"line{more}" if column == "line" else column for column in columns)
    return (",".join(names) + "\n").encode()


def lines_csv(use: LineUse, origin: Origin | None = None, limits: Sequence[str] = LIMITS) -> Iterator[bytes]:
    """One row per line that moves, with its file where `origin` has several. The feed of a line with rapids
    only is empty. `limits` are the names of the limits of the motion."""
    yield _head(LINE_COLUMNS, origin)
    files = Files(origin)
    limit = use.limit()
    held = use.at_limit_s[np.arange(len(use)), limit]
    columns = (
        use.line, use.seconds, use.dwell_s, use.length_mm, use.feed_mm_s, use.achieved_mm_s(),
        use.fastest_mm_s, use.lost_s(),
    )  # fmt: skip
    for a in range(0, len(use), ROWS):
        part = zip(*(c[a : a + ROWS].tolist() for c in (*columns, limit, held)), strict=True)
        texts = []
        for line, seconds, dwell, length, feed, achieved, fastest, lost, which, at_limit in part:
            shown = f"{feed:.6g}" if np.isfinite(feed) else ""
            texts.append(
                f"{files.cells(line)},{seconds:.9f},{dwell:.9g},{length:.6f},{shown},{achieved:.6g},{fastest:.6g},"
                f"{lost:.9f},{limits[which]},{at_limit:.9f}\n"
            )
        yield "".join(texts).encode()


def slow_csv(
    parts: Sequence[SlowStretches], origin: Origin | None = None, limits: Sequence[str] = LIMITS
) -> Iterator[bytes]:
    """One row per section below half the feed, with its file where `origin` has several. Times count from the
    start of its stretch. `limits` are the names of the limits of the motion."""
    yield _head(SLOW_COLUMNS, origin)
    files = Files(origin)
    for stretch, slow in enumerate(parts, 1):
        for i in range(len(slow)):
            x, y, z = slow.position_mm[i].tolist()
            line = files.cells(int(slow.line[i]))
            yield (
                f"{stretch},{slow.start_s[i]:.6f},{slow.seconds[i]:.6f},{slow.lost_s[i]:.6f},{line},"
                f"{x:.6f},{y:.6f},{z:.6f},{slow.slowest_mm_s[i]:.6g},{slow.feed_mm_s[i]:.6g},"
                f"{limits[int(slow.limit[i])]}\n"
            ).encode()
