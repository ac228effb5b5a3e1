"""A program with its loops, subprograms and expressions unrolled: `flatten`, and what --flatten does."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

from olp.core.errors import ProgramError, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.files.sources import Source, Sources
from olp.program.dialect import Dialect
from olp.program.origin import Origin, Unrolled
from olp.program.survey import Change, Unroll, as_it_is
from olp.workflows.session import PathLike, Session, opened

#: Endings of files of subprograms.
_ENDINGS = ("", ".ngc", ".nc", ".NC", ".h", ".H", ".spf", ".SPF", ".mpf", ".MPF", ".SSB", ".SUB", ".MIN")
#: Digits of O numbers in names of files.
_DIGITS = (1, 4, 5)


def above_zero(options: object, *names: str) -> None:
    """Raise UsageError where one of these options is stated and is no finite number above zero."""
    for name in names:
        value = getattr(options, name)
        if value is not None and not (isinstance(value, numbers.Real) and 0.0 < float(value) < math.inf):
            raise UsageError(f"{name} = {value!r}: expected a finite number above zero")


@dataclass(frozen=True, slots=True, kw_only=True)
class UnrollOptions:
    """The options of every verb that reads a program: `flatten` unrolls loops, subprograms and expressions
    first, `expand_cycles` canned cycles too. `peck_clearance_mm` is the clearance above the last peck, for
    controls where it is a parameter."""

    flatten: bool = False
    expand_cycles: bool = False
    peck_clearance_mm: float | None = None

    @property
    def asked(self) -> bool:
        return self.flatten or self.expand_cycles


#: The options of a program that is read as it is.
AS_IT_IS = UnrollOptions()


def flatten(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    progress: Progress | None = None,
) -> bytes:
    """The text of a program with loops, subprograms, expressions and, with `expand_cycles`, canned cycles
    written out as plain blocks. This is not lossless.

    `peck_clearance_mm` is the clearance above the last peck, for controls where it is a parameter. Raises
    ProgramError with the line of the program, or of the file of a subprogram.
    """
    session, source = opened(program, machine, job, "<program>")
    options = UnrollOptions(flatten=True, expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm)
    return run(session, source, options, progress)


def run(session: Session, program: Source, options: UnrollOptions, progress: Progress | None = None) -> bytes:
    """As `flatten`, in a session."""
    program.load()
    with program.errors("<program>"):
        # a text of its own: what is said of it later has its own lines
        reading = session.reading(program)
        return bytes(as_asked(session.sources, program, *reading, options, tell=progress or silent).data)


def as_asked(
    sources: Sources,
    program: Source,
    setup: Setup,
    dialect: Dialect,
    options: UnrollOptions,
    *,
    block_delete: bool | None = None,
    tell: Progress = silent,
) -> Source:
    """The program, unrolled where the options ask for it and it is not yet. Subprograms are searched in its
    folder. `block_delete` is the position of that switch, None where the result has to be right for both.
    Raises UsageError for a dialect that cannot be unrolled, ProgramError with the line of the original."""
    unroll = unroller(sources, program, setup, dialect, options, block_delete=block_delete, tell=tell)
    return program if unroll is None else program.holding(unroll(as_it_is, None))


def unroller(
    sources: Sources,
    program: Source,
    setup: Setup,
    dialect: Dialect,
    options: UnrollOptions,
    *,
    block_delete: bool | None = None,
    tell: Progress = silent,
) -> Unroll | None:
    """What unrolls the program as in `as_asked`; None where there is nothing to do. `tell` is told how much
    of the work that a run may cause is done.

    Payloads that the job gives by line become comments first, as unrolling changes the lines.
    """
    from olp.program.directives import with_payloads

    if not options.asked or isinstance(program.data, Unrolled):
        return None
    unrolled = dialect.unroller
    if unrolled is None:
        raise UsageError(f"{dialect.title} cannot be unrolled; leave --flatten and --expand-cycles out")
    subprograms = beside(sources, program)

    def unroll(change: Change, limit: int | None) -> Unrolled:
        def changed(wanted: str) -> tuple[str, bytes] | None:
            given = subprograms(wanted)
            return None if given is None else (given[0], _switched(change(*given), setup, dialect))

        given = _switched(change(None, whole(program.data)), setup, dialect)
        text = unrolled(
            with_payloads(given, setup.job.payloads, dialect.comment), dialect.set_as(setup.machine),
            subprograms=changed,
            expand_cycles=options.expand_cycles, block_delete=block_delete,
            peck_clearance=options.peck_clearance_mm, parameters=setup.job.parameters, tell=tell,
            **({} if limit is None else {"limit": limit}),
            **({"setup": setup} if dialect.unrolls_with_tools else {}),
        )  # fmt: skip
        _refuse_payloads_not_reached(setup, text.origin)
        if setup.job.payloads:
            # the comments of payloads are not in the file
            lines = tuple(dialect.lines(given))
            text.origin = replace(text.origin, texts=lines + text.origin.texts[len(lines) :])
        return text

    return unroll


def _switched(text: bytes, setup: Setup, dialect: Dialect) -> bytes:
    """A text as the control runs it with the stated switch of block delete; its lines stay in their places.
    Raises UsageError for dialects in which that is not looked for."""
    if setup.job.block_delete is None:
        return text
    if dialect.skip_mark is None:
        raise UsageError(
            f"block_delete of the job file is not read for {dialect.title}; leave it out, and take the / out"
        )
    left = setup.job.block_delete == "off"
    lines = dialect.lines(text)
    for number, line in enumerate(lines):
        mark = dialect.skip_mark.match(line)
        if mark is not None:
            lines[number] = line[mark.end() :] if left else line[len(line.rstrip(b"\r\n")) :]
    return b"".join(lines)


def beside(sources: Sources, program: Source) -> Callable[[str], tuple[str, bytes] | None]:
    """Gives name and text of the file of a subprogram in the folder of the program, None without one. Its
    name ends as those of subprograms do, or as that of the program."""

    def in_folder(wanted: str) -> tuple[str, bytes] | None:
        if not program.name:
            return None
        number = (wanted, *(f"{o}{wanted.zfill(n)}" for o in "Oo" for n in _DIGITS))
        names = number if wanted.isdigit() else (wanted, f"O{wanted}".upper())
        main = Path(program.name)
        for name, ending in product(names, (*_ENDINGS, main.suffix)):
            candidate = main.parent / f"{name}{ending}"
            if sources.exists(candidate):
                return str(candidate), sources.read(candidate)
        return None

    return in_folder


def _refuse_payloads_not_reached(setup: Setup, origin: Origin) -> None:
    """Raise ProgramError for a payload of the job at a line that the unrolled text does not have."""
    written = set(origin.line.tolist())
    for line in setup.job.payloads:
        if line not in written:
            raise ProgramError(
                "[[payloads]] of the job file names this line, which the unrolled program does not have; "
                "name the line of a block that is executed",
                line=line,
                code="OLP550",
            )
