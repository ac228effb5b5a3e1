"""The model as one C99 file without dependencies, for any control that runs C."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from olp.calibration.control_tables.residuals import BAND_MM
from olp.files.control_code import source, vectors
from olp.files.control_code.base import Code, CodeFormat, vectors_beside

_USE = """/* Each cycle: fill an olp_state, call olp_switch, then olp_follow with the axis position that the
   program wants; it gives the axis position to command. While something else moves the axes call olp_led
   instead. Bounds to start with: olp_first_bounds. */
"""


def _write(code: Code, target: Path) -> Mapping[Path, bytes]:
    head = source.remark(
        code.kept, code.digest, "The calibrated model of a machine, and its inverse at servo rate."
    )
    bounds = f"{{{code.most_mm()!r}, {code.rate_mm_s()!r}, 1.0, {BAND_MM!r}, 1}}"
    parts = [
        head,
        _USE,
        "#include <math.h>\n#include <string.h>\n",
        source.source(code.kept, code.digest),
        f"const olp_limits olp_first_bounds = {bounds};\n",
        source.part("self_test"),
    ]
    return {
        target: "\n".join(parts).encode("ascii"),
        vectors_beside(target): vectors.text(code.rows).encode("ascii"),
    }


FORMAT = CodeFormat(
    "c",
    "C99 source",
    ".c",
    "its own; compiled and compared with the model in the tests",
    "the model itself: 21 errors, tool, direction, payload, temperatures, maps; error and inverse",
    _write,
    lambda text: text,
)
