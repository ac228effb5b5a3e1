"""Every exception that `olp` raises.

    OlpError
    ├── UsageError             the call itself is wrong                        exit 2
    ├── InputError             a file is unreadable, invalid or refused        exit 3
    │   ├── ConfigError        machine, calibration or job file
    │   ├── ProgramError       a program, with its line
    │   │   ├── Refused        for several reasons, each with its line
    │   │   └── AlreadyCorrected
    │   ├── OutsideBox         a command leaves the calibrated volume
    │   └── Doubtful           inputs that are not plausible, and are not accepted
    └── CannotCompute          good input, no answer                           exit 4
        └── NotInvertible

Each holds its data and builds its message in `__str__`, as
`file:line: what is wrong; what was expected; what to do`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator

from olp.core.patterns import pattern
from olp.core.values import dataclass

#: What a message states of its statement: quoted text, and numbers.
_OWN = pattern(r"`[^`]*`|'[^']*'|-?\d+(?:\.\d+)?")

#: Exit code of an interrupted run, as shells report it.
INTERRUPTED = 130


class OlpError(Exception):
    """Base of all errors of `olp`; `exit_code` is the status of the command line."""

    exit_code = 4

    def __init__(self, message: str, *, file: str | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line) if part is not None)
        return f"{place}: {self.message}" if place else self.message

    def in_file(self, file: str) -> OlpError:
        """Name the file, unless one is named already; returns the same error for `raise`."""
        if self.file is None:
            self.file = file
        return self


class UsageError(OlpError):
    """The call is wrong: an option that does not exist, a missing argument."""

    exit_code = 2


class InputError(OlpError):
    """A file cannot be read, is invalid, or is refused."""

    exit_code = 3


class ConfigError(InputError):
    """A machine, calibration or job file is invalid; `problems` lists every one of them."""

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        problems: tuple[str, ...] = (),
    ) -> None:
        super().__init__(message, file=file, line=line)
        self.problems = problems or (message,)

    def __str__(self) -> str:
        prefix = f"{self.file}: " if self.file else ""
        return "\n".join(prefix + problem for problem in self.problems)


class ProgramError(InputError):
    """A program is refused; `line` counts from 1 in the source file.

    `code` says why, as a row of `olp.findings.codes.refusal`. `others` are refusals of other lines that were
    found at the same time. `missing` is the table and the name of what machine and job do not define, such
    as ("tools", "7"). `hint` is the end of the message: what to do, where that may not help; `instead` is
    what to do where it does not.
    `word` is the word of a block that is refused, such as "G68", where the rest of the block could be read;
    of other words than G and M the letter.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        code: str = "OLP500",
        others: tuple[ProgramError, ...] = (),
        missing: tuple[str, str] | None = None,
        hint: str = "",
        instead: str = "",
        word: str = "",
    ) -> None:
        super().__init__(f"{message}; {hint}" if hint else message, file=file, line=line)
        self.code = code
        self.others = others
        self.missing = missing
        self.hint = hint
        self.instead = instead
        self.word = word

    @property
    def hinted(self) -> bool:
        """Whether it, or another that was found with it, has a hint."""
        return any(error.hint for error in (self, *self.others))

    @staticmethod
    def together(errors: Iterable[ProgramError]) -> ProgramError:
        """Refusals that were found at the same time, as the one of the first line with the others."""
        first, *others = sorted(errors, key=lambda error: error.line or 0)
        first.others = tuple(others)
        return first


@dataclass(frozen=True, slots=True)
class Reason:
    """Why one statement is refused; `statement` is its text, shortened. It `follows` perhaps from what was
    refused in that line, else None. The lines are those of `file` and `follows_file`, files of subprograms
    that were unrolled; None is the program itself."""

    line: int | None
    code: str
    message: str
    statement: str
    follows: int | None = None
    file: str | None = None
    follows_file: str | None = None

    @property
    def sentence(self) -> str:
        """The message, and what it may follow from."""
        if self.follows is None:
            return self.message
        apart = self.follows_file != self.file
        there = f" of {self.follows_file or 'the program'}" if apart else ""
        return f"{self.message} (it may follow from line {self.follows}{there})"

    @property
    def kind(self) -> tuple[str | None, str, str, bool]:
        """What reasons that are alike have in common: all but the text and the numbers of the statement."""
        return self.file, self.code, _OWN.sub("", self.message), self.follows is None


class Refused(ProgramError):
    """A program is refused for several `reasons`, in the order of lines; there may be more where they are not
    `complete`."""

    #: Reasons that the message lists.
    LISTED = 20

    def __init__(self, reasons: tuple[Reason, ...], *, complete: bool) -> None:
        first = reasons[0]
        super().__init__(first.message, file=first.file, line=first.line, code=first.code)
        self.reasons = reasons
        self.complete = complete

    def __str__(self) -> str:
        lines = []
        for reason in self.reasons[: self.LISTED]:
            file = reason.file or self.file
            lines.append(f"{f'{file}:' if file else ''}{reason.line}: {reason.sentence}")
        more = len(self.reasons) - self.LISTED
        place = f"{self.file}: " if self.file else ""
        if more > 0:
            least = "" if self.complete else "at least "
            lines.append(f"{place}{least}{more} more statements are refused; olp inspect lists them")
        elif not self.complete:
            lines.append(f"{place}more statements may be refused; correct these first")
        return "\n".join(lines)


class AlreadyCorrected(ProgramError):
    """The program has the stamp of an earlier correction."""


class OutsideBox(InputError):
    """A corrected command leaves the calibrated box."""


class Doubtful(InputError):
    """Inputs are not plausible; `problems` has one sentence of each doubt, `codes` the codes that accept
    them."""

    def __init__(self, problems: tuple[str, ...], codes: tuple[str, ...]) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems
        self.codes = codes

    def __str__(self) -> str:
        prefix = f"{self.file}: " if self.file else ""
        return "\n".join(prefix + problem for problem in self.problems)


class CannotCompute(OlpError):
    """The input is good and there is no answer."""


class NotInvertible(CannotCompute):
    """No command reaches the target within 1e-9 mm: the error grows as fast as the position. `rows` are those
    of such targets where there are several; `row` is the first one."""

    rows: tuple[int, ...] = ()

    @property
    def row(self) -> int | None:
        return self.rows[0] if self.rows else None


@contextlib.contextmanager
def naming(file: str) -> Iterator[None]:
    """Errors that have a line but no file get this file; with "" they are unchanged."""
    try:
        yield
    except OlpError as error:
        raise (error.in_file(file) if file and error.line is not None else error) from None
