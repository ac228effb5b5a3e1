"""What a table says about itself in comments `# key = value`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import TypeVar

from olp.core.schema import Table
from olp.files.problems import config_error, validate
from olp.files.toml_text import Path

T = TypeVar("T", bound=Table)
#: A value as it is written, and its line.
Said = tuple[str, int]

_KEY = re.compile(r"#+\s*([A-Za-z_]\w*)\s*=\s*(\S.*?)\s*$")


def stated_keys(text: str) -> Iterator[tuple[str, Said]]:
    """(key, (value as written, line)) of each comment `# key = value`."""
    for number, line in enumerate(text.splitlines(), 1):
        found = _KEY.fullmatch(line.strip())
        if found:
            yield found[1], (found[2], number)


def stated_as(keys: Mapping[str, Said], model: type[T], file: str, *, bare: bool = True) -> T:
    """The comments of a file as a table of `model`. Words need no quotes there where they may be `bare`.
    Raises ConfigError with every problem and its line."""
    values: dict[str, object] = {}
    for key, (written, line) in keys.items():
        try:
            values[key] = tomllib.loads(f"value = {written}")["value"]
        except tomllib.TOMLDecodeError:
            if not bare:
                raise config_error([(line, f"{key} = {written} is no value")], file) from None
            values[key] = written
    lines: dict[Path, int] = {(key,): line for key, (_, line) in keys.items()}
    return validate(model, values, lines, file)
