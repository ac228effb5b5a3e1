"""Where points and tools of an application count from: chains of frames and of tools."""

from __future__ import annotations

from dataclasses import replace

from olp.core.errors import ProgramError
from olp.program.robots.frames import Located, RobotFrames, Tool
from olp.program.robots.poses import Pose
from olp.program.robots.val3.state import State
from olp.program.robots.val3.values import Thing

WORLD = "world"
FLANGE = "flange"
#: Frames count from each other so often at most.
_LONGEST = 32


class Places:
    """The frames and tools of one application."""

    def __init__(self, state: State, frames: RobotFrames) -> None:
        self.state, self.frames = state, frames
        self._located: dict[tuple[str, str, int], Located] = {}
        self._tools: dict[tuple[str, str, int], Tool] = {}

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
        return pose


def _shown(name: tuple[str, str]) -> str:
    return name[0] if name[1] == "0" else f"{name[0]}[{name[1]}]"


def _versioned(thing: Thing) -> str:
    return f"{thing.shown} {thing.version}" if thing.version else thing.shown
