"""What may be wrong with a source of readings, by the odds of all others."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import field

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.errormodel.quality import Fitted

#: What may be wrong in one fit, at most: ten mistakes of each of twenty sources.
_TRIED = 200
#: Share of fits of sound readings in which one of them may be named.
_BY_CHANCE = 0.01
#: Nats by which something is named as wrong with a source. Sound readings give such odds for one mistake with
#: at most the inverse of them as its chance, whatever the mistake.
NAMED = math.log(_TRIED / _BY_CHANCE)
#: Nats by which the others have to confirm what is named: 20 to 1.
_CONFIRMED = math.log(20.0)
#: Such a cause explains at least this share of what a source contradicts, by the evidence.
EXPLAINS = 0.9
#: Nats by which others confirm one reading at most: what its curve may be over its noise is below e^10.
_PER_READING = 10.0
#: Nats by which something is excluded: 100 to 1.
EXCLUDED = math.log(100.0)


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """Something that may be wrong with a source, its kind and in words, and its log odds (nats) against what
    was read. `support` are its log odds against a source that says nothing: whether the others confirm it.
    What is `sought` may be named by itself; the rest is excluded or not. `change` (size,) is by how much the
    unknowns are others if it is so."""

    kind: str
    words: str
    log_odds: float
    support: float
    sought: bool = True
    change: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def confirmed(self) -> bool:
        """Whether the others confirm it."""
        return self.support > _CONFIRMED

    @property
    def beyond_doubt(self) -> bool:
        """Whether what was read is beyond doubt not so, and this explains it."""
        return self.confirmed and self.log_odds > NAMED


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """A source against all others: `misfit` is the sum of z^2 over as many directions as freedom, `tried` is
    what may be wrong with it, the most probable first. `against` is the log odds (nats) that it says nothing
    of this machine. `rivals` are the names of sources of which one is wrong as probably instead, `number` is
    its place among all sources. `beside` is its misfit in that of others of its kind."""

    label: str
    component: str
    misfit: Fitted
    tried: tuple[Tried, ...]
    against: float
    rivals: tuple[str, ...] = ()
    number: int = 0
    beside: Fitted | None = None

    @property
    def name(self) -> str:
        """Its file, and the component that it reads."""
        other = self.component and self.component != self.label
        return f"{self.label} ({self.component})" if other else self.label

    @property
    def named(self) -> Tried | None:
        """What is wrong with it beyond doubt. Where something that is sought is, so is something else that
        explains it better."""
        found = [tried for tried in self.tried if tried.beyond_doubt]
        return found[0] if any(tried.sought for tried in found) else None

    @property
    def explained(self) -> float:
        """How much (nats) what is named explains, as far as it can: what others tell of a sound source where
        they follow a wrong one is no more than absurd."""
        most = self.against + _PER_READING * self.misfit.freedom
        return min(self.named.log_odds, most) if self.named is not None else -math.inf

    @property
    def causes(self) -> str:
        """What is wrong with it in words, with all that is not excluded against what is most probable."""
        best = self.named
        if best is None:
            return ""
        return _in_words((one for one in self.tried if one.sought or one.beyond_doubt), best.log_odds)

    @property
    def likely(self) -> str:
        """In words what explains nearly all that it contradicts though the others do not confirm it, with all
        that is not excluded against that."""
        sought = [tried for tried in self.tried if tried.sought]
        best = max((tried.log_odds for tried in sought), default=-np.inf)
        return _in_words(sought, best) if best > max(NAMED, EXPLAINS * self.against) else ""

    @property
    def contradicts(self) -> bool:
        """Whether it is better to leave it out than to believe it, whatever is wrong with it."""
        return (self.misfit.failed and self.against > NAMED) or self.unlike_its_kind

    @property
    def unlike_its_kind(self) -> bool:
        """Whether it fits far worse than others of its kind. What it has of its own was taken for ripple of
        the machine, so all of them seem to fit."""
        return self.beside is not None and self.beside.failed

    @property
    def doubt(self) -> float:
        """The largest log odds (nats) that something is wrong with it; above `NAMED` it is told."""
        odds = [tried.log_odds for tried in self.tried if tried.sought and tried.confirmed]
        return max([*odds, self.against if self.misfit.failed else -np.inf])

    @property
    def open(self) -> tuple[Tried, ...]:
        """What may be wrong with it without notice, as the readings do not exclude it."""
        return tuple(tried for tried in self.tried if tried.log_odds > -EXCLUDED)


def _in_words(tried: Iterable[Tried], best: float) -> str:
    """In words what is not excluded against log odds of `best`."""
    return ", or ".join(one.words for one in tried if one.log_odds > best - EXCLUDED)
