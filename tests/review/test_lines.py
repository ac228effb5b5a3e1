"""Texts by templates and numbers: each line comes back to the letter, and what is predicted costs nothing."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from cases import texts
from hypothesis import given
from hypothesis import strategies as st
from judge.unpacker import decoded, integers

from olp.review import lines as coding
from olp.review.lines import Lines, Prediction
from olp.review.pack import DEVIATION_MM, POSITION_MM, Arrays
from olp.review.tokens import MARK, Tokens

#: Characters that numbers are made of are more frequent than chance has them.
LETTERS = st.text(
    st.one_of(
        st.sampled_from("0123456789.-+XYZ ,\n"),
        st.characters(exclude_characters=MARK.decode(), exclude_categories=["Cs"]),
    ),
    max_size=200,
)


@pytest.fixture(autouse=True, scope="module")
def every_column_is_stored() -> Iterator[None]:
    """Also those of few values and of few lines, which would belong to the templates."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coding, "_FEW", 0)
        patch.setattr(coding, "_SPARSE", 1 << 30)
        yield


def unpacked(arrays: Arrays, name: str = "text") -> Any:
    return decoded(arrays.specs, zlib.decompress(arrays.deflated()), name)


def stored(arrays: Arrays, name: str) -> list[int]:
    return integers(arrays.specs, zlib.decompress(arrays.deflated()), arrays.specs[name])


def returned(text: str) -> str:
    arrays = Arrays()
    arrays.lines("text", text)
    return "\n".join(unpacked(arrays))


# -- to the letter --------------------------------------------------------------------------------------


@given(LETTERS)
def test_any_text_comes_back_to_the_letter(text: str) -> None:
    assert returned(text) == text


@pytest.mark.slow
@given(st.integers(0, 2**32), st.integers(1, 120), st.sampled_from([0.0, 0.1, 1.0]))
def test_programs_of_all_dialects_come_back_to_the_letter(seed: int, count: int, uneven: float) -> None:
    text = texts.text(seed, count, uneven=uneven)
    assert returned(text) == text


@pytest.mark.slow
@given(st.integers(0, 2**32), st.data())
def test_edited_programs_come_back_to_the_letter(seed: int, data: st.DataObject) -> None:
    text = texts.text(seed, 60)
    for _ in range(data.draw(st.integers(1, 8))):
        a = data.draw(st.integers(0, len(text)))
        b = min(len(text), a + data.draw(st.integers(0, 5)))
        text = text[:a] + data.draw(LETTERS) + text[b:]
    assert returned(text) == text


@pytest.mark.parametrize("decimals", [0, 3, 9])
@pytest.mark.parametrize("form", texts.FORMS)
def test_every_form_of_a_number_is_a_style_of_its_column(form: Any, decimals: int) -> None:
    """Whatever the usual form of the column is."""
    numbers = [form(v) for v in (-700.25, -12.0, -0.5, -0.0001, 0.0, 0.0001, 0.5, 1.0, 1.5, 10.0, 12.3456)]
    usual = [f"X{1000.0 + k / 7:.{decimals}f}" for k in range(40)]
    text = "\n".join([*usual, *(f"X{number}" for number in numbers)])
    assert returned(text) == text


@pytest.mark.slow
@given(st.integers(0, 2**32), st.booleans())
def test_texts_come_back_whatever_is_predicted(seed: int, moving: bool) -> None:
    """By positions that have nothing to do with them too."""
    rng = np.random.default_rng(seed)
    text = texts.text(seed, 50)
    arrays = Arrays()
    positions = np.cumsum(rng.normal(0.0, 5.0, (30, 3)), axis=0) if moving else np.zeros((30, 3))
    arrays.quantised("P", positions, POSITION_MM, keep=True)
    arrays.quantised("d", rng.normal(0.0, 0.05, (30, 3)), DEVIATION_MM, keep=True)
    arrays.lines("text", text, ["P", "d"], np.sort(rng.integers(0, 30, 50)).astype(np.int32))
    assert "\n".join(unpacked(arrays)) == text


def test_long_numbers_stay_in_the_text_where_others_have_many_decimals() -> None:
    """In units of the last decimal they would be more than a double counts."""
    text = "\n".join(f"X.{k:09d}\nX{k + 987_654_000}" for k in range(1, 100))
    assert returned(text) == text


def test_a_text_with_the_mark_of_numbers_is_refused() -> None:
    with pytest.raises(ValueError, match="contains the mark"):
        Lines.of("X1\x01\nX2")


@pytest.mark.slow
def test_too_many_styles_belong_to_the_templates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coding, "_STYLES", 3)
    for seed in range(20):
        text = texts.text(seed, 80, uneven=1.0)
        assert returned(text) == text
        assert len(Lines.of(text).styles) == 3


# -- by hand --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "skeleton", "numbers"),
    [
        (b"G1 X-12.50", b"G\x01 X\x01", [(1, 1, 0, False), (-1250, 2, 2, True)]),
        (b"X.5 Y5. Z-.5", b"X\x01 Y\x01 Z\x01", [(5, 0, 1, True), (5, 1, 0, True), (-5, 0, 1, True)]),
        (b"N007 X+3", b"N\x01 X+\x01", [(7, 3, 0, False), (3, 1, 0, False)]),
        (b"X-0.0 Y1-2", b"X-\x01 Y\x01\x01", [(0, 1, 1, True), (1, 1, 0, False), (-2, 1, 0, False)]),
        (b"1.2.3 . 1234567890", b"1.2.3 . 1234567890", []),
        (b"123456789 1e5", b"\x01 \x01e\x01", [(123456789, 9, 0, False), (1, 1, 0, False), (5, 1, 0, False)]),
    ],
)  # fmt: skip
def test_numbers_of_a_line(line: bytes, skeleton: bytes, numbers: list[tuple[int, int, int, bool]]) -> None:
    """Value, digits before and behind the point, and the point, by hand."""
    tokens = Tokens.of(line.decode())
    assert tokens.skeletons == [skeleton]
    columns = (tokens.value, tokens.whole, tokens.decimals, tokens.point)
    assert list(zip(*(column.tolist() for column in columns), strict=True)) == numbers


def test_bands_are_cut_at_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    text = texts.text(5, 300)
    whole = Tokens.of(text)
    monkeypatch.setattr("olp.review.tokens._BAND", 100)
    bands = Tokens.of(text)
    assert bands.skeletons == whole.skeletons
    for name in ("skeleton", "value", "whole", "decimals", "point"):
        assert (getattr(bands, name) == getattr(whole, name)).all(), name


# -- what it costs --------------------------------------------------------------------------------------


def path(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions on the grid of 0.1 um, and corrections of them that leave them on it."""
    rng = np.random.default_rng(4)
    nominal = np.round(np.cumsum(rng.normal(0.0, 3.0, (count, 3)), axis=0), 4)
    return nominal, np.round(rng.normal(0.0, 0.05, (count, 3)), 4)


@pytest.mark.parametrize(
    "line", ["X{:.4f} Y{:.4f} Z{:.4f}", "goto/{:.4f},{:.4f},{:.4f}", "{:.4f} {:.4f} {:.4f}"]
)
def test_positions_that_the_page_has_cost_a_text_nothing(line: str) -> None:
    nominal, correction = path(500)
    arrays = Arrays()
    arrays.quantised("P", nominal - [10.0, 20.0, 30.0], POSITION_MM, keep=True)
    arrays.quantised("d", correction, DEVIATION_MM, keep=True)
    at = np.arange(500, dtype=np.int32)
    for name, values, of in (("before", nominal, ["P"]), ("after", nominal + correction, ["P", "d"])):
        text = "\n".join(line.format(*row) for row in values)
        arrays.lines(name, text, of, at)
        assert "\n".join(unpacked(arrays, name)) == text
        # the zero of the positions is another
        assert set(stored(arrays, f"{name}_rest")) == {100_000, 200_000, 300_000}
        assert len(arrays.specs[f"{name}_rest"]["order"]) == 3


def test_inches_and_steps_from_the_line_before_are_predicted_too() -> None:
    nominal, _ = path(500)
    at = np.arange(500, dtype=np.int32)
    arrays = Arrays()
    arrays.quantised("P", nominal, POSITION_MM, keep=True)
    inches = [Prediction(axis, 2540.0, False) for axis in range(3)]
    steps = [Prediction(axis, 100.0, True) for axis in range(3)]
    for rows, decimals, expected in (
        (nominal / 25.4, 4, inches),
        (np.diff(nominal, axis=0, prepend=nominal[:1]), 4, steps),
    ):
        text = "\n".join("X{:.{d}f} Y{:.{d}f} Z{:.{d}f}".format(*row, d=decimals) for row in rows)
        arrays.lines("text", text, ["P"], at)
        assert "\n".join(unpacked(arrays)) == text
        assert arrays.specs["text"]["columns"] == [
            {"decimals": decimals, "axis": p.axis, "nm": p.nm, "relative": p.relative} for p in expected
        ]
        assert set(stored(arrays, "text_rest")) == {0}


def test_a_line_that_is_the_same_costs_a_number() -> None:
    text = "\n".join("G1 X0.5 (naïve 🛠 line)" for _ in range(50))
    lines = Lines.of(text)
    assert len(lines.templates) == 1
    assert not np.diff(lines.rest, axis=0).any()
