"""Reads and writes TOML text: the values of a file with the line of each key, and values as TOML."""

from __future__ import annotations

import codecs
import datetime
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property, lru_cache
from typing import Any

from olp.core.errors import ConfigError
from olp.core.patterns import pattern

#: A key path, such as ("axes", "X", "travel_mm") or ("curves", 0, "file").
Path = tuple[str | int, ...]

_KEY = pattern(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|[A-Za-z0-9_-]+')
_KEY_LINE = pattern(rf"\s*((?:{_KEY.pattern})(?:\s*\.\s*(?:{_KEY.pattern}))*)\s*=(.*)")
_HEADER = pattern(r"\s*(\[\[?)(.*?)\]\]?\s*(?:#.*)?$")
_STRING_OR_COMMENT = pattern(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|#.*')
#: characters of a line that a message shows
_SHOWN = 120
#: parts of a key at most; the time to read one goes with their square
_DEEPEST = 16
_PART = r"(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+"
_DEEP_KEY = pattern(rf"(?m)(?:^|[\[{{,])[ \t]*+(?:{_PART}\.[ \t]*+){{{_DEEPEST}}}")
_BLANKS = pattern(r"[A-Za-z]\w*(?: +\w+)+\s*(?==)")
_BARE = pattern(r"[A-Za-z0-9_-]+")


def read_toml(data: bytes, file: str) -> tuple[dict[str, object], Mapping[Path, int]]:
    """Values and key lines of a TOML file. Raises ConfigError with the line where the text is not TOML."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise ConfigError("the text is UTF-16; expected a text file saved as UTF-8", file=file)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        problem = (
            f"line {line}: byte 0x{data[error.start]:02x} is not UTF-8; expected a text file saved as UTF-8"
        )
        raise ConfigError(problem, file=file, line=line) from None
    if not text.strip():
        raise ConfigError(
            "the file is empty; expected keys and values; olp init writes first files", file=file
        )
    deep = None
    if any(line.count(".") >= _DEEPEST for line in text.split("\n")):
        deep = _DEEP_KEY.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.end()) + 1
        raise ConfigError(
            f"line {line}: a key has more than {_DEEPEST} parts; correct it", file=file, line=line
        )
    try:
        values = _own(_parsed(text))
    except tomllib.TOMLDecodeError as error:
        raise _syntax_error(str(error), text, file) from None
    except (ValueError, RecursionError):
        problem = "has a number with thousands of digits, or brackets nested too deeply; correct it"
        raise ConfigError(problem, file=file) from None
    return values, _KeyLines(text)


@lru_cache(maxsize=8)
def _parsed(text: str) -> dict[str, object]:
    """The values of a text: several readers look at one file, and a run parses it once."""
    return tomllib.loads(text)


def _own(value: Any) -> Any:
    """A value whose tables and lists are the caller's own."""
    if isinstance(value, dict):
        return {key: _own(inner) for key, inner in value.items()}
    return [_own(inner) for inner in value] if isinstance(value, list) else value


class _KeyLines(Mapping[Path, int]):
    """`key_lines` of a text; they are looked for when the first one is asked for."""

    def __init__(self, text: str) -> None:
        self._text = text

    @cached_property
    def _lines(self) -> dict[Path, int]:
        return key_lines(self._text)

    def __getitem__(self, path: Path) -> int:
        return self._lines[path]

    def __iter__(self) -> Iterator[Path]:
        return iter(self._lines)

    def __len__(self) -> int:
        return len(self._lines)


def _syntax_error(message: str, text: str, file: str) -> ConfigError:
    position = re.search(r"\(at (?:line (\d+), column \d+|end of document)\)", message)
    lines = text.split("\n")
    line = int(position[1]) if position and position[1] else max(len(lines), 1)
    written = lines[line - 1].strip()
    what = re.sub(r"\s*\(at .*\)", "", message)
    hint = "correct this line"
    value = _STRING_OR_COMMENT.sub("", written).partition("=")[2]
    if "[" not in value and re.search(r"\d,\d", value):
        hint = "write a decimal point instead of the comma"
    elif blanks := _BLANKS.match(written):
        hint = f"a key has no blanks; did you mean {blanks[0].strip().replace(' ', '_')}?"
    elif written.count('"') % 2:
        hint = "close the quotes"
    elif "Invalid value" in what or "'\\'" in what:
        hint = "text needs quotes, and a file name on Windows single quotes"
    if len(written) > _SHOWN:
        written = written[:_SHOWN] + "..."
    problem = (
        f"line {line}: {written!r} is not TOML ({what}); expected key = value, [table] or [[table]]; {hint}"
    )
    if not file.lower().endswith(".toml"):
        problem += "; the files that describe machine and job end in .toml"
    return ConfigError(problem, file=file, line=line)


def _split(dotted: str) -> tuple[str, ...]:
    return tuple(part[1:-1] if part[0] in "\"'" else part for part in _KEY.findall(dotted))


def key_lines(text: str) -> dict[Path, int]:
    """The line, counted from 1, of each table header and of each key that starts a line of valid TOML."""
    lines: dict[Path, int] = {}
    counts: dict[Path, int] = {}
    table: Path = ()
    depth = 0
    quotes = ""
    for number, line in enumerate(text.split("\n"), 1):
        if quotes:
            if quotes not in line:
                continue
            line = line.partition(quotes)[2]
            quotes = ""
        elif depth == 0 and (header := _HEADER.match(line)):
            table = _enter(_split(header[2]), header[1] == "[[", counts)
            lines.setdefault(table, number)
            continue
        elif depth == 0 and (key := _KEY_LINE.match(line)):
            path = table + _split(key[1])
            for end in range(len(table) + 1, len(path) + 1):
                lines.setdefault(path[:end], number)
            line = key[2]
        opening = re.search(r'"""|\'\'\'', line)
        if opening and opening[0] not in line[opening.end() :]:
            quotes = opening[0]
            line = line[: opening.start()]
        bare = _STRING_OR_COMMENT.sub("", line)
        depth += bare.count("[") + bare.count("{") - bare.count("]") - bare.count("}")
    return lines


def _enter(header: tuple[str, ...], is_array: bool, counts: dict[Path, int]) -> Path:
    """The key path of a header, with the current index behind each array of tables."""
    path: Path = ()
    for end, part in enumerate(header, 1):
        path += (part,)
        if is_array and end == len(header):
            counts[path] = counts.get(path, -1) + 1
        if path in counts:
            path += (counts[path],)
    return path


def line_of(path: Path, lines: Mapping[Path, int]) -> int | None:
    """The line of the nearest key at or above a path."""
    return next((lines[path[:end]] for end in range(len(path), 0, -1) if path[:end] in lines), None)


def dotted(path: Path) -> str:
    """A key path as a reader writes it: `curves[0].file`, counted from 0."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += ("." if text else "") + toml_key(part)
    return text


def toml_value(value: object) -> str:
    """A value as TOML. Floats are written so that they read back exactly."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, int | float | datetime.date):
        return repr(value) if isinstance(value, int | float) else value.isoformat()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(str(k))} = {toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    raise TypeError(f"no TOML for {type(value).__name__}")


def toml_key(name: str) -> str:
    """A key, quoted where a bare one is not allowed."""
    return name if _BARE.fullmatch(name) else _quoted(name)


def toml_lines(values: Mapping[str, object]) -> Iterator[str]:
    """`key = value` lines. Keys whose value is None are left out."""
    return (f"{toml_key(key)} = {toml_value(value)}" for key, value in values.items() if value is not None)


def toml_document(tables: Iterable[tuple[str, Mapping[str, object]]]) -> str:
    """Header and keys of each table, with an empty line before it. A header "" writes keys alone."""
    lines: list[str] = []
    for header, values in tables:
        lines += [*(("", header) if header else ()), *toml_lines(values)]
    return "\n".join(lines) + "\n"


def comment(sentence: str) -> Iterator[str]:
    """A sentence as comment lines of at most 100 characters."""
    line = "#"
    # TOML takes no control characters, not even in a comment.
    for word in "".join(c if c.isprintable() else " " for c in sentence).split():
        if len(line) + len(word) > 99:
            yield line
            line = "#"
        line += " " + word
    yield line


def _quoted(text: str) -> str:
    escapes = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}
    body = "".join(escapes.get(c, c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}") for c in text)
    return f'"{body}"'
