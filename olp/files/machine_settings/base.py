"""What the formats of control settings share: what they may state, and how it becomes a machine."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace
from pathlib import Path

from olp.core.machine import Tool, WorkOffset
from olp.core.units import AXES
from olp.core.values import dataclass

#: Gives the bytes of a file.
Load = Callable[[Path], bytes]

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
#: The zero of programs of printers: that of their axes.
BED = {"G54": WorkOffset("G54")}
#: s/min.
SECONDS = 60.0


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """What is stated of one axis, in mm, mm/s, mm/s2, mm/s3; None where nothing is."""

    travel_mm: tuple[float, float] | None = None
    least_increment_mm: float | None = None
    velocity_mm_s: float | None = None
    acceleration_mm_s2: float | None = None
    jerk_mm_s3: float | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """What the configuration of a control states of its machine, and `notes` on what you must know or decide
    about it, one sentence each.

    `name` is empty where the file has none. `controller` is the dialect of its programs. `compensated` are
    ISO names of what the control corrects.
    """

    name: str
    controller: str
    axes: Mapping[str, AxisSettings]
    compensated: frozenset[str] = frozenset()
    tools: Mapping[int, Tool] = field(default_factory=dict)
    work_offsets: Mapping[str, WorkOffset] = field(default_factory=dict)
    work_offset: str = "G54"
    notes: tuple[str, ...] = ()

    def without(self) -> Iterator[str]:
        """Notes on what the file does not state."""
        for what, key in (("travel", "travel_mm"), ("velocity", "velocity_mm_s"),
                          ("acceleration", "acceleration_mm_s2"), ("jerk", "jerk_mm_s3")):  # fmt: skip
            axes = [name for name in AXES if getattr(self.axes[name], key) is None]
            if axes:
                need = "state it with --travel" if key == "travel_mm" else f"add {key} before olp retime"
                yield f"The file states no {what} of {', '.join(axes)}: {need}."


@dataclass(frozen=True, slots=True)
class SettingsFormat:
    """One format: `recognises` a text by what is in it, `read` gives the settings in a file.

    `read` raises InputError with the file and the line or key. `source` says where its facts are from.
    """

    key: str
    title: str
    source: str
    recognises: Callable[[str], bool]
    read: Callable[[Path, Load], Settings]


def decoded(data: bytes) -> str:
    """The text of a file; what is not UTF-8 is in comments and names only."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", "replace")
    return data.decode("utf-8-sig", "replace")


def positive(value: float | None) -> float | None:
    """A limit; zero and less mean that there is none."""
    return value if value is not None and value > 0.0 and math.isfinite(value) else None


def interval(low: float | None, high: float | None) -> tuple[float, float] | None:
    """A travel, None where it is empty or one end is unknown."""
    if low is None or high is None or not low < high or not (math.isfinite(low) and math.isfinite(high)):
        return None
    return low, high


def times(value: float | None, factor: float) -> float | None:
    """A value in other units."""
    return None if value is None else value * factor


def finite(text: str) -> float | None:
    """The finite number that a text is, None for any other text."""
    number = float(text) if re.fullmatch(NUMBER, text) else math.nan
    return number if math.isfinite(number) else None


def words(text: str) -> dict[str, float]:
    """The words of a line such as `X300.00 Y300.00 Z5.00`, the first of each letter."""
    found: dict[str, float] = {}
    for letter, value in re.findall(rf"\b([A-Z])\s*({NUMBER})(?![\w.])", text.upper()):
        found.setdefault(letter, float(value))
    return found


def backlash_note(axis: str, key: str, backlash_mm: float) -> str:
    """The note on a backlash that the control takes up."""
    return (
        f"{key} = {backlash_mm:g} mm is compensated by the control. Measure with it active, or leave "
        f"{axis}_um out of [backlash] in the calibration."
    )


def corrected_note(key: str, names: list[str]) -> str:
    """The note on errors that the control corrects."""
    return (
        f"{key} corrects {', '.join(names)}, so it is listed in compensated_by_controller. If it was active "
        "while measuring, list it in active_during_measurement of the calibration instead."
    )


def bed_note() -> str:
    """The note on the zero of printers."""
    return "G54 stands for the bed, all zeros: programs of printers state no work offset."


def touched_note() -> str:
    """The note on work offsets that a file states."""
    return (
        'The work offsets count as touched off on the uncompensated machine (set_by = "touch"). Name the '
        'tool in touch_tool, or write set_by = "true" where they were located by other means.'
    )


def with_notes(settings: Settings) -> Settings:
    """The settings with notes on what their file does not state."""
    return replace(settings, notes=(*settings.notes, *settings.without()))
