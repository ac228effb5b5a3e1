"""Programs that control and shop keep in two files, statements in one and data in the other, as one text."""

from __future__ import annotations

from pathlib import Path

from olp.core.patterns import pattern
from olp.core.spool import Text

#: Endings of files of data, by those of the statements that use them.
_DATA = {".src": ".dat"}
#: What stands between the two in one text, a comment of their language.
_BETWEEN = b"\n;olp: data of %b\n"
_MARK = pattern(rb"\n;olp: data of ([^\r\n]+)\n")
_LINE_END = pattern(rb"\r\n|\n|\r")


def data_beside(program: Path) -> Path | None:
    """The file of data that a program may have beside it; None where programs of its ending have none."""
    ending = program.suffix
    data = _DATA.get(ending.lower())
    return None if data is None else program.with_suffix(data.upper() if ending.isupper() else data)


def joined(statements: bytes, data: bytes, name: str) -> bytes:
    """Both files as one text; `name` is that of the file of data."""
    return statements + _BETWEEN % name.encode() + data


def divided(path: Path, text: Text) -> dict[Path, Text]:
    """The files that a text is written to: two for one that was joined, where `path` ends as such a program
    does."""
    data = data_beside(path)
    mark = None if data is None else _MARK.search(text)
    if data is None or mark is None:
        return {path: text}
    return {path: text[: mark.start()], data: text[mark.end() :]}


def place_of(text: Text, line: int) -> str:
    """A line of a text in words, with the name of the file of data where it is in that."""
    mark = _MARK.search(text)
    before = 0 if mark is None else len(_LINE_END.findall(text, 0, mark.end()))
    if mark is None or line <= before:
        return f"line {line}"
    return f"line {line - before} of {mark[1].decode()}"
