"""Sensors of temperature beside the readings of a line: what its error may do with each of them.

Every sensor stands for a part of the structure. A component grows with it in the three shapes of a thermal
structure (`olp.errormodel.distortion`): an offset, growth along the axis, and a bow, each per K.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.errormodel.distortion import SHAPES, shapes

#: What 1 K may do: offset, growth over 1 m and bow, standard deviations in mm.
LENGTH_PER_K = 0.02, 0.03, 0.01
#: The same of angles, in rad.
ANGLE_PER_K = 20e-6, 20e-6, 10e-6
#: Unknowns of growth are per m, so that all have one size.
_SIZE = np.array((1.0, 1e-3, 1.0))
#: A sensor that changes less than this over all lines tells nothing, K.
LEAST_K = 0.1


def shapes_of(name: str, warm: Sequence[str]) -> tuple[str, ...]:
    """The shapes of a component among those that change with temperature. An offset of the tip along X is
    one, whichever axis it comes from, so that only one component holds it."""
    row = [one for one in warm if one[1] == name[1]]
    own = f"E{name[1]}{name[1]}"
    holds = name[1] in "ABC" or name == (own if own in row else row[0])
    return SHAPES if holds else SHAPES[1:]


def per_kelvin(name: str, sensors: int, kinds: Sequence[str] = SHAPES) -> Array:
    """(shapes x sensors,) standard deviations of the unknowns of a component before any reading, mm or
    rad."""
    sizes = ANGLE_PER_K if name[1] in "ABC" else LENGTH_PER_K
    return np.tile(sizes[len(SHAPES) - len(kinds) :], sensors)


def warmed(
    span_mm: tuple[float, float], q: Array, rise_K: Mapping[str, Array], kinds: Sequence[str] = SHAPES
) -> Array:
    """(n, shapes x sensors) what each unknown adds at q (n,), from the rise of each sensor (n,)."""
    form = (shapes(span_mm, q) * _SIZE)[:, len(SHAPES) - len(kinds) :]
    columns = [form * rise[:, None] for rise in rise_K.values()]
    return np.concatenate(columns, axis=1) if columns else np.zeros((len(q), 0))


def coefficients(unknowns: Array, kinds: Sequence[str]) -> Array:
    """(sensors, 3) offset, growth per mm, and bow, of unknowns (shapes x sensors,)."""
    own = unknowns.reshape(-1, len(kinds))
    return np.asarray(np.pad(own, ((0, 0), (len(SHAPES) - len(kinds), 0))) * _SIZE)


def own_columns(target_mm: Array, sensors_degC: Mapping[str, Array]) -> Array:
    """(n, 3 sensors) of a line by itself: over its own targets, from the means of its own temperatures."""
    low, high = float(target_mm.min()), float(target_mm.max())
    rise = {name: own - own.mean() for name, own in sensors_degC.items()}
    return warmed((low, max(high, low + 1.0)), target_mm, rise)


def ranges_of(lines: Sequence[tuple[str, Mapping[str, Array]]]) -> dict[str, tuple[float, float]]:
    """The lowest and highest temperature of each sensor over all lines that have some; each line with its
    file. Raises ConfigError where lines have different sensors, or one of them tells nothing."""
    every: dict[str, list[Array]] = {}
    for file, sensors in lines:
        if set(sensors) != set(lines[0][1]):
            raise ConfigError(
                f"it has the sensors {', '.join(sorted(sensors))}, and {lines[0][0]} has "
                f"{', '.join(sorted(lines[0][1]))}; expected the same in all lines with sensors",
                file=file,
            )
        for name, own in sensors.items():
            every.setdefault(name, []).append(own)
    ranges = {
        name: (float(min(one.min() for one in own)), float(max(one.max() for one in own)))
        for name, own in every.items()
    }
    for name, (low, high) in ranges.items():
        if high - low < LEAST_K:
            raise ConfigError(
                f"sensor {name} changes by {high - low:.2g} K over all lines, so what it does is not "
                "observable; read lines while the machine is cold and warm, or leave its column out",
                file=lines[0][0],
            )
    return ranges


def middle_of(lines: Sequence[Mapping[str, Array]]) -> dict[str, float]:
    """The mean temperature of each sensor over the readings of all lines, to 0.1 K: curves hold there."""
    names = lines[0] if lines else ()
    return {name: round(float(np.concatenate([one[name] for one in lines]).mean()), 1) for name in names}
