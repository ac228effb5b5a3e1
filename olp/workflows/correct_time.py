"""What a correction costs in time: both programs planned as `olp retime` does."""

from __future__ import annotations

from typing import Any, Protocol

from olp.core.errors import OlpError
from olp.core.progress import Progress, silent
from olp.files.sources import Source
from olp.workflows.flatten import UnrollOptions
from olp.workflows.retime import RetimeOptions, durations
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


def with_time(
    session: Session, program: Source, result: Both, options: UnrollOptions, tell: Progress | None
) -> None:
    """State `times` in the report of a correction, or why they are not known: those of long programs are not,
    unless they are there."""
    if "time" not in result.report and result.report["moves"]["total"] > MOST_UNASKED:
        result.report["time"] = {"unknown": LONG}
    elif "time" not in result.report:
        try:
            result.report["time"] = times(session, program, result, options, tell)
        except OlpError as error:
            result.report["time"] = {"unknown": str(error)}


def times(
    session: Session, program: Source, result: Both, options: UnrollOptions, tell: Progress | None
) -> dict[str, Any]:
    """Seconds of the nominal and the corrected text of a `program`, and what the correction adds as a share.
    Texts of more than `MOST_OPTIMISED` waypoints are planned without optimised speeds. Raises as `durations`.
    """
    asked = RetimeOptions(
        flatten=options.flatten, expand_cycles=options.expand_cycles,
        peck_clearance_mm=options.peck_clearance_mm,
    )  # fmt: skip
    texts = [program.holding(text) for text in (result.nominal, result.plain)]
    (nominal, corrected), optimised = durations(session, texts, asked, MOST_OPTIMISED, tell or silent)
    return {
        "nominal_s": nominal,
        "corrected_s": corrected,
        "share": corrected / nominal - 1.0 if nominal else 0.0,
        "optimised": optimised,
    }
