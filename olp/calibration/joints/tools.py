"""A tool vector that is another one than stated: the one with which readings fit best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from olp.calibration.joints.adjustment import adjusted, starts_of
from olp.calibration.joints.mistakes import RIGHT, Mended
from olp.calibration.joints.readings import Reading
from olp.calibration.joints.unknowns import Model
from olp.core.errors import CannotCompute, ConfigError

#: mm: so far off a tool vector may be.
_ANY_MM = 100.0
#: mm: readings settle with a tool vector that is off by less.
_UNSETTLING_MM = 1.0
#: Steps within which readings settle.
_QUICK = 7


def other_tools(model: Model, readings: Sequence[Reading], *, settles: bool) -> Iterator[Mended]:
    """By each tool vector that is stated the one that it may have been, in all readings with it. Where these
    do not settle as they are, one that is off by little is not why."""
    for stated in dict.fromkeys(reading.tool_mm for reading in readings):
        own = [reading.tool_mm == stated for reading in readings]
        opened = [
            replace(reading, tool_sigma=_ANY_MM) if mine else reading
            for reading, mine in zip(readings, own, strict=True)
        ]
        try:
            fit = adjusted(model, starts_of(model, opened), _QUICK)
        except (CannotCompute, ConfigError):
            continue
        change = np.mean([one.own[-3:] for one, mine in zip(fit.sources, own, strict=True) if mine], axis=0)
        far = float(np.linalg.norm(change))
        # farther off is another machine
        if not (0.0 if settles else _UNSETTLING_MM) <= far <= _ANY_MM:
            continue
        x, y, z = (float(number) for number in np.array(stated) + change)
        mended = [
            replace(reading, tool_mm=(x, y, z)) if mine else reading
            for reading, mine in zip(readings, own, strict=True)
        ]
        names = ", ".join(
            PurePath(reading.source).name for reading, mine in zip(readings, own, strict=True) if mine
        )
        words = (
            f"{names}: the tool was about [{x:.2f}, {y:.2f}, {z:.2f}] mm, and not {list(stated)}; measure it "
            "and state tool_mm"
        )
        yield words, mended, RIGHT
