"""The model as one C99 file without dependencies, for any control that runs C."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from olp.calibration.control_tables.residuals import BAND_MM
from olp.files.control_code import source
from olp.files.control_code.base import Code, CodeFormat, vectors_beside

_USE = """/* Each cycle: fill an olp_state, call olp_switch, then olp_follow with the axis values that the
   program wants; it gives the axis values to command. While something else moves the axes call olp_led
   instead. Bounds to start with: olp_first_bounds. */
"""


def _write(code: Code, target: Path) -> Mapping[Path, bytes]:
    linear, rotary = code.linear, code.rotary
    first = (linear.most, rotary.most, linear.rate, rotary.rate, 1.0, BAND_MM)
    parts = [
        source.remark(code, "The calibrated model of a machine, and its inverse at servo rate."),
        _USE,
        "#include <math.h>\n#include <string.h>\n",
        source.source(code),
        f"const olp_limits olp_first_bounds = {{{', '.join(map(repr, first))}, 1}};\n",
        source.part(code.self_test),
    ]
    return {
        target: "\n".join(parts).encode("ascii"),
        vectors_beside(target): code.vectors.encode("ascii"),
    }


FORMAT = CodeFormat(
    "c",
    "C99 source",
    ".c",
    "its own; compiled and compared with the model in the tests",
    "the model itself: errors of axes and chain, tool, direction, payload, temperatures; and its inverse",
    _write,
    lambda text: text,
)
