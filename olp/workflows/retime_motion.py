"""A planned motion without the report of it, as pages show it."""

from __future__ import annotations

from olp.core.progress import Progress, silent
from olp.files.sources import Source
from olp.trajectory.from_program import axis_limits
from olp.trajectory.variants import Plan, planned
from olp.workflows.doubt import doubted_motion
from olp.workflows.retime import RetimeOptions, case_of
from olp.workflows.session import Session


def motion(
    session: Session, program: Source, options: RetimeOptions, progress: Progress | None = None
) -> Plan:
    """The plan of `olp.workflows.retime.run` with these options, with the lines of the text that the program
    was unrolled from. Raises as that."""
    tell = progress or silent
    tell("read", 0.0)
    case = case_of(session, program, options)
    doubted_motion(case.program, session.of(case.setup), options.accept, options.date, program.name)
    return planned(case, axis_limits(session.setup.machine), tell).in_original()
