"""All that is refused in a program: read it, note the refusal, mend the text there, and read on.

Three repairs let the reading go on with as little harm as possible. A work offset, tool or stylus that is not
defined is defined. A start position that is not known is set to zero. Any other refused statement is taken
out: its bytes become blanks, so that lines keep their numbers. In blocks of words the refused G or M word
goes alone, and an arc becomes straight, so that positions remain. Refusals that may be there only because of
a repair say so.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

from olp.core.errors import ProgramError, Reason, Refused
from olp.core.machine import ZERO, Setup, Tool, WorkOffset
from olp.findings.catalogue import RULES
from olp.program.dialect import Dialect, Options
from olp.program.foreign import recognised
from olp.program.program import Program
from olp.program.registry import read

#: Gives the file of a subprogram by its name, None where there is none.
Subprograms = Callable[[str], bytes | None]

#: Most readings of one text; each finds at least one refusal, most find all of a kind.
READINGS = 40
#: Most bytes that are read in all: eight readings of a text of 100 kB.
BYTES = 800_000
#: Least number of readings of a long text.
LEAST_READINGS = 3
#: Most characters of a statement that are shown.
SHOWN = 60

_LINE_END = re.compile(rb"\r\n|\n|\r")
_NO_LINE_END = re.compile(rb"[^\r\n]")
#: Most blocks of an unrolling that is tried; a longer one counts as one that helps.
UNROLLED = 20_000
TOO_LONG = "OLP543"
#: Its repair is a start position.
UNKNOWN_POSITION = "OLP524"
#: Its repair is a straight move.
ARC = "OLP530"
#: What is taken out with it states nothing.
COMMENT = "OLP514"


def read_all(
    data: bytes,
    setup: Setup,
    dialect: Dialect,
    options: Options | None = None,
    *,
    words: bool = True,
    subprograms: Subprograms | None = None,
) -> Program:
    """As `olp.program.registry.read`, and a refusal has all reasons; `subprograms` gives the file of one for
    unrolling, if that would help. Raises Refused where there are several, ProgramError where there is one."""
    try:
        return read(data, setup, dialect, options, words=words)
    except ProgramError as error:
        certain = dialect.sign is not None or setup.job.described is not None
        other = recognised(data, languages=not certain)
        if other is not None:
            raise other from None
        raise refused(data, setup, dialect, options or Options(), error, subprograms) from None


def refused(
    data: bytes,
    setup: Setup,
    dialect: Dialect,
    options: Options,
    first: ProgramError,
    subprograms: Subprograms | None = None,
) -> ProgramError:
    """All that is refused in a program whose reading ended with the error `first`."""
    if first.line is None:
        return first
    survey = _Survey(data, setup, dialect, options)
    complete = survey.run(first)
    survey.judge_hints(subprograms)
    reasons = survey.reasons()
    return first if len(reasons) == 1 and complete else Refused(reasons, complete=complete)


@dataclass(slots=True, eq=False)
class _Survey:
    """The text with its repairs, and what was refused in it."""

    data: bytes
    setup: Setup
    dialect: Dialect
    options: Options
    #: refusals by line and message, each with the line that it may follow from
    errors: dict[tuple[int, str], tuple[ProgramError, int | None]] = field(default_factory=dict)
    #: lines whose statements were taken out, in order
    taken: list[int] = field(default_factory=list)
    #: the lines of the text with their ends, as they are and with the repairs
    whole: list[bytes] = field(init=False)
    lines: list[bytes] = field(init=False)

    def __post_init__(self) -> None:
        ends = [match.end() for match in _LINE_END.finditer(self.data)]
        self.whole = [self.data[a:b] for a, b in pairwise((0, *ends, len(self.data)))]
        self.lines = list(self.whole)

    def run(self, error: ProgramError) -> bool:
        """Read until nothing is refused; False where the survey ends before that."""
        for _ in range(max(LEAST_READINGS, min(READINGS, BYTES // max(len(self.data), 1)))):
            before = (self.setup, list(self.lines))
            # those of one reading do not follow from each other
            taken = sorted(self.taken)
            for each in (error, *error.others):
                self._note(each, taken)
            if (self.setup, self.lines) == before:
                return False
            try:
                read(b"".join(self.lines), self.setup, self.dialect, self.options, words=False)
                return True
            except ProgramError as another:
                error = another
            if error.line is None:
                return False
        return False

    def _note(self, error: ProgramError, taken: list[int]) -> None:
        """Note a refusal, and mend what is refused. `taken` are the lines taken out before this reading."""
        line = error.line or 1
        key = (line, error.message)
        again = key in self.errors
        if not again:
            before = bisect_left(taken, line) if RULES[error.code].follows else 0
            self.errors[key] = (error, taken[before - 1] if before else None)
        if error.missing is not None and not again:
            self.setup = _defined(self.setup, *error.missing)
        elif error.code == UNKNOWN_POSITION and not again and None in self.setup.job.start_mm:
            x, y, z = (0.0 if value is None else value for value in self.setup.job.start_mm)
            self.setup = replace(self.setup, job=replace(self.setup.job, start_mm=(x, y, z)))
        elif line <= len(self.lines):
            self._take_out(error, line - 1, again=again)

    def _take_out(self, error: ProgramError, index: int, *, again: bool) -> None:
        """Blank the word that is refused, or the statement with the lines that it goes on in."""
        if error.code == ARC and not again:
            line = self.lines[index]
            self.lines[index] = self.dialect.straightened(line)
            if self.lines[index] != line:
                return
        if error.code != COMMENT:
            self.taken.append(index + 1)
        if error.word and not again:
            form = rb"(?i)" + error.word[:1].encode() + rb"0*" + re.escape(error.word[1:].encode())
            text = re.sub(form + rb"(?![\d.])", lambda m: b" " * len(m[0]), self.lines[index])
            if text != self.lines[index]:
                self.lines[index] = text
                return
        goes_on = True
        while goes_on and index < len(self.lines):
            goes_on = self.dialect.continues(self.lines[index])
            self.lines[index] = _NO_LINE_END.sub(b" ", self.lines[index])
            index += 1

    def judge_hints(self, subprograms: Subprograms | None) -> None:
        """Replace the hint to unroll a text that cannot be unrolled by the reason for that. The refusals
        without the hint are taken out before."""
        hinted = [error for error, _ in self.errors.values() if error.hint]
        if not hinted or self.dialect.unroller is None:
            return
        text = list(self.whole)
        for error, _ in self.errors.values():
            if not error.hint and error.line is not None and error.line <= len(text):
                text[error.line - 1] = _NO_LINE_END.sub(b" ", text[error.line - 1])
        beside = {} if subprograms is None else {"subprograms": subprograms}
        try:
            self.dialect.unroller(b"".join(text), self.dialect, limit=UNROLLED, **beside)
        except ProgramError as error:
            if error.code == TOO_LONG:
                return
            place = f"line {error.line}" + (f" of {error.file}" if error.file else "")
            instead = f"olp correct --flatten does not unroll it: {place}: {error.message}"
            for each in hinted:
                each.message = each.message.removesuffix(each.hint) + instead
                each.hint = ""

    def reasons(self) -> tuple[Reason, ...]:
        """What was refused, in the order of lines."""
        rows = sorted(self.errors.values(), key=lambda row: row[0].line or 0)
        return tuple(
            Reason(
                line=error.line or 1, code=error.code, message=error.message,
                statement=self._statement(error.line or 1), follows=follows,
            )
            for error, follows in rows
        )  # fmt: skip

    def _statement(self, line: int) -> str:
        text = self.whole[line - 1] if line <= len(self.whole) else b""
        shown = text.strip()[:SHOWN].decode("utf-8", "replace")
        return "".join(c if c.isprintable() else "?" for c in shown)


def _defined(setup: Setup, table: str, name: str) -> Setup:
    """The setup with a work offset, a tool or a stylus of zero length."""
    job = setup.job
    if table == "tools":
        job = replace(job, tools={**job.tools, int(name): Tool(int(name))})
    elif table == "styli":
        job = replace(job, styli={**job.styli, name: ZERO})
    else:
        job = replace(job, work_offsets={**job.work_offsets, name: WorkOffset(name)})
    return replace(setup, job=job)
