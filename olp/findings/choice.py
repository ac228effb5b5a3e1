"""Which codes a gate looks for: those that a call selects, less those that it ignores."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.errors import UsageError
from olp.findings.catalogue import GATE_CODES


def chosen(select: Sequence[str], ignore: Sequence[str], among: Sequence[str] = GATE_CODES) -> list[str]:
    """The codes of `among` that begin with one of `select`, or all, less those that begin with one of
    `ignore`. Raises UsageError for text that begins no code, and for codes to select that are not looked
    for."""
    for prefix in (*select, *ignore):
        if not any(code.startswith(prefix.upper()) for code in (*GATE_CODES, *among)):
            raise UsageError(
                f"{prefix!r} is not the code of a finding or the beginning of one; olp explain lists them all"
            )
    wanted, unwanted = (tuple(prefix.upper() for prefix in prefixes) for prefixes in (select, ignore))
    for prefix in wanted:
        if not any(code.startswith(prefix) for code in among):
            raise UsageError(
                f"{prefix} is not looked for on machines with rotary joints; expected codes of "
                f"{', '.join(among)}"
            )
    codes = [code for code in among if not wanted or code.startswith(wanted)]
    return [code for code in codes if not (unwanted and code.startswith(unwanted))]
