"""`calibrate export`: a calibration as the compensation table of a control, and its residual errors."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.control_tables.controls import Control, RealTime
from olp.calibration.control_tables.residuals import (
    CORRECT,
    REAL_TIME,
    UNCOMPENSATED,
    Residual,
    along,
    in_box,
    residuals_by,
)
from olp.core.errors import InputError, OlpError, UsageError
from olp.core.machine import Machine, Setup
from olp.core.progress import silent
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Reference
from olp.files.calibration.reader import load_calibration
from olp.files.control_code.base import Code
from olp.files.control_code.compiled import self_test as run_self_test
from olp.files.control_code.linear import linear_code
from olp.files.control_code.registry import CODE, write_code
from olp.files.control_code.source import HASH_DIGITS
from olp.files.control_tables.base import Exported, Given, Sense
from olp.files.control_tables.registry import FORMATS, format_named, read_table, write_table
from olp.files.kinematics.tables import TABLES
from olp.files.sources import Sources
from olp.findings.catalogue import Finding
from olp.reports.report import number
from olp.workflows import refusals
from olp.workflows.calibrate_export_joints import (
    compare_kinematics,
    given_joints,
    joint_export,
    table_export,
)
from olp.workflows.control_table import given_of
from olp.workflows.correct import CorrectOptions, corrected
from olp.workflows.doubt import acceptable
from olp.workflows.session import Loaded, PathLike, Session, content_of, digest_of

#: Number of random points over the box.
POINTS = 4000
#: Seed of their positions; it is fixed, so that the figures of two calls can be compared.
SEED = 1
#: Name of the first file of a table that is only compared.
_MAIN = Path("table")


@dataclass(frozen=True, slots=True, eq=False)
class TableExport:
    """The files of a table, findings, and the report as a mapping ("olp-tables-1"): the residual errors, and
    for the machine file `compensated_by_controller` once the table is active, `real_time` once code is."""

    files: Mapping[Path, bytes]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]
    report: dict[str, Any]


def export_table(
    machine: PathLike | Setup | None,
    kind: str,
    target: PathLike,
    job: PathLike | None = None,
    *,
    calibration: PathLike | None = None,
    program: PathLike | bytes | None = None,
    sense: Sense | None = None,
    comp_type: int | None = None,
    axis_names: Mapping[str, str] | None = None,
    reference: Reference | None = None,
    most_rows: int | None = None,
    self_test: bool = False,
    chain: str | None = None,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
) -> TableExport:
    """Write the calibration of a machine, or a calibration file alone, as the table of a control, or as code
    that corrects in real time (`olp.files.control_code`). `self_test` compiles the code here and compares it
    with the model.

    The report states the residual error over the calibrated box and, with `program`, along it. The figures
    are those of the written table, read back. `flatten` and the options after it are those of `correct`, for
    the program. Raises UsageError, InputError.
    """
    options = CorrectOptions(
        outside_box="hold", flatten=flatten, expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm,
        date=date, accept=tuple(sorted(acceptable(accept))),
    )  # fmt: skip
    if calibration is None and (of_joints := given_joints(machine, job)) is not None:
        if kind in TABLES:
            files, notes, report = table_export(of_joints, kind, job, Path(target))
            return TableExport(files, (), notes, report | {"findings": []})
        code, report = joint_export(of_joints, kind, job, chain, program)
        return _coded(code, kind, Path(target), report, self_test=self_test)
    source = _source(machine, job, calibration, chain)
    given = given_of(source.machine, chain, sense, None, comp_type, axis_names, reference, most_rows)
    if kind in TABLES:
        raise UsageError(f"--format {kind} holds rotary axes, and this machine has none")
    if kind in CODE:
        code = linear_code(source.rest, source.chain, source.digest)
        report = _report(source, {kind: RealTime(source.model)}, program, options)
        return _coded(code, kind, Path(target), report, source.findings, self_test=self_test)
    if self_test:
        raise UsageError("--self-test goes with a format of code, such as --format c; a table has no code")
    written = write_table(source.rest, format_named(kind).key, Path(target), given)
    report = _report(source, {kind: _control(written, kind, given, source)}, program, options)
    report["compensated_by_controller"] = sorted(written.corrects | source.compensated)
    findings = (*source.findings, *written.findings)
    report["findings"] = [finding.as_dict() for finding in findings]
    return TableExport(written.files, findings, written.notes, report)


def _coded(
    code: Code, kind: str, target: Path, report: dict[str, Any], findings: tuple[Finding, ...] = (), *,
    self_test: bool,
) -> TableExport:  # fmt: skip
    """Code that corrects in real time, with its report."""
    files = write_code(code, kind, target)
    report["real_time"] = code.digest[:HASH_DIGITS]
    if self_test:
        report["self_test"] = run_self_test(CODE[kind], files)
    report["findings"] = [finding.as_dict() for finding in findings]
    return TableExport(files, findings, (), report)


def compare_tables(
    machine: PathLike | Setup | None,
    job: PathLike | None = None,
    *,
    calibration: PathLike | None = None,
    program: PathLike | bytes | None = None,
    reference: Reference | None = None,
    most_rows: int | None = None,
    chain: str | None = None,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
) -> dict[str, Any]:
    """The residual error of each format of tables, next to a corrected program ("olp-tables-1"). Nothing is
    written. Where a format leaves sign convention or reference open, the figures are those of the right one.
    """
    options = CorrectOptions(
        outside_box="hold", flatten=flatten, expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm,
        date=date, accept=tuple(sorted(acceptable(accept))),
    )  # fmt: skip
    if calibration is None and (of_joints := given_joints(machine, job)) is not None:
        if program is not None:
            raise UsageError("--program is for machines with three linear axes; leave it out")
        return compare_kinematics(of_joints, job)
    source = _source(machine, job, calibration, chain)
    controls: dict[str, Control] = {}
    findings: dict[str, list[dict[str, object]]] = {}
    for key, form in FORMATS.items():
        given = given_of(
            source.machine, chain, form.sense or "error", None, None, None,
            reference or "functional-point", most_rows,
        )  # fmt: skip
        written = write_table(source.rest, key, _MAIN.with_suffix(form.ending), given)
        controls[key] = _control(written, key, given, source)
        findings[key] = [f.as_dict() for f in written.findings if f.code not in ("OLP874", "OLP875")]
    controls[REAL_TIME] = RealTime(source.model)
    report = _report(source, controls, program, options)
    report["formats"] = {
        key: {"title": form.title, "status": form.status, "holds": form.holds, "findings": findings[key]}
        for key, form in FORMATS.items()
    }
    report["findings"] = [finding.as_dict() for finding in source.findings]
    return report


@dataclass(frozen=True, slots=True, eq=False)
class _Source:
    """What a table is made from: `rest` is the calibration without the errors that the control corrects."""

    sources: Sources
    machine: Machine | None
    loaded: Loaded | None
    chain: str
    digest: str
    rest: Calibration
    model: ErrorModel
    tools_mm: np.ndarray
    increment_mm: np.ndarray
    compensated: frozenset[str]
    findings: tuple[Finding, ...]


def _source(
    machine: PathLike | Setup | None, job: PathLike | None, calibration: PathLike | None, chain: str | None
) -> _Source:
    if (machine is None and job is None) == (calibration is None):
        raise UsageError(
            "name either a machine file with -m, whose calibration is taken, or a calibration with -c"
        )
    sources = Sources()
    if calibration is not None:
        alone = load_calibration(calibration, read=sources.read)
        model = build(alone, chain or "FXYZ", outside="hold")
        digest = digest_of(content_of(sources, calibration), chain or "FXYZ")
        return _Source(
            sources, None, None, chain or "FXYZ", digest, alone, model, np.zeros((1, 3)), np.full(3, 1e-3),
            frozenset(), (),
        )  # fmt: skip
    if chain is not None:
        raise UsageError("--chain goes with -c; the machine file states its own chain")
    session = Session.start(machine, job, sources=sources)
    # what the control corrects by now does not matter to what it will
    session = replace(session, setup=_by_itself(session.setup))
    loaded = session.loaded("hold")
    described = loaded.setup.machine
    skip = described.compensated_by_controller - loaded.calibration.active_during_measurement
    findings = []
    if skip:
        message = f"{', '.join(sorted(skip))}: named in compensated_by_controller, not in the new table"
        findings.append(Finding("OLP876", message, count=len(skip)))
    tool_vectors = {
        tool.tool_vector_mm for tool in described.tools.values() if tool.tool_vector_mm is not None
    }
    rest = _without(loaded.calibration, skip)
    return _Source(
        sources, described, loaded, described.chain, loaded.digest, rest, loaded.model,
        np.array(sorted(tool_vectors) or [(0.0, 0.0, 0.0)]), np.array(described.least_increment_mm),
        described.compensated_by_controller, tuple(findings),
    )  # fmt: skip


def _by_itself(setup: Setup) -> Setup:
    return replace(setup, machine=replace(setup.machine, real_time=None))


def _without(calibration: Calibration, skip: frozenset[str]) -> Calibration:
    curves = []
    for curve in calibration.curves:
        parts = [
            {n: v for n, v in part.items() if n not in skip}
            for part in (curve.columns, curve.forward, curve.backward)
        ]
        if any(parts):
            curves.append(replace(curve, columns=parts[0], forward=parts[1], backward=parts[2]))
    return replace(
        calibration,
        curves=tuple(curves),
        squareness={n: 0.0 if n in skip else v for n, v in calibration.squareness.items()},
        cyclic=tuple(c for c in calibration.cyclic if c.component not in skip),
    )


def _control(written: Exported, kind: str, given: Given, source: _Source) -> Control:
    """The control with the table of the written bytes; beyond its ends the last values hold."""
    given = replace(given, travel_mm=np.array(source.rest.box_mm))
    main = next(iter(written.files))
    if not written.corrects:
        return format_named(kind).control(Calibration("", source.rest.box_mm), source.chain)
    imported = read_table(main, kind, given, lambda path: written.files[path])
    return format_named(kind).control(imported.calibration, source.chain)


def _report(
    source: _Source, controls: Mapping[str, Control], program: PathLike | bytes | None,
    options: CorrectOptions,
) -> dict[str, Any]:  # fmt: skip
    box = np.asarray(source.model.box_mm, float)
    points = in_box(box, source.tools_mm, POINTS, SEED)
    report: dict[str, Any] = {
        "schema": "olp-tables-1",
        "machine": source.rest.machine,
        "box": {
            "points": POINTS, "seed": SEED, "box_mm": box.tolist(), "tools_mm": source.tools_mm.tolist(),
            "left": _figures(residuals_by(source.model, controls, points, source.increment_mm)),
        },
    }  # fmt: skip
    if program is not None:
        report["program"] = _along(source, controls, program, box, options)
    return report


def _along(
    source: _Source, controls: Mapping[str, Control], program: PathLike | bytes, box: np.ndarray,
    options: CorrectOptions,
) -> dict[str, Any]:  # fmt: skip
    """Residual errors along a program; for correcting, the proof of a correction that is really done."""
    loaded = source.loaded
    if loaded is None:
        raise UsageError("a program is read with its machine; name the machine file with -m")
    text = source.sources.source(program)
    text.load()
    with text.errors("<program>"):
        loaded = loaded.reading(text)
        text, program_read = refusals.read(
            source.sources, text, loaded.setup, loaded.dialect, None, options, words=False
        )
    path = program_read.toolpath
    points = along(path, box, source.chain)
    if points.counted is None or not points.counted.any():
        raise InputError("has no cutting move whose axes are all known", file=text.name or "<program>")
    report: dict[str, Any] = {
        "name": text.short,
        "points": int(points.counted.sum()),
        "left": _figures(residuals_by(source.model, controls, points)),
        "refused": None,
    }
    try:
        run = corrected(source.sources, text, loaded, options, silent)
        after = run.report["deviation"]["after"]["between"]
        report["left"][CORRECT] = {**after, "rms_in_frame_um": None}
    except OlpError as error:
        report["refused"] = str(error.in_file(text.name or "<program>"))
        report["left"][CORRECT] = dict.fromkeys(("rms_um", "max_um", "rms_in_frame_um"))
    return report


def _figures(residuals: Mapping[str, Residual]) -> dict[str, Any]:
    return {name: residual.as_dict() for name, residual in residuals.items()}


def parts_rows(report: Mapping[str, Any]) -> Sequence[tuple[str, ...]]:
    """Rows of figures on which errors a table of a control's kinematics leaves: table and kind of errors, um
    (rms, max) and urad (rms, max)."""
    keys = ("rms_um", "max_um", "rms_urad", "max_urad")
    return [
        (f"{name}: {kind}", *(number(figures[key]) for key in keys))
        for name, parts in report["box"].get("parts", {}).items()
        for kind, figures in parts.items()
    ]


def turns(report: Mapping[str, Any]) -> bool:
    """Whether a report states a residual orientation."""
    return any("rms_urad" in box for box in report["box"]["left"].values())


def residual_rows(report: Mapping[str, Any]) -> Sequence[tuple[str, ...]]:
    """Rows of figures: method, over the box (rms, max, rms in a frame), along the program (same), and the
    orientation over the box (rms, max)."""
    rows = []
    for name, box in report["box"]["left"].items():
        title = "uncompensated machine" if name == UNCOMPENSATED else name
        row = [title, *(number(box[key]) for key in ("rms_um", "max_um", "rms_in_frame_um"))]
        if "program" in report:
            residual = report["program"]["left"][name]
            row += [number(residual[key]) for key in ("rms_um", "max_um", "rms_in_frame_um")]
        if turns(report):
            row += [number(box[key]) for key in ("rms_urad", "max_urad")]
        rows.append(tuple(row))
    return rows
