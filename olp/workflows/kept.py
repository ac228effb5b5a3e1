"""Programs that keep their loops and subprograms when they are corrected.

The unrolled program is corrected, and its numbers are put into the program itself. What comes out is unrolled
again and proved as any other program.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from olp.core.arrays import Index
from olp.core.errors import ProgramError, Reason, Refused
from olp.core.progress import Progress
from olp.core.spool import Text
from olp.core.values import dataclass
from olp.files.sources import Source, Sources
from olp.findings.catalogue import Finding
from olp.program.kept import Kept
from olp.program.origin import Origin, Unrolled
from olp.program.program import Program
from olp.workflows.flatten import AS_IT_IS, UnrollOptions, as_asked
from olp.workflows.session import Loaded

#: Lines that a finding names.
_LINES = 10
#: Characters of a statement that a reason shows.
_SHOWN = 60
_UNROLL = "unroll the program with --flatten"
#: The code of a program that is not proved with its flow kept.
NOT_PROVED = "OLP511"
_WAY_ON = f"so its loops and subprograms cannot be kept; {_UNROLL}"


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """How the flow of a program was kept. `kept` is None where nothing was left to keep, as all `calls` are
    written out; these are lines of the program. `outer` is the program with them, None where there are
    none."""

    kept: Kept | None
    outer: Unrolled | None = None
    calls: tuple[int, ...] = ()


def unrolled_unasked(program: Source, options: UnrollOptions) -> Unrolled | None:
    """The text of a program that was unrolled only to be read, None for others."""
    data = program.data
    return data if isinstance(data, Unrolled) and not options.asked else None


def with_flow(unrolled: Unrolled, text: bytes, starts: Index, loaded: Loaded) -> Kept:
    """The program that was unrolled, with the corrections of the unrolled `text`, whose lines begin at
    `starts`. Raises ProgramError where the dialect keeps none."""
    origin, keeper = unrolled.origin, loaded.dialect.keeper
    if keeper is None or loaded.setup.job.payloads:
        raise _refusal(1, "payloads of the job belong to lines that run in turn, " + _WAY_ON, origin)
    kept: Kept = keeper(unrolled, text, starts, loaded.dialect)
    return kept


def refused(kept: Kept, origin: Origin) -> ProgramError:
    """Why a program cannot keep its flow: all the lines whose passes need other numbers."""
    reasons = []
    for each in kept.differences:
        file, line = origin.file_of(each.line)
        statement = origin.text(each.line).strip()[:_SHOWN]
        message = f"`{statement}` cannot be corrected in its place: {each.why}, {_WAY_ON}"
        reasons.append(Reason(line, "OLP511", message, statement, file=file))
    if len(reasons) == 1:
        return _refusal(kept.differences[0].line, reasons[0].message, origin)
    return Refused(tuple(reasons), complete=True)


def _refusal(line: int, message: str, origin: Origin) -> ProgramError:
    file, number = origin.file_of(line)
    return ProgramError(message, file=file, line=number, code="OLP511")


def unrolling_of_corrected(nominal: Program) -> UnrollOptions:
    """How the correction of a program is read: unrolled where that was, as it may have kept its flow."""
    return AS_IT_IS if nominal.origin is None else UnrollOptions(flatten=True)


def unrolled_again(sources: Sources, program: Source, text: Text, loaded: Loaded, tell: Progress) -> Source:
    """A corrected text whose flow was kept, unrolled as the nominal program was."""
    flat = UnrollOptions(flatten=True)
    return as_asked(sources, program.holding(text), loaded.setup, loaded.dialect, flat, tell=tell)


@contextmanager
def provably_kept() -> Iterator[None]:
    """Why a program that kept its flow is not proved, with the way on. A block that the control refuses once
    corrected has its own way, and unrolling is none."""
    try:
        yield
    except ProgramError as error:
        if error.code == "OLP561":
            raise
        why = f"with its loops and subprograms kept the program is not proved ({error.message}); {_UNROLL}"
        raise ProgramError(why, line=error.line or 1, code=NOT_PROVED) from None


def through(unrolled: Unrolled, outer: Unrolled) -> Unrolled:
    """A text that was unrolled from `outer`, with the lines of the program that `outer` was made from."""
    return Unrolled.of(unrolled, unrolled.origin.through(outer.origin), unrolled.within)


def findings_of(flow: Flow) -> tuple[Finding, ...]:
    """What is said of a program whose flow was kept, in lines that its origin counts."""
    found: list[Finding] = []
    if flow.calls:
        count = len(flow.calls)
        which = "a block is" if count == 1 else f"{count} blocks are"
        what = f"{which} written out: calls that need other numbers than the others, or moves of the control"
        found.append(Finding("OLP110", what, flow.calls[0], flow.calls[:_LINES], len(flow.calls)))
    if flow.kept is None:
        return tuple(found)
    what = "loops and subprograms are kept; "
    if flow.kept.repeated:
        count = len(flow.kept.repeated)
        what += f"{count} corrected lines run more than once, with the same numbers in each pass"
    else:
        what += "no corrected line runs more than once"
    lines = flow.kept.repeated or flow.kept.changed
    if flow.outer is not None:
        lines = tuple(flow.outer.origin.lines_of(lines).tolist())
    return (*found, Finding("OLP109", what, lines[0] if lines else None, lines[:_LINES], len(lines)))
