"""Arcs of programs of statements: centres, radii and angles, and the later parts of arcs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from olp.compensation.arc_centres import Arc, solve
from olp.compensation.point_writer import FINE_DECIMALS, PointWriter
from olp.compensation.rows import Rows
from olp.core.geometry import PLANES
from olp.program.program import ArcText
from olp.program.text.edits import BARE, EditList, Edits
from olp.program.text.numbers import MOST_DECIMALS

#: pieces of one inserted statement at the most, for their order among insertions at one position
ROW = 64


def arc_edits(writer: PointWriter, rows: Rows) -> list[Edits]:
    """Centres, radii and angles of arcs, and the later parts of arcs."""
    if not rows.arc.any():
        return []
    edits = EditList(writer.prefixes)
    arcs = solve(writer, rows)
    frame = writer.path.frame[arcs.move]
    centres = writer.local(arcs.centre, frame).tolist()
    units, fewest = writer.frame_unit_mm[frame].tolist(), writer.fewest[frame].tolist()
    for i in range(len(arcs.row)):
        arc = arcs.one(i)
        text = writer.statements.arcs[arc.move]
        changes = _arc_words(writer, arc, text, centres[i], units[i], fewest[i])
        if rows.head[arc.row]:
            for word, mantissa, decimals in changes:
                _replace(writer, word, mantissa, decimals, edits)
            if text.long is not None and abs(arc.sweep) <= np.pi:
                edits.add(*text.long, BARE, 0)
        else:
            _arc_again(writer, rows, arc, text, changes, edits)
    return [edits.done()]


def _arc_words(
    writer: PointWriter, arc: Arc, text: ArcText, number: list[float], unit: float, fewest: list[int]
) -> list[tuple[int, int, int]]:
    """(word, mantissa, decimals) of all words of an arc beside its end; `number` is its centre in the
    program's numbers."""
    changes = [
        _rounded(writer, word, number[axis], fewest[axis] + 1)
        for words in text.centres
        for axis, word in enumerate(words)
    ]
    if text.radius >= 0:
        a, b = PLANES[arc.plane][:2]
        away = (arc.start - arc.centre).tolist()
        changes.append(_rounded(writer, text.radius, math.hypot(away[a], away[b]) / unit, max(fewest) + 1))
    if text.angle >= 0:
        changes.append(_rounded(writer, text.angle, math.degrees(abs(_sweep(arc))), FINE_DECIMALS))
    return changes


def _sweep(arc: Arc) -> float:
    """The angle between the ends of an arc as they are written."""
    a, b = PLANES[arc.plane][:2]
    first, last = (arc.start - arc.centre).tolist(), (arc.end - arc.centre).tolist()
    angle = math.atan2(last[b], last[a]) - math.atan2(first[b], first[a])
    return angle + 2 * math.pi * round((arc.sweep - angle) / (2 * math.pi))


def _rounded(writer: PointWriter, word: int, value: float, fewest: int) -> tuple[int, int, int]:
    decimals = min(max(int(writer.words.decimals[word]), fewest), MOST_DECIMALS)
    return word, round(value * 10**decimals), decimals


def _replace(writer: PointWriter, word: int, mantissa: int, decimals: int, edits: EditList) -> None:
    own = int(writer.words.decimals[word])
    stated = int(writer.words.mantissa[word])
    same = stated * 10 ** (decimals - own) if decimals >= own else round(stated / 10 ** (own - decimals))
    if same != mantissa:
        prefix = writer.statements.broken.get(word, b"")
        edits.add(int(writer.words.number[word]), int(writer.words.end[word]), mantissa, decimals, prefix)
        writer.tally.changed_words += 1


def _arc_again(
    writer: PointWriter,
    rows: Rows,
    arc: Arc,
    text: ArcText,
    changes: Sequence[tuple[int, int, int]],
    edits: EditList,
) -> None:
    """A later part: the words of the arc and of its end once more, with other numbers."""
    eol = writer.program.eol(arc.line)
    numbers = {word: (mantissa, decimals) for word, mantissa, decimals in changes}
    slot = writer.program.slot[arc.move].tolist()
    end = {
        word: (int(rows.mantissa[arc.row, axis]), int(rows.decimals[arc.row, axis]))
        for axis, word in enumerate(slot)
    }
    if text.direction:
        numbers |= _direction(writer, arc, text)
    place = int(writer.statements.end[arc.move])
    order = arc.row * ROW
    spans = [(text.begin, text.end, numbers | (end if text.whole else {}))]
    long = text.long if abs(arc.sweep) <= np.pi else None
    if not text.whole:
        begin, stop = int(writer.statements.begin[arc.move]), int(writer.statements.end[arc.move])
        spans.append((begin, stop, end))
    for begin, stop, values in spans:
        order = _again(writer, begin, stop, values, long, place, eol, order, edits)
    writer.tally.inserted_blocks += 1


def _again(
    writer: PointWriter, begin: int, stop: int, values: dict[int, tuple[int, int]],
    long: tuple[int, int] | None, place: int, eol: bytes, order: int, edits: EditList,
) -> int:  # fmt: skip
    """Bytes once more, with other numbers in place of some words. A comment at the end is left out, and
    what is `long`."""
    position, lead = begin, eol
    for word in sorted(values, key=lambda w: int(writer.words.number[w])):
        start = int(writer.words.number[word])
        if long is not None and position <= long[0] < start:
            lead += writer.program.data[position : long[0]] + writer.program.data[long[1] : start]
        else:
            lead += writer.program.data[position:start]
        edits.add(place, place, *values[word], lead, order)
        position, lead, order = int(writer.words.end[word]), b"", order + 1
    trail = writer.program.data[position:stop]
    comment = trail.rfind(b"$$")
    if comment >= 0 and b"\n" not in trail[comment:]:
        trail = trail[:comment].rstrip()
    edits.add(place, place, BARE, 0, trail, order)
    return order + 1


def _direction(writer: PointWriter, arc: Arc, text: ArcText) -> dict[int, tuple[int, int]]:
    """The direction in which a part of an arc begins."""
    first, second = PLANES[arc.plane][:2]
    tangent = np.zeros(3)
    away = arc.start - arc.centre
    tangent[first], tangent[second] = -away[second] * np.sign(arc.sweep), away[first] * np.sign(arc.sweep)
    tangent /= np.linalg.norm(tangent)
    if writer.turn is not None:
        tangent = tangent @ writer.turn[int(writer.path.frame[arc.move])]
    return {
        word: (round(float(tangent[axis]) * 10**FINE_DECIMALS), FINE_DECIMALS)
        for axis, word in enumerate(text.direction)
    }
