"""`retime` on machines with rotary joints: every axis inside its limits, the tip inside its feed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from olp.compensation.joints.motion import Motion
from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.progress import Progress, silent
from olp.core.toolpath import BLEND_MM
from olp.core.values import dataclass
from olp.files.write import write_bytes
from olp.kinematics.structure import Structure
from olp.trajectory.from_joints import JointRoute, limits_of, routes_of
from olp.trajectory.motion import Motion as PlannedMotion
from olp.trajectory.plan import Trajectory, plan
from olp.trajectory.route import AxisLimits
from olp.workflows.flatten import UnrollOptions
from olp.workflows.joints.loaded import JointRun
from olp.workflows.session import PathLike
from olp.workflows.shown import Shown

#: Rounds in which feeds are lowered where the tip is faster than its feed.
_ROUNDS = 5
#: The tip may be faster than its feed by this share of it.
_FASTER = 1e-3
#: Samples of a piece of the motion at which the tip is looked at, as shares of its time.
_SHARES = (0.0, 0.25, 0.5, 0.75)
#: Places of a piece of the motion between which its way is about straight.
_STEPS = 9
#: Lines of the table of those that take longest.
_LONGEST = 10
#: From this share a limit counts as reached.
_AT_LIMIT = 0.98
#: Rows of a file at a time.
_ROWS = 1 << 14
_WORDS = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRetimeOptions(UnrollOptions):
    """The options of `retime` on such machines."""

    blend_mm: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """A motion between rests at unknown positions. By piece (p,): `ratio` is the speed of the tip to its feed
    at most. `limit` is the limit that it is nearest to: three of each axis, -1 is the feed."""

    route: JointRoute
    trajectory: Trajectory
    ratio: Array
    limit: Index


@dataclass(frozen=True, slots=True, eq=False)
class JointRetiming(Shown):
    """The motion of a program: `trajectories` in the space of their routes, which `at` turns into axis
    values; the report ("olp-joint-retime-1")."""

    structure: Structure
    stretches: tuple[_Stretch, ...]
    report: dict[str, Any]
    findings: tuple[()] = ()

    @property
    def duration_s(self) -> float:
        return float(sum(s.trajectory.duration_s for s in self.stretches))

    def seconds(self, move: Index, share: Array) -> Array:
        """(n,) s at which the motion is about at shares of moves, NaN where none is planned."""
        result, begin = np.full(len(move), np.nan), 0.0
        for one in self.stretches:
            route, pieces = one.route, one.trajectory.motion
            end = np.zeros(len(route.line) + 1)
            np.maximum.at(end, pieces.line + 1, pieces.start_s[1:])
            end = np.maximum.accumulate(end)
            key = np.append(float(route.move[0]), route.move + route.share)
            rows = np.flatnonzero((move >= route.move[0]) & (move <= route.move[-1]))
            time, way = _ways(pieces)
            place = np.interp(move[rows] + share[rows], key, np.interp(end, time, way))
            result[rows] = begin + np.interp(place, way, time)
            begin += one.trajectory.duration_s
        return result

    def at(self, stretch: int, time_s: Array) -> tuple[Array, Array, Array, Array, Index]:
        """Axis values in mm and deg, their velocities, accelerations and jerks, (n, axes) each, and lines
        (n,), at times (n,) s of a stretch, counted from 0."""
        one = self.stretches[stretch]
        position, velocity, acceleration, jerk, segment = one.trajectory.at(time_s)
        scale = one.route.scale
        return position / scale, velocity / scale, acceleration / scale, jerk / scale, one.route.line[segment]

    def to_text(self) -> str:
        """The report as `olp retime` prints it."""
        from olp.reports.joint_retime import to_text

        return to_text(self.report)

    def to_csv(self, cycle_s: float = 1e-3) -> Iterator[bytes]:
        """Axis values, velocities and accelerations at the cycles of the control, and the line. Stretches
        follow one another."""
        units = [
            f"{name}_{unit}" for name, unit in zip(self.structure.order, self.structure.units, strict=True)
        ]
        head = ["t_s", *units, *(f"V{u}_s" for u in units), *(f"A{u}_s2" for u in units), "line"]
        yield (",".join(head) + "\n").encode()
        begin = 0.0
        for number, one in enumerate(self.stretches):
            times = one.trajectory.sample_times(cycle_s)
            for a in range(0, len(times), _ROWS):
                some = times[a : a + _ROWS]
                position, velocity, acceleration, _, line = self.at(number, some)
                table = np.column_stack((begin + some, position, velocity, acceleration)) + 0.0
                rows = zip(table.tolist(), line.tolist(), strict=True)
                yield "".join(f"{','.join(f'{v:.9g}' for v in row)},{n}\n" for row, n in rows).encode()
            begin += one.trajectory.duration_s

    def write(self, path: PathLike, cycle_s: float = 1e-3, *, force: bool = False) -> Path:
        """Write the samples as CSV, whole or not at all."""
        write_bytes(path, self.to_csv(cycle_s), force=force)
        return Path(path)


def retime_joints(
    program: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    blend_mm: float | None = None,
    flatten: bool = False,
    expand_cycles: bool = False,
    progress: Progress | None = None,
) -> JointRetiming:
    """The fastest motion found along a program that keeps every axis inside its limits of velocity,
    acceleration and jerk, the tip inside its feed, and within the path tolerance.

    `blend_mm` is the path tolerance where the program names none; it has priority over the machine file.
    Raises as `correct_joints`, and ConfigError where the machine file leaves a limit out.
    """
    options = JointRetimeOptions(blend_mm=blend_mm, flatten=flatten, expand_cycles=expand_cycles)
    return retimed(JointRun.of(program, machine, job), options, progress)


def retimed(run: JointRun, options: JointRetimeOptions, progress: Progress | None = None) -> JointRetiming:
    """As `retime_joints`, for a run that is loaded."""
    limits_of(run.machine.structure)
    with run.program.errors():
        _, path = run.read(run.program, options)
    return motion_of(run, path, options, progress)


def motion_of(
    run: JointRun, path: JointPath, options: JointRetimeOptions, progress: Progress | None = None, *,
    optimise: bool | None = None,
) -> JointRetiming:  # fmt: skip
    """As `retime_joints`, for a path that was read. `optimise` is that of `plan`."""
    tell = progress or silent
    structure, control = run.machine.structure, run.machine.control
    limits = limits_of(structure)
    stated = (options.blend_mm, None if control is None else control.blend_mm, BLEND_MM)
    blend_mm = next(value for value in stated if value is not None)
    with path.program.errors():
        routes = routes_of(path, blend_mm)
    if not routes:
        raise CannotCompute(
            "no move of the program begins and ends at known positions of all axes, so nothing can be timed; "
            "command all axes first",
            file=run.program.name or None,
        )
    stretches = tuple(_planned(path.motion, route, limits, optimise, tell) for route in routes)
    timed = np.unique(np.concatenate([one.route.line for one in stretches]))
    # the first row of a list is where the motion begins
    moving = np.isfinite(path.end).all(axis=1) & ~np.isfinite(path.start).all(axis=1)
    moving &= path.listed is None
    report = {
        "schema": "olp-joint-retime-1",
        "program": Path(run.program.name).name if run.program.name else "",
        **run.heads(),
        "blend_mm": blend_mm,
        "waypoints": int(sum(len(route.route) for route in routes)),
        "untimed": {"moves": int(moving.sum()), "lines": np.unique(path.line[moving])[:_LONGEST].tolist()},
        **_summary(structure, stretches, timed),
    }
    return JointRetiming(structure, stretches, report)


def _planned(
    motion: Motion, route: JointRoute, limits: AxisLimits, optimise: bool | None, tell: Progress
) -> _Stretch:
    """The motion of a route, again with lower feeds where the tip would be faster than its own."""
    scaled = AxisLimits(
        limits.velocity * route.scale, limits.acceleration * route.scale, limits.jerk * route.scale
    )
    for left in reversed(range(_ROUNDS)):
        found = plan(route.route, scaled, tell, optimise=optimise)
        ratio, limit = _used(motion, route, found, scaled)
        factor = np.ones(len(route.line))
        np.maximum.at(factor, found.motion.line, ratio)
        if left == 0 or not (factor > 1.0 + _FASTER).any():
            return _Stretch(route, found, ratio, limit)
        route = route.slower(factor)
    raise AssertionError("the last round returns")


def _used(motion: Motion, route: JointRoute, found: Trajectory, limits: AxisLimits) -> tuple[Array, Index]:
    """`ratio` and `limit` of a stretch. The limits of an axis are velocity, acceleration and jerk."""
    pieces = found.motion
    count, seconds = len(pieces), np.diff(pieces.start_s)
    ratio, most = np.zeros(count), np.zeros((count, 3 * len(limits.velocity)))
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    for a in range(0, count, _ROWS):
        piece = np.arange(a, min(a + _ROWS, count))
        segment = pieces.line[piece]
        for share in _SHARES:
            position, *rates = pieces.of(piece, share * seconds[piece])
            for k, (rate, bound) in enumerate(zip(rates, bounds, strict=True)):
                most[piece, k::3] = np.maximum(most[piece, k::3], np.abs(rate) / bound)
            slopes = motion.slopes(position / route.scale, route.tool[segment])[:, :3]
            rotary = np.array([unit == "deg" for unit in motion.structure.units])
            rate = rates[0] / route.scale
            tip = np.einsum("nij,nj->ni", slopes, np.where(rotary, np.radians(rate), rate))
            fast = np.linalg.norm(tip, axis=1) / route.feed_mm_s[segment]
            ratio[piece] = np.maximum(ratio[piece], fast)
    nearest = most.argmax(axis=1)
    return ratio, np.where(ratio >= most.max(axis=1), -1, nearest)


def _ways(motion: PlannedMotion) -> tuple[Array, Array]:
    """Times in order, and the length of the path up to each."""
    width, share = np.diff(motion.start_s), np.linspace(0.0, 1.0, _STEPS)
    piece = np.arange(len(motion)).repeat(_STEPS)
    after = (width[:, None] * share).ravel()
    step = np.linalg.norm(np.diff(motion.positions(piece, after), axis=0), axis=1)
    return motion.start_s[piece] + after, np.append(0.0, np.cumsum(step))


def _names(structure: Structure) -> list[str]:
    return [f"{name} {word}" for name in structure.order for word in _WORDS]


def _summary(structure: Structure, stretches: tuple[_Stretch, ...], lines: Index) -> dict[str, Any]:
    """How long, where, and what slows it down."""
    names = [*_names(structure), "feed"]
    seconds, by_limit = np.zeros(len(lines)), np.zeros((len(lines), len(names)))
    solvers: dict[str, float] = {}
    largest = dict.fromkeys(_WORDS, 0.0)
    dwell = feed = 0.0
    for one in stretches:
        pieces = one.trajectory.motion
        width = np.diff(pieces.start_s)
        row = np.searchsorted(lines, one.route.line[pieces.line])
        np.add.at(seconds, row, width)
        np.add.at(by_limit, (row, one.limit), width)
        dwell += float(one.route.route.dwell_s.sum())
        feed = max(feed, float(one.ratio.max(initial=0.0)))
        for leg in one.trajectory.legs:
            solvers[leg.solver] = solvers.get(leg.solver, 0.0) + leg.duration_s
        for word in _WORDS:
            largest[word] = max(largest[word], float(getattr(one.trajectory.audit, word).max()))
    longest = np.argsort(-seconds, kind="stable")[:_LONGEST]
    total = float(seconds.sum())
    return {
        "duration_s": total,
        "dwell_s": dwell,
        "solvers_s": solvers,
        "largest_share_of_limit": largest | {"feed": feed},
        "nearest_limit": {
            name: float(share)
            for name, share in zip(names, (by_limit.sum(axis=0) / max(total, 1e-300)).tolist(), strict=True)
            if share > 0.0
        },
        "stretches": [
            {
                "first_line": int(one.route.line.min()),
                "last_line": int(one.route.line.max()),
                "duration_s": one.trajectory.duration_s,
            }
            for one in stretches
        ],
        "longest_lines": [
            {"line": int(lines[k]), "seconds": float(seconds[k]), "limit": names[int(by_limit[k].argmax())]}
            for k in longest.tolist()
        ],
    }
