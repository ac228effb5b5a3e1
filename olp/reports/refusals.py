"""Refused statements as text: by code, with what to do, and each statement with its line and reason."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from olp.core.errors import Reason
from olp.findings.catalogue import RULES
from olp.reports.report import WIDTH, printable

#: Most reasons of a kind that are written out.
_WRITTEN = 6
#: Most lines of the others that are named.
_LINES = 12


def refusals_text(rows: Sequence[Mapping[str, Any]], *, complete: bool) -> Iterator[str]:
    """Lines on the reasons of a refusal in the form of `olp.workflows.refusals.parts_of`, by code."""
    reasons = [Reason(**{k: v for k, v in row.items() if k != "remedy"}) for row in rows]
    yield f"Refused ({'' if complete else 'at least '}{len(reasons)}), explained by olp explain CODE"
    for code in dict.fromkeys(reason.code for reason in reasons):
        mine = [reason for reason in reasons if reason.code == code]
        yield f"  {code}  {RULES[code].title} ({len(mine)})"
        for kind in dict.fromkeys(reason.kind for reason in mine):
            yield from _alike([reason for reason in mine if reason.kind == kind])
        yield from _wrapped(f"What to do: {RULES[code].remedy}", 10)


def _alike(reasons: Sequence[Reason]) -> Iterator[str]:
    """Reasons of one kind: the first ones in full, then the lines of the others."""
    for reason in reasons[:_WRITTEN]:
        of = f" of {reason.file}" if reason.file else ""
        place = "" if reason.line is None else f"line {reason.line}{of}: "
        known = not reason.statement or f"`{reason.statement[:20]}" in reason.message
        statement = "" if known else f"`{reason.statement}`: "
        yield from _wrapped(f"{place}{statement}{reason.sentence}", 6)
    others = reasons[_WRITTEN:]
    if others:
        shown = ", ".join(str(reason.line) for reason in others[:_LINES])
        more = f" and {len(others) - _LINES} others" if len(others) > _LINES else ""
        yield from _wrapped(f"and the same in line{'s' if len(others) > 1 else ''} {shown}{more}", 6)


def _wrapped(text: str, indent: int) -> list[str]:
    return textwrap.wrap(printable(text), WIDTH, initial_indent=" " * indent, subsequent_indent=" " * 10)
