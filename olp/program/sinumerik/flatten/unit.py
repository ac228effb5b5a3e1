"""One text of a parametric program: its lines cut into pieces, its labels, and where its loops end."""

from __future__ import annotations

import re
from dataclasses import field

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.sinumerik.blocks import Block, block_of, without_comment

_END = re.compile(rb"\r*\n?\Z")
_HEAD = re.compile(
    r"(?:\xef\xbb\xbf)?[ \t]*/?\d?[ \t]*(?:N\d+)?[ \t]*(?:[A-Z_][A-Z0-9_]+[ \t]*:(?!=)[ \t]*)*", re.IGNORECASE
)
_KEYWORD = re.compile(
    r"(IF|ELSE|ENDIF|FOR|ENDFOR|WHILE|ENDWHILE|LOOP|ENDLOOP|REPEAT|REPEATB|UNTIL|CASE|GOTO[FBCS]?|DEF|PROC|(?:EXT)?CALL|RET)"
    r"(?![A-Z0-9_])[ \t]*",
    re.IGNORECASE,
)
_LABEL = re.compile(r"([A-Z_][A-Z0-9_]+)[ \t]*:(?!=)", re.IGNORECASE)
_JUMPS = re.compile(r"\bGOTO[FBCS]?\b", re.IGNORECASE)
#: What closes each structure.
_CLOSED_BY = {"IF": "ENDIF", "FOR": "ENDFOR", "WHILE": "ENDWHILE", "LOOP": "ENDLOOP", "REPEAT": "UNTIL"}
_PROGRAM = re.compile(rb"(?im)^%_N_(\w+)_([MS]PF)[^\n]*\n?")


@dataclass(slots=True, eq=False)
class Line:
    """A line: its bytes without their line end, what it says without a comment, its keyword and what stands
    behind that. `block` is None where a keyword takes the whole line."""

    number: int
    raw: bytes
    eol: bytes
    code: str
    keyword: str
    rest: str
    deleted: bool
    block: Block | None


@dataclass(slots=True, eq=False)
class Unit:
    """The lines of one text, compiled when first met. `labels` leads from labels and block numbers to lines,
    `closing` from a line that opens a structure to those that go on with it and close it."""

    file: str | None
    texts: list[bytes]
    first: int = 0
    labels: dict[str, list[int]] = field(default_factory=dict)
    closing: dict[int, list[int]] = field(default_factory=dict)
    _lines: dict[int, Line] = field(default_factory=dict)

    @staticmethod
    def of(data: bytes, file: str | None, first: int = 0) -> Unit:
        """Raises ProgramError with its line for a structure that is not closed. `first` lines of the file
        come before the text."""
        unit = Unit(file, re.findall(rb"[^\n]*\n|[^\n]+", data), first)
        unit._structure()
        return unit

    def line(self, index: int) -> Line:
        """A line by its index from 0."""
        known = self._lines.get(index)
        if known is None:
            known = self._lines[index] = self._compiled(index)
        return known

    def _head(self, index: int) -> tuple[str, str, str]:
        code = without_comment(self.texts[index]).decode("latin-1").rstrip("\r\n")
        head = _HEAD.match(code)
        rest = code[head.end() :] if head else code
        match = _KEYWORD.match(rest)
        return code, "" if match is None else match[1].upper(), rest if match is None else rest[match.end() :]

    def _compiled(self, index: int) -> Line:
        text = self.texts[index]
        end = _END.search(text)
        raw = text[: end.start()] if end else text
        code, keyword, rest = self._head(index)
        block = None
        if not keyword and code.strip() and not code.lstrip().startswith("%"):
            block = block_of(without_comment(raw))
        deleted = code.lstrip().startswith("/")
        return Line(self.first + index + 1, raw, text[len(raw) :], code, keyword, rest, deleted, block)

    def _structure(self) -> None:
        open_: list[tuple[str, int]] = []
        for index in range(len(self.texts)):
            code, keyword, rest = self._head(index)
            for label in _LABEL.findall(code):
                self.labels.setdefault(label.upper(), []).append(index)
            number = re.match(r"[ \t]*/?\d?[ \t]*(?:N|:)(\d+)", code, re.IGNORECASE)
            if number:
                self.labels.setdefault(f"N{number[1]}", []).append(index)
            opens = keyword in _CLOSED_BY and not (keyword == "IF" and _JUMPS.search(rest))
            if opens and not (keyword == "REPEAT" and rest.strip()):
                open_.append((keyword, index))
                self.closing[index] = []
            elif keyword == "ELSE" or keyword in _CLOSED_BY.values():
                if not open_ or (keyword != "ELSE" and _CLOSED_BY[open_[-1][0]] != keyword):
                    raise self.error(f"{keyword} closes nothing that is open", index)
                self.closing[open_[-1][1]].append(index)
                if keyword != "ELSE":
                    open_.pop()
        if open_:
            raise self.error(
                f"{open_[-1][0]} is not closed; expected {_CLOSED_BY[open_[-1][0]]}", open_[-1][1]
            )

    def error(self, message: str, index: int, code: str = "OLP542") -> ProgramError:
        """A refusal at a line, by its index from 0."""
        return ProgramError(message, line=self.first + index + 1, file=self.file, code=code)


def programs(data: bytes) -> tuple[bytes, dict[str, tuple[bytes, int]]]:
    """The text of the program, and those of the subprograms behind it in an archive by their name, each with
    the number of lines before it."""
    heads = [head for head in _PROGRAM.finditer(data) if data[: head.start()].strip()]
    stops = [*(head.start() for head in heads), len(data)]
    others = {}
    for head, stop in zip(heads, stops[1:], strict=True):
        text = data[head.end() : stop]
        others[head[1].decode().upper()] = (text, data.count(b"\n", 0, head.end()))
    return data[: stops[0]], others
