"""One correction run: read, plan, write, prove, report. And the report alone, for a verification."""

from __future__ import annotations

import datetime
import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from olp.checks import correction as checks
from olp.checks import state
from olp.checks.model import model_findings
from olp.compensation.invert import TOLERANCE_MM
from olp.compensation.plan import Limits, Plan
from olp.compensation.planning import plan
from olp.compensation.stamp import find_stamp, stamp_line
from olp.compensation.style import fewest_decimals
from olp.compensation.writing import write
from olp.core.arrays import Array, Index
from olp.core.errors import AlreadyCorrected, OlpError, ProgramError, UsageError, naming
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.toolpath import Flag, Toolpath
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.proof.proof import ROUNDING_SHARE, Proof, prove
from olp.uncertainty.spread import Confidence
from olp.workflows.session import Loaded, unrolled
from olp.workflows.uncertainty import assess

_PROVES = (
    "the written text, read back from its bytes, commands what was computed (syntax, digits, modal words)",
    "the error model at those commands brings the tip to the nominal path, at and between the way-points",
)
_DOES_NOT_PROVE = (
    "that the calibration still describes the machine: measure a circle or a diagonal to see that",
    "what the control does between blocks (blending, following error) and what the process does to the part",
)


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A correction, or a verification of one: the corrected text and both programs as read, the proof, the
    report ("olp-report-1"), the findings, and how sure it is where the calibration states uncertainties."""

    text: bytes
    nominal: Program
    corrected: Program
    proof: Proof
    passed: Index
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    confidence: Confidence | None = None


def correct_bytes(
    data: bytes,
    name: str,
    loaded: Loaded,
    *,
    tolerance_um: float,
    hold: bool,
    unroll: bool,
    expand: bool,
    clearance: float | None,
    contour: bool,
    rapids: bool,
    date: datetime.date | None,
    tell: Progress,
    outside: str = "OLP403",
    within_um: float | None = None,
) -> Run:
    """Correct a program and prove it; `outside` is the code of what is held at the face of the box,
    `within_um` the tolerance whose probability is wanted (default: that of the proof)."""
    stamp = find_stamp(data)
    if stamp:
        raise AlreadyCorrected(
            f"the program carries the stamp `{stamp.group().decode()}`; correcting it again would apply the "
            "model twice; correct the nominal program",
            line=data.count(b"\n", 0, stamp.start()) + 1,
        )
    loaded = loaded.reading(data, name)
    if unroll or expand:
        data = unrolled(data, name, loaded.setup, loaded.dialect, expand, clearance)
    tell("read", 0.0)
    program = read(data, loaded.setup, loaded.dialect, Options(contour=contour))
    if rapids and program.statements is not None and program.statements.decimal:
        raise UsageError(
            "--split-rapids does not go with this dialect: nothing says how the machine goes between its "
            "places; "
            'state joined = "lines" and insert = true in the profile'
        )
    tell("correct", 0.2)
    digit = last_digit_mm(program, loaded.setup)
    lettered = program.statements is not None and bool(program.statements.decimal)
    limits = Limits(
        tolerance_um * MM_PER_UM, digit_mm=digit, split_rapids=rapids, refuse_outside=not hold,
        insert=not lettered,
    )  # fmt: skip
    rows = plan(program.toolpath, loaded.model, limits)
    tell("write", 0.5)
    written = write(
        program, rows, loaded.model, tolerance_mm=limits.tolerance_mm,
        increments_mm=loaded.setup.machine.least_increment_mm,
        stamp=stamp_line(loaded.digest, loaded.dialect.comment) if loaded.dialect.marks else b"",
    )  # fmt: skip
    text = written.text if written.changed else data
    parts, tally, holes = written.parts, written.tally, written.holes
    del written
    tell("prove", 0.7)
    path = program.toolpath
    nominal = replace(program, words=None, slot=program.slot[:0])
    del program
    passed = rows.passed
    corrections = _largest_correction(path, _ends(rows, len(path)))
    del rows
    corrected = read(text, loaded.setup, loaded.dialect, Options(contour=contour), words=False)
    proof = prove(
        nominal,
        corrected,
        loaded.model,
        tolerance_mm=limits.tolerance_mm,
        digit_mm=digit,
        passed=passed,
        parts=parts,
    )
    _prove_without_deleted(nominal, text, loaded, contour, limits, digit)
    sure = assess(
        loaded,
        nominal,
        corrected,
        proof.groups,
        passed,
        within_um or tolerance_um,
        date,
        tell,
        asked=within_um is not None,
    )
    findings = (
        *_calibration(loaded, date),
        *checks.proof_findings(proof, passed),
        *checks.between_findings(nominal, proof, loaded.model),
        *checks.hole_findings(holes, limits.tolerance_mm),
        *checks.stroke_findings(nominal, loaded.model, limits.tolerance_mm),
        *place_findings(proof, loaded, outside if hold else None),
        *checks.path_mode_findings(nominal, corrections),
        *checks.program_findings(nominal, loaded.setup, contour=contour),
        *(sure[2] if sure else ()),
        *_model(path, loaded, limits.tolerance_mm),
    )
    report = report_of(nominal, (data, name), loaded, proof, findings, tolerance_um)
    report["moves"] = checks.tally_moves(path, len(passed), parts) | {
        "inserted_blocks": tally.inserted_blocks,
        "inserted_words": tally.inserted_words,
        "changed_words": tally.changed_words,
    }
    report["corrected"] = {"sha256": hashlib.sha256(text).hexdigest(), "lines": text.count(b"\n")}
    report["largest_correction_um"] = corrections * 1e3
    if sure:
        report["uncertainty"] = sure[1]
    return Run(text, nominal, corrected, proof, passed, report, findings, sure[0] if sure else None)


def verify_programs(
    nominal: tuple[Program, str],
    corrected: tuple[Program, str],
    loaded: Loaded,
    *,
    tolerance_um: float,
    contour: bool,
    date: datetime.date | None,
    within_um: float | None = None,
) -> Run:
    """Prove a corrected program, whoever wrote it; programs come with their names. Raises ProgramError
    where the second is no correction of the first."""
    (first, name), (second, other) = nominal, corrected
    limits = Limits(tolerance_um * MM_PER_UM, refuse_outside=False)
    with naming(name or "<nominal>"):
        rows = plan(first.toolpath, loaded.model, limits)
    digit = last_digit_mm(second, loaded.setup)
    try:
        proof = prove(
            first, second, loaded.model, tolerance_mm=limits.tolerance_mm, digit_mm=digit,
            passed=rows.passed,
        )  # fmt: skip
    except OlpError as error:
        raise error.in_file(other or "<corrected>") from None
    sure = assess(
        loaded,
        first,
        second,
        proof.groups,
        rows.passed,
        within_um or tolerance_um,
        date,
        silent,
        asked=within_um is not None,
    )
    findings = (
        *_calibration(loaded, date),
        *checks.proof_findings(proof, rows.passed),
        *checks.between_findings(first, proof, loaded.model),
        *checks.program_findings(first, loaded.setup, contour=contour),
        *(sure[2] if sure else ()),
        *_model(first.toolpath, loaded, limits.tolerance_mm),
    )
    report = report_of(first, (first.data, name), loaded, proof, findings, tolerance_um)
    if sure:
        report["uncertainty"] = sure[1]
    return Run(second.data, first, second, proof, rows.passed, report, findings, sure[0] if sure else None)


def place_findings(proof: Proof, loaded: Loaded, outside: str | None) -> list[Finding]:
    """Travel, and the calibrated box under the code `outside`, of the corrected path, with the nominal
    lines."""
    path = replace(proof.written, line=proof.nominal.line[proof.owner()])
    found = state.travel_findings(path, loaded.setup.machine)
    return found if outside is None else [*found, *state.box_findings(path, loaded.model.box_mm, outside)]


def _calibration(loaded: Loaded, date: datetime.date | None) -> list[Finding]:
    days = loaded.setup.machine.sanity.calibration_days
    return state.calibration_findings(loaded.calibration, date, days)


def _model(path: Toolpath, loaded: Loaded, tolerance_mm: float) -> list[Finding]:
    sanity = loaded.setup.machine.sanity
    return model_findings(path, loaded.calibration, loaded.model, sanity, tolerance_mm)


def _prove_without_deleted(
    program: Program, text: bytes, loaded: Loaded, contour: bool, limits: Limits, digit_mm: float
) -> None:
    """With the block-delete switch on, the corrected program has to come out right too."""
    path = program.toolpath
    deleted = (path.flag & np.uint8(Flag.DELETED)) != 0
    if not deleted.any():
        return
    options = Options(block_delete=True, contour=contour)
    line = int(path.line[deleted][0])
    nominal = read(program.data, loaded.setup, loaded.dialect, options, words=False)
    corrected = read(text, loaded.setup, loaded.dialect, options, words=False)
    try:
        rows = plan(nominal.toolpath, loaded.model, replace(limits, refuse_outside=False))
        proof = prove(
            nominal,
            corrected,
            loaded.model,
            tolerance_mm=limits.tolerance_mm,
            digit_mm=digit_mm,
            passed=rows.passed,
        )
        good = proof.holds
    except ProgramError:
        good = False
    if not good:
        raise ProgramError(
            "later blocks depend on this block under block delete, so one correction cannot be right for "
            "both switch positions; remove the `/`, or give every axis in the first block after it",
            line=line,
        )


def report_of(
    program: Program,
    source: tuple[bytes, str],
    loaded: Loaded,
    proof: Proof,
    findings: tuple[Finding, ...],
    tolerance_um: float,
) -> dict[str, Any]:
    """The report ("olp-report-1") as far as a proof alone can fill it."""
    data, name = source
    machine, calibration = loaded.setup.machine, loaded.calibration
    size = proof.size_mm()
    bend = float(
        np.where(proof.after.judged & proof.cutting & ~proof.lean, proof.after.bend, 0.0).max(initial=0.0)
    )
    return {
        "schema": "olp-report-1",
        "program": {
            "name": Path(name).name if name else "",
            "sha256": hashlib.sha256(data).hexdigest(),
            "lines": program.lines,
            "dialect": loaded.dialect.name,
            "moves": len(program.toolpath),
        },
        "machine": {"name": machine.name, "chain": machine.chain, "controller": machine.controller},
        "calibration": {
            "measured": calibration.measured,
            "valid_until": calibration.valid_until,
            "model": calibration.model,
            "temperature_degC": calibration.temperature_degC,
            "sha256": loaded.digest,
        },
        "tolerance_um": tolerance_um,
        "deviation": {
            "before": proof.before.summary(proof.cutting),
            "after": proof.after.summary(proof.cutting & ~proof.lean),
            "path_max_um": float(size.max(initial=0.0)) * 1e3,
            "allowed_um": proof.allowed_mm * 1e3,
            "holds": proof.holds,
        },
        "budget_um": _budget(bend, proof, program, loaded),
        "orientation": checks.orientation(program.toolpath, loaded.model),
        "sources": checks.sources(program.toolpath, loaded.model),
        "worst": checks.worst_blocks(program, proof),
        "findings": [f.as_dict() for f in findings],
        "proves": list(_PROVES),
        "does_not_prove": list(_DOES_NOT_PROVE),
    }


def _budget(bend_mm: float, proof: Proof, program: Program, loaded: Loaded) -> dict[str, float]:
    """What remains, by where it comes from, in um; the largest of each, of the random part two standard
    deviations. The control rounds to its least increment where the digits written are not multiples of it."""
    machine, repeatability = loaded.setup.machine, loaded.calibration.repeatability_mm
    units = {f.unit_mm for f in program.toolpath.frames} or {1.0}
    halves = [
        0.5 * least
        if any(
            not _multiple(10.0 ** -fewest_decimals(least, u, loaded.dialect.inch_decimals) * u, least)
            for u in units
        )
        else 0.0
        for least in machine.least_increment_mm
    ]
    budget = {
        "model_and_chords": bend_mm,
        "inversion": TOLERANCE_MM,
        "rounding": ROUNDING_SHARE * proof.digit_mm,
        "increment": float(np.linalg.norm(halves)),
    }
    if repeatability is not None:
        budget["random_2_sigma"] = 2.0 * float(np.linalg.norm(repeatability))
    return {name: value * UM_PER_MM for name, value in budget.items()}


def _multiple(length_mm: float, of_mm: float) -> bool:
    return abs(length_mm / of_mm - round(length_mm / of_mm)) < 1e-6 and length_mm > 0.5 * of_mm


def _ends(rows: Plan, count: int) -> Array:
    """(n, 3) command at the end of each move."""
    if len(rows) == count:
        return rows.command_mm
    last = np.append(rows.move[1:] != rows.move[:-1], True)
    return np.asarray(rows.command_mm[last], float)


def _largest_correction(path: Toolpath, command_mm: Array) -> float:
    """How far the commands are from the nominal path, in mm, where they are farthest."""
    largest = 0.0
    for a in range(0, len(path), 1 << 16):
        away = np.nan_to_num(command_mm[a : a + (1 << 16)] - path.end_mm[a : a + (1 << 16)])
        largest = max(largest, float(np.einsum("ij,ij->i", away, away).max(initial=0.0)))
    return float(largest**0.5)


def last_digit_mm(program: Program, setup: Setup) -> float:
    """The coarsest last digit that the corrected program is written with."""
    units = {f.unit_mm for f in program.toolpath.frames} or {1.0}
    inch = program.dialect.inch_decimals
    return max(
        10.0 ** -fewest_decimals(least, unit, inch) * unit
        for least in setup.machine.least_increment_mm
        for unit in units
    )
