"""What a table states about itself in comments `# key = value`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import TypeVar

from olp.core.schema import Table
from olp.files.problems import config_error, validate
from olp.files.toml_text import Path

T = TypeVar("T", bound=Table)
#: A value as written, and its line.
Written = tuple[str, int]

_KEY = re.compile(r"#+\s*([A-Za-z_]\w*)\s*=\s*(\S.*?)\s*$")


def stated_keys(text: str) -> Iterator[tuple[str, Written]]:
    """(key, (value as written, line)) of each comment `# key = value`."""
    for number, line in enumerate(text.splitlines(), 1):
        match = _KEY.fullmatch(line.strip())
        if match:
            yield match[1], (match[2], number)


def stated_as(keys: Mapping[str, Written], model: type[T], file: str, *, bare: bool = True) -> T:
    """The comments of a file as a table of `model`. With `bare`, words need no quotes. Raises ConfigError
    with every problem and its line."""
    values: dict[str, object] = {}
    for key, (written, line) in keys.items():
        try:
            values[key] = tomllib.loads(f"value = {written}")["value"]
        except tomllib.TOMLDecodeError:
            if not bare:
                sentence = f"{key} = {written} is not a value; expected one as in TOML"
                raise config_error([(line, sentence)], file) from None
            values[key] = written
    lines: dict[Path, int] = {(key,): line for key, (_, line) in keys.items()}
    return validate(model, values, lines, file)
