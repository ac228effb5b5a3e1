"""What the reading of a program of statements says, as plain values that can be compared."""

from __future__ import annotations

from typing import Any

from olp.program.program import Program


def word_of(program: Program, index: int) -> tuple[bytes, float, bool] | None:
    """A word: its bytes, its value, and whether it has a point; None for none."""
    words = program.words
    assert words is not None
    if index < 0:
        return None
    text = program.data[int(words.start[index]) : int(words.end[index])]
    return text, int(words.mantissa[index]) / 10.0 ** int(words.decimals[index]), bool(words.pointed[index])


def text_of(program: Program, begin: int, end: int) -> bytes:
    """The bytes of a program from `begin` to `end`; empty where these are -1."""
    return program.data[begin:end] if begin >= 0 else b""


def arc_of(program: Program, move: int) -> dict[str, Any]:
    """What states an arc of a program of statements, as the texts of its parts."""
    assert program.statements is not None
    arc = program.statements.arcs[move]

    def texts(words: tuple[int, ...]) -> list[bytes]:
        return [word[0] for word in (word_of(program, w) for w in words) if word is not None]

    return {
        "text": program.data[arc.begin : arc.end],
        "centres": [texts(centre) for centre in arc.centres],
        "radius": texts((arc.radius,)),
        "angle": texts((arc.angle,)),
        "direction": texts(arc.direction),
        "whole": arc.whole,
        "long": None if arc.long is None else program.data[slice(*arc.long)],
    }


def feeds_of(program: Program) -> list[tuple[int, int, bytes | None]]:
    """Of each stated feed: its first move, its line, and its number as written."""
    assert program.statements is not None
    feeds = program.statements.feeds
    words = [word_of(program, w) for w in feeds.word.tolist()]
    texts = [None if word is None else word[0] for word in words]
    return list(zip(feeds.move.tolist(), feeds.line.tolist(), texts, strict=True))


def said(program: Program) -> dict[str, Any]:
    """All that a reading says, with each word as its text."""
    path, statements = program.toolpath, program.statements
    assert statements is not None
    bounds = zip(statements.begin.tolist(), statements.end.tolist(), strict=True)
    arcs = path.arcs
    return {
        "kind": path.kind.tolist(),
        "flag": path.flag.tolist(),
        "line": path.line.tolist(),
        "frame": [path.frames[k] for k in path.frame.tolist()],
        "end": [repr(row) for row in path.end_mm.tolist()],
        "start": repr(path.start_mm),
        "slot": [[word_of(program, w) for w in row] for row in program.slot.tolist()],
        "text": [text_of(program, a, b) for a, b in bounds],
        "arcs": [
            column.tolist() for column in (arcs.move, arcs.centre_mm, arcs.plane, arcs.sweep_rad)
        ],
        "arc text": {move: arc_of(program, move) for move in statements.arcs},
        "feed": repr(statements.feed_mm_s.tolist()),
        "feeds": feeds_of(program),
        "rest": statements.rest.tolist(),
        "dwell": statements.dwell_s.tolist(),
        "strokes": statements.strokes.tolist(),
        "broken": sorted((word_of(program, w), mark) for w, mark in statements.broken.items()),
        "lines": [program.text(n + 1) for n in range(program.lines)],
        "remarks": program.remarks,
        "rest of it": (
            program.end_line, statements.rapid, statements.cards, statements.mark, statements.width
        ),
    }  # fmt: skip
