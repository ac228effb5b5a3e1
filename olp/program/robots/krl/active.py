"""Base, tool and speed that are in force while a KRL text is read, as it states them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.frames import Located, RobotFrames, Tool
from olp.program.robots.krl.data import Declared, Taught, key_of, pose_of
from olp.program.robots.krl.text import Line
from olp.program.robots.moves import NAN, DecidedInRun
from olp.program.robots.poses import Pose

_SET = pattern(rb"(?i)\$(BASE|TOOL)\s*(\.\s*\w+)?\s*=(?!=)\s*(.*)")
_BAS = pattern(rb"(?i)BAS\s*\(\s*#(\w+)\s*(?:,\s*(.*?)\s*)?\)")
_TAUGHT = pattern(rb"(?i)FDAT_ACT\s*=\s*(\w+)")
_SPEED = pattern(rb"(?i)\$VEL\.CP\s*=\s*([+-]?(?:\d+\.?\d*|\.\d+))")
_ANY_SPEED = pattern(rb"(?i)\$VEL(?:\.CP)?\s*=")
_MODE = pattern(rb"(?i)\$IPO_MODE\s*=\s*(.*?)\s*")
_ANY_STILL = pattern(rb"(?i)\$IPO_MODE\s*=\s*#TCP\b")
_WORLD = pattern(rb"(?i)\$(?:NULLFRAME|WORLD)")
_NUMBERED = pattern(rb"(?i)(?:BASE|TOOL)_DATA\s*\[\s*(\d+)\s*\]")
#: Functions of inline forms that give the tool or the base of a taught point.
_OF_TAUGHT = pattern(rb"(?i)S(?:BASE|TOOL2?)\s*\(\s*(\w+)(?:\.\s*(?:BASE|TOOL)_NO)?\s*\)")
_NAME = pattern(rb"(\w+)\s*(?:\[\s*(\d+)\s*\])?")
_NUMBER = pattern(rb"\s*[+-]?(?:\d+\.?\d*|\.\d+)\s*")
_WITH = pattern(rb"(?i)\$(BASE|TOOL|IPO_MODE)\s*=\s*(\{[^{}]*\}|[^,({]*(?:\([^()]*\))?)")
_OF_MODE = pattern(rb"(?i)SIPO_MODE\s*\(\s*(\w+)")
_MM_PER_M = 1000.0


@dataclass(frozen=True, slots=True)
class Place:
    """A base or a tool: its number, 0 for none, or the pose that the text states under a `name`."""

    number: int = 0
    pose: Pose | None = None
    name: str = ""


@dataclass(frozen=True, slots=True)
class State:
    """What is in force; None where the text does not say it. `why` is what the run decides it by. `still`:
    the tool may stand still, and the robot move the part."""

    base: Place | None
    tool: Place | None
    why: str
    still: bool = False


#: What BAS(#INITMOV) sets, as the file bas.src of controls says: the world, and the first tool.
_BEGIN = (Place(), Place(1))


class Active:
    """Follows the statements that set base, tool and speed. `told` takes a remark: what it is about, its
    line, and its text."""

    def __init__(
        self, data: bytes, setup: Setup, declared: Declared, frames: RobotFrames,
        told: Callable[[str, int, str], None],
    ) -> None:  # fmt: skip
        self.data, self.setup, self.declared, self.frames = data, setup, declared, frames
        self._told = told
        self.feed = NAN
        self._taught: Taught | None = None
        self._places: dict[tuple[str, Place], Located | Tool] = {}
        #: of the last move what was in force, its base and its tool
        self._bases: tuple[State, Located] | None = None
        self._tools: tuple[State, Tool] | None = None
        self.state = State(None, None, "")
        #: names of values that are set as a base or tool
        self.named: set[str] = set()

    @functools.cached_property
    def _any_still(self) -> bool:
        """Whether the text may set a tool that stands still."""
        points = set(_TAUGHT.findall(self.data)) if b"#TCP" in self.data.upper() else ()
        taught = (self.declared.taught(key_of(name, None)) for name in points)
        return _ANY_STILL.search(self.data) is not None or any(own and own.fixed for own in taught)

    def forget(self, why: str, *, begun: bool = True) -> None:
        """What is in force depends on the run from here on. Where none has `begun`, no statement of this text
        has set a tool that stands still."""
        self.state, self._taught = State(None, None, why, begun and self._any_still), None

    def take(self, line: Line) -> bool:
        """Whether a statement is about base, tool or speed; it is followed."""
        text = line.text
        given = _SET.fullmatch(text)
        if given is not None:
            which = given[1].upper().decode()
            span = (line.begin + given.start(3), line.begin + given.end(3))
            self._set(which, None if given[2] else self._place(which, span, line), line)
            return True
        call = _BAS.fullmatch(text)
        if call is not None:
            self._bas(call[1].upper(), call[2] or b"", line)
            return True
        taught = _TAUGHT.fullmatch(text)
        if taught is not None:
            self._taught = self.declared.taught(key_of(taught[1], None))
            return True
        mode = _MODE.fullmatch(text)
        if mode is not None:
            self.state = replace(self.state, still=self._any_still and mode[1].upper() != b"#BASE")
            return True
        if _ANY_SPEED.match(text):
            speed = _SPEED.fullmatch(text)
            self.feed = NAN if speed is None else float(speed[1]) * _MM_PER_M
            return True
        return False

    def _set(self, which: str, place: Place | None, line: Line) -> None:
        why = f"in line {line.line} ${which} gets a value that the text does not state"
        if which == "BASE":
            self.state = replace(self.state, base=place)
        else:
            self.state = replace(self.state, tool=place)
        if place is None:
            self.state = replace(self.state, why=why)

    def _place(self, which: str, span: tuple[int, int], line: Line) -> Place | None:
        """What an expression sets; None where the text does not say it."""
        text = self.data[slice(*span)].strip()
        numbered, of_taught = _NUMBERED.fullmatch(text), _OF_TAUGHT.fullmatch(text)
        if _WORLD.fullmatch(text):
            return Place()
        if numbered is not None:
            return Place(int(numbered[1]))
        if of_taught is not None:
            return self._of_taught(which, self.declared.taught(key_of(of_taught[1], None)))
        numbers = self.declared.aggregate(span)
        if numbers is not None:
            return Place(0, pose_of(numbers, line.line), f"${which} of line {line.line}")
        name = _NAME.fullmatch(text)
        if name is None:
            return None
        key = key_of(name[1], name[2])
        try:
            pose = self.declared.frame(key, line.line)
        except DecidedInRun:
            return None
        self.named.add(name[1].decode("latin-1"))
        return None if pose is None else Place(0, pose, key)

    @staticmethod
    def _of_taught(which: str, taught: Taught | None) -> Place | None:
        if taught is None:
            return None
        number = taught.base if which == "BASE" else taught.tool
        return None if number is None else Place(number)

    def _bas(self, command: bytes, value: bytes, line: Line) -> None:
        """A call of BAS, by which inline forms set what is in force."""
        speed = float(value) * _MM_PER_M if _NUMBER.fullmatch(value) else NAN
        if command in (b"PTP_PARAMS", b"CP_PARAMS", b"FRAMES"):
            for which in ("BASE", "TOOL"):
                self._set(which, self._of_taught(which, self._taught), line)
            if self.state.base is None or self.state.tool is None:
                why = f"line {line.line} sets those of a taught point that the text does not state"
                self.state = replace(self.state, why=why)
            still = self._any_still if self._taught is None else self._taught.fixed
            self.state = replace(self.state, still=still)
            if command == b"CP_PARAMS":
                self.feed = speed
        elif command in (b"BASE", b"TOOL"):
            place = Place(int(value)) if value.isdigit() else None
            self._set(command.decode(), place, line)
        elif command == b"INITMOV":
            self.state, self._taught = State(*_BEGIN, ""), None
        elif command == b"EX_BASE":
            self.forget(f"BAS(#EX_BASE) in line {line.line} sets them")
        elif command == b"VEL_CP":
            self.feed = speed

    def within(self, text: bytes, begin: int, line: Line) -> State:
        """What is in force for a move with the words `text` behind WITH, which begin at a byte."""
        state = self.state
        for match in _WITH.finditer(text):
            which = match[1].upper().decode()
            if which == "IPO_MODE":
                taught = _OF_MODE.match(match[2])
                fixed = taught is not None and self.declared.taught(key_of(taught[1], None))
                still = match[2].strip().upper() == b"#TCP" or bool(fixed and fixed.fixed)
                state = replace(state, still=still)
                continue
            place = self._place(which, (begin + match.start(2), begin + match.end(2)), line)
            why = f"the value of ${which} behind WITH is not stated in this text"
            state = replace(state, base=place) if which == "BASE" else replace(state, tool=place)
            if place is None:
                state = replace(state, why=why)
        return state

    # -- in the machine -------------------------------------------------------------------------------

    def base(self, state: State, line: int) -> Located:
        """The base of a move. Raises ProgramError where it is not stated."""
        if state.still:
            raise DecidedInRun(
                "the tool may stand still (#TCP), and the robot move the part, which is not read",
                line=line,
                code="OLP512",
            )
        if self._bases is not None and self._bases[0] is state:
            return self._bases[1]
        place = state.base
        if place is None:
            place = self._stated("$BASE", state.why, line)
        self._begun(place, "base 0, the world,", line)
        key = ("BASE", place)
        if key not in self._places:
            self._places[key] = self._located(place, line)
        found = self._places[key]
        assert isinstance(found, Located)
        self._bases = state, found
        return found

    def _located(self, place: Place, line: int) -> Located:
        if place.pose is not None:
            return self.frames.located(place.name, place.pose, line)
        if place.number == 0:
            return self.frames.located(place.name, None, line) if place.name else self.frames.world
        pose = self.declared.frame(f"BASE_DATA[{place.number}]", line)
        return self.frames.located(f"BASE{place.number}", pose, line)

    def tool(self, state: State, line: int) -> Tool:
        """The tool of a move; as `base`."""
        if self._tools is not None and self._tools[0] is state:
            return self._tools[1]
        place = state.tool
        if place is None:
            place = self._stated("$TOOL", state.why, line)
        self._begun(place, "tool 1", line)
        key = ("TOOL", place)
        if key not in self._places:
            if place.pose is not None:
                self._places[key] = Tool(place.name, place.pose)
            else:
                pose = self.declared.frame(f"TOOL_DATA[{place.number}]", line) if place.number else None
                name = f"TOOL{place.number}"
                self._places[key] = self.frames.numbered_tool(name, place.number, pose, line)
        found = self._places[key]
        assert isinstance(found, Tool)
        self._tools = state, found
        return found

    def _begun(self, place: Place, what: str, line: int) -> None:
        if any(place is own for own in _BEGIN):
            self._told(f"begun: {what}", line, f"{what} is in force here, as BAS(#INITMOV) sets it")

    def _stated(self, what: str, why: str, line: int) -> Place:
        """What the machine file states, where no statement of the text sets it."""
        machine = self.setup.machine
        if not why and what == "$TOOL" and machine.default_tool:
            return Place(machine.default_tool)
        work = machine.default_work_offset
        if not why and what == "$BASE" and work in {**machine.work_offsets, **self.setup.job.work_offsets}:
            return Place(name=work)
        # without a reason machine and job may state it
        refusal = DecidedInRun if why else ProgramError
        raise refusal(
            f"which {what} is in force here is not stated"
            + (f": {why}" if why else "")
            + f"; set {what} before this move, by its number or with its numbers",
            line=line,
            code="OLP523" if what == "$BASE" else "OLP521",
        )
