"""Where the positions of a job are: their frames, tools, axes beside the robot, and the joints of pulses."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.errors import ProgramError
from olp.program.robots.frames import Located, Tool
from olp.program.robots.inform import postures
from olp.program.robots.inform.text import TAUGHT, Job, Position
from olp.program.robots.moves import RobotMoves, not_read
from olp.program.robots.poses import Pose, of_zyx
from olp.program.robots.targets import ABSENT, Copy, Target

#: Numbers of a pose, and joints of an arm.
_NUMBERS = 6
_IN_JOINTS = (b"", b"PULSE", b"ANGLE")
_IN_FRAMES = (b"BASE", b"ROBOT", b"USER")
_BASES = (b"BC", b"BP")
#: A name of an axis beside the robot, and its number.
Beside = tuple[bytes, int]
#: The axes beside the robot with which a position is used: those of its base, and of a positioner.
_Used = tuple[tuple[float, ...], tuple[float, ...]]


class Places:
    """The positions of one job as targets of `moves`."""

    def __init__(self, data: bytes, moves: RobotMoves, job: Job) -> None:
        self.data, self.moves, self.job = data, moves, job
        self.setup = moves.setup
        self._targets: dict[int, tuple[int, _Used]] = {}
        self._tools: dict[int, Tool] = {}
        self._words: dict[bytes, tuple[float, ...]] = {}
        self._frames: dict[tuple[bytes, float], Located] = {}

    def in_joints(self, position: Position, line: int) -> bool:
        """Whether a position states pulses or joints. Raises ProgramError where it is not in a frame, too."""
        kind, form = position.header.kind.upper(), position.header.form
        joints = kind in _IN_JOINTS
        if not joints and kind not in _IN_FRAMES:
            raise not_read(
                f"the position of line {position.line} is of ///POSTYPE {kind.decode('latin-1')}; expected "
                "PULSE, BASE, ROBOT or USER",
                line,
            )
        if form and (form != b"RECTAN") != joints:
            raise not_read(
                f"the position of line {position.line} is of ///POSTYPE {kind.decode('latin-1') or 'PULSE'} "
                f"and behind ///{form.decode()}, which contradict each other",
                line,
            )
        return joints

    def target(self, position: Position, beside: Sequence[Beside], line: int) -> int:
        """The place of the target of a pose."""
        outer = self._outer(position, beside, line)
        used = outer, self.station(beside, line)
        known = self._known(position, used, line)
        if known is not None:
            return known
        numbers = position.numbers
        if numbers is None or len(numbers) < _NUMBERS:
            raise ProgramError(
                f"the position of line {position.line} is in another form; expected X, Y, Z in mm and Rx, "
                "Ry, Rz in deg",
                line=line,
                code="OLP533",
            )
        (x, a), (y, b), (z, c), (rx, i), (ry, j), (rz, k) = numbers[:_NUMBERS]
        posture = position.header.posture
        if posture not in self._words:
            self._words[posture] = postures.words_of(posture)
        words = self._words[posture]
        # lines of their own around the position, where the words of its posture change
        begin, end = position.span
        around = ((begin, begin), (end, end)) if words[0] == words[0] else ()
        index = self.moves.target(
            position.line, position.span, (x, y, z), (a, b, c), of_zyx((k, j, i)), outer,
            self.name(position), position.span, (rx, ry, rz), around, words, outer,
            self._copy(position, beside),
        )  # fmt: skip
        self._targets[position.line] = index, used
        return index

    def joints(self, position: Position, beside: Sequence[Beside], line: int) -> int | None:
        """The place of the target of joints; None where the text does not state all six. Raises ProgramError
        for pulses where the machine does not state what they are."""
        outer = self._outer(position, beside, line)
        used = outer, self.station(beside, line)
        known = self._known(position, used, line)
        numbers = position.numbers
        if known is not None or numbers is None or len(numbers) < _NUMBERS:
            return known
        counts: tuple[float, ...] = ()
        degrees = [value for _, value in numbers[:_NUMBERS]]
        if position.header.kind.upper() != b"ANGLE":
            stated = self.setup.machine.pulses_per_deg
            if stated is None:
                raise ProgramError(
                    f"the position of line {position.line} is in pulses, and how many of them turn an axis "
                    "by a degree is not stated; give pulses_per_deg in each [axes.NAME] of the machine file",
                    line=line,
                    code="OLP533",
                )
            counts = stated
            degrees = [value / per for value, per in zip(degrees, counts, strict=True)]
        a, b, c, d, e, f = degrees
        index = self.moves.joint_target(
            position.line, position.span, [span for span, _ in numbers[:_NUMBERS]], (a, b, c, d, e, f), outer,
            self.name(position), position.span, counts, self._copy(position, beside),
        )  # fmt: skip
        self._targets[position.line] = index, used
        return index

    def tool(self, position: Position, line: int) -> Tool:
        """The tool of a position. Raises ProgramError where neither machine nor job states it."""
        text = position.header.tool.strip()
        number = int(text) if text.isdigit() else self.setup.machine.default_tool
        if number is None or (text and not text.isdigit()):
            raise ProgramError(
                f"the position of line {position.line} names no tool; state ///TOOL before it, or "
                "job_defaults.tool in the machine file",
                line=line,
                code="OLP521",
            )
        if number not in self._tools:
            frames = self.moves.frames
            self._tools[number] = frames.numbered_tool(f"TL{number}", number, None, line, none=None)
        return self._tools[number]

    def frame(self, position: Position, target: Target, line: int) -> Located:
        """The frame of a pose."""
        kind = position.header.kind.upper()
        base = target.outer[0] if target.outer and target.outer[0] < ABSENT else 0.0
        key = (position.header.user if kind == b"USER" else kind), base
        if key not in self._frames:
            self._frames[key] = self._located(position, kind, base, line)
        return self._frames[key]

    def _located(self, position: Position, kind: bytes, base: float, line: int) -> Located:
        world, track = self.moves.frames.world, self.setup.machine.track
        if kind == b"BASE" or (kind == b"ROBOT" and base == 0.0):
            return world
        if kind == b"USER":
            number = position.header.user.strip()
            if not number.isdigit():
                raise ProgramError(
                    f"the position of line {position.line} is in a user frame, and no ///USER names it",
                    line=line,
                    code="OLP523",
                )
            if base != 0.0 and track is not None:
                raise not_read(
                    "the base axis of this move counts from the user frame, which is not read; save the job "
                    "in base coordinates (///POSTYPE BASE)",
                    line,
                )
            return self.moves.frames.located(f"UF{int(number)}", None, line)
        if track is None:
            raise not_read(
                "this position counts from the arm on its base axis (///POSTYPE ROBOT), and track in "
                "[kinematics] does not state where that leads",
                line,
            )
        x, y, z = (base * part for part in track)
        return world.holding(f"ROBOT {base:g}", Pose((x, y, z)))

    def name(self, position: Position) -> str:
        """The name of a position as its declaration has it."""
        text = self.data[slice(*position.span)]
        return text[: text.index(b"=")].strip().decode("latin-1")

    def _known(self, position: Position, used: _Used, line: int) -> int | None:
        known = self._targets.get(position.line)
        if known is None:
            return None
        if known[1] != used:
            raise not_read(
                f"the position of line {position.line} is used with two positions of the axes beside the "
                "robot; give each its own",
                line,
            )
        return known[0]

    def station(self, beside: Sequence[Beside], line: int) -> tuple[float, ...]:
        """The values of a positioner, which stands or moves beside the robot."""
        return tuple(
            value for kind, number in beside if kind == b"EC"
            for value in self._values(kind, number, line)[0]
        )  # fmt: skip

    def _outer(self, position: Position, beside: Sequence[Beside], line: int) -> tuple[float, ...]:
        """The base axes, or one that is not there, and behind them all others of the robot."""
        own = [] if position.numbers is None else [value for _, value in position.numbers[_NUMBERS:]]
        machine = self.setup.machine
        bases: list[float] = []
        for kind, number in beside:
            if kind not in _BASES:
                continue
            values, form = self._values(kind, number, line)
            # joints say where the arm is on its carriage, wherever that is
            counts = machine.track_errors or position.header.form == b"RECTAN"
            if counts and form != b"RECTAN" and any(values) and machine.track is not None:
                raise not_read(
                    "the base axis of this move is in pulses; save the job in base coordinates "
                    "(///POSTYPE BASE), where it is in mm",
                    line,
                )
            bases += values
        on_arm = position.header.kind.upper() == b"ROBOT"
        if not bases and on_arm and machine.track is not None and not machine.track_errors:
            # it counts from the arm, wherever its carriage is
            bases = [0.0]
        if not bases and not own:
            return ()
        return (*(bases or (ABSENT,)), *own)

    def _values(self, kind: bytes, number: int, line: int) -> tuple[list[float], bytes]:
        """The values of an axis beside the robot, and their form."""
        found = self.job.positions.get((kind, number), [])
        numbers = found[0].numbers if len(found) == 1 else None
        if numbers is None:
            name = f"{kind.decode()}{number:05d}"
            raise ProgramError(
                f"the position {name} is not stated once with its numbers", line=line, code="OLP533"
            )
        return [value for _, value in numbers], found[0].header.form

    def _copy(self, position: Position, beside: Sequence[Beside]) -> Copy:
        """Where further positions like this one go, with those of the axes beside the robot."""
        taught = [(kind, number) for kind, number in beside if kind in TAUGHT]
        others = [(kind, self.job.positions[kind, number][0]) for kind, number in taught]
        return self._copied(b"C", position, tuple(self._copied(kind, own) for kind, own in others))

    def _copied(self, kind: bytes, position: Position, beside: tuple[Copy, ...] = ()) -> Copy:
        eol = b"\r\n" if self.data.startswith(b"\r\n", position.span[1]) else b"\n"
        place, there = self.job.places[kind]
        own, text = position.header, self.data[slice(*position.span)]
        return Copy(place, own.before(there, eol), there.before(own, eol), text, beside)
