"""Planted blunders in campaigns on machines of any joints, and what a fit says of them.

A blunder has a clear effect where the calibration is off by more than it states, and where it is refused.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

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
    or "refused", whether the cause was named, and what was said."""

    size: float
    alarms: tuple[str, ...]
    named: bool
    said: str

    @property
    def loud(self) -> bool:
        return self.size > LOUD

    @property
    def silent(self) -> bool:
        return self.loud and not self.alarms


def blunders(campaign: Campaign) -> Iterator[JointBlunder]:
    """Some of each kind that this campaign can have."""
    rng, order = np.random.default_rng(campaign.rng.integers(1 << 30)), campaign.machine.order
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
    index = int(rng.integers(len(campaign.runs)))
    run = campaign.runs[index]

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
    if run.which is not None and len(set(run.which[1])) > 1:
        column, names = run.which
        one, other = sorted(set(names))[:2]
        swap = {one: other, other: one}
        both = [swap.get(name, name) for name in names]
        yield _planted(
            campaign, index, "names swapped", ("are swapped",), dataclasses.replace(run, which=(column, both))
        )
        wrong = [*names]
        wrong[a] = next(name for name in sorted(set(names)) if name != names[a])
        single = dataclasses.replace(run, which=(column, wrong))
        yield _planted(campaign, index, "one name", (f"line {a + 2} is of {names[a]}",), single)
    for index, run in enumerate(campaign.runs):
        if "payload_kg" in run.table:
            bare = "\n".join(line for line in run.table.split("\n") if not line.startswith("payload"))
            yield _planted(campaign, index, "payload", ("payload",), dataclasses.replace(run, table=bare))


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
    size = float(np.sqrt(np.mean(off**2) / np.mean(stated**2)))
    return JointOutcome(size, alarms, _named(blunder, said), "; ".join(said))


def _named(blunder: JointBlunder, said: list[str]) -> bool:
    return any(all(words in one for words in blunder.words) for one in said)
