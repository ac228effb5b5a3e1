"""Trajectories as files: CSV, NPZ, Parquet, ROS JointTrajectory as JSON, and a table of PVT points."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator

import numpy as np

from olp.exceptions import ConfigError
from olp.trajectory.plan import Trajectory

AXES = "XYZ"
COLUMNS = (
    "t_s",
    *(f"{a}_mm" for a in AXES),
    *(f"V{a}_mm_s" for a in AXES),
    *(f"A{a}_mm_s2" for a in AXES),
    "line",
)
#: rows that are in memory at a time
_ROWS = 1 << 14


def rows(trajectory: Trajectory, cycle_s: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(numbers (n, 10), lines (n,)) of the samples at the control's cycle, a block at a time."""
    times = trajectory.sample_times(cycle_s)
    for a in range(0, len(times), _ROWS):
        t = times[a : a + _ROWS]
        position, velocity, acceleration, _, line = trajectory.at(t)
        yield np.column_stack((t, position, velocity, acceleration)), line


def csv(trajectory: Trajectory, cycle_s: float) -> Iterator[bytes]:
    """The samples as CSV, a block at a time; every number in the digits that give it back exactly."""
    yield (",".join(COLUMNS) + "\n").encode()
    for numbers, lines in rows(trajectory, cycle_s):
        # adding 0.0 makes 0 of -0
        text = (
            ",".join(map(repr, row)) + f",{line}\n"
            for row, line in zip((numbers + 0.0).tolist(), lines.tolist(), strict=True)
        )
        yield "".join(text).encode()


def npz(trajectory: Trajectory, cycle_s: float) -> bytes:
    """The samples, and the pieces that they are taken from (see `olp.trajectory.motion.Motion`)."""
    blocks = list(rows(trajectory, cycle_s))
    table = np.concatenate([b[0] for b in blocks])
    motion = trajectory.motion
    sink = io.BytesIO()
    np.savez_compressed(
        sink,
        t_s=table[:, 0], position_mm=table[:, 1:4], velocity_mm_s=table[:, 4:7],
        acceleration_mm_s2=table[:, 7:10], line=np.concatenate([b[1] for b in blocks]),
        piece_start_s=motion.start_s, piece_time=motion.time, piece_path=motion.path,
        piece_shape=motion.shape, piece_line=motion.line,
    )  # fmt: skip
    return sink.getvalue()


def parquet(trajectory: Trajectory, cycle_s: float) -> bytes:
    """The columns of the CSV. Raises ConfigError where pyarrow is not installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise ConfigError("Parquet needs pyarrow, which is not installed; install it or write CSV") from None
    sink = io.BytesIO()
    schema = pa.schema([(name, pa.int64() if name == "line" else pa.float64()) for name in COLUMNS])
    with pq.ParquetWriter(sink, schema) as writer:
        for numbers, lines in rows(trajectory, cycle_s):
            columns = [*numbers.T, lines]
            writer.write_table(pa.table(dict(zip(COLUMNS, columns, strict=True)), schema=schema))
    return sink.getvalue()


def ros(trajectory: Trajectory, cycle_s: float) -> bytes:
    """A trajectory_msgs/JointTrajectory in JSON: metres, and times from the start."""
    points = []
    for numbers, _ in rows(trajectory, cycle_s):
        for row in numbers.tolist():
            seconds = int(row[0])
            points.append(
                {
                    "positions": [v * 1e-3 for v in row[1:4]],
                    "velocities": [v * 1e-3 for v in row[4:7]],
                    "accelerations": [v * 1e-3 for v in row[7:10]],
                    "time_from_start": {"sec": seconds, "nanosec": round((row[0] - seconds) * 1e9)},
                }
            )
    return json.dumps({"joint_names": list(AXES), "points": points}).encode()


def pvt(trajectory: Trajectory, cycle_s: float) -> Iterator[bytes]:
    """Position, velocity and time of each cycle, times counted from the point before, as PVT controls take
    them."""
    yield b"dt_s,X_mm,VX_mm_s,Y_mm,VY_mm_s,Z_mm,VZ_mm_s\n"
    before = 0.0
    for numbers, _ in rows(trajectory, cycle_s):
        out = []
        for t, x, y, z, vx, vy, vz, *_rest in (numbers + 0.0).tolist():
            out.append(f"{t - before!r},{x!r},{vx!r},{y!r},{vy!r},{z!r},{vz!r}\n")
            before = t
        yield "".join(out).encode()
