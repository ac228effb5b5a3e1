"""Targets of a robot program: positions that are stated in the text, and the moves that use them."""

from __future__ import annotations

from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.program.robots.poses import NO_TURN, Quaternion

#: Bytes of the text: the first, and the one behind the last.
Span = tuple[int, int]
#: No bytes of the text.
NOWHERE: Span = (-1, -1)


@dataclass(frozen=True, slots=True)
class Target:
    """A position as it is stated: the `line`, the bytes of its whole `value`, of its three `numbers`, and
    their `slots`. `turn` is its orientation in its frame, and `rest` what else it states: configuration and
    external axes. One that is declared has a `name`, and `declaration` are the bytes that declare it."""

    line: int
    value: Span
    numbers: tuple[Span, Span, Span]
    slots: tuple[int, int, int]
    point: Vector
    turn: Quaternion = NO_TURN
    rest: tuple[float, ...] = ()
    name: str = ""
    declaration: Span = NOWHERE


@dataclass(frozen=True, slots=True)
class Use:
    """How a move uses a target, which is the place of it in `Targets.targets`. `statement` are the bytes of
    the move, `place` those that state the target, and `named` those of its name in them. `shift_mm` is how
    far the move goes from the target, along its frame, and `turn` its orientation there. `before` is the
    orientation at the start of the move. `zone` are the bytes that say how the move ends. `offsets` are the
    bytes of the three numbers of its shift, empty where it has none, along axes turned by `offset_turn`."""

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


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """All targets of a program, and (n,) what each of its moves uses; None for a move that the text does not
    state as a target."""

    targets: tuple[Target, ...]
    uses: tuple[Use | None, ...]


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a move that ends before it: its three `numbers`, and the `share` of the move where it ends.

    `stop`: the robot stops there. `name` is that of its target where the language needs one."""

    numbers: tuple[bytes, bytes, bytes]
    share: float
    stop: bool
    name: str

    def renumbered(self, target: Target) -> list[tuple[int, int, bytes]]:
        """What replaces the numbers of a target, from its first byte on."""
        start = target.value[0]
        return [
            (a - start, b - start, text) for (a, b), text in zip(target.numbers, self.numbers, strict=True)
        ]
