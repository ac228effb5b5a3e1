"""What the code of a finding means."""

from __future__ import annotations

from enum import IntEnum

from olp.core.values import dataclass


class Severity(IntEnum):
    """Ordered, so that `--fail-on warning` is a comparison."""

    INFO = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class Rule:
    """A code with its title, its severity, why it matters, what to do, and an example.

    `topic` is the module of the code. `gate` says whether `olp check` looks for it in a program. It does not
    look for findings of measured paths, of results, and of measurements of a machine. A `doubt` says that an
    input is not plausible: as an error it stops a run before anything is written, unless it is accepted. A
    refusal that `follows` may be there only because an earlier statement was refused.
    """

    code: str
    title: str
    severity: Severity
    why: str
    remedy: str
    example: str
    topic: str
    gate: bool = True
    doubt: bool = False
    follows: bool = False
