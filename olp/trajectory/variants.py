"""Plans of the same program under other path tolerances, and under accelerations that bound a deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import CannotCompute, OlpError, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress
from olp.core.values import dataclass
from olp.program.feeds.actions import actions
from olp.program.feeds.moves import lengths_mm
from olp.program.feeds.timing import PathControl, path_modes
from olp.program.feeds.words import FeedsWritten, Shared, check_feeds, write_feeds
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.trajectory.from_program import CHORD_SHARE, EXACT_MM, routes
from olp.trajectory.inertia import Inertial, capped, guaranteed_cap
from olp.trajectory.plan import Trajectory, plan
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.usage import LineUse, SlowStretches, usage

#: plans with adapted accelerations before those that guarantee the bound of the inertial deviation
_TRIALS = 3
#: share by which a peak of acceleration between samples may exceed them
_BETWEEN = 1e-4
#: lines that a report lists
_LINES = 8


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A program to plan: its text as read, the path tolerance where it states none, the override of feeds
    (1: as programmed), and the routes that it drives."""

    name: str
    setup: Setup
    program: Program
    blend_mm: float
    blend_from: str
    block_delete: bool
    legs: tuple[Route, ...]
    override: float = 1.0

    def rewritten(self, data: bytes) -> Case:
        """The case of another text, read with the same options. Raises ProgramError."""
        options = Options(block_delete=self.block_delete)
        program = read(data, self.setup, self.program.dialect, options)
        # the machine's mode at the start is not in the text
        modes = (*(m for m in self.program.path_modes if m.line == 0), *program.path_modes)
        return replace(self, program=replace(program, path_modes=modes)).driven()

    def driven(self) -> Case:
        """The same with its routes."""
        legs = routes(
            self.program, blend_mm=self.blend_mm, block_delete=self.block_delete,
            times=self.setup.machine.times,
        )  # fmt: skip
        if self.override != 1.0:
            legs = tuple(replace(leg, feed_mm_s=leg.feed_mm_s * self.override) for leg in legs)
        return replace(self, legs=legs)

    def control(self) -> list[dict[str, Any]]:
        """What the program asks of the control beside motion, how often, and its time as far as stated."""
        asked = actions(self.program, block_delete=self.block_delete)
        return [] if asked is None else asked.rows(self.setup.machine.times)

    def scaled(self, factor: float) -> Case:
        """The same with all path tolerances, also those that the program states, times a factor."""
        modes = tuple(
            mode if mode.tolerance_mm is None else replace(mode, tolerance_mm=mode.tolerance_mm * factor)
            for mode in self.program.path_modes
        )
        program = replace(self.program, path_modes=modes)
        return replace(self, program=program, blend_mm=self.blend_mm * factor).driven()

    def tolerances(self) -> dict[str, Any]:
        """Which path tolerances are in use, and where they come from."""
        modes = path_modes(self.program, block_delete=self.block_delete)
        path = self.program.toolpath
        blends = [m for m in modes if m.control == PathControl.BLEND]
        stated = {m.stated_mm * 1e3 for m in blends if m.stated_mm is not None}
        first = int(path.line[0]) if len(path) else 0
        bare = not modes or modes[0].line > first or any(m.stated_mm is None for m in blends)
        return {
            "stated_um": sorted(stated),
            "default_um": self.blend_mm * 1e3 if bare else None,
            "default_from": self.blend_from if bare else None,
            "exact_stop_at_start": bool(modes) and modes[0].line == 0,
        }

    def chords_mm(self) -> float:
        """How far the chords of arcs may be from the arcs."""
        if not len(self.program.toolpath.arcs):
            return 0.0
        stated = self.tolerances()
        widest = max((v for v in (*stated["stated_um"], stated["default_um"]) if v), default=0.0) * 1e-3
        return CHORD_SHARE * max(widest, EXACT_MM)

    def untimed(self) -> dict[str, Any]:
        """Moves from or to positions that only the control knows: how many, and their first lines."""
        path = self.program.toolpath
        line = self.program.original_lines(path.line[np.isnan(lengths_mm(path))])
        return {"moves": len(line), "lines": np.unique(line)[:_LINES].tolist()}


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A case planned within limits: one trajectory per route. How they use the limits is found when it is
    asked for: plans of which only the time counts need it not."""

    case: Case
    limits: AxisLimits
    trajectories: tuple[Trajectory, ...]
    _used: list[tuple[LineUse, tuple[SlowStretches, ...]]] = field(
        default_factory=list, init=False, repr=False
    )

    @property
    def lines(self) -> LineUse:
        """Time, speed and limit of each line."""
        return self._usage()[0]

    @property
    def slow(self) -> tuple[SlowStretches, ...]:
        """Of each route, where the speed is below half the feed."""
        return self._usage()[1]

    def _usage(self) -> tuple[LineUse, tuple[SlowStretches, ...]]:
        if not self._used:
            used = [usage(t, leg) for t, leg in zip(self.trajectories, self.case.legs, strict=True)]
            self._used.append((LineUse.joined([lines for lines, _ in used]), tuple(slow for _, slow in used)))
        return self._used[0]

    @property
    def duration_s(self) -> float:
        return sum(t.duration_s for t in self.trajectories)

    @property
    def blending_mm(self) -> float:
        """The largest distance of the motion from the chords of the path."""
        return max((leg.deviation_mm for t in self.trajectories for leg in t.legs), default=0.0)

    def in_original(self) -> Plan:
        """The same with the lines of the text that the program was unrolled from, as people are told them."""
        program = self.case.program
        if program.origin is None:
            return self
        line_of = program.original_lines
        legs = tuple(replace(leg, line=line_of(leg.line)) for leg in self.case.legs)
        motions = (replace(t.motion, line=line_of(t.motion.line)) for t in self.trajectories)
        numbered = Plan(
            replace(self.case, legs=legs), self.limits,
            tuple(replace(t, motion=m) for t, m in zip(self.trajectories, motions, strict=True)),
        )  # fmt: skip
        slow = tuple(replace(slow, line=line_of(slow.line)) for slow in self.slow)
        numbered._used.append((self.lines.numbered(line_of(self.lines.line)), slow))
        return numbered


def planned(case: Case, limits: AxisLimits, tell: Progress, what: str = "plan") -> Plan:
    """Plan every route of a case. Raises CannotCompute as `olp.trajectory.plan.plan`."""
    with case.program.errors():
        trajectories = _motions(case.legs, limits, tell, what)
    return Plan(case, limits, trajectories)


def _motions(legs: Sequence[Route], limits: AxisLimits, tell: Progress, what: str) -> tuple[Trajectory, ...]:
    edges = np.cumsum([0, *map(len, legs)]) / max(sum(map(len, legs)), 1)
    return tuple(
        plan(leg, limits, lambda _, part, a=a, b=b: tell(what, a + part * (b - a)), share=b - a)  # type: ignore[misc]
        for leg, (a, b) in zip(legs, pairwise(edges.tolist()), strict=True)
    )


def within_inertial(
    case: Case, limits: AxisLimits, compliance: Array, most_mm: float, tell: Progress
) -> Plan:
    """Plan with accelerations so low that the inertial deviation is nowhere above `most_mm`.

    The cap of each axis' own shift of the tool is lowered by the excess of the plan before. Where that does
    not converge, it is set so that no motion can exceed the bound. Raises UsageError for a machine without
    compliance, and for a bound that is not above 0.
    """
    if not most_mm > 0.0:
        raise UsageError(f"the bound of the inertial deviation is {most_mm * 1e3:g} um; expected more than 0")
    if not compliance.any():
        raise UsageError(
            "the machine file states no compliance, so inertial deviation cannot be bounded; give "
            "compliance_um_per_m_s2 in [axes.X], [axes.Y] or [axes.Z]"
        )
    guaranteed = guaranteed_cap(limits, compliance, most_mm) * (1.0 - 2.0 * _BETWEEN)
    size = np.sqrt((compliance * compliance).sum(axis=0))
    cap = float((size * limits.acceleration).max())
    for trial in range(_TRIALS + 1):
        cap = guaranteed if trial == _TRIALS else max(cap, guaranteed)
        result = planned(case, capped(limits, compliance, cap), tell, "plan" if trial == 0 else "bound")
        largest = max((Inertial.of(t.motion, compliance).most_mm for t in result.trajectories), default=0.0)
        if largest * (1.0 + _BETWEEN) <= most_mm:
            return result
        # a cap above the largest deviation did not bind
        cap = min(cap, largest) * (most_mm / largest) * (1.0 - 1e-3)
    raise CannotCompute(f"no plan keeps the inertial deviation within {most_mm * 1e3:g} um")


def with_feeds(base: Plan, shared: Shared, tell: Progress) -> tuple[bytes, dict[str, Any]]:
    """The text with the planned feeds in its F words, read back and planned again, and a report of it;
    `duration_s` is the time of the text with these feeds.

    Raises ProgramError for a feed that cannot be written, CannotCompute where it does not read back.
    """
    case = base.case
    try:
        written, kept = written_feeds(case.program, base.lines, shared, block_delete=case.block_delete)
    except OlpError as error:
        raise (error.in_file(case.name) if case.name else error) from None
    # the written text has lines of its own
    other = case.rewritten(bytes(written.data))
    check_feeds(case.program, other.program, block_delete=case.block_delete)
    again = planned(other, base.limits, tell, "feeds")
    return written.data, feeds_report(written, kept, shared, again.duration_s)


def written_feeds(
    program: Program, lines: LineUse, shared: Shared, *, block_delete: bool
) -> tuple[FeedsWritten, list[int]]:
    """The text of a program with the planned feeds of its lines in the F words, and the lines that keep
    theirs. Raises ProgramError for a feed that cannot be written."""
    fed = np.flatnonzero((lines.feed_length_mm > 0.0) & (lines.feed_seconds > 0.0))
    planned_s = lines.feed_seconds[fed]
    with program.errors():
        written = write_feeds(
            program, lines.line[fed], planned_s, planned_s - lines.lost_s()[fed], shared=shared,
            block_delete=block_delete,
        )  # fmt: skip
    return written, np.unique(program.original_lines(written.kept)).tolist()


def feeds_report(written: FeedsWritten, kept: list[int], shared: Shared, duration_s: float) -> dict[str, Any]:
    """What a report says of written feeds; the text with them takes `duration_s`."""
    return {
        "words": written.words,
        "changed": written.changed,
        "shared": written.shared,
        "rule": shared,
        "slower_lines": written.slower,
        "kept_lines": kept,
        "duration_s": duration_s,
    }


def blend_study(case: Case, base: Plan, factors: Sequence[float], tell: Progress) -> list[dict[str, Any]]:
    """Time and path deviation at multiples of the path tolerances in use; `base` is the plan at 1."""
    rows = []
    path = case.tolerances()
    used_um = [v for v in (*path["stated_um"], path["default_um"]) if v]
    for factor in factors:
        other = (
            base if factor == 1.0 else planned(case.scaled(factor), base.limits, tell, f"blend x{factor:g}")
        )
        rows.append(
            {
                "factor": factor,
                "tolerance_um": [v * factor for v in used_um],
                "duration_s": other.duration_s,
                "deviation_um": other.blending_mm * 1e3,
            }
        )
    return rows
