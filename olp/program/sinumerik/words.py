"""Blocks of Sinumerik programs as words of the RS-274 family, byte for byte, with their actions."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.program.rs274.codes import INCH
from olp.program.rs274.translation import Action, Drilling
from olp.program.sinumerik import cycles
from olp.program.sinumerik.actions import (
    ChangeTool,
    Compensate,
    Edge,
    GoHome,
    NameTool,
    SelectOffset,
    SetUnit,
    Tolerate,
)
from olp.program.sinumerik.blocks import NUMBER, Block, Form, Piece, arguments, unknown
from olp.program.sinumerik.constants import Constants
from olp.program.sinumerik.frames import STATEMENTS, Parts
from olp.program.sinumerik.offsets import written_offset
from olp.program.sinumerik.refusals import (
    ROTARY_ONLY,
    no_number,
    refused,
    return_elsewhere,
    statement,
    unroll,
)
from olp.program.sinumerik.swivel import swivel
from olp.program.sinumerik.table import (
    CONTOUR_WAYS,
    DRILLING,
    HARMLESS,
    HARMLESS_G,
    REFUSED,
    ROUNDING_G,
    UNROLLED,
)
from olp.program.sinumerik.tips import TIPS, tips_action

_AXES = "XYZ"
_OTHER_AXES = frozenset("ABCUVW")
_CENTRES = "IJK"
#: Components of the direction of the tool, by the letters that state it in this family.
_DIRECTIONS = {"A3": b"I", "B3": b"J", "C3": b"K"}
_COUNTED = re.compile(rb"(AC|IC)[ \t]*\([ \t]*([+-]?(?:\d+\.?\d*|\.\d+))[ \t]*\)", re.IGNORECASE)
_ROTARY = re.compile(rb"(?:AC|IC|DC|ACP|ACN)[ \t]*\([ \t]*([+-]?(?:\d+\.?\d*|\.\d+))[ \t]*\)", re.IGNORECASE)
_ADDRESS = re.compile(r"([A-Z])(\d*)")
_SAME = frozenset({0, 1, 2, 3, 9, 17, 18, 19, 40, *range(53, 58), 90, 91, 93, 94, 95, 96, 97})
#: G codes by the one of this family with the same meaning
_RENAMED = {60: 61, 71: 21, 700: 20, 710: 21, 153: 53, 961: 96, 962: 96, 971: 97, 972: 97, 973: 97,
            **dict.fromkeys(ROUNDING_G, 64)}  # fmt: skip
#: `M1=3`: M codes of a numbered spindle
_SPINDLE_M = frozenset({3, 4, 5, 19, 40, 41, 42, 43, 44, 45, 70})


class Words:
    """What the special lines of a text give, line by line: see `Translation`."""

    def __init__(self, *, tips: bool = False) -> None:
        self.tips = tips
        self.refused: dict[int, ProgramError] = {}
        self.actions: dict[int, tuple[Action, ...]] = {}
        self.counted: dict[int, tuple[str, str]] = {}
        self.central: list[int] = []
        self.closings: list[int] = []
        self.modal: list[tuple[int, Drilling | None]] = []
        self.calls: dict[int, Drilling] = {}
        #: by what it is in, the statement that contours are not read with
        self.ways: dict[str, str] = {}
        self.parts = Parts()
        self.constants = Constants()

    def refuse(self, error: ProgramError, line: int) -> None:
        """Note why a line is refused; the first reason counts."""
        error.line = line
        self.refused.setdefault(line, error)

    def line(self, code: bytes, block: Block | None, start: int, number: int) -> bytes:
        """The words of a line that begins at byte `start`, with blanks for all else."""
        if block is None:
            return b" " * len(code)
        one = _Line(self, code, block, start, number)
        try:
            one.run()
        except ProgramError as error:
            self.refuse(error, number)
        return bytes(one.out)


class _Line:
    """One line while it is turned into words."""

    def __init__(self, words: Words, code: bytes, block: Block, start: int, number: int) -> None:
        self.words, self.code, self.block, self.start, self.number = words, code, block, start, number
        self.out = bytearray(b" " * len(code))
        self.acts: list[Action] = []
        self.relative = self.absolute = ""
        self.side = 0

    def run(self) -> None:
        """Raises ProgramError, without a line, for the first piece that cannot be read."""
        self._head()
        pieces = list(self.block.pieces)
        if self.words.constants.assigned(self.code, pieces, deleted=self.block.deleted):
            return
        names = {piece.name for piece in pieces}
        whole = self._whole(pieces, names)
        if not whole:
            for piece in pieces:
                self._piece(piece, pieces)
        if self.side:
            # the edge of the same block counts, wherever it is in it
            self.acts.append(Compensate(self.side * 10, tuple(sorted(self.words.ways.values()))))
        if (self.acts or whole) and self.block.deleted:
            raise ProgramError(
                "a block under block delete changes frames, offsets or the tool, so later blocks depend on "
                "the switch; remove the `/`",
                code="OLP525",
            )
        if self.acts:
            self.words.actions[self.number] = tuple(self.acts)
        if self.relative or self.absolute:
            self.words.counted[self.number] = (self.relative, self.absolute)

    def _head(self) -> None:
        """Block delete and block number stay; a main block is numbered with a colon."""
        end = self.block.pieces[0].start if self.block.pieces else len(self.code)
        head = self.code[:end]
        if self.block.deleted:
            slash = head.index(b"/")
            self.out[slash : slash + 1] = b"/"
            if head[slash + 1 : slash + 2].isdigit():
                self.out[slash + 1 : slash + 2] = head[slash + 1 : slash + 2]
        if self.block.number:
            place = head.index(self.block.number, head.index(b"/") + 2 if self.block.deleted else 0)
            self.out[place : place + len(self.block.number)] = self.block.number
            mark = max(head.upper().rfind(b"N", 0, place), head.rfind(b":", 0, place))
            self.out[mark : mark + 1] = b"N"

    # -- statements that take the whole block --------------------------------------------------------

    def _whole(self, pieces: list[Piece], names: set[str]) -> bool:
        """Whether the block is one statement whose other words are its arguments."""
        if not pieces:
            return False
        first = pieces[0]
        if first.name in STATEMENTS:
            self._frame(first.name, pieces[1:])
        elif first.name == "MCALL":
            self._modal_call(first, pieces[1:])
        elif first.name in DRILLING and first.called:
            self._alone(pieces)
            self.words.calls[self.number] = cycles.called(self.code, self.start, first, first, always=True)
        elif first.name == "PROC":
            if any(piece.called and self.code[piece.value : piece.value_end].strip() for piece in pieces):
                raise unroll("a subprogram with parameters")
        elif first.name == "RET":
            if len(pieces) > 1 or self.code[first.value : first.value_end].strip():
                raise return_elsewhere(self.code[first.start :].decode("latin-1"))
            self._write(first.start, b"M2")
        elif first.name in UNROLLED and first.form is Form.NAME:
            raise unroll(f"`{first.name}`")
        elif any(
            piece.form is Form.WORD and piece.name == "G" and self._int(piece) in (25, 26) for piece in pieces
        ):
            self._limits(pieces)
        elif part := next((self._int(p) for p in pieces if p.name == "G" and self._int(p) in (58, 59)), 0):
            self._part(part, pieces)
        elif any(
            piece.form is Form.WORD and piece.name == "G" and self._int(piece) in (74, 75) for piece in pieces
        ):
            axes = [_AXES.index(piece.name[0]) for piece in pieces if piece.name[0] in _AXES]
            self.acts.append(GoHome(tuple(axes) or (0, 1, 2)))
        elif any(piece.form is Form.WORD and piece.name == "G" and self._int(piece) == 4 for piece in pieces):
            self._dwell(pieces)
        elif ({"WORKPIECE", "EXTERN", "MSG"} & names and len(pieces) == 1) or "EXTERN" in names:
            pass
        else:
            return False
        return True

    def _part(self, code: int, pieces: list[Piece]) -> None:
        """G58 and G59: one part of the programmable offset."""
        values = {}
        for piece in pieces:
            if piece.name in _AXES:
                values[piece.name] = self._number(piece)
            elif piece.name != "G" or self._int(piece) != code:
                raise ProgramError(
                    f"G{code} and other words are in one block; put them into blocks of their own",
                    code="OLP518",
                )
        self.acts.append(self.words.parts.part(f"G{code}", values))

    def _frame(self, name: str, pieces: list[Piece]) -> None:
        values: dict[str, float] = {}
        angle = None
        for piece in pieces:
            value = self._literal(piece)
            if piece.name in _AXES and value is not None:
                values[piece.name] = value
            elif piece.name == "RPL" and value is not None:
                angle = value
            elif value != 0.0:
                raise ProgramError(
                    f"`{piece.name}` beside {name} is not read; program a frame with X, Y and Z alone",
                    code="OLP512",
                    word=name,
                )
        action = self.words.parts.frame(name, values, angle)
        if action is not None:
            self.acts.append(action)

    def _modal_call(self, call: Piece, pieces: list[Piece]) -> None:
        drilling = None
        if pieces and pieces[0].name != "CYCLE80":
            if pieces[0].name not in DRILLING:
                raise statement(pieces[0])
            self._alone(pieces)
            drilling = cycles.called(self.code, self.start, call, pieces[0])
        self.words.modal.append((self.number, drilling))

    def _alone(self, pieces: list[Piece]) -> None:
        if len(pieces) > 1:
            raise ProgramError(
                f"{pieces[0].name} and other words are in one block; put them into blocks of their own",
                code="OLP518",
            )

    def _limits(self, pieces: list[Piece]) -> None:
        """G25 and G26 limit speeds and the working area; their axis words are no motion."""
        for piece in pieces:
            if piece.name == "G" and self._int(piece) not in (25, 26):
                raise ProgramError("G25 and G26 stand in blocks of their own", code="OLP518")

    def _dwell(self, pieces: list[Piece]) -> None:
        """G4 F is a time in seconds, G4 S turns of the spindle, whose time is not followed."""
        for piece in pieces:
            if piece.name == "F":
                self._word(piece, b"P")
            elif piece.name == "G" and self._int(piece) == 4:
                turns = any(other.name == "S" for other in pieces)
                self._write(piece.start, b"G9" if turns else self.code[piece.start : piece.end])
            elif piece.name != "S":
                self._piece(piece, pieces)

    # -- single pieces -------------------------------------------------------------------------------

    def _piece(self, piece: Piece, pieces: list[Piece]) -> None:
        if piece.form is Form.NAME:
            self._name(piece, pieces)
            return
        if piece.name == "G":
            self._g(piece, pieces)
        elif piece.name == "M":
            self._m(piece)
        elif piece.name == "D":
            self.acts.append(Edge(self._integer(piece)))
        elif piece.name == "T":
            self._tool(piece)
        elif piece.name == "H":
            self._integer(piece)
        elif piece.name in _AXES or piece.name in _CENTRES:
            self._coordinate(piece)
        elif piece.name == "CR":
            self._word(piece, b"R")
        elif piece.name == "TURN":
            self._word(piece, b"P")
        elif piece.name in ("ADIS", "ADISPOS"):
            self.acts.append(Tolerate(piece.name, self._number(piece)))
        else:
            self._other(piece)

    def _other(self, piece: Piece) -> None:
        """Words of other axes, speeds, variables."""
        base = piece.name.partition("[")[0]
        address = _ADDRESS.fullmatch(piece.name)
        if piece.name in _OTHER_AXES and (
            turned := _ROTARY.fullmatch(self.code, piece.value, piece.value_end)
        ):
            self._write(piece.start, piece.name.encode())
            self._write(turned.start(1), turned[1])
            self.words.closings.append(self.start + turned.end(1))
        elif self.words.tips and piece.name in _DIRECTIONS:
            self._word(piece, _DIRECTIONS[piece.name])
        elif piece.form is Form.WORD and piece.name in "NFSABCUVW":
            self._word(piece, piece.name.encode())
        elif address and address[1] in "FSABCUVW" and (not address[2] or address[1] in "UVW"):
            self._word(piece, address[1].encode())
        elif address and address[1] in "SH" and address[2]:
            if address[1] == "S" and address[2] == "1":
                self._word(piece, b"S")
        elif address and address[1] == "M" and address[2] and self._integer(piece) in _SPINDLE_M:
            pass
        elif address and address[1] == "T" and address[2]:
            self._tool(piece)
        elif base in CONTOUR_WAYS:
            self._way(base, read=self._number(piece) == 0.0)
        elif base in HARMLESS or base.startswith(("$AC_", "$A_OUT", "$A_DBB", "$A_DBW")):
            pass
        elif base == "$P_UIFR":
            self.acts.append(written_offset(self.code, piece))
        elif base in REFUSED:
            raise refused(base)
        elif base.startswith("$"):
            raise ProgramError(
                f"{base} is a variable of the control, and what it sets is not read; take it out, or state "
                "what it sets in the machine or job file",
                code="OLP512",
                word=base,
            )
        elif base in UNROLLED or (piece.form is Form.EQUAL and (not address or address[1] == "R")):
            raise unroll(f"`{self.code[piece.start : piece.end].decode('latin-1')}`")
        elif piece.form is Form.WORD and piece.name in "LP":
            raise unroll("a call of a subprogram")
        else:
            raise unknown(self.code[piece.start : piece.end])

    def _name(self, piece: Piece, pieces: list[Piece]) -> None:
        name = piece.name
        if name == "SUPA":
            self._write(piece.start, b"G53")
        elif name == "CYCLE832":
            given = arguments(self.code, piece)
            number = NUMBER.fullmatch(given[0]) if given else None
            if number is not None:
                self.acts.append(Tolerate(name, float(number[0])))
        elif name == "CYCLE800":
            self._tilt(arguments(self.code, piece))
        elif name in TIPS:
            self._tips(name, arguments(self.code, piece) if piece.called else [])
        elif name in REFUSED:
            raise refused(name)
        elif name == "RET":
            raise return_elsewhere(self.code.decode("latin-1"))
        elif name in CONTOUR_WAYS:
            self._way(name)
        elif name in HARMLESS:
            pass
        else:
            raise statement(piece)

    def _tips(self, name: str, given: list[bytes]) -> None:
        """TRAORI with the first transformation of the machine, which the machine file describes, and what
        belongs to it."""
        if name == "TRAORI" and not self.words.tips:
            raise refused(name)
        if name == "TRAORI" and given not in ([], [b""], [b"1"]):
            raise ProgramError(
                "TRAORI names another transformation than the first of the machine; program TRAORI(1)",
                code="OLP512",
                word=name,
            )
        if self.words.tips:
            self.acts.append(tips_action(name))

    def _tilt(self, given: list[bytes]) -> None:
        """CYCLE800 without a tilt ends one. It may retract, and then the axes are not known."""
        if self.words.tips:
            self.acts.append(swivel(given))
            return
        rest = given[4:13]
        if any(text and (not NUMBER.fullmatch(text) or float(text)) for text in rest):
            raise refused("CYCLE800")
        if given and given[0] not in (b"", b"0"):
            self.acts.append(GoHome((0, 1, 2)))

    def _g(self, piece: Piece, pieces: list[Piece]) -> None:
        code = self._integer(piece)
        name = f"G{code}"
        if code in _SAME:
            self._word(piece, b"G")
        elif code in (41, 42):
            self._word(piece, b"G")
            self.side = code
        elif name in CONTOUR_WAYS:
            self._way(name)
        elif code in _RENAMED:
            self._write(piece.start, b"G%d" % _RENAMED[code])
            if code in (71, 700, 710):
                self.words.parts.unit_changes()
        elif code == 70:
            self._write(piece.start, b"G21")
            self.acts.append(SetUnit(INCH))
            self.words.parts.unit_changes()
        elif code == 500 or 505 <= code <= 599:
            self.acts.append(SelectOffset(name))
        elif code in HARMLESS_G:
            pass
        elif name in UNROLLED:
            raise unroll(name)
        elif name in REFUSED:
            raise refused(name)
        else:
            raise ProgramError(
                f"{name} is not known to the sinumerik profile and may move the machine; take it out, or "
                "name the dialect of its language with --dialect",
                code="OLP512",
                word=name,
            )

    def _way(self, name: str, *, read: bool = False) -> None:
        """How contours are made from here on."""
        kind, always = CONTOUR_WAYS[name]
        self.words.ways.pop(kind, None)
        if not (always or read):
            self.words.ways[kind] = name

    def _m(self, piece: Piece) -> None:
        code = self._integer(piece)
        if code == 6:
            self.acts.append(ChangeTool())
        elif code == 17:
            # as many digits, so that the word ends where its own text does
            self._write(piece.start, b"M")
            self._write(piece.value, b"2".rjust(piece.value_end - piece.value, b"0"))
        elif code != 70:
            self._word(piece, b"M")

    def _tool(self, piece: Piece) -> None:
        value = self.code[piece.value : piece.value_end].strip()
        if value.startswith(b'"') and value.endswith(b'"'):
            self.acts.append(NameTool(value[1:-1].decode("latin-1")))
        else:
            self._word(piece, b"T")

    def _coordinate(self, piece: Piece) -> None:
        """X to Z and I to K: a number, or one in AC( ) or IC( )."""
        counted = _COUNTED.fullmatch(self.code, piece.value, piece.value_end)
        value = self.code[piece.value : piece.value_end]
        if value.partition(b"(")[0].strip().upper() in ROTARY_ONLY:
            raise no_number(piece.name, value)
        if piece.form is Form.WORD or counted is None:
            self._word(piece, piece.name.encode())
            return
        self._write(piece.start, piece.name.encode())
        self._write(counted.start(2), counted[2])
        self.words.closings.append(self.start + counted.end(2))
        relative = counted[1].upper() == b"IC"
        if piece.name in _CENTRES:
            if not relative:
                self.words.central.append(self.number)
        elif relative:
            self.relative += piece.name
        else:
            self.absolute += piece.name

    # -- numbers -------------------------------------------------------------------------------------

    def _word(self, piece: Piece, letter: bytes) -> None:
        """A word of one letter with the number of a piece."""
        text: bytes | None = self.code[piece.value : piece.value_end]
        if NUMBER.fullmatch(self.code, piece.value, piece.value_end) is None:
            text = self.words.constants.padded(self.code[piece.value : piece.value_end])
        if text is None:
            raise unroll(f"`{self.code[piece.start : piece.end].decode('latin-1')}`")
        self._write(piece.start, letter)
        self._write(piece.value, text)

    def _write(self, place: int, text: bytes) -> None:
        self.out[place : place + len(text)] = text

    def _literal(self, piece: Piece) -> float | None:
        """The number of a piece; None where it has none. Raises ProgramError for an expression."""
        if piece.value == piece.value_end:
            return None
        text = self.code[piece.value : piece.value_end].replace(b" ", b"").replace(b"\t", b"")
        text = self.words.constants.padded(text) or text
        if NUMBER.fullmatch(text) is None:
            raise unroll(f"`{self.code[piece.start : piece.end].decode('latin-1')}`")
        return float(text)

    def _number(self, piece: Piece) -> float:
        value = self._literal(piece)
        if value is None:
            raise unknown(self.code[piece.start : piece.end])
        return value

    def _integer(self, piece: Piece) -> int:
        value = self._number(piece)
        if value != round(value) or value < 0:
            raise ProgramError(
                f"{piece.name}{value:g} is no code of this control; expected an integer from 0", code="OLP516"
            )
        return round(value)

    def _int(self, piece: Piece) -> int:
        """The number of a word as an integer, -1 where it is none."""
        text = self.code[piece.value : piece.value_end].strip()
        return int(text) if text.isdigit() else -1
