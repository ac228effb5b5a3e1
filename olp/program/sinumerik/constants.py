"""Variables of a Sinumerik text that stand for numbers: `_Z_HOME=-10`, and `Z=_Z_HOME` behind it.

A text is read from the top, as flow control is refused where nothing is unrolled. So the last number that was
assigned counts. Names that DEF defines, R-parameters and names that begin with an underscore are variables;
another one may be an axis of the machine.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from olp.core.errors import ProgramError
from olp.program.sinumerik.blocks import NUMBER, Form, Piece

_OWN = re.compile(r"_[A-Z0-9_]*|R\d+")
#: Digits of a number that the reader of words takes.
_MOST_DIGITS = 18


class Constants:
    """The numbers of variables, as they are written, by name in capitals."""

    def __init__(self) -> None:
        self._texts: dict[str, bytes] = {}
        self._defined: set[str] = set()
        #: those that hold whole numbers, and those that hold none, whatever their names are
        self._whole: set[str] = set()
        self._other: set[str] = set()

    def declare(self, kind: bytes, variables: bytes) -> None:
        """Take over a DEF: what has no number is 0. What INT rounds, and BOOL and text, is not taken over."""
        for variable in variables.decode("latin-1").upper().split(","):
            text, _, value = variable.partition("=")
            name, number = text.strip(), value.strip().encode() or b"0"
            if kind.upper() not in (b"INT", b"REAL"):
                self._other.add(name)
                continue
            self._defined.add(name)
            if kind.upper() == b"INT":
                self._whole.add(name)
            if self._takes(name, number):
                self._texts[name] = number

    def _takes(self, name: str, number: bytes) -> bool:
        """Whether a variable keeps a number as it is written."""
        own = name in self._defined or (name not in self._other and bool(_OWN.fullmatch(name)))
        return own and not (name in self._whole and b"." in number)

    def assigned(self, code: bytes, pieces: Sequence[Piece], *, deleted: bool) -> bool:
        """Whether a block only assigns numbers to variables, which are taken over. Raises ProgramError,
        without a line, where a switch decides of it."""
        texts = {}
        for piece in pieces:
            value = code[piece.value : piece.value_end].strip()
            plain = piece.form is Form.EQUAL and NUMBER.fullmatch(value)
            if not plain or not self._takes(piece.name, value):
                return False
            texts[piece.name] = value
        if texts and deleted:
            raise ProgramError(
                "a block under block delete assigns to variables, so later blocks depend on the switch; "
                "remove the `/`",
                code="OLP525",
            )
        self._texts |= texts
        return bool(texts)

    def padded(self, name: bytes) -> bytes | None:
        """The number of a variable in as many bytes as its name has, with zeros before it. So it can be read
        and replaced where the name is. None where there is none, or no room."""
        text = self._texts.get(name.decode("latin-1").upper(), b"").replace(b" ", b"").removeprefix(b"+")
        digits, sign = text.removeprefix(b"-"), text[:1] if text.startswith(b"-") else b""
        missing = len(name) - len(text)
        if not text or missing < 0 or len(digits) + missing > _MOST_DIGITS:
            return None
        return sign + b"0" * missing + digits
