"""What a worker of a batch does with a program of a machine with rotary joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from olp.core.errors import UsageError
from olp.files.sources import Parcel
from olp.workflows.batch_task import Config, Outcome, Task, counts, heading
from olp.workflows.correct import CorrectOptions
from olp.workflows.joints.correct import JointCorrection, JointOptions, correction_of
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.report import filed
from olp.workflows.joints.verify import JointVerification, verified


def outcome(config: Config, parcel: Parcel, task: Task) -> Outcome:
    """A program corrected, or a released one judged. Raises as `correct_joints`, and UsageError for what is
    not built for such a machine."""
    options = _options(task)
    run = JointRun.of(
        parcel.source(task.program), config.machine, config.job, config.dialect, parcel, config.calibration
    )
    if task.released is not None:
        return Outcome(_row(verified(run, parcel.source(task.released, task.program), options)))
    done = correction_of(run, options)
    if options.times:
        from olp.workflows.joints.correct_time import with_time

        with_time(run, done, asked=True)
    result = JointCorrection.of(run, done)
    report = filed(result.report, task.report, options.date) if task.report else None
    page = None if task.page is None else task.page.of_joints(run, options, done, task.output)
    return Outcome(_row(result), result.data, report, page)


def _options(task: Task) -> JointOptions:
    given, usual = task.options, CorrectOptions()
    own = {field.name for field in fields(JointOptions)}
    values = {field.name: getattr(given, field.name) for field in fields(CorrectOptions)}
    other = [name for name, value in values.items() if name not in own and value != getattr(usual, name)]
    if other:
        raise UsageError(
            f"--{other[0].replace('_', '-')} does not go with machines with rotary joints yet; correct this "
            "program in a call of its own, without it"
        )
    return JointOptions(**{name: value for name, value in values.items() if name in own})


def _row(result: JointCorrection | JointVerification) -> Mapping[str, Any]:
    """The row of a summary, as of other machines: figures of the report, none of its own."""
    stated = result.report
    deviation, part = stated["deviation"], stated.get("part")
    return {
        **heading(stated),
        "uncorrected_um": deviation["before"]["position_max_um"],
        "corrected_um": deviation["after"]["position_max_um"],
        "allowed_um": deviation["allowed_um"],
        "holds": deviation["holds"],
        "part_tolerance_um": None if part is None else part["tolerance_um"],
        "part_ok": None if part is None else part["holds"],
        "ok": stated["verdict"]["ok"],
        "sentences": [],
        "findings": counts(result.findings),
    }
