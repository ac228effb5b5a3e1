"""The readings of one instrument in files: its table in a plan and its own files, read and written.

An instrument is one module. It holds the keys of its table, and reads the table into an `Observation`. Where
a plan can ask for the instrument, it also writes the table. Observations and their `State` are in
`olp.calibration.observations`. `olp.files.measurements.instruments.registry` lists all instruments.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar, Generic, TypeVar

import numpy as np

from olp.calibration.observations.base import Observation, Scattered
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.machine import Vector
from olp.core.schema import Table
from olp.core.values import dataclass
from olp.files.measurements.line_keys import LineKeys
from olp.files.measurements.point_readings import AXIS, TOOL, PointReadings

#: um/m as a ratio.
PER_UNIT = 1e-6
#: A ratio in um/m.
UM_M = 1e6

T = TypeVar("T", bound=Table)
Taken = TypeVar("Taken", bound=Observation)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What a plan states for all its tables: its path, [defaults], the axis along gravity and the chain."""

    path: Path
    defaults: LineKeys
    vertical: str = "Z"
    chain: str | None = None

    def beside(self, file: str) -> Path:
        """The path of a file that the plan names."""
        return self.path.parent / file


@dataclass(frozen=True, slots=True)
class SeenFile:
    """What a file of readings shows of itself: its name, the names of its columns, its comments `# key =
    value` as written, and the component where its format states one."""

    name: str
    header: tuple[str, ...]
    stated: Mapping[str, str]
    component: str | None = None


class Instrument(ABC, Generic[T, Taken]):
    """`key` of its tables in a plan, the model of one table, and `words` on them for the schema. `gives` is
    the type of observation. `plans` says that files for future readings can be written. A file that has the
    columns `marks` is one of its files, and `asks` are keys of its table that a person has to state."""

    key: ClassVar[str]
    table: ClassVar[type[Table]]
    words: ClassVar[str]
    gives: ClassVar[type[Observation]]
    plans: ClassVar[bool] = False
    marks: ClassVar[tuple[str, ...]] = ()
    asks: ClassVar[tuple[str, ...]] = ()

    def proposed(self, seen: SeenFile) -> dict[str, object] | None:
        """The keys of its table that a file shows by itself; None where it is not a file of this
        instrument."""
        return {} if self.marks and set(self.marks) <= set(seen.header) else None

    @abstractmethod
    def read(self, table: T, plan: Plan) -> Taken:
        """The readings that one table names. Raises InputError where a file cannot be read, ConfigError with
        every problem."""

    def asked(self, taken: Taken, name: str) -> list[str]:
        """The lines of its table in a plan of future readings, whose file is `name`."""
        raise NotImplementedError

    def empty(self, taken: Taken, rows: Index) -> bytes:
        """Its file to fill in: `rows` are readings of `taken` in the order of visiting."""
        raise NotImplementedError


def tools_of(readings: PointReadings, tool_mm: Vector | None, defaults: LineKeys) -> Array:
    """The vector of each point, from the file or from the plan. Raises ConfigError."""
    tool = tool_mm or defaults.tool_mm
    if readings.tool_mm is not None:
        if tool_mm is not None:
            raise ConfigError("tool_mm is stated here and in columns of the file; expected it once")
        return readings.tool_mm
    if tool is None:
        raise ConfigError("tool_mm is missing; expected it here, or the columns tool_X_mm ... in the file")
    return np.array(tool)


def points_to_fill(cloud: Scattered, rows: Index, wanted: Sequence[str]) -> bytes:
    """A CSV file of axis positions and tool vectors with empty columns `wanted`."""
    lines = [",".join((*AXIS, *TOOL, *wanted))]
    for k in rows.astype(int).tolist():
        cells = [f"{v:g}" for v in (*cloud.axis_mm[k].tolist(), *cloud.tool_mm[k].tolist())]
        lines.append(",".join(cells) + "," * len(wanted))
    return ("\n".join(lines) + "\n").encode()
