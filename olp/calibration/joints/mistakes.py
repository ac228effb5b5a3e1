"""What may be wrong with readings of a machine of any joints: each mistake in words, and the readings put
right."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import PurePath

import numpy as np

from olp.calibration.joints.adjustment import OUTLIER, JointFit, starts_of
from olp.calibration.joints.candidates import SHIFTS
from olp.calibration.joints.deciding import log_odds
from olp.calibration.joints.readings import Ball, Lengths, Points, Reading, SixD, Start
from olp.core.arrays import Array
from olp.core.geometry import rotation_matrix
from olp.core.rigid_fit import Rigid
from olp.kinematics.errors import Payload
from olp.kinematics.poses import Poses
from olp.kinematics.structure import Structure

#: What is wrong, the readings put right, and the share of chi-square that may then be left.
Mended = tuple[str, list[Reading], float]
#: Readings put right have at most this share of chi-square.
RIGHT = 0.05
#: Of two values that are both stated, those with less than this share of chi-square are the commanded ones.
_EITHER = 0.5
#: Values that may be radians are at most this large: two turns and a half.
_RADIANS = 16.0
#: Values that may be degrees times 57.3 are beyond the travel by this factor.
_BEYOND = 1.05
#: mm in an inch.
_INCH = 25.4
#: um in a mm.
_UM = 1000.0
#: A mirror: together with the unknown frame it stands for all of them.
_MIRROR = np.diag((1.0, 1.0, -1.0))
_LEFT_HANDED = (
    "the frame of the tracker is left-handed: one of its axes is reversed, or two columns are exchanged"
)
#: Largest angle of a target that may be radians, as degrees would be read: half a turn.
_HALF_TURN = 3.15
#: At most so many readings that were left out are paired.
_PAIRED = 8


def mistakes(structure: Structure, readings: Sequence[Reading]) -> Iterator[Mended]:
    """One mistake each."""
    for words, changed in _of_axes(structure, readings):
        yield words, changed, RIGHT
    if any(one.read_back is not None for one in readings):
        yield "commanded values and those read back are in each other's columns", shown(readings), _EITHER
    yield from _of_payload(readings)
    for index, reading in enumerate(readings):
        name = PurePath(reading.source).name
        for words, mended in (*_of_rows(reading), *_of_names(reading), *_of_instrument(reading)):
            yield f"{name}: {words}", [*readings[:index], mended, *readings[index + 1 :]], RIGHT


def closer(readings: Sequence[Reading], mended: Sequence[Reading]) -> float:
    """By how much the log of the odds grows where balls are read in a larger unit than stated: readings lie
    closer together than noise has them."""
    whole = 0.0
    for one, other in zip(readings, mended, strict=True):
        if isinstance(one, Ball) and isinstance(other, Ball) and one.count == other.count:
            before, after = (float(np.linalg.norm(each.measured_mm)) for each in (one, other))
            whole += one.measured_mm.size * float(np.log(after / before)) if before and after else 0.0
    return whole


def _of_payload(readings: Sequence[Reading]) -> Iterator[Mended]:
    """A payload that a plan forgets, states where it was not, or takes for that of other readings."""
    held = {one.payload: PurePath(one.source).name for one in reversed(readings) if one.payload.kg}
    for index, reading in enumerate(readings):
        name, own = PurePath(reading.source).name, reading.payload
        others = [(f"the payload of {other} was on in these readings", load) for load, other in held.items()]
        if own.kg:
            others = [(f"the payload was that of {other}", load) for load, other in held.items()]
            others.append((f"the payload of {own.kg:g} kg was not on in these readings", Payload()))
        for words, load in others:
            if load != own:
                mended = replace(reading, payload=load)
                yield f"{name}: {words}", [*readings[:index], mended, *readings[index + 1 :]], RIGHT


def shown(readings: Sequence[Reading]) -> list[Reading]:
    """The readings with the values that the control showed, where these were noted."""
    return [
        one if one.read_back is None else replace(one, values=one.read_back, read_back=one.values)
        for one in readings
    ]


def _of_axes(structure: Structure, readings: Sequence[Reading]) -> Iterator[tuple[str, list[Reading]]]:
    largest = np.max([np.abs(reading.values).max(axis=0) for reading in readings], axis=0)
    joints = structure.joints
    most = dict(zip(joints, largest.tolist(), strict=True))
    turning = [name for name, joint in joints.items() if joint.kind == "rotary"]
    for name in joints:
        yield f"axis {name} runs the other way in these readings", _scaled(structure, readings, [name], -1.0)
    slides = [name for name in joints if name not in turning]
    small = [name for name in turning if most[name] < _RADIANS]
    wide = [name for name in turning if most[name] > _BEYOND * np.abs(joints[name].travel).max()]
    for group, what, factor in (
        (slides, "in inches", _INCH),
        (small, "in radians", float(np.degrees(1.0))),
        (wide, "57.3 times too large, as degrees that were taken for radians,", float(np.radians(1.0))),
    ):
        for names in dict.fromkeys((*((name,) for name in group), tuple(group)) if group else ()):
            axes = f"axis {names[0]} is" if len(names) == 1 else f"axes {', '.join(names)} are"
            yield f"{axes} {what} in these readings", _scaled(structure, readings, names, factor)
    for one, other in combinations(joints, 2):
        if joints[one].kind == joints[other].kind:
            columns = list(range(len(joints)))
            a, b = structure.order.index(one), structure.order.index(other)
            columns[a], columns[b] = b, a
            yield (
                f"axes {one} and {other} are in each other's columns",
                [replace(reading, values=reading.values[:, columns]) for reading in readings],
            )


def _scaled(
    structure: Structure, readings: Sequence[Reading], names: Sequence[str], factor: float
) -> list[Reading]:
    """Readings with the values of some axes times a factor."""
    scale = np.where(np.isin(structure.order, names), factor, 1.0)
    return [replace(reading, values=reading.values * scale) for reading in readings]


def _of_rows(reading: Reading) -> Iterator[tuple[str, Reading]]:
    for step, words in ((1, "later"), (-1, "earlier")):
        moved = np.roll(reading.values, -step, axis=0)
        yield f"each reading belongs one posture {words}", replace(reading, values=moved)


def _of_names(reading: Reading) -> Iterator[tuple[str, Reading]]:
    which = reading.which
    for k in range(len(reading.names)):
        for other in range(k):
            swapped = np.where(which == k, other, np.where(which == other, k, which))
            yield (
                f"{reading.names[k]} and {reading.names[other]} are swapped",
                replace(reading, which=swapped),
            )


def _of_instrument(reading: Reading) -> Iterator[tuple[str, Reading]]:
    """A frame that is mirrored, another unit, another sign."""
    changes: list[tuple[str, Callable[[Array], Array]]] = []
    if isinstance(reading, SixD):
        yield from _of_angles(reading)
    if isinstance(reading, Points | SixD):
        changes += [
            (_LEFT_HANDED, lambda m: m @ _MIRROR),
            ("positions are in inches", lambda m: m * _INCH),
            ("positions are in m", lambda m: m * _UM),
        ]
    if isinstance(reading, Lengths):
        changes += [("lengths are in inches", lambda m: m * _INCH), ("lengths are in m", lambda m: m * _UM)]
    if isinstance(reading, Ball) and np.any(reading.measured_mm):
        changes += [
            ("readings are of the other sign: ball against tip", lambda m: -m),
            ("readings are in mm, not um", lambda m: m * _UM),
        ]
        yield from _of_columns(reading)
        words = "workpiece" if reading.in_machine else "machine"
        yield (
            f"readings are along the axes of the {words}",
            replace(reading, in_machine=not reading.in_machine),
        )
    for words, change in changes:
        assert isinstance(reading, Points | SixD | Lengths | Ball)
        mended = replace(reading, measured_mm=change(reading.measured_mm))
        if isinstance(mended, SixD) and words == _LEFT_HANDED:
            mended = replace(mended, measured_turn=_MIRROR @ mended.measured_turn @ _MIRROR)
        yield words, mended


def _of_columns(reading: Ball) -> Iterator[tuple[str, Reading]]:
    """One column of a ball with the other sign, or two in each other's place."""
    for k, letter in enumerate(SHIFTS):
        signs = np.where(np.arange(3) == k, -1.0, 1.0)
        yield f"d{letter} is of the other sign", replace(reading, measured_mm=reading.measured_mm * signs)
    for a, b in combinations(range(3), 2):
        columns = [0, 1, 2]
        columns[a], columns[b] = b, a
        words = f"d{SHIFTS[a]} and d{SHIFTS[b]} are in each other's columns"
        yield words, replace(reading, measured_mm=reading.measured_mm[:, columns])


def _of_angles(reading: SixD) -> Iterator[tuple[str, Reading]]:
    """Angles of a target in radians, as small as these are."""
    angles = np.array([Rigid(turn, np.zeros(3)).angles_deg for turn in reading.measured_turn])
    if np.abs(angles).max() < _HALF_TURN:
        turns = np.stack([rotation_matrix((a, b, c)) for a, b, c in np.degrees(angles).tolist()])
        yield "angles of the target are in radians", replace(reading, measured_turn=turns)


def row_mistakes(fit: JointFit, readings: Sequence[Reading]) -> Iterator[tuple[str, float]]:
    """What readings that a fit left out are, where that is plain, with the log of its odds: two exchanged
    ones, or one of another nest, ball or centre."""
    starts, reduced = starts_of(fit.model, readings), fit.chi_square / fit.freedom
    near = OUTLIER * max(1.0, float(np.sqrt(reduced)))
    for start, source in zip(starts, fit.sources, strict=True):
        reading = start.reading
        name = PurePath(reading.source).name
        lines = [one.row for one in fit.left_out if one.source == reading.source][:_PAIRED]
        rows: list[int] = np.flatnonzero(np.isin(reading.row, lines)).tolist()
        pose = fit.model.machine(fit.theta, reading.payload).actual(reading.values)

        def away(one: Start, pose: Poses = pose, own: Array = source.own) -> Array:
            return np.asarray(one.predicted(pose, own)[:, :3])

        sigma, read, predicted = start.sigma[:3], start.measured[:, :3], away(start)

        def better(
            rows: list[int],
            other: Array,
            sigma: Array = sigma,
            read: Array = read,
            predicted: Array = predicted,
        ) -> float | None:
            """The log of the odds that rows are read as predicted otherwise; None where they are not."""
            then = (read[rows] - other[rows]) / sigma
            if np.abs(then).max() >= near:
                return None
            now = (read[rows] - predicted[rows]) / sigma
            return log_odds(float(np.sum(now**2)), float(np.sum(then**2)), reduced)

        for k, a in enumerate(rows):
            for b in rows[:k]:
                both, lines_of_both = [a, b], f"of lines {reading.row[b]} and {reading.row[a]} are exchanged"
                order = np.arange(reading.count)
                order[both] = both[::-1]
                odds = better(both, predicted[order]) if np.any(read) else None
                if odds is not None:
                    yield f"{name}: the readings {lines_of_both}", odds
                    continue
                other = replace(start, **{column: getattr(start, column)[order] for column in start.columns})
                odds = better(both, away(other, Poses(pose.rotation[order], pose.position[order])))
                if odds is not None:
                    yield f"{name}: the postures {lines_of_both}", odds
            for index in range(len(reading.names)):
                which = np.where(np.arange(reading.count) == a, index, reading.which)
                odds = better([a], away(replace(start, reading=replace(reading, which=which))))
                if index != reading.which[a] and odds is not None:
                    yield (
                        f"{name}: line {reading.row[a]} is of {reading.names[index]}, not of "
                        f"{reading.names[reading.which[a]]}",
                        odds,
                    )
