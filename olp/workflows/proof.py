"""The proof of a correction, which `correct` and `verify` share: from two programs to the report."""

from __future__ import annotations

import datetime
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from olp.checks import correction as checks
from olp.checks import state
from olp.checks.along import Along
from olp.checks.base import finding
from olp.checks.model import model_findings
from olp.compensation.invert import TOLERANCE_MM
from olp.compensation.plan import Limits
from olp.compensation.planning import uncorrected_moves
from olp.compensation.stamp import find_stamp
from olp.compensation.style import fewest_decimals
from olp.core.arrays import Index
from olp.core.errors import ProgramError, naming
from olp.core.machine import Setup
from olp.core.progress import Progress, part, silent
from olp.core.spool import Text, sha256_of
from olp.core.toolpath import Flag, Toolpath
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.core.values import dataclass
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.program.origin import original_of
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.program.text.columns import found
from olp.proof.judgement import Judgements, verdict
from olp.proof.proof import ROUNDING_SHARE, Proof, largest_correction_mm, prove
from olp.workflows.doubt import accepted_of, doubted
from olp.workflows.flatten import UnrollOptions, above_zero
from olp.workflows.session import Loaded

if TYPE_CHECKING:
    from olp.uncertainty.spread import Confidence

_PROVES = (
    "the written text, read back from its bytes, commands what was computed (syntax, digits, modal words)",
    "the error model at those commands brings the tip to the nominal path, at and between the waypoints",
)
_DOES_NOT_PROVE = (
    "that the calibration still describes the machine: measure a circle or a diagonal to see that",
    "what the control does between blocks (blending, following error) and what the process does to the part",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProofOptions(UnrollOptions):
    """Options of every verb that proves a correction: the numerical tolerance, the part tolerance
    (`part_tolerance_um`, default: the job's), the day of the run, and the codes of doubts to accept. What is
    unrolled is the nominal program."""

    tolerance_um: float = 1.0
    part_tolerance_um: float | None = None
    only_sure_components: bool = False
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        above_zero(self, "tolerance_um", "part_tolerance_um", "peck_clearance_mm")

    def proof(self) -> dict[str, Any]:
        """These values alone, as the keywords of another verb's options."""
        return {f.name: getattr(self, f.name) for f in fields(ProofOptions)}


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A correction, or a verification of one: the corrected text and both programs as read, the proof and its
    table of judgements, the report ("olp-report-1") and the findings. `confidence` has bands and
    probabilities where a part tolerance is stated and the calibration states uncertainties."""

    text: Source
    nominal: Program
    corrected: Program
    proof: Proof
    table: Judgements
    uncorrected: Index
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    confidence: Confidence | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A nominal program and its correction as read, with their texts, and the moves of the nominal one that
    are left uncorrected. `text` keeps the loops and subprograms that `corrected` has unrolled. `sha256` is
    the digest of the nominal text."""

    nominal: Program
    source: Source
    sha256: str
    corrected: Program
    text: Source
    uncorrected: Index


def verify_programs(
    nominal: tuple[Program, str], corrected: tuple[Program, str], loaded: Loaded, options: ProofOptions,
    *, outside: str | None, refuse_doubts: bool = True, tell: Progress = silent,
) -> Run:  # fmt: skip
    """Prove a corrected program from any source; programs come with their names. `outside` is the code of
    findings outside the calibrated box; with None such a path raises OutsideBox, as in `correct`. Raises
    ProgramError where the second is not a correction of the first, Doubtful with `refuse_doubts`."""
    (first, name), (second, other) = nominal, corrected
    if find_stamp(first.data) is not None and find_stamp(second.data) is None:
        raise ProgramError(
            "the program given as nominal has the stamp of a correction, and the corrected one has none; "
            "exchange the two",
            file=name or "<nominal>",
            code="OLP562",
        )
    doubts = doubted(
        first, loaded, options.accept, options.date, name=name, stamped=second.data, refuse=refuse_doubts
    )
    try:
        # lines of errors are those of the nominal text
        with naming(name or "<nominal>"):
            with first.errors():
                limits = limits_of(first, loaded, options, refuse_outside=outside is None)
                uncorrected = uncorrected_moves(first, loaded.model, limits)
            texts = Source(name, lambda: first.data), Source(other, lambda: second.data)
            pair = Pair(first, texts[0], digest_of(first.data), second, texts[1], uncorrected)
            return proved(pair, loaded.held(), options, doubts, outside=outside, tell=tell)
    except ProgramError as error:
        raise error.in_file(other or "<corrected>") from None


def limits_of(
    program: Program, loaded: Loaded, options: ProofOptions, *, refuse_outside: bool,
    split_rapids: bool = False,
) -> Limits:  # fmt: skip
    """The limits of the plan of a program."""
    return Limits(
        options.tolerance_um * MM_PER_UM, digit_mm=last_digit_mm(program, loaded.setup),
        split_rapids=split_rapids, refuse_outside=refuse_outside, insert=not program.verbatim,
        one_radius=program.arc_slots.poles is not None,
    )  # fmt: skip


def proved(
    pair: Pair, loaded: Loaded, options: ProofOptions, doubts: tuple[Finding, ...], *,
    outside: str | None = None, notes: tuple[Finding, ...] = (), tell: Progress = silent,
) -> Run:  # fmt: skip
    """The proof of a pair of programs with all that is said of it; `correct` and `verify` are the same here.
    `doubts` are those about the inputs, `notes` further findings. `outside` is the code of findings outside
    the calibrated box, None where nothing is outside. Raises ProgramError where the second is not a
    correction of the first, or not with the block-delete switch on."""
    tolerance_mm = options.tolerance_um * MM_PER_UM
    written = _written(pair.text.data)
    proof = _prove(
        pair.nominal, pair.corrected, loaded, pair.uncorrected, tolerance_mm,
        last_digit_mm(pair.corrected, loaded.setup), part(tell, 0.0, 0.8),
    )  # fmt: skip
    table = Judgements.of(proof)
    _prove_without_deleted(pair, loaded, options, proof, table)
    part_um = loaded.part_tolerance_um(options.part_tolerance_um)
    first = pair.nominal.in_original()
    assessment = None
    if loaded.uncertainty is not None:
        from olp.workflows.confidence import assess

        assessment = assess(
            loaded, loaded.uncertainty, first, pair.corrected, proof.groups, pair.uncorrected, part_um,
            options.date, part(tell, 0.8, 0.95),
        )  # fmt: skip
    tell("report", 0.95)
    largest_mm = largest_correction_mm(first, pair.corrected, proof)
    findings = (
        *doubts,
        *_unstamped(doubts, loaded),
        *notes,
        *checks.proof_findings(proof, pair.uncorrected, first.dialect, first.place),
        *checks.part_findings(table, part_um),
        *checks.between_findings(first, proof, loaded.model),
        *position_findings(proof, loaded, outside),
        *checks.path_mode_findings(first, largest_mm),
        *checks.program_findings(first, loaded.setup),
        *(assessment[2] if assessment else ()),
        *findings_of_model(first.toolpath, loaded, tolerance_mm),
    )
    source = pair.source.short, pair.sha256
    report = report_of(first, source, loaded, proof, table, findings, options.tolerance_um)
    report["corrected"] = written
    report["largest_correction_um"] = largest_mm * UM_PER_MM
    if assessment:
        report["uncertainty"] = assessment[1]
    report["judgement"] = table.report()
    report["verdict"] = verdict(table, part_um, report.get("uncertainty"), findings, first.place)
    confidence = assessment[0] if assessment else None
    return Run(
        pair.text, pair.nominal, pair.corrected, proof, table, pair.uncorrected, report, findings, confidence
    )


def _prove(
    nominal: Program, corrected: Program, loaded: Loaded, uncorrected: Index, tolerance_mm: float,
    digit_mm: float, tell: Progress = silent,
) -> Proof:  # fmt: skip
    """The proof of two programs, whose nominal lines are those of the original."""
    with nominal.errors():
        proof = prove(
            nominal, corrected, loaded.model, tolerance_mm=tolerance_mm, digit_mm=digit_mm,
            uncorrected=uncorrected, tell=tell,
        )  # fmt: skip
    return replace(proof, nominal=nominal.in_original().toolpath)


def _prove_without_deleted(
    pair: Pair, loaded: Loaded, options: ProofOptions, proof: Proof, table: Judgements
) -> None:
    """Raise ProgramError where the corrected program is wrong with the block-delete switch on, on lines that
    are right with the switch off, as `table` says."""
    path = pair.nominal.toolpath
    deleted = found(len(path), lambda some: np.asarray((path.flag[some] & np.uint8(Flag.DELETED)) != 0))
    if not deleted.size:
        return
    reading = Options(block_delete=True)
    nominal = read(pair.source.data, loaded.setup, loaded.dialect, reading, words=False)
    with naming(pair.text.name or "<corrected>"):
        other = read(pair.corrected.data, loaded.setup, loaded.dialect, reading, words=False)
    try:
        limits = limits_of(nominal, loaded, options, refuse_outside=False)
        uncorrected = uncorrected_moves(nominal, loaded.model, limits)
        without = Judgements.of(
            _prove(nominal, other, loaded, uncorrected, proof.tolerance_mm, proof.digit_mm)
        )
        good = bool(np.isin(without.line[without.over], table.line[table.over]).all())
    except ProgramError:
        good = False
    with pair.nominal.errors():
        if not good:
            raise ProgramError(
                "later blocks depend on this block under block delete, so one correction cannot be right for "
                "both switch positions; remove the `/`, or give every axis in the first block after it",
                line=int(path.line[deleted[0]]),
                code="OLP525",
            )


def _unstamped(doubts: tuple[Finding, ...], loaded: Loaded) -> list[Finding]:
    """Accepted doubts that no stamp states, because the text may have no comment."""
    accepted = accepted_of(doubts)
    if loaded.dialect.marks or not accepted:
        return []
    codes = ",".join(accepted)
    what = f"no stamp states that {codes} was accepted; give --accept {codes} wherever this file is read"
    return [finding("OLP626", what)]


def position_findings(proof: Proof, loaded: Loaded, outside: str | None) -> list[Finding]:
    """Findings on the travel, and on the calibrated box under the code `outside`, of the corrected path, with
    the nominal lines."""
    path = replace(proof.written, line=proof.nominal_lines())
    findings = state.travel_findings(path, loaded.setup.machine)
    if outside is not None:
        findings = [*findings, *state.box_findings(path, loaded.model.box_mm, outside)]
    return findings


def findings_of_model(path: Toolpath, loaded: Loaded, tolerance_mm: float) -> list[Finding]:
    sanity = loaded.setup.machine.sanity
    return model_findings(path, loaded.calibration, loaded.model, sanity, tolerance_mm)


def report_of(
    program: Program,
    source: tuple[str, str],
    loaded: Loaded,
    proof: Proof,
    table: Judgements,
    findings: tuple[Finding, ...],
    tolerance_um: float,
) -> dict[str, Any]:
    """The parts of the report ("olp-report-1") that a proof alone gives; `source` is the name of the nominal
    text and its digest."""
    name, digest = source
    along = Along.of(program.toolpath)
    return {
        "schema": "olp-report-1",
        "program": {
            "name": name,
            "sha256": digest,
            "lines": program.lines,
            "dialect": loaded.dialect.name,
            "moves": len(program.toolpath),
        },
        **loaded.heads(),
        "tolerance_um": tolerance_um,
        "deviation": {
            "before": proof.before.summary,
            "after": proof.after.summary,
            "path_max_um": proof.largest_mm * UM_PER_MM,
            "allowed_um": proof.allowed_mm * 1e3,
            "holds": proof.holds,
        },
        "budget_um": _budget(proof, program, loaded),
        "orientation": checks.orientation(along, loaded.model),
        "sources": checks.sources(along, loaded.model),
        "worst": checks.worst_blocks(program, table),
        "accepted": accepted_of(findings),
        "findings": [f.as_dict() for f in findings],
        "proves": list(_PROVES),
        "does_not_prove": list(_DOES_NOT_PROVE),
    }


def _budget(proof: Proof, program: Program, loaded: Loaded) -> dict[str, float]:
    """The remaining deviation by cause, in um: the largest of each, of the random part two standard
    deviations. The control rounds to its least increment where the written digits are not multiples of it."""
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
        "model_and_chords": proof.after.bend_mm,
        "inversion": TOLERANCE_MM,
        "rounding": ROUNDING_SHARE * proof.digit_mm,
        "increment": float(np.linalg.norm(halves)),
    }
    if repeatability is not None:
        budget["random_2_sigma"] = 2.0 * float(np.linalg.norm(repeatability))
    return {name: value * UM_PER_MM for name, value in budget.items()}


def _multiple(length_mm: float, of_mm: float) -> bool:
    return abs(length_mm / of_mm - round(length_mm / of_mm)) < 1e-6 and length_mm > 0.5 * of_mm


def _written(text: Text) -> dict[str, Any]:
    """What a report says of a corrected text."""
    return {"sha256": sha256_of(text), "lines": text.count(b"\n")}


def digest_of(data: Text) -> str:
    """The digest of a nominal text; of one that was unrolled that of its original."""
    return sha256_of(original_of(data))


def last_digit_mm(program: Program, setup: Setup) -> float:
    """The coarsest last digit of the corrected program, in mm."""
    units = {(f.unit_mm, round(f.stretch, 9)) for f in program.toolpath.frames} or {(1.0, 1.0)}
    inch = program.dialect.inch_decimals
    return max(
        10.0 ** -fewest_decimals(least, unit, inch) * unit * stretch
        for least in setup.machine.least_increment_mm
        for unit, stretch in units
    )
