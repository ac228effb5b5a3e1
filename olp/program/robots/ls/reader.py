"""Reads TP programs of FANUC robots: moves, and the positions whose numbers can be edited.

A position names its own frame and tool, so it is right wherever the program comes from.
"""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector
from olp.core.patterns import pattern
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.robots.frames import Located, Tool
from olp.program.robots.ls import postures
from olp.program.robots.ls.manner import CHOSEN, Manner, Manners
from olp.program.robots.ls.registers import Registers
from olp.program.robots.ls.text import Line, Position, lines, parts, positions
from olp.program.robots.moves import RobotMoves, not_read, take_all
from olp.program.robots.poses import Pose, of_zyx, rotated
from olp.program.robots.targets import NOWHERE, Span, Use

#: The same of an arc, whose via point stands first.
_ARC = pattern(rb"(?i)(\s*)C\s+P\[\s*(\d+)\s*(?::[^\]]*)?\]\s+(PR?\[.*)")
#: Moves that are not read, by their letters.
_OTHERS = {"C": "an arc through a register", "A": "an arc of several moves", "S": "a spline"}
_OTHER_MOVE = pattern(rb"(?i)\s*[CASLJ]\s+PR?\[")
#: Statements by which later targets are moved.
_MOVING = pattern(
    rb"(?i)\s*(?:Touch\s+Offset|Search\s+Start|Track\b|VISION\s+.*OFFSET|(?:TOOL_)?OFFSET\s+COND)"
)
_COPIED = pattern(rb"(?i)\s*PR\[[^\]]*\]\s*=(.*)")
_NUMBERED = pattern(rb"(?i)(?<!\w)P\[\s*(\d+)")
_ASSIGNED = pattern(rb"(?i)\s*P\[\s*(\d+)[^\]]*\]\s*=")
#: Statements by which the tool swings about the path from here on.
_WEAVE = pattern(rb"(?i)\s*Weave\s+(?!End\b).*")
#: Statements that neither move nor lead elsewhere.
_STILL = pattern(
    rb"(?i)\s*(?:!.*|//.*|--.*|(?:R|DO|RO|GO|AO|F|SO|SR|UO|TIMER|AR|VR|SI)\[.*|WAIT\b.*|WARTE\b.*|PAYLOAD\b.*|"
    rb"PAUSE|UALM\b.*|OVERRIDE\b.*|\$.*|JMP\s+LBL\b.*|IF\b.*,\s*JMP\s+LBL\b.*|MESSAGE\b.*|"
    rb"RSR\b.*|COL\s+.*|Arc\s+.*|Weld\s+.*|Weave\s+End\b.*|LOCK\s+.*|UNLOCK\s+.*|COMMENT\b.*|SKIP\s+CONDITION\b.*|"
    rb"MONITOR\b.*|TC_ONLINE\b.*|JOINT_MAX_SPEED\b.*|LINEAR_MAX_SPEED\b.*|POINT_LOGIC\b.*|ACC\b.*|"
    rb"STOP_TRACKING\b.*)?\s*"
)
_ENDS = pattern(rb"(?i)\s*(?:END|ABORT|JMP\s+LBL\b[^,]*)\s*")
_BLOCK = pattern(rb"(?i)\s*(?:(IF\b.*THEN)|(FOR\b.*)|(ELSE)|(ENDIF|ENDFOR))\s*")
_POSE = frozenset("XYZWPR")
_JOINTS = ("J1", "J2", "J3", "J4", "J5", "J6")


def read(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    return _Reader(data, setup).run(dialect, options or Options(), words=words)


class _Reader:
    """Reads one program."""

    def __init__(self, data: bytes, setup: Setup) -> None:
        self.data, self.setup = data, setup
        self.moves = RobotMoves(data, setup, "UFRAME0")
        self.registers = Registers(())
        self.manners = Manners(arm=self.moves.arm)
        self.positions: dict[int, list[Position]] = {}
        self.known: dict[int, int] = {}
        #: positions that registers get the numbers of
        self.copied: list[str] = []
        self.frames: dict[tuple[int, Pose | None], Located] = {}
        self.tools: dict[tuple[int, Pose | None], Tool] = {}
        #: what other motion groups are at, as text
        self.beside = b""
        #: configurations and other groups by their text
        self.configs: dict[tuple[bytes, bytes], int] = {}
        self.blocks: list[tuple[bool, int]] = []
        self.refusals: list[ProgramError] = []

    def run(self, dialect: Dialect, options: Options, *, words: bool) -> Program:
        sections = parts(self.data)
        if "MN" not in sections:
            raise ProgramError("the text has no part /MN", line=1, code="OLP510")
        for part in sections.get("POS", []):
            positions(self.data, part, self.positions)
        every = [line for part in sections["MN"] for line in lines(self.data, part)]
        for line in every:
            copied = _COPIED.match(line.text)
            self.copied += [] if copied is None else [f"P[{int(n)}]" for n in _NUMBERED.findall(copied[1])]
        self.registers = Registers(line.text for line in every)
        take_all(every, self._statement, self.moves, self.refusals, options)
        return self.moves.program(dialect, words=words)

    # -- statements ----------------------------------------------------------------------------------

    def _statement(self, line: Line) -> None:
        text = line.text
        move = self.manners.of(text)
        if move is not None:
            self._move(line, *move)
            return
        arc = _ARC.fullmatch(text)
        move = None if arc is None else self.manners.of(arc[1] + b"L " + arc[3])
        if arc is not None and move is not None:
            self._arc(line, int(arc[2]), *move)
            return
        if _OTHER_MOVE.match(text):
            letter = text.split()[0].upper().decode("latin-1")
            what = _OTHERS.get(letter, "a move with words of its own")
            raise not_read(f"{what} ({letter}), which is not read; post straight moves (L)", line.line)
        if _ASSIGNED.match(text):
            raise not_read("a position gets another value, so its numbers depend on the run", line.line)
        if _MOVING.match(text):
            raise not_read("targets are moved by what a sensor or a register says", line.line)
        if self.registers.take(text) or _STILL.fullmatch(text):
            return
        if _WEAVE.fullmatch(text):
            what = "the tool weaves from here on: the path about which it swings is corrected and judged"
            self.moves.remark("weave", line.line, what)
            return
        block = _BLOCK.fullmatch(text)
        if block is not None:
            self._block(block.lastindex or 0)
        elif not _ENDS.fullmatch(text):
            self._unknown(line)

    def _unknown(self, line: Line) -> None:
        """Behind a label, a call or a macro where the robot is depends on the run."""
        self.moves.known = False
        self.registers.forget()
        text = line.text.strip()
        if not text.upper().startswith(b"LBL"):
            what = f"`{text[:40].decode('latin-1')}` may move the robot: correct that program too"
            self.moves.remark("called", line.line, what)

    def _block(self, kind: int) -> None:
        if kind in (1, 2):
            self.blocks.append((kind == 2, self.moves.count))
            return
        moved = bool(self.blocks) and self.blocks[-1][1] != self.moves.count
        if kind == 4 and self.blocks:
            self.blocks.pop()
        if moved or not self.blocks:
            self.moves.known = False
        self.registers.forget()

    # -- moves ---------------------------------------------------------------------------------------

    def _move(self, line: Line, move: Manner, number: int) -> None:
        self._begin(line, move, number)
        position = None if move.register else self._position(number, line)
        shift = self._shift(move, position)
        begin = self.data.index(b"[", line.first) + 1
        place = begin, self.data.index(b"]", begin)
        whole = self._groups_move(position, line)
        if position is not None and "X" not in position.axes:
            self.moves.joint_move(line.line, lambda: self._joints(line, move, number, position, place))
            return
        if position is None or shift is None:
            self.moves.left(line.line)
            what = "left as written: the text does not state where this move goes"
            self.moves.remark("left", line.line, what)
            # it may go to a position itself, or to a register that got the numbers of one
            self.moves.hold(self.copied if position is None else [f"P[{number}]"])
            return
        along_tool = shift != ZERO and move.offset is not None and move.offset.along_tool
        use = self._use(line, number, position, place, shift, along_tool=along_tool)
        self.moves.move(
            line.line, use, self._frame(position, line), self._tool(position, line), move.feed,
            straight=move.straight, whole=whole or move.whole,
        )  # fmt: skip
        if move.skips:
            self.moves.known = False

    def _arc(self, line: Line, via_number: int, move: Manner, number: int) -> None:
        """An arc through a position to another one."""
        self._begin(line, move, number)
        if move.register or move.offset is not None or move.skips:
            raise not_read("an arc to a register, with an offset or with Skip is not read", line.line)
        begin, ends, whole = line.first, [], False
        for own in (via_number, number):
            begin = self.data.index(b"[", begin) + 1
            position = self._position(own, line)
            if "X" not in position.axes:
                raise not_read(f"P[{own}] of this arc is in joints; post it as a position", line.line)
            span = begin, self.data.index(b"]", begin)
            whole |= self._groups_move(position, line)
            use = self._use(line, own, position, span, ZERO)
            ends.append((use, self._frame(position, line), self._tool(position, line)))
        (via, *place), (end, frame, tool) = ends
        if place != [frame, tool]:
            raise not_read("via point and end of this arc have different frames or tools", line.line)
        self.moves.arc(
            line.line, via, end, frame, tool, move.feed, turned_by_via=True,
            whole=whole or move.whole,
        )  # fmt: skip

    def _groups_move(self, position: Position | None, line: Line) -> bool:
        """Whether other motion groups move along with a move, or may: parts would lead them to its end before
        the move ends."""
        others = b"" if position is None else position.others
        moved, self.beside = others != self.beside, others
        if others:
            what = (
                "other motion groups are kept as written: they are not corrected, and positions of the first "
                "do not count from them"
            )
            self.moves.remark("groups", line.line, what)
        return moved

    def _use(
        self, line: Line, number: int, position: Position, place: Span, shift: Vector, *,
        along_tool: bool = False,
    ) -> Use:  # fmt: skip
        index = self._target(number, position)
        active = self.registers.frame, self.registers.tool
        if active != (-1, -1):
            self._tell_other(line, number, (position.frame, position.tool), active)
        return Use(
            index, (line.span[0], line.span[1]), place, place, shift, self.moves.targets[index].turn,
            zone=(line.first, line.span[1]), along_tool=along_tool,
        )  # fmt: skip

    def _tell_other(self, line: Line, number: int, used: tuple[int, int], active: tuple[int, int]) -> None:
        """Tell a frame or a tool of a position that is not the active one."""
        for name, own, other in zip(("UFRAME", "UTOOL"), used, active, strict=True):
            if own != other and own >= 0 and other >= 0:
                what = f"P[{number}] is in {name} {own}, and {name}_NUM is {other} here: the control stops"
                self.moves.remark(name, line.line, what)

    def _begin(self, line: Line, move: Manner, number: int) -> None:
        """What counts for all moves. Raises ProgramError for words of them that are not read."""
        if self.blocks and any(loop and before == self.moves.count for loop, before in self.blocks):
            self.moves.known = False
        if move.elsewhere:
            raise not_read(f"this move {move.elsewhere}, which is not read", line.line)
        if number == CHOSEN and not move.register:
            what = "which position this move goes to is chosen in the run; program it with its number"
            raise not_read(what, line.line)
        if move.unread:
            raise not_read(f"{move.unread}; post the move without it", line.line)

    def _joints(self, line: Line, move: Manner, number: int, position: Position, place: Span) -> Use | None:
        """How a move uses joint values; None where the text does not state where they lead."""
        axes = position.axes
        if not set(_JOINTS) <= set(axes) or move.offset is not None:
            return None
        if self.setup.machine.third_level is None:
            what = (
                "whether J3 counts from the horizontal is not stated: give third_joint_level in [kinematics]"
            )
            self.moves.remark("level", line.line, what)
            return None
        index = self.known.get(number)
        if index is None:
            a, b, c, d, e, f = (axes[name][1] for name in _JOINTS)
            index = self.known[number] = self.moves.joint_target(
                position.line, position.span, [axes[name][0] for name in _JOINTS], (a, b, c, d, e, f),
                position.outer, f"P[{number}]", position.span,
            )  # fmt: skip
        return Use(index, line.span, place, place, zone=(line.first, line.span[1]))

    def _shift(self, move: Manner, position: Position | None) -> Vector | None:
        """How far a move goes from its position, along its frame; None where the text does not say it."""
        offset = move.offset
        if offset is None or position is None or "X" not in position.axes:
            return ZERO
        pose = None if offset.register is None else self.registers.pose(offset.register)
        if pose is None or pose.turn[1:] != ZERO:
            return None
        return pose.origin_mm if offset.in_frame else rotated(_turn(position), pose.origin_mm)

    def _position(self, number: int, line: Line) -> Position:
        found = self.positions.get(number, [])
        if len(found) != 1:
            what = "is not stated" if not found else "is stated twice"
            raise ProgramError(f"the position P[{number}] {what}", line=line.line, code="OLP533")
        axes = found[0].axes
        if found[0].foreign:
            raise ProgramError(
                f"the position P[{number}] of line {found[0].line} states `{found[0].foreign}`; expected mm "
                "and deg",
                line=line.line,
                code="OLP533",
            )
        if "E1" in found[0].turning and self.setup.machine.track is not None:
            raise ProgramError(
                f"the position P[{number}] of line {found[0].line} states E1 in deg, and E1 is the track of "
                "the arm, in mm; expected a machine file without a track",
                line=line.line,
                code="OLP533",
            )
        posed = "X" in axes and axes.keys() >= _POSE
        if not posed and ("X" in axes or not any(name[0] == "J" for name in axes)):
            raise ProgramError(
                f"the position P[{number}] of line {found[0].line} is not taught, or in another form",
                line=line.line,
                code="OLP533",
            )
        return found[0]

    def _target(self, number: int, position: Position) -> int:
        known = self.known.get(number)
        if known is None:
            axes = position.axes
            (x, a), (y, b), (z, c) = axes["X"], axes["Y"], axes["Z"]
            text = self.data[slice(*position.config)]
            config = float(self.configs.setdefault((text, position.others), len(self.configs)))
            words, own = postures.words_of(text)
            first = position.config[0]
            turns = tuple((first + begin, first + end) for begin, end in own)
            outer = position.outer
            known = self.known[number] = self.moves.target(
                position.line, position.span, (x, y, z), (a, b, c), _turn(position),
                (config, *outer), f"P[{number}]", position.span,
                (axes["R"][0], axes["P"][0], axes["W"][0]), turns, words, outer,
                along=axes["E1"][0] if "E1" in axes else NOWHERE,
            )  # fmt: skip
        return known

    def _frame(self, position: Position, line: Line) -> Located:
        number = self.registers.frame if position.frame < 0 else position.frame
        key = number, self.registers.frame_of(number)[1]
        if key not in self.frames:
            self.frames[key] = self._located(number, line)
        return self.frames[key]

    def _located(self, number: int, line: Line) -> Located:
        if number < 0:
            raise not_read("the frame of this position is the active one, and not known here", line.line)
        if number == 0:
            return self.moves.frames.world
        given, pose = self.registers.frame_of(number)
        if given and pose is None:
            raise self._unstated("UFRAME", number, line)
        return self.moves.frames.located(f"UFRAME{number}", pose, line.line)

    @staticmethod
    def _unstated(table: str, number: int, line: Line) -> ProgramError:
        what = (
            f"{table}[{number}] gets numbers that the text does not state; state them in PR[i], and set it "
        )
        return not_read(what + "once, before all labels and jumps", line.line)

    def _tool(self, position: Position, line: Line) -> Tool:
        number = self.registers.tool if position.tool < 0 else position.tool
        key = number, self.registers.tool_of(number)[1]
        if key not in self.tools:
            self.tools[key] = self._numbered(number, line)
        return self.tools[key]

    def _numbered(self, number: int, line: Line) -> Tool:
        if number < 0:
            raise not_read("the tool of this position is the active one, and not known here", line.line)
        given, pose = self.registers.tool_of(number)
        if given and pose is None and number:
            raise self._unstated("UTOOL", number, line)
        return self.moves.frames.numbered_tool(f"UTOOL{number}", number, pose, line.line)


def _turn(position: Position) -> tuple[float, float, float, float]:
    """The orientation of a position: Rz(R) Ry(P) Rx(W)."""
    axes = position.axes
    return of_zyx((axes["R"][1], axes["P"][1], axes["W"][1]))
