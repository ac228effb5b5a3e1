"""The moves of an application: which target each one goes to, in which frame, and with which tool."""

from __future__ import annotations

import re
from dataclasses import replace

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.line import Line
from olp.program.robots.moves import NAN, DecidedInRun, RobotMoves
from olp.program.robots.poses import NO_TURN, Quaternion, inverted, multiplied, rotated
from olp.program.robots.targets import NOWHERE, Span, Use
from olp.program.robots.val3.code import Routine, lines_in
from olp.program.robots.val3.data import JOINTS, TRANSFORM, WORDS, Slot
from olp.program.robots.val3.places import Places
from olp.program.robots.val3.reach import Reach
from olp.program.robots.val3.state import Scope, State
from olp.program.robots.val3.values import CALL, REFERENCE, Thing, pose_of, words_of

_HERE = pattern(rb"(?is)herej?\s*\(.*\)")
_MOVE = "a target, a tool, a motion description"
#: What each move is given.
_ARGUMENTS = {b"movej": _MOVE, b"movel": _MOVE, b"movec": f"an intermediate point, {_MOVE}"}
_MOVES = pattern(rb"(?i)\bmove[ljc]\s*\(")
_CALLS = pattern(rb"(?i)call\b")
#: What each word of a configuration says: the sign of what tells postures apart. Others leave it open.
SIGNS = {
    "lefty": 1.0,
    "righty": -1.0,
    "epositive": 1.0,
    "enegative": -1.0,
    "wpositive": 1.0,
    "wnegative": -1.0,
}
OPEN = frozenset(("ssame", "sfree", "esame", "efree", "wsame", "wfree"))


@dataclass(frozen=True, slots=True)
class _Goal:
    """What a move goes to: its numbers, those of `thing` where it has a name. `named` are the bytes of its
    name, and `value` those of braces. It is moved by `shift`, along `axes` or along the tool, and `turned`.
    `offsets` are the bytes of the shift."""

    kind: str
    slots: list[Slot]
    words: dict[str, str]
    father: tuple[str, str] | None = None
    thing: Thing | None = None
    named: Span = NOWHERE
    value: Span = NOWHERE
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turned: Quaternion = NO_TURN
    offsets: tuple[Span, ...] = ()
    axes: Quaternion = NO_TURN
    along_tool: bool = False


@dataclass(frozen=True, slots=True)
class _Site:
    """A call that is followed: its statement, and whether its program makes a single move."""

    line: Line
    single: bool


class Moving:
    """Collects the moves of one application."""

    def __init__(self, data: bytes, state: State, places: Places, moves: RobotMoves) -> None:
        self.data, self.state, self.places, self.moves = data, state, places, moves
        self._targets: dict[tuple[Span, ...], int] = {}
        self._owner: dict[Span, int] = {}
        self._seen: dict[int, dict[tuple[int, ...], tuple[object, ...]]] = {}
        self._sites: list[_Site] = []

    def enter(self, line: Line, routine: Routine) -> None:
        """A program that is called in a line is followed from here on."""
        lines = lines_in(routine.nodes)
        moves = sum(len(_MOVES.findall(one.text)) for one in lines)
        self._sites.append(_Site(line, moves == 1 and not any(_CALLS.match(one.text) for one in lines)))

    def leave(self) -> None:
        self._sites.pop()

    def check(self, reach: Reach) -> None:
        """Raises ProgramError where a target has numbers that something else needs as they are."""
        uses: dict[tuple[str, str], str] = {}
        for span, index in self._owner.items():
            what = self.places.held.get(span, "")
            for name in sorted(self.state.through.get(span, ())):
                line = uses[name] if name in uses else uses.setdefault(name, reach.used(*name))
                what = what or (f"{name[1]}, which {line} uses" if line else "")
            if what:
                raise ProgramError(
                    f"this target has some of its numbers from {what}, so both change together; state them "
                    "apart",
                    line=self.moves.targets[index].line,
                    code="OLP533",
                )

    # -- moves ---------------------------------------------------------------------------------------

    def take(self, line: Line, match: re.Match[bytes], scope: Scope, *, repeated: bool) -> None:
        """A move. Raises ProgramError where the text does not state where it goes."""
        word = match[1].lower()
        given = self.state.arguments(line.begin + match.start(2), line.begin + match.end(2))
        expected = _ARGUMENTS[word]
        if len(given) != expected.count(",") + 1:
            raise ProgramError(
                f"the move has {len(given)} arguments; expected {expected}", line=line.line, code="OLP516"
            )
        if word == b"movec":
            self._arc(line, given, scope, repeated=repeated)
            return
        place, tool_span, motion = given
        if _HERE.fullmatch(self.data, *place):
            return
        goal = self._goal(place, scope, line)
        if repeated:
            # one text for several moves
            goal = replace(goal, offsets=())
        if goal.kind == "joint" and word == b"movel":
            raise ProgramError("joints in a movel are not read; write a point", line=line.line, code="OLP533")
        feed, zone, passes = self.places.motion(motion, scope)
        site = self._site_of(goal)
        statement, number = (line.begin, line.end), line.line
        if site is not None:
            statement = place = (site.line.begin, site.line.end)
            number, zone = site.line.line, NOWHERE
        index = self._target(goal, line, site, fixed=site is None and (repeated or not self._grows(goal)))
        use = Use(index, statement, place, goal.named if site is None else NOWHERE, zone=zone)
        whole = not passes or (site is None and repeated) or not self._can_grow(goal, site)
        if goal.kind == "joint":
            if self._first(line, (index,), ()):
                self.moves.joint_move(number, lambda: use)
            return
        tool = self.places.tool_of(tool_span, scope, line.line)
        frame = self.places.frame(goal.father, line.line)
        use = self._shifted(use, goal, self.moves.targets[index].turn)
        if self._first(line, (index,), (frame, tool, use.shift_mm, use.turn)):
            self.moves.move(number, use, frame, tool, feed, straight=word == b"movel", whole=whole)

    def _arc(self, line: Line, given: list[Span], scope: Scope, *, repeated: bool) -> None:
        """An arc. Raises ProgramError where the text does not state where it goes."""
        *ends, tool_span, motion = given
        goals = [self._goal(place, scope, line) for place in ends]
        if any(goal.kind == "joint" for goal in goals):
            raise ProgramError("joints in a movec are not read; write points", line=line.line, code="OLP533")
        if any(self._site_of(goal) is not None for goal in goals):
            what = "a call gives the numbers of this arc; state its points in the data, or in the movec"
            raise ProgramError(what, line=line.line, code="OLP533")
        frame, other = (self.places.frame(goal.father, line.line) for goal in reversed(goals))
        if other != frame:
            what = "the intermediate point of this arc counts from another frame than its end; give both one"
            raise ProgramError(what, line=line.line, code="OLP533")
        feed, zone, passes = self.places.motion(motion, scope)
        tool = self.places.tool_of(tool_span, scope, line.line)
        whole = not passes or repeated or not all(self._can_grow(goal, None) for goal in goals)
        uses = []
        for goal, place in zip(goals, ends, strict=True):
            index = self._target(goal, line, None, fixed=repeated or not self._grows(goal))
            use = Use(index, (line.begin, line.end), place, goal.named, zone=zone)
            own = replace(goal, offsets=()) if repeated else goal
            uses.append(self._shifted(use, own, self.moves.targets[index].turn))
        via, end = uses
        if self._first(line, (via.target, end.target), (frame, tool, via, end)):
            # the tool turns by way of the intermediate point
            self.moves.arc(line.line, via, end, frame, tool, feed, whole=whole, turned_by_via=True)

    @staticmethod
    def _shifted(use: Use, goal: _Goal, turn: Quaternion) -> Use:
        axes = turn if goal.along_tool else goal.axes
        return replace(
            use, shift_mm=rotated(axes, goal.shift), turn=multiplied(turn, goal.turned), offsets=goal.offsets,
            offset_turn=axes if goal.offsets else NO_TURN, along_tool=goal.along_tool,
        )  # fmt: skip

    def _first(self, line: Line, targets: tuple[int, ...], what: tuple[object, ...]) -> bool:
        """Whether a statement makes a move that it did not make before. Raises ProgramError where it goes to
        the same targets in another way."""
        seen = self._seen.setdefault(line.begin, {})
        if targets not in seen:
            seen[targets] = what
            return True
        if seen[targets] != what:
            raise ProgramError(
                "this move is made again with another frame or tool, so its target means several places; "
                "give each its own target",
                line=line.line,
                code="OLP533",
            )
        self.moves.known = False
        return False

    def _site_of(self, goal: _Goal) -> _Site | None:
        """The call whose numbers a target has, where its program makes that one move."""
        site = self._sites[-1] if self._sites else None
        if site is None or not site.single or goal.offsets:
            return None
        inside = all(site.line.begin <= a and b <= site.line.end for (a, b), _ in goal.slots)
        return site if inside else None

    # -- targets -------------------------------------------------------------------------------------

    def _goal(self, span: Span, scope: Scope, line: Line) -> _Goal:
        text = self.data[slice(*span)]
        braces, call = self.state.braces(span), CALL.fullmatch(text)
        if braces is not None:
            slots = [slot for slot in self.state.numbers(braces.parts, scope) if slot is not None]
            if len(slots) == len(braces.parts) == len(TRANSFORM):
                kind = "point" if braces.nested else "joint"
                return _Goal(kind, slots, words_of(braces.words), value=braces.span)
        elif call is not None and call[1].lower() in (b"appro", b"compose"):
            return self._moved(span[0] + call.start(2), span[1] - 1, call[1].lower(), scope, line)
        else:
            thing = self.state.thing(span, scope)
            if thing is not None and thing.kind in ("point", "joint"):
                return self._of_thing(thing, span, line)
        shown = text[:60].decode("latin-1")
        what = f"the target `{shown}` is computed, or chosen in the run; program it with its numbers"
        match = REFERENCE.fullmatch(text)
        if match is not None and not self.state.knows(match[1].decode("latin-1"), scope):
            what = f"the target {shown} is not stated; give the data (.dtx) and project (.pjx) beside it"
        raise DecidedInRun(what, line=line.line, code="OLP533")

    def _of_thing(self, thing: Thing, span: Span, line: Line) -> _Goal:
        slots = thing.known()
        if slots is None or any(own == NOWHERE for own, _ in slots):
            why = thing.why or "the text does not state all its numbers here"
            # joints that are not stated are left, as on machines without joints
            left = thing.why or thing.version or thing.kind == "joint"
            refusal = DecidedInRun if left else ProgramError
            raise refusal(f"the target {thing.shown}: {why}", line=line.line, code="OLP533")
        return _Goal(thing.kind, slots, dict(thing.words), thing.father, thing, span)

    def _moved(self, begin: int, end: int, word: bytes, scope: Scope, line: Line) -> _Goal:
        """A point that is moved along its own axes (appro), or along those of a frame (compose)."""
        given = self.state.arguments(begin, end)
        count = 2 if word == b"appro" else 3
        slots = self.state.transform(given[-1], scope) if len(given) == count else None
        goal = None if slots is None else self._goal(given[0], scope, line)
        if (
            slots is None
            or goal is None
            or goal.kind != "point"
            or goal.shift != (0.0, 0.0, 0.0)
            or goal.axes != NO_TURN
        ):
            raise DecidedInRun(
                f"{word.decode()} is read of a point and numbers, and not of another one",
                line=line.line,
                code="OLP533",
            )
        move = pose_of([value for _, value in slots])
        inline = all(given[-1][0] <= a < b <= given[-1][1] for (a, b), _ in slots)
        offsets = tuple(span for span, _ in slots[:3]) if inline else ()
        if not inline:
            self.places.hold(f"the shift of {word.decode()} in line {line.line}", slots)
        if word == b"appro":
            return replace(goal, shift=move.origin_mm, turned=move.turn, offsets=offsets, along_tool=True)
        if move.turn != NO_TURN:
            raise ProgramError(
                "compose that turns the point about a frame is not read; program the point",
                line=line.line,
                code="OLP533",
            )
        thing = self.state.thing(given[1], scope)
        name = self.data[slice(*given[1])].strip().decode("latin-1")
        about = self.places.frame((name, "0") if thing is None else (thing.name, thing.key), line.line)
        own = self.places.frame(goal.father, line.line)
        axes = multiplied(inverted(own.pose.turn), about.pose.turn)
        return replace(goal, shift=move.origin_mm, offsets=offsets, axes=axes)

    def _target(self, goal: _Goal, line: Line, site: _Site | None, *, fixed: bool) -> int:
        """The place of a target."""
        key = tuple(span for span, _ in goal.slots)
        if key not in self._targets:
            if any(span in self._owner for span in key):
                raise ProgramError(
                    "this target has some of its numbers from another one, so both change together; state "
                    "all six numbers of each",
                    line=line.line,
                    code="OLP533",
                )
            self._targets[key] = index = self._stated(goal, line, site)
            self._owner.update(dict.fromkeys(key, index))
        index = self._targets[key]
        if fixed:
            self._fix(index)
        return index

    def _stated(self, goal: _Goal, line: Line, site: _Site | None) -> int:
        entry = goal.thing.entry if goal.thing is not None and site is None else None
        whole = entry is not None and goal.thing is not None and goal.thing.declared
        spans = [span for span, _ in goal.slots]
        value = goal.value
        if value == NOWHERE:
            value = min(a for a, _ in spans), max(b for _, b in spans)
        number, name, declaration = line.line, "", NOWHERE
        if entry is not None and goal.thing is not None:
            name, declaration = entry.name, entry.span
            if whole:
                number, value = entry.line, entry.host
        values = [value for _, value in goal.slots]
        if goal.kind == "joint":
            if self.moves.arm and len(values) != len(JOINTS):
                what = f"the target has {len(values)} joints; expected the {len(JOINTS)} of this arm"
                raise ProgramError(what, line=line.line, code="OLP516")
            return self.moves.joint_target(number, value, spans, tuple(values), (), name, declaration)
        pose = pose_of(values)
        x, y, z, *turned = spans
        return self.moves.target(
            number, value, (x, y, z), pose.origin_mm, pose.turn, (), name, declaration, tuple(turned),
            config=self._config(goal, line),
        )  # fmt: skip

    def _config(self, goal: _Goal, line: Line) -> tuple[float, ...]:
        if not self.moves.arm:
            return ()
        found = []
        for word in WORDS:
            stated = goal.words.get(word, f"{word[0]}same")
            if stated not in OPEN and stated not in SIGNS:
                raise ProgramError(
                    f"the configuration `{stated}` of this target is no {word} that is read",
                    line=line.line,
                    code="OLP516",
                )
            found.append(SIGNS.get(stated, NAN))
        return tuple(found)

    def _fix(self, index: int) -> None:
        """A target that cannot be declared again, as its name does not stand in its moves alone."""
        target = self.moves.targets[index]
        self.moves.targets[index] = replace(target, declaration=NOWHERE)

    @staticmethod
    def _grows(goal: _Goal) -> bool:
        return goal.thing is None or goal.thing.grows

    def _can_grow(self, goal: _Goal, site: _Site | None) -> bool:
        """Whether parts of a move have a place for their targets."""
        thing = goal.thing
        if site is not None or thing is None:
            return True
        entry = thing.entry
        return (
            entry is not None
            and self._grows(goal)
            and thing.father == entry.father
            and all(thing.words.get(word) == entry.words.get(word) for word in WORDS)
        )
