"""Planted blunders in campaigns on machines of any joints, and what a fit says of them.

A blunder has a clear effect where the calibration is off by more than it states, and where it is refused.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from cases.joint_campaigns import Array, Campaign, Run

import olp
from olp.core.errors import OlpError

#: Findings that speak against the readings.
ALARMS = ("OLP802", "OLP808", "OLP810")
#: A calibration that is off by more than so many times what it states may not pass in silence.
LOUD = 2.0


@dataclasses.dataclass(frozen=True)
class JointBlunder:
    """Readings with one thing wrong, and parts of the words that name it."""

    kind: str
    words: tuple[str, ...]
    runs: tuple[Run, ...]


@dataclasses.dataclass(frozen=True)
class JointOutcome:
    """How far the calibration is off, by what it states (infinite where there is none), the codes of findings
    or "refused", whether the cause was named, and what was said. It was `told` where the report says that
    nothing excludes this mistake, and what it costs."""

    size: float
    alarms: tuple[str, ...]
    named: bool
    said: str
    told: bool = False

    @property
    def loud(self) -> bool:
        return self.size > LOUD

    @property
    def silent(self) -> bool:
        return self.loud and not self.alarms


def blunders(campaign: Campaign) -> Iterator[JointBlunder]:
    """Some of each kind that this campaign can have."""
    rng = np.random.default_rng(campaign.rng.integers(1 << 30))
    yield from _of_axes(campaign, rng)
    index = int(rng.integers(len(campaign.runs)))
    yield from _of_rows(campaign, rng, index)
    yield from _of_names(campaign, rng, index)
    for index, run in enumerate(campaign.runs):
        if "payload_kg" in run.table:
            bare = "\n".join(line for line in run.table.split("\n") if not line.startswith("payload"))
            yield _planted(campaign, index, "payload", ("payload",), dataclasses.replace(run, table=bare))
    yield from _of_instrument(campaign, rng)


def _of_axes(campaign: Campaign, rng: np.random.Generator) -> Iterator[JointBlunder]:
    """Signs and units of axis values, and columns of two axes that are exchanged."""
    order = campaign.machine.order
    turning = np.array([campaign.machine.kind(name) == "rotary" for name in order])
    for axis in rng.permutation(np.flatnonzero(turning))[:2].tolist():
        one = np.arange(len(order)) == axis
        words = f"axis {order[axis]} "
        yield JointBlunder(
            "sign", (f"{words}runs the other way",), _times(campaign, np.where(one, -1.0, 1.0))
        )
        scale = np.where(one, np.radians(1.0), 1.0)
        yield JointBlunder("radians", (f"{words}is in radians",), _times(campaign, scale))
    if turning.sum() > 1:
        every = tuple(name for name, turns in zip(order, turning, strict=True) if turns)
        scale = np.where(turning, np.radians(1.0), 1.0)
        yield JointBlunder("all radians", (*every, "in radians"), _times(campaign, scale))
    if turning.any():
        scale = np.where(turning, np.degrees(1.0), 1.0)
        yield JointBlunder("degrees twice", ("57.3 times too large",), _times(campaign, scale))
    if not turning.all():
        axis = int(rng.choice(np.flatnonzero(~turning)))
        one = np.arange(len(order)) == axis
        words = f"axis {order[axis]} "
        signs = np.where(one, -1.0, 1.0)
        yield JointBlunder("sign of a slide", (f"{words}runs the other way",), _times(campaign, signs))
        every = np.where(turning, 1.0, 1.0 / 25.4)
        yield JointBlunder("inches", ("in inches",), _times(campaign, every))
    for kind in (turning, ~turning):
        if kind.sum() > 1:
            a, b = sorted(rng.choice(np.flatnonzero(kind), 2, replace=False).tolist())
            columns = np.arange(len(order))
            columns[[a, b]] = b, a
            words = (f"axes {order[a]} and {order[b]} are in each other's columns",)
            runs = (dataclasses.replace(run, values=run.values[:, columns]) for run in campaign.runs)
            yield JointBlunder("columns of axes", words, tuple(runs))


def _of_rows(campaign: Campaign, rng: np.random.Generator, index: int) -> Iterator[JointBlunder]:
    """Postures that belong to other readings, and values that the control showed."""
    run, order = campaign.runs[index], campaign.machine.order
    turning = np.array([campaign.machine.kind(name) == "rotary" for name in order])
    rolled = np.roll(run.values, int(rng.choice([-1, 1])), axis=0)
    yield _planted(campaign, index, "shifted rows", ("one posture",), dataclasses.replace(run, values=rolled))
    a, b = sorted(rng.choice(len(run.values), 2, replace=False).tolist())
    swapped = np.arange(len(run.values))
    swapped[[a, b]] = b, a
    exchanged = dataclasses.replace(run, values=run.values[swapped])
    yield _planted(
        campaign, index, "two postures", (f"of lines {a + 2} and {b + 2} are exchanged",), exchanged
    )
    off = rng.uniform(4e-4, 8e-4, len(order)) * np.where(turning, np.degrees(1.0), 100.0)
    early = run.values - off * np.sign(np.diff(run.values, axis=0, prepend=run.values[:1] + 1.0))
    shown = dataclasses.replace(run, values=early, shown=run.values)
    yield _planted(campaign, index, "read back", ("read back",), shown)
    alone = dataclasses.replace(run, values=early)
    yield _planted(campaign, index, "read back alone", ("values read back",), alone)
    wrong = run.values.copy()
    axis = int(rng.integers(len(order)))
    wrong[a, axis] += rng.choice((-1.0, 1.0)) * np.ptp(run.values[:, axis]) * 0.1
    typed = dataclasses.replace(run, values=wrong)
    yield _planted(campaign, index, "one value", ("line", f" {a + 2}"), typed)


def _of_names(campaign: Campaign, rng: np.random.Generator, index: int) -> Iterator[JointBlunder]:
    """Names of nests, balls, centres or planes in each other's place."""
    run = campaign.runs[index]
    if run.which is None or len(set(run.which[1])) < 2:
        return
    column, names = run.which
    one, other = sorted(set(names))[:2]
    swap = {one: other, other: one}
    both = [swap.get(name, name) for name in names]
    yield _planted(
        campaign, index, "names swapped", ("are swapped",), dataclasses.replace(run, which=(column, both))
    )
    a, wrong = int(rng.integers(len(names))), [*names]
    wrong[a] = next(name for name in sorted(set(names)) if name != names[a])
    single = dataclasses.replace(run, which=(column, wrong))
    yield _planted(campaign, index, "one name", (f"line {a + 2} is of {names[a]}",), single)


def _of_instrument(campaign: Campaign, rng: np.random.Generator) -> Iterator[JointBlunder]:
    """Frame, axes, units and tool of what was read, and readings of another machine."""
    kind = campaign.instrument

    def read(name: str, words: str, change: Callable[[Array], Array]) -> JointBlunder:
        runs = (dataclasses.replace(run, read=change(run.read)) for run in campaign.runs)
        return JointBlunder(name, (words,), tuple(runs))

    if kind in ("tracker", "payload"):
        a, b = sorted(rng.choice(3, 2, replace=False).tolist())
        order = [b if k == a else a if k == b else k for k in range(3)]
        yield read("handedness", "left-handed", lambda read: read * (1.0, -1.0, 1.0))
        yield read("columns read", "left-handed", lambda read: read[:, order])
    if kind in ("tracker", "payload", "6D"):
        yield read("inches read", "in inches", lambda read: _lengths(read, 1.0 / 25.4))
        yield read("m read", "in m", lambda read: _lengths(read, 1e-3))
    if kind == "6D":
        yield read("handedness", "left-handed", _mirrored)
        yield read("angles in radians", "angles", lambda read: _angles(read, np.radians(1.0)))
    if kind == "ball-bar":
        yield read("inches read", "in inches", lambda read: read / 25.4)
    if kind in ("R-test", "two balls"):
        a, b = sorted(rng.choice(3, 2, replace=False).tolist())
        order = [b if k == a else a if k == b else k for k in range(3)]
        yield read("columns read", "each other's columns", lambda read: read[:, order])
        yield read("mm read", "in mm", lambda read: 1e-3 * read)
        yield read("ball against tip", "other sign", lambda read: -read)
        signs = np.where(np.arange(3) == a, -1.0, 1.0)
        yield read("one sign read", f"d{'XYZ'[a]} is of the other sign", lambda read: read * signs)
        axes = (run.table.replace('"workpiece"', '"machine"') for run in campaign.runs)
        runs = (dataclasses.replace(run, table=table) for run, table in zip(campaign.runs, axes, strict=True))
        yield JointBlunder("axes of the readings", ("along the axes",), tuple(runs))
    longer = campaign.tool + np.array((0.0, 0.0, rng.choice((-10.0, 10.0))))
    runs = (
        dataclasses.replace(run, table=run.table.replace(f"{campaign.tool.tolist()}", f"{longer.tolist()}"))
        for run in campaign.runs
    )
    yield JointBlunder("tool", ("tool",), tuple(runs))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / campaign.structure
        seed = int(rng.integers(1 << 30))
        another = Campaign(place, campaign.structure, kind, seed, campaign.size)
    yield JointBlunder("another machine", ("another machine",), tuple(another.runs))


def _lengths(read: Array, factor: float) -> Array:
    return np.concatenate((read[:, :3] * factor, read[:, 3:]), 1)


def _angles(read: Array, factor: float) -> Array:
    return np.concatenate((read[:, :3], read[:, 3:] * factor), 1)


def _mirrored(read: Array) -> Array:
    """Poses as an instrument would have them whose Y runs the other way."""
    return read * (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)


def _planted(campaign: Campaign, index: int, kind: str, words: tuple[str, ...], other: Run) -> JointBlunder:
    return JointBlunder(kind, words, (*campaign.runs[:index], other, *campaign.runs[index + 1 :]))


def _times(campaign: Campaign, factors: Array) -> tuple[Run, ...]:
    return tuple(dataclasses.replace(run, values=run.values * factors) for run in campaign.runs)


def outcome(campaign: Campaign, blunder: JointBlunder) -> JointOutcome:
    """What a fit says."""
    runs = campaign.runs
    campaign.runs = list(blunder.runs)
    try:
        fitted = olp.fit_joint_calibration(campaign.written(), campaign.folder / "machine.toml")
    except OlpError as error:
        return JointOutcome(np.inf, ("refused",), _named(blunder, [str(error)]), str(error))
    finally:
        campaign.runs = runs
    off, stated = campaign.off(fitted, *campaign.judged())
    alarms = tuple(sorted({one.code for one in fitted.findings if one.code in ALARMS}))
    said = [one.message for one in fitted.findings if one.code == "OLP810"]
    # a single wrong value is named by its line
    said += [one.message for one in fitted.findings if one.code == "OLP802" and blunder.kind == "one value"]
    size = float(np.sqrt(np.mean(off**2) / np.mean(stated**2)))
    told = _named(blunder, [one.message for one in fitted.findings if one.code == "OLP812"])
    return JointOutcome(size, alarms, _named(blunder, said), "; ".join(said), told)


def _named(blunder: JointBlunder, said: list[str]) -> bool:
    return any(all(words in one for words in blunder.words) for one in said)
