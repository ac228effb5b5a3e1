"""A report as a document of headed sections, and its two forms: one HTML page, and Markdown.

The page contains all it needs, loads nothing from a network, and prints on A4.
"""

from __future__ import annotations

import html
import re
import urllib.parse
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from itertools import zip_longest
from pathlib import Path

from olp.core.values import dataclass
from olp.reports import shown
from olp.reports.report import printable


@dataclass(frozen=True, slots=True)
class Paragraph:
    text: str


@dataclass(frozen=True, slots=True)
class Pairs:
    """Names and values, side by side."""

    rows: Sequence[tuple[str, str]]


@dataclass(frozen=True, slots=True)
class Link:
    """The text of a cell, and the file that it leads to: a path from the folder of the document, with `/`."""

    text: str
    path: str

    @property
    def address(self) -> str:
        """The path as an address."""
        return urllib.parse.quote(self.path, errors="surrogateescape")


@dataclass(frozen=True, slots=True)
class Grid:
    """A table; the first `text_columns` columns are text."""

    header: Sequence[str]
    rows: Sequence[Sequence[str | Link]]
    text_columns: int = 1
    code: int | None = None  # a column that holds text of a program
    aside: int | None = None  # a column that begins a second table beside the first


@dataclass(frozen=True, slots=True)
class Plot:
    """An SVG element and what it shows."""

    svg: bytes
    caption: str


@dataclass(frozen=True, slots=True)
class Notice:
    """A finding: severity, code, title, message, what to do."""

    severity: str
    code: str
    title: str
    message: str
    remedy: str


Block = Paragraph | Pairs | Grid | Plot | Notice


@dataclass(frozen=True, slots=True)
class Section:
    title: str
    blocks: Sequence[Block]
    level: int = 1


@dataclass(frozen=True, slots=True)
class Document:
    """`verdict` is (good, sentence), where good is None if it is open; None where there is nothing to
    decide."""

    title: str
    subtitle: str
    verdict: tuple[bool | None, str] | None
    sections: Sequence[Section] = field(default=())
    footer: str = ""


#: Tables of at most this many rows are kept on one page.
_SHORT = 12
#: A SHA-256 digest.
_HASH = re.compile(r"[0-9a-f]{64}")

_CSS = """
:root { --ink: #1d2327; --soft: #5b6670; --line: #d9dee2; --good: #1b7f4b; --bad: #b3261e; }
* { box-sizing: border-box; }
body { font: 10pt/1.45 "Helvetica Neue", Arial, "Liberation Sans", sans-serif; color: var(--ink); margin:
  0 auto;
  padding: 14mm 12mm; max-width: 190mm; }
header { border-bottom: 2pt solid var(--ink); padding-bottom: 3mm; margin-bottom: 5mm; }
h1 { font-size: 19pt; line-height: 1.2; margin: 0; }
header p { color: var(--soft); margin: 1mm 0 0; overflow-wrap: anywhere; }
.verdict { border-left: 4pt solid; padding: 2.5mm 4mm; margin: 0 0 5mm; font-weight: 600; background:
  #f5f7f8; }
.good { border-color: var(--good); color: var(--good); } .bad { border-color: var(--bad); color:
  var(--bad); } .open { border-color: var(--soft); color: var(--soft); }
section { margin: 0 0 6mm; }
h2 { font-size: 12.5pt; margin: 7mm 0 2mm; border-bottom: .5pt solid var(--line); padding-bottom: 1mm; }
h3 { font-size: 10.5pt; margin: 4.5mm 0 1.5mm; }
h2, h3 { break-after: avoid; }
p { margin: 0 0 2mm; }
table { border-collapse: collapse; width: 100%; margin: 1mm 0 3mm; font-size: 9pt; }
th { font-weight: 600; color: var(--soft); border-bottom: .75pt solid var(--ink); }
th, td { padding: 1mm 2mm; text-align: right; vertical-align: top; font-variant-numeric: tabular-nums; }
td { border-bottom: .5pt solid var(--line); }
th.l, td.l { text-align: left; } th.aside, td.aside { padding-left: 12mm; } th:first-child,
  td:first-child { padding-left: 0; }
tr, table.short { break-inside: avoid; }
a { color: inherit; }
td.code, dd.code { font: 7.5pt/1.6 "DejaVu Sans Mono", Consolas, monospace; overflow-wrap: anywhere; }
dd.code { padding-top: .4mm; }
p.lead { break-after: avoid; }
thead { display: table-header-group; }
dl { display: grid; grid-template-columns: 46mm 1fr; gap: .8mm 4mm; margin: 0 0 3mm; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 2mm 0 4mm; break-inside: avoid; } figure svg { width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: 8.5pt; margin-top: 1mm; }
.notice { border-left: 3pt solid var(--line); padding: 1mm 3mm; margin: 0 0 2.5mm; break-inside: avoid; }
.notice.error { border-color: var(--bad); } .notice.warning { border-color: #d08700; }
.notice b { font-weight: 600; } .notice span { color: var(--soft); }
footer { color: var(--soft); font-size: 8pt; border-top: .5pt solid var(--line); padding-top: 2mm;
  overflow-wrap: anywhere; }
@page { size: A4; margin: 15mm 14mm 16mm; @bottom-right { content: counter(page) " / " counter(pages);
  font: 8pt Arial, sans-serif; color: #5b6670; } }
@media print { body { padding: 0; max-width: none; } }
@media screen and (max-width: 190mm) { body { padding: 5mm 4mm; }
  table { display: block; overflow-x: auto; } dl { grid-template-columns: minmax(25mm, 2fr) 3fr; } }
"""


def to_html(document: Document) -> bytes:
    """One page that loads nothing: its policy forbids it to the browser."""
    document = as_shown(document)
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    parts = [
        "<!DOCTYPE html>", '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{_text(document.title)}: {_text(document.subtitle)}</title>",
        f"<style>{_CSS}</style></head><body>",
        f"<header><h1>{_text(document.title)}</h1><p>{_text(document.subtitle)}</p></header>",
    ]  # fmt: skip
    if document.verdict is not None:
        good, sentence = document.verdict
        mark = "open" if good is None else "good" if good else "bad"
        parts.append(f'<p class="verdict {mark}">{_text(sentence)}</p>')
    for number, section in _numbered(document.sections):
        tag = f"h{section.level + 1}"
        parts.append(f"<{tag}>{number} {_text(section.title)}</{tag}>")
        parts += [_html(block, after) for block, after in zip_longest(section.blocks, section.blocks[1:])]
    parts.append(f"<footer>{_text(document.footer)}</footer></body></html>")
    return ("\n".join(parts) + "\n").encode()


def as_shown(document: Document) -> Document:
    """The document in the units that are shown. Plots and findings keep theirs."""
    verdict = document.verdict
    return replace(
        document,
        verdict=None if verdict is None else (verdict[0], shown.prose(verdict[1])),
        sections=[_shown(section) for section in document.sections],
    )


def _shown(section: Section) -> Section:
    blocks: list[Block] = []
    unit = shown.unit_in(section.title)
    for block in section.blocks:
        if isinstance(block, Paragraph):
            unit = shown.unit_in(block.text.rstrip(":")) or shown.unit_in(section.title)
            blocks.append(Paragraph(shown.title(shown.prose(block.text))))
        elif isinstance(block, Pairs):
            rows = [(shown.title(a), shown.value(b, shown.unit_in(a))) for a, b in block.rows]
            blocks.append(Pairs(rows))
        elif isinstance(block, Grid):
            blocks.append(_grid(block, unit))
        else:
            blocks.append(block)
    return Section(shown.title(section.title), blocks, section.level)


def _grid(grid: Grid, unit: str | None) -> Grid:
    texts = [[cell.text if isinstance(cell, Link) else cell for cell in row] for row in grid.rows]
    header, lengths = shown.cells(grid.header, texts, unit, grid.text_columns)
    rows: list[list[str | Link]] = []
    for before, row in zip(grid.rows, lengths, strict=True):
        # a link is a name, and the text of a program is no sentence
        kept = (isinstance(cell, Link) or k == grid.code for k, cell in enumerate(before))
        rows.append([a if keep else b for a, b, keep in zip(before, row, kept, strict=True)])
    return replace(grid, header=header, rows=rows)


def in_form(document: Document, name: str) -> bytes:
    """As HTML or as Markdown, by the ending of the file's name."""
    return to_html(document) if Path(name).suffix.lower() == ".html" else to_markdown(document)


def to_markdown(document: Document) -> bytes:
    """The same without plots and their captions."""
    document = as_shown(document)
    lines = [f"# {_mark(document.title)}", "", _mark(document.subtitle), ""]
    if document.verdict is not None:
        lines += [f"**{_mark(document.verdict[1])}**", ""]
    for number, section in _numbered(document.sections):
        blocks = [line for block in section.blocks for line in _markdown(block)]
        lines += [f"{'#' * (section.level + 1)} {number} {_mark(section.title)}", "", *blocks]
    lines += ["---", "", _mark(document.footer)]
    return (re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n").encode()


def _numbered(sections: Sequence[Section]) -> Iterator[tuple[str, Section]]:
    main = sub = 0
    for section in sections:
        if section.level == 1:
            main, sub = main + 1, 0
            yield f"{main}", section
        else:
            sub += 1
            yield f"{main}.{sub}", section


def _text(text: str) -> str:
    return html.escape(printable(text))


def _html(block: Block, after: Block | None) -> str:
    if isinstance(block, Paragraph):
        # a paragraph that announces a table or a plot is kept on its page
        lead = ' class="lead"' if isinstance(after, Grid | Plot) else ""
        return f"<p{lead}>{_text(block.text)}</p>"
    if isinstance(block, Pairs):
        rows = (
            f'<dt>{_text(a)}</dt><dd class="{"code" if _HASH.fullmatch(b) else "words"}">{_text(b)}</dd>'
            for a, b in block.rows
            if b
        )
        return f"<dl>{''.join(rows)}</dl>"
    if isinstance(block, Plot):
        return f"<figure>{block.svg.decode()}<figcaption>{_text(block.caption)}</figcaption></figure>"
    if isinstance(block, Notice):
        severity, message, remedy = _text(block.severity), _text(block.message), _text(block.remedy)
        return (
            f'<div class="notice {severity}"><b>{_text(block.code)} {_text(block.title)}</b> '
            f"<span>({severity})</span><br>{message}<br><span>{remedy}</span></div>"
        )

    def row(cells: Sequence[str | Link], tag: str) -> str:
        html_cells = []
        for column, cell in enumerate(cells):
            kind = "l" if column < block.text_columns or column in (block.code, block.aside) else "r"
            kind += " aside" if column == block.aside else ""
            kind += " code" if column == block.code else ""
            html_cells.append(f'<{tag} class="{kind}">{_cell(cell)}</{tag}>')
        return "<tr>" + "".join(html_cells) + "</tr>"

    body = "".join(row(cells, "td") for cells in block.rows)
    short = "short" if len(block.rows) <= _SHORT else "long"
    return f"<table class='{short}'><thead>{row(block.header, 'th')}</thead><tbody>{body}</tbody></table>"


def _cell(cell: str | Link) -> str:
    if isinstance(cell, Link):
        return f'<a href="{html.escape(cell.address)}">{_text(cell.text)}</a>'
    return _text(cell)


def _mark_cell(cell: str | Link) -> str:
    return f"[{_mark(cell.text)}]({cell.address})" if isinstance(cell, Link) else _mark(cell)


def _mark(text: str) -> str:
    """Text with the marks of Markdown escaped."""
    return re.sub(r"([\\`*_\[\]<>|#])", r"\\\1", printable(text))


def _markdown(block: Block) -> Iterator[str]:
    if isinstance(block, Paragraph):
        yield from (_mark(block.text), "")
    elif isinstance(block, Pairs):
        yield from (f"- {_mark(a)}: {_mark(b)}" for a, b in block.rows if b)
        yield ""
    elif isinstance(block, Notice):
        sentence = f"{_mark(block.message)} {_mark(block.remedy)}"
        yield f"- **{block.code} {_mark(block.title)}** ({block.severity}): {sentence}"
    elif isinstance(block, Grid):
        words = {*range(block.text_columns), block.code, block.aside}
        rule = ("---" if column in words else "---:" for column in range(len(block.header)))
        yield "| " + " | ".join(map(_mark, block.header)) + " |"
        yield "| " + " | ".join(rule) + " |"
        yield from ("| " + " | ".join(map(_mark_cell, row)) + " |" for row in block.rows)
        yield ""
