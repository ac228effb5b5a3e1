"""Every exception that `olp` raises.

    OlpError
    ├── UsageError             the call itself is wrong                        exit 2
    ├── InputError             a file is unreadable, invalid or refused        exit 3
    │   ├── ConfigError        machine, calibration or job file
    │   ├── ProgramError       a program, with its line
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
from collections.abc import Iterator

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
    """A program is refused; `line` counts from 1 in the source file."""


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
    """No command reaches the target within 1e-9 mm: the error grows as fast as the position."""


@contextlib.contextmanager
def naming(file: str) -> Iterator[None]:
    """Errors that have a line but no file get this file; with "" they are unchanged."""
    try:
        yield
    except OlpError as error:
        raise (error.in_file(file) if file and error.line is not None else error) from None
