"""Reads what a probe touched, from the log of a control: places of the tip in the order of the program.

A log is a list touch,X_mm,Y_mm,Z_mm as programs for LinuxCNC write it, the console of Grbl with a line
[PRB:x,y,z:1] for each touch, or DMIS output with the points.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.schema import Table
from olp.files.measurements.columns import read_columns
from olp.files.measurements.point_readings import AXIS
from olp.files.problems import Problem, config_error
from olp.files.write import PathLike, read_bytes
from olp.program.touches import Touches
from olp.results.dmis import is_dmis, read_dmis

#: A result of Grbl: three positions or more, and whether the probe answered.
_PRB = re.compile(rb"\[PRB:(-?[\d.]+),(-?[\d.]+),(-?[\d.]+)(?:,-?[\d.]+)*:([01])\]")
#: A touch is this near to its path across it, in mm: steps of the control and rounding of a log.
ACROSS_MM = 0.02
#: A place this near to the end of a touch, in mm, did not touch anything.
AT_END_MM = 1e-3


class LogKeys(Table):
    """A log states nothing about itself in comments."""


def read_touches(path: PathLike, touches: Touches) -> Array:
    """(n, 3) axis positions at which the probe answered. Raises InputError and ConfigError: each touch must
    be there once, in order, on its way."""
    file = str(path)
    data = read_bytes(path)
    if is_dmis(data):
        place, names, lines = _dmis(data, touches, file)
    elif _PRB.search(data):
        place, names, lines = _console(data, touches, file)
    else:
        columns, _ = read_columns(path, LogKeys, AXIS, words=("touch",))
        place = np.stack([columns.number[name] for name in AXIS], axis=1)
        names, lines = list(columns.word["touch"]), columns.line.tolist()
    if names != list(touches.labels):
        raise ConfigError(_order(names, touches), file=file)
    problems = list(_off_the_way(place, lines, touches))
    if problems:
        raise config_error(problems, file)
    return place


def _dmis(data: bytes, touches: Touches, file: str) -> tuple[Array, list[str], list[int]]:
    """Points on the surface, and directions out of it: the tip is its radius away."""
    reported = read_dmis(data)
    inside = [re.sub(r"\AFA\((.*)\)\Z", r"\1", str(name)) for name in reported.names]
    known = {label.upper(): label for label in touches.labels}
    names = [known.get(name.upper(), name) for name in inside]
    lines = np.asarray(reported.line).tolist()
    if names != list(touches.labels):
        raise ConfigError(_order(names, touches), file=file)
    place = reported.value_mm + touches.radius_mm * touches.normal - np.array(touches.tool_mm)
    return place, names, lines


def _console(data: bytes, touches: Touches, file: str) -> tuple[Array, list[str], list[int]]:
    """Machine positions that Grbl reports, in order."""
    places, lines, problems = [], [], []
    for found in _PRB.finditer(data):
        line = data.count(b"\n", 0, found.start()) + 1
        lines.append(line)
        places.append([float(found[k]) for k in (1, 2, 3)])
        if found[4] == b"0":
            problems.append((line, "the probe did not answer; touch again"))
    if problems:
        raise config_error(problems, file)
    names = list(touches.labels[: len(places)]) + ["?"] * (len(places) - len(touches.labels))
    return np.array(places), names, lines


def _order(names: list[str], touches: Touches) -> str:
    """The first difference between a log and its program."""
    for k, label in enumerate(touches.labels):
        if k >= len(names):
            return f"holds {len(names)} touches; expected {len(touches.labels)}: {label} is missing"
        if names[k] != label:
            return f'touch {k + 1} is "{names[k]}"; expected "{label}", in the order of the program'
    return f"holds {len(names)} touches; expected {len(touches.labels)}"


def _off_the_way(place: Array, lines: list[int], touches: Touches) -> Iterator[Problem]:
    """Touches that are not between the begin and the end of their way."""
    way = touches.end_mm - touches.start_mm
    long = np.linalg.norm(way, axis=1)
    way /= long[:, None]
    along = ((place - touches.start_mm) * way).sum(axis=1)
    across = np.linalg.norm(place - touches.start_mm - along[:, None] * way, axis=1)
    for k, label in enumerate(touches.labels):
        if across[k] > ACROSS_MM:
            yield (
                lines[k],
                f"{label} is {across[k]:.4g} mm beside its way; expected the log of this program, in axis "
                "positions in mm",
            )
        elif along[k] > long[k] - AT_END_MM:
            yield lines[k], f"{label} is at the end of its way: nothing was touched"
        elif along[k] < AT_END_MM:
            yield lines[k], f"{label} touched where it began; expected free way before the surface"
