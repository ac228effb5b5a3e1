"""What SAVE in the first line of a subprogram puts back at its end: the G codes in force at its call.

Source: Siemens, Programming Manual Job Planning, section on subprograms with SAVE.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from olp.core.errors import ProgramError
from olp.program.sinumerik.blocks import Form, Piece
from olp.program.sinumerik.flatten.unit import Line
from olp.program.sinumerik.frames import STATEMENTS
from olp.program.sinumerik.table import DRILLING, PATTERNS

#: Groups of G codes, one of each in force, and whether a block with the code alone puts it back.
_GROUPS: tuple[tuple[frozenset[int], bool], ...] = (
    (frozenset(range(4)), True),
    (frozenset({17, 18, 19}), True),
    (frozenset({40, 41, 42}), False),
    (frozenset({450, 451}), True),
    (frozenset({460, 461, 462}), True),
    (frozenset({500, *range(54, 58), *range(505, 600)}), True),
    (frozenset({60, 64, *range(641, 646)}), True),
    (frozenset({601, 602, 603}), True),
    (frozenset({70, 71, 700, 710}), True),
    (frozenset({90, 91}), True),
    # behind a change of these a feed has to be stated again
    (frozenset({93, 94, 95, 96, 97, 961, 962, 971, 972, 973}), False),
)
_GROUP: Mapping[int, int] = {code: k for k, (codes, _) in enumerate(_GROUPS) for code in codes}
#: Codes of one block, and the pole, which SAVE leaves alone.
_OF_ONE_BLOCK = frozenset({4, 9, 25, 26, 53, 74, 75, 153, 110, 111, 112})
#: Shapes that are in force as G0 to G3 are.
_SHAPES = frozenset({"CIP", "CT"})
#: Names that are no modes.
_NO_MODES = frozenset({"MSG", "STOPRE", "SUPA", "MCALL", "CYCLE80", *DRILLING, *PATTERNS})


class Saved:
    """The G codes in force, followed through the blocks that are run: by group the one that was stated last,
    -1 where it is not known."""

    def __init__(self) -> None:
        self._codes = dict.fromkeys(range(len(_GROUPS)), -1)
        #: groups that the subprogram with SAVE has stated, None outside of one
        self._stated: set[int] | None = None

    def follow(self, line: Line) -> None:
        """Take note of a block. Raises ProgramError for what SAVE puts back in a way that is not written."""
        assert line.block is not None
        for piece in line.block.pieces:
            if piece.name == "G":
                self._code(line, piece)
            elif piece.form is Form.NAME and piece.name in _SHAPES:
                self._state(0, -1)
            elif self._stated is not None and (piece.name.startswith("$P_") or piece.name in STATEMENTS):
                raise _not_written(f"{piece.name} changes a frame")
            elif self._stated is not None and piece.form is Form.NAME and piece.name not in _NO_MODES:
                raise _not_written(f"{piece.name} is a mode, or may change one,")

    def _code(self, line: Line, piece: Piece) -> None:
        text = line.code[piece.value : piece.value_end].strip()
        code = int(text) if text.isdigit() else -1
        group = _GROUP.get(code)
        if group is not None:
            self._state(group, -1 if line.deleted and self._codes[group] != code else code)
        elif code < 0:
            # an expression: it may be of any group
            for k in range(len(_GROUPS)):
                self._state(k, -1)
        elif self._stated is not None and code not in _OF_ONE_BLOCK:
            raise _not_written(f"G{code} is a mode, or changes a frame,")

    def _state(self, group: int, code: int) -> None:
        self._codes[group] = code
        if self._stated is not None:
            self._stated.add(group)

    @contextmanager
    def kept(self) -> Iterator[list[bytes]]:
        """Around a subprogram with SAVE; behind it the list has the codes to put back. Raises ProgramError
        where one is not known, or a block of its own does not put it back."""
        before, outside = dict(self._codes), self._stated
        self._stated = set()
        again: list[bytes] = []
        yield again
        for group in sorted(self._stated):
            code = before[group]
            if code == self._codes[group] != -1:
                continue
            codes, plain = _GROUPS[group]
            if code < 0:
                names = ", ".join(f"G{c}" for c in sorted(codes)[:5])
                raise ProgramError(
                    f"the end of a subprogram with SAVE puts back which of {names} was in force at the "
                    "call, and the program has not stated it; program it before the call",
                    code="OLP544",
                )
            if not plain:
                raise _not_written(f"another code takes the place of G{code}")
            again.append(b"G%d" % code)
        self._codes, self._stated = before, outside


def _not_written(what: str) -> ProgramError:
    return ProgramError(
        f"{what} in a subprogram with SAVE, and how its end puts that back is not written out; put it back "
        "in the subprogram, and take SAVE out",
        code="OLP544",
    )
