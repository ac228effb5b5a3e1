"""Expressions of RS-274 and Macro B: laws against Python's own arithmetic, and hand-worked values."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.expressions import EQUAL_WITHIN, MACRO_B, NGC, Arithmetic, Reader


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
    ],
)
def test_macro_b_values(text: str, expected: float) -> None:
    assert value(text, MACRO_B) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1/0]", "division by zero"),
        ("[1 MOD 0]", "MOD by zero"),
        ("ACOS[2]", "ACOS"),
        ("SQRT[-1]", "SQRT"),
        ("LN[0]", "LN"),
        ("[-8**[1/3]]", "no finite real value"),
        ("[0**-1]", "no finite real value"),
        ("[9**9**9**9]", "no finite real value"),
        ("ATAN[1]", "two arguments"),
        ("#[7.3]", "is 7.3; expected an integer"),
        ("[1+", "expected a number"),
        ("[1", "expected ']'"),
        ("#<a", "closing '>'"),
        ("EXISTS[#7]", "named parameter"),
        ("[" * 99, "nested deeper"),
        ("", "expected a number"),
    ],
)
def test_refusals_say_what_was_found(text: str, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        value(text)
    assert message in str(caught.value)


def test_angle_that_depends_on_a_parameter_of_the_control_is_refused() -> None:
    with pytest.raises(ProgramError, match="parameter"):
        value("ATAN[-1]/[1]", MACRO_B)


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
