"""Numbers written anew in columns: as one by one, whatever their form."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from olp.program.text.numbers import Placing, number, spliced, written
from olp.program.text.rewriting import rewritten

_SIGN = st.sampled_from(["", "-", "+"])
_WHOLE = st.sampled_from(["", "0", "7", "00", "012", "305", "90210", "1234567"])
_FRACTION = st.sampled_from(["", "0", "5", "25", "500", "0625", "123456", "0000000001"])
_POWER = st.sampled_from(["", "", "", "e2", "E-03", "D+1"])
_BLANKS = (b" ", b"\t")


@st.composite
def forms(draw: st.DrawFn, decimal: str) -> bytes:
    whole, fraction = draw(_WHOLE), draw(_FRACTION)
    mark = decimal if fraction or draw(st.booleans()) else ""
    power = draw(_POWER) if len(whole) < 5 else ""
    return (draw(_SIGN) + (whole or ("" if fraction else "3")) + mark + fraction + power).encode()


@given(st.data(), st.sampled_from([".", ","]), st.sampled_from([None, 0, 3, 6, 12]))
def test_columns_of_numbers_are_written_as_one_by_one(
    data: st.DataObject, decimal: str, decimals: int | None
) -> None:
    texts = data.draw(st.lists(forms(decimal), min_size=1, max_size=6))
    # halves of the last digit, and what binary numbers make of them, are the hard ones
    steps = st.sampled_from([0.0, 0.05, -0.05, 0.005, 0.125, -0.0005, 1e-9, -7.25, 12345.678, 2e8])
    added = data.draw(st.lists(steps, min_size=len(texts), max_size=len(texts)))
    whole = b";".join(texts)
    end = np.cumsum([len(text) + 1 for text in texts]) - 1
    start = end - [len(text) for text in texts]
    known = [number(text, decimal.encode()) for text in texts]
    old = np.array([form.value for form in known if form is not None])
    new = old + added
    done = rewritten(np.frombuffer(whole, np.uint8), start, end, old, new, decimals, decimal.encode())
    expected = [
        written(form, float(value), decimals, decimal.encode())
        for form, value in zip(known, new, strict=True)
        if form is not None
    ]
    assert done.text.tobytes() == b"".join(expected)
    assert done.length.tolist() == [len(text) for text in expected]
    said = [number(text, decimal.encode()) for text in expected]
    assert done.value.tolist() == [
        float(before) if form is None else form.value for before, form in zip(old, said, strict=True)
    ]


def test_a_product_that_is_rounded_to_a_half_is_not_a_half() -> None:
    # 2.675 is 2.67499999999999982 in binary, and 100 times that is 267.5
    text, start, end = np.frombuffer(b"1.00", np.uint8), np.array([0]), np.array([4])
    assert rewritten(text, start, end, np.ones(1), np.array([2.675]), None, b".").text.tobytes() == b"2.67"


def test_a_number_that_goes_on_in_the_next_line_ends_in_the_first() -> None:
    text = b"12.$\r\n  5,7.25"
    done = rewritten(
        np.frombuffer(text, np.uint8), np.array([0, 10]), np.array([9, 14]), np.array([12.5, 7.25]),
        np.array([12.75, 7.5]), None, b".",
    )  # fmt: skip
    assert done.text.tobytes() == b"12.8$\r\n  7.50"
    assert done.continued.tolist() == [True, False]


def test_no_number_of_a_plain_table_is_written_one_by_one(monkeypatch: object) -> None:
    import olp.program.text.rewriting as rewriting

    calls: list[int] = []
    monkeypatch.setattr(rewriting, "written", lambda *_: calls.append(1) or b"0.0")  # type: ignore[attr-defined]
    for count in (500, 1000):
        texts = [b"%+.3f" % value if value > 3 else b"%.3f" % value for value in np.linspace(-9, 9, count)]
        end = np.cumsum([len(text) + 1 for text in texts]) - 1
        start = end - [len(text) for text in texts]
        old = np.array([float(text) for text in texts])
        rewritten(np.frombuffer(b" ".join(texts), np.uint8), start, end, old, old + 0.0123, None, b".")
    assert not calls


def placed_one_by_one(data: bytes, padded: bool, trailing: bool, start: int, end: int, text: bytes) -> object:
    """The rule of `Placing`, byte by byte."""
    more, gap = len(text) - (end - start), 0
    while start - gap and data[start - gap - 1 : start - gap] in _BLANKS:
        gap += 1
    if padded:
        taken = min(more, max(gap - 1, 0)) if more > 0 else 0
        return start - taken, end, b" " * -more + text
    if trailing and more > 0:
        behind = 0
        while behind < more and not data[end + behind : end + behind + 2].strip(b" \t"):
            behind += 1
        return start, min(end + behind, len(data)), text
    if trailing and data[end : end + 1] in _BLANKS:
        return start, end, text + b" " * -more
    return start, end, text


@example([("", 1, 1), ("  ;", 1, 3)], " ")
@example([("", 1, 1), ("  ;", 1, 3)], " \n")
@given(
    st.lists(st.tuples(st.text(" \t;", max_size=4), st.integers(1, 4), st.integers(1, 6)), min_size=1),
    st.text(" \t\n", max_size=3),
)
def test_columns_of_a_text_keep_their_edges(cells: list[tuple[str, int, int]], tail: str) -> None:
    data, spans = b"", []
    for blanks, width, _ in cells:
        data += (blanks or ";").encode()
        spans.append((len(data), len(data) + width))
        data += b"8" * width
    data += tail.encode()
    start, end = np.array(spans).T
    placing = Placing(data, start, end)
    edits = [(a, b, b"9" * new) for (a, b), (_, _, new) in zip(spans, cells, strict=True)]
    expected = [placed_one_by_one(data, placing.padded, placing.trailing, *edit) for edit in edits]
    assert placing.placed(edits) == expected
    assert len(spliced(data, placing.placed(edits))) > 0
