"""Collects the moves of a robot program while it is read, whatever its language."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector
from olp.core.patterns import pattern
from olp.core.toolpath import Flag, Frame, Kind
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.robots.arcs import Chords
from olp.program.robots.external import External, differ
from olp.program.robots.frames import Located, RobotFrames, Tool
from olp.program.robots.poses import NO_TURN, Pose, Quaternion, angle_between
from olp.program.robots.targets import (
    NO_COPY,
    NOWHERE,
    Arc,
    Copy,
    Span,
    Target,
    Targets,
    Use,
)
from olp.program.verbatim import Moves

NAN = float("nan")
#: mm; less of a tool vector moves nothing, and comes from the digits of orientations
_SAME_VECTOR_MM = 1e-4
#: rad by which a via point may be turned from the even turn along its arc, where both could count
_SAME_ORIENTATION = 1e-3
#: deg by which joint values that are stated twice may differ
_SAME_DEG = 1e-6
#: Statements between two reports of progress.
_TOLD = 4096
#: Kinds as the columns of moves have them.
_LINE = int(Kind.LINE)
_RAPID = int(Kind.RAPID)
#: The same of flags.
_WHOLE = int(Flag.WHOLE)
_CONTROL = int(Flag.CONTROL)
_NOWHERE: Vector = (NAN, NAN, NAN)
_WORDS = pattern(rb"[A-Za-z_]\w*")
_BEGINS_IN_RUN = "where this move begins depends on the run: it is corrected at its end"


def take_all(
    statements: Sequence[Any], take: Callable[[Any], None], moves: RobotMoves, refusals: list[ProgramError],
    options: Options,
) -> None:  # fmt: skip
    """Takes every statement, and tells how far that is. Moves about which the run decides are left. Raises
    the first of `refusals`, which statements add to, with the others."""
    for k, statement in enumerate(statements):
        if k % _TOLD == 0:
            options.tell("read", k / len(statements))
        try:
            take(statement)
        except DecidedInRun as error:
            moves.decided(error)
        except ProgramError as error:
            refusals.append(error)
    if refusals:
        first = refusals[0]
        first.others = tuple(refusals[1:])
        raise first


class DecidedInRun(ProgramError):
    """The run of a program decides where a move goes, in which frame or with which tool."""


def not_read(what: str, line: int) -> ProgramError:
    """The refusal of a statement whose effect on the path is not known."""
    return ProgramError(what, line=line, code="OLP512")


class RobotMoves:
    """Targets and moves of one program. `known` is False where the position before the next move depends on
    the run of the program."""

    def __init__(self, data: bytes, setup: Setup, world: str, unit_mm: float = 1.0) -> None:
        self.data, self.setup, self.arm = data, setup, setup.machine.arm
        self.frames = RobotFrames(setup, world, unit_mm)
        self.moves = Moves()
        self.targets: list[Target] = []
        self.uses: list[Use | None] = []
        self.arcs: list[Arc] = []
        self.gaps: list[int] = []
        self._known_at: dict[int, tuple[float, ...]] = {}
        #: why moves are left as they are written, and names whose numbers something else needs, in capitals
        self._left: list[DecidedInRun] = []
        self._held: set[str] = set()
        self._remarks: dict[str, tuple[str, int, str]] = {}
        self.external = External(setup.machine, self.remark)
        self.known = True
        self._frame = -1
        self._turn: Quaternion | None = None
        self._rest: tuple[float, ...] = ()
        self._feed = NAN
        #: the frame and the tool of the last move, and how it uses its target
        self._at: tuple[Located, Tool, Use] | None = None
        self._first_turns: dict[str, Quaternion] = {}
        #: numbers of frames, with what they are the numbers of: two tools may have the same name
        self._index: dict[tuple[int, int, Quaternion, Vector], tuple[int, Located, Tool]] = {}

    @property
    def count(self) -> int:
        return len(self.uses)

    def remark(self, about: str, line: int, text: str, name: str = "told") -> None:
        """Note the first of what is `about` the same, as a remark of the reader by its `name`."""
        self._remarks.setdefault(about, (name, line, text))

    def target(
        self, line: int, value: Span, numbers: tuple[Span, Span, Span], point: Vector, turn: Quaternion,
        rest: tuple[float, ...], name: str = "", declaration: Span = NOWHERE,
        turned: tuple[Span, ...] = (), turns: tuple[Span, ...] = (), config: tuple[float, ...] = (),
        outer: tuple[float, ...] = (), copy: Copy = NO_COPY, along: Span = NOWHERE,
    ) -> int:  # fmt: skip
        """Add a target that the text states; returns its place."""
        first = self.moves.numbers(numbers)
        slots = (first, first + 1, first + 2)
        self.targets.append(
            Target(line, value, numbers, slots, point, turn, rest, name, declaration, turned, turns,
                   config, outer, copy=copy, along=along)
        )  # fmt: skip
        return len(self.targets) - 1

    def joint_target(
        self, line: int, value: Span, numbers: Sequence[Span], degrees: tuple[float, ...],
        outer: tuple[float, ...] = (), name: str = "", declaration: Span = NOWHERE,
        counts: tuple[float, ...] = (), copy: Copy = NO_COPY,
    ) -> int:  # fmt: skip
        """Add a target whose six `numbers` are joint values, which `degrees` are; returns its place. Those of
        motors are `counts` in a degree."""
        first, second, third, *others = numbers
        self.targets.append(
            Target(
                line, value, (first, second, third), (-1, -1, -1), _NOWHERE, NO_TURN, (), name, declaration,
                tuple(others), outer=outer, joints=degrees, counts=counts, copy=copy,
            )
        )  # fmt: skip
        return len(self.targets) - 1

    def move(
        self, line: int, use: Use, frame: Located, tool: Tool, feed: float, *, straight: bool,
        whole: bool = False, chord: bool = False,
    ) -> None:  # fmt: skip
        """Add a move to a target; `straight` where its path is a line, `whole` where it is never split. A
        `chord` is part of an arc."""
        index = self._framed(frame, tool, use, line)
        if not self.known:
            self.away(line)
        target = self.targets[use.target]
        known = straight and self._turn is not None
        # an arm is led along the way, however the tool turns
        swings = known and not self.arm and self._swings(index)
        if swings:
            self.remark("swings", line, "the tool turns on the way: the move is corrected at its end")
        elif straight and not known:
            self.remark("told", line, _BEGINS_IN_RUN)
        line_kind = known and not swings
        held = not chord and (whole or (line_kind and target.rest != self._rest))
        self.moves.put(
            kind=_LINE if line_kind else _RAPID, flag=_WHOLE if held else 0, line=line, frame=index,
            end=target.point, slot=target.slots, bounds=use.statement, feed=feed,
        )  # fmt: skip
        first = self._first_turns.setdefault(tool.name, use.turn)
        if tool.pose is None and first != use.turn and not self.arm:
            what = f"the orientation changes, and the vector of the tool {tool.name} does not"
            self.remark("turning", line, what, "turning")
        before = use.turn if self._turn is None else self._turn
        whole |= self.external.moves(target, line) or chord
        pose = self.external.frame(frame, target, line)
        led = straight and not known
        self.uses.append(use.begun(before, pose, tool.pose, straight=known, whole=whole, led=led))
        self.known, self._frame, self._turn, self._rest, self._feed = True, index, use.turn, target.rest, feed
        self._at = frame, tool, use

    def arc(
        self, line: int, via: Use, end: Use, frame: Located, tool: Tool, feed: float, *, whole: bool = False,
        turned_by_via: bool = False,
    ) -> None:  # fmt: skip
        """Add an arc through a target to another one, as chords. Where it cannot be read so, both targets are
        corrected. With `turned_by_via` the orientation of the via point has to be the one that the tool has
        there. Raises ProgramError where it has not."""
        begin = self._at if self.known and self._turn is not None else None
        if begin is None or begin[:2] != (frame, tool):
            self._at_points(line, (via, end), frame, tool, feed, "where this arc begins is not stated")
            return
        start, middle, last = (self.targets[use.target] for use in (begin[2], via, end))
        if differ(start, middle) or differ(middle, last):
            self._at_points(line, (via, end), frame, tool, feed, "an external axis moves along this arc")
            return
        places = [np.array(place) for place in map(self._place, (begin[2], via, end))]
        assert self._turn is not None
        chords = Chords.of((places[0], places[1], places[2]), (self._turn, end.turn))
        if chords is None:
            why = "the three points of this arc lie on a line, or on a circle too large to be read"
            self._at_points(line, (via, end), frame, tool, feed, why)
            return
        turned = (replace(end, turn=turn) for turn in (chords.turns[len(chords.turns) // 2], end.turn))
        if not self.arm and any(self._swings(self._framed(frame, tool, use, line)) for use in turned):
            self._at_points(line, (via, end), frame, tool, feed, "the tool turns on this arc")
            return
        off = angle_between(via.turn, chords.turns[chords.first - 1])
        if turned_by_via and off > _SAME_ORIENTATION:
            raise not_read(
                f"at the via point the tool is turned by {off * 1e3:.3g} mrad from the even turn along this "
                "arc, and which of both counts is not stated; give the via point that orientation",
                line,
            )
        if self._turn != end.turn:
            what = "along arcs the tool is taken to turn evenly from start to end, by the shorter way"
            self.remark("arcs", line, what)
        self._chords(line, via, end, frame, tool, feed, chords, whole=whole)

    def _at_points(
        self, line: int, uses: tuple[Use, Use], frame: Located, tool: Tool, feed: float, why: str
    ) -> None:
        """Add an arc as its via point and its end, as its path is not known."""
        # along an arc the posture stays, and which one that is the way would say
        self._known_at.pop(self.count - 1, None)
        self.remark(f"points: {why}", line, f"{why}: it is corrected at its via point and at its end")
        for use in uses:
            self.move(line, use, frame, tool, feed, straight=False, whole=True)

    def _chords(
        self, line: int, via: Use, end: Use, frame: Located, tool: Tool, feed: float, chords: Chords, *,
        whole: bool,
    ) -> None:  # fmt: skip
        """Add the chords of an arc as moves."""
        target, first, last = self.targets[end.target], self.count, len(chords.turns) - 1
        for k, (place, turn) in enumerate(zip(chords.points.tolist(), chords.turns, strict=True)):
            use = via if k == chords.first - 1 else end
            if k not in (chords.first - 1, last):
                a, b, c = (value / self.frames.unit_mm for value in place)
                self.targets.append(
                    Target(
                        line, NOWHERE, (NOWHERE,) * 3, (-1, -1, -1), (a, b, c), turn, target.rest,
                        config=target.config, outer=target.outer,
                    )
                )  # fmt: skip
                use = Use(len(self.targets) - 1, NOWHERE, NOWHERE, turn=turn)
            # the tool turns evenly, whatever the via point states
            use = replace(use, turn=turn)
            self.move(line, use, frame, tool, feed, straight=True, chord=True)
        self.arcs.append(Arc(first, first + chords.first - 1, first + last, whole))

    def _place(self, use: Use) -> Vector:
        """Where a move ends in its frame, mm."""
        unit = self.frames.unit_mm
        pairs = zip(self.targets[use.target].point, use.shift_mm, strict=True)
        x, y, z = (a * unit + b for a, b in pairs)
        return (x, y, z)

    def _framed(self, frame: Located, tool: Tool, use: Use, line: int) -> int:
        """The number of the frame of a move."""
        # the joints of an arm turn the tool, so its vector is none of a frame
        turn = NO_TURN if self.arm else use.turn
        key = (id(frame), id(tool), turn, use.shift_mm)
        known = self._index.get(key)
        if known is None:
            index = self.frames.index(frame, tool, turn, use.shift_mm, line)
            known = self._index[key] = index, frame, tool
        return known[0]

    def joint_move(
        self, line: int, taken: Callable[[], Use | None], *, straight: bool = False,
        tool: Tool | None = None, feed: float = NAN, whole: bool = False, stands: tuple[float, ...] = (),
    ) -> None:  # fmt: skip
        """Add a move to joint values; `straight` where it leads the tip of its `tool` along a line, `whole`
        where that is never split. Where the machine is no arm, or `taken` finds no numbers in the text, it
        stays as it is, and where the robot is then is not known, unless it `stands` at joint values."""
        use = taken() if self.arm else None
        if use is None:
            self.left(line, stands)
            self.remark("joints", line, "joint values are kept as written")
            return
        if not self.known:
            self.away(line)
        known = straight and self._turn is not None
        if straight and not known:
            self.remark("told", line, _BEGINS_IN_RUN)
        self._frame = self._flange(line)
        self.moves.put(
            kind=_LINE if known else _RAPID, flag=0 if known else _CONTROL,
            line=line, frame=self._frame, end=_NOWHERE, slot=(-1, -1, -1), bounds=NOWHERE,
            feed=feed if known else self._feed,
        )  # fmt: skip
        whole |= self.external.moves(self.targets[use.target], line)
        self.external.refuse_unplaced(self.targets[use.target], line)
        pose = Pose() if tool is None else tool.pose
        self.uses.append(replace(use, tool=pose, straight=known, whole=whole))
        self.known, self._turn, self._rest, self._at = True, NO_TURN, (), None

    def away(self, line: int) -> None:
        """The machine may have gone to a position that the text does not state."""
        self.known, self._turn, self._rest = True, None, ()
        if self.uses:
            self.gaps.append(self.count)
            self._open(line, max(self._frame, 0))

    def left(self, line: int, stands: tuple[float, ...] = ()) -> None:
        """A move stays as it is written, and where it goes is not stated. On an arm it is one of the moves,
        so that it is listed as uncorrected, and nothing before it says where the arm is. Then it `stands` at
        joint values (6,) in degrees, where these are known."""
        if not self.arm:
            self.known = False
            return
        self.known, self._turn, self._rest = True, None, ()
        if stands:
            self._known_at[self.count] = stands
        self._open(line, self._flange(line))

    def decided(self, error: DecidedInRun) -> None:
        """A move is left as it is written, as the run decides about it."""
        assert error.line is not None
        self.left(error.line)
        self._left.append(error)
        self.remark(f"left: {error.message}", error.line, f"left as written: {error.message}")

    def stated_joints(self, name: str, own: tuple[float, ...], line: int) -> tuple[float, ...]:
        """The joint values (6,) in degrees of a position that the control knows by a name: its `own`, or
        those of the job; none where neither states them. Raises ProgramError where they differ."""
        given = {key.casefold(): values for key, values in self.setup.job.joint_targets.items()}
        stated = given.get(name.casefold(), ())
        if own and stated and any(abs(a - b) > _SAME_DEG for a, b in zip(own, stated, strict=True)):
            raise ProgramError(
                f"the position {name} is stated by the control's data and by joint_targets of the job, and "
                "they differ; state it once, or the same",
                line=line,
                code="OLP523",
            )
        return own or stated

    def hold(self, names: Iterable[str]) -> None:
        """Targets of these names keep their numbers, as something else than corrected moves has them."""
        self._held.update(name.upper() for name in names)

    def hold_mentioned(self, statements: Iterable[Span]) -> None:
        """Where moves are left, hold what statements mention: they may go there. Moves that are corrected and
        statements that state targets do not count. Raises ProgramError where no move is corrected."""
        if not self._left:
            return
        uses = [use for use in self.uses if use is not None]
        if not uses:
            raise ProgramError.together(self._left)
        own = {use.named[0] for use in uses}
        stated = sorted({self.targets[use.target].value[0] for use in uses})
        for span in statements:
            if bisect_left(stated, span[0]) == bisect_left(stated, span[1]):
                words = _WORDS.finditer(self.data, *span)
                self.hold(word[0].decode("latin-1") for word in words if word.start() not in own)

    def _flange(self, line: int) -> int:
        """The number of the world with the tip at the flange."""
        return self.frames.index(self.frames.world, Tool("", Pose()), NO_TURN, ZERO, line)

    def _open(self, line: int, frame: int) -> None:
        """A move whose end is not stated."""
        self.moves.put(
            kind=_RAPID, flag=_CONTROL, line=line, frame=frame, end=_NOWHERE,
            slot=(-1, -1, -1), bounds=NOWHERE, feed=self._feed,
        )  # fmt: skip
        self.uses.append(None)

    def _swings(self, index: int) -> bool:
        """Whether the tool vector changes on the way to a target."""
        frames = self.frames.table.frames
        pairs = zip(frames[index].tool_mm, frames[self._frame].tool_mm, strict=True)
        return max(abs(a - b) for a, b in pairs) > _SAME_VECTOR_MM

    def program(self, dialect: Dialect, *, words: bool) -> Program:
        """The whole program."""
        frames = self.frames.table.frames
        program = self.moves.program(
            self.data, dialect, self.setup, frames, list(self._remarks.values()), decimal=b".", words=words,
        )  # fmt: skip
        path = program.toolpath
        path.end_mm[:] = placed_in(frames, path.frame, path.end_mm)
        own = self.targets
        if self._held:
            own = [
                replace(target, held=True)
                if {target.name.upper(), target.name.upper().partition("[")[0]} & self._held
                else target
                for target in own
            ]
        targets = Targets(tuple(own), tuple(self.uses), tuple(self.arcs), tuple(self.gaps), self._known_at)
        return replace(program, targets=targets)


def placed_in(frames: Sequence[Frame], number: npt.NDArray[np.int32], points: Array) -> Array:
    """(n, 3) axis positions of points (n, 3) in frames by their numbers (n,)."""
    if not frames:
        return points
    unit = np.array([frame.unit_mm for frame in frames])[number]
    place = points * unit[:, None]
    turns = np.array([np.eye(3) if frame.turn is None else frame.turn for frame in frames])[number]
    x, y, z = place.T
    turned = [row[:, 0] * x + row[:, 1] * y + row[:, 2] * z for row in np.moveaxis(turns, 1, 0)]
    return np.asarray(np.stack(turned, axis=1) + np.array([frame.offset_mm for frame in frames])[number])
