"""Lines of a parametric program: one line of bytes compiled to words, assignments and a flow statement.

Blanks mean nothing, also inside numbers; `(...)` and `;` start comments. Every word keeps its position
in the bytes, so that a line is written back by splicing values into it.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.rs274.block_text import CLOSED_TOGETHER, PRINTS
from olp.program.rs274.flatten.expressions import Expression, Parameters, Reader, plain_number
from olp.program.rs274.flatten.language import Language

_SKIP = re.compile(CLOSED_TOGETHER.decode() + r"|\([^)]*\)?|;.*|[\x00-\x20]+")
_PRINTS = re.compile(PRINTS)
_LETTER = re.compile(r",?[a-z@^$]")
_LITERAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
_PLAIN_END = re.compile(r"[a-z@^$,]|$|#")
_LABEL = re.compile(r"\d+|<[^>]*>")
_KEYWORD = re.compile(
    r"endsub|sub|call|return|elseif|else|endif|if|endwhile|while|do|endrepeat|repeat|break|continue"
)
#: characters of a text that a message shows, and of a label at most
_SHOWN = 60
_LONGEST_LABEL = 250
_WITH_VALUE = frozenset({"if", "elseif", "while", "repeat"})


@dataclass(frozen=True, slots=True)
class Word:
    """A letter and its value. `value` is None for a plain number, which `number` gives.

    `start`, `value_start` and `end` are positions in the raw line. `pointed`: the plain number has a point.
    """

    letter: str
    number: float
    value: Expression | None
    pointed: bool
    start: int
    value_start: int
    end: int


@dataclass(frozen=True, slots=True)
class Assignment:
    """`#n = value`; `target` gives the number or the name."""

    target: Callable[[Parameters], int | str]
    value: Expression
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Flow:
    """A statement that controls the run. `label` is "" where an expression (`dynamic`) gives it.

    Keywords are those of LinuxCNC's O-words, "program" for a header such as O1234, and of Macro B
    "when-goto", "when-then", "while-do", "do", "end" and "goto". Those of user tasks are "jump", "call-task",
    with the `names` of its arguments, and "rts".
    """

    keyword: str
    label: str
    dynamic: Expression | None = None
    values: tuple[Expression, ...] = ()
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Line:
    """One source line; `number` counts from 1. `opaque` lines hold something that is not understood.
    `label` is the number or name behind N of a user task. One that `prints` writes to a file."""

    number: int
    raw: bytes
    eol: bytes
    percent: bool = False
    deleted: bool = False
    opaque: bool = False
    prints: bool = False
    words: tuple[Word, ...] = ()
    assignments: tuple[Assignment, ...] = ()
    flow: Flow | None = None
    label: str = ""
    comments: tuple[bytes, ...] = ()

    @property
    def plain(self) -> bool:
        """True where the line has no variable, so that its bytes can be copied."""
        return not self.assignments and all(word.value is None for word in self.words)


def compile_line(line: bytes, number: int, language: Language) -> Line:
    """Compile one line with its end. Raises ProgramError (without a line) for a broken expression."""
    raw = line.rstrip(b"\r\n")
    eol = line[len(raw) :]
    printed = _PRINTS.fullmatch(raw) if language.macro_b else None
    if printed is not None:
        start, end = printed.span("n")
        n = (Word("n", float(printed["n"]), None, False, start - 1, start, end),) if start >= 0 else ()
        return Line(number, raw, eol, prints=True, words=n)
    text, places, comments = compact(raw)
    if text.startswith("%"):
        return Line(number, raw, eol, percent=True)
    if language.macro_b and text.startswith(":") and text[1:].isdigit():
        # another way to write the number of a program
        text = "o" + text[1:]
    start = 0
    deleted = text.startswith("/")
    if deleted:
        start = 2 if text[1:2].isdigit() and text[2:3] else 1
    try:
        return _compile(_Source(number, raw, eol, text, places, deleted, comments), start, language)
    except ProgramError:
        if "#" in text or "[" in text or text[start : start + 1] == "o":
            raise
        return Line(number, raw, eol, deleted=deleted, opaque=True, comments=comments)


@dataclass(frozen=True, slots=True)
class _Source:
    number: int
    raw: bytes
    eol: bytes
    text: str
    places: list[int]
    deleted: bool
    comments: tuple[bytes, ...]


def compact(raw: bytes, *, keep_blanks: bool = False) -> tuple[str, list[int], tuple[bytes, ...]]:
    """Lower-case text without blanks and comments, the positions of its characters, and the comments. A blank
    between letters or digits stays one where they are kept."""
    # Latin-1 keeps one character per byte, also in lower case.
    source = raw.decode("latin-1")
    pieces: list[str] = []
    places: list[int] = []
    comments: list[bytes] = []
    done = 0
    for match in _SKIP.finditer(source):
        pieces.append(source[done : match.start()])
        places.extend(range(done, match.start()))
        done = match.end()
        if keep_blanks and _between(source, match.start(), done):
            pieces.append(" ")
            places.append(match.start())
        if match.group()[0] in "(;":
            comments.append(raw[match.start() : match.end()])
    pieces.append(source[done:])
    places.extend(range(done, len(source)))
    return "".join(pieces).lower(), places, tuple(comments)


def _between(source: str, start: int, end: int) -> bool:
    """Whether letters or digits are on both sides."""
    return source[max(start - 1, 0) : start].isalnum() and source[end : end + 1].isalnum()


def _compile(source: _Source, begin: int, language: Language) -> Line:
    text = source.text
    reader = Reader(text, language.arithmetic, begin)
    words: list[Word] = []
    assignments: list[Assignment] = []
    flow: Flow | None = None
    while reader.position < len(text):
        start = reader.position
        first = all(word.letter == "n" for word in words) and not assignments
        if text[start] == "#":
            assignments.append(_assignment(reader, source.places, language))
            continue
        if first and text[start] == "o":
            flow = _o_word(reader)
        elif first and language.macro_b:
            flow = _macro_b(reader, assignments, source.places, language)
        if flow is not None:
            if reader.position < len(text):
                rest = text[reader.position : reader.position + _SHOWN]
                raise ProgramError(
                    f"{_written(flow)} is followed by {rest!r}, which is not understood; put it into a block "
                    "of its own",
                    code="OLP510",
                )
            break
        words.append(_word(reader, source.places, language))
    return Line(
        source.number, source.raw, source.eol, deleted=source.deleted, words=tuple(words),
        assignments=tuple(assignments), flow=flow, comments=source.comments,
    )  # fmt: skip


def _written(flow: Flow) -> str:
    """The last word of a statement, as programs write it."""
    return flow.keyword.rsplit("-", 1)[-1].upper()


def _word(reader: Reader, places: list[int], language: Language) -> Word:
    text, start = reader.text, reader.position
    letter = _LETTER.match(text, start)
    if letter is None:
        raise ProgramError(f"expected a word at {text[start : start + 12]!r}", code="OLP510")
    value_start = letter.end()
    literal = _LITERAL.match(text, value_start)
    if literal and _PLAIN_END.match(text, literal.end()):
        number, value, pointed = plain_number(literal.group()), None, "." in literal.group()
        reader.position = literal.end()
    else:
        reader.position = value_start
        number, value, pointed = 0.0, reader.value(), False
        written = text[value_start : reader.position]
        if language.rounds_words and ("round[" in written or "rnd[" in written):
            raise ProgramError(
                "ROUND inside a word rounds to the least increment, which is not known here; "
                "assign the rounded value to a variable first",
                code="OLP541",
            )
    return Word(
        letter.group(),
        number,
        value,
        pointed,
        places[start],
        places[value_start],
        places[reader.position - 1] + 1,
    )


def _assignment(reader: Reader, places: list[int], language: Language) -> Assignment:
    start = reader.position
    target = reader.parameter_index()
    if not reader.text.startswith("=", reader.position):
        raise ProgramError("a parameter without '=' is where a word is expected", code="OLP510")
    reader.position += 1
    value = reader.unbracketed() if language.macro_b else reader.value()
    return Assignment(target, value, places[start], places[reader.position - 1] + 1)


def _o_word(reader: Reader) -> Flow:
    text = reader.text
    reader.position += 1
    dynamic: Expression | None = None
    label = ""
    static = _LABEL.match(text, reader.position)
    if static:
        label = static.group().strip("<>")
        if static.group()[0] != "<":
            label = label.lstrip("0") or "0"
        reader.position = static.end()
        if len(label) > _LONGEST_LABEL:
            raise ProgramError(
                f"a label has {len(label)} characters; expected at most {_LONGEST_LABEL}", code="OLP505"
            )
    else:
        dynamic = reader.value()
    keyword = _KEYWORD.match(text, reader.position)
    if keyword is None:
        if reader.position < len(text) or not label.isdigit():
            raise ProgramError(
                f"O-word without a known keyword at {text[reader.position : reader.position + 12]!r}",
                code="OLP542",
            )
        return Flow("program", label)
    reader.position = keyword.end()
    values: list[Expression] = []
    while text.startswith("[", reader.position):
        values.append(reader.bracket())
    name = keyword.group()
    if name in _WITH_VALUE and len(values) != 1:
        raise ProgramError(
            f"O-word {name.upper()} has {len(values)} values; expected one [expression]", code="OLP542"
        )
    if dynamic is not None and name != "call":
        raise ProgramError(
            f"O-word {name.upper()} has a computed label; only CALL may have one", code="OLP542"
        )
    return Flow(name, label, dynamic, tuple(values))


def _macro_b(
    reader: Reader, assignments: list[Assignment], places: list[int], language: Language
) -> Flow | None:
    text, start = reader.text, reader.position
    if text.startswith("if[", start):
        reader.position += 2
        condition = reader.bracket()
        if text.startswith("goto", reader.position):
            reader.position += 4
            return Flow("when-goto", "", None, (condition, reader.value()))
        if text.startswith("then", reader.position):
            reader.position += 4
            while text.startswith("#", reader.position):
                assignments.append(_assignment(reader, places, language))
            return Flow("when-then", "", None, (condition,))
        raise ProgramError("IF is followed by neither GOTO nor THEN", code="OLP510")
    loops = ("while[", "wh[") if reader.arithmetic.two_letters else ("while[",)
    if text.startswith(loops, start):
        reader.position = text.index("[", start)
        condition = reader.bracket()
        if not text.startswith("do", reader.position):
            raise ProgramError("WHILE is not followed by DO", code="OLP542")
        reader.position += 2
        return Flow("while-do", _number_label(reader), None, (condition,))
    for keyword in ("goto", "do", "end"):
        if text.startswith(keyword, start):
            reader.position += len(keyword)
            if keyword == "goto":
                return Flow("goto", "", None, (reader.value(),))
            return Flow(keyword, _number_label(reader))
    return None


def _number_label(reader: Reader) -> str:
    number = reader.number()
    if number is None:
        raise ProgramError("DO and END take a plain number", code="OLP542")
    return str(int(number))
