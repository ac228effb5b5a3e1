"""The files of an application as one text: projects, programs and data, told apart by their elements."""

from __future__ import annotations

import functools

from olp.core.errors import ProgramError
from olp.core.projects import parts
from olp.core.values import dataclass
from olp.program.robots.val3.code import Routine, routines
from olp.program.robots.val3.data import Datum, Reader
from olp.program.robots.val3.xml import Element, Lines, elements

#: The program that a control begins with.
_START = "start"
_WIDE = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, slots=True)
class Application:
    """What a text states: its `data`, its programs by their names, and the `first` of them."""

    data: tuple[Datum, ...]
    routines: dict[str, Routine]
    first: Routine | None


@functools.lru_cache(maxsize=2)
def application(data: bytes) -> Application:
    """The application of a text, which is read once. Raises ProgramError where it is no XML of VAL 3."""
    line_of = Lines(data)
    found: list[Datum] = []
    all_: dict[str, Routine] = {}
    first: Routine | None = None
    for part in parts(data):
        if data[part.begin : part.begin + 2] in _WIDE:
            what = "the text has two bytes for each character; save it as UTF-8"
            raise ProgramError(what, line=line_of(part.begin), code="OLP506")
        root = elements(data, part.begin, part.end, line_of)
        if not root.children:
            what = "this is no XML of VAL 3: no element begins in it"
            raise ProgramError(what, line=line_of(part.begin), code="OLP506")
        _in_millimetres(data, root, line_of)
        found += Reader(data, line_of).all_of(root)
        own = routines(data, root, line_of)
        for routine in own:
            all_.setdefault(routine.name, routine)
        if not part.name and own:
            first = own[0]
    return Application(tuple(found), all_, first or all_.get(_START))


def _in_millimetres(data: bytes, root: Element, line_of: Lines) -> None:
    """Raises ProgramError where a project has another unit of length."""
    for element in root.all_of("Parameters", "parameters"):
        span = element.attributes.get("millimeterUnit")
        if span is not None and data[slice(*span)].strip().lower() not in (b"true", b"1"):
            what = "lengths of this project are in inch (millimeterUnit), which is not read"
            raise ProgramError(what, line=line_of(span[0]), code="OLP512")
