"""Files of a laser along face and body diagonals: tables [[diagonals]]."""

from __future__ import annotations

import numpy as np

from olp.calibration.observations.diagonals import Diagonal
from olp.core.schema import NotNegative, Table, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM
from olp.files.measurements.columns import read_columns
from olp.files.measurements.instruments.base import PER_UNIT, Instrument, Plan, SeenFile
from olp.files.measurements.instruments.self_described import InstrumentTable
from olp.files.measurements.line_keys import Sense
from olp.files.measurements.readings import SENSES
from olp.files.write import PathLike


class DiagonalKeys(Table):
    """What a file of a laser along a diagonal states about itself."""

    start_mm: Triple = Field(description="the axis positions of its start, [X, Y, Z] in mm")
    end_mm: Triple = Field(description="the axis positions of its end, [X, Y, Z] in mm")
    tool_mm: Triple = Field(description="the vector from the gauge point to the reflector, [X, Y, Z] in mm")
    sense: Sense = Field(description='"actual-minus-commanded" or "commanded-minus-actual"')
    sigma_um: NotNegative = Field(default=0.0, description="the standard uncertainty of one reading in um")
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the laser's scale in um/m"
    )


def read_diagonal(path: PathLike) -> Diagonal:
    """Read columns `target_mm,run,direction,value_um`: the distance from the start, and direction 1 away from
    it. Raises InputError, ConfigError."""
    columns, keys = read_columns(path, DiagonalKeys, ("target_mm", "run", "direction", "value_um"))
    return Diagonal(
        keys.start_mm,
        keys.end_mm,
        columns.number["target_mm"],
        columns.number["value_um"] * MM_PER_UM * SENSES[keys.sense],
        columns.number["run"].astype(np.int64),
        columns.number["direction"].astype(np.int64),
        keys.tool_mm,
        keys.sigma_um * MM_PER_UM,
        keys.sigma_scale_um_m * PER_UNIT,
        str(path),
    )


class DiagonalFiles(Instrument[InstrumentTable, Diagonal]):
    key = "diagonals"
    table = InstrumentTable
    marks = ("target_mm",)
    words = "tables [[diagonals]]: a laser along one face or body diagonal each"
    gives = Diagonal

    def proposed(self, seen: SeenFile) -> dict[str, object] | None:
        return super().proposed(seen) if "start_mm" in seen.stated else None

    def read(self, table: InstrumentTable, plan: Plan) -> Diagonal:
        return read_diagonal(plan.beside(table.file))
