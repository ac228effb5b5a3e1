"""The review page of a program of a batch."""

from __future__ import annotations

from olp.files.sources import Source
from olp.review import job
from olp.workflows.correct import Correction, CorrectOptions
from olp.workflows.session import Session


def page(
    session: Session, source: Source, options: CorrectOptions, correction: Correction, corrected_name: str
) -> bytes:
    """The page of `olp view` on a correction, as one file."""
    viewed = job.ViewOptions(**options.proof(), outside_box=options.outside_box)
    review = job.run(session, source, viewed, correction=correction, corrected_name=corrected_name)
    return review.html()
