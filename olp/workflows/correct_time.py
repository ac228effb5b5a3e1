"""What a correction costs in time: both programs planned as `olp retime` does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from olp.core.errors import OlpError
from olp.core.progress import Progress, silent
from olp.files.sources import Source
from olp.workflows.flatten import UnrollOptions
from olp.workflows.session import Session

#: Waypoints of a program whose speeds are optimised along dense curves.
MOST_OPTIMISED = 20_000
#: Moves of a program that is timed without being asked: more take longer to plan than to correct.
MOST_UNASKED = 50_000
LONG = f"a program of more than {MOST_UNASKED} moves is timed with --times alone"


class Both(Protocol):
    """A correction: both texts, unrolled, and its report."""

    @property
    def nominal(self) -> bytes: ...

    @property
    def plain(self) -> bytes: ...

    @property
    def report(self) -> dict[str, Any]: ...


def timed(moves: int, *, asked: bool) -> bool:
    """Whether the motion of a program of so many moves is planned, in a report and on a page."""
    return asked or moves <= MOST_UNASKED


def with_time(
    session: Session, program: Source, result: Both, options: UnrollOptions, tell: Progress | None,
    *, asked: bool = False,
) -> None:  # fmt: skip
    """State `times` in the report of a correction, or why they are not known; `asked` as in `state`."""
    total = result.report["moves"]["total"]
    state(result.report, total, lambda: times(session, program, result, options, tell), asked=asked)


def state(
    report: dict[str, Any], moves: int, plan: Callable[[], dict[str, Any]], *, asked: bool = False
) -> None:
    """State times in the report of a program of so many moves, or why they are not known: those of long
    programs are not, unless they are there or a call has `asked` for them."""
    if "time" in report:
        return
    if timed(moves, asked=asked):
        try:
            report["time"] = plan()
        except OlpError as error:
            report["time"] = {"unknown": str(error)}
    else:
        report["time"] = {"unknown": LONG}


def cost(nominal_s: float, corrected_s: float, optimised: bool) -> dict[str, Any]:
    """The times of both programs, and what the correction adds as a share."""
    share = corrected_s / nominal_s - 1.0 if nominal_s else 0.0
    return {"nominal_s": nominal_s, "corrected_s": corrected_s, "share": share, "optimised": optimised}


def times(
    session: Session, program: Source, result: Both, options: UnrollOptions, tell: Progress | None
) -> dict[str, Any]:
    """Seconds of the nominal and the corrected text of a `program`, and what the correction adds as a share.
    Texts of more than `MOST_OPTIMISED` waypoints are planned without optimised speeds. Raises as `durations`.
    """
    # a long program states no times, and needs no planner
    from olp.workflows.retime import RetimeOptions, durations

    asked = RetimeOptions(
        flatten=options.flatten, expand_cycles=options.expand_cycles,
        peck_clearance_mm=options.peck_clearance_mm,
    )  # fmt: skip
    texts = [program.holding(text) for text in (result.nominal, result.plain)]
    (nominal, corrected), optimised = durations(session, texts, asked, MOST_OPTIMISED, tell or silent)
    return cost(nominal, corrected, optimised)
