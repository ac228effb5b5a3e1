"""Comments that instruct: sections without a correction, payloads, and payloads by line of the job."""

from __future__ import annotations

import pytest

from olp.core.errors import ProgramError
from olp.core.machine import Axis, Machine, Setup, WorkOffset
from olp.core.toolpath import Flag, Toolpath
from olp.program.directives import with_payloads
from olp.program.registry import named, read

AXES = {axis: Axis((-1000.0, 1000.0), 0.001, 100.0, 1000.0, 1e5) for axis in "XYZ"}
SETUP = Setup(Machine("m", "FXYZ", "linuxcnc", AXES, work_offsets={"G54": WorkOffset("G54", set_by="true")}))
HEAD = "G21 G90 G54 G17 F100\n"


def path(text: str) -> Toolpath:
    return read((HEAD + text).encode(), SETUP, named("linuxcnc")).toolpath


def payloads(text: str) -> list[float]:
    """kg of each move."""
    moves = path(text)
    return [moves.frames[frame].payload_kg for frame in moves.frame.tolist()]


def exempt(text: str) -> str:
    """A `-` for each move that is left uncorrected, else `x`."""
    return "".join("-" if int(flag) & Flag.PASS else "x" for flag in path(text).flag.tolist())


@pytest.mark.parametrize(
    ("text", "moves"),
    [
        ("G1 X1\n(olp off)\nX2\nX3\n(olp on)\nX4\n", "x--x"),
        # the switch holds on its own line
        ("G1 X1\nX2 (olp off)\nX3 ; olp on\nX4 (OLP\tOFF: why)\n", "x-x-"),
        # of two in one line the last one holds from there on
        ("G1 X1 (olp off)(olp on)\nX2\n", "xx"),
        ("G1 X1 (olp on)(olp off)\nX2\n", "--"),
        ("(olp off)\n(olp off)\nG1 X1\n(olp on)\nX2\n", "-x"),
        ("(olp on)\nG1 X1\n", "x"),
        # other comments
        ("(olp offset)\nG1 X1\n(olpoff)\nX2\n(x olp off)\nX3\n(off)\nX4\n(olp)\nX5\n()\nX6\n(o)\n", "xxxxxx"),
        ("G1 X1\n(\tolp off)\nX2\n(olp off 3)\nX3\n", "x--"),
    ],
)
def test_sections_that_are_left_uncorrected(text: str, moves: str) -> None:
    assert exempt(text) == moves


@pytest.mark.parametrize(
    ("comment", "kg"),
    [
        ("(olp payload 30 kg)", 30.0), ("(OLP PAYLOAD 30)", 30.0), ("( olp\tpayload 2.5kg )", 2.5),
        ("; olp payload .5 kg", 0.5),
        ("(olp payload 7.)", 7.0), ("; olp payload 3 )", None), ("(olp payload 30 kg, line 4)", 30.0),
        ("(olp payload 30 kg , line 4)", 30.0), ("(olp payload 30,line 4)", 30.0),
        # about something else
        ("(olp weight 30)", 0.0), ("(olp pay 30)", 0.0), ("(olp )", 0.0), ("(olp pay load 3)", 0.0),
    ],
)  # fmt: skip
def test_a_payload_holds_from_its_line_on(comment: str, kg: float | None) -> None:
    text = f"G1 X1\nX2 {comment}\nX3\n"
    if kg is None:
        with pytest.raises(ProgramError, match="is not understood"):
            payloads(text)
    else:
        assert payloads(text) == [0.0, kg, kg]


def test_payloads_follow_one_another() -> None:
    text = "(olp payload 3)\nG1 X1\n(olp off)\nX2\nX3 (olp payload 0)\nX4 ; olp payload 1.5 kg\n"
    assert payloads(text) == [3.0, 3.0, 0.0, 1.5]
    assert payloads("(olp weight 3)\nG1 X1 (olp off)\nX2 (olp payload 3)\n") == [0.0, 3.0]


@pytest.mark.parametrize(
    ("block", "code", "message"),
    [
        *((f"({comment})", "OLP550",
          f"the comment `{comment}` is not understood; expected a mass in kg, such as "
           "(OLP PAYLOAD 30 kg)")
          for comment in ("olp payload", "olp paylod 30", "olp payload: 30", "olp payload 30 lb",
           "olp Payload=30", "olp payloads 3",
                          "olp payload 3 kg x", "olp playload 3", "olp payload, 3", "olp payload 1e3",
                          "olp plod 3",
                          "olp payload_of_the_tool 3", "olp load: 30", "olp load= 30", "olp load, 30")),
        ("(olp payload 30 kg, line x)", "OLP550",
         "the comment `olp payload 30 kg, line x` is not understood; expected a mass in "
         "kg, such as (OLP PAYLOAD 30 kg)"),
        (f"(olp payload {'x' * 60})", "OLP550",
         f"the comment `olp payload {'x' * 32}` is not understood; expected a mass in kg, "
         "such as (OLP PAYLOAD 30 kg)"),
        (f"(olp payload {'9' * 310})", "OLP550",
         f"the comment `olp payload {'9' * 32}` is not understood; expected a mass in kg, "
         "such as (OLP PAYLOAD 30 kg)"),
        ("(olp payload 3)(olp payload 3)", "OLP550", "this line has two payloads; expected one"),
        ("/X2 (olp payload 3)", "OLP525",
         "a payload is under block delete, so it is not known whether it holds afterwards; "
         "move it to a block without `/`"),
    ],
)  # fmt: skip
def test_payloads_that_are_refused(block: str, code: str, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        path(f"G1 X1\n{block}\nX3\n")
    assert (caught.value.code, caught.value.line, caught.value.message) == (code, 3, message)


# --- payloads by line of the job file -----------------------------------------------------------------------

ROUND, SEMICOLON = (b"(", b")"), (b"; ", b"")


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        (b"G1 X1\nX2\n", 1, b"G1 X1 (OLP PAYLOAD 2.5 kg, line 1)\nX2\n"),
        (b"G1 X1\nX2", 2, b"G1 X1\nX2 (OLP PAYLOAD 2.5 kg, line 2)"),
        (b"G1 X1\n\nX2", 2, b"G1 X1\n(OLP PAYLOAD 2.5 kg, line 2)\nX2"),
        (b"G1 X1\n  \nX2", 2, b"G1 X1\n  (OLP PAYLOAD 2.5 kg, line 2)\nX2"),
        (b"X1 ; a\nX2", 1, b"X1  (OLP PAYLOAD 2.5 kg, line 1); a\nX2"),
        (b"; a\nX2", 1, b"(OLP PAYLOAD 2.5 kg, line 1); a\nX2"),
        (b"X1 (a;b);c\nX2", 1, b"X1 (a;b) (OLP PAYLOAD 2.5 kg, line 1);c\nX2"),
        (b"X1 (a;b\nX2", 1, b"X1 (a;b (OLP PAYLOAD 2.5 kg, line 1)\nX2"),
        (b"X1\r\nX2\r\r\n", 2, b"X1\r\nX2 (OLP PAYLOAD 2.5 kg, line 2)\r\r\n"),
        # a text of another comment that has no end is no mark
        (b"(olp payload)\nX2", 2, b"(olp payload)\nX2 (OLP PAYLOAD 2.5 kg, line 2)"),
    ],
)  # fmt: skip
def test_where_the_comment_of_a_line_is_put(text: bytes, line: int, expected: bytes) -> None:
    assert with_payloads(text, {line: 2.5}, ROUND) == expected
    assert with_payloads(expected, {line: 2.5}, ROUND) is expected


def test_comments_of_several_lines_come_in_their_order() -> None:
    marked = with_payloads(b"a\nb\nc\n", {3: 1.0, 1: 0.0, 2: 1e-7}, SEMICOLON)
    assert marked == (
        b"a ; OLP PAYLOAD 0 kg, line 1\nb ; OLP PAYLOAD 0.0000001 kg, line 2\nc ; OLP PAYLOAD 1 kg, line 3\n"
    )
    assert with_payloads(marked, {1: 0.0, 2: 1e-7, 3: 1.0}, SEMICOLON) is marked


@pytest.mark.parametrize(
    ("text", "payloads", "line", "message"),
    [
        (b"a\nb\n", {3: 1.0}, None,
         "[[payloads]] of the job file names line 3, and the program has fewer lines; give the number "
         "of one of its lines"),
        (b"a\nb", {3: 1.0}, None,
         "[[payloads]] of the job file names line 3, and the program has fewer lines; give the number "
         "of one of its lines"),
        (b"", {1: 1.0}, None,
         "[[payloads]] of the job file names line 1, and the program has fewer lines; give the number "
         "of one of its lines"),
        (b"a\nb\n", {2: 1.0, 9: 1.0}, None,
         "[[payloads]] of the job file names line 9, and the program has fewer lines; give the "
         "number of one of its lines"),
        (b"a\r\nb\r(olp payload 3)\n", {1: 1.0}, 3,
         "the program states a payload here, and the job file states payloads in "
         "[[payloads]]; expected one of the two"),
        (b"a;OLP PAYLOAD 3KG\n", {1: 1.0}, 1,
         "the program states a payload here, and the job file states payloads in "
         "[[payloads]]; expected one of the two"),
        (b"a (olp payload 1 kg, line 1)\n", {1: 2.0}, None,
         "the payloads in the comments of this program are not those of "
         "[[payloads]] in the job file; give the job file that it was made with"),
        (b"a (olp payload 1 kg, line 1)\n", {1: 1.0, 2: 1.0}, None,
         "the payloads in the comments of this program are not those "
         "of [[payloads]] in the job file; give the job file that it was made with"),
    ],
)  # fmt: skip
def test_payloads_of_the_job_that_are_refused(
    text: bytes, payloads: dict[int, float], line: int | None, message: str
) -> None:
    with pytest.raises(ProgramError) as caught:
        with_payloads(text, payloads, ROUND)
    assert (caught.value.code, caught.value.line, caught.value.message) == ("OLP550", line, message)
