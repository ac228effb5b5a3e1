"""What control code is made of, what a format of it is, and the bounds with which it starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.files.control_code.carried import Sensor

#: Share by which the first bound of a correction exceeds the largest of the test vectors.
_MORE = 1.5
#: mm/s and deg/s; the least first bound of the rate of a correction.
_LEAST_RATE = 5.0
#: s; the servo cycle within which the largest backlash is crossed.
_CYCLE_S = 1e-3
#: Steps of a first bound of a correction by unit: 1 um, and 1e-5 deg.
_STEPS: Mapping[str, float] = {"mm": 1e-3, "deg": 1e-5}


@dataclass(frozen=True, slots=True)
class Bounds:
    """The largest correction of an axis, mm or deg, and by how much it changes in a second."""

    most: float
    rate: float

    @staticmethod
    def of(corrections: Array, backlash: float, unit: str) -> Bounds:
        """From corrections or errors of test vectors and the largest backlash, rounded up."""
        step = _STEPS[unit]
        most = math.ceil(_MORE * float(np.abs(corrections).max(initial=0.0)) / step + 1.0) * step
        return Bounds(round(most, 5), max(_LEAST_RATE, float(math.ceil(1.1 * backlash / _CYCLE_S))))


@dataclass(frozen=True, slots=True, eq=False)
class Code:
    """What is written: the tables of one machine, and the parts of C that read them.

    `axes` are their names with their `units`, mm or deg. `shapes` and `engine` are parts by name, around
    `tables`; `tips` gives axis values by where the tip is, or with `poses` the tool, where that is possible.
    `vectors` is the text of the test vectors, which the part `self_test` reads. `centred` says whether the
    centre of the payload counts. `linear` and `rotary` are the first bounds.
    """

    machine: str
    chain: str
    digest: str
    axes: tuple[str, ...]
    units: tuple[str, ...]
    shapes: tuple[str, ...]
    tables: tuple[str, ...]
    engine: tuple[str, ...]
    tips: tuple[str, ...]
    poses: bool
    self_test: str
    vectors: str
    sensors: tuple[Sensor, ...]
    payload_kg: float
    centred: bool
    linear: Bounds
    rotary: Bounds


@dataclass(frozen=True, slots=True)
class CodeFormat:
    """One format. `write` gives the files, the source first; `plain` the C text of a source, which a compiler
    takes with OLP_SELF_TEST; `vectors` is the file of test vectors beside a source."""

    key: str
    title: str
    ending: str
    status: str
    holds: str
    write: Callable[[Code, Path], Mapping[Path, bytes]]
    plain: Callable[[bytes], bytes]


def vectors_beside(target: Path) -> Path:
    """The file of test vectors beside a source."""
    return target.with_name(f"{target.stem}-vectors.txt")
