"""Line-oriented languages of motion that a file describes: forms of statements, and what each does."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field

from olp.core.values import dataclass
from olp.program.described.forms import Form
from olp.program.dialect import Dialect, Row, Support

_FIELD = re.compile(r"\{\w+\}")
_BEGIN = re.compile(r"<[^<>]+>|[\w.$#%]+")
_NO_DIGITS = str.maketrans("", "", "0123456789.")

#: what a statement may do, and what becomes of it
DOES = {
    "line": (Support.CORRECTED, "a straight move"),
    "rapid": (Support.CORRECTED, "a move whose path is not stated; corrected at its end"),
    "point": (Support.CORRECTED, "a named position; corrected where moves use it"),
    "away": (Support.READ, "moves the machine to a position that the text does not state"),
    "tool": (Support.READ, "the tool from here on"),
    "frame": (Support.READ, "the frame from here on"),
    "unit": (Support.READ, "the unit from here on"),
    "speed": (Support.READ, "the speed from here on, where it is stated in a unit of speed"),
    "section": (Support.READ, "begins or ends a part of the text"),
    "carry": (Support.UNCHANGED, ""),
    "refuse": (Support.REFUSED, ""),
}


@dataclass(frozen=True, slots=True)
class Rule:
    """One form and what its statements do. `inside` is the section where it holds (None: in all), `enters`
    the one that it begins; `frame` and `unit` are fixed by the form where it has no field for them."""

    form: Form
    does: str
    why: str = ""
    inside: str | None = None
    enters: str | None = None
    frame: str | None = None
    unit: str | None = None
    speed_unit: str | None = None
    incremental: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class UserDialect(Dialect):
    """A language that a file describes."""

    statements: tuple[Rule, ...]
    unit: str | None
    speed_unit: str | None = None
    comments: tuple[str, ...] = ()
    quote: str = ""
    continuation: str = ""
    terminator: str = ""
    label: re.Pattern[str] | None = None
    ignore_case: bool = True
    about: str = ""
    by_word: Mapping[str, tuple[Rule, ...]] = field(default_factory=dict)

    @property
    def numbered(self) -> frozenset[str] | None:
        """The first words, without digits, of forms that have digits outside their fields; None where such a
        form may begin with anything. Lines with other first words keep their meaning with other numbers."""
        words: set[str] = set()
        for rule in self.statements:
            text = _FIELD.sub("", rule.form.text)
            if any(letter.isdigit() for letter in text):
                begin = _BEGIN.match(rule.form.text)
                if begin is None:
                    return None
                either = (word.split() or [""] for word in begin[0].strip("<>").split("|"))
                words |= {word.upper().translate(_NO_DIGITS) for word, *_ in either}
        return frozenset(words)

    def comment_marks(self) -> tuple[tuple[bytes, bytes], ...]:
        return tuple((mark.encode(), b"") for mark in self.comments)

    def continues(self, line: bytes) -> bool:
        return bool(self.continuation) and line.rstrip().endswith(self.continuation.encode())

    def rows(self) -> Sequence[Row]:
        rows = []
        for rule in self.statements:
            support, usual = DOES[rule.does]
            where = f" (in {rule.inside})" if rule.inside else ""
            rows.append(Row(rule.form.text + where, support, rule.why or usual))
        return [*rows, Row("any other statement", Support.REFUSED, "it may move the machine")]
