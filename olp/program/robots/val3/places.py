"""Where points and tools of an application count from: chains of frames and of tools, and how moves go."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from olp.core.errors import ProgramError
from olp.program.robots.frames import Located, RobotFrames, Tool
from olp.program.robots.moves import NAN
from olp.program.robots.poses import Pose
from olp.program.robots.targets import NOWHERE, Span
from olp.program.robots.val3.data import Slot
from olp.program.robots.val3.state import Scope, State
from olp.program.robots.val3.values import REFERENCE, Thing

WORLD = "world"
FLANGE = "flange"
#: Frames count from each other so often at most.
_LONGEST = 32


class Places:
    """The frames and tools of one application. `held` are the bytes of the numbers that moves need as they
    are, with what has them: a target with the same bytes would change both."""

    def __init__(self, state: State, frames: RobotFrames) -> None:
        self.state, self.frames = state, frames
        self._located: dict[tuple[str, str, int], Located] = {}
        self._tools: dict[tuple[str, str, int], Tool] = {}
        self.held: dict[Span, str] = {}

    def hold(self, what: str, slots: Iterable[Slot | None]) -> None:
        """Numbers that stay as they are."""
        for slot in slots:
            if slot is not None:
                self.held.setdefault(slot[0], what)

    def frame(self, father: tuple[str, str] | None, line: int, depth: int = 0) -> Located:
        """The frame that a point counts from. Raises ProgramError where it is not stated."""
        if father is None or father[0] == WORLD:
            return self.frames.world
        key = (*father, self.state.versions)
        if key not in self._located:
            self._located[key] = self._framed(father, line, depth)
        return self._located[key]

    def _framed(self, father: tuple[str, str], line: int, depth: int) -> Located:
        thing = self.state.of(*father)
        if thing is None:
            return self.frames.located(_shown(father), None, line)
        if thing.pose() is None:
            try:
                return self.frames.located(thing.shown, None, line)
            except ProgramError:
                self._pose(thing, "frame", line, depth, "OLP523")
                raise
        own = self._pose(thing, "frame", line, depth, "OLP523")
        outer = self.frame(thing.father, line, depth + 1)
        if outer.work is not self.frames.world.work:
            # a frame of the job holds this one
            found = outer.holding(thing.shown, own)
        else:
            found = self.frames.located(thing.shown, outer.inner.then(own), line)
        return replace(found, name=_versioned(thing))

    def tool(self, thing: Thing | None, name: tuple[str, str], line: int) -> Tool:
        """The tool of a move; as `frame`."""
        if thing is None:
            stated = Pose() if name[0] == FLANGE else None
            return self.frames.tool(_shown(name), stated, line)
        key = (thing.name, thing.key, self.state.versions)
        if key not in self._tools:
            found = self.frames.tool(thing.shown, self._at_flange(thing, line, 0), line)
            self._tools[key] = replace(found, name=_versioned(thing))
        return self._tools[key]

    def motion(self, span: Span, scope: Scope) -> tuple[float, Span, bool]:
        """The speed of a motion description, its bytes where parts of a move need another one, and whether
        parts can pass without a stop."""
        thing = self.state.thing(span, scope)
        if thing is None or thing.why or thing.kind != "mdesc":
            return NAN, NOWHERE, False
        if thing.version:
            self.hold(f"the motion {thing.shown}", thing.slots.values())
        speed = thing.slots.get("tmax")
        own = speed is not None and speed[0] != NOWHERE and speed[1] > 0.0
        feed = speed[1] if own and speed is not None else NAN
        match = REFERENCE.fullmatch(self.state.data, *span)
        key = "0" if match is None or match[2] is None else match[2].strip().decode("latin-1")
        plain = match is not None and (match[1].decode("latin-1"), key) == (thing.name, thing.key)
        blends = thing.words.get("blend", "joint") not in ("off", "")
        if thing.entry is not None and plain and thing.grows and not (thing.version and blends):
            return feed, span, True
        return feed, NOWHERE, blends

    def tool_of(self, span: Span, scope: Scope, line: int) -> Tool:
        """The tool that a move is given. Raises ProgramError where it is computed, or not stated."""
        thing = self.state.thing(span, scope)
        match = REFERENCE.fullmatch(self.state.data, *span)
        if match is None or match[3]:
            raise ProgramError("the tool of this move is computed", line=line, code="OLP521")
        key = "0" if match[2] is None else match[2].strip().decode("latin-1")
        return self.tool(thing, (match[1].decode("latin-1"), key), line)

    def _at_flange(self, thing: Thing, line: int, depth: int) -> Pose:
        own = self._pose(thing, "tool", line, depth, "OLP521")
        if thing.father is None or thing.father[0] in (FLANGE, WORLD) or thing.name == FLANGE:
            return own
        outer = self.state.of(*thing.father)
        if outer is None:
            raise ProgramError(
                f"the tool {thing.shown} counts from {_shown(thing.father)}, which is not stated",
                line=line,
                code="OLP521",
            )
        return self._at_flange(outer, line, depth + 1).then(own)

    def _pose(self, thing: Thing, what: str, line: int, depth: int, code: str) -> Pose:
        pose = thing.pose()
        if pose is None or thing.kind != what or depth > _LONGEST:
            why = thing.why or f"it is no {what} whose numbers are stated"
            raise ProgramError(f"the {what} {thing.shown}: {why}", line=line, code=code)
        self.hold(f"the {what} {thing.shown}", thing.slots.values())
        return pose


def _shown(name: tuple[str, str]) -> str:
    return name[0] if name[1] == "0" else f"{name[0]}[{name[1]}]"


def _versioned(thing: Thing) -> str:
    return f"{thing.shown} {thing.version}" if thing.version else thing.shown
