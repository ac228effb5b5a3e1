"""How a call ends where it does not end well: lines on stderr and an exit code, never a traceback."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import click

from olp.cli.common import diagnostic, silence
from olp.core.errors import INTERRUPTED, OlpError, ProgramError, Reason, Refused

#: Exit code of a run that no error of ours ended: a defect, too little memory, a system that refuses.
UNEXPECTED = 4
#: Where this variable of the environment is set, a defect also shows its traceback.
TRACEBACK = "OLP_TRACEBACK"
#: what the loader of libraries says where memory is short
_NO_ROOM = ("failed to map segment", "annot allocate memory")
#: letters of the text of an exception that is not ours
_MOST_LETTERS = 200


@contextlib.contextmanager
def with_exit_code(words: Sequence[str]) -> Iterator[None]:
    """Turns every exception of a call with these words into its lines and `click.exceptions.Exit`. Those by
    which click ends a call are unchanged."""
    try:
        yield
    except (click.ClickException, click.exceptions.Exit, click.Abort):
        raise
    except OlpError as error:
        show_error(str(error))
        _show_remedies(error)
        raise click.exceptions.Exit(error.exit_code) from None
    except KeyboardInterrupt:
        diagnostic("olp: interrupted")
        raise click.exceptions.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        # The reader of stdout has closed it, such as `head`: no error.
        silence(sys.stdout)
        raise click.exceptions.Exit(0) from None
    except MemoryError as error:
        _let_go(error)
        _end_memory(words)
    except ImportError as error:
        # a library that finds no room to be loaded
        if not any(sign in str(error) for sign in _NO_ROOM):
            _end_defect(words, error)
        _end_memory(words)
    except OSError as error:
        if error.errno == errno.ENOMEM:
            _end_memory(words)
        if error.strerror is None:
            _end_defect(words, error)
        if error.filename is not None:
            _end(f"{error.filename!s}: cannot be used ({error.strerror}); name another file", UNEXPECTED)
        silence(sys.stdout)
        _end(f"the system refuses ({error.strerror}); check where the output goes", UNEXPECTED)
    except Exception as error:
        _end_defect(words, error)


def _let_go(error: BaseException | None) -> None:
    """Clear the calls that an error ended, and those of the errors before it: they hold what filled the
    memory."""
    while error is not None:
        call = error.__traceback__
        while call is not None:
            with contextlib.suppress(RuntimeError):  # one that still runs
                call.tb_frame.clear()
            call = call.tb_next
        error = error.__context__


def keep_streams() -> None:
    """Take the numbers of closed streams, so that no file that is opened later is written as stdout."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # the lowest free number is given
            os.open(os.devnull, os.O_RDWR)


def show_error(message: str) -> None:
    """Write the lines of an error to stderr."""
    for line in message.split("\n"):
        diagnostic(f"olp: error: {line}")


def _show_remedies(error: OlpError) -> None:
    """What to do about statements that are refused, once per code, where no sentence says it."""
    reasons = error.reasons[: Refused.LISTED] if isinstance(error, Refused) else (error,)
    codes = dict.fromkeys(
        reason.code
        for reason in reasons
        if isinstance(reason, ProgramError | Reason) and ";" not in reason.message
    )
    if codes:
        from olp.findings.catalogue import RULES

        for code in codes:
            diagnostic(f"olp: what to do ({code}): {RULES[code].remedy}")


def _end(message: str, code: int) -> NoReturn:
    show_error(message)
    raise click.exceptions.Exit(code) from None


def _end_memory(words: Sequence[str]) -> NoReturn:
    _end(_headed(words, "needs more memory than there is; give a smaller file, or part of it"), UNEXPECTED)


def _end_defect(words: Sequence[str], error: Exception) -> NoReturn:
    """One sentence: what happened and where, whose fault it is, and what to send."""
    import traceback

    if os.environ.get(TRACEBACK):
        diagnostic("".join(traceback.format_exception(error)).rstrip())
    text = " ".join(str(error).split())[:_MOST_LETTERS]
    what = f"{type(error).__name__}: {text}" if text else type(error).__name__
    _end(
        _headed(
            words,
            f"this is a defect of olp, not of your files ({what}, in {_place(error)}); send this line, the "
            f"call and its files to those who keep olp; {TRACEBACK}=1 in the environment shows more",
        ),
        UNEXPECTED,
    )


def _place(error: BaseException) -> str:
    """The innermost line of ours, such as `cli/correct.py:120`."""
    import traceback

    ours = Path(__file__).parents[1]
    places = [
        f"{Path(frame.filename).relative_to(ours).as_posix()}:{frame.lineno}"
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).is_relative_to(ours)
    ]
    return places[-1] if places else "an unknown place"


def _headed(words: Sequence[str], message: str) -> str:
    """The message with the first file that the call names."""
    for word in words:
        with contextlib.suppress(OSError, ValueError):
            if Path(word).is_file():
                return f"{word}: {message}"
    return message
