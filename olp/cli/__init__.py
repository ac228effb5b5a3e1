"""The command line: one module per verb, imported when that verb is called.

Every exception becomes `olp: error: ...` on stderr and an exit code in `endings`, and nowhere else.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import IO, Any

import click

from olp.cli.common import diagnostic
from olp.cli.endings import with_exit_code
from olp.cli.late import LateGroup
from olp.core.patterns import pattern
from olp.core.version import __version__

#: Verb to what it does. Kept here so that `olp --help` imports no verb.
VERBS = {
    "init": "Write the first files of a new machine into a folder.",
    "inspect": "Show what a program does, or what a machine's calibration holds.",
    "correct": "Correct a program with the machine's calibrated errors, and prove it.",
    "batch": "Correct all programs of folders; do again what changes, release, judge releases.",
    "results": "Correct what a measuring machine reported.",
    "verify": "Prove a corrected program from the nominal and the corrected text alone.",
    "simulate": "Write the path that the machine would take with its errors, as CSV.",
    "flatten": "Write a program with its loops, subprograms and expressions unrolled.",
    "retime": "Re-time a program within the limits of the axes, and say how long it takes.",
    "check": "Check whether a program may run on the machine: findings, for people and pipelines.",
    "view": "Show a job in the browser: paths, enlarged errors, time, program text.",
    "compare": "Compare measured runs with a nominal path: deviations, ISO 9283 figures.",
    "calibrate": "Make a calibration from measurements; read and write the tables of controls.",
    "schema": "Write the JSON Schema of a file that people write.",
    "explain": "Explain the code of a finding or a term, or list all codes.",
    "help": "Show the documentation on a topic, or answer a question.",
}

#: What click says of words that a verb does not take.
_EXTRA = pattern(r"Got unexpected extra arguments? \((.*)\)")
#: What click says of an option with fewer values than it takes.
_FEW = pattern(r"requires (an|\d+) arguments?\.$")
#: How alike an option is that may have been meant, from 0 to 1.
_NEAR = 0.75
#: Key under which a call keeps its words.
_WORDS = "olp.words"

# Read when numpy is imported, which a verb does. The matrices here are 3 x 3: threads for them would only
# spin.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


class _WrongCall(click.UsageError):
    """A call that click refuses: its usage, then what is wrong, headed as the errors of `olp` are."""

    def show(self, file: IO[Any] | None = None) -> None:
        if self.ctx is not None:
            diagnostic(f"{self.ctx.get_usage()}\nTry '{self.ctx.command_path} --help' for help.\n")
        diagnostic(f"olp: error: {self.message}")


@contextlib.contextmanager
def _wrong_calls() -> Iterator[None]:
    try:
        yield
    except click.UsageError as error:
        # A group without a verb shows its help, which click raises as an error of its own.
        if type(error).show is not click.UsageError.show:
            raise
        raise _WrongCall(_plain(error), error.ctx) from None


def _plain(error: click.UsageError) -> str:
    """The message of click in the words of the others: what is wrong, and what to do."""
    message = error.format_message()
    path = "olp" if error.ctx is None else error.ctx.command_path
    takes = [] if error.ctx is None else [name for p in error.ctx.command.params for name in p.opts]
    if isinstance(error, click.NoSuchOption):
        wanted = error.option_name.replace("_", "-")
        import difflib

        near = difflib.get_close_matches(wanted, takes, 1, _NEAR)
        hint = f"did you mean {near[0]}?" if near else f"{path} --help lists the options"
        if near and not near[0].startswith("-"):
            hint = f"it goes without one: {path} {_usage(error.ctx)}"
        return f"there is no option {error.option_name}; {hint}"
    if isinstance(error, click.BadOptionUsage) and (short := _FEW.search(message)):
        if short[1] == "an":
            return f"the option {error.option_name} needs a value after it; give one, or leave the option out"
        return f"the option {error.option_name} needs {short[1]} values after it; --help says which"
    if isinstance(error, click.MissingParameter) and error.param is not None:
        return f"{_spelled(error.param)} is missing; expected {path} {_usage(error.ctx)}"
    extra = _EXTRA.match(message)
    if extra is None:
        return message
    words = extra[1]
    if words.startswith("/"):
        return f"{words} is one word too many; options begin with - or --, as in -q"
    files = "; name the machine file with -m, and the job file with -j" if "--machine" in takes else ""
    return f"{words} is one word too many{files or f'; {path} --help says what it takes'}"


def _spelled(parameter: click.Parameter) -> str:
    """A parameter as a call writes it, such as NOMINAL or -o FOLDER."""
    names = "" if isinstance(parameter, click.Argument) else f"{parameter.opts[0]} "
    return f"{names}{parameter.metavar or (parameter.name or '').upper()}"


def _usage(context: click.Context | None) -> str:
    """The arguments of a verb, and the options that it cannot do without."""
    parameters = [] if context is None else context.command.params
    return " ".join(_spelled(p) for p in sorted(parameters, key=lambda p: p.param_type_name) if p.required)


class _Verbs(LateGroup):
    """The verbs; every exception ends in its lines and an exit code."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        words = tuple(args)
        with with_exit_code(words), _wrong_calls():
            context = super().make_context(info_name, args, parent, **extra)
        context.meta[_WORDS] = words
        return context

    def invoke(self, ctx: click.Context) -> object:
        with with_exit_code(ctx.meta[_WORDS]), _wrong_calls():
            return super().invoke(ctx)


_HELP = """Corrects off-line programs of machines with three linear axes by the machine's calibrated errors.

The result goes to stdout, messages to stderr; - is stdin or stdout. No file is overwritten without --force.

\b
Exit codes: 0 good; 1 findings at or above --fail-on; 2 wrong call; 3 input unreadable or refused;
4 cannot be computed, or a defect of olp; 130 interrupted."""

main = _Verbs(
    VERBS,
    "olp.cli.{}",
    name="olp",
    help=_HELP,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    subcommand_metavar="VERB ...",
)
main = click.version_option(__version__, prog_name="olp")(main)
