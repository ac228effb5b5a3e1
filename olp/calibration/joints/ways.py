"""Axis values that are off by the way an axis moved: those that a control showed, or backlash."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from olp.calibration.joints.adjustment import JointFit, block_of, starts_of
from olp.calibration.joints.mistakes import RIGHT, Mended
from olp.calibration.joints.readings import Reading, Start
from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array

#: Half the step of differences by an axis value, mm or deg.
_HALF = 1e-3
#: An axis is named where it comes short by more than so many standard deviations.
_SURE = 5.0
#: Combinations that readings show less than this share of the best one are not looked for.
_BLIND = 1e-9
#: Fewer postures do not tell ways apart.
_FEW = 10


def by_way(fit: JointFit, readings: Sequence[Reading]) -> Iterator[Mended]:
    """The readings with the values that axes moved to, where they stopped short of these by the way they
    came. The first posture of each file, which nothing comes before, is left out."""
    model = fit.model
    if min(reading.count for reading in readings) < _FEW:
        return
    mended, off, sigma = list[Reading](), [], []
    for start, source in zip(starts_of(model, readings), fit.sources, strict=True):
        later = start.only(np.arange(start.reading.count) > 0)
        ways = ways_of(start.reading.values)[1:]
        short, spread = _short(model, fit.theta, later, source.own, ways)
        mended.append(replace(later.reading, values=later.reading.values + short * ways))
        off.append(short)
        sigma.append(spread)
    joints = model.structure.joints
    # an axis that never moved has neither
    worst = np.argmax(np.abs(off) / np.maximum(sigma, np.finfo(float).tiny), axis=0)
    named = [
        f"{name} by {abs(off[source][k]):.2g} {joints[name].unit}"
        for k, (name, source) in enumerate(zip(model.structure.order, worst.tolist(), strict=True))
        if abs(off[source][k]) > _SURE * sigma[source][k]
    ]
    if named:
        words = (
            f"axes are off by the way they moved, {', '.join(named)}: values read back stand for commanded "
            "ones, or there is backlash"
        )
        yield words, mended, RIGHT


def ways_of(values: Array) -> Array:
    """(n, axes) 1 or -1 by the way in which each axis came to its value, 0 where it never moved yet."""
    ways = np.sign(np.diff(values, axis=0, prepend=values[:1]))
    for before, now in pairwise(ways):
        now[now == 0.0] = before[now == 0.0]
    return ways


def _short(model: Model, theta: Array, start: Start, own: Array, ways: Array) -> tuple[Array, Array]:
    """(axes,) by how much axes stop short, with standard deviations, mm or deg: what best explains readings
    together with changes of all unknowns."""
    (chunk,) = block_of(model, theta, start, own).chunks()
    reading = start.reading
    machine = model.machine(theta, reading.payload)
    columns = []
    for k in range(ways.shape[1]):
        step = _HALF * np.eye(ways.shape[1])[k]
        ends = (start.predicted(machine.actual(reading.values + sign * step), own) for sign in (1.0, -1.0))
        ahead, behind = ends
        columns.append(((ahead - behind) / (2.0 * _HALF) * ways[:, k, None]).ravel())
    table = np.column_stack((*columns, chunk.rows, chunk.local)) / chunk.sigma[:, None]
    rest = (chunk.y - chunk.rows @ theta - chunk.local @ own) / chunk.sigma
    size = np.maximum(np.linalg.norm(table, axis=0), np.finfo(float).tiny)
    left, values, right = np.linalg.svd(table / size, full_matrices=False)
    kept = values > _BLIND * values[0]
    inverse = right[kept].T / values[kept]
    found = inverse @ (left[:, kept].T @ rest)
    count = ways.shape[1]
    return found[:count] / size[:count], np.linalg.norm(inverse[:count], axis=1) / size[:count]
