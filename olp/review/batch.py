"""The review pages of programs of a batch."""

from __future__ import annotations

from olp.core.values import dataclass
from olp.files.sources import Source
from olp.review import job
from olp.workflows.correct import Correction, CorrectOptions
from olp.workflows.joints.correct import JointOptions, ProvedJoints
from olp.workflows.joints.loaded import JointRun
from olp.workflows.session import Session


@dataclass(frozen=True, slots=True)
class Pages:
    """Pages of `olp view` on corrections, each as one file: see `olp.workflows.batch_task.Page`."""

    def of_three(
        self, session: Session, source: Source, options: CorrectOptions, correction: Correction,
        corrected_name: str,
    ) -> bytes:  # fmt: skip
        """On three linear axes."""
        viewed = job.ViewOptions(**options.proof(), outside_box=options.outside_box)
        review = job.run(session, source, viewed, correction=correction, corrected_name=corrected_name)
        return review.html()

    def of_joints(
        self, run: JointRun, options: JointOptions, done: ProvedJoints, corrected_name: str
    ) -> bytes:
        """On a machine of any joints."""
        from olp.review.joints import page_of

        return page_of(run, done, options, corrected_name, time=True).html()
