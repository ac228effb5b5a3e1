"""A plan of measurements proposed from a folder: what files say by name, header and comments is taken, and
what no file says is asked for."""

from __future__ import annotations

import contextlib
import itertools
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from olp.core.errors import ConfigError, InputError
from olp.core.machine import Machine
from olp.core.schema import fields_of
from olp.core.values import dataclass
from olp.files.columns import instrument_text
from olp.files.measurements.instruments.base import Instrument, SeenFile
from olp.files.measurements.instruments.lines import LineFiles
from olp.files.measurements.layout_draft import ASKED, drafted
from olp.files.measurements.line_keys import LineKeys
from olp.files.measurements.line_profile import (
    WITHOUT_GRAMMAR,
    LineColumns,
    LineProfile,
    load_line_profile,
    read_line,
)
from olp.files.measurements.point_readings import COVARIANCE, SIGMA, TOOL
from olp.files.measurements.reader import listed, readings_in
from olp.files.measurements.schemas import PlanFile
from olp.files.measurements.seen import COLUMNS, STORED, Known, known_of
from olp.files.toml_text import toml_document, toml_key, toml_value
from olp.files.write import read_bytes

#: Keys that every line needs, and that [defaults] may hold for all of them.
_OF_LINES = ("sense", "line_mm", "tool_mm")
#: Columns that state for each row what a key states for all of them.
_COLUMNS_OF = {"tool_mm": TOOL, "sigma_um": (*SIGMA, *COVARIANCE)}
#: Keys of the whole plan that files may state.
_OF_ALL = ("machine", "measured", "temperature_degC")
#: Lines, which alone have profiles.
LINES = LineFiles()
#: The convention of readings after their profile.
SENSED = "actual-minus-commanded"


@dataclass(frozen=True, slots=True)
class Proposal:
    """The text of a plan (olp-measurements-1), what is asked for in it, and the files that are not known.
    `layouts` are profiles (olp-line-profile-1) that are drafted for files of other layouts, by name."""

    text: str
    asked: tuple[str, ...]
    unknown: tuple[str, ...]
    layouts: Mapping[str, str] = field(default_factory=dict)


def propose(folder: Path, machine: Machine | None = None) -> Proposal:
    """The plan for the files of a folder. Raises InputError where one cannot be read, and ConfigError where
    none is known."""
    known: list[Known] = []
    unknown: list[str] = []
    asked: list[str] = []
    layouts: dict[str, str] = {}
    profiles = _profiles(folder)
    for path in readings_in(folder):
        taken = _taken(path, profiles) or _drafted(path, layouts, asked)
        if taken is None:
            unknown.append(path.name)
        else:
            known.append(taken)
    if not known:
        endings = ", ".join((*COLUMNS, *STORED))
        others = f", such as {listed(unknown)}" if unknown else ""
        raise ConfigError(
            f"holds no file of readings that says what it is; expected some of {endings}, or a profile "
            f"(olp-line-profile-1) beside files of another layout{others}",
            file=str(folder),
        )
    lines = [*_whole([seen for _, seen, _ in known], machine, asked), ""]
    lines += _defaults([seen for instrument, seen, _ in known if instrument.key == "lines"], asked)
    for instrument, seen, keys in known:
        lines += ["", f"[[{instrument.key}]]", *_table(instrument, seen, keys, asked)]
    return Proposal("\n".join(lines) + "\n", tuple(asked), tuple(unknown), layouts)


def _taken(path: Path, profiles: Mapping[str, LineProfile]) -> Known | None:
    """The instrument of a file and what it shows: by itself, or by the first profile that reads it."""
    known = known_of(path)
    if known is not None:
        return known
    for name, profile in profiles.items():
        try:
            readings = read_line(path, profile)
        except InputError:
            continue
        stated = {key: written for key, (written, _) in readings.keys.items()}
        if readings.sense_known:
            stated["sense"] = SENSED
        value = "value_urad" if readings.angular else "value_um"
        seen = SeenFile(path.name, ("target_mm", value), stated, readings.component)
        return LINES, seen, {**(LINES.proposed(seen) or {}), "profile": name}
    return None


def _drafted(path: Path, layouts: dict[str, str], asked: list[str]) -> Known | None:
    """A file of two columns of numbers as a line, with a profile that is drafted: one for all that are laid
    out alike. None where its format is not public."""
    if path.suffix.lower() in WITHOUT_GRAMMAR:
        return None
    try:
        keys = drafted(instrument_text(read_bytes(path), str(path)))
    except InputError:
        keys = None
    if keys is None:
        return None
    columns = keys.pop("columns")
    assert isinstance(columns, Mapping)
    text = "# Drafted from a file. Check it, and replace each question mark.\n"
    text += toml_document([("", keys), ("[columns]", columns)])
    name = next((name for name, other in layouts.items() if other == text), None)
    if name is None:
        numbers = (f"layout-{number}.toml" for number in itertools.count(1))
        name = next(one for one in numbers if one not in layouts and not (path.parent / one).exists())
        layouts[name] = text
        models = (LineProfile, keys), (LineColumns, columns)
        asked += [
            f"{key} of {name}: {fields_of(model)[key].description}"
            for model, stated in models for key, value in stated.items() if value == ASKED
        ]  # fmt: skip
    seen = SeenFile(path.name, ("target_mm",), {})
    return LINES, seen, {**(LINES.proposed(seen) or {}), "profile": name}


def _profiles(folder: Path) -> dict[str, LineProfile]:
    """The layouts of files of lines that a folder holds, by the names of their files."""
    profiles = {}
    for path in sorted(folder.glob("*.toml")):
        with contextlib.suppress(InputError):
            profiles[path.name] = load_line_profile(path)
    return profiles


def _whole(files: Sequence[SeenFile], machine: Machine | None, asked: list[str]) -> Iterator[str]:
    """The keys of the plan as a whole. A key that files state differently is asked for."""
    yield "# Proposed from the files of this folder. Check it, and replace each question mark."
    yield 'schema = "olp-measurements-1"'
    for key in _OF_ALL:
        values = {seen.stated[key] for seen in files if key in seen.stated}
        value: Any = _value(values.pop()) if len(values) == 1 else ASKED
        if key == "machine" and machine is not None:
            value = machine.name
        yield _line(key, value, PlanFile, "the plan", asked)
    if machine is not None:
        yield _line("chain", machine.chain, PlanFile, "the plan", asked)


def _defaults(lines: Sequence[SeenFile], asked: list[str]) -> Iterator[str]:
    """[defaults]: what lines need and not all of them state."""
    wanted = [key for key in _OF_LINES if any(key not in seen.stated for seen in lines)]
    if wanted:
        yield "[defaults]"
        yield from (_line(key, ASKED, LineKeys, "the lines", asked) for key in wanted)


def _table(
    instrument: Instrument[Any, Any], seen: SeenFile, keys: Mapping[str, object], asked: list[str]
) -> Iterator[str]:
    yield f"file = {toml_value(seen.name)}"
    yield from (f"{toml_key(key)} = {toml_value(value)}" for key, value in keys.items())
    for key in instrument.asks:
        if key in keys or any(name in seen.header for name in _COLUMNS_OF.get(key, ())):
            continue
        value = _value(seen.stated[key]) if key in seen.stated else ASKED
        yield _line(key, value, instrument.table, seen.name, asked)
    if instrument.key == "lines" and Path(seen.name).suffix.lower() in STORED[1:]:
        yield _line("profile", ASKED, LineKeys, seen.name, asked)


def _value(written: str) -> Any:
    """The value of a comment; a word without quotes is that word."""
    try:
        return tomllib.loads(f"value = {written}")["value"]
    except tomllib.TOMLDecodeError:
        return written


def _line(key: str, value: Any, model: type[Any], whose: str, asked: list[str]) -> str:
    """A key of the plan; one that is asked for says in a comment what it means."""
    if value != ASKED:
        return f"{toml_key(key)} = {toml_value(value)}"
    words = fields_of(model)[key].description
    asked.append(f"{key} of {whose}: {words}")
    return f'{toml_key(key)} = "{ASKED}"  # {words}'
