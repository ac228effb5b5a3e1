"""The commands that LinuxCNC gives to its HAL: those of a HAL file, or of an INI file and its HAL files.

Source: "INI configuration", sections KINS and HAL, of the manual of LinuxCNC 2.9. Values such as
[SECTION]NAME are those of the INI file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from olp.core.errors import InputError
from olp.core.values import dataclass
from olp.files.write import PathLike, Reader, read_bytes

_SECTION = re.compile(r"\s*\[(\w+)\]\s*(?:[#;].*)?$")
_ENTRY = re.compile(r"\s*(\w+)\s*=\s*(.*?)\s*$")
_NAMED = re.compile(r"\[(\w+)\](\w+)$")
#: Files of the library of LinuxCNC, which set no dimensions of a machine.
_LIBRARY = "LIB:"


@dataclass(frozen=True, slots=True)
class Command:
    """A command in words, with its file and line."""

    words: tuple[str, ...]
    file: str
    line: int


def hal_commands(path: PathLike, read: Reader = read_bytes) -> tuple[Command, ...]:
    """The commands of a file. Of an INI file: its KINEMATICS as one that loads it, those of the HALFILEs that
    it names beside it, and those of HALCMD. Raises InputError for a HAL file that is not there or is a
    script, for a machine in inches, and for a value that the INI file does not state."""
    text = _text(path, read)
    entries = tuple(_entries(text))
    if not any(key == "KINEMATICS" for _, key, _, _ in entries):
        return tuple(_of_file(text, str(path)))
    values = {(section, key): value for section, key, value, _ in entries}
    units = values.get(("TRAJ", "LINEAR_UNITS"), "mm").lower()
    if units not in ("mm", "1", "1.0"):
        raise InputError(
            f"has LINEAR_UNITS = {units}, and dimensions are read as mm; state them in a HAL file in mm",
            file=str(path),
        )
    commands: list[Command] = []
    for section, key, value, line in entries:
        if (section, key) == ("KINS", "KINEMATICS"):
            commands.append(Command(("loadrt", *value.split()), str(path), line))
        elif section == "HAL" and key in ("HALFILE", "POSTGUI_HALFILE") and not value.startswith(_LIBRARY):
            file = Path(path).parent / value.split()[0]
            if file.suffix.lower() != ".hal":
                raise InputError(
                    f"runs {value}, whose commands are not read; state the kinematics in a HAL file alone",
                    file=str(path), line=line,
                )  # fmt: skip
            commands += _of_file(_text(file, read), str(file))
    commands += [
        Command(tuple(value.split()), str(path), line)
        for section, key, value, line in entries
        if section == "HAL" and key in ("HALCMD", "POSTGUI_HALCMD")
    ]
    return tuple(_resolved(command, values) for command in commands)


def _text(path: PathLike, read: Reader) -> str:
    return read(path).decode("utf-8", "replace")


def _of_file(text: str, file: str) -> Iterator[Command]:
    for line, statement in enumerate(text.splitlines(), 1):
        words = statement.partition("#")[0].split()
        if words:
            yield Command(tuple(words), file, line)


def _entries(text: str) -> Iterator[tuple[str, str, str, int]]:
    """Section, key, value and line of the entries of an INI file."""
    section = ""
    for line, row in enumerate(text.splitlines(), 1):
        if row.lstrip().startswith(("#", ";")):
            continue
        head, entry = _SECTION.match(row), _ENTRY.match(row)
        if head is not None:
            section = head[1]
        elif entry is not None:
            yield section, entry[1], re.split(r"\s[#;]", entry[2])[0].strip(), line


def _resolved(command: Command, values: dict[tuple[str, str], str]) -> Command:
    """A command that sets a pin, with the value of the INI file."""
    if command.words[0] != "setp" or len(command.words) < 3:
        return command
    named = _NAMED.match(command.words[2])
    if named is None:
        return command
    stated = values.get((named[1], named[2]))
    if stated is None:
        raise InputError(
            f"sets {command.words[1]} to {command.words[2]}, which the INI file does not state",
            file=command.file, line=command.line,
        )  # fmt: skip
    return Command((*command.words[:2], stated), command.file, command.line)
