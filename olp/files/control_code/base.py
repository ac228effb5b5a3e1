"""What a format of control code is, and the bounds with which it starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.files.control_code.carried import Carried

#: Share by which the first bound of a correction exceeds the largest error of the test vectors.
_MORE = 1.5
#: mm/s; the least first bound of the rate of a correction.
_LEAST_RATE = 5.0
#: s; the servo cycle within which the largest backlash is crossed.
_CYCLE_S = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Code:
    """What is written: the model, the hash of its calibration, and the test vectors."""

    kept: Carried
    digest: str
    rows: Array

    def most_mm(self) -> float:
        """The first bound of a correction, to 1 um upward."""
        return math.ceil(_MORE * float(np.abs(self.rows[:, -3:]).max(initial=0.0)) * 1e3 + 1.0) / 1e3

    def rate_mm_s(self) -> float:
        """The first bound of its rate."""
        return max(_LEAST_RATE, math.ceil(1.1 * self.kept.backlash_mm() / _CYCLE_S))


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
