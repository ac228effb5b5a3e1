"""What may be in a line of a control: why a line is refused, word for word."""

from __future__ import annotations

import re
from typing import Any

import pytest

from olp.program.rs274.block_text import BlockText
from olp.program.rs274.profiles.fanuc import DIALECT as FANUC
from olp.program.rs274.profiles.grbl import DIALECT as GRBL
from olp.program.rs274.profiles.haas import DIALECT as HAAS
from olp.program.rs274.profiles.linuxcnc import DIALECT as LINUXCNC

FREE: dict[str, Any] = {"odd_bytes": None}


def inside(what: str, column: int) -> tuple[str, str]:
    return f"{what} is inside this line, at column {column}; expected plain text; remove it", "OLP502"


def unclosed(shown: str) -> tuple[str, str]:
    return f"the comment `{shown}` is not closed; expected `)` in the same line", "OLP514"


def doubly_closed(shown: str) -> tuple[str, str]:
    return (
        f"`{shown}` has a comment inside a comment, and the first `)` ends both; "
        "take the inner brackets out, or write [ and ] there",
        "OLP514",
    )


def nested(shown: str) -> tuple[str, str]:
    return f"the comment `{shown}` has a `(` in it, which the control refuses; remove it", "OLP514"


LONG = (
    "the line has 6 bytes, and the control takes 5 at most; shorten its comment or split it",
    "OLP505",
)
ALONE = ("`%` is not alone in its line; put what is behind it into the next one", "OLP505")

REFUSALS: list[tuple[bytes, dict[str, Any], tuple[str, str] | None]] = [
    (b"X1234", {"longest": 5}, None),
    (b"X12345", {"longest": 5}, LONG),
    (b"X1234\r", {"longest": 5}, LONG),
    (b"X1\rY2", {}, inside("a carriage return", 3)),
    (b"\rY2", {}, inside("a carriage return", 1)),
    (b"X1\r\r", {}, None),
    (b"X1\r\r", {"odd_bytes": re.compile(rb"\r")}, None),
    (b"X1\rY2", FREE, None),
    (b"X1 \xe9", {"odd_bytes": re.compile(rb"\xe9")}, inside("the byte 0xe9", 4)),
    (b"X1\x07", FREE, None),
    (b"X1\x07", {**FREE, "skips_control": False}, inside("the byte 0x07", 3)),
    (b"(a;b) X1\x0bY2", {**FREE, "skips_control": False}, inside("the byte 0x0b", 9)),
    (b"(\x07)X1 ;\x07", {**FREE, "skips_control": False}, None),
    (b"X1\tY1\r", {**FREE, "skips_control": False}, None),
    (b"\x00", {**FREE, "skips_control": False}, inside("the byte 0x00", 1)),
    (b"\x1f", {**FREE, "skips_control": False}, inside("the byte 0x1f", 1)),
    (b"\x0e", {**FREE, "skips_control": False}, inside("the byte 0x0e", 1)),
    (b"%", {"marks_in_pairs": True}, None),
    (b" % \r", {"marks_in_pairs": True}, None),
    (b" % O1", {"marks_in_pairs": True}, ALONE),
    (b"% O1", {}, None),
    (b"X1 %", {"marks_in_pairs": True}, None),
    (b"X1 (a", {}, unclosed("(a")),
    (b"X1 (" + b"a" * 50, {}, unclosed("(" + "a" * 39)),
    (b"(" + b"a" * 36 + b"   b", {}, unclosed("(" + "a" * 36)),
    (b"X1 (a) (b", {}, unclosed("(b")),
    (b"X1 (a", {"open_comments": True}, None),
    (b"X1 ;(a", {}, None),
    (b"X1 ;a)", {}, None),
    (b"X1 (a) Y2", {}, None),
    (b"X1 (a (b c)", {}, None),
    (b"X1 (a (b c)", {"nested_comments": False}, nested("(a (b c)")),
    (b"X1 (a) (b)", {"nested_comments": False}, None),
    (b"X1 (a (" + b"b" * 50 + b")", {"nested_comments": False}, nested("(a (" + "b" * 36)),
    (b" X1 (a (b) c) ", {}, doubly_closed("X1 (a (b) c)")),
    (b"X1 (a (b) c)" + b"d" * 60, {}, doubly_closed("X1 (a (b) c)" + "d" * 48)),
    (b"X1 (a (b) c", {}, None),
    (b"(a) b) X1", {}, None),
    (b"(a (b) c)", {"nested_comments": False}, doubly_closed("(a (b) c)")),
    (b"(a (b))", {}, doubly_closed("(a (b))")),
    (b"X1 (a (b) (c)\t) Y2 (d (e))", {"inner_brackets": True}, None),
    (b"(a (b)", {"inner_brackets": True}, None),
    (b"(a (b) c)", {"inner_brackets": True}, doubly_closed("(a (b) c)")),
    (b"(a (b) X2 (c))", {"inner_brackets": True}, doubly_closed("(a (b) X2 (c))")),
    (b"(at (1.5, 2) to (3, 4) )", {"inner_brackets": True}, None),
    (b'(a (b) 3/8" c (d) e) mm)', {"inner_brackets": True}, doubly_closed('(a (b) 3/8" c (d) e) mm)')),
    (b'(a (b) 3/8" c (d)) X1', {"inner_brackets": True}, None),
    (b"(== a (b) ==)", {"inner_brackets": True}, None),
    (b"(a (b) --- c (d) --- )", {"inner_brackets": True}, None),
    (b"#1 (a (b) =5)", {"inner_brackets": True}, doubly_closed("#1 (a (b) =5)")),
    (b"(a (b) to)", {}, doubly_closed("(a (b) to)")),
    (b"(a (b) GOTO 5)", {"inner_brackets": True}, doubly_closed("(a (b) GOTO 5)")),
    (b"(a (b) VC5=1)", {"inner_brackets": True}, doubly_closed("(a (b) VC5=1)")),
    (b"(a (b) to (c) X5)", {"inner_brackets": True}, doubly_closed("(a (b) to (c) X5)")),
    (b"(a (b)))", {"inner_brackets": True}, doubly_closed("(a (b)))")),
    (b"(a (b)) (c", {"inner_brackets": True}, unclosed("(c")),
]  # fmt: skip


@pytest.mark.parametrize(("line", "rules", "expected"), REFUSALS)
def test_a_line_is_refused_in_these_words(
    line: bytes, rules: dict[str, Any], expected: tuple[str, str] | None
) -> None:
    error = BlockText(**rules).refusal(line)
    assert (None if error is None else (error.message, error.code)) == expected


def test_a_lone_carriage_return_ends_lines_of_some_controls() -> None:
    text = b"a\rb\r\nc\n"
    assert BlockText().line_end.split(text) == [b"a\rb\r", b"c", b""]
    assert BlockText(cr_ends_line=True).line_end.split(text) == [b"a", b"b", b"c", b""]


#: Texts of a line, and the controls that refuse it.
CONTROLS = {
    b"X1\x07": "linuxcnc",
    b"X1\x00": "linuxcnc",
    b"(\x00)": "linuxcnc",
    b"X1\rY2": "linuxcnc fanuc haas",
    b"(a": "linuxcnc fanuc haas",
    b"(a (b)": "linuxcnc",
    b"(a (b) c)": "linuxcnc fanuc haas grbl",
    b"% O1": "linuxcnc",
    b"X1" + b" " * 250: "",
    b"X1" + b" " * 251: "linuxcnc",
}


@pytest.mark.parametrize("line", CONTROLS)
def test_each_control_refuses_its_lines(line: bytes) -> None:
    controls = (LINUXCNC, FANUC, HAAS, GRBL)
    assert [c.name for c in controls if c.text.refusal(line)] == CONTROLS[line].split()
    assert [c.name for c in controls if c.text.cr_ends_line] == ["grbl"]
