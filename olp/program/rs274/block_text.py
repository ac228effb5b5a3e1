"""How a control takes the bytes of a block: line ends, comments, bytes that are no text, and the length."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.text.line_ends import LINE_END, STRAY_CR

#: Bytes of an unclosed comment that are shown.
_SHOWN = 40
#: Bytes of a line that are shown.
_SHOWN_OF_LINE = 60
#: Bytes that are good on every control.
PLAIN = b"\t\n" + bytes(range(0x20, 0x7F))
#: Control characters but tab and those of line ends.
CONTROL = pattern(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_COMMENTS = pattern(rb"\([^)]*\)?|;.*", re.DOTALL)
#: Text that no control takes for a block: a number without a letter, signs in a row, or a word of letters
#: alone.
_NO_BLOCK = (
    rb"(?:[\d\"]|={2,}|-{3,}|(?!(?i:IF|WHILE|WH|DO|END|THEN|ELSE|GOTO|CALL|RTS|MODIN|MODOUT|NOEX|POPEN|PCLOS)\b)"
    rb"[A-Za-z]{2,}(?![\w=\[#]))[^()\r\n]*"
)
#: A comment with brackets in it, as in `(a (b))` or `(a (b) to (c))`. Where the first `)` ends it, nothing is
#: outside of it but what makes the control refuse the block; so a control that runs it ends it at the last.
CLOSED_TOGETHER = rb"\([^()\r\n]*(?:\([^()\r\n]*\)[ \t]*(?:" + _NO_BLOCK + rb")?)+\)"
_WHOLE = pattern(CLOSED_TOGETHER + b"|" + _COMMENTS.pattern, re.DOTALL)
#: Statements of Macro B that write to a file or a line of the control, with `/` and N.
PRINTS = (
    rb"[ \t]*(?:/\d?[ \t]*)?(?:[Nn][ \t]*(?P<n>\d+)[ \t]*)?"
    rb"(?i:POPEN|PCLOS|[BD]PRNT[ \t]*\[[^\r\n]*\])[ \t]*(?:;[^\r\n]*)?"
)
_NEWLINE = pattern(rb"\n")


def counting(numbers: bytes) -> bytes:
    """Statements of Macro B that only give one of these common variables a value, as counters of parts do."""
    return (
        rb"[ \t]*(?:[Nn][ \t]*\d+[ \t]*)?#[ \t]*" + numbers + rb"[ \t]*="
        rb"(?i:[-+*/\[\]#\d. \t]|MOD|AND|XOR|OR|ABS|A?SIN|A?COS|A?TAN|SQRT|FIX|FUP|ROUND|EXP|LN|BIN|BCD)+"
        rb"(?:\([^)\r\n]*\)[ \t]*)?(?:;[^\r\n]*)?"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockText:
    """What may be in a line of a control.

    - `odd_bytes`: bytes that are refused, since the control or an editor takes them for something else.
    - `skips_control`: control characters mean nothing, as blanks; else they are refused outside comments.
    - `cr_ends_line`: a lone carriage return ends a line.
    - `open_comments`: a comment that is not closed ends with its line. `nested_comments`: `(` may be in one.
      `inner_brackets`: brackets may be in one and close before it, as in `(a (b))` (`CLOSED_TOGETHER`).
    - `brackets`: `(` opens a comment; else a line with one is refused.
    - `marks_in_pairs`: `%` is the first line and the last one, alone in its line, or not there.
    - `unread`: words that mean nothing for the path and have no letter, such as the number of a spindle; its
      group, where it has one. Each has the byte `unread_mark`.
    - `longest`: bytes of a line at most, without its line feed (None: no limit).
    - `outside`: by name, how lines begin that are no blocks, and why a program cannot have them.
    """

    odd_bytes: re.Pattern[bytes] | None = STRAY_CR
    skips_control: bool = True
    cr_ends_line: bool = False
    open_comments: bool = False
    nested_comments: bool = True
    inner_brackets: bool = False
    brackets: bool = True
    marks_in_pairs: bool = False
    unread: re.Pattern[bytes] | None = None
    unread_mark: int = 0
    longest: int | None = None
    outside: Mapping[str, tuple[re.Pattern[bytes], str]] = field(default_factory=dict)

    @property
    def line_end(self) -> re.Pattern[bytes]:
        """What separates lines."""
        return LINE_END if self.cr_ends_line else _NEWLINE

    def refusal(self, line: bytes) -> ProgramError | None:
        """Why a line, up to its line feed, is refused; None where its bytes are good."""
        if self.longest is not None and len(line) > self.longest:
            return ProgramError(
                f"the line has {len(line)} bytes, and the control takes {self.longest} at most; "
                "shorten its comment or split it",
                code="OLP505",
            )
        line = line.rstrip(b"\r")
        for begin, why in self.outside.values():
            if begin.match(line):
                shown = line.strip()[:_SHOWN_OF_LINE].decode("latin-1")
                return ProgramError(f"`{shown}` {why}", code="OLP512")
        odd = None if self.odd_bytes is None else self.odd_bytes.search(line)
        if odd is None and not self.skips_control:
            odd = CONTROL.search(_COMMENTS.sub(lambda comment: b" " * len(comment[0]), line))
        if odd is not None:
            what = "a carriage return" if odd[0] == b"\r" else f"the byte 0x{odd[0][0]:02x}"
            return ProgramError(
                f"{what} is inside this line, at column {odd.start() + 1}; expected plain text; remove it",
                code="OLP502",
            )
        if self.marks_in_pairs and line.strip().startswith(b"%") and line.strip() != b"%":
            return ProgramError(
                "`%` is not alone in its line; put what is behind it into the next one", code="OLP505"
            )
        return self._comments(line)

    def _comments(self, line: bytes) -> ProgramError | None:
        """Why the comments of a line are refused."""
        # the first `)` ends a comment, so a further one is outside of it
        comments = _WHOLE if self.inner_brackets else _COMMENTS
        behind = b")" in comments.sub(b"", line)
        for comment in comments.finditer(line):
            text = comment[0]
            shown = text[:_SHOWN].decode("latin-1").strip()
            if not text.startswith(b"("):
                continue
            why = None
            if not self.open_comments and not text.endswith(b")"):
                why = f"the comment `{shown}` is not closed; expected `)` in the same line"
            elif b"(" in text[1:] and behind:
                whole = line.strip()[:_SHOWN_OF_LINE].decode("latin-1")
                why = (
                    f"`{whole}` has a comment inside a comment, and the first `)` ends both; "
                    "take the inner brackets out, or write [ and ] there"
                )
            elif b"(" in text[1:] and not self.nested_comments:
                why = f"the comment `{shown}` has a `(` in it, which the control refuses; remove it"
            if why is not None:
                return ProgramError(why, code="OLP514")
        return None
