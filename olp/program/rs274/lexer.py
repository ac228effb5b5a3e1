"""Lexer of word-address text (RS-274, ISO 6983 and similar): bytes to columns, one row per word.

Bytes are never decoded. White space means nothing, also inside numbers; `(...)` and `;` start
comments; `/` at the start of a block is block delete; a line that starts with `%` is a tape mark.
A line with anything but words (letter, number) is *odd*: its words are dropped and its number is
reported, so that the interpreter can decide whether the line may stay unchanged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask, distinct, is_in
from olp.core.patterns import pattern
from olp.core.progress import Progress, silent
from olp.core.spool import Text, in_parts, matches, unload
from olp.core.values import dataclass
from olp.program.rs274.block_text import CLOSED_TOGETHER, CONTROL, PLAIN, BlockText
from olp.program.text.line_ends import LONE_CR

Bytes = npt.NDArray[np.uint8]

#: Bytes lexed at a time: the working columns then stay in the second-level cache.
CHUNK = 1 << 18

_U = np.uint64
_TOGETHER = pattern(CLOSED_TOGETHER)
#: Bytes before and after the text, so that eight bytes can be read at a time at either end.
_PAD = 8
#: Masks of the high bytes of a number of eight bytes, by how many of them are kept.
_NONE = np.zeros(0, np.int64)
_HIGH = np.array([0] + [(~((1 << (8 * (8 - n))) - 1)) & (2**64 - 1) for n in range(1, 9)], dtype=np.uint64)
#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10 ** np.arange(19, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class WordChunk:
    """Words of consecutive lines. Positions count from the start of the text, lines from 0 in the chunk.

    `mantissa` / 10**`decimals` is the number as written; `pointed` is whether it has a decimal point.
    `first_word[i]` is the index of line i's first word, with one extra entry for the end.
    `comments` are the positions where comments open.
    """

    letter: Bytes
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    pointed: Mask
    start: Index
    number: Index
    end: Index
    line: Index
    first_word: Index
    line_start: Index
    line_end: Index
    deleted: Mask
    marks: Index
    odd: Index
    comments: Index
    first_line: int


def chunks(data: Text, rules: BlockText, size: int = CHUNK, tell: Progress = silent) -> Iterator[WordChunk]:
    """Lex a whole text, chunk by chunk, each ending at a line end. Lines that the `rules` refuse are odd."""
    if rules.cr_ends_line and next(matches(LONE_CR, data), None) is not None:
        data = LONE_CR.sub(b"\n", data)
    # in parts, as no copy of the whole is needed
    plain = not any(part.translate(None, PLAIN) for part in in_parts(data))
    odd = () if plain or rules.odd_bytes is None else matches(rules.odd_bytes, data)
    strange = np.array([match.start() for match in odd], np.int64)
    if not rules.skips_control and (plain or next(matches(CONTROL, data), None) is None):
        rules = replace(rules, skips_control=True)
    text = np.frombuffer(data, np.uint8)
    start = line = 0
    while start < len(data):
        cut = len(data)
        if start + size < len(data):
            newline = data.find(b"\n", start + size)
            cut = newline + 1 if newline >= 0 else cut
        here = strange[slice(*np.searchsorted(strange, (start, cut)))]
        chunk = lex(text[start:cut], rules, start, line, strange=here - start)
        line += len(chunk.line_start)
        start = cut
        yield chunk
        unload()
        tell("read", cut / len(data))


def lex(
    text: Bytes, rules: BlockText, offset: int = 0, first_line: int = 0, *, strange: Index = _NONE
) -> WordChunk:
    """Lex whole lines; `offset` and `first_line` are where they begin in the text. The lines of bytes
    `strange` are odd."""
    size = len(text)
    newline = np.flatnonzero(text == 10)
    ends = newline if newline.size and newline[-1] == size - 1 else np.append(newline, size)
    lines = len(ends)
    starts = np.empty(lines, np.int64)
    starts[0] = 0
    starts[1:] = ends[:-1] + 1

    keep = text > 32
    if not rules.skips_control:
        keep |= (text < 9) | ((text > 10) & (text < 32) & (text != 13))
    keep[newline] = True
    if rules.unread is not None and (text == rules.unread_mark).any():
        for match in rules.unread.finditer(text.tobytes()):
            keep[slice(*match.span(rules.unread.groups))] = False
    deleted = np.zeros(lines, bool)
    marks = _line_heads(text, starts, ends, keep, deleted)
    if rules.marks_in_pairs and marks.size:
        alone = [bytes(text[starts[m] : ends[m]]).strip() == b"%" for m in marks.tolist()]
        strange = np.append(strange, starts[marks[~np.array(alone)]])
    comments, refused = _drop_comments(text, ends, keep, rules)
    content = without_cr(text, starts, ends)
    if rules.longest is not None:
        refused = np.append(refused, starts[ends - starts > rules.longest])
    strange = np.append(strange, refused) if refused.size else strange
    where: Index | None = None
    compact, begin, stop = runs(blanked(text, keep))
    line_breaks = newline
    if (compact[begin + (_PAD - 1)] == 32).any():
        # blanks inside words: take them all out
        where = np.flatnonzero(keep)
        compact, begin, stop = runs(text[where])
        line_breaks = np.flatnonzero(compact[_PAD : _PAD + len(where)] == 10)
    body = compact[_PAD : len(compact) - _PAD]
    letter = compact[begin + (_PAD - 1)] & np.uint8(0xDF)
    bad = _misplaced(body, begin, stop, letter)
    mantissa, decimals, pointed, malformed = numbers(compact, body, begin, stop)
    if malformed.size:
        bad = np.concatenate((bad, begin[malformed]))

    if len(line_breaks) < lines:
        line_breaks = np.append(line_breaks, len(body))
    first_word = np.empty(lines + 1, np.int64)
    first_word[0] = 0
    first_word[1:] = np.searchsorted(begin, line_breaks)
    line = np.repeat(np.arange(lines), np.diff(first_word))
    odd = np.searchsorted(line_breaks, bad) if bad.size else _NONE
    odd = distinct(np.append(odd, np.searchsorted(ends, strange))) if odd.size or strange.size else odd
    if odd.size:
        good = ~is_in(line, odd)
        begin, stop, letter, line = begin[good], stop[good], letter[good], line[good]
        mantissa, decimals, pointed = mantissa[good], decimals[good], pointed[good]
        first_word = np.searchsorted(line, np.arange(lines + 1))
    return WordChunk(
        letter=letter,
        mantissa=mantissa,
        decimals=decimals,
        pointed=pointed,
        start=(begin - 1 if where is None else where[begin - 1]) + offset,
        number=(begin if where is None else where[begin]) + offset,
        end=(stop if where is None else where[stop - 1] + 1) + offset,
        line=line,
        first_word=first_word,
        line_start=starts + offset,
        line_end=content + offset,
        deleted=deleted,
        marks=marks,
        odd=odd,
        comments=comments + offset,
        first_line=first_line,
    )


def without_cr(text: Bytes, starts: Index, ends: Index) -> Index:
    """(n,) where lines end without the carriage returns before their line feeds."""
    content = ends.copy()
    while True:
        has_cr = (content > starts) & (text[np.maximum(content - 1, 0)] == 13)
        if not has_cr.any():
            return content
        content[has_cr] -= 1


def blanked(text: Bytes, keep: Mask) -> Bytes:
    """The text with a blank for all that is not kept."""
    # by bits, which is four times as fast as a choice
    kept = -keep.view(np.uint8)
    return (text & kept) | (~kept & np.uint8(32))


def runs(text: Bytes) -> tuple[Bytes, Index, Index]:
    """The text between two pads of line ends, and where runs of the characters of numbers begin and end."""
    compact = np.full(len(text) + 2 * _PAD + 1, 10, np.uint8)
    compact[_PAD : _PAD + len(text)] = text
    # '+' ',' '-' '.' '/' and digits; ',' and '/' make their line odd below
    numeric = (compact[_PAD - 1 : _PAD + len(text) + 1] - np.uint8(43)) < 15
    edges = np.flatnonzero(numeric[1:] != numeric[:-1])
    return compact, edges[0::2], edges[1::2]


def _line_heads(text: Bytes, starts: Index, ends: Index, keep: Mask, deleted: Mask) -> Index:
    """Take `/` and `%` at the start of lines out of `keep`; returns the lines with a tape mark."""
    if not ((text == 47) | (text == 37)).any():
        return np.zeros(0, np.int64)
    kept = np.flatnonzero(keep)
    head = kept[np.minimum(np.searchsorted(kept, starts), len(kept) - 1)]
    head_of = np.where(head < ends, text[head], 0)
    lines = np.flatnonzero(head_of == 47)
    deleted[lines] = True
    keep[head[lines]] = False
    # "/2": an optional switch number, only where a word follows it
    switch = head[lines] + 1
    switch = switch[switch < ends[lines]]
    keep[switch[(text[switch] >= 49) & (text[switch] <= 57)]] = False
    marks = np.flatnonzero(head_of == 37)
    for line in marks.tolist():
        keep[head[line] : ends[line]] = False
    return marks


def _drop_comments(text: Bytes, ends: Index, keep: Mask, rules: BlockText) -> tuple[Index, Index]:
    """Clear `keep` inside comments: `(` to `)` or the end of the line, `;` to the end of the line. Returns
    where they open, and where comments are that the rules refuse."""
    opening = np.flatnonzero((text == 40) | (text == 59))
    if not opening.size:
        return opening, opening
    refused = [_NONE]
    line_end = ends[np.searchsorted(ends, opening)]
    closing = np.flatnonzero(text == 41)
    stop = line_end
    if closing.size:
        nearest = np.append(closing, len(text))[np.searchsorted(closing, opening)]
        stop = np.where((text[opening] == 40) & (nearest < line_end), nearest + 1, line_end)
    if (opening[1:] < stop[:-1]).any():
        real, inner, last = [], [], 0
        for i, (first, to) in enumerate(zip(opening.tolist(), stop.tolist(), strict=True)):
            if first >= last:
                real.append(i)
                last = to
                if rules.inner_brackets and i + 1 < len(opening) and opening[i + 1] < to:
                    together = _TOGETHER.match(text[first : line_end[i]].tobytes())
                    stop[i] = last = to if together is None else first + together.end()
            elif text[opening[real[-1]]] == 40 and text[first] == 40:
                inner.append(first)
        opening, stop = opening[real], stop[real]
        if not rules.nested_comments:
            refused.append(np.array(inner, np.int64))
    if not rules.brackets:
        refused.append(opening[text[opening] == 40])
    if not rules.open_comments:
        refused.append(opening[(text[opening] == 40) & (text[stop - 1] != 41)])
    lengths = np.zeros(2 * len(opening) + 1, np.int64)
    lengths[1::2] = stop - opening
    lengths[2:-1:2] = opening[1:] - stop[:-1]
    lengths[0] = opening[0]
    lengths[-1] = len(text) - stop[-1]
    comment = np.zeros(2 * len(opening) + 1, bool)
    comment[1::2] = True
    inside = np.repeat(comment, lengths)
    inside &= text != 10
    keep[inside] = False
    return opening, np.concatenate(refused)


def _misplaced(body: Bytes, begin: Index, stop: Index, letter: Bytes) -> Index:
    """Positions of anything that is not part of a word; `body` ends with an added line end."""
    alphabetic = (letter - np.uint8(65)) < 26
    symbols = body[:-1]
    separators = np.count_nonzero((symbols == 44) | (symbols == 47))
    others = len(symbols) - np.count_nonzero((symbols == 32) | (symbols == 10)) - int((stop - begin).sum())
    if alphabetic.all() and not separators and len(begin) == others:
        return np.zeros(0, np.int64)
    number = (symbols - np.uint8(43)) < 15
    is_letter = ((symbols & np.uint8(0xDF)) - np.uint8(65)) < 26
    followed = np.append(number[1:], False)
    wrong = ~number & (symbols != 10) & (symbols != 32) & ~(is_letter & followed)
    wrong |= (symbols == 44) | (symbols == 47)
    return np.concatenate((np.flatnonzero(wrong), begin[~alphabetic]))


def numbers(
    compact: Bytes, body: Bytes, begin: Index, stop: Index
) -> tuple[Index, npt.NDArray[np.int8], Mask, Index]:
    """Mantissa, decimals, has-a-point and the indices of malformed numbers, eight digits at a time."""
    count = len(begin)
    if not count:
        return np.zeros(0, np.int64), np.zeros(0, np.int8), np.zeros(0, bool), np.zeros(0, np.int64)
    first = body[begin]
    negative = first == 45
    signed = negative | (first == 43)
    digits = begin + signed
    point, pointed, dots = _points(body, begin, stop)
    whole = point - digits
    fraction = np.maximum(stop - point - 1, 0)
    signs = np.count_nonzero((body == 43) | (body == 45))
    suspects = np.zeros(0, np.int64)
    if np.count_nonzero(pointed) != dots or np.count_nonzero(signed) != signs:
        suspects = np.arange(count)
    else:
        suspects = np.flatnonzero((whole > 8) | (fraction > 8) | (whole + fraction == 0))
    # window[i] holds the eight bytes before position i of `body`
    window = np.ndarray((len(compact) - 7,), "<u8", compact.data, 0, (1,))
    value = _seven_digits(window[stop], whole, fraction, pointed)
    long = np.flatnonzero(whole + fraction > 7)
    if long.size:
        places = np.minimum(fraction[long], 8)
        value[long] = _eight_digits(window[point[long]], np.minimum(whole[long], 8)) * _POW10[places]
        value[long] += _eight_digits(window[stop[long]], places)
    mantissa = np.where(negative, -value, value)
    decimals = fraction.astype(np.int8)
    malformed = []
    for i in suspects.tolist():
        parsed = slow_number(bytes(body[begin[i] : stop[i]]))
        if parsed is None:
            malformed.append(i)
        else:
            mantissa[i], decimals[i] = parsed
    return mantissa, decimals, pointed, np.array(malformed, np.int64)


def _points(body: Bytes, begin: Index, stop: Index) -> tuple[Index, Mask, int]:
    """(n,) where the first decimal point of each number is, its end where it has none; whether it has one;
    and the number of points in the text."""
    is_point, begins = body == 46, np.zeros(len(body), bool)
    begins[begin] = True
    # what comes behind a begin is a point, or the next begin
    marks = np.flatnonzero(is_point | begins)
    behind = np.append(marks, len(body) + 1)[np.flatnonzero(begins[marks]) + 1]
    nearest = np.where(is_point[begin], begin, behind)
    pointed = nearest < stop
    return np.where(pointed, nearest, stop), pointed, int(np.count_nonzero(is_point))


def _seven_digits(window: npt.NDArray[np.uint64], whole: Index, fraction: Index, pointed: Mask) -> Index:
    """The numbers without their points at the ends of eight-byte windows, of up to seven digits in all."""
    behind = _HIGH.take(fraction, mode="clip")
    # the digits before a point go in its place
    moved = window << (pointed.view(np.uint8).astype(np.uint64) << _U(3))
    return _eight_digits((window & behind) | (moved & ~behind), whole + fraction)


def _eight_digits(window: npt.NDArray[np.uint64], count: Index) -> Index:
    """The last `count` ASCII digits of each eight-byte window as integers, by multiply and shift."""
    x = (window ^ _U(0x3030303030303030)) & _HIGH.take(count, mode="clip")
    x = x * _U(10) + (x >> _U(8))
    low = (x & _U(0x000000FF000000FF)) * _U(0x000F424000000064)
    high = ((x >> _U(16)) & _U(0x000000FF000000FF)) * _U(0x0000271000000001)
    return ((low + high) >> _U(32)).astype(np.int64)


def slow_number(text: bytes) -> tuple[int, int] | None:
    """One number of any length; None where it is not one. Beyond 18 digits the last ones are dropped."""
    body = text[1:] if text[:1] in b"+-" else text
    whole, _, fraction = body.partition(b".")
    if not (whole + fraction).isdigit():
        return None
    whole = whole.lstrip(b"0")
    if len(whole) > 12:
        return None
    fraction = fraction[: 18 - len(whole)]
    value = int((whole + fraction) or b"0")
    return (-value if text[:1] == b"-" else value), len(fraction)
