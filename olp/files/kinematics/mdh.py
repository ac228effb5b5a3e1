"""A machine file from a table of modified Denavit-Hartenberg parameters: a row for each rotary joint."""

from __future__ import annotations

import math
from collections.abc import Sequence

from olp.core.errors import InputError
from olp.files.columns import Wanted, finite, missing, names, read_sheet, unknown
from olp.files.kinematics.families import arm
from olp.files.kinematics.written import WIDE_DEG, Written, machine_file
from olp.files.problems import Problem, config_error
from olp.files.write import PathLike, read_bytes

#: The columns of a row, as in Craig, Introduction to Robotics (2005).
COLUMNS = ("a_mm", "alpha_deg", "d_mm", "theta0_deg")
#: The ends of travel of each joint; both or none.
ENDS = ("min_deg", "max_deg")


def machine_of_mdh(path: PathLike, name: str, controller: str | None = None) -> Written:
    """The machine file of an arm, from a CSV file with the columns `COLUMNS` and perhaps `ENDS`. Raises
    InputError where the file cannot be read, ConfigError with every problem."""
    wanted = Wanted(f"holds no rows; expected {','.join(COLUMNS)}", _header, _number)
    sheet = read_sheet(read_bytes(path), str(path), wanted)
    if sheet.problems:
        raise config_error(sheet.problems, str(path))
    if not sheet.rows:
        raise InputError("holds no joints; expected a row for each", file=str(path))
    columns = sheet.columns
    rows = [
        (float(a), float(alpha), float(d), float(theta))
        for a, alpha, d, theta in zip(*(columns[name] for name in COLUMNS), strict=True)
    ]
    travels = []
    if ENDS[0] in columns:
        travels = list(zip(columns[ENDS[0]].tolist(), columns[ENDS[1]].tolist(), strict=True))
        problems: list[Problem] = [
            (int(line), f"min_deg = {low:g} is not below max_deg = {high:g}")
            for line, (low, high) in zip(sheet.lines, travels, strict=True)
            if not low < high
        ]
        if problems:
            raise config_error(problems, str(path))
    notes = ["The table states no least increments; 0.001 deg is written: give those of the control"]
    if not travels:
        notes.append(
            f"The table states no travel; {WIDE_DEG[0]:g} to {WIDE_DEG[1]:g} deg is written: give "
            f"{' and '.join(ENDS)}"
        )
    return machine_file(arm(rows, travels), name, controller, notes)


def _header(line: int, header: Sequence[str]) -> list[Problem]:
    wanted = (*COLUMNS, *(ENDS if any(end in header for end in ENDS) else ()))
    known = (*COLUMNS, *ENDS)
    return [*names(line, header, lambda _, name: unknown(name, known)), *missing(line, header, wanted)]


def _number(name: str, cell: str) -> tuple[float, str | None]:
    value = finite(cell)
    wrong = f'{name} = "{cell}"; expected a number in {name.rpartition("_")[2]}'
    return value, wrong if math.isnan(value) else None
