"""Statements that hand a code to the control or set it up: which of them leave the path as it is.

PREFUN/n is Gn and AUXFUN/n is Mn in the block that the post-processor writes. Both may change what later
points mean, so all that is not known to be harmless is refused.
"""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.program.text.statements import Statement, shown

#: Gn that leave positions of absolute points in the present frame as they are
_HARMLESS_G = frozenset((8, 9, 17, 40, 49, 50.1, 60, 61, 62, 63, 64, 80, 90, 94, 95, 96, 97, 98, 99))
#: Gn that select a work offset
_OFFSETS = frozenset((54, 55, 56, 57, 58, 59))
#: Mn that change the tool, so that positions are not known afterwards
_CHANGES_TOOL = frozenset((6,))
#: Mn that call other programs, or move a pallet
_CALLS = frozenset((60, 96, 97, 98, 99))


def numbers_of(statement: Statement) -> list[float]:
    """The numbers among the minor words of a statement."""
    return [f.number[0] / 10.0 ** f.number[1] for f in statement.fields() if f.number is not None]


def check_prefun(statement: Statement, default_offset: str) -> None:
    """Raise ProgramError for a G code that may change what later points mean."""
    codes = numbers_of(statement)
    for code in codes or [float("nan")]:
        if code in _HARMLESS_G or (code in _OFFSETS and default_offset == f"G{code:g}"):
            continue
        if code in _OFFSETS:
            raise ProgramError(
                f"PREFUN/{code:g} selects a work offset, and the job counts from {default_offset}; "
                f'state work_offset = "G{code:g}" in [job_defaults], or send a program for each offset',
                line=statement.line,
                code="OLP523",
            )
        what = f"PREFUN/{code:g}" if code == code else "PREFUN without a number"
        raise ProgramError(
            f"{what} gives the control a G code that may change what later points mean; "
            "take it out, or leave it to the post-processor",
            line=statement.line,
            code="OLP512",
        )


def changes_tool(statement: Statement) -> bool:
    """Whether AUXFUN changes the tool. Raises ProgramError for an M code that runs another program."""
    codes = numbers_of(statement)
    calls = next((c for c in codes if c in _CALLS), None)
    if calls is not None:
        raise ProgramError(
            f"AUXFUN/{calls:g} is M{calls:g}, which calls another program or moves a pallet; "
            "leave it to the post-processor",
            line=statement.line,
            code="OLP512",
        )
    return any(c in _CHANGES_TOOL for c in codes)


def check_set(statement: Statement) -> None:
    """Raise ProgramError for a form of SET that is not of the output of the post-processor alone."""
    fields = [f.text for f in statement.fields()]
    first = fields[0] if fields else b""
    if first == b"MODE" or (first == b"LOCK" and b"OFF" in fields):
        return
    what = {
        b"HOLDER": "puts a head between spindle and tool, whose vector is not known; state the whole vector "
        "as tools.N.gauge_to_tip_mm, and take the statement out",
        b"LOCK": "holds an axis, so that the machine does not go to the points; take it out",
    }.get(first, "is read as SET/MODE only; take it out, or leave it to the post-processor")
    raise ProgramError(f"SET/{shown(first) or 'nothing'} {what}", line=statement.line, code="OLP512")


def check_turn(statement: Statement) -> None:
    """Raise ProgramError for a rotary axis that leaves its zero."""
    numbers = numbers_of(statement)
    if not numbers or any(numbers):
        raise ProgramError(
            f"{shown(statement.head()[1])} turns the part or the head, and where the part is afterwards is "
            "not known; only an angle of 0 is read. Send a program for each position of the part, and state "
            "its frame in the job",
            line=statement.line,
            code="OLP512",
        )
