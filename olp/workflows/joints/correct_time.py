"""What a correction costs in time on a machine with rotary joints: both programs planned as by `retime`."""

from __future__ import annotations

from typing import Any, Protocol

from olp.compensation.joints.path import JointPath
from olp.core.progress import Progress, silent
from olp.workflows.correct_time import MOST_OPTIMISED, cost, state
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.retime import JointRetimeOptions, motion_of


class Both(Protocol):
    """A correction: both paths, and its report."""

    @property
    def nominal(self) -> JointPath: ...

    @property
    def corrected(self) -> JointPath: ...

    @property
    def report(self) -> dict[str, Any]: ...


def with_time(run: JointRun, done: Both, tell: Progress | None = None, *, asked: bool = False) -> None:
    """State `times` in the report of a correction, or why they are not known; `asked` as in `state`."""
    state(done.report, len(done.nominal), lambda: times(run, done, tell), asked=asked)


def times(run: JointRun, done: Both, tell: Progress | None = None) -> dict[str, Any]:
    """Seconds of the nominal and the corrected program, and what the correction adds as a share. Programs of
    more than `MOST_OPTIMISED` moves are planned without optimised speeds. Raises as `retime_joints`."""
    optimised = max(len(done.nominal), len(done.corrected)) <= MOST_OPTIMISED

    def seconds(path: JointPath) -> float:
        options = JointRetimeOptions()
        return motion_of(run, path, options, tell or silent, optimise=None if optimised else False).duration_s

    return cost(seconds(done.nominal), seconds(done.corrected), optimised)
