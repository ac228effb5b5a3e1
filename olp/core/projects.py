"""Programs that a control keeps in many files of one folder, which a project file names, as one text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass

#: Endings of programs, of the project that names them, and of data.
_PROGRAM = ".pgx"
_PROJECT = ".pjx"
_DATA = ".dtx"
#: What stands before each further file in one text, a comment of XML.
_BEFORE = b"\n<!--olp: file %b-->\n"
_MARK = pattern(rb"\n<!--olp: file ([^\r\n]+?)-->\n")
_NAMED = pattern(rb"<(?:[Pp]rogram|[Dd]ata)\s[^<>]*?\bfile\s*=\s*[\"']([^\"'<>]*)[\"']")
_LINE_END = pattern(rb"\r*\n|\r")


@dataclass(frozen=True, slots=True)
class Part:
    """A file of a text that holds several: its `name`, "" for the first, its bytes, and the lines before."""

    name: str
    begin: int
    end: int
    lines: int


def is_one_of_many(path: Path) -> bool:
    """Whether files of this ending may have others beside them that belong to the same program."""
    return path.suffix.lower() in (_PROGRAM, _PROJECT)


def gathered(
    path: Path,
    exists: Callable[[Path], bool],
    read: Callable[[Path], bytes],
    listed: Callable[[Path, str], Sequence[Path]],
) -> bytes | None:
    """A program with the files of its project as one text; None where it has none. The project has the name
    of its folder, or that of the program, or is the only one there that names it. `listed` are the files of a
    folder that have an ending. Files in other folders are left out."""
    found: dict[str, Path] = {}
    project: Path | None = path
    if path.suffix.lower() != _PROJECT:
        project = _project_of(path, exists, read, listed)
    if project is None:
        for stem in dict.fromkeys((_folder_of(path), path.stem)):
            data = path.with_name(f"{stem}{_DATA}")
            if exists(data):
                found[data.name] = data
    else:
        found[project.name] = project
        for file in _files_of(read(project)):
            if exists(path.with_name(file)):
                found[file] = path.with_name(file)
    found.pop(path.name, None)
    if not found:
        return None
    return read(path) + b"".join(_BEFORE % name.encode() + read(file) for name, file in found.items())


def _project_of(
    path: Path,
    exists: Callable[[Path], bool],
    read: Callable[[Path], bytes],
    listed: Callable[[Path, str], Sequence[Path]],
) -> Path | None:
    for stem in dict.fromkeys((_folder_of(path), path.stem)):
        project = path.with_name(f"{stem}{_PROJECT}")
        if exists(project):
            return project
    naming = [p for p in listed(path.parent, _PROJECT) if path.name in _files_of(read(p))]
    return naming[0] if len(naming) == 1 else None


def _files_of(project: bytes) -> list[str]:
    """The names of the files of a project that are in its folder."""
    names = (name.decode("utf-8", "replace") for name in _NAMED.findall(project))
    return [name for name in names if _is_plain(name)]


def _folder_of(path: Path) -> str:
    return path.absolute().parent.name


def _is_plain(name: str) -> bool:
    """Whether a name is that of a file in the same folder."""
    return name not in ("", ".", "..") and not set(name) & set('/\\:*?"<>|\0')


def holds_several(text: Text) -> bool:
    """Whether a text holds several files."""
    return _MARK.search(text) is not None


def parts(text: Text) -> Iterator[Part]:
    """The files that a text holds, in its order."""
    begin, lines, name = 0, 0, ""
    for mark in _MARK.finditer(text):
        yield Part(name, begin, mark.start(), lines)
        lines += len(_LINE_END.findall(text, begin, mark.end()))
        begin, name = mark.end(), mark[1].decode("utf-8", "replace")
    yield Part(name, begin, len(text), lines)


def divided(path: Path, text: Text) -> dict[Path, Text]:
    """The files that a text is written to: the first one to `path`, the others beside it."""
    files: dict[Path, Text] = {}
    for part in parts(text):
        plain = part.name and _is_plain(part.name)
        files[path.with_name(part.name) if plain else path] = text[part.begin : part.end]
    return files


def place_of(text: Text, line: int) -> tuple[str, int]:
    """The file of a line of a text, "" for the first one, and its number there."""
    found = "", line
    for part in parts(text):
        if part.lines < line:
            found = part.name, line - part.lines
    return found
