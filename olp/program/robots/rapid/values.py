"""Data of RAPID that are stated with their numbers: targets, tools, frames."""

from __future__ import annotations

import re
from collections.abc import Sequence

from olp.core.errors import ProgramError
from olp.core.machine import Vector
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.poses import Pose, Quaternion
from olp.program.robots.targets import Span

_N = rb"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
NUMBER = _N.replace(rb"\s*", b"")


def _list(count: int) -> bytes:
    return rb"\[" + b",".join([_N] * count) + rb"\]"


_PIECES = (_list(3), _list(4), _list(4), _list(6))
#: A robtarget with all its numbers, each a group.
ROBTARGET = pattern(rb"\[\s*" + rb"\s*,\s*".join(_PIECES) + rb"\s*\]")
#: A jointtarget likewise.
JOINTTARGET = pattern(rb"\[\s*" + rb"\s*,\s*".join((_list(6), _list(6))) + rb"\s*\]")
_POSE = rb"\[\s*" + rb"\s*,\s*".join(_PIECES[:2]) + rb"\s*\]"
#: tooldata: whether the robot holds it, and its frame. The load behind it has no effect on the path.
_TOOL = pattern(rb"(?i)\[\s*(TRUE|FALSE)\s*,\s*" + _POSE + rb"\s*,.*\]\s*", re.DOTALL)
#: wobjdata: held by the robot, fixed, the unit that moves it, the user frame and the object frame
_FRAME = pattern(
    rb"(?i)\[\s*(TRUE|FALSE)\s*,\s*(TRUE|FALSE)\s*,\s*\"([^\"]*)\"\s*,\s*"
    + _POSE + rb"\s*,\s*" + _POSE + rb"\s*\]\s*"
)  # fmt: skip
#: How far the length of a quaternion may be from 1.
_UNIT = 1e-3


def quaternion(numbers: Sequence[float], line: int) -> Quaternion:
    """A rotation of RAPID, w first. Raises ProgramError where it is none."""
    w, x, y, z = numbers
    size = (w * w + x * x + y * y + z * z) ** 0.5
    if not abs(size - 1.0) < _UNIT:
        raise ProgramError(
            f"the orientation has length {size:.6g}; expected a quaternion of length 1",
            line=line,
            code="OLP516",
        )
    return (w / size, x / size, y / size, z / size)


@dataclass(frozen=True, slots=True)
class Stated:
    """What a robtarget states: the bytes of its position, this, its orientation, and the `rest`:
    configuration and external axes. `turned`, `turns` and `along` are the bytes of the orientation, of the
    quarters of axes, and of the first external axis."""

    spans: tuple[Span, Span, Span]
    point: Vector
    turn: Quaternion
    rest: tuple[float, ...]
    turned: tuple[Span, ...]
    turns: tuple[Span, ...]
    along: Span

    @property
    def config(self) -> tuple[float, ...]:
        return self.rest[:4]

    @property
    def outer(self) -> tuple[float, ...]:
        return self.rest[4:]


def target_of(match: re.Match[bytes], line: int) -> Stated:
    """What a robtarget states. Raises ProgramError where its orientation is none."""
    x, y, z, *others = map(float, match.groups())
    regs = match.regs
    spans = (regs[1], regs[2], regs[3])
    turn = quaternion(others[:4], line)
    return Stated(spans, (x, y, z), turn, tuple(others[4:]), regs[4:8], regs[8:11], regs[12])


@dataclass(frozen=True, slots=True)
class Joints:
    """What a jointtarget states: the bytes of its joint values, these in degrees, and the external axes."""

    spans: tuple[Span, ...]
    degrees: tuple[float, ...]
    outer: tuple[float, ...]


def joints_of(match: re.Match[bytes]) -> Joints:
    """What a jointtarget states."""
    numbers = tuple(map(float, match.groups()))
    return Joints(tuple(match.span(k) for k in range(1, 7)), numbers[:6], numbers[6:])


def tool_of(text: bytes, name: str, line: int) -> Pose:
    """The frame of a tool at the flange. Raises ProgramError where it is not stated, or stands still."""
    match = _TOOL.fullmatch(text.strip())
    if match is None:
        raise ProgramError(f"the tool {name} is not stated with numbers", line=line, code="OLP521")
    if match[1].upper() != b"TRUE":
        raise ProgramError(
            f"the tool {name} stands still (robhold FALSE), and the robot moves the part: not read",
            line=line,
            code="OLP512",
        )
    return _pose(match.groups()[1:8], line)


def frame_of(text: bytes, name: str, line: int) -> Pose:
    """The pose of a work object in the world; as `tool_of`."""
    match = _FRAME.fullmatch(text.strip())
    if match is None:
        raise ProgramError(f"the work object {name} is not stated with numbers", line=line, code="OLP523")
    if match[1].upper() == b"TRUE" or match[2].upper() == b"FALSE" or match[3]:
        raise ProgramError(
            f"the work object {name} moves (robhold, ufprog or ufmec), and where it is then is not stated",
            line=line,
            code="OLP512",
        )
    groups = match.groups()
    return _pose(groups[3:10], line).then(_pose(groups[10:17], line))


def _pose(groups: Sequence[bytes], line: int) -> Pose:
    x, y, z, *turn = (float(text) for text in groups)
    return Pose((x, y, z), quaternion(turn, line))
