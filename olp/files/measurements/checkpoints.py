"""Points of one set-up: a CSV file that states in comments how it was taken, or the points of a plan.

    # sigma_um = 8
    # tool_mm = [0.0, 0.0, -120.0]
    # frame = "instrument"
    X_mm,Y_mm,Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm

Columns deviation_X_um, deviation_Y_um, deviation_Z_um (actual minus commanded) may replace the measured ones.
"""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Literal

import numpy as np

from olp.calibration.observations.points import Points
from olp.core.errors import ConfigError
from olp.core.machine import Vector
from olp.core.schema import NotNegative, Positive, Table, Triple, fields_of
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM
from olp.files.measurements.instruments.base import PER_UNIT
from olp.files.measurements.point_readings import DEVIATION, MEASURED, parse_point_readings
from olp.files.measurements.reader import load_measurements
from olp.files.measurements.stated import stated_as
from olp.files.problems import config_error
from olp.files.write import PathLike, read_bytes

#: The key of positions in the frame of the machine.
MACHINE = "machine"


class StatedOfPoints(Table):
    """What a file of points may state about itself in comments `# key = value`."""

    sigma_um: Positive | None = Field(
        default=None, description="the standard uncertainty of a coordinate, in um"
    )
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the instrument's scale, in um/m"
    )
    tool_mm: Triple | None = Field(
        default=None, description="the vector from the gauge point to the reflector, [X, Y, Z] in mm"
    )
    frame: Literal["machine", "instrument"] = Field(
        default="instrument",
        description='the frame of measured positions: "machine", or "instrument" (unknown)',
    )


def load_checkpoints(
    path: PathLike, *, sigma_um: float | None = None, tool_mm: Vector | None = None
) -> tuple[Points, bool]:
    """The points of one set-up, and whether they are in the machine's frame.

    `sigma_um` and `tool_mm` apply where the file does not state them. Raises InputError where the file cannot
    be read, and ConfigError with every problem.
    """
    source = FilePath(path)
    if source.is_dir() or source.suffix.lower() == ".toml":
        sets = load_measurements([source]).of(Points)
        if len(sets) != 1:
            sentence = f"holds {len(sets)} sets of points; expected one; name its file"
            raise ConfigError(sentence, file=str(path))
        return sets[0], False
    data = read_bytes(source)
    header = next((line for line in data.splitlines() if line.strip() and not line.startswith(b"#")), b"")
    deviates = b"deviation_" in header
    readings = parse_point_readings(data, str(path), DEVIATION if deviates else MEASURED)
    keys = {key: value for key, value in readings.keys.items() if key in fields_of(StatedOfPoints)}
    stated = stated_as(keys, StatedOfPoints, readings.file, bare=False)
    problems = []
    if stated.sigma_um is not None and sigma_um is not None and stated.sigma_um != sigma_um:
        problems.append(f"sigma_um = {stated.sigma_um:g}, but {sigma_um:g} in the call; expected it once")
    sigma = stated.sigma_um if stated.sigma_um is not None else sigma_um
    own = readings.sigma_mm
    if own is not None and sigma is not None:
        problems.append("sigma_um is stated beside columns of uncertainties; expected it once")
    elif own is None and sigma is None:
        problems.append("the uncertainty of a coordinate is not stated; expected a comment # sigma_um = 8")
    if readings.tool_mm is not None and stated.tool_mm is not None:
        problems.append("tool_mm is stated in a comment and in columns; expected it once")
    tool = stated.tool_mm if stated.tool_mm is not None else tool_mm
    if readings.tool_mm is None and tool is None:
        problems.append(
            "the vector from the gauge point to the reflector is not stated; expected columns tool_X_mm, "
            "tool_Y_mm, tool_Z_mm, or a comment # tool_mm = [0.0, 0.0, -120.0]"
        )
    if problems:
        raise config_error([(None, text) for text in problems], str(path))
    vector = np.array(tool) if readings.tool_mm is None else readings.tool_mm
    measured = readings.measured
    if deviates:
        measured = readings.axis_mm + vector + readings.measured * MM_PER_UM
    points = Points(
        axis_mm=readings.axis_mm,
        tool_mm=vector,
        measured_mm=measured,
        sigma=own or (sigma or 0.0) * MM_PER_UM,
        sigma_scale=stated.sigma_scale_um_m * PER_UNIT,
        source=str(path),
        row=readings.row,
        covariance_mm2=readings.covariance_mm2,
    )
    return points, stated.frame == MACHINE
