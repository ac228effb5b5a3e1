"""Programs that keep their loops and subprograms when they are corrected.

The unrolled program is corrected, and its numbers are put into the program itself. What comes out is unrolled
again and proved as any other program.
"""

from __future__ import annotations

from olp.core.arrays import Index
from olp.core.errors import ProgramError, Reason, Refused
from olp.files.sources import Source, Sources
from olp.findings.catalogue import Finding
from olp.program.kept import Kept
from olp.program.origin import Origin, Unrolled
from olp.program.program import Program
from olp.workflows.flatten import AS_IT_IS, UnrollOptions, as_asked
from olp.workflows.session import Loaded

#: Characters of a statement that a reason shows.
_SHOWN = 60
_WAY_ON = "so its loops and subprograms cannot be kept; unroll the program with --flatten"


def unrolled_unasked(program: Source, options: UnrollOptions) -> Unrolled | None:
    """The text of a program that was unrolled only to be read, None for others."""
    data = program.data
    return data if isinstance(data, Unrolled) and not options.asked else None


def with_flow(unrolled: Unrolled, text: bytes, starts: Index, loaded: Loaded) -> Kept:
    """The program that was unrolled, with the corrections of the unrolled `text`, whose lines begin at
    `starts`. Raises ProgramError, or Refused with all the lines whose passes need other numbers."""
    origin, keeper = unrolled.origin, loaded.dialect.keeper
    if keeper is None or loaded.setup.job.payloads:
        raise _refusal(1, "payloads of the job belong to lines that run in turn, " + _WAY_ON, origin)
    kept: Kept = keeper(unrolled, text, starts, loaded.dialect)
    if kept.text is not None:
        return kept
    reasons = []
    for each in kept.differences:
        file, line = origin.file_of(each.line)
        statement = origin.text(each.line).strip()[:_SHOWN]
        message = f"`{statement}` cannot be corrected in its place: {each.why}, {_WAY_ON}"
        reasons.append(Reason(line, "OLP511", message, statement, file=file))
    if len(reasons) == 1:
        raise _refusal(kept.differences[0].line, reasons[0].message, origin)
    raise Refused(tuple(reasons), complete=True)


def _refusal(line: int, message: str, origin: Origin) -> ProgramError:
    file, number = origin.file_of(line)
    return ProgramError(message, file=file, line=number, code="OLP511")


def unrolling_of_corrected(nominal: Program) -> UnrollOptions:
    """How the correction of a program is read: unrolled where that was, as it may have kept its flow."""
    return AS_IT_IS if nominal.origin is None else UnrollOptions(flatten=True)


def unrolled_again(sources: Sources, program: Source, text: bytes, loaded: Loaded) -> Source:
    """A corrected text whose flow was kept, unrolled as the nominal program was."""
    flat = UnrollOptions(flatten=True)
    return as_asked(sources, program.holding(text), loaded.setup, loaded.dialect, flat)


def finding_of(kept: Kept) -> Finding:
    """What is said of a program whose flow was kept; lines are those that the origin counts."""
    what = "loops and subprograms are kept; "
    if kept.repeated:
        what += f"{len(kept.repeated)} corrected lines run more than once, with the same numbers in each pass"
    else:
        what += "no corrected line runs more than once"
    lines = kept.repeated or kept.changed
    return Finding("OLP109", what, lines[0] if lines else None, lines[:10], len(lines))
