"""Expressions of RS-274 and Macro B: laws against Python's own arithmetic, and hand-worked values."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.expressions import EQUAL_WITHIN, MACRO_B, NGC, Arithmetic, Reader, whole


class _Table:
    """#7 is 3, #8 is -2, #<a> is 4, #9 is vacant."""

    def number(self, index: int) -> float | None:
        return {3: 11.0, 7: 3.0, 8: -2.0}.get(index)

    def named(self, name: str) -> float:
        return {"a": 4.0}[name]

    def exists(self, name: str) -> bool:
        return name == "a"


def value(text: str, arithmetic: Arithmetic = NGC) -> float | None:
    reader = Reader(text.replace(" ", "").lower(), arithmetic)
    result = reader.value()(_Table())
    assert reader.position == len(reader.text)
    return result


#: Words of Macro B that their first two letters may stand for.
LONG_WORDS = ["ABS", "ACOS", "ASIN", "ATAN", "COS", "EXP", "FIX", "FUP", "ROUND", "SIN", "SQRT", "TAN"]


def test_two_letters_are_no_word_of_linuxcnc() -> None:
    for word in LONG_WORDS:
        with pytest.raises(ProgramError, match="expected a number"):
            value(f"{word[:2]}[0.5]")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[2**3**2]", 64),
        ("[-2**2]", 4),
        ("[2+3 MOD 2]", 3),
        ("[-7 MOD 3]", 2),
        ("[7 MOD -3]", 1),
        ("[5-3-1]", 1),
        ("[8/4/2]", 1),
        ("[1 OR 0 AND 0]", 0),
        ("[1 XOR 1]", 0),
        ("[1 GT 0 EQ 1]", 1),
        ("[1 EQ 1.00009]", 1),
        ("[1 EQ 1.00011]", 0),
        ("[1 NE 1.000001]", 0),
        ("[1 GE 1.000001]", 0),
        ("FIX[-2.8]", -3),
        ("FUP[-2.8]", -2),
        ("ROUND[-2.5]", -3),
        ("ROUND[2.5]", 3),
        ("ATAN[1]/[-1]", 135),
        ("-SIN[30]", -0.5),
        ("--3", 3),
        ("-#7", -3),
        ("##7", 11),
        ("#[#7]", 11),
        ("[#7+-#8]", 5),
        ("EXISTS[#<a>]", 1),
        ("EXISTS[#<b>]", 0),
        ("[2*[#<a>-.5]]", 7),
        ("EXP[LN[2]]", 2),
        ("ACOS[0]", 90),
        ("1 2 . 5", 12.5),
        ("+#8", -2),
        ("ABS[-3]", 3),
        ("ASIN[0.5]", 30),
        ("ASIN[-1]", -90),
        ("ACOS[-1]", 180),
        ("COS[60]", 0.5),
        ("COS[0]", 1),
        ("TAN[45]", 1),
        ("LN[EXP[3]]", 3),
        ("FIX[2.8]", 2),
        ("FUP[2.2]", 3),
        ("ROUND[2.4]", 2),
        ("ROUND[-0.4]", 0),
        ("RND[2.5]", 3),
        ("SQRT[6.25]", 2.5),
        ("SQR[9]", 3),
        ("ATAN[-1]/[-1]", -135),
        ("ATAN[3]/[0]", 90),
        ("[7 MOD 7]", 0),
        ("[-6 MOD 3]", 0),
        ("[-7 MOD -3]", 2),
        ("[9**0.5]", 3),
        ("[2**-1]", 0.5),
        ("[2*3**2]", 18),
        ("[1+2 GT 2+0]", 1),
        ("[#9 EQ 0]", 1),
        ("[#9 + #9]", 0),
        ("[EXISTS[#<a>] + 1]", 2),
    ],
)
def test_rs274_values(text: str, expected: float) -> None:
    assert value(text) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("FIX[-2.8]", -2),
        ("FUP[-2.2]", -3),
        ("[6 AND 3 + 1]", 3),
        ("[#9 EQ #0]", 1),
        ("[#9 EQ 0]", 0),
        ("[#9 NE #0]", 0),
        ("[#9 + 2]", 2),
        ("[2 * 3 LT 7]", 1),
        ("ATAN[1]/[-1]", 135),
        ("ATAN[0]/[-1]", 180),
        ("ATAN[1]", 45),
        ("ATAN[-1]", -45),
        ("ATAN[#9]", 0),
        ("FIX[2.8]", 2),
        ("FUP[2.2]", 3),
        ("FUP[-3]", -3),
        ("[-7 MOD 3]", -1),
        ("[7 MOD -3]", 1),
        ("[12 AND 10]", 8),
        ("[12 OR 10]", 14),
        ("[12 XOR 10]", 6),
        ("[8 + 6 AND 3]", 10),
        ("[8 OR 1 + 1]", 10),
        ("[8 XOR 1 - 1]", 8),
        ("[1 OR 2 EQ 3]", 1),
        ("[1 EQ 1.00001]", 0),
        ("[1 NE 1.00001]", 1),
        ("[#9 NE 0]", 1),
        ("[#9 LE 0]", 1),
        ("ABS[#9]", 0),
        ("-#9", 0),
        ("[2.00009 AND 3]", 2),
        ("#[2.99991]", 11),
        *((f"{word[:2]}[0.5]", value(f"{word}[0.5]", MACRO_B)) for word in LONG_WORDS),
    ],
)
def test_macro_b_values(text: str, expected: float) -> None:
    assert value(text, MACRO_B) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1/0]", "division by zero in an expression"),
        ("[1 MOD 0]", "MOD by zero in an expression"),
        ("ACOS[2]", "ACOS[2] has no finite real value"),
        ("ASIN[-2]", "ASIN[-2] has no finite real value"),
        ("SQRT[-1]", "SQRT[-1] has no finite real value"),
        ("SQR[-1]", "SQRT[-1] has no finite real value"),
        ("LN[0]", "LN[0] has no finite real value"),
        ("EXP[800]", "EXP[800] has no finite real value"),
        ("[-8**[1/3]]", "-8 ** 0.333333 has no finite real value"),
        ("[0**-1]", "0 ** -1 has no finite real value"),
        ("[10**200*10**200]", "* gives a number that is not finite"),
        ("[-[10**308]-10**308]", "- gives a number that is not finite"),
        ("[10**200/10**-200]", "/ gives a number that is not finite"),
        ("ATAN[1]", "ATAN takes two arguments, as in ATAN[y]/[x]"),
        ("#[7.3]", "a parameter number is 7.3; expected an integer"),
        ("[1+", "expected a number, a parameter or [expression] at ''"),
        ("[abcdefghijklmnop]", "expected a number, a parameter or [expression] at 'abcdefghijkl'"),
        ("[1abcdefghijklmnop", "expected ']' in an expression, found 'abcdefghijkl'"),
        ("#<a", "a parameter name has no closing '>'"),
        ("EXISTS[#7]", "EXISTS takes a named parameter, as in EXISTS[#<name>]"),
        ("EXISTS[#<a>x", "expected ']' in an expression, found 'x'"),
        ("", "expected a number, a parameter or [expression] at ''"),
        ("9" * 309, "a number of 309 digits is too large; expected at most 300"),
    ],
)
def test_refusals_say_what_was_found(text: str, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        value(text)
    assert (caught.value.code, str(caught.value)) == ("OLP540", message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1 MOD 0]", "MOD by zero in an expression"),
        ("[1.5 AND 1]", "an operand of AND is 1.5; expected an integer"),
        ("[1 OR 1.5]", "an operand of OR is 1.5; expected an integer"),
        ("[1.5 XOR 1.5]", "an operand of XOR is 1.5; expected an integer"),
        ("[2**3]", "expected ']' in an expression, found '**3]'"),
    ],
)
def test_refusals_of_macro_b(text: str, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        value(text, MACRO_B)
    assert (caught.value.code, str(caught.value)) == ("OLP540", message)


@pytest.mark.parametrize("arithmetic", [NGC, MACRO_B])
def test_comparisons_are_exact_at_equal_numbers(arithmetic: Arithmetic) -> None:
    """The results for a smaller, an equal and a greater first operand."""
    expected = {"LT": (1, 0, 0), "LE": (1, 1, 0), "EQ": (0, 1, 0), "NE": (1, 0, 1), "GE": (0, 1, 1),
                "GT": (0, 0, 1)}  # fmt: skip
    for name, results in expected.items():
        assert tuple(value(f"[{a} {name} 5]", arithmetic) for a in (4.5, 5, 5.5)) == results


def test_logic_of_rs274_takes_every_number_but_zero_as_true() -> None:
    expected = {"AND": (0, 0, 0, 1), "OR": (0, 1, 1, 1), "XOR": (0, 1, 1, 0)}
    for name, results in expected.items():
        pairs = ((0, 0), (0, -2.5), (0.5, 0), (3, -4))
        assert tuple(value(f"[{a} {name} {b}]") for a, b in pairs) == results


def test_a_number_is_an_integer_within_one_ten_thousandth() -> None:
    assert [whole(x, "L") for x in (2.0, 1.99991, 2.00009, -2.99991, -3.00009, 0.0)] == [2, 2, 2, -3, -3, 0]
    for x, shown in (
        (2.0002, "2.0002"),
        (1.9998, "1.9998"),
        (0.5, "0.5"),
        (math.inf, "inf"),
        (math.nan, "nan"),
    ):
        with pytest.raises(ProgramError, match=f"^the count is {shown}; expected an integer$") as caught:
            whole(x, "the count")
        assert caught.value.code == "OLP540"


def test_brackets_may_be_sixty_levels_deep() -> None:
    assert value("[" * 59 + "7" + "]" * 59) == 7
    # what is behind one another is not deep
    assert value("[" + "+".join(["[1]"] * 500) + "]") == 500
    with pytest.raises(ProgramError, match="nested deeper than 60; split it over lines") as caught:
        value("[" * 60 + "7" + "]" * 60)
    assert caught.value.code == "OLP543"


def test_a_plain_number_is_read_at_its_place() -> None:
    reader = Reader("x-.5+12.y", NGC, 1)
    assert (reader.number(), reader.position) == (-0.5, 4)
    assert (reader.number(), reader.position) == (12.0, 8)
    assert (reader.number(), reader.position) == (None, 8)


def test_angle_that_depends_on_a_parameter_of_the_control_is_refused() -> None:
    with pytest.raises(ProgramError, match="write the angle with ACOS or ASIN") as caught:
        value("ATAN[-1]/[1]", MACRO_B)
    assert caught.value.code == "OLP541"


_number = st.integers(-9999, 9999).map(lambda n: n / 100)


def _tree() -> st.SearchStrategy[tuple[str, float]]:
    leaf = _number.map(lambda x: (f"{x:.2f}", x))

    def join(inner: st.SearchStrategy[tuple[str, float]]) -> st.SearchStrategy[tuple[str, float]]:
        return st.one_of(
            st.tuples(inner, inner).map(lambda p: (f"[{p[0][0]} + {p[1][0]}]", p[0][1] + p[1][1])),
            st.tuples(inner, inner).map(lambda p: (f"[{p[0][0]} - {p[1][0]}]", p[0][1] - p[1][1])),
            st.tuples(inner, inner).map(lambda p: (f"[{p[0][0]} * {p[1][0]}]", p[0][1] * p[1][1])),
            st.tuples(inner, inner, inner).map(
                lambda p: (f"[{p[0][0]} + {p[1][0]} * {p[2][0]}]", p[0][1] + p[1][1] * p[2][1])
            ),
            inner.map(lambda p: (f"ABS[{p[0]}]", abs(p[1]))),
            inner.map(lambda p: (f"-[{p[0]}]", -p[1])),
        )

    return st.recursive(leaf, join, max_leaves=12)


@given(tree=_tree(), arithmetic=st.sampled_from([NGC, MACRO_B]))
def test_arithmetic_is_that_of_doubles(tree: tuple[str, float], arithmetic: Arithmetic) -> None:
    text, expected = tree
    assert value(text, arithmetic) == expected


@given(a=_number, b=_number)
def test_modulo_fix_and_comparison_laws(a: float, b: float) -> None:
    if b != 0:
        rest = value(f"[{a} MOD {b}]")
        assert rest is not None
        assert 0 <= rest <= abs(b)
        turns = (a - rest) / b
        assert turns == pytest.approx(round(turns), abs=1e-6)
    assert value(f"FIX[{a}]") == math.floor(a)
    assert value(f"FUP[{a}]") == math.ceil(a)
    assert value(f"[{a} EQ {b}]") == float(abs(a - b) < EQUAL_WITHIN)
    equal, less, more = (value(f"[{a} {op} {b}]", MACRO_B) for op in ("EQ", "LT", "GT"))
    assert (equal or 0) + (less or 0) + (more or 0) == 1


@given(angle=st.integers(-179, 180))
def test_atan_returns_the_angle_of_a_direction(angle: int) -> None:
    assert value(f"ATAN[SIN[{angle}]]/[COS[{angle}]]") == pytest.approx(angle, abs=1e-9)
