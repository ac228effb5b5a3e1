"""Findings about a correction, and tables of its report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.checks.along import Along, Figure
from olp.checks.base import beside_axes, finding, lines_of
from olp.checks.listed import between_findings as between_findings
from olp.checks.listed import remark_findings
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.units import UM_PER_MM
from olp.errormodel.base import ErrorModel
from olp.findings.catalogue import Finding
from olp.program.dialect import Dialect
from olp.program.program import Program
from olp.program.text.columns import found, spans
from olp.proof.judgement import Judgements
from olp.proof.measured import SHOWN
from olp.proof.proof import Counts, Proof

#: codes of remarks of readers
_REMARKS = {
    "thermal": "OLP412",
    "arcs": "OLP413",
    "transform": "OLP414",
    "scan": "OLP415",
    "chords": "OLP416",
    "preset": "OLP417",
    "macro": "OLP334",
}
#: how canned cycles become plain moves: with an option, where the dialect has it
_AS_MOVES = {True: "with --expand-cycles", False: "as plain moves in the post-processor"}
#: blocks that the report lists
_WORST = 5


def program_findings(program: Program, setup: Setup) -> list[Finding]:
    """Findings from the text of the program."""
    findings = []
    path = program.toolpath
    for name, line, text in program.remarks:
        if name == "unit":
            which = "the program has neither G20 nor G21 before the first move" if text == "mm" else text
            findings.append(finding("OLP301", f"{which}; millimetres assumed", [line]))
        elif name in _REMARKS:
            findings.append(finding(_REMARKS[name], text, [line]))
    findings += remark_findings(program)
    count = len(path)
    whole = found(count, lambda some: beside_axes(path, some) & (path.kind[some] != Kind.PROBE))
    if whole.size and not program.verbatim:
        lines = lines_of(path, whole)
        what = "blocks also move another axis"
        if program.targets is not None:
            what = "moves have words of their own end, or move another axis"
        findings.append(finding("OLP104", f"{len(lines)} {what}; corrected at their ends only", lines))
    deleted = found(count, lambda some: _has(path, some, Flag.DELETED))
    if deleted.size:
        lines = lines_of(path, deleted)
        findings.append(
            finding(
                "OLP304", f"{len(lines)} blocks are under block delete; proved with and without them", lines
            )
        )
    assumed = sorted({
        f.work_offset for f in path.frames
        if f.touched is not None and (o := setup.work_offset(f.work_offset)) is not None
        and o.touched_at_mm == (None, None, None)
    })  # fmt: skip
    for name in assumed:
        findings.append(
            finding(
                "OLP303", f"{name} is taken as touched off on the uncompensated machine, at its own position"
            )
        )
    findings += _contour_findings(program)
    if setup.machine.compensated_by_controller:
        names = ", ".join(sorted(setup.machine.compensated_by_controller))
        findings.append(finding("OLP404", f"the control corrects {names}, so the program does not"))
    return findings


def _contour_findings(program: Program) -> list[Finding]:
    """Findings on contours under cutter compensation."""
    path, found = program.toolpath, []
    on = path.compensated()
    if on.any():
        radii = sorted({c.radius_mm for f in path.frames if (c := f.compensation) is not None})
        shown = ", ".join(f"{radius:g} mm" for radius in radii[:5]) + (", ..." if len(radii) > 5 else "")
        begins = on & (path.contour_number() != np.concatenate(([-1], path.contour_number()[:-1])))
        what = f"contours were followed with cutter radii of {shown}"
        if program.dialect.contours_assumed:
            found.append(finding("OLP313", program.dialect.contours_assumed, lines_of(path, begins)))
        if any(radii) or not program.dialect.contours_assumed:
            found.insert(0, finding("OLP305", what, lines_of(path, begins)))
    for name, line, _ in program.remarks:
        if name == "path":
            text = "contours were replaced by the path of the tool; wear at the control does not act on it"
            if program.origin is not None:
                text += ", and loops and subprograms are written out"
            found.append(finding("OLP314", text, [line]))
    return found


def path_mode_findings(program: Program, correction_mm: float) -> list[Finding]:
    """Does the control leave the path by more than the correction?"""
    findings: list[Finding] = []
    if not program.dialect.path_tolerance:
        return findings
    if not program.path_modes and len(program.toolpath):
        findings.append(
            finding(
                "OLP201",
                f"no path mode is stated: {program.dialect.path_mode}",
                [int(program.toolpath.line[0])],
            )
        )
    bare = [m.line for m in program.path_modes if m.tolerance_mm is None]
    if bare:
        findings.append(
            finding("OLP201", "G64 without P sets no bound to how far the control rounds corners", bare)
        )
    wide = [
        m for m in program.path_modes if m.tolerance_mm is not None and m.tolerance_mm > correction_mm > 0
    ]
    if wide:
        worst = max(m.tolerance_mm or 0.0 for m in wide)
        findings.append(
            finding(
                "OLP202",
                f"{wide[0].name} lets the control leave the path by {worst * 1e3:.3g} um, more than the "
                f"largest correction of {correction_mm * 1e3:.3g} um",
                [m.line for m in wide],
            )
        )
    merging = [m.line for m in program.path_modes if m.merge_mm > 0.0 and (m.tolerance_mm or 0) > 0]
    if merging:
        findings.append(
            finding("OLP203", "G64 P without Q0 also merges short blocks within the tolerance", merging)
        )
    return findings


def proof_findings(
    proof: Proof, uncorrected: Index, dialect: Dialect, place: Callable[[int], str] = str
) -> list[Finding]:
    """Findings from the proof of a program of this dialect; `place` puts a line into words."""
    findings = []
    path = proof.nominal
    count, over = len(path), found(len(path), lambda some: proof.size_mm(some) > proof.tolerance_mm)
    size = proof.size_mm(over)
    chosen = size > proof.allowed_mm
    above = over[chosen]
    if above.size:
        worst = int(above[size[chosen].argmax()])
        what = f"{len(above)} moves are above tolerance: {size.max() * 1e3:.2f} um at line "
        what += f"{place(int(path.line[worst]))}, allowed {proof.allowed_mm * 1e3:.2f} um"
        if path.compensated()[above].any() and proof.written.compensated().any():
            what += "; contours under cutter compensation are among them: correct with --contour path"
        cycle = np.uint8(Flag.CYCLE)
        if ((path.flag[above] | path.flag[np.maximum(above - 1, 0)]) & cycle).any():
            what += "; holes of canned cycles, or moves from there, are among them: write these cycles out "
            what += _AS_MOVES[dialect.expands_cycles]
        findings.append(finding("OLP101", what, lines_of(path, above)))
    if not any((proof.counts[some] <= Counts.LEFT).any() for some in spans(count)):
        findings.append(finding("OLP107", "no move of this program could be judged"))
    untouched = found(count, lambda some: _has(path, some, Flag.PASS | Flag.MACHINE))
    untouched = distinct(np.concatenate((untouched, uncorrected)))
    if untouched.size:
        what = f"{len(untouched)} moves were written unchanged"
        findings.append(finding("OLP102", what, lines_of(path, untouched)))
    unknown = found(
        count,
        lambda some: (proof.counts[some] <= Counts.LEFT) & (proof.after.side[some] > proof.tolerance_mm),
    )
    if unknown.size:
        findings.append(
            finding(
                "OLP103",
                f"in {len(unknown)} moves the side of an axis' backlash is unknown; up to "
                f"{proof.after.side[unknown].max() * UM_PER_MM:.1f} um of the deviation comes from that",
                lines_of(path, unknown),
            )
        )
    holes = proof.counts[over] == Counts.HOLE
    if holes.any():
        most_um = size[holes].max() * UM_PER_MM
        what = f"{int(holes.sum())} holes are off by up to {most_um:.2f} um along the stroke; write their "
        what += f"cycles out {_AS_MOVES[dialect.expands_cycles]}"
        findings.append(finding("OLP105", what, lines_of(path, over[holes])))
    lean = proof.lean[over]
    if lean.any():
        what = f"{int(lean.sum())} feed moves start where a canned cycle or an uncorrected move ended; they "
        what += f"are off by up to {size[lean].max() * UM_PER_MM:.2f} um"
        findings.append(finding("OLP306", what, lines_of(path, over[lean])))
    return findings


def part_findings(table: Judgements, part_tolerance_um: float | None) -> list[Finding]:
    """Is the corrected path within the part tolerance, uncertainty left aside?"""
    if part_tolerance_um is None:
        return []
    above = found(
        len(table.counts),
        lambda some: (
            (table.counts[some] <= Counts.LEFT)
            & (np.nan_to_num(table.corrected[some]) * UM_PER_MM > part_tolerance_um)
        ),
    )
    if not above.size:
        return []
    what = (
        f"{len(above)} moves are above the part tolerance: "
        f"{table.largest_mm() * UM_PER_MM:.2f} um, {part_tolerance_um:g} um allowed"
    )
    return [finding("OLP108", what, sorted(set(table.line[above].tolist())))]


def sources(along: Along, model: ErrorModel) -> list[dict[str, Any]]:
    """Size of each error source over the nominal path, at waypoints and between them, largest first."""

    def sizes(point: Array, move: Index) -> Iterator[tuple[str, Array]]:
        for name, part in model.contributions(point, along.path.tool_at(move)):
            yield name, np.sqrt(np.einsum("ij,ij->i", part, part))

    rows = [
        {"name": figure.name, "max_um": figure.largest * 1e3, "rms_um": figure.rms * 1e3}
        for figure in along.figures(sizes)
    ]
    return sorted(rows, key=lambda row: -row["max_um"])


def orientation(along: Along, model: ErrorModel) -> dict[str, float]:
    """Largest and rms angle of the tool in urad along the nominal path, which a machine with three linear
    axes cannot correct."""
    path = along.path
    payloads = [(f.payload_kg,) for f in path.frames]

    def sizes(point: Array, move: Index) -> Iterator[tuple[str, Array]]:
        turned = model.rotation(point, None, path.per_frame_at(payloads, move)[..., 0])
        yield "", np.sqrt(np.einsum("ij,ij->i", turned, turned)) * 1e6

    angle = next(iter(along.figures(sizes)), Figure("", 0.0, 0.0))
    return {"max_urad": angle.largest, "rms_urad": angle.rms}


def worst_blocks(program: Program, table: Judgements) -> list[dict[str, Any]]:
    """The blocks farthest from the nominal path once corrected, and their uncorrected deviation."""
    rows = table.on_lines(table.worst_lines(_WORST)).by_line()
    size = np.where(rows["state"] == SHOWN, 0.0, np.nan_to_num(rows["corrected_um"]))
    return [
        {
            "line": int(rows["line"][k]),
            "text": program.text(int(rows["line"][k])),
            "before_um": float(np.nan_to_num(rows["uncorrected_um"][k])),
            "after_um": float(size[k]),
        }
        for k in np.lexsort((rows["line"], -size))[:_WORST].tolist()
        if size[k] > 0.0
    ]


def tally_moves(path: Toolpath, uncorrected: int, parts: npt.NDArray[np.integer[Any]]) -> dict[str, int]:
    """Every move is corrected, corrected approximately, or left uncorrected; the three add up to all."""
    total, skipped, approximated, split = len(path), uncorrected, 0, 0
    for some in spans(total):
        untouched = _has(path, some, Flag.PASS | Flag.MACHINE | Flag.CONTROL)
        rough = _has(path, some, Flag.CYCLE | Flag.WHOLE) | (path.kind[some] == Kind.PROBE)
        skipped += int(np.count_nonzero(untouched))
        approximated += int(np.count_nonzero(rough & ~untouched))
        split += int(np.count_nonzero(parts[some] > 1))
    return {
        "total": total,
        "corrected": total - skipped - approximated,
        "approximated": approximated,
        "passed": skipped,
        "refused": 0,
        "split": split,
    }


def _has(path: Toolpath, some: slice, flags: Flag) -> Mask:
    """(m,) which of some moves have one of the flags."""
    return np.asarray((path.flag[some] & np.uint8(flags)) != 0)
