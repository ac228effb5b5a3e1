"""The setup of programs of a batch, what is to be done with one, and what became of it.

Nothing here reads or writes a file, and a task is the same wherever it is done.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

from olp.core.values import dataclass
from olp.core.version import __version__
from olp.errormodel.known import KnownErrors
from olp.files.sources import Parcel, Source
from olp.findings.catalogue import Finding
from olp.workflows.correct import Correction, CorrectOptions
from olp.workflows.session import Session

if TYPE_CHECKING:
    from olp.workflows.joints.correct import JointOptions, ProvedJoints
    from olp.workflows.joints.loaded import JointRun


class Page(Protocol):
    """Makes the review pages of corrections; `corrected_name` is the name of the output."""

    def of_three(
        self, session: Session, source: Source, options: CorrectOptions, correction: Correction,
        corrected_name: str,
    ) -> bytes:  # fmt: skip
        """On three linear axes."""
        ...

    def of_joints(
        self, run: JointRun, options: JointOptions, done: ProvedJoints, corrected_name: str
    ) -> bytes:
        """On a machine of any joints."""
        ...


#: Setups that a worker keeps.
_KEPT = 16
#: Sessions by the digest of their setup. A thread has its own, as a session is no shared value.
_SESSIONS = threading.local()


@dataclass(frozen=True, slots=True)
class Config:
    """Machine, job and calibration of tasks, as bytes: `files` by their names in a parcel, `there` are names
    of files that are there and are not sent, `digest` stands for all of this. `calibration` is another file
    than the machine names, where one is tried. `known` are errors that are stated in place of a machine. With
    `joints` it has others than three linear axes; then files are sent as they are asked for."""

    machine: str | None
    job: str | None
    dialect: str | None
    files: Mapping[str, bytes | None]
    there: frozenset[str]
    digest: str
    calibration: str | None = None
    known: KnownErrors | None = None
    joints: bool = False

    def session(self) -> Session:
        """A session of its own, with the calibration as far as it is loaded by then."""
        kept: dict[str, Session] = _SESSIONS.__dict__.setdefault("kept", {})
        if self.digest not in kept:
            sources = Parcel(self.files, self.there)
            machine = self.machine if self.known is None else self.known
            session = Session.start(machine, self.job, dialect=self.dialect, sources=sources)
            if self.calibration is not None:
                setup = session.setup
                other = replace(setup.machine, calibration=self.calibration)
                session = session.of(replace(setup, machine=other))
            while len(kept) >= _KEPT:
                del kept[next(iter(kept))]
            kept[self.digest] = session
        return kept[self.digest]


@dataclass(frozen=True, slots=True)
class Task:
    """A program to correct. `files` are those beside the setup, the program among them, by their names in a
    parcel. `output` is the name of the corrected program, `report` that of its report ("": none), with
    `plots` or without. `page` makes its review page. With `released`, the name of a corrected program among
    the files, that one is judged instead, and nothing is written."""

    program: str
    files: Mapping[str, bytes | None]
    options: CorrectOptions
    output: str
    report: str = ""
    plots: bool = False
    page: Page | None = None
    released: str | None = None
    version: str = __version__


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a task: a row of the summary, and the bytes to be written, None where there are none.
    `wanted` is a file that the task needs before it can be done; there is no row then. `used` are the names
    of the files that it asked for. `lasting`: the same inputs have the same outcome."""

    row: Mapping[str, Any] | None
    text: bytes | None = None
    report: bytes | None = None
    page: bytes | None = None
    used: tuple[str, ...] = ()
    wanted: str | None = None
    lasting: bool = True


def counts(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Codes with severity and number, in the order in which they are found."""
    rows: dict[str, dict[str, Any]] = {}
    for finding in findings:
        severity = finding.severity.name.lower()
        row = rows.setdefault(finding.code, {"code": finding.code, "severity": severity, "count": 0})
        row["count"] += finding.count
    return list(rows.values())


def heading(stated: Mapping[str, Any]) -> dict[str, Any]:
    """What a row tells of a report before its figures: the program, the machine and its calibration, and how
    long both programs take where that was asked."""
    program, calibration = stated["program"], stated.get("calibration", {})
    measured = calibration.get("measured")
    return {
        "lines": program["lines"],
        "moves": program["moves"],
        "dialect": program["dialect"],
        "machine": stated["machine"]["name"],
        "calibration": {
            "measured": None if measured is None else measured.isoformat(),
            "sha256": calibration.get("sha256"),
        },
        **({"time": stated["time"]} if "time" in stated else {}),
    }
