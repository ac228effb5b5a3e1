"""`olp results`: corrects the points that a measuring machine reported. Read, run the model forward, write,
report."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.checks.doubt import stated_doubts
from olp.checks.doubt_size import box_doubts
from olp.compensation.stamp import find_stamp, line_of, stamp_line
from olp.core.errors import AlreadyCorrected, InputError, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.spool import Spool, whole
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.files.point_profile import load_profile
from olp.files.sources import Source
from olp.files.write import write_bytes
from olp.findings.catalogue import Finding
from olp.program.text.delimited import Layout, detected_layout, first_lines
from olp.results.forward import Forward, forward
from olp.results.frames import frame_of, stylus_of
from olp.results.reported import Reported, Stated, missing
from olp.results.table import read_table
from olp.results.writing import write
from olp.workflows import real_time
from olp.workflows.doubt import acceptable, accepted_of, with_accepted
from olp.workflows.results_report import report_of
from olp.workflows.session import Loaded, Outside, PathLike, Session, opened
from olp.workflows.shown import Shown

#: Rounding above this, in mm, is a finding: the bar of the corrections themselves.
_ROUNDING_MM = 2e-4
#: An error of this, in mm, from an unknown side of the touch is a warning.
_DOUBT_MM = 1e-4

#: What axis positions are those of, in words.
_COUNTED = {
    "tip": "axis positions are those of the tip: no tool length is active (job_defaults.length_active)",
    "tool": "axis positions differ from those of the tip by the length of the tool",
    "ram": "axis positions are those of the end of the ram; the stylus leads from there to the tip",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultOptions:
    """The options of `correct_results`."""

    profile: PathLike | Layout | None = None
    frame: str | Mapping[str, str] | None = None
    tool: int | Mapping[str, int] | None = None
    tip_radius_mm: float | None = None
    decimals: int | None = None
    outside_box: Outside = "refuse"
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class ResultCorrection(Shown):
    """Corrected results: their bytes, the report as a mapping ("olp-results-1"), and the findings. `inputs`
    are the files that were read, which `write` never overwrites."""

    _data: Spool
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    inputs: tuple[str, ...] = ()

    @property
    def data(self) -> bytes:
        """The corrected text."""
        return self._data.read()

    def parts(self) -> Iterator[bytes]:
        """The corrected text in parts."""
        return self._data.parts()

    def to_text(self) -> str:
        """The report as `olp results` prints it."""
        from olp.reports.results import to_text

        return to_text(self.report)

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the corrected results as `Correction.write` does."""
        write_bytes(path, self.parts(), force=force, inputs=self.inputs)
        return Path(path)


def correct_results(
    results: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    profile: PathLike | Layout | None = None,
    frame: str | Mapping[str, str] | None = None,
    tool: int | Mapping[str, int] | None = None,
    tip_radius_mm: float | None = None,
    decimals: int | None = None,
    outside_box: Literal["refuse", "hold"] = "refuse",
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    progress: Progress | None = None,
) -> ResultCorrection:
    """Correct the points that a measuring machine reported: true = reported + error at the touch.

    `results` is a table of points or DMIS output, a path or its bytes. `frame` names the work offset of the
    points ("machine": axis positions), `tool` the number of the stylus. Where a file names several, each is a
    mapping from the file's names to those of machine and job. `tip_radius_mm` replaces that of the stylus.
    `decimals` is the least number of decimals written. Only the numbers of points change.
    `date` and `accept` are those of `correct`, for doubts about the calibration. Raises InputError with the
    line (AlreadyCorrected, OutsideBox, ConfigError), and Doubtful.
    """
    session, source = opened(results, machine, job)
    options = ResultOptions(
        profile=profile, frame=frame, tool=tool, tip_radius_mm=tip_radius_mm, decimals=decimals,
        outside_box=outside_box, date=date, accept=tuple(accept),
    )  # fmt: skip
    return run(session, source, options, progress)


def run(
    session: Session, results: Source, options: ResultOptions, progress: Progress | None = None
) -> ResultCorrection:
    """As `correct_results`, in a session."""
    real_time.refuse_correcting(session.setup.machine)
    loaded = session.loaded(options.outside_box)
    profile = options.profile
    if profile is not None and not isinstance(profile, Layout):
        profile = load_profile(profile, session.sources.read).layout
    results.load()
    with results.errors("<results>"):
        done = _corrected(results, loaded, options, profile, progress or silent)
    return replace(done, inputs=session.inputs())


def _corrected(
    results: Source, loaded: Loaded, options: ResultOptions, layout: Layout | None, tell: Progress
) -> ResultCorrection:
    data = whole(results.data)
    stamp = find_stamp(data)
    if stamp:
        raise AlreadyCorrected(
            f"the results have the stamp `{stamp.group().decode()}` of a correction; a second one would add "
            "the error twice; correct the file that the machine wrote",
            line=line_of(data, stamp),
            code="OLP560",
        )
    tell("read", 0.0)
    reported = _read(data, layout)
    tell("correct", 0.5)
    radius = options.tip_radius_mm if options.tip_radius_mm is not None else reported.tip_radius_mm
    reported = replace(
        reported,
        frames=_named("frame", reported.frames, options.frame),
        tools=_named("tool", reported.tools, options.tool),
        tip_radius_mm=radius,
    )
    setup = loaded.setup
    axes = _axes(reported, loaded)
    reported = replace(reported, assumed=(*reported.assumed, _COUNTED[axes]))
    findings = _already(reported, loaded)
    own = bool(reported.own_stylus.all())
    frames = [frame_of(setup, n) for n in reported.frames]
    styli = [stylus_of(setup, t, own) for t in reported.tools]
    result = forward(
        reported, frames, styli, loaded.model, axes=axes, hold=options.outside_box == "hold",
        payload_kg=setup.job.payload_kg,
    )  # fmt: skip
    # the directions are large, and were needed for that alone
    reported = replace(reported, normal=missing(len(reported), 3))
    if radius is None and any(s.radius_mm == 0.0 and any(s.tool_vector_mm) for s in styli):
        findings.append(
            Finding("OLP623", "no radius of the tip is known; give --tip-radius-mm, 0 for centres")
        )
    doubts = _doubts(loaded, result, options)
    mark = b""
    if reported.comment is not None:
        mark = stamp_line(loaded.digest, reported.comment, accepted_of(doubts))
    tell("write", 0.7)
    text, rounding = write(reported, result.added_mm, mark, options.decimals)
    # and so were the numbers and their places
    none = {name: getattr(reported, name)[:0].copy() for name in ("start", "end", "value")}
    reported = replace(reported, **none)
    turned = sorted(
        {f.name for f in frames if f.touched is not None and not np.allclose(f.rotation, np.eye(3))}
    )
    findings += [*_findings(reported, result, rounding, turned), *doubts]
    outside = ~loaded.model.inside(result.axis_mm).all(axis=1)
    if outside.any():
        lines = reported.line[outside].tolist()
        findings.append(_finding("OLP403", f"{len(lines)} touches lie outside the calibrated box", lines))
    report = report_of(reported, result, loaded, results.short, text, rounding, findings)
    return ResultCorrection(text, report, tuple(findings))


def _doubts(loaded: Loaded, result: Forward, options: ResultOptions) -> tuple[Finding, ...]:
    """Doubts about the calibration, with the styli of the results. Raises Doubtful."""
    machine, tools = loaded.setup.machine, np.atleast_2d(result.tool_vector_mm)
    findings = [
        *stated_doubts(loaded.calibration, machine, options.date, loaded.uncertainty),
        *box_doubts(loaded.held().model, tools, loaded.calibration, machine),
    ]
    return with_accepted(findings, acceptable(options.accept))


def _axes(reported: Reported, loaded: Loaded) -> Literal["tip", "tool", "ram"]:
    """What axis positions are those of: as in the programs of the machine."""
    if reported.axes_at_ram or loaded.dialect.axes_at_ram:
        return "ram"
    return "tool" if loaded.setup.machine.length_active else "tip"


def _named(what: str, stated: tuple[Any, ...], given: object) -> tuple[Any, ...]:
    """The names of machine and job for those of the file."""
    if given is None:
        return stated
    if not isinstance(given, Mapping):
        if len(stated) > 1:
            names = ", ".join(str(name) for name in stated)
            raise UsageError(
                f"the file names several of them ({names}); name each, as in --{what} {stated[-1]}=.."
            )
        return (given,) * len(stated)
    unknown = [name for name in given if name not in {str(t) for t in stated}]
    if unknown:
        names = ", ".join(str(name) for name in stated)
        raise UsageError(f"--{what} {unknown[0]}=..: the file does not name it; it names {names}")
    return tuple(given.get(str(name), name) for name in stated)


def _read(data: bytes, profile: Layout | None) -> Reported:
    from olp.results.dmis import is_dmis, read_dmis

    if profile is None and is_dmis(data):
        return read_dmis(data)
    layout = profile or detected_layout(first_lines(data))
    if layout is None:
        raise InputError(
            "does not show which columns hold X, Y and Z; give their names or numbers with --column X=.. "
            "--column Y=.. --column Z=.., or give a profile with --profile"
            if data.strip()
            else "holds no points; expected a table of points, or DMIS output"
        )
    return read_table(data, layout)


def _already(reported: Reported, loaded: Loaded) -> list[Finding]:
    """Findings on compensation that was active, as the file states. Raises InputError where it would be
    applied twice."""
    calibration = loaded.calibration
    findings = []
    for statement in reported.stated:
        _refuse_twice(statement, bool(calibration.active_during_measurement), calibration.thermal is not None)
        findings.append(Finding(
            "OLP625",
            f"`{statement.text}` says that the control compensated the {statement.what} while measuring; the "
            "calibration leaves that to the control",
            statement.line, (statement.line,),
        ))  # fmt: skip
    skipped = sorted(loaded.setup.machine.compensated_by_controller)
    if skipped:
        findings.append(Finding("OLP404", f"left to the control: {', '.join(skipped)}"))
    return findings


def _refuse_twice(statement: Stated, active: bool, thermal: bool) -> None:
    if statement.what == "geometry" and not active:
        raise InputError(
            f"`{statement.text}`: an error map of the control has corrected these results already. The "
            "calibration was measured without one (active_during_measurement is empty), so they would be "
            "corrected twice; use a calibration measured with the map active",
            line=statement.line,
        )
    if statement.what == "temperature" and thermal:
        raise InputError(
            f"`{statement.text}` says that these results are compensated for temperature already, and the "
            "calibration has a table [thermal], so they would be corrected twice; use a calibration without "
            "it",
            line=statement.line,
        )


def _finding(code: str, message: str, lines: Sequence[int]) -> Finding:
    few = tuple(lines[:8])
    return Finding(code, message, few[0] if few else None, few, max(len(lines), 1))


def _findings(
    reported: Reported, result: Forward, rounding_mm: float, turned: Sequence[str]
) -> list[Finding]:
    findings = [Finding("OLP621", message) for message in reported.assumed]
    by_reason: dict[tuple[str, str], list[int]] = {}
    for item in reported.unchanged:
        by_reason.setdefault((item.name, item.reason), []).append(item.line)
    for (name, reason), lines in by_reason.items():
        findings.append(_finding("OLP622", f"{name} is kept as written: {reason}", lines))
    doubt = result.doubt_mm
    if doubt.any():
        message = (
            "which side of the tip touched is not stated, so the error was taken at the reported point; "
            f"that is at most {doubt.max() * UM_PER_MM:.2g} um off"
        )
        wrong = doubt > _DOUBT_MM
        code = "OLP623" if wrong.any() else "OLP621"
        findings.append(_finding(code, message, reported.line[wrong].tolist()))
    if result.play_mm.any():
        lines = reported.line[result.play_mm > 0].tolist()
        what = (
            "the direction of the approach is not known; half the backlash is up to "
            f"{result.play_mm.max() * 1e3:.2g} um"
        )
        findings.append(_finding("OLP103", what, lines))
    if turned:
        message = (
            f"frame {', '.join(turned)} is rotated and was set on the uncompensated machine; only its zero "
            "is corrected"
        )
        findings.append(Finding("OLP624", message))
    if rounding_mm > _ROUNDING_MM:
        message = (
            f"rounding to the digits of the file is up to {rounding_mm * UM_PER_MM:.2g} um; see --decimals"
        )
        findings.append(Finding("OLP411", message))
    if reported.comment is None:
        findings.append(Finding("OLP626", "the profile allows no comment, so no stamp was written"))
    return findings
