"""What a person should know about a correction, as findings; and the tables of the report."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from olp.checks.base import finding, lines_of
from olp.checks.listed import between_findings as between_findings
from olp.checks.listed import remark_findings
from olp.compensation.hole_plan import HolePlan
from olp.core.arrays import Index
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.errormodel.base import ErrorModel
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.proof.proof import Proof

_SAMPLED = 4096
_WORST = 5


def program_findings(program: Program, setup: Setup, *, contour: bool) -> list[Finding]:
    """What the program's text alone tells."""
    out = []
    path = program.toolpath
    for name, line, text in program.remarks:
        if name == "unit":
            which = "neither G20 nor G21 stands before the first move" if text == "mm" else text
            out.append(finding("OLP301", f"{which}; millimetres assumed", [line]))
        elif name == "thermal":
            out.append(finding("OLP412", text, [line]))
        elif name == "arcs":
            out.append(finding("OLP413", text, [line]))
        elif name == "increments":
            out.append(
                finding(
                    "OLP302",
                    "lengths without a decimal point are read as least increments of the control",
                    [line],
                )
            )
    out += remark_findings(program)
    whole = ((path.flag & np.uint8(Flag.WHOLE)) != 0) & (path.kind != Kind.PROBE)
    if whole.any() and not (program.statements and program.statements.decimal):
        lines = lines_of(path, whole)
        out.append(
            finding(
                "OLP104", f"{len(lines)} blocks move another axis too; corrected at their ends only", lines
            )
        )
    deleted = (path.flag & np.uint8(Flag.DELETED)) != 0
    if deleted.any():
        lines = lines_of(path, deleted)
        out.append(
            finding("OLP304", f"{len(lines)} blocks stand under block delete; proved with and without", lines)
        )
    assumed = sorted({
        f.work_offset for f in path.frames
        if f.touched is not None and (o := setup.work_offset(f.work_offset)) is not None
        and o.touched_at_mm == (None, None, None)
    })  # fmt: skip
    for name in assumed:
        out.append(
            finding("OLP303", f"{name} is taken as touched off on the raw machine at its own position")
        )
    if contour:
        out.append(finding("OLP305", "contours under G41/G42 were taken as the path of the tool"))
    if setup.machine.compensated_by_controller:
        names = ", ".join(sorted(setup.machine.compensated_by_controller))
        out.append(finding("OLP404", f"the control corrects {names}; left to it"))
    return out


def path_mode_findings(program: Program, correction_mm: float) -> list[Finding]:
    """Does the control leave the path by more than it is corrected?"""
    out: list[Finding] = []
    if not program.dialect.path_tolerance:
        return out
    if not program.path_modes and len(program.toolpath):
        out.append(
            finding(
                "OLP201",
                f"no path mode is stated: {program.dialect.path_mode}",
                [int(program.toolpath.line[0])],
            )
        )
    bare = [m.line for m in program.path_modes if m.tolerance_mm is None]
    if bare:
        out.append(finding("OLP201", "G64 without P lets the control round corners without bound", bare))
    wide = [
        m for m in program.path_modes if m.tolerance_mm is not None and m.tolerance_mm > correction_mm > 0
    ]
    if wide:
        worst = max(m.tolerance_mm or 0.0 for m in wide)
        out.append(
            finding(
                "OLP202",
                f"{wide[0].name} lets the path leave by {worst * 1e3:.3g} um, more than the largest "
                f"correction of {correction_mm * 1e3:.3g} um",
                [m.line for m in wide],
            )
        )
    merging = [m.line for m in program.path_modes if m.merges and (m.tolerance_mm or 0) > 0]
    if merging:
        out.append(
            finding("OLP203", "G64 P without Q0 also merges short blocks within the tolerance", merging)
        )
    return out


def proof_findings(proof: Proof, passed: Index) -> list[Finding]:
    """What the proof found."""
    out = []
    path = proof.nominal
    size = proof.size_mm()
    above = size > proof.allowed_mm
    if above.any():
        worst = int(size.argmax())
        out.append(
            finding(
                "OLP101",
                f"{int(above.sum())} moves end above tolerance: {size[worst] * 1e3:.2f} um at line "
                f"{int(path.line[worst])}, allowed {proof.allowed_mm * 1e3:.2f} um",
                lines_of(path, above),
            )
        )
    if not proof.after.judged.any():
        out.append(finding("OLP107", "no move of this program could be judged"))
    untouched = (path.flag & np.uint8(Flag.PASS | Flag.MACHINE)) != 0
    untouched[passed] = True
    if untouched.any():
        lines = lines_of(path, untouched)
        out.append(finding("OLP102", f"{int(untouched.sum())} moves were written as they were", lines))
    unknown = proof.after.side > proof.tolerance_mm
    if unknown.any():
        out.append(
            finding(
                "OLP103",
                f"at {int(unknown.sum())} way-points the flank of an axis is not known yet; the tip may be "
                f"off by up to {proof.after.side.max() * 1e3:.1f} um there",
                lines_of(path, unknown),
            )
        )
    if proof.lean.any():
        lines = lines_of(path, proof.lean)
        out.append(finding("OLP306", f"{len(lines)} feed moves start where a move ended uncorrected", lines))
    return out


def hole_findings(holes: HolePlan, tolerance_mm: float) -> list[Finding]:
    """Cycles whose stroke cannot follow the error."""
    leaning = [
        h.line for h, lean in zip(holes.holes, holes.lean_mm.tolist(), strict=True) if lean > tolerance_mm
    ]
    if not leaning:
        return []
    return [
        finding(
            "OLP105",
            f"{len(leaning)} holes lean by up to {holes.lean_mm.max() * 1e3:.2f} um between R and bottom",
            leaning,
        )
    ]


def stroke_findings(program: Program, model: ErrorModel, tolerance_mm: float) -> list[Finding]:
    """Holes whose stroke, which is the control's own, cannot follow the error."""
    said = program.statements
    if said is None or not len(said.strokes):
        return []
    path = program.toolpath
    top, bottom = said.strokes[:, 0], said.strokes[:, 1]
    tool = path.tool_mm()
    tool_vectors = tool if tool.ndim == 1 else tool[top]
    change = model.error(path.end_mm[bottom], tool_vectors) - model.error(path.end_mm[top], tool_vectors)
    lean = np.nan_to_num(np.sqrt((change * change).sum(axis=1))) / 2
    wide = lean > tolerance_mm
    if not wide.any():
        return []
    what = f"{int(wide.sum())} holes lean by up to {lean.max() * 1e3:.2f} um at clearance and bottom"
    return [finding("OLP105", what, path.line[top[wide]].tolist())]


def sources(path: Toolpath, model: ErrorModel) -> list[dict[str, Any]]:
    """Size of each source of error over the nominal path, largest first, from up to 4096 of its moves."""
    known = np.flatnonzero(np.isfinite(path.end_mm).all(axis=1))
    if not len(known):
        return []
    pick = known[np.linspace(0, len(known) - 1, min(len(known), _SAMPLED)).astype(np.int64)]
    tool = path.tool_mm()
    out = []
    for name, part in model.contributions(path.end_mm[pick], tool if tool.ndim == 1 else tool[pick]):
        size = np.sqrt((part * part).sum(axis=1))
        out.append(
            {
                "name": name,
                "max_um": float(size.max()) * 1e3,
                "rms_um": float(np.sqrt(np.mean(size * size))) * 1e3,
            }
        )
    return sorted(out, key=lambda row: -row["max_um"])


def orientation(path: Toolpath, model: ErrorModel) -> dict[str, float]:
    """Largest and rms angle of the tool that the machine cannot correct, in urad."""
    known = np.flatnonzero(np.isfinite(path.end_mm).all(axis=1))
    if not len(known):
        return {"max_urad": 0.0, "rms_urad": 0.0}
    pick = known[np.linspace(0, len(known) - 1, min(len(known), _SAMPLED)).astype(np.int64)]
    payload = path.per_frame([(f.payload_kg,) for f in path.frames])[..., 0]
    turned = model.rotation(path.end_mm[pick], None, payload if payload.ndim == 0 else payload[pick])
    angle = np.sqrt((turned**2).sum(axis=1)) * 1e6
    return {"max_urad": float(angle.max()), "rms_urad": float(np.sqrt(np.mean(angle * angle)))}


def worst_blocks(program: Program, proof: Proof) -> list[dict[str, Any]]:
    """The blocks that stay farthest from the nominal path, with what they were before."""
    size = proof.size_mm()
    before = np.fmax(np.nan_to_num(proof.before.waypoint), np.nan_to_num(proof.before.path))
    out: list[dict[str, Any]] = []
    seen: set[int] = set()
    few = min(50 * _WORST, len(size))
    top = np.argpartition(size, len(size) - few)[len(size) - few :] if few else np.zeros(0, np.int64)
    for move in top[np.lexsort((top, -size[top]))].tolist():
        line = int(program.toolpath.line[move])
        if line in seen or size[move] == 0:
            continue
        seen.add(line)
        out.append(
            {
                "line": line,
                "text": program.text(line),
                "before_um": float(before[move]) * 1e3,
                "after_um": float(size[move]) * 1e3,
            }
        )
        if len(out) == _WORST:
            break
    return out


def tally_moves(path: Toolpath, passed: int, parts: npt.NDArray[np.int32]) -> dict[str, int]:
    """Every move is corrected, corrected approximately, or passed; the three add up to all."""
    untouched = (path.flag & np.uint8(Flag.PASS | Flag.MACHINE | Flag.CONTROL)) != 0
    rough = ((path.flag & np.uint8(Flag.CYCLE | Flag.WHOLE)) != 0) | (path.kind == Kind.PROBE)
    rough &= ~untouched
    total = len(path)
    skipped = int(untouched.sum()) + passed
    return {
        "total": total,
        "corrected": total - skipped - int(rough.sum()),
        "approximated": int(rough.sum()),
        "passed": skipped,
        "refused": 0,
        "split": int((parts > 1).sum()),
    }
