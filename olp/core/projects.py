"""Programs that a control keeps in many files of one folder, as one text.

Which files of the folder these are, a rule for each ending says: the project of VAL 3
(`olp.core.val3_projects`), or what modules of RAPID have of each other (`olp.core.rapid_modules`).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Protocol

from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass

_VAL3 = "olp.core.val3_projects"
_RAPID = "olp.core.rapid_modules"
#: Modules whose `files_of` gives the files of a program, by the ending of a file of it.
_RULES = {
    ".pgx": _VAL3,
    ".pjx": _VAL3,
    ".pgf": _RAPID,
    ".mod": _RAPID,
    ".modx": _RAPID,
    ".prg": _RAPID,
    ".sysx": _RAPID,
}
#: What stands before each further file in one text, a comment of XML or of RAPID.
_BEFORE = {_VAL3: b"\n<!--olp: file %b-->\n", _RAPID: b"\n!olp: file %b\n"}
_MARK = pattern(rb"\n(?:<!--olp: file ([^\r\n]+?)-->|!olp: file ([^\r\n]+))\n")
_LINE_END = pattern(rb"\r*\n|\r")


class Beside(Protocol):
    """What a rule asks about the files beside a program, which are read once in a run."""

    def exists(self, path: Path) -> bool:
        """Whether a file is there."""
        ...

    def read(self, path: Path) -> bytes:
        """The bytes of a file. Raises InputError where it cannot be read."""
        ...

    def listed(self, folder: Path, ending: str) -> list[Path]:
        """The files of a folder that have an ending in small letters, by name."""
        ...


@dataclass(frozen=True, slots=True)
class Part:
    """A file of a text that holds several: its `name`, "" for the first, its bytes, and the lines before."""

    name: str
    begin: int
    end: int
    lines: int


def is_one_of_many(path: Path) -> bool:
    """Whether files of this ending may have others beside them that belong to the same program."""
    return path.suffix.lower() in _RULES


def files_of(path: Path, beside: Beside) -> list[Path]:
    """The files of the program that a file belongs to, this one first. Raises InputError where one cannot be
    read."""
    rule: Callable[[Path, Beside], list[Path]] = import_module(_RULES[path.suffix.lower()]).files_of
    return rule(path, beside)


def gathered(path: Path, beside: Beside) -> bytes | None:
    """A program of several files as one text; None where it has one."""
    first, *others = files_of(path, beside)
    if not others:
        return None
    before = _BEFORE[_RULES[path.suffix.lower()]]
    further = (before % file.name.encode() + beside.read(file) for file in others)
    return beside.read(first) + b"".join(further)


def holds_several(text: Text) -> bool:
    """Whether a text holds several files."""
    return _MARK.search(text) is not None


def parts(text: Text) -> Iterator[Part]:
    """The files that a text holds, in its order."""
    begin, lines, name = 0, 0, ""
    for mark in _MARK.finditer(text):
        yield Part(name, begin, mark.start(), lines)
        lines += len(_LINE_END.findall(text, begin, mark.end()))
        begin, name = mark.end(), (mark[1] or mark[2]).decode("utf-8", "replace")
    yield Part(name, begin, len(text), lines)


def divided(path: Path, text: Text) -> dict[Path, Text]:
    """The files that a text is written to: the first one to `path`, the others beside it."""
    files: dict[Path, Text] = {}
    for part in parts(text):
        plain = part.name and is_plain(part.name)
        files[path.with_name(part.name) if plain else path] = text[part.begin : part.end]
    return files


class FileLines:
    """Where the lines of a text are in its files. The text is divided once, when the first place is asked."""

    def __init__(self, text: Text) -> None:
        self._text = text
        self._parts: list[Part] = []

    def of(self, line: int) -> tuple[str, int]:
        """The file of a line, "" for the first one, and its number there."""
        self._parts = self._parts or list(parts(self._text))
        part = self._parts[max(bisect_left(self._parts, line, key=lambda part: part.lines) - 1, 0)]
        return part.name, line - part.lines


def is_plain(name: str) -> bool:
    """Whether a name is that of a file in the same folder."""
    return name not in ("", ".", "..") and not set(name) & set('/\\:*?"<>|\0')
