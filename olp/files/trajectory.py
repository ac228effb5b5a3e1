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

import numpy as np
import numpy.typing as npt

from olp.core.errors import ConfigError, UsageError
from olp.core.units import AXES
from olp.program.origin import Files, Origin
from olp.trajectory.plan import Trajectory
from olp.trajectory.usage import LIMITS, LineUse, SlowStretches

COLUMNS = (
    "t_s",
    *(f"{a}_mm" for a in AXES),
    *(f"V{a}_mm_s" for a in AXES),
    *(f"A{a}_mm_s2" for a in AXES),
    "line",
)
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
    """(numbers (n, 10), lines (n,)) of the samples at the control's cycle, a block at a time. Raises as
    `check_cycle`."""
    times = _times(trajectory, cycle_s)
    for a in range(0, len(times), ROWS):
        t = times[a : a + ROWS]
        position, velocity, acceleration, _, line = trajectory.at(t)
        yield np.column_stack((t, position, velocity, acceleration)), line


def csv(trajectory: Trajectory, cycle_s: float) -> Iterator[bytes]:
    """The samples as CSV. Every number has the digits that read back exactly."""
    yield (",".join(COLUMNS) + "\n").encode()
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


def npz(trajectory: Trajectory, cycle_s: float) -> Iterator[bytes]:
    """The samples, and the pieces of motion that they come from (see `olp.trajectory.motion.Motion`)."""
    motion = trajectory.motion
    count = len(_times(trajectory, cycle_s))

    def columns(a: int, b: int | None) -> Iterator[np.ndarray]:
        return (n[:, a] if b is None else n[:, a:b] for n, _ in rows(trajectory, cycle_s))

    sampled: dict[str, tuple[tuple[int, ...], npt.DTypeLike, Callable[[], Iterator[np.ndarray]]]] = {
        "t_s": ((count,), np.float64, lambda: columns(0, None)),
        "position_mm": ((count, 3), np.float64, lambda: columns(1, 4)),
        "velocity_mm_s": ((count, 3), np.float64, lambda: columns(4, 7)),
        "acceleration_mm_s2": ((count, 3), np.float64, lambda: columns(7, 10)),
        "line": ((count,), np.int64, lambda: (lines for _, lines in rows(trajectory, cycle_s))),
    }
    pieces = {
        "piece_start_s": motion.start_s, "piece_time": motion.time, "piece_path": motion.path,
        "piece_shape": motion.shape, "piece_line": motion.line,
    }  # fmt: skip
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


def parquet(trajectory: Trajectory, cycle_s: float) -> Iterator[bytes]:
    """The columns of the CSV. Raises ConfigError where pyarrow is not installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise ConfigError("Parquet needs pyarrow, which is not installed; install it or write CSV") from None
    sink = _Parts()
    schema = pa.schema([(name, pa.int64() if name == "line" else pa.float64()) for name in COLUMNS])
    with pq.ParquetWriter(sink, schema) as writer:
        for numbers, lines in rows(trajectory, cycle_s):
            columns = [*numbers.T, lines]
            writer.write_table(pa.table(dict(zip(COLUMNS, columns, strict=True)), schema=schema))
            yield sink.take()
    yield sink.take()


def ros(trajectory: Trajectory, cycle_s: float) -> Iterator[bytes]:
    """A trajectory_msgs/JointTrajectory in JSON: metres, and times from the start."""
    before = '{"joint_names": ' + json.dumps(list(AXES)) + ', "points": [\n'
    for numbers, _ in rows(trajectory, cycle_s):
        points = []
        for row in (numbers + 0.0).tolist():
            seconds, nanosec = divmod(round(row[0] * _NANO), _NANO)
            points.append(
                json.dumps(
                    {
                        "positions": [v * 1e-3 for v in row[1:4]],
                        "velocities": [v * 1e-3 for v in row[4:7]],
                        "accelerations": [v * 1e-3 for v in row[7:10]],
                        "time_from_start": {"sec": seconds, "nanosec": nanosec},
                    }
                )
            )
        yield (before + ",\n".join(points)).encode()
        before = ",\n"
    yield b"\n]}\n"


def pvt(trajectory: Trajectory, cycle_s: float) -> Iterator[bytes]:
    """Position, velocity and time of each cycle, as PVT controls take them: times count from the point
    before."""
    yield b"dt_s,X_mm,VX_mm_s,Y_mm,VY_mm_s,Z_mm,VZ_mm_s\n"
    before = 0.0
    for numbers, _ in rows(trajectory, cycle_s):
        lines = []
        for t, x, y, z, vx, vy, vz, *_rest in (numbers + 0.0).tolist():
            lines.append(f"{t - before!r},{x!r},{vx!r},{y!r},{vy!r},{z!r},{vz!r}\n")
            before = t
        yield "".join(lines).encode()


def _head(columns: Sequence[str], origin: Origin | None) -> bytes:
    more = Files(origin).head
    names = (f"line{more}" if column == "line" else column for column in columns)
    return (",".join(names) + "\n").encode()


def lines_csv(use: LineUse, origin: Origin | None = None) -> Iterator[bytes]:
    """One row per line that moves, with its file where `origin` has several. The feed of a line with rapids
    only is empty."""
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
                f"{lost:.9f},{LIMITS[which]},{at_limit:.9f}\n"
            )
        yield "".join(texts).encode()


def slow_csv(parts: Sequence[SlowStretches], origin: Origin | None = None) -> Iterator[bytes]:
    """One row per section below half the feed, with its file where `origin` has several. Times count from the
    start of its stretch."""
    yield _head(SLOW_COLUMNS, origin)
    files = Files(origin)
    for stretch, slow in enumerate(parts, 1):
        for i in range(len(slow)):
            x, y, z = slow.position_mm[i].tolist()
            line = files.cells(int(slow.line[i]))
            yield (
                f"{stretch},{slow.start_s[i]:.6f},{slow.seconds[i]:.6f},{slow.lost_s[i]:.6f},{line},"
                f"{x:.6f},{y:.6f},{z:.6f},{slow.slowest_mm_s[i]:.6g},{slow.feed_mm_s[i]:.6g},"
                f"{LIMITS[int(slow.limit[i])]}\n"
            ).encode()
