"""Forms of statements: a small language for how a statement is written, and what its fields are.

`LMOVE TRANS({x}, {y}, {z} [, {a}, {b}, {c}])` means: the words, the marks, numbers for `{x}` and the others,
and an optional part in brackets. Blanks are free around marks; between words there is at least one.
`<MOVE|MOVES>` is either word, `...` whatever follows. `{target}`, `{frame}` and `{word}` are names.
"""

from __future__ import annotations

import re

from olp.core.errors import ConfigError
from olp.core.values import dataclass

NUMBERS = ("x", "y", "z", "a", "b", "c", "speed", "blend", "time", "tool", "number")
NAMES = ("target", "frame", "word")

_TOKEN = re.compile(
    r"(?P<blank>\s+)|(?P<field>\{(?P<name>\w+)\})|(?P<rest>\.\.\.)|(?P<either><[^<>]+>)|(?P<open>\[)|(?P<close>\])|"
    r"(?P<word>(?:(?!\.\.\.)[\w.$#%])+)|(?P<mark>[^\w\s])"
)
#: Its digits are taken as a whole, so that no number is ever parted into two; an E behind them may be a word.
_NUMBER = r"(?>[-+]?(?:\d+(?:\.\d*)?|\.\d+))(?:[eE][-+]?\d++)?(?![\d.])"
#: Of one form at most, as each more of them may double the time to compare it: parts in brackets, `...`; and
#: characters.
_OPTIONAL = 8
_RESTS = 2
_LONGEST = 500
_NAME = r"[A-Za-z_$.][\w.$]*(?:\[[\w,. ]*\])?"


@dataclass(frozen=True, slots=True)
class Form:
    """A form and the pattern that it means; `first` is the word that it begins with, "" where it may begin
    with several, as `G{number}` does."""

    text: str
    pattern: re.Pattern[str]
    first: str
    fields: frozenset[str]


def form(text: str, *, ignore_case: bool) -> Form:
    """The form that a text states. Raises ConfigError where it is not a form."""
    pieces: list[str] = []
    fields: list[str] = []
    depth, first = 0, ""
    before = "start"
    blank = False
    for token in _TOKEN.finditer(text):
        kind = token.lastgroup or ""
        if kind == "blank":
            blank = True
            continue
        token_text = token[0]
        wordy = kind in ("field", "word", "either")
        if kind in ("open", "close"):
            depth += 1 if kind == "open" else -1
            if depth < 0:
                break
            pieces.append(r"(?:\s*+" if kind == "open" else ")?")
            before = "mark" if kind == "open" else "close"
            blank = False
            continue
        if before != "start":
            # no blank inside a word; around marks blanks are free
            apart = wordy and before == "wordy"
            pieces.append((r"\s++" if blank else "") if apart else r"\s*+")
        pieces.append(_piece(kind, token, fields, text))
        if before == "start" and kind == "word" and text[token.end() : token.end() + 1] not in tuple("{<[."):
            first = token_text
        before = "wordy" if wordy else "mark"
        blank = False
    if depth:
        raise ConfigError(f'the form "{text}" has an opening or closing bracket without the other')
    if len(set(fields)) < len(fields):
        raise ConfigError(f'the form "{text}" has a field twice')
    _check_size(text)
    flags = re.IGNORECASE if ignore_case else 0
    return Form(
        text,
        re.compile(r"\s*+" + "".join(pieces) + r"\s*+", flags),
        first.upper() if ignore_case else first,
        frozenset(fields),
    )


def _check_size(text: str) -> None:
    """Raise ConfigError for a form that takes long to compare with a statement."""
    if len(text) > _LONGEST:
        raise ConfigError(
            f'the form "{text[:60]}..." has {len(text)} characters; expected at most {_LONGEST}'
        )
    kinds = [token.lastgroup for token in _TOKEN.finditer(text)]
    for kind, most, what in (("open", _OPTIONAL, "optional parts"), ("rest", _RESTS, "places for any text")):
        if kinds.count(kind) > most:
            raise ConfigError(
                f'the form "{text[:60]}" has {kinds.count(kind)} {what}; expected at most {most}; '
                "describe the statement with several forms"
            )


def _piece(kind: str, token: re.Match[str], fields: list[str], text: str) -> str:
    """The pattern of one part of a form."""
    if kind == "rest":
        return r".*"
    if kind == "either":
        return "(?:" + "|".join(re.escape(word.strip()) for word in token[0][1:-1].split("|")) + ")"
    if kind != "field":
        return re.escape(token[0])
    name = token["name"]
    if name not in (*NUMBERS, *NAMES):
        raise ConfigError(
            f'the form "{text}" has a field {{{name}}}; expected one of {", ".join((*NUMBERS, *NAMES))}'
        )
    if name in ("number", "word"):
        return _NUMBER if name == "number" else _NAME
    fields.append(name)
    return f"(?P<{name}>{_NUMBER if name in NUMBERS else _NAME})"
