"""Targets of a robot program: positions that are stated in the text, and the moves that use them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.program.robots.poses import NO_TURN, Pose, Quaternion

#: Bytes of the text: the first, and the one behind the last.
Span = tuple[int, int]
#: No bytes of the text.
NOWHERE: Span = (-1, -1)
#: External axes that are not there have at least this.
ABSENT = 9e8


@dataclass(frozen=True, slots=True)
class Copy:
    """Where a language has further declarations like one: the byte, and lines before and behind it there.
    `beside` are those that belong to it, each with the `text` that declares it."""

    place: int = -1
    before: bytes = b""
    behind: bytes = b""
    text: bytes = b""
    beside: tuple[Copy, ...] = ()


#: A language that has no place for these.
NO_COPY = Copy()


@dataclass(frozen=True, slots=True)
class Target:
    """A position as it is stated: the `line`, the bytes of its whole `value`, of its three `numbers`, and
    their `slots`. `turn` is its orientation in its frame, and `rest` what else it states: configuration and
    external axes. One that is declared has a `name`, and `declaration` are the bytes that declare it.
    `turned` are the bytes of the numbers of its orientation, `turns` those that say how far axes turned.
    `config` are the words that name a posture, NaN where one is not stated, and `outer` the external axes.
    `along` are the bytes of the first of these, where parts of a move can state others.
    One in joints has their values in degrees (`joints`), the first three of them in `numbers`, the others in
    `turned`. Where the text counts steps of motors, `counts` are those of each joint in a degree. `copy` is
    where another declaration of it goes, in a language that has a place for these. One that is `held` keeps
    its numbers, as something else than corrected moves has them from it: moves go to clones of it."""

    line: int
    value: Span
    numbers: tuple[Span, Span, Span]
    slots: tuple[int, int, int]
    point: Vector
    turn: Quaternion = NO_TURN
    rest: tuple[float, ...] = ()
    name: str = ""
    declaration: Span = NOWHERE
    turned: tuple[Span, ...] = ()
    turns: tuple[Span, ...] = ()
    config: tuple[float, ...] = ()
    outer: tuple[float, ...] = ()
    joints: tuple[float, ...] = ()
    counts: tuple[float, ...] = ()
    copy: Copy = NO_COPY
    held: bool = False
    along: Span = NOWHERE


@dataclass(frozen=True, slots=True)
class Use:
    """How a move uses a target, which is the place of it in `Targets.targets`. `statement` are the bytes of
    the move, `place` those that state the target, and `named` those of its name in them. `shift_mm` is how
    far the move goes from the target, along its frame, and `turn` its orientation there. `before` is the
    orientation at the start of the move. `zone` are the bytes that say how the move ends. `offsets` are the
    bytes of the three numbers of its shift, empty where it has none, along axes turned by `offset_turn`,
    which are those of the tool where it is `along_tool`. `frame` is the pose of the target's frame in machine
    coordinates, and `tool` that of the tip at the flange, None where the program does not state it. The
    robot goes `straight` from a known target, or is `led` straight from where no target says it is, or goes
    with any posture that is near where it is `free`. A move that is `whole` is never split. Where a track
    carries the arm, `frame` counts from its carriage."""

    target: int
    statement: Span
    place: Span
    named: Span = NOWHERE
    shift_mm: Vector = ZERO
    turn: Quaternion = NO_TURN
    before: Quaternion = NO_TURN
    zone: Span = NOWHERE
    offsets: tuple[Span, ...] = ()
    offset_turn: Quaternion = NO_TURN
    along_tool: bool = False
    frame: Pose = Pose()
    tool: Pose | None = None
    straight: bool = False
    free: bool = False
    whole: bool = False
    led: bool = False

    def begun(
        self, before: Quaternion, frame: Pose, tool: Pose | None, *, straight: bool, whole: bool, led: bool
    ) -> Use:
        """The same with where it begins, in its frame and with its tool."""
        return Use(
            self.target, self.statement, self.place, self.named, self.shift_mm, self.turn, before, self.zone,
            self.offsets, self.offset_turn, self.along_tool, frame, tool, straight, self.free, whole, led,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Arc:
    """An arc that is read as chords (`robots.arcs`): the moves `first`..`last`. Its via point is the end of
    `middle`, and its end that of `last`; both are stated by one statement, or by
    two that follow one another. Other chords have targets of their
    own, which no text states. One that is `whole` is never written as several arcs."""

    first: int
    middle: int
    last: int
    whole: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """All targets of a program, and (n,) what each of its moves uses; None for a move that the text does not
    state as a target. `arcs` are those among the moves, in their order, and `gaps` the moves that no
    statement makes: before the next one the machine may have gone anywhere. `known_at` are moves that
    are left as written, with the joint values to which they go, in degrees."""

    targets: tuple[Target, ...]
    uses: tuple[Use | None, ...]
    arcs: tuple[Arc, ...] = ()
    gaps: tuple[int, ...] = ()
    known_at: Mapping[int, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a move that ends before it: its three `numbers`, and the `share` of the move where it ends.

    `stop`: the robot stops there. `name` is that of its target where the language needs one. `turned` are
    the numbers of its orientation where it is corrected, `turns` what replaces those of `Target.turns`, and
    `along` where the track is that carries the arm, where it goes along the move."""

    numbers: tuple[bytes, bytes, bytes]
    share: float
    stop: bool
    name: str
    turned: tuple[bytes, ...] = ()
    turns: tuple[bytes, ...] = ()
    along: bytes = b""

    def renumbered(self, target: Target) -> list[tuple[int, int, bytes]]:
        """What replaces the numbers of a target, from its first byte on."""
        start, spans = target.value[0], list(target.numbers)
        spans += target.turned if self.turned else ()
        spans += target.turns if self.turns else ()
        spans += [target.along] if self.along else []
        texts = (*self.numbers, *self.turned, *self.turns, *([self.along] if self.along else []))
        return [(a - start, b - start, text) for (a, b), text in zip(spans, texts, strict=True)]
