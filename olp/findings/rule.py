"""What a finding's code stands for."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Severity(IntEnum):
    """Ordered, so that `--fail-on warning` is a comparison."""

    INFO = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class Rule:
    """A code with its title, its usual severity, why it matters, what to do, and a case of it.

    `topic` says what it is about; `gate` whether `olp check` looks for it in a program: findings of measured
    paths, of results, and of measurements of a machine are not for it.
    """

    code: str
    title: str
    severity: Severity
    why: str
    remedy: str
    example: str
    topic: str
    gate: bool = True
