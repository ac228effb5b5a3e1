"""All dialects, which of them a text is written in, and the one way to read any of them.

A new dialect is a value in `DIALECTS` and a reader in `READERS`; how it may be told from others by its text
stands in `_SIGNS`, by its file's ending in `_ENDINGS`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from olp.core.errors import ProgramError, UsageError
from olp.core.machine import Setup
from olp.program.apt import reader as apt
from olp.program.apt.table import APT
from olp.program.described.reader import read_described
from olp.program.dialect import Dialect
from olp.program.dialect import Options as Options
from olp.program.dmis import reader as dmis
from olp.program.dmis.table import DMIS
from olp.program.pointlist.reader import POINT_LIST, read_list
from olp.program.program import Program
from olp.program.rs274 import reader
from olp.program.rs274.profiles import PROFILES, Profile

Reader = Callable[..., Program]


def _rs274(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool) -> Program:
    assert isinstance(dialect, Profile)
    return reader.read(data, setup, dialect, options, words=words)


READERS: Mapping[str, Reader] = {
    "rs274": _rs274,
    "apt": apt.read,
    "dmis": dmis.read,
    "list": read_list,
    "described": read_described,
}
DIALECTS: Mapping[str, Dialect] = {**PROFILES, APT.name: APT, DMIS.name: DMIS, POINT_LIST.name: POINT_LIST}

#: Endings of files that only one family has. The ending of a version (`.ncl.3`) does not count.
_ENDINGS: Mapping[str, str] = {
    **dict.fromkeys(("apt", "aptsource", "ncl", "cls", "cl", "clt", "cldata", "clf"), "apt"),
    **dict.fromkeys(("dmi", "dms", "dmis"), "dmis"),
    **dict.fromkeys(("csv", "tsv"), "list"),
}
#: What only texts of a family say at the start of a line.
_SIGNS: Mapping[str, re.Pattern[bytes]] = {
    "apt": re.compile(
        rb"(?im)^[ \t]*(PARTNO|LOADTL|LOAD[ \t]*/|SPINDL|FINI[ \t]*\r?$|CUTTER|TOOL PATH|CUTCOM|MULTAX|"
        rb"TLAXIS|RAPID[ \t]*/?[ \t]*\r?$|FEDRAT[ \t]*/[ \t]*(?:[\d.]|[IM]P?M)|GODLTA|INDIRV|MOVARC|"
        rb"CIRCLE[ \t]*/|CYCLE[ \t]*/|UNITS?[ \t]*/[ \t]*(?:MM|INCH(?:ES)?)[ \t]*\r?$|"
        rb"GOTO[ \t]*/[-+.\dED \t]+(?:,[-+.\dED \t]+){5})"
    ),
    "dmis": re.compile(
        rb"(?im)^[ \t]*(DMISMN|FILNAM|SNSLCT|SNSET|PTMEAS|MEAS[ \t]*/|ENDMES|ENDFIL|WKPLAN|TECOMP|"
        rb"UNITS[ \t]*/[ \t]*\w+[ \t]*,|GOTO[ \t]*/[ \t]*CART|"
        rb"MODE[ \t]*/[ \t]*(?:MAN|PROG|AUTO)|F\([^)]*\)[ \t]*=[ \t]*FEAT|"
        rb"FEDRAT[ \t]*/[ \t]*\w+VEL)"
    ),
}
#: What only texts of statements say, without saying of which family.
_STATEMENTS = re.compile(rb"(?im)^[ \t]*(GOTO|RAPID|FROM)[ \t]*/")
_VERSION = re.compile(r"\.\d+$")
_LOOKED_AT = 1 << 16
_PAYLOAD = re.compile(rb"(?im)^[^\r\n]*\bolp[ \t]+payload\b")


def read(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    right.

    Without `words` the columns that only writing needs are left out.
    """
    if dialect.family != "rs274":
        _refuse_payloads(data, setup, dialect)
    return READERS[dialect.family](data, setup, dialect, options or Options(), words=words)


def _refuse_payloads(data: bytes, setup: Setup, dialect: Dialect) -> None:
    """Raises ProgramError where the payload changes inside a program whose language has no such comment."""
    what = (
        f"{dialect.title} programs have one payload; give payload_kg in the job file, and split the program"
    )
    if setup.job.payloads:
        raise ProgramError(f"[[payloads]] of the job file: {what}", line=min(setup.job.payloads))
    said = _PAYLOAD.search(data)
    if said:
        raise ProgramError(
            f"a comment changes the payload: {what}", line=data.count(b"\n", 0, said.start()) + 1
        )


def dialect_of(name: str | None, control: Dialect, data: bytes, file: str) -> Dialect:
    """The dialect of a program: the one that is named, else what its text and the ending of its file say,
    else that of the control. Raises UsageError for a name that there is not, ProgramError where text and
    ending contradict each other or tell too little."""
    if name is not None:
        found = DIALECTS.get(name)
        if found is None:
            raise UsageError(f"there is no dialect {name!r}; expected one of {', '.join(DIALECTS)}")
        return found
    said = _by_text(data)
    ending = _ENDINGS.get(_ending(file))
    if len(said) > 1 and ending in said:
        return DIALECTS[ending]
    if len(said) > 1 and control.name in said:
        return control
    if len(said) > 1:
        raise ProgramError(
            f"the text may be {' or '.join(sorted(said))}; say which with --dialect, or with the key dialect "
            "of the job file"
        )
    if said:
        (one,) = said
        if ending not in (None, one):
            raise ProgramError(
                f"the file ends as {ending} and its text reads as {one}; say which it is with --dialect, or "
                "with the key dialect of the job file"
            )
        return DIALECTS[one]
    return DIALECTS[ending] if ending is not None else control


def _ending(file: str) -> str:
    return _VERSION.sub("", file).rpartition(".")[2].lower()


def _by_text(data: bytes) -> set[str]:
    """The dialects of statements that a text may be written in; none where it holds no statements."""
    start = data[:_LOOKED_AT]
    counts = {name: len(sign.findall(start)) for name, sign in _SIGNS.items()}
    most = max(counts.values(), default=0)
    if most:
        return {name for name, count in counts.items() if count == most}
    return set(_SIGNS) if _STATEMENTS.search(start) else set()
