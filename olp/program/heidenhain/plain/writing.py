"""Writes motion that the control makes from several statements out as plain blocks: polar positions,
tangential arcs, roundings, chamfers, approaches, mirrored and rotated positions, patterns of holes.

It works on a text without loops and parameters. Statements that need nothing of this keep their bytes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.program.heidenhain.cycles import AT_ONCE
from olp.program.heidenhain.names import refuse_also_unrolled
from olp.program.heidenhain.plain.approach import approached, departed
from olp.program.heidenhain.plain.blocks import Block, block_of, line_end
from olp.program.heidenhain.plain.frame import MIRROR, ROTATION, SHIFT, WRITTEN_OUT
from olp.program.heidenhain.plain.holes import Holes
from olp.program.heidenhain.plain.moves import NAN, Entry, Source, Text, flipped, unknown
from olp.program.heidenhain.plain.path import Piece, chamfered, rounded
from olp.program.heidenhain.plain.scaling import SCALING, SCALINGS
from olp.program.heidenhain.plain.sides import beside
from olp.program.heidenhain.plain.tools import Radius
from olp.program.heidenhain.statements import Statement, cycle_of, of_lines, without_comment

_TRANSFORMS = frozenset({SHIFT, MIRROR, ROTATION, SCALING, SCALINGS})
_SELECT = 247
#: M functions after which positions are not those of the words, or not known
_AWAY = frozenset({91, 92, 140})
_TILTED = frozenset({104, 112, 114, 128, 130})
#: what is written out
_WRITTEN_OUT = re.compile(
    rb"(?<![A-Z])(?:LP|R[LR](?![.\d])|CTP?|RND|CHF|APPR|DEP|PATTERN|M89|I[XYZ]|"
    rb"TRANS[ \t]+[MRS]|CYCLE?[ \t]+DEF[ \t]*(?:8|1[01]|26|22[01])(?!\d)|CYCL[ \t]+CALL[ \t]+P)", re.I,
)  # fmt: skip
_SIDE = re.compile(rb"(?<![A-Z])(R0|RL|RR)(?![.\d])")


def written_out(
    lines: Sequence[bytes], sources: Sequence[Source], setup: Setup | None
) -> tuple[list[bytes], list[Source]]:
    """The lines of a text without loops and parameters as plain blocks, with the sources of each. `setup` has
    the tools. Raises ProgramError whose line is an index of `lines`, from 1."""
    if not any(_WRITTEN_OUT.search(without_comment(line)) for line in lines):
        return list(lines), list(sources)
    return _Writing(lines, sources, setup).run()


class _Writing(Holes):
    """One text while it is written out."""

    def __init__(self, lines: Sequence[bytes], sources: Sequence[Source], setup: Setup | None) -> None:
        super().__init__(None if setup is None else setup.machine.scaling_axes)
        self.radius = Radius(setup)
        self.given, self.sources = lines, sources
        #: the side of the contour on which the tool is: R0, RL or RR
        self.side = b"R0"
        #: a rounding or a chamfer that waits for the move behind it, and the move before it
        self.corner: tuple[Block, Entry, Source] | None = None
        #: an approach that waits for the first move of its contour
        self.approach: tuple[Entry, int] | None = None
        #: the last move, where it goes across the plane
        self.last: Entry | None = None

    def run(self) -> tuple[list[bytes], list[Source]]:
        begin = 0
        while begin < len(self.given):
            end = begin + 1
            while self.given[end - 1].rstrip().endswith(b"~") and end < len(self.given):
                end += 1
            self._statement(list(self.given[begin:end]), list(self.sources[begin:end]), begin + 1)
            begin = end
        self._nothing_waits(len(self.given))
        text = Text()
        for entry in beside(self.entries):
            text.put(entry)
        return text.lines, text.sources

    def _statement(self, lines: list[bytes], source: list[Source], line: int) -> None:
        statement = of_lines(lines, line)
        entry = Entry(lines, source)
        cycle = cycle_of(statement)
        if not statement.text or statement.text.startswith(b"*"):
            self.entries.append(entry)
        elif statement.deleted:
            self._nothing_waits(line)
            self._skipped(statement, entry)
        elif cycle is not None:
            self._nothing_waits(line)
            if cycle.number in _TRANSFORMS:
                if cycle.part:
                    self.frame.take(cycle, statement)
                    if cycle.number in WRITTEN_OUT:
                        self.pole = self.upright = None
                if cycle.number in WRITTEN_OUT:
                    return
            self.define(cycle, statement, entry)
            if cycle.number == _SELECT:
                self.frame.shift, self.at = [0.0, 0.0, 0.0], [NAN, NAN, NAN]
            elif cycle.number not in AT_ONCE:
                self.modal_call = False
        elif (block := block_of(lines[0], line) if len(lines) == 1 else None) is not None:
            self._motion(block, entry)
        else:
            if self.corner is not None or self.approach is not None:
                refuse_also_unrolled(statement)
            self._nothing_waits(line)
            self._other(statement, entry)

    def _skipped(self, statement: Statement, entry: Entry) -> None:
        """A block under block delete: it may move, or not."""
        if self.frame.turned or self.frame.lifts:
            raise ProgramError(
                f"{statement.shown} is under block delete in a rotated, mirrored or scaled program; remove "
                "the `/`",
                line=statement.line,
                code="OLP525",
            )
        self.at, self.last = [NAN, NAN, NAN], None
        self.entries.append(entry)

    def _other(self, statement: Statement, entry: Entry) -> None:
        upper = statement.upper
        if upper.startswith(b"BEGIN PGM"):
            self.radius.begin(statement)
        elif upper.startswith(b"TOOL CALL"):
            moved = self.radius.call(statement)
            # another length, and Z of the program is another one
            self.at, self.last = [NAN, NAN, NAN] if moved else [*self.at[:2], NAN], None
        elif self.pattern_or_call(upper, entry, statement.line):
            self.last = None
            return
        self.entries.append(entry)

    def _nothing_waits(self, line: int) -> None:
        """Refuse where a rounding or an approach still waits for the next move."""
        if self.corner is not None or self.approach is not None:
            name = "APPR" if self.corner is None else self.corner[0].name.decode()
            raise ProgramError(
                f"{name} needs a move of the contour directly behind it; program one",
                line=line,
                code="OLP516",
            )

    # -- motion --------------------------------------------------------------------------------------

    def _motion(self, block: Block, entry: Entry) -> None:
        entry.block, entry.rest = block, block.rest
        entry.shift = (self.frame.shift[0], self.frame.shift[1], self.frame.shift[2])
        name, functions = block.name, block.functions
        if any(m in _TILTED for m in functions):
            self.entries.append(entry)
            return
        if name in (b"RND", b"CHF"):
            self._nothing_waits(block.line)
            if self.last is None:
                raise ProgramError(
                    f"{name.decode()} needs a move in the plane of X and Y directly before it; program one",
                    line=block.line,
                    code="OLP516",
                )
            self.corner = (block, self.last, entry.source[0])
            return
        if name == b"CC":
            self._put_pole(block, entry)
            return
        if any(m in _AWAY for m in functions):
            self._nothing_waits(block.line)
            self._away(block, entry)
            return
        if name.startswith(b"APPR"):
            self._nothing_waits(block.line)
            self._begin_approach(block, entry)
            return
        if name.startswith(b"DEP"):
            self._nothing_waits(block.line)
            self._depart(block, entry)
            return
        self._move(block, entry)

    def _away(self, block: Block, entry: Entry) -> None:
        for axis, letter in enumerate((b"X", b"Y", b"Z")):
            if letter in block.words or (axis == 2 and 140 in block.functions):
                self.at[axis] = NAN
        self.last = None
        self.entries.append(entry)

    def _put_pole(self, block: Block, entry: Entry) -> None:
        if b"Z" in block.words:
            self.pole = None
            self.put_upright_pole(block)
            if not (self.frame.turned or self.frame.lifts):
                self.entries.append(entry)
            return
        self.upright = None
        point, _ = self.end(block)
        if math.isnan(point[0]) or math.isnan(point[1]):
            raise unknown("this CC", block.line)
        self.pole = entry.pole = point
        steps = any(step for step, _ in block.words.values())
        entry.changed = self.frame.turned or steps or len(block.words) < 2
        self.entries.append(entry)

    def _move(self, block: Block, entry: Entry) -> None:
        """L, C, CR, CT, and the polar ones."""
        name = block.name
        if name == b"LP" and self.upright is not None:
            self._upright_line(block, entry)
            return
        arc = name != b"L" and name != b"LP"
        across = block.stated(b"XY") or arc or name == b"LP"
        if arc and name in (b"C", b"CP") and self.pole is None and not self.frame.turned:
            self._other_plane(block, entry)
            return
        if arc and self.upright is not None:
            raise ProgramError(
                "an arc in another plane than XY is not read in a rotated, mirrored or scaled program; write "
                "it as straight moves",
                line=block.line,
                code="OLP512",
            )
        start, z0 = (self.at[0], self.at[1]), self.at[2]
        if name in (b"CT", b"CTP"):
            end, z = self.end(block) if name == b"CT" else self.polar_end(block)
            piece = self.tangent(block, None if self.last is None else self.last.piece, end)
        elif arc:
            piece, z = self.arc(block)
        else:
            end, z = self.end(block) if name == b"L" else self.polar_end(block)
            piece = Piece(start, end)
        self._check_known(block, piece, z)
        entry.piece, entry.z = piece if across else None, (z0, z)
        entry.axes = (b"XY" if across else b"") + (b"Z" if b"Z" in block.words else b"")
        steps = [step for letter, (step, _) in block.words.items() if letter in b"XYZ"]
        mixed = any(steps) and not all(steps)
        entry.changed = mixed or name in (b"LP", b"CT", b"CTP") or (self.frame.turned and across)
        entry.changed |= self.frame.lifts and b"Z" in block.words
        if not self.frame.turned and name == b"L":
            entry.axes = bytes(a for a in b"XYZ" if bytes([a]) in block.words)
        if self.frame.flips and flipped(entry.rest) != entry.rest:
            entry.rest, entry.changed = flipped(entry.rest), True
        self._side_of(block, entry)
        self._settle(entry, across)
        self.entries.append(entry)
        self.at = [piece.end[0], piece.end[1], z]
        if across:
            self.last = entry if math.isfinite(sum((*piece.start, *piece.end))) else None
        elif b"Z" in block.words:
            self.last = None
        self.call_behind(block, entry)

    def _check_known(self, block: Block, piece: Piece, z: float) -> None:
        """Refuse words that need a position which is not known."""
        steps = {letter for letter, (step, _) in block.words.items() if step}
        mixed = bool(steps) and len(steps) < len([w for w in block.words if w in b"XYZ"])
        needed = (self.frame.turned and block.stated(b"XY")) or block.name != b"L" or mixed
        stated = [k for k, letter in enumerate((b"X", b"Y", b"Z")) if letter in block.words]
        unsure = [k for k in stated if math.isnan((*piece.end, z)[k])]
        if needed and (unsure or (self.frame.turned and math.isnan(sum(piece.end)))):
            raise unknown("this block", block.line)

    def _upright_line(self, block: Block, entry: Entry) -> None:
        """LP about a pole of a plane with Z."""
        if self.side != b"R0":
            raise ProgramError(
                "a polar position in another plane than XY is not read in a contour with RL or RR",
                line=block.line,
                code="OLP518",
            )
        end, axes = self.upright_end(block)
        entry.piece, entry.z = Piece((self.at[0], self.at[1]), (end[0], end[1])), (self.at[2], end[2])
        entry.axes, entry.changed = axes, True
        self._side_of(block, entry)
        self._nothing_waits(block.line)
        self.entries.append(entry)
        self.at, self.last = end, None
        self.call_behind(block, entry)

    def _other_plane(self, block: Block, entry: Entry) -> None:
        self._nothing_waits(block.line)
        if self.side != b"R0" or self.frame.lifts:
            raise ProgramError(
                "a contour with RL or RR, or with Z scaled, is in another plane than XY, which is not read; "
                "write the path of the tool",
                line=block.line,
                code="OLP518",
            )
        _, z = self.end(block)
        here = self.end(block)[0]
        known = block.name == b"C"
        self.at = [here[0], here[1], z] if known else [NAN, NAN, NAN]
        self.last = None
        self.entries.append(entry)
        self.call_behind(block, entry)

    def _side_of(self, block: Block, entry: Entry) -> None:
        """Follow R0, RL and RR."""
        match = _SIDE.search(entry.rest)
        if match is not None:
            self.side = match[1]
        self._keep_side(entry, block.line)

    def _keep_side(self, entry: Entry, line: int) -> None:
        if self.side != b"R0":
            entry.side, entry.radius = 1 if self.side == b"RL" else -1, self.radius.of(line)

    # -- corners and approaches ----------------------------------------------------------------------

    def _settle(self, entry: Entry, across: bool) -> None:
        """Put a rounding or an approach before a move, now that it is known."""
        if self.corner is None and self.approach is None:
            return
        piece = entry.piece
        if not across or piece is None or entry.block is None or math.isnan(sum((*piece.start, *piece.end))):
            self._nothing_waits(entry.block.line if entry.block else 1)
            return
        if self.approach is not None:
            helper, side = self.approach
            self.approach = None
            self._put_approach(helper, side, piece)
            return
        assert self.corner is not None
        (block, before, source), self.corner = self.corner, None
        assert before.piece is not None
        if any(b"Z" in each.axes and each.z[0] != each.z[1] for each in (before, entry)):
            raise ProgramError(
                f"{block.name.decode()} is beside a move along Z, which is not read; program the corner",
                line=block.line,
                code="OLP512",
            )
        size, make = (
            block.sizes[b"R"] * self.frame.scaling.size,
            rounded if block.name == b"RND" else chamfered,
        )
        full = abs(before.piece.sweep) > 6.28 or abs(piece.sweep) > 6.28
        made = None if full or not size > 0 else make(before.piece, piece, size)
        if made is None:
            raise ProgramError(
                f"{block.name.decode()} {size:g} does not fit between the moves beside it; use a smaller one",
                line=block.line,
                code="OLP530",
            )
        self._put_corner(block, before, entry, made, source)

    def _put_corner(
        self,
        block: Block,
        before: Entry,
        entry: Entry,
        made: tuple[Piece, Piece | None, Piece],
        source: Source,
    ) -> None:
        first, corner, second = made
        if corner is None:
            return
        before.piece, before.changed, before.axes = first, True, before.axes + b"XY"
        entry.piece, entry.changed, entry.axes = second, True, entry.axes + b"XY"
        new = Entry(
            [], [source], block, corner, axes=b"XY", changed=True, rest=block.rest, shift=before.shift
        )
        new.side, new.radius = entry.side, entry.radius
        self.entries.insert(self.entries.index(before) + 1, new)
        assert entry.block is not None
        if block.feed and not entry.block.feed and self.feed:
            entry.rest = (entry.rest + b" " + self.feed).strip()

    def _turn_of(self) -> int:
        """1 where APPR and DEP are on the left of the contour, -1 on the right."""
        if self.side != b"R0":
            return 1 if self.side == b"RL" else -1
        return 1 if self.frame.flips else -1

    def _check_unscaled(self, block: Block) -> None:
        if not self.frame.scaling.off:
            raise ProgramError(
                f"{block.name.decode()} is in a scaled program, and whether that scales its radius is not "
                "known here; write its moves",
                line=block.line,
                code="OLP512",
            )

    def _begin_approach(self, block: Block, entry: Entry) -> None:
        self._check_unscaled(block)
        if self.frame.flips:
            entry.rest = flipped(entry.rest)
        self._side_of(block, entry)
        polar = block.name.split()[1].startswith(b"P")
        end, z = self.polar_end(block) if polar else self.end(block)
        start = (self.at[0], self.at[1])
        if math.isnan(sum((*start, *end))):
            raise unknown("APPR", block.line)
        entry.piece, entry.z = Piece(start, end), (self.at[2], z)
        entry.axes = b"XY" + (b"Z" if b"Z" in block.words else b"")
        self.approach = (entry, self._turn_of())
        self.entries.append(entry)
        self.at, self.last = [end[0], end[1], z], None

    def _put_approach(self, helper: Entry, side: int, first: Piece) -> None:
        block, piece = helper.block, helper.piece
        assert block is not None
        assert piece is not None
        heading = first.heading(last=False)
        if heading is None:
            raise ProgramError("APPR needs a move of the contour behind it", line=block.line, code="OLP516")
        form = block.name.split()[1].removeprefix(b"P")
        # R and LEN are those of the tool's centre, and lead to beside the contour
        begin = first.across(helper.side * helper.radius, last=False)
        to, onto = approached(form, block.sizes, side, piece.start, begin, heading, block.line)
        side_word = b"R0" if _SIDE.search(helper.rest) else b""
        # LCT goes to its arc with the feed of its own block, the others with the feed before
        early = block.feed if form == b"LCT" else b""
        words = b" ".join(w for w in (side_word, early) if w)
        helper.before = [self._part(helper, to, b"XY", words)]
        if b"Z" in helper.axes:
            helper.before.append(self._part(helper, None, b"Z", b""))
        helper.piece, helper.axes, helper.changed = onto, b"XY", True
        helper.rest, helper.centre = _SIDE.sub(b"", helper.rest).strip(), True

    def _part(self, entry: Entry, piece: Piece | None, axes: bytes, rest: bytes) -> Entry:
        assert entry.block is not None
        block = entry.block
        bare = Block(b"L", {}, 0, {}, b"", block.head, line_end(block.tail) or b"\n", block.line)
        return Entry([], entry.source[:1], bare, piece, entry.z, axes, True, rest, entry.shift, centre=True)

    def _depart(self, block: Block, entry: Entry) -> None:
        self._check_unscaled(block)
        before = None if self.last is None else self.last.piece
        heading = None if before is None else before.heading(last=True)
        form = block.name.split()[1].removeprefix(b"P")
        if heading is None or before is None:
            raise ProgramError("DEP needs a move of the contour before it", line=block.line, code="OLP516")
        polar = block.name.split()[1].startswith(b"P")
        end, z = self.polar_end(block) if polar else self.end(block)
        side = self._turn_of()
        self._keep_side(entry, block.line)
        begin = before.across(entry.side * entry.radius, last=True)
        pieces = departed(form, block.sizes, side, begin, heading, end, block.line)
        entry.z, entry.changed = (self.at[2], z), True
        entry.rest = _SIDE.sub(b"", block.rest).strip()
        parts = [self._part(entry, piece, b"XY", b"") for piece in pieces]
        if b"Z" in block.words:
            parts.append(self._part(entry, None, b"Z", b""))
        parts[0].rest, parts[-1].block = entry.rest, block
        # a block of its own name would count as an arc about the pole of the program
        self.entries += parts
        self.at = [*pieces[-1].end, z]
        self.last = None
        self.side = b"R0"
