"""DMIS programs that touch points, each a feature of its own, so that the results hold every touch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.program.dialect import Dialect
from olp.program.touches import Touches

#: Name of the sensor that the program defines.
SENSOR = "OLP"


def probing_program(dialect: Dialect, touches: Touches, digits: int, notes: Sequence[str], log: str) -> bytes:
    """Touches in the frame of the machine, in places of the tip: axis positions plus the tool vector.

    Points and directions of `PTMEAS` are those of the surface. `log` names the results.
    """
    tool = np.array(touches.tool_mm)
    approach = float(np.abs((touches.start_mm - touches.contact_mm) * touches.normal).sum(axis=1).max())
    speed = touches.feed_mm_min / 60.0
    lines = [
        f"DMISMN/'{log}',05.2",
        *(f"$$ {note}".encode("ascii", "replace").decode() for note in notes),
        "UNITS/MM,ANGDEC",
        f"DECPL/ALL,{digits}",
        f"FEDRAT/MESVEL,MMPS,{speed:g}",
        f"SNSET/APPRCH,{approach:.{digits}f}",
        f"SNSET/RETRCT,{approach:.{digits}f}",
        f"S({SENSOR})=SNSDEF/PROBE,FIXED,CART,{_numbers(tool, digits)},0,0,-1,{2.0 * touches.radius_mm:g}",
        "MODE/PROG,MAN",
        f"SNSLCT/S({SENSOR})",
    ]
    surface = touches.contact_mm + tool - touches.radius_mm * touches.normal
    places, number = touches.moves()
    for place, touch in zip(places + tool, number.tolist(), strict=True):
        if touch < 0:
            lines.append(f"GOTO/CART,{_numbers(place, digits)}")
            continue
        label = touches.labels[touch]
        point = f"CART,{_numbers(surface[touch], digits)},{_numbers(touches.normal[touch], 6)}"
        lines += [f"F({label})=FEAT/POINT,{point}", f"MEAS/POINT,F({label}),1", f"  PTMEAS/{point}", "ENDMES"]
        lines.append(f"OUTPUT/FA({label})")
    return ("\n".join([*lines, "ENDFIL"]) + "\n").encode()


def _numbers(values: Array, digits: int) -> str:
    return ",".join(f"{value + 0.0:.{digits}f}" for value in values.tolist())
