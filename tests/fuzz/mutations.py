"""Seeded mutations of bytes: flips, cuts, copies, splices of two texts, words of a dictionary, odd bytes."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

#: Words that texts of all kinds react to: numbers at the edge, marks, keys, codes.
WORDS: tuple[bytes, ...] = (
    b"0", b"-0", b"1e999", b"-1e999", b"nan", b"inf",
    b"1e308", b"99999999999", b"-99999999999",
    b"9223372036854775808", b"4294967296", b"65536", b"0.000000000000000000001", b"." * 3, b"1.2.3",
    b"+-1",
    b"1" * 60, b"X", b"Y1", b"Z-1", b"G0 ", b"G1 ",
    b"G2 ", b"G3 ", b"G81 ", b"G83 ", b"G91 ", b"G90 ", b"G20 ",
    b"G92 X1", b"G92.1", b"G52 X1", b"G10 L2 P1 X1", b"G10 L20 P1", b"G53 ",
    b"G28 ", b"G43 H1", b"G49", b"G41",
    b"G18 ", b"G93 ", b"G95 ", b"M2", b"M30", b"M6 T1",
    b"M98 P1 L2", b"M99", b"L99999", b"P0", b"Q0", b"R1e9",
    b"I0 J0", b"K1", b"F0", b"F-1", b"%", b"/",
    b"(", b")", b";", b"#1=1", b"#<a>", b"[1/0]", b"o1 sub", b"o1 if [1]",
    b"o1 endif", b"o1 repeat [3]", b"o1 endrepeat", b"N1 ", b"GOTO 1", b"GOTO/1,2,3",
    b"CIRCLE/0,0,0,0,0,1,10",
    b"RAPID", b"FEDRAT/100", b"MULTAX/ON", b"UNITS/INCHES", b"DMISMN/'A',05.2", b"ENDFIL",
    b"MEAS/POINT,F(A),1",
    b"PTMEAS/CART,1,2,3,0,0,1", b"D(MCS)", b"T(A)=TOOL", b"$", b"$$", b",",
    b",,", b"=", b"[]", b"[[", b"]]", b"{}",
    b'"', b"'", b'"""', b"\\", b"\\u0000", b"true", b"false",
    b"[1, 2]", b"1979-05-27", b"-1", b"1.0", b"# ",
    b"X_mm", b"EXX_um", b"direction", b"line", b"\xef\xbb\xbf", b"\xff\xfe",
    b"\r", b"\r\n", b"\n", b"\n\n",
    b"\x00", b"\t", b" ", b"\x1a", b"\x7f", b"\x80",
    b"\xff", b"\xc3", b"\xed\xa0\x80", b"olp-corrected 000000000000",
    b"(olp off)", b"(olp on)", b"(olp payload 5)", b"PK\x03\x04", b"\x93NUMPY",
)  # fmt: skip
#: bytes of a text that is copied again and again, at most
_MOST = 60_000

Mutation = Callable[[random.Random, bytearray, Sequence[bytes]], None]


def _span(draw: random.Random, data: bytearray) -> tuple[int, int]:
    """A stretch, mostly short, often of whole lines."""
    if draw.random() < 0.5:
        lines = [0, *(k + 1 for k, byte in enumerate(data) if byte == 10), len(data)]
        a = draw.randrange(len(lines))
        b = min(a + draw.choice((1, 1, 1, 2, 5, 40)), len(lines) - 1)
        return lines[a], max(lines[a], lines[b])
    a = draw.randrange(len(data) + 1)
    return a, min(len(data), a + draw.choice((1, 1, 2, 4, 9, 60, 900)))


def _flip(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    if data:
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)


def _byte(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    if data:
        data[draw.randrange(len(data))] = draw.randrange(256)


def _cut(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    a, b = _span(draw, data)
    del data[a:b]


def _end(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    del data[draw.randrange(len(data) + 1) :]


def _copy(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    a, b = _span(draw, data)
    place = draw.randrange(len(data) + 1)
    times = draw.choice((1, 1, 1, 2, 9, 200))
    data[place:place] = bytes(data[a:b] * times)[:_MOST]


def _word(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    place = draw.randrange(len(data) + 1)
    data[place:place] = draw.choice(WORDS) * draw.choice((1, 1, 1, 1, 1, 2, 50))


def _replace(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    """A number or a word of the text by one of the dictionary."""
    starts = [
        k for k in range(len(data)) if chr(data[k]).isalnum() and (not k or not chr(data[k - 1]).isalnum())
    ]
    if starts:
        a = b = draw.choice(starts)
        while b < len(data) and (chr(data[b]).isalnum() or data[b] in b"._-"):
            b += 1
        data[a:b] = draw.choice(WORDS)


def _splice(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    other = bytearray(draw.choice(others))
    a, b = _span(draw, other)
    place, end = _span(draw, data)
    data[place:end] = other[a:b]


def _swap(draw: random.Random, data: bytearray, others: Sequence[bytes]) -> None:
    lines = data.split(b"\n")
    a, b = draw.randrange(len(lines)), draw.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    data[:] = b"\n".join(lines)


_MUTATIONS: tuple[Mutation, ...] = (
    _flip, _byte, _cut, _cut, _end, _copy, _word, _word, _replace, _replace, _replace, _splice, _swap,
)  # fmt: skip


def mutated(draw: random.Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """The bytes after one to a few mutations; `others` are texts of the same kind."""
    changed = bytearray(data)
    for _ in range(draw.choice((1, 1, 1, 2, 2, 3, 6))):
        draw.choice(_MUTATIONS)(draw, changed, others)
    return bytes(changed[: 4 * _MOST])
