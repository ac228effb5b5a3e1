"""External axes of robot programs: a track that carries the arm, those that move nothing of concern, and
those that stay at one value."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from olp.core.errors import ProgramError
from olp.core.machine import Machine
from olp.program.robots.frames import Located
from olp.program.robots.poses import Pose
from olp.program.robots.targets import ABSENT, NOWHERE, Target


class External:
    """What the machine file says of external axes, and where those are that may move. `remark` notes the
    first of what is about the same, by its line and text. Where the machine is no arm, nothing counts from
    them."""

    def __init__(self, machine: Machine, remark: Callable[[str, int, str], None]) -> None:
        self._arm, self._track, self._declared = machine.arm, machine.track, machine.external
        self._errors = machine.track_errors
        self._remark = remark
        self._at: dict[int, float] = {}
        #: what the move before states of them, so that none moves on the way to the same
        self._before: tuple[float, ...] = ()
        self._frames: dict[tuple[str, float], Pose] = {}

    @property
    def counts(self) -> bool:
        """Whether a pose hangs on the value of one of them."""
        return self._track is not None or any(value is not None for value in self._declared.values())

    def moves(self, target: Target, line: int) -> bool:
        """Whether an axis moves on the way to a target, or may move, so that no part of that can be stated.
        One that the target does not state stays. Raises ProgramError where one is at a value at which it is
        not stated what it carries."""
        if (
            not self._arm
            or target.outer == self._before
            or min(map(abs, target.outer), default=ABSENT) >= ABSENT
        ):
            return False
        before = dict(self._at)
        for number, value in enumerate(target.outer, 1):
            if abs(value) >= ABSENT:
                continue
            stays = self._declared.get(number, 0.0)
            if number == 1 and self._track is not None:
                self._at[number] = value
                if self._errors and target.along != NOWHERE:
                    if before.get(number, value) != value:
                        what = "along straight moves the track is taken to go evenly with the tip"
                        self._remark("track", line, what)
                    before[number] = value
            elif stays is None:
                self._at[number] = value
                what = f"the external axis {number} is kept: it moves neither the arm nor the workpiece"
                self._remark(f"external {number}", line, f"{what}, as the machine file says")
            elif value != stays:
                raise ProgramError(_unknown(number, value, self._declared), line=line, code="OLP564")
        self._before = target.outer
        return self._at != before

    def frame(self, frame: Located, target: Target, line: int) -> Pose:
        """A frame of a pose as it counts from the carriage of an arm on a track. Raises ProgramError where
        the target does not state where that is."""
        if self._track is None:
            return frame.pose
        along = self._along(target, line)
        if not self._errors:
            what = "the arm is carried along its track: errors of the track itself are not corrected"
            self._remark("track", target.line, what)
        key = frame.name, along
        if key not in self._frames:
            x, y, z = (a - along * b for a, b in zip(frame.pose.origin_mm, self._track, strict=True))
            self._frames[key] = Pose((x, y, z), frame.pose.turn)
        return self._frames[key]

    def refuse_unplaced(self, target: Target, line: int) -> None:
        """Raises ProgramError where the errors of a track count, and a target in joints does not state where
        the carriage is."""
        if self._errors:
            self._along(target, line)

    def _along(self, target: Target, line: int) -> float:
        """Where the carriage is. Raises ProgramError where a target does not state it."""
        along = target.outer[0] if target.outer else ABSENT
        if abs(along) < ABSENT:
            return along
        without = "take the track out of the chain" if self._errors else "leave out track in [kinematics]"
        raise ProgramError(
            "the arm is on a track, and this target does not state its first external axis, so it is "
            f"not known where the carriage is. State it in the target, or {without} "
            "and count the work frames from the arm",
            line=line,
            code="OLP516",
        )


def differ(before: Target, after: Target) -> bool:
    """Whether an external axis moves from one target to another; one that is not stated stays."""
    begun = before.outer + (ABSENT,) * len(after.outer)
    return any(abs(b) < ABSENT and a != b for a, b in zip(begun, after.outer, strict=False))


def _unknown(number: int, value: float, declared: Mapping[int, float | None]) -> str:
    if number in declared:
        return (
            f"the external axis {number} is at {value}, and external in [kinematics] says that it stays at "
            f"{declared[number]}, where the work frames hold. Correct the moves at {value} as a program of "
            "their own, with the work frames and the machine file of that position"
        )
    track = "track = [X, Y, Z] where it carries the arm, " if number == 1 else ""
    return (
        f"the external axis {number} is at {value}, and the machine file does not say what it carries. In "
        f'[kinematics] state {track}external = {{ {number} = "apart" }} where it moves neither the arm nor '
        f"the workpiece. State external = {{ {number} = {value} }} where it stays there, as the frames do"
    )
