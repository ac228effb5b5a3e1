"""Programs that control and shop keep in two files, statements in one and data in the other, as one text.

What the control itself keeps of its tools and bases, in a file of its system, is read behind these two. It is
never written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from olp.core.patterns import pattern
from olp.core.spool import Text

#: Endings of files of data, by those of the statements that use them.
_DATA = {".src": ".dat"}
#: The folder of programs of a control.
_PROGRAMS = "program"
#: The folder of its system beside it.
_SYSTEM = ("System", "SYSTEM", "system")
#: The file of the data of a control there.
_OWN = "$config.dat"
#: What stands between the files in one text, comments of their language.
_BETWEEN = b"\n;olp: data of %b\n"
_RUN = b"\n;olp: system data of %b from line %d\n"
_MARK = pattern(rb"\n;olp: data of ([^\r\n]+)\n")
_SYSTEM_MARK = pattern(rb"\n;olp: system data of ([^\r\n]+) from line (\d+)\n")
_LINE_END = pattern(rb"\r\n|\n|\r")
#: What is read of the data of a control: the frames of tools and bases by their numbers, and the home
#: positions.
_FRAME = pattern(
    rb"(?i)[ \t]*(?:(?:TOOL|BASE)_DATA[ \t]*\[|"
    rb"(?:(?:DECL|GLOBAL|CONST)[ \t]+)*(?:E[36])?AXIS[ \t]+XHOME\d*[ \t]*=)"
)


def data_beside(program: Path) -> Path | None:
    """The file of data that a program may have beside it; None where programs of its ending have none."""
    ending = program.suffix
    data = _DATA.get(ending.lower())
    return None if data is None else program.with_suffix(data.upper() if ending.isupper() else data)


def system_of(program: Path, listed: Callable[[Path, str], list[Path]]) -> Path | None:
    """The file of the control's own data, where a program lies in the folders of a control; None elsewhere.
    `listed` gives the files of a folder by their ending."""
    ending = _DATA.get(program.suffix.lower())
    if ending is None:
        return None
    for folder in program.absolute().parents:
        if folder.name.casefold() == _PROGRAMS:
            files = (file for name in _SYSTEM for file in listed(folder.with_name(name), ending))
            return next((file for file in files if file.name.casefold() == _OWN), None)
    return None


def joined(statements: bytes, data: bytes, name: str) -> bytes:
    """Both files as one text; `name` is that of the file of data."""
    return statements + _BETWEEN % name.encode() + data


def with_system(text: bytes, system: bytes, name: str) -> bytes:
    """A program with tools, bases and home positions of the control's own data, of a file of this name."""
    pieces, last = [text], -1
    for number, line in enumerate(_LINE_END.split(system), 1):
        if _FRAME.match(line) is not None:
            pieces += [b"\n" if last == number - 1 else _RUN % (name.encode(), number), line]
            last = number
    return b"".join(pieces)


def system_part(text: Text) -> bytes:
    """What `with_system` has added to a text."""
    return bytes(text[own_end(text) :])


def own_end(text: Text) -> int:
    """Where the files of the program itself end in a text."""
    mark = _SYSTEM_MARK.search(text)
    return len(text) if mark is None else mark.start()


def divided(path: Path, text: Text) -> dict[Path, Text]:
    """The files that a text is written to: two for one that was joined, where `path` ends as such a program
    does."""
    data = data_beside(path)
    if data is None:
        return {path: text}
    end, mark = own_end(text), _MARK.search(text)
    if mark is None:
        return {path: text if end == len(text) else text[:end]}
    return {path: text[: mark.start()], data: text[mark.end() : end]}


def place_of(text: Text, line: int) -> str:
    """A line of a text in words, with the name of the file of data where it is in that."""
    found = f"line {line}"
    for name, end, first in _marks(text):
        before = len(_LINE_END.findall(text, 0, end))
        if line <= before:
            break
        found = f"line {line - before + first - 1} of {name.decode()}"
    return found


def _marks(text: Text) -> Iterator[tuple[bytes, int, int]]:
    """Of each further piece of a text, the name of its file, where it begins, and its first line there."""
    mark = _MARK.search(text)
    if mark is not None:
        yield mark[1], mark.end(), 1
    for mark in _SYSTEM_MARK.finditer(text, own_end(text)):
        yield mark[1], mark.end(), int(mark[2])
