"""Reads delimited tables: which lines hold data, and the cells of each.

Tables that are only read become texts (`Form`). Of tables that are edited the bytes of each cell are kept
(`Cells`), so that all other bytes stay unchanged. The caller decides which columns a table needs, and the
message for a cell that is not a number.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence

from olp.core.errors import InputError
from olp.core.values import dataclass
from olp.program.text.delimited import DELIMITERS, Layout
from olp.program.text.line_ends import LINE_END, ends_in
from olp.program.text.numbers import Number, number

Span = tuple[int, int]
#: Line and cells of a row.
Row = tuple[int, list[Span]]
#: Bytes that show whether a file is binary.
_HEAD = 1024


def decoded(data: bytes) -> str:
    """The text of a file. Raises InputError with the line of the first byte that is not UTF-8, and for a
    binary file with the name of what it is."""
    if b"\0" in data[:_HEAD]:
        from olp.program.foreign import recognised

        other = recognised(data, languages=False)
        if other is not None:
            raise InputError(other.message, line=1)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        sentence = f"byte 0x{data[error.start]:02x} is not UTF-8; expected a text file saved as UTF-8"
        raise InputError(sentence, line=data[: error.start].count(b"\n") + 1) from None


@dataclass(frozen=True, slots=True)
class Form:
    """How text becomes rows. `mark` separates cells, None for any blanks. Lines that begin with one of
    `comments` have no data, and neither has the rest of a line after `remark`. `loose` quotes may come after
    blanks. `strict` lines end only at line ends, others at all line breaks of Unicode."""

    mark: str | None = ","
    comments: tuple[str, ...] = ("#",)
    remark: str | None = None
    loose: bool = False
    strict: bool = False

    def lines(self, text: str) -> Iterator[tuple[int, str]]:
        """Every line and its number, from 1, without its end and without remarks."""
        lines = io.StringIO(text, newline=None) if self.strict else text.splitlines()
        for index, line in enumerate(lines, 1):
            whole = line.removesuffix("\n")
            yield index, whole if self.remark is None else whole.split(self.remark, 1)[0]

    def holds(self, line: str) -> bool:
        """Whether a line is neither empty nor a comment."""
        return bool(line.strip()) and not line.lstrip().startswith(self.comments)

    def cells(self, line: str) -> list[str]:
        """The cells of a line, without blanks around them. Raises InputError where the line cannot be
        split."""
        if self.mark is None:
            return line.split()
        try:
            row = next(csv.reader([line], delimiter=self.mark, skipinitialspace=self.loose))
        except csv.Error as error:
            raise InputError(f"is not a table of comma-separated values ({error})") from None
        return [cell.strip() for cell in row]

    def rows(self, text: str, behind: int = 0) -> Iterator[tuple[int, list[str]]]:
        """Number and cells of each line that has data, after the first `behind` lines."""
        for line, whole in self.lines(text):
            if line > behind and self.holds(whole):
                yield line, self.cells(whole)


#: CSV as instruments write it
CSV = Form()
#: CSV as people write it
LOOSE_CSV = Form(loose=True, strict=True)


def form_of(layout: Layout) -> Form:
    """The form of tables with this layout."""
    return Form(DELIMITERS[layout.delimiter], (layout.comment, "#"), loose=True, strict=True)


def place_of(column: str | int, header: Sequence[str]) -> int | None:
    """The index of a column by its number from 1 or its name; None where no column has the name."""
    if isinstance(column, int):
        return column - 1
    return header.index(column) if column in header else None


def no_number(place: int, cell: str, decimal: str) -> str:
    """The message for a cell that should be a number."""
    return f'column {place + 1} is "{cell[:40]}"; expected a number with a decimal {decimal}'


class Cells:
    """Rows of a table and where the cells of each are, as positions in the bytes of the text. Bytes are
    decoded only to compare names. Raises InputError for UTF-16."""

    def __init__(self, data: bytes, layout: Layout) -> None:
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise InputError("the text is UTF-16; expected one byte per character; save it as UTF-8", line=1)
        self.data, self.layout = data, layout
        self.decimal = b"," if layout.decimal == "comma" else b"."
        mark = DELIMITERS[layout.delimiter]
        self._mark = None if mark is None else mark.encode()
        self._comments = (b"#", layout.comment.encode())
        #: where the last row that was read begins and ends
        self.bounds: Span = (0, 0)
        self.header: list[str] = []
        self.header_line = 0
        if layout.header:
            for line, start, end in self._lines():
                self.header = [self.text(span) for span in self.split(start, end)]
                self.header_line = line
                break

    def place(self, role: str) -> int | None:
        """The index of the column that holds something, None where the table has none. Raises InputError."""
        column = self.layout.columns.get(role)
        if column is None:
            return None
        place = place_of(column, self.header)
        if place is None:
            known = ", ".join(self.header) or "their numbers"
            raise InputError(
                f'there is no column "{column}"; expected one of {known}', line=self.header_line or 1
            )
        return place

    def rows(self, begin: int = 0, stop: int | None = None, before: int = 0) -> Iterator[Row]:
        """Line (from 1) and cells of each row of data; of the lines in the bytes `begin`..`stop` alone, which
        come after so many `before`."""
        for line, start, end in self._lines(begin, stop, before):
            if line > self.header_line:
                self.bounds = (start, end)
                yield line, self.split(start, end)

    def bands(self, size: int) -> Iterator[tuple[int, int, int]]:
        """The text in parts of about `size` bytes and whole lines: where each begins and stops, and how many
        lines come before it."""
        data, begin, before = self.data, 0, 0
        while begin < len(data):
            stop = data.find(b"\n", begin + size) + 1 or len(data)
            yield begin, stop, before
            before += ends_in(data, begin, stop)
            begin = stop

    def number(self, row: Sequence[Span], place: int) -> Number | str:
        """The number in a cell of a row, or what is wrong with it."""
        if place >= len(row):
            return f"{len(row)} columns; expected at least {place + 1} between {self.layout.delimiter}s"
        value = number(self.data[slice(*row[place])], self.decimal)
        return no_number(place, self.text(row[place]), self.layout.decimal) if value is None else value

    def word(self, row: Sequence[Span], place: int | None) -> str:
        """The text of a cell of a row, nothing where there is none."""
        return self.text(row[place]) if place is not None and place < len(row) else ""

    def text(self, span: Span) -> str:
        raw = self.data[span[0] : span[1]]
        try:
            return raw.decode("utf-8")
        except UnicodeDecodeError:
            return raw.decode("latin-1")

    def split(self, start: int, end: int) -> list[Span]:
        """Spans of the cells of a row, without blanks and quotes around them."""
        data, mark = self.data, self._mark
        spans = []
        if mark is None:
            for match in re.finditer(rb"\S+", data[start:end]):
                spans.append(self._bare(start + match.start(), start + match.end()))
            return spans
        begin = start
        while True:
            stop = begin
            while stop < end and data[stop : stop + 1] in (b" ", b"\t") and mark != b"\t":
                stop += 1
            if data[stop : stop + 1] == b'"':
                closing = data.find(b'"', stop + 1, end)
                while closing >= 0 and data[closing + 1 : closing + 2] == b'"':
                    closing = data.find(b'"', closing + 2, end)
                stop = end if closing < 0 else closing
            stop = data.find(mark, stop, end)
            stop = end if stop < 0 else stop
            spans.append(self._bare(begin, stop))
            if stop >= end:
                return spans
            begin = stop + 1

    def _bare(self, start: int, end: int) -> Span:
        data = self.data
        while start < end and data[start] in b" \t":
            start += 1
        while end > start and data[end - 1] in b" \t":
            end -= 1
        if end - start > 1 and data[start] == data[end - 1] == 34:
            return self._bare(start + 1, end - 1)
        return start, end

    def _lines(
        self, begin: int = 0, stop: int | None = None, number: int = 0
    ) -> Iterator[tuple[int, int, int]]:
        """Number, start and end of the lines that are neither empty nor comments, in the bytes
        `begin`..`stop`, which come after `number` others."""
        data = self.data
        stop = len(data) if stop is None else stop
        begin = 3 if begin == 0 and data[:3] == b"\xef\xbb\xbf" else begin
        while begin < stop:
            number += 1
            match = LINE_END.search(data, begin, stop)
            end, following = (stop, stop) if match is None else match.span()
            held = data[begin:end].strip()
            if held and not held.startswith(self._comments):
                yield number, begin, end
            begin = following
