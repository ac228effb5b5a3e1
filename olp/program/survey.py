"""All that is refused in a program: read it, note the refusal, mend the text there, and read on.

Three repairs let the reading go on with as little harm as possible. A work offset, tool or stylus that is not
defined is defined. A start position that is not known is set to zero. Any other refused statement is taken
out: its bytes become blanks, so that lines keep their numbers. In blocks of words the refused G or M word
goes alone, and an arc becomes straight, so that positions remain. Refusals that may be there only because of
a repair say so.

A program that is to be unrolled is mended in its own lines, and in those of the files of its subprograms,
and is unrolled again for each reading.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import field, replace
from typing import Any

from olp.core.errors import ConfigError, ProgramError, Reason, Refused
from olp.core.machine import ZERO, Setup, Tool, WorkOffset
from olp.core.patterns import pattern
from olp.core.spool import Text, whole
from olp.core.values import dataclass
from olp.findings.catalogue import RULES
from olp.program.dialect import Dialect, Options
from olp.program.origin import Unrolled
from olp.program.program import Program
from olp.program.registry import read

#: Gives name and text of the file of a subprogram by its name, None where there is none.
Subprograms = Callable[[str], tuple[str, bytes] | None]
#: Gives the text that is taken instead of the one of a file; of the program where it has no name.
Change = Callable[[str | None, bytes], bytes]
#: Unrolls a program with its texts changed, in so many bytes of visited blocks (None: as many as usual).
Unroll = Callable[[Change, int | None], Unrolled]
#: A file, "" for the program, and a line of it from 1.
_Place = tuple[str, int]

#: Most readings of one text; each finds at least one refusal, most find all of a kind.
READINGS = 40
#: Most bytes that are read in all: eight readings of a text of 100 kB.
BYTES = 800_000
#: What an unrolling counts as beside the bytes of its text.
REFUSED_BYTES = BYTES // 20
#: Least number of readings of a long text.
LEAST_READINGS = 3
#: Most characters of a statement that are shown.
SHOWN = 60

#: A number behind its letter; that of an expression goes with its whole block.
_NUMBER = rb"[ \t]*[-+]?[ \t]*[\d.]+"
_NO_LINE_END = pattern(rb"[^\r\n]")
#: Most bytes of visited blocks of an unrolling that is tried; a longer one counts as one that helps.
UNROLLED = 1_000_000
TOO_LONG = "OLP543"
#: Nothing behind it can be read.
BROKEN = "OLP506"
#: Its repair is a start position.
UNKNOWN_POSITION = "OLP524"
#: Its repair is a straight move.
ARC = "OLP530"
#: What is taken out with it states nothing.
COMMENT = "OLP514"
#: Instead of the hint to unroll, of a word that an unrolled program still has.
_KEPT = "--flatten does not unroll it"
#: What to do about such a word, where nothing else is known of it.
_PLAIN_BLOCKS = "write plain blocks"


#: Bytes of a file that show whether it is a text.
_HEAD = 1024
#: A text has fewer zero bytes than one in so many; in UTF-16 it is every second one.
_ZERO_SHARE = 4


def as_it_is(file: str | None, text: bytes) -> bytes:
    """Changes nothing."""
    return text


def read_all(
    data: Text,
    setup: Setup,
    dialect: Dialect,
    options: Options | None = None,
    *,
    words: bool = True,
    subprograms: Subprograms | None = None,
    unroll: Unroll | None = None,
    expands: bool = False,
    early: bool = False,
) -> Program:
    """As `olp.program.registry.read`, and a refusal has all reasons. With `unroll` the program is unrolled
    first, and lines are those of the original; `expands` says that its canned cycles are plain moves then.
    With `early` a first refusal that unrolling may help with is raised without the others.
    Else `subprograms` gives the file of one, to see whether unrolling would help. Raises Refused where there
    are several reasons, ProgramError where there is one."""
    options = options or Options()
    try:
        text = data if unroll is None else unroll(as_it_is, None)
        program = read(text, setup, dialect, options, words=words)
        _refuse_foreign(data, program)
        return program
    except ProgramError as error:
        if early and unroll is None and error.hinted:
            raise
        from olp.program.foreign import recognised

        certain = dialect.signs.own is not None or setup.job.described is not None
        other = recognised(whole(data), languages=not certain, own=dialect.languages)
        if other is not None:
            raise other from None
        # an unrolled text has no statements of its own
        if error.line is None or isinstance(data, Unrolled):
            raise
        survey = _Survey(whole(data), setup, dialect, options, unroll)
        if survey.ran_long(error):
            raise
        if unroll is not None and not expands:
            plain = _plain(replace(survey, unroll=None))
            if plain is not None:
                raise plain from None
        complete = survey.run(error)
        if unroll is None:
            survey.judge_hints(subprograms)
        raise survey.error(complete=complete) from None


def _refuse_foreign(data: Text, program: Program) -> None:
    """Raise ProgramError for a file of another kind that happens to be readable.

    It has no move, as a document that begins with %. Or it has bytes of no text, as UTF-16 without its mark.
    """
    head = data[:_HEAD]
    if not len(program.toolpath) or head.count(b"\0") * _ZERO_SHARE > len(head):
        from olp.program.foreign import recognised

        other = recognised(whole(data), languages=False, own=program.dialect.languages)
        if other is not None:
            raise other


def _plain(survey: _Survey) -> ProgramError | None:
    """All that is refused in a program that needs no unrolling, the same as without; None for others."""
    error = survey.reading()
    if error is None or error.line is None:
        return None
    complete = survey.run(error)
    return None if survey.hinted() else survey.error(complete=complete)


@dataclass(slots=True, eq=False)
class _Survey:
    """The texts with their repairs, and what was refused in them; texts are by file, "" for the program."""

    data: bytes
    setup: Setup
    dialect: Dialect
    options: Options
    unroll: Unroll | None = None
    #: refusals by place and message, each with the place that it may follow from
    errors: dict[tuple[_Place, str], tuple[ProgramError, _Place | None]] = field(init=False)
    #: where statements were taken out
    taken: list[_Place] = field(init=False)
    #: the lines of the texts with their ends, as they are and with the repairs
    whole: dict[str, list[bytes]] = field(init=False)
    lines: dict[str, list[bytes]] = field(init=False)
    #: bytes that were read
    spent: int = field(init=False)

    def __post_init__(self) -> None:
        self.errors, self.taken, self.whole, self.lines, self.spent = {}, [], {}, {}, 0
        self._mended(None, self.data)

    def _mended(self, file: str | None, text: bytes) -> bytes:
        """A text with its repairs."""
        name = file or ""
        if name not in self.lines:
            self.whole[name] = self.dialect.lines(text)
            self.lines[name] = list(self.whole[name])
        return b"".join(self.lines[name])

    def reading(self) -> ProgramError | None:
        """Read the text with its repairs; why it is refused. What is wrong in the files of the setup, or in
        their repairs, has no line."""
        try:
            text = self._mended(None, self.data)
            if self.unroll is not None:
                # one that is refused may have run long
                self.spent += REFUSED_BYTES
                text = self.unroll(self._mended, UNROLLED)
            self.spent += len(text)
            read(text, self.setup, self.dialect, self.options, words=False)
        except ProgramError as error:
            return error
        except ConfigError as error:
            return ProgramError(str(error), code="OLP500")
        return None

    def run(self, error: ProgramError | None) -> bool:
        """Read until nothing is refused; False where the survey ends before that."""
        if error is not None and (error.file or "") not in self.lines:
            # the file of a subprogram has been read when the program is unrolled from here
            again = self.reading()
            error = error if again is None or self.ran_long(again) else again
        before_all, most = self.spent, BYTES - len(self.data)
        for reading in range(READINGS):
            if error is None:
                return True
            if reading >= LEAST_READINGS and self.spent - before_all > most:
                return False
            before = (self.setup, {file: list(lines) for file, lines in self.lines.items()})
            # those of one reading do not follow from each other
            taken = sorted(self.taken)
            for each in (error, *error.others):
                known = self.setup.job.start_mm != before[0].job.start_mm
                # with the start known since, it may not be refused; if it is, the next reading finds it
                if not (known and each.code == UNKNOWN_POSITION):
                    self._note(each, taken)
            if (self.setup, self.lines) == before:
                return False
            error = self.reading()
            if error is not None and (error.line is None or self.ran_long(error)):
                return False
        return error is None

    def ran_long(self, error: ProgramError) -> bool:
        """Whether unrolling ended at its limit, or the text is not whole; there is nothing to mend then."""
        return error.code == BROKEN or (self.unroll is not None and error.code == TOO_LONG)

    def _note(self, error: ProgramError, taken: list[_Place]) -> None:
        """Note a refusal, and mend what is refused. `taken` is where statements were taken out before this
        reading."""
        place = (error.file or "", error.line or 1)
        key = (place, error.message)
        again = key in self.errors
        follows = RULES[error.code].follows
        if self.unroll is not None and error.hint:
            _without_hint(error, _kept(error))
        # the rest of a block without its refused word is refused only because of that
        if not again and not (follows and place in taken):
            before = bisect_left(taken, place) if follows else 0
            self.errors[key] = (error, taken[before - 1] if before else None)
        if error.missing is not None and not again:
            self.setup = _defined(self.setup, *error.missing)
        elif error.code == UNKNOWN_POSITION and not again and None in self.setup.job.start_mm:
            x, y, z = (0.0 if value is None else value for value in self.setup.job.start_mm)
            self.setup = replace(self.setup, job=replace(self.setup.job, start_mm=(x, y, z)))
        elif place[0] in self.lines and place[1] <= len(self.lines[place[0]]):
            self._take_out(error, place, again=again)

    def _take_out(self, error: ProgramError, place: _Place, *, again: bool) -> None:
        """Blank the word that is refused, or the statement with the lines that it goes on in."""
        lines, index = self.lines[place[0]], place[1] - 1
        if error.code == ARC and not again:
            line = lines[index]
            lines[index] = self.dialect.straightened(line)
            if lines[index] != line:
                return
        if error.code != COMMENT:
            self.taken.append(place)
        if error.word and not again:
            text = _form(error.word).sub(lambda m: b" " * len(m[0]), lines[index])
            if text != lines[index]:
                lines[index] = text
                return
        goes_on = True
        while goes_on and index < len(lines):
            goes_on = self.dialect.continues(lines[index])
            lines[index] = _NO_LINE_END.sub(b" ", lines[index])
            index += 1

    def hinted(self) -> list[ProgramError]:
        """The refusals that unrolling may help with."""
        return [error for error, _ in self.errors.values() if error.hint]

    def judge_hints(self, subprograms: Subprograms | None) -> None:
        """Replace the hint to unroll what cannot be unrolled by the reason for that. The refusals without the
        hint are taken out before, but for those that may follow from others."""
        hinted = self.hinted()
        if not hinted or self.dialect.unroller is None:
            return
        text = list(self.whole[""])
        for error, follows in self.errors.values():
            if not error.hint and not follows and error.line is not None and error.line <= len(text):
                text[error.line - 1] = _NO_LINE_END.sub(b" ", text[error.line - 1])
        beside: dict[str, Any] = {} if subprograms is None else {"subprograms": subprograms}
        if self.dialect.unrolls_with_tools:
            beside["setup"] = self.setup
        try:
            unrolled = self.dialect.unroller(
                b"".join(text), self.dialect.set_as(self.setup.machine), limit=UNROLLED,
                parameters=self.setup.job.parameters, **beside,
            )  # fmt: skip
        except ProgramError as error:
            if error.code == TOO_LONG:
                return
            place = f"line {error.line}" + (f" of {error.file}" if error.file else "")
            instead = f"--flatten does not unroll it: {place}: {error.message}"
            for each in hinted:
                _without_hint(each, instead)
            return
        kept = list(zip(unrolled.origin.line.tolist(), self.dialect.lines(unrolled), strict=True))
        for each in hinted:
            if each.word and any(
                line == each.line and _form(each.word).search(block) for line, block in kept
            ):
                _without_hint(each, _kept(each))

    def error(self, *, complete: bool) -> ProgramError:
        """What was refused, in the order of lines; a single refusal as it is."""
        rows = sorted(self.errors.items(), key=lambda row: row[0][0])
        if len(rows) == 1 and complete:
            return rows[0][1][0]
        reasons = tuple(
            Reason(
                line=place[1], code=error.code, message=error.message, statement=self._statement(place),
                follows=follows[1] if follows else None, file=place[0] or None,
                follows_file=follows[0] or None if follows else None,
            )
            for (place, _), (error, follows) in rows
        )  # fmt: skip
        return Refused(reasons, complete=complete)

    def _statement(self, place: _Place) -> str:
        lines, line = self.whole.get(place[0], []), place[1]
        text = lines[line - 1] if line <= len(lines) else b""
        shown = text.strip()[:SHOWN].decode("utf-8", "replace")
        return "".join(c if c.isprintable() else "?" for c in shown)


#: brackets of a call, with those inside of them
_BRACKETS = rb"\((?:[^()\n]|\([^()\n]*\))*\)"
#: what a word of a name has behind it: a value, or the brackets of a call
_BEHIND = rb"(?:[ \t]*(?:=[ \t]*[^\s(]*(?:" + _BRACKETS + rb")?|" + _BRACKETS + rb"))?"


def _form(word: str) -> re.Pattern[bytes]:
    """How a word is written, such as G068 for G68; of a letter alone with any number."""
    number = rb"0*" + re.escape(word[1:].encode()) + rb"(?![\d.])" + _BEHIND
    return re.compile(rb"(?i)" + word[:1].encode() + (number if word[1:] else _NUMBER))


def _kept(error: ProgramError) -> str:
    return f"{_KEPT}; {error.instead or _PLAIN_BLOCKS}"


def _without_hint(error: ProgramError, instead: str) -> None:
    error.message, error.hint = error.message.removesuffix(error.hint) + instead, ""


def _defined(setup: Setup, table: str, name: str) -> Setup:
    """The setup with a work offset, a tool or a stylus of zero length."""
    job = setup.job
    if table == "tools":
        job = replace(job, tools={**job.tools, int(name): Tool(int(name))})
    elif table == "tool_names":
        number = max((*job.tools, *setup.machine.tools), default=0) + 1
        job = replace(job, tools={**job.tools, number: Tool(number, name=name)})
    elif table == "styli":
        job = replace(job, styli={**job.styli, name: ZERO})
    else:
        job = replace(job, work_offsets={**job.work_offsets, name: WorkOffset(name)})
    return replace(setup, job=job)
