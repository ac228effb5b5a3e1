"""Lines of a parametric program: where their words are, what flow they state, and what is refused."""

from __future__ import annotations

import pytest
from cases.unrolling import fanuc, flatten, lcnc, refused

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.language import MACRO_B, NGC, Language
from olp.program.rs274.flatten.lines import Line, compile_line


def words(line: Line) -> list[tuple[str, bytes, bytes]]:
    """Letter, bytes of the word and bytes of its value."""
    return [(w.letter, line.raw[w.start : w.end], line.raw[w.value_start : w.end]) for w in line.words]


def test_words_keep_their_place_in_the_bytes() -> None:
    raw = b"/ n 1 0 G1x - 1 . 5 (a) Y[ 1 + (b) 2 ] ,R2 @7 ; e\r\r\n"
    line = compile_line(raw, 4, NGC)
    assert (line.number, line.raw, line.eol) == (4, raw[:-3], b"\r\r\n")
    assert words(line) == [
        ("n", b"n 1 0", b"1 0"), ("g", b"G1", b"1"), ("x", b"x - 1 . 5", b"- 1 . 5"),
        ("y", b"Y[ 1 + (b) 2 ]", b"[ 1 + (b) 2 ]"), (",r", b",R2", b"2"), ("@", b"@7", b"7"),
    ]  # fmt: skip
    assert [w.number for w in line.words] == [10.0, 1.0, -1.5, 0.0, 2.0, 7.0]
    assert [w.pointed for w in line.words] == [False, False, True, False, False, False]
    assert [w.value is None for w in line.words] == [True, True, True, False, True, True]
    assert line.comments == (b"(a)", b"(b)", b"; e")
    assert (line.deleted, line.percent, line.opaque, line.plain) == (True, False, False, False)


def test_assignments_keep_their_place_in_the_bytes() -> None:
    line = compile_line(b" #1 = [ 2 ] (c) #<a b> = 3 X1\n", 1, NGC)
    assert [line.raw[a.start : a.end] for a in line.assignments] == [b"#1 = [ 2 ]", b"#<a b> = 3"]
    assert words(line) == [("x", b"X1", b"1")]
    assert not line.plain


@pytest.mark.parametrize(
    ("raw", "deleted", "percent", "opaque"),
    [
        (b"%", False, True, False), (b" % X1", False, True, False), (b"/X1", True, False, False),
        (b"/3X1", True, False, False), (b"/3 X1", True, False, False), (b"X1", False, False, False),
        (b"", False, False, False), (b"X1!", False, False, True), (b"/X1!", True, False, True),
        (b"/3", True, False, True), (b"X", False, False, True), (b"X1 G", False, False, True),
        (b"X1..2", False, False, True), (b"(X1", False, False, False), (b";X1!", False, False, False),
        (b"X1 %", False, False, True),
    ],
)  # fmt: skip
def test_kinds_of_lines(raw: bytes, deleted: bool, percent: bool, opaque: bool) -> None:
    line = compile_line(raw, 1, NGC)
    assert (line.deleted, line.percent, line.opaque) == (deleted, percent, opaque)
    assert line.plain


def test_a_number_behind_the_slash_is_the_switch() -> None:
    for head in (b"/", b"/1", b"/ 9 "):
        assert [(w.letter, w.number) for w in compile_line(head + b"X12", 1, NGC).words] == [("x", 12.0)]
    assert [(w.letter, w.number) for w in compile_line(b"/12", 1, NGC).words] == []


def test_a_line_that_is_not_understood_keeps_its_comments() -> None:
    line = compile_line(b"X1! (c)\r\n", 3, NGC)
    assert (line.number, line.raw, line.eol, line.comments) == (3, b"X1! (c)", b"\r\n", (b"(c)",))
    assert lcnc("X1!\nM2\n") == "X1!\nM2\n"
    assert refused("G0 X1\nX2!\nY#5420\n")[::2] == ("OLP524", 3)


@pytest.mark.parametrize(
    ("raw", "language", "keyword", "label", "values"),
    [
        (b"o7 sub", NGC, "sub", "7", 0), (b"N5 O007 SUB", NGC, "sub", "7", 0),
        (b"o0 sub", NGC, "sub", "0", 0),
        (b"o00 sub", NGC, "sub", "0", 0), (b"o<A b> sub", NGC, "sub", "ab", 0),
        (b"/o7 sub", NGC, "sub", "7", 0),
        (b"o<007> endsub", NGC, "endsub", "007", 0), (b"o7 call [1] [2]", NGC, "call", "7", 2),
        (b"o7 endsub [1]", NGC, "endsub", "7", 1), (b"o7 return", NGC, "return", "7", 0),
        (b"o7 if [1]", NGC, "if", "7", 1), (b"o7 else if [1]", NGC, "elseif", "7", 1),
        (b"o7 else", NGC, "else", "7", 0), (b"o7 endif", NGC, "endif", "7", 0),
        (b"o7 while [1]", NGC, "while", "7", 1), (b"o7 endwhile", NGC, "endwhile", "7", 0),
        (b"o7 do", NGC, "do", "7", 0), (b"o7 repeat [2]", NGC, "repeat", "7", 1),
        (b"o7 endrepeat", NGC, "endrepeat", "7", 0), (b"o7 break", NGC, "break", "7", 0),
        (b"o7 continue", NGC, "continue", "7", 0), (b"O0123 (head)", NGC, "program", "123", 0),
        (b"o[1+2] call [3]", NGC, "call", "", 1), (b"o#3 call", NGC, "call", "", 0),
        (b"O123", MACRO_B, "program", "123", 0), (b"N5 IF[1EQ1]GOTO 5", MACRO_B, "when-goto", "", 2),
        (b"IF [1EQ1] THEN #1=2", MACRO_B, "when-then", "", 1),
        (b"WHILE[1EQ1] DO 02", MACRO_B, "while-do", "2", 1),
        (b"DO3", MACRO_B, "do", "3", 0), (b"END03", MACRO_B, "end", "3", 0),
        (b"GOTO #1", MACRO_B, "goto", "", 1),
    ],
)  # fmt: skip
def test_flow_of_a_line(raw: bytes, language: Language, keyword: str, label: str, values: int) -> None:
    line = compile_line(raw + b"\n", 1, language)
    assert line.flow is not None
    assert (line.flow.keyword, line.flow.label, len(line.flow.values)) == (keyword, label, values)
    assert (line.flow.dynamic is not None) is (label == "" and keyword == "call")
    assert [w.letter for w in line.words] == ["n"] * raw.upper().startswith(b"N")
    assert line.deleted is raw.startswith(b"/")


def test_what_is_flow_of_one_language_is_words_of_the_other() -> None:
    assert compile_line(b"goto5", 1, NGC).opaque
    assert [w.letter for w in compile_line(b"X1 O5", 1, MACRO_B).words] == ["x", "o"]
    assert compile_line(b"#1=2 O5", 1, NGC).flow is None


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("o1 if", "OLP542", "O-word IF has 0 values; expected one [expression]"),
        ("o1 if [1] [2]", "OLP542", "O-word IF has 2 values; expected one [expression]"),
        ("o1 elseif", "OLP542", "O-word ELSEIF has 0 values; expected one [expression]"),
        ("o1 while", "OLP542", "O-word WHILE has 0 values; expected one [expression]"),
        ("o1 repeat", "OLP542", "O-word REPEAT has 0 values; expected one [expression]"),
        ("o[1] sub", "OLP542", "O-word SUB has a computed label; only CALL may have one"),
        ("o1 blah", "OLP542", "O-word without a known keyword at 'blah'"),
        ("o1 abcdefghijklmnop", "OLP542", "O-word without a known keyword at 'abcdefghijkl'"),
        ("o<a>", "OLP542", "O-word without a known keyword at ''"),
        ("/o1 blah", "OLP542", "O-word without a known keyword at 'blah'"),
        (
            "o1 else X5",
            "OLP510",
            "ELSE is followed by 'x5', which is not understood; put it into a block of its own",
        ),
        (
            "o1 else " + "X5" * 99,
            "OLP510",
            f"ELSE is followed by '{'x5' * 30}', which is not understood; put it into a block of its own",
        ),
        ("#1", "OLP510", "a parameter without '=' is where a word is expected"),
        ("X1 #1 Y2", "OLP510", "a parameter without '=' is where a word is expected"),
        ("#1=5!abcdefghijklmnop", "OLP510", "expected a word at '!abcdefghijk'"),
        ("#1=[2", "OLP540", "expected ']' in an expression, found ''"),
    ],
)
def test_lines_that_are_refused(line: str, code: str, message: str) -> None:
    assert refused(f"G0 X1\n{line}\n") == (code, message, 2)


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        (f"o<{'a' * 251}> call", "OLP505", "a label has 251 characters; expected at most 250"),
        (f"o{'1' * 251} call", "OLP505", "a label has 251 characters; expected at most 250"),
        (f"#1={'9' * 400}", "OLP540", "a number of 400 digits is too large; expected at most 300"),
        (f"X{'9' * 400}#1=2", "OLP540", "a number of 400 digits is too large; expected at most 300"),
    ],
)
def test_long_lines_that_are_refused(line: str, code: str, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        compile_line(line.encode(), 1, NGC)
    assert (caught.value.code, caught.value.message) == (code, message)


def test_a_label_may_have_250_characters() -> None:
    flow = compile_line(b"o<%s> call" % (b"a" * 250), 1, NGC).flow
    assert flow is not None and flow.label == "a" * 250


def test_names_of_digits_and_numbers_are_the_same_label() -> None:
    assert lcnc("o<12> sub\nX1\no012 endsub\no12 call\nM2\n") == "X1\nM2\n"
    assert lcnc("o< A b > sub\nX1\no<ab> endsub\nO<aB> CALL\nM2\n") == "X1\nM2\n"


@pytest.mark.parametrize("function", ["ROUND", "RND"])
def test_rounding_in_a_word_counts_increments_on_some_controls(function: str) -> None:
    message = (
        "ROUND inside a word rounds to the least increment, which is not known here; assign the rounded "
        "value to a variable first"
    )
    block = f"G1 X[1.+{function}[1.5]]"
    assert refused(f"O1\n{block}\n", "fanuc") == ("OLP541", message, 2)
    assert lcnc(f"{block}\nM2\n") == "G1 X3\nM2\n"
    assert fanuc(f"O1\n#1={function}[1.5]\nX#1\nM30\n") == "O1\nX2.\nM30\n"


def test_a_block_number_of_its_own_is_searched_for() -> None:
    # an expression is no block number
    assert fanuc("O1\n#1=5\nGOTO5\nN#1 X1.\nN5 X2.\nM30\n") == "O1\nN5 X2.\nM30\n"
    # a broken line has none, and does not matter until it is run
    source = "O1\nM98 P2\nX[1+\nN5 X2\nM2\nO2\nM99 P5\n"
    assert lcnc(source) == "O1\nN5 X2\nM2\n"
    # in a line of several words, and the first one of its number
    assert fanuc("O1\nGOTO5\nX1.\nX2. N5\nX3.\nN5\nM30\n") == "O1\nX2. N5\nX3.\nN5\nM30\n"


def test_lines_that_the_control_cannot_read_are_refused() -> None:
    code, message, line = refused("G0 X1\n" + "X1" * 200 + "\n")
    assert (code, line) == ("OLP505", 2)
    assert "252" in message
    # 252 characters with the line end
    longest = "(" + "a" * 249 + ")"
    assert lcnc(f"{longest}\nM2\n") == f"{longest}\nM2\n"


def test_o_words_behind_comments_blanks_slashes_and_numbers_are_found() -> None:
    for head in ("", " \t", "(a) ", "(a) (b)", "N5 ", "n 12", "/", " / (a) N5 "):
        source = f"{head}o7 sub\nX1\no7 endsub\no7 call\nM2\n"
        assert lcnc(source) == "X1\nM2\n"
    # the subprogram behind the end is found, too
    assert lcnc("o7 call\nM2\n(a) o7 sub\nX1\n (b) o7 endsub\n") == "X1\n(b)\nM2\n"


def test_all_digits_are_written_where_an_arc_may_have_a_radius() -> None:
    third = "0.3333333333333333"
    short = third[:12]
    for arc in ("G2 X5 R3", "G2 X5 r 3", "G2 X5 R-3", "G2 X5 R.5", "G2 X5 R#1", "G2 X5 R[3]", "G2 X5 R+3"):
        blocks = lcnc(f"#1=3\nG1 X[1/3]\n{arc} Y0\nM2\n").splitlines()
        assert blocks[0] == f"G1 X{third}", arc
    for other in ("(R3)", "; R3", "G2 X5 I3", "(a) G2 X1 I1 ;R3", "o1 repeat [2]\no1 endrepeat"):
        assert lcnc(f"G1 X[1/3]\n{other}\nM2\n").splitlines()[0] == f"G1 X{short}", other
    # a Fanuc takes four decimals at most
    assert fanuc("O1\nG1 X[1/3]\nG2 X5. R3.\nM30\n").splitlines()[1] == "G1 X0.3333"


def test_lone_carriage_returns_end_lines_where_the_control_says_so() -> None:
    assert flatten(b"#1=2\rX#1\rM2\r", profile="grbl") == b"X2\rM2\r"
    assert flatten(b"#1=2\r\nX#1\r\r\nM2", profile="linuxcnc") == b"X2\r\r\nM2"
