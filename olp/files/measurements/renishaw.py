"""Dynamic recordings of Renishaw's CARTO and XL-80 (.rtx): header lines, then samples as doubles.

The layout is known from a public reader, not from the maker: `HEADER::`, lines `Key: value`, `Data:`,
little-endian float64, `EOF::`. The file names neither the unit of samples nor the positions of the axis, so
a profile has to state both.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import InputError
from olp.core.schema import Table
from olp.core.schema_keys import Field
from olp.core.values import dataclass
from olp.files.measurements.readings import ANGULAR, UNITS, Readings
from olp.files.write import PathLike, read_bytes

RTX = ".rtx"
MARK = b"HEADER::"
_DATA = b"Data:\r\n"
_END = b"EOF::"
#: Bytes of the header, at most.
_MOST_HEADER = 1 << 16
#: Samples at rest differ from the first or last one by less than this share of the travel.
_REST = 1e-4


class RecordingTable(Table):
    motion: Literal["triggered", "sweep"] = Field(
        description='"triggered" (one sample every step_mm of the scale) or "sweep" (samples in time, one '
        "pass at constant feed from start_mm to end_mm)"
    )
    start_mm: float = Field(description="the axis position of the first sample, in mm")
    step_mm: float | None = Field(
        default=None,
        description="the axis travel from sample to sample, with its sign, in mm; triggered only",
    )
    end_mm: float | None = Field(
        default=None, description="the axis position of the last sample, in mm; sweep only"
    )
    every: Annotated[int, Field(ge=1)] = Field(
        default=1, description="the number of samples that are averaged to one reading"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """(n,) samples as stored, the header's `keys`, and the time from sample to sample in s."""

    file: str
    samples: Array
    keys: Mapping[str, str]
    period_s: float


def read_rtx(path: PathLike, unit: str | None = None) -> Readings:
    """Refuses a recording without a profile, after a check of its bytes.

    Raises InputError, because the file states neither its unit nor the positions of the axis.
    """
    recording = parse_rtx(read_bytes(path), str(path))
    what = "the positions of the axis" if unit else "its unit and the positions of the axis"
    raise InputError(
        f"is a dynamic recording of {len(recording.samples)} samples, and does not state {what}; give a "
        "profile with unit and the table [recording]",
        file=str(path),
    )


def parse_rtx(data: bytes, file: str) -> Recording:
    """The samples of a dynamic recording. Raises InputError with what is missing."""
    if not data.startswith(MARK):
        raise InputError(
            f'begins with {data[:8]!r}; expected "HEADER::", a dynamic recording (.rtx)', file=file
        )
    start = data.find(_DATA, 0, _MOST_HEADER)
    if start < 0:
        raise InputError('has no line "Data:" after its header; copy the file again', file=file)
    keys: dict[str, str] = {}
    for number, line in enumerate(data[len(MARK) : start].decode("utf-8", "replace").split("\r\n"), 1):
        key, mark, value = line.partition(":")
        if line.strip() and not mark:
            sentence = f'"{line[:40]}" is not a line of the header; expected "Key: value"'
            raise InputError(sentence, file=file, line=number)
        if mark:
            keys[key.strip()] = value.strip()
    body = data[start + len(_DATA) :]
    # The end mark follows the last sample. The same bytes inside a sample are not the end.
    tail = body.rstrip(b"\r\n")
    if not tail.endswith(_END):
        raise InputError('does not end with "EOF::"; the recording is cut off, copy it again', file=file)
    body = tail[: -len(_END)]
    if len(body) % 8:
        raise InputError(f"holds {len(body)} bytes of samples; expected a multiple of 8", file=file)
    samples = np.frombuffer(body, "<f8").astype(np.float64)
    if len(samples) < 2 or not np.isfinite(samples).all():
        sentence = f"holds {len(samples)} samples, or one is not a number; expected 2 or more"
        raise InputError(sentence, file=file)
    stated = _number(keys, "Sample no", file)
    if stated is not None and int(stated) != len(samples):
        raise InputError(
            f'holds {len(samples)} samples, but its header says "Sample no: {int(stated)}"; copy it again',
            file=file,
        )
    rate = _number(keys, "Actual sample rate", file) or _number(keys, "Sample rate", file)
    if not rate or rate <= 0.0:
        raise InputError('states no "Actual sample rate"; expected samples per second', file=file)
    return Recording(file, samples, MappingProxyType(keys), 1.0 / rate)


def line_of_recording(
    recording: Recording, layout: RecordingTable, unit: str, holds: Literal["error", "position"]
) -> Readings:
    """One run from a recording: its samples in `unit`, at the axis positions that `layout` states.

    A sweep takes samples in time. Its middle part, where the axis moves, is spread from start to end at
    constant feed. With `holds` "position" the errors of a sweep are deviations from constant feed. They hold
    neither scale nor slow curve, only cyclic errors. Raises InputError.
    """
    file, value = recording.file, recording.samples * UNITS[unit]
    notes = ["the unit and the positions of this recording are those of the profile"]
    if layout.motion == "triggered":
        if not layout.step_mm:
            sentence = '[recording] motion = "triggered" lacks step_mm; expected the travel per sample'
            raise InputError(sentence, file=file)
        target = layout.start_mm + layout.step_mm * np.arange(len(value))
        value = value - target if holds == "position" else value
    else:
        if layout.end_mm is None or layout.end_mm == layout.start_mm:
            sentence = '[recording] motion = "sweep" lacks end_mm; expected the end of the sweep'
            raise InputError(sentence, file=file)
        if holds == "position":
            part = _moving(value, file)
            value = value[part]
            target = np.linspace(layout.start_mm, layout.end_mm, len(value), dtype=np.float64)
            slope, rest = np.polyfit(target, value, 1)
            value = np.asarray(value - slope * target - rest, dtype=np.float64)
            notes.append("errors are deviations from constant feed: scale and slow curve are not in them")
        else:
            target = np.linspace(layout.start_mm, layout.end_mm, len(value), dtype=np.float64)
    group = layout.every
    if group > 1:
        whole = len(value) // group * group
        target, value = (np.array(a[:whole], float).reshape(-1, group).mean(axis=1) for a in (target, value))
    direction = 1 if target[-1] > target[0] else -1
    ones = np.ones(len(value), np.int64)
    return Readings(
        file, np.asarray(target, np.float64), value, ones, direction * ones, 0 * ones, None, unit in ANGULAR,
        MappingProxyType({}), tuple(notes),
    )  # fmt: skip


def _moving(position: Array, file: str) -> slice:
    """The samples of a sweep between rest at its start and rest at its end."""
    travel = abs(position[-1] - position[0])
    if travel == 0.0:
        raise InputError("the recorded position does not change; expected a sweep", file=file)
    started = np.flatnonzero(np.abs(position - position[0]) > _REST * travel)
    moving = np.flatnonzero(np.abs(position - position[-1]) > _REST * travel)
    return slice(max(int(started[0]) - 1, 0), min(int(moving[-1]) + 2, len(position)))


def _number(keys: Mapping[str, str], key: str, file: str) -> float | None:
    text = keys.get(key)
    if not text:
        return None
    try:
        return float(text)
    except ValueError:
        raise InputError(f'its header says "{key}: {text}"; expected a number', file=file) from None
