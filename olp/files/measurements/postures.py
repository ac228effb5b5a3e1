"""Files of postures: CSV with comments `# key = value`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.calibration.iso230.postures import Postures, turn_of
from olp.core.errors import ConfigError
from olp.core.machine import Tool
from olp.core.schema import NotNegative, Table, Text
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM
from olp.files.measurements.columns import read_columns
from olp.files.problems import config_error
from olp.files.write import PathLike


class PostureKeys(Table):
    """What a file of postures states about itself."""

    sigma_um: NotNegative = Field(
        default=0.0, description="the standard uncertainty of one coordinate of a posture in um"
    )
    point: Text | None = Field(
        default=None, description="a description of the point that was touched, for the report"
    )


def read_postures(path: PathLike, tools: Mapping[int, Tool] | None = None) -> Postures:
    """Read columns `X_mm,Y_mm,Z_mm,tool[,TX_mm,TY_mm,TZ_mm][,A_deg,B_deg,C_deg]`.

    They hold axis positions, the name of the tool, its nominal vector in the frame of the head, and the
    rotation Rz(C) Ry(B) Rx(A) of the head. Without TX_mm to TZ_mm, tools are numbers of `tools`. Raises
    InputError, ConfigError.
    """
    vector, turn = ("TX_mm", "TY_mm", "TZ_mm"), ("A_deg", "B_deg", "C_deg")
    columns, keys = read_columns(path, PostureKeys, ("X_mm", "Y_mm", "Z_mm"), (*vector, *turn), ("tool",))
    number, n = columns.number, len(columns.line)
    given = [name for name in vector if name in number]
    if given and len(given) < 3:
        raise ConfigError(f"has {', '.join(given)}; expected all of {', '.join(vector)}", file=str(path))
    if given:
        vectors = np.column_stack([number[name] for name in vector])
    else:
        vectors = np.array([
            _vector(name, int(line), tools or {}, str(path))
            for name, line in zip(columns.word["tool"], columns.line, strict=True)
        ])  # fmt: skip
    angles = [number.get(name, np.zeros(n)) for name in turn]
    return Postures(
        np.column_stack([number[name] for name in ("X_mm", "Y_mm", "Z_mm")]),
        columns.word["tool"], vectors, turn_of(angles[0], angles[1], angles[2]),
        keys.sigma_um * MM_PER_UM, str(path),
    )  # fmt: skip


def _vector(name: str, line: int, tools: Mapping[int, Tool], file: str) -> tuple[float, float, float]:
    tool = tools.get(int(name)) if name.isdigit() else None
    if tool is None or tool.tool_vector_mm is None:
        sentence = (
            f"tool {name} has no vector; expected the columns TX_mm, TY_mm, TZ_mm, or a tool number of the "
            "machine file (-m) with gauge_to_tip_mm or a length"
        )
        raise config_error([(line, sentence)], file)
    return tool.tool_vector_mm
