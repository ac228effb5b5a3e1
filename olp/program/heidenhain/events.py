"""Statements of a Heidenhain program that are no motion blocks: what each changes, and which are refused."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from olp.core.errors import ProgramError
from olp.core.spool import whole
from olp.core.toolpath import Interpolated
from olp.core.units import MM_PER_INCH
from olp.program.dialect import Options
from olp.program.heidenhain.chunk import harmless
from olp.program.heidenhain.collector import Collected
from olp.program.heidenhain.cycles import AT_ONCE, PATTERNS, Cycle
from olp.program.heidenhain.modes import Modes
from olp.program.heidenhain.names import name_of, refuse
from olp.program.heidenhain.planes import Plane, plane_of
from olp.program.heidenhain.statements import CycleText, Statement, cycle_of, of_lines
from olp.program.heidenhain.table import UNROLL

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)"
_ASSIGN = re.compile(rb"(?:FN[ \t]*0[ \t]*:[ \t]*)?(Q[LR]?\d+)[ \t]*=[ \t]*(.*)", re.I | re.S)
_VALUE = re.compile(rb"(" + _NUMBER + rb"|[-+]?Q[LR]?\d+)\Z", re.I)
#: FN 1 to FN 8, FN 13 and FN 18: the parameter that they assign
_ASSIGNED = re.compile(rb"FN[ \t]*(?:[1-8]|13|18)[ \t]*:.*?\b(Q[LR]?\d+)[ \t]*=", re.I | re.S)
#: what prints, and a stop
_PRINTS = re.compile(rb"(?:FN[ \t]*(?:14|15|16|20)\b|STOP\b|\*)")
#: where a jump leads to
_TARGET = re.compile(rb'GOTO[ \t]*LBL[ \t]*("[^"]*"|\d+)\Z')
#: bytes that a jump ahead may pass over
_JUMPED = 4000
_LABEL = re.compile(rb'LBL[ \t]*("[^"]*"|\d+)', re.I)
_SECTION_END = re.compile(rb"(?im)^[ \t]*\d*[ \t]*LBL[ \t]*0(?![\d.])")
_CALL = re.compile(rb'CALL[ \t]+LBL[ \t]*("[^"]*"|\d+)[ \t]*(REP.*)?\Z', re.I | re.S)
_ANGLE = re.compile(rb"\bSP([ABC])[ \t]*(" + _NUMBER + rb")", re.I)
#: What these cycles say where they change nothing.
_CHANGING_NOTHING = {
    8: re.compile(rb""),
    10: re.compile(rb"(?:I?ROT[ \t]*[-+]?0*\.?0*)?", re.I),
    11: re.compile(rb"(?:SCL[ \t]*\+?0*1(?:\.0*)?)?", re.I),
    19: re.compile(
        rb"(?:[ABC][ \t]*[-+]?(?:0+\.?0*|\.0+)[ \t]*)*(?:(?:DIST|ABST|F)[ \t]*(?:MAX|[\d.]+)[ \t]*)*", re.I
    ),
    26: re.compile(rb"(?:CC[XYZ][ \t]*" + _NUMBER + rb"[ \t]*|[XYZ][ \t]*\+?0*1(?:\.0*)?[ \t]*)*", re.I),
}
_TCPM = re.compile(
    rb"FUNCTION[ \t]+TCPM[ \t]+F[ \t]+(?:TCP|CONT)[ \t]+AXIS[ \t]+POS[ \t]+PATHCTRL[ \t]+(?P<way>AXIS|VECTOR)"
    rb"(?:[ \t]+REFPNT[ \t]+TIP-TIP)?(?:[ \t]+F[ \t]*[\d.]+)?"
)
_FUNCTIONS = re.compile(rb"(?:L[ \t]+)?(?:M\d+[ \t]*)+")
_PRESET = 339
_MOTION = re.compile(rb"(?:LN?|CC?|CR|CP)[ \t]|[XYZABC][-+.\d]|I[XYZ]|[MF][ \t]*[-+.\dM]")
_SHIFT = 7
_DWELL = 9
_SELECT = 247
#: numbers of the touch probe cycles
_TOUCHES = (range(400, 500), range(1400, 1500))


class Events:
    """Takes statements over into `modes`, in their order; `ended` is the line of the end of the program."""

    def __init__(self, modes: Modes, collector: Collected, options: Options) -> None:
        self.modes, self.collector, self.options = modes, collector, options
        #: how tool centre point control leads rotary axes, empty where the machine has none
        self.tips: Interpolated = ""
        self.cycle: Cycle | None = None
        self.definition: Cycle | None = None
        self.ended = 0
        #: the statements of sections that are called, by label
        self.sections: dict[bytes, list[Statement] | None] = {}
        self._depth = 0
        #: parameters that a jump to a label may leave as they were
        self._jumped: dict[bytes, list[str]] = {}
        self._handlers: Sequence[tuple[bytes, Callable[[Statement], None]]] = (
            (b"BEGIN PGM", self._begin), (b"END PGM", self._end), (b"TOOL CALL", self._tool),
            (b"CYCL CALL", self._cycle_call), (b"CALL LBL", self._call), (b"LBL", self._label),
            (b"FUNCTION TCPM", self._tcpm), (b"FUNCTION RESET", self._reset), (b"PLANE", self._plane),
            (b"STOP", self._stop), (b"Q", self._assign),
            *((b"FN %d" % n, self._unknown) for n in (*range(1, 9), 13, 18)),
            (b"FN 0", self._assign), *((b"FN %d" % n, self._jump) for n in (9, 10, 11, 12)),
        )  # fmt: skip
        self._by_name = dict(self._handlers)

    def take(self, statement: Statement) -> None:
        """Take over one statement. Raises ProgramError where it is refused."""
        upper = statement.upper
        if not upper:
            return
        if statement.deleted:
            self._deleted(statement, upper)
            return
        cycle = cycle_of(statement)
        if cycle is not None:
            self._define(cycle, statement)
            return
        name = name_of(upper)
        handler = self._by_name.get(name)
        if handler is not None:
            handler(statement)
            return
        refuse(name, statement)

    def _deleted(self, statement: Statement, upper: bytes) -> None:
        if self.options.block_delete:
            return
        if re.fullmatch(rb"M0*(?:2|30)", upper):
            self.ended = statement.line
            return
        raise ProgramError(
            f"{statement.shown} is under block delete, and later blocks may depend on it; remove the `/`",
            line=statement.line,
            code="OLP525",
        )

    # -- the program ---------------------------------------------------------------------------------

    def _begin(self, statement: Statement) -> None:
        words = statement.upper.split()
        modes = self.modes
        if modes.unit_stated:
            return
        modes.unit_stated = True
        modes.unit_mm = MM_PER_INCH if words[-1] == b"INCH" else 1.0
        if words[-1] not in (b"INCH", b"MM"):
            modes.unit_stated = False

    def _end(self, statement: Statement) -> None:
        self.ended = statement.line

    def _stop(self, statement: Statement) -> None:
        self.collector.pauses.append((self.collector.moves, 0.0))

    def _tool(self, statement: Statement) -> None:
        if self.modes.tool_call(statement) and self.modes.setup.machine.tool_change_moves:
            self.control_move(statement.line, (0, 1, 2))

    def control_move(self, line: int, axes: Sequence[int]) -> None:
        """A move that the control makes by itself: the position of some axes is not known after it."""
        raise NotImplementedError

    def turned_by_control(self, plane: Plane, letters: str, line: int) -> None:
        """A move of rotary axes, all where no `letters` are stated, to where the control finds them."""
        raise NotImplementedError

    # -- parameters ----------------------------------------------------------------------------------

    def _assign(self, statement: Statement) -> None:
        match = _ASSIGN.match(statement.text)
        if match is None:
            raise ProgramError(
                f"{statement.shown} is no assignment that is read; expected Q and a number",
                line=statement.line,
                code="OLP510",
            )
        name, known = match[1].upper().decode(), self.modes.parameters
        self._not_of_cycle(name, statement)
        value = _VALUE.match(match[2].strip())
        known.pop(name, None)
        if value is None:
            return
        text = value[1].upper()
        other = text.lstrip(b"+-").decode()
        if not other.startswith("Q"):
            known[name] = float(text)
        elif other in known:
            known[name] = -known[other] if text.startswith(b"-") else known[other]

    def _unknown(self, statement: Statement) -> None:
        match = _ASSIGNED.match(statement.text)
        if match is not None:
            name = match[1].upper().decode()
            self._not_of_cycle(name, statement)
            self.modes.parameters.pop(name, None)

    def _not_of_cycle(self, name: str, statement: Statement) -> None:
        """Refuse an assignment to a parameter of the cycle in force, whose calls take the new value."""
        if self.cycle is not None and name in {f"Q{number}" for number in self.cycle.values}:
            raise ProgramError(
                f"{name} belongs to CYCL DEF {self.cycle.number} of line {self.cycle.line}, whose next call "
                "takes the new value",
                line=statement.line,
                code="OLP511",
                hint=UNROLL,
            )

    def _jump(self, statement: Statement) -> None:
        """A jump ahead over what moves nothing and changes no mode: what is assigned there is not known."""
        target = _TARGET.search(statement.upper)
        begin = statement.span[1]
        if target is None or begin < 0:
            refuse(name_of(statement.upper), statement)
            return
        lines = self.collector.data[begin : begin + _JUMPED].split(b"\n")[1:]
        assigned: list[str] = []
        for other in statements_of(lines, statement.line + 1):
            label = _LABEL.match(other.upper)
            if label is not None and label[1] == target[1]:
                self._jumped.setdefault(label[1], []).extend(assigned)
                return
            match = _ASSIGN.match(other.text) or _ASSIGNED.match(other.text)
            if other.deleted or (match is None and not _PRINTS.match(other.upper)):
                break
            if match is not None:
                name = match[1].upper().decode()
                self._not_of_cycle(name, statement)
                assigned.append(name)
        refuse(name_of(statement.upper), statement)

    # -- labels --------------------------------------------------------------------------------------

    def _label(self, statement: Statement) -> None:
        label = _LABEL.match(statement.upper)
        if label is None:
            raise ProgramError("LBL has no number and no name", line=statement.line, code="OLP510")
        for name in self._jumped.get(label[1], ()):
            self.modes.parameters.pop(name, None)

    def _call(self, statement: Statement) -> None:
        """CALL LBL of a section that only sets modes: these are set here too."""
        match = _CALL.match(statement.text)
        section = None if match is None or match[2] else self._section(match[1].upper())
        if section is None or self._depth or any(_moves(s) for s in section):
            refuse(b"CALL LBL", statement)
            return
        self._depth = 1
        for inner in section:
            if not _FUNCTIONS.fullmatch(inner.upper):
                self.take(inner)
            elif self.tips and re.search(rb"M129\b", inner.upper):
                self.modes.switch_tips("", statement.line)
        self._depth = 0

    def _section(self, label: bytes) -> list[Statement] | None:
        if label not in self.sections:
            self.sections[label] = section_of(whole(self.collector.data), label)
        return self.sections[label]

    # -- cycles --------------------------------------------------------------------------------------

    def _define(self, text: CycleText, statement: Statement) -> None:
        number, part = text.number, text.part
        current = self.definition
        if part and current is not None and current.number == number:
            current.parts[part] = text.rest
        else:
            current = self.definition = Cycle.of(text, statement)
            if number not in AT_ONCE:
                self.cycle = current
        if number in AT_ONCE:
            self._at_once(text, statement)
        elif number in PATTERNS:
            refuse(b"CYCL DEF %d" % number, statement)
        elif not part and any(number in numbers for numbers in _TOUCHES):
            raise ProgramError(
                f"CYCL DEF {number} touches the part, and what it finds may move the datum; run it in a "
                "program of its own, and state the datum in [work_offsets.NAME]",
                line=statement.line,
                code="OLP512",
            )
        elif not part and number > 299:
            raise ProgramError(
                f"CYCL DEF {number} is a cycle of the builder of the machine, and may move it; write plain "
                "moves for it, or run it in a program of its own",
                line=statement.line,
                code="OLP512",
            )

    def _at_once(self, text: CycleText, statement: Statement) -> None:
        number, part, rest = text.number, text.part, text.rest
        name = b"CYCL DEF %d" % number
        if number == _SHIFT and part:
            turned = [
                self.modes.value(v, statement) for axis, _, v in text.shifts(statement) if axis in "ABC"
            ]
            if self.tips and any(turned):
                raise ProgramError(
                    "CYCL DEF 7 shifts a rotary axis, which is not read; state the shift in "
                    "[work_offsets.NAME]",
                    line=statement.line,
                    code="OLP565",
                )
            self.modes.datum_shift(text, statement)
        elif number == _SELECT:
            value = text.values.get(_PRESET)
            if value is None:
                raise ProgramError("CYCL DEF 247 has no Q339; give it", line=statement.line, code="OLP516")
            self.modes.select_preset(round(self.modes.value(value, statement)), statement.line)
        elif number == _DWELL and part:
            seconds = re.search(rb"(" + _NUMBER + rb")\s*\Z", rest)
            self.collector.pauses.append((self.collector.moves, float(seconds[1]) if seconds else 0.0))
        elif part and number in _CHANGING_NOTHING and not _CHANGING_NOTHING[number].fullmatch(rest):
            refuse(name, statement)

    def _cycle_call(self, statement: Statement) -> None:
        rest = statement.upper[len(b"CYCL CALL") :].strip()
        if rest.startswith((b"POS", b"PAT")):
            raise ProgramError(
                f"CYCL CALL {rest[:3].decode()} states where the holes are",
                line=statement.line,
                code="OLP512",
                hint=UNROLL,
            )
        self.hole(statement.line)

    def hole(self, line: int) -> None:
        """The strokes of the cycle in force, where the tool is."""
        raise NotImplementedError

    # -- tool centre point control -------------------------------------------------------------------

    def _tcpm(self, statement: Statement) -> None:
        """FUNCTION TCPM with axis positions; the other forms are refused by name."""
        if not self.tips:
            refuse(b"FUNCTION TCPM", statement)
        words = _TCPM.fullmatch(statement.upper)
        if words is None:
            raise ProgramError(
                f"{statement.shown} is not read; expected F TCP or F CONT, AXIS POS, PATHCTRL AXIS or "
                "VECTOR, and REFPNT TIP-TIP",
                line=statement.line,
                code="OLP512",
                word="FUNCTION TCPM",
            )
        self.modes.switch_tips("vector" if words["way"] == b"VECTOR" else "axes", statement.line)

    def _reset(self, statement: Statement) -> None:
        if self.tips and re.match(rb"FUNCTION[ \t]+RESET[ \t]+TCPM\b", statement.upper):
            self.modes.switch_tips("", statement.line)

    # -- tilted planes -------------------------------------------------------------------------------

    def _plane(self, statement: Statement) -> None:
        if self.tips:
            before = self.modes.plane
            plane = plane_of(statement, None if before is None else before.turn)
            self.modes.tilt(plane, statement.line)
            if plane.turns:
                self.turned_by_control(plane, "", statement.line)
            return
        upper = statement.upper
        angles = _ANGLE.findall(upper)
        reset = re.match(rb"PLANE[ \t]+RESET\b", upper) is not None
        spatial = re.match(rb"PLANE[ \t]+SPATIAL\b", upper) is not None and len(angles) == 3
        if not reset and (not spatial or any(float(a) for _, a in angles)):
            refuse(b"PLANE", statement)
        elif b"MOVE" in upper:
            # where rotary axes turn back, the linear ones follow
            self.control_move(statement.line, (0, 1, 2))


def _moves(statement: Statement) -> bool:
    """Whether a statement of a section may move the machine."""
    upper = statement.upper
    if upper.startswith((b"CYCL CALL", b"TOOL CALL", b"CALL")):
        return True
    if _FUNCTIONS.fullmatch(upper):
        return not all(harmless(int(m)) for m in re.findall(rb"M(\d+)", upper))
    return cycle_of(statement) is None and _MOTION.match(upper) is not None


def section_of(data: bytes, label: bytes) -> list[Statement] | None:
    """The statements of a label up to its LBL 0, in the order of the text; None unless it is there once."""
    begins = list(re.finditer(rb"(?im)^[ \t]*\d*[ \t]*LBL[ \t]*" + re.escape(label) + rb"(?![\d.])", data))
    if len(begins) != 1:
        return None
    begin = begins[0].end()
    end = _SECTION_END.search(data, begin)
    lines = data[begin : len(data) if end is None else end.start()].split(b"\n")[1:]
    return statements_of(lines, data.count(b"\n", 0, begin) + 2)


def statements_of(lines: Sequence[bytes], first: int) -> list[Statement]:
    """The statements of lines, the first of which has this number."""
    statements, begin = [], 0
    for k, line in enumerate(lines):
        if not line.rstrip().endswith(b"~"):
            statements.append(of_lines(list(lines[begin : k + 1]), first + begin))
            begin = k + 1
    return [s for s in statements if s.text]
