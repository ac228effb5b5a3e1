"""Planted blunders: readings of a simulated machine with one thing wrong, how large that is against what all
other readings predict, and whether a fit says so."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from cases.calibration import cloud, measurements_of, rays, two_pods
from judge import families, simulated

from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.normal import Block, Chunk, Normal
from olp.calibration.observations.base import Observation, State
from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points
from olp.core.errors import OlpError
from olp.workflows.calibrate_fit import FittedCalibration, fit_calibration

#: Kind, words and observation of a blunder.
What = tuple[str, str, Observation]
#: The seed of another machine of the same family is larger by this.
OTHER = 5000
#: What lines are taken together with.
MIXTURES = ("points", "stations", "pods", "circles")
#: Findings and refusals that speak against the readings.
ALARMS = ("OLP808", "OLP810", "OLP811")
#: Non-centrality from which no blunder may pass in silence.
LOUD = 7.0
#: A report that says beforehand what may stay hidden states at least this share of the harm.
TOLD = 0.5
#: um; a change of errors that is no harm.
NO_HARM_UM = 1.0
#: Places in the box where harm is looked for.
PLACES = 200


@dataclasses.dataclass(frozen=True)
class Blunder:
    """What is wrong with the observation of a number, a part of the words that name it, "" where no words can
    tell it from others, and what is read instead."""

    index: int
    kind: str
    words: str
    planted: Observation


@dataclasses.dataclass(frozen=True)
class Size:
    """How large a blunder is against what all others say: `noncentrality` by both uncertainties, `redundancy`
    the share of its square by the noise of the source alone that remains."""

    noncentrality: float
    redundancy: float


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What a fit says of a blunder: `alarms` are the codes of findings, or "refused". `harm_um` is what it
    does to errors in the box, `stated_um` what the report says that the source may hide."""

    noncentrality: float
    redundancy: float
    alarms: tuple[str, ...]
    named: bool
    harm_um: float = 0.0
    stated_um: float = 0.0

    @property
    def loud(self) -> bool:
        """Whether it may not pass in silence."""
        return self.noncentrality >= LOUD

    @property
    def silent(self) -> bool:
        return not self.alarms and self.loud

    @property
    def told(self) -> bool:
        """Whether the report says beforehand that the source may hide what it did, or nothing was done."""
        return self.stated_um > TOLD * self.harm_um or self.harm_um < NO_HARM_UM


def readings(seed: int, family: str, mixture: str) -> Measurements:
    """A machine's lines with 9 to 13 targets, and other readings of it."""
    machine = families.machine(seed, family)
    taken = measurements_of(simulated.all_lines(machine, seed, runs=3, count=(13, 11, 9)))
    more: dict[str, Callable[[], tuple[Observation, ...]]] = {
        "points": lambda: (cloud(machine, seed, 60, 6.0),),
        "stations": lambda: rays(machine, seed, 4, 50),
        "pods": lambda: (two_pods(machine, seed, 120),),
        "circles": lambda: (*_diagonals(machine, seed), *_circles(machine, seed)),
    }
    return dataclasses.replace(
        taken, observations=(*taken.observations, *more[mixture]()), chain=machine.chain
    )


def _diagonals(machine: simulated.Machine, seed: int) -> Iterator[Diagonal]:
    low, high = machine.box.T
    for k, side in enumerate(((1, 1, 1), (1, 0, 1), (0, 1, 1), (0, 0, 1))):
        start = np.where(side, low, high)
        end = low + high - start
        a, b = tuple(start.tolist()), tuple(end.tolist())
        columns = simulated.diagonal(machine, seed, a, b, simulated.TOOL)
        yield Diagonal(a, b, *columns, simulated.TOOL, source=f"diagonal-{k}.csv")


def _circles(machine: simulated.Machine, seed: int) -> Iterator[Circles]:
    for plane in ("XY", "YZ", "ZX"):
        centre = (1500.0, 1000.0, -500.0)
        columns = simulated.circles(machine, seed, plane, centre, 300.0, simulated.TOOL)
        yield Circles(
            plane, 300.0, centre, columns[0], columns[1], columns[2], columns[3], simulated.TOOL,
            sigma=3e-4, source=f"circle-{plane.lower()}.csv",
        )  # fmt: skip


def blunders(seed: int, family: str, mixture: str) -> list[Blunder]:
    """Everything that is planted in readings, one at a time."""
    others = readings(seed + OTHER, family, mixture).observations
    found = []
    for k, one in enumerate(readings(seed, family, mixture).observations):
        planted = [*_PLANTS[type(one)](one), ("another machine", "", others[k])]
        found += [Blunder(k, *what) for what in planted]
    return found


def _factors(one: Any, units: tuple[tuple[str, float, str], ...]) -> Iterator[What]:
    for kind, factor, words in (("sign", -1.0, "sign"), *units):
        value = factor * one.value
        yield (kind, words, dataclasses.replace(one, value=value))


_LENGTHS = (("25.4", 1 / 25.4, "of an inch"), ("25.4", 25.4, "of an inch"), ("1000", 1e-3, "in mm"))
_ANGLES = (("4.848", 4.8481368, "arcsec"), ("4.848", 1 / 4.8481368, "arcsec"), ("1000", 1e-3, "mm/m"))


def _of_line(line: Line) -> Iterator[What]:
    angle = line.quantity == "angle"
    yield from _factors(line, _ANGLES if angle else _LENGTHS)
    ends = line.target_mm.min() + line.target_mm.max()
    turned = dataclasses.replace(line, target_mm=ends - line.target_mm, direction=-line.direction)
    yield ("direction", "other way", turned)
    if angle:
        letters = [d for d in "ABC" if d != line.component[1]]
        for letter in letters:
            name = f"E{letter}{line.component[2]}"
            yield ("columns", f"it is {line.component}", dataclasses.replace(line, component=name))
        return
    place = list(line.line_mm)
    place[(line.axis + 1) % 3] += 600.0
    yield ("place", "another place", dataclasses.replace(line, line_mm=tuple(place)))
    tool = (line.tool_mm[0] + 150.0, line.tool_mm[1] - 100.0, line.tool_mm[2] + 120.0)
    yield ("lever", "another lever arm", dataclasses.replace(line, tool_mm=tool))
    if line.quantity == "positioning":
        stretched = line.value + 1.1e-5 * 5.0 * (line.target_mm - line.target_mm.min())
        yield ("temperature", "scale", dataclasses.replace(line, value=stretched))


def _of_diagonal(one: Diagonal) -> Iterator[What]:
    yield from _factors(one, _LENGTHS)
    turned = dataclasses.replace(one, distance_mm=one.length_mm - one.distance_mm, direction=-one.direction)
    yield ("direction", "other way", turned)


def _of_circles(one: Circles) -> Iterator[What]:
    yield from _factors(one, _LENGTHS)
    turned = dataclasses.replace(one, angle_rad=-one.angle_rad, direction=-one.direction)
    yield ("direction", "clockwise", turned)


def _of_points(one: Points) -> Iterator[What]:
    mirrored = one.measured_mm * np.array((1.0, 1.0, -1.0))
    yield ("handedness", "left-handed", dataclasses.replace(one, measured_mm=mirrored))
    scaled = one.measured_mm * (1.0 + 6e-5)
    yield ("scale", "scale of its own", dataclasses.replace(one, measured_mm=scaled))
    yield ("lever", "tool vectors are swapped", dataclasses.replace(one, tool_mm=one.tool_mm[:, [1, 0, 2]]))


def _of_lengths(one: Lengths) -> Iterator[What]:
    scaled = one.length_mm * (1.0 + 6e-5)
    yield ("scale", "scale of its own", dataclasses.replace(one, length_mm=scaled))
    yield ("lever", "tool vectors are swapped", dataclasses.replace(one, tool_mm=one.tool_mm[:, [1, 0, 2]]))


def _of_pods(one: Pods) -> Iterator[What]:
    yield ("handedness", "other way round", dataclasses.replace(one, azimuth_rad=-one.azimuth_rad))
    yield ("lever", "tool vectors are swapped", dataclasses.replace(one, tool_mm=one.tool_mm[:, [1, 0, 2]]))
    baselines = tuple((i, j, 1.0002 * apart, sigma) for i, j, apart, sigma in one.baselines)
    yield ("scale", "a baseline", dataclasses.replace(one, baselines=baselines))


_PLANTS: dict[type, Callable[[Any], Iterator[What]]] = {
    Line: _of_line, Diagonal: _of_diagonal, Circles: _of_circles, Points: _of_points, Lengths: _of_lengths,
    Pods: _of_pods,
}  # fmt: skip


def outcome(taken: Measurements, clean: FittedCalibration, blunder: Blunder) -> Outcome:
    """What the fit of the readings with a blunder says."""
    changed = list(taken.observations)
    changed[blunder.index] = blunder.planted
    size = size_of(taken, clean.fit, blunder)
    try:
        fitted = fit_calibration(dataclasses.replace(taken, observations=tuple(changed)))
    except OlpError as error:
        named = bool(blunder.words) and blunder.words in str(error)
        return Outcome(size.noncentrality, size.redundancy, ("refused",), named)
    alarms = tuple(sorted({one.code for one in fitted.findings if one.code in ALARMS}))
    words = [one.message for one in fitted.findings if one.code in {"OLP810", "OLP811"}]
    source = blunder.planted.source
    named = any(one.startswith(source) and blunder.words in one for one in words)
    stated = max(row["hidden_harm_um"] for row in fitted.report["agreement"] if row["file"] == source)
    harm = harm_of(taken, clean.fit, fitted.fit)
    return Outcome(size.noncentrality, size.redundancy, alarms, named, harm, stated)


def harm_of(taken: Measurements, clean: Fit, bad: Fit) -> float:
    """The largest change of errors in the box, in um, with the tools of the readings."""
    place = np.random.default_rng(3).uniform(*bad.box_mm.T, (PLACES, 3))
    tools = np.unique(np.concatenate([np.atleast_2d(one.tool_mm) for one in taken.observations]), axis=0)
    off = [bad.error(place, tool) - clean.error(place, tool) for tool in tools]
    return float(1e3 * np.linalg.norm(off, axis=-1).max())


def size_of(taken: Measurements, clean: Fit, blunder: Blunder) -> Size:
    """The size of a blunder; infinite where its readings cannot be used at all."""
    try:
        return size(clean, blunder.index, taken.observations[blunder.index], blunder.planted)
    except OlpError:
        return Size(np.inf, 1.0)


def size(clean: Fit, index: int, taken: Observation, planted: Observation) -> Size:
    """By how many standard deviations a blunder moves what a source says of the unknowns, against what all
    other readings and the prior predict of what is stated to have been read."""
    # with all its readings, also those that the fit left out
    state = _started(taken, clean.results[index].state)
    stated = clean.block(_started(planted, state))
    own, shifted = (Normal.of(clean.parameters.size) for _ in range(2))
    own.add(stated)
    shifted.add(_shift(clean, clean.block(state), stated))
    away, share = _against(_given(clean, index), own.H, shifted.g)
    some = share > 1e-3
    alone = away[some] ** 2 / share[some]
    both = float(np.sum(alone / (1.0 + share[some])))
    return Size(float(np.sqrt(both)), both / max(float(np.sum(alone)), 1e-300))


def _against(covariance: np.ndarray, own: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A source against the covariance of what all others say: what is on its right side, and the share of its
    precision `own`, in the directions in which the others have a standard deviation of 1."""
    columns = np.flatnonzero(own.any(axis=0))
    variance, vectors = np.linalg.eigh(covariance[np.ix_(columns, columns)])
    root = vectors * np.sqrt(np.maximum(variance, 0.0))
    share, directions = np.linalg.eigh(root.T @ own[np.ix_(columns, columns)] @ root)
    return directions.T @ (root.T @ right[columns]), share


@lru_cache(maxsize=64)
def _given(clean: Fit, index: int) -> np.ndarray:
    """The covariance of the unknowns by the prior and all sources but one."""
    of = _precisions(clean)
    total = clean.prior.precision()[0] + sum(one for k, one in enumerate(of) if k != index)
    scale = np.sqrt(np.diag(total))
    covariance = np.linalg.inv(total / np.outer(scale, scale) + 1e-13 * np.eye(len(scale)))
    return np.asarray(covariance / np.outer(scale, scale))


@lru_cache(maxsize=2)
def _precisions(clean: Fit) -> list[np.ndarray]:
    """What every source says of the unknowns."""
    every = []
    for result in clean.results:
        one = Normal.of(clean.parameters.size)
        one.add(clean.block(result.state))
        every.append(one.H)
    return every


def _started(observation: Observation, like: State) -> State:
    """An observation as it begins, with the noise of another state."""
    state, noise = observation.start(), getattr(like, "noise", None)
    return state if noise is None else dataclasses.replace(state, noise=noise)  # type: ignore[type-var]


def _shift(clean: Fit, right: Block, stated: Block) -> Block:
    """The rows of a source as it is stated with a blunder, and the change of its residuals by that as
    readings."""
    theta = clean.theta

    def residuals(of: Block) -> list[np.ndarray]:
        return [chunk.y - chunk.rows @ theta[of.columns] for chunk in of.chunks()]

    def chunks() -> Iterator[Chunk]:
        for chunk, before, after in zip(stated.chunks(), residuals(right), residuals(stated), strict=True):
            yield Chunk(chunk.rows, after - before, chunk.sigma, chunk.local)

    return Block(stated.columns, stated.precision, chunks)


@lru_cache(maxsize=4)
def clean_fit(seed: int, family: str, mixture: str) -> tuple[Measurements, FittedCalibration]:
    """Readings without a blunder, and their fit."""
    taken = readings(seed, family, mixture)
    return taken, fit_calibration(taken)
