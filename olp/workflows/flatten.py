"""A program with its loops, subprograms and expressions unrolled."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from olp.core.errors import UsageError
from olp.core.machine import Setup
from olp.files.sources import Source, Sources
from olp.program.dialect import Dialect
from olp.workflows.session import PathLike, opened


def flatten(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    expand_cycles: bool = False,
) -> bytes:
    """Unroll loops, subprograms, expressions and, with `expand_cycles`, canned cycles into plain blocks. This
    is not lossless."""
    session, source = opened(program, machine, job, "<program>")
    with source.errors("<program>"):
        setup, dialect = session.reading(source)
        return unrolled(session.sources, source, setup, dialect, expand_cycles=expand_cycles)


class Unrolling(Protocol):
    """The options of a verb that may unroll a program first."""

    @property
    def flatten(self) -> bool: ...
    @property
    def expand_cycles(self) -> bool: ...
    @property
    def peck_clearance_mm(self) -> float | None: ...


def as_asked(sources: Sources, program: Source, setup: Setup, dialect: Dialect, options: Unrolling) -> Source:
    """The program, unrolled where the options ask for it. Raises as `unrolled`."""
    if not (options.flatten or options.expand_cycles):
        return program
    text = unrolled(
        sources, program, setup, dialect, expand_cycles=options.expand_cycles,
        peck_clearance_mm=options.peck_clearance_mm,
    )  # fmt: skip
    return program.holding(text)


def unrolled(
    sources: Sources,
    program: Source,
    setup: Setup,
    dialect: Dialect,
    *,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
) -> bytes:
    """The text with loops, subprograms and expressions unrolled; subprograms are searched in its folder.

    With `expand_cycles` canned cycles are written out too. `peck_clearance_mm` is the clearance above the
    last peck, for controls where it is a parameter. Payloads that the job gives by line become comments
    first, as unrolling changes the lines. Raises UsageError for a dialect that has none of them.
    """
    from olp.program.directives import with_payloads

    if dialect.unroller is None:
        raise UsageError(f"{dialect.title} cannot be unrolled; leave --flatten and --expand-cycles out")
    data = with_payloads(program.data, setup.job.payloads, dialect.comment)
    return dialect.unroller(
        data,
        dialect,
        subprograms=beside(sources, program),
        expand_cycles=expand_cycles,
        peck_clearance=peck_clearance_mm,
    )


def beside(sources: Sources, program: Source) -> Callable[[str], bytes | None]:
    """Gives the file of a subprogram in the folder of the program, None where there is none."""

    def in_folder(wanted: str) -> bytes | None:
        if not program.name:
            return None
        for suffix in ("", ".ngc", ".nc"):
            candidate = Path(program.name).parent / f"{wanted}{suffix}"
            if candidate.is_file():
                return sources.read(candidate)
        return None

    return in_folder
