"""Where the lines of an unrolled text come from: the lines of the program, and of the files of its
subprograms."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from olp.core.arrays import Index
from olp.core.errors import OlpError, ProgramError
from olp.core.spool import Text
from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Origin:
    """The lines of the texts that were unrolled, counted through all of them: first those of the program,
    then those of each file of subprograms.

    `files` are their names, `first` (k,) the number of lines before each; the program has none of both.
    `texts` are the lines. (n,) `line` is the number of the line that each line of the unrolled text was made
    from, both from 1, as an index from 0.
    """

    files: tuple[str, ...]
    first: Index
    texts: tuple[bytes, ...]
    line: Index

    @property
    def lines(self) -> int:
        """The lines of the program itself."""
        return int(self.first[0]) if len(self.first) else len(self.texts)

    def lines_of(self, line: Any) -> Index:
        """The lines that lines of the unrolled text were made from; 0, before the first line, stays 0."""
        given = np.asarray(line, np.int64)
        if not len(self.line):
            return given
        return np.where(given > 0, self.line[np.clip(given - 1, 0, len(self.line) - 1)], given)

    def line_of(self, line: int) -> int:
        """`lines_of` of one line."""
        return int(self.lines_of(line))

    def file_of(self, line: int) -> tuple[str | None, int]:
        """The file of a line and its number there; None is the program itself."""
        k = int(np.searchsorted(self.first, line, "left")) - 1
        return (None, line) if k < 0 else (self.files[k], line - int(self.first[k]))

    def counted(self) -> Iterator[dict[str, Any]]:
        """The files of subprograms as plain data: where the lines of each begin, as they count through."""
        for name, first in zip(self.files, self.first.tolist(), strict=True):
            yield {"name": Path(name).name, "lines_from": first + 1}

    def through(self, outer: Origin) -> Origin:
        """The origin of a text whose program was itself made from another one, of which `outer` is the
        origin. Files are those of `outer`, which has them all."""
        shift = {name: int(first) for name, first in zip(outer.files, outer.first.tolist(), strict=True)}
        lines = []
        for line in self.line.tolist():
            file, number = self.file_of(line)
            lines.append(int(outer.line[number - 1]) if file is None else shift[file] + number)
        return Origin(outer.files, outer.first, outer.texts, np.array(lines, np.int64))

    def place(self, line: int) -> str:
        """A line in words: its number, with the name of its file where that is not the program's."""
        file, number = self.file_of(line)
        return str(number) if file is None else f"{number} of {Path(file).name}"

    def text(self, line: int) -> str:
        """The text of a line, without its end."""
        return self.texts[line - 1].rstrip(b"\r\n").decode("latin-1")

    @contextlib.contextmanager
    def errors(self) -> Iterator[None]:
        """Errors with a line of the unrolled text get the line that it was made from, and its file."""
        try:
            yield
        except OlpError as error:
            for each in (error, *(error.others if isinstance(error, ProgramError) else ())):
                if each.line is not None and each.file is None:
                    each.file, each.line = self.file_of(self.line_of(each.line))
            raise


@dataclass(frozen=True, slots=True)
class Files:
    """The columns `line` and, where there are several files, `file` of a table in text."""

    origin: Origin | None

    @property
    def head(self) -> str:
        """What comes after `line` in the row of names."""
        return ",file" if self.origin is not None and self.origin.files else ""

    def cells(self, line: int) -> str:
        """The cells of a line."""
        if self.origin is None or not self.origin.files:
            return str(line)
        file, number = self.origin.file_of(line)
        return f"{number}," if file is None else f"{number},{quoted(Path(file).name)}"


def quoted(cell: str) -> str:
    """A cell of a CSV file (RFC 4180)."""
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in ',"\r\n') else cell


@dataclass(frozen=True, slots=True, eq=False)
class Within:
    """(n,) the line of the program itself that each line of an unrolled text runs in, such as that of a call,
    and the number of that run."""

    line: Index
    run: Index


class Unrolled(bytes):
    """A text that was unrolled, with the origin of its lines. `within` has no rows where it is not known."""

    origin: Origin
    within: Within

    @staticmethod
    def of(text: bytes, origin: Origin, within: Within | None = None) -> Unrolled:
        none = np.zeros(0, np.int64)
        unrolled = Unrolled(text)
        unrolled.origin = origin
        unrolled.within = within or Within(none, none)
        return unrolled


def origin_of(data: Text) -> Origin | None:
    """Where the lines of a text come from; None where it was not unrolled."""
    return data.origin if isinstance(data, Unrolled) else None


def original_of(data: Text) -> Text:
    """The text of the program that a text was unrolled from, or the text itself."""
    origin = origin_of(data)
    return data if origin is None else b"".join(origin.texts[: origin.lines])


def in_original(data: Text) -> contextlib.AbstractContextManager[None]:
    """Errors with a line of a text get the line of its original, where it was unrolled."""
    origin = origin_of(data)
    return contextlib.nullcontext() if origin is None else origin.errors()
