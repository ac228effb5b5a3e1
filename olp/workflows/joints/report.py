"""The report ("olp-joints-1") of a proof on a machine with rotary joints, and its findings."""

from __future__ import annotations

import datetime
import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from olp.checks.base import finding
from olp.checks.listed import remark_findings
from olp.compensation.joints.arm_path import ArmPath
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.compensation.style import fewest_decimals
from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Kind
from olp.core.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM
from olp.findings.catalogue import Finding
from olp.kinematics.errors import TURN_DEG
from olp.kinematics.machine import JointCalibration
from olp.program.robots.dialect import RobotDialect
from olp.proof.joints import Deviation, JointProof, largest_steps
from olp.workflows.joints.loaded import JointRun

#: Kinds of moves that cut.
_FEED = (Kind.LINE, Kind.ARC_CW, Kind.ARC_CCW)
#: Lines of the table of worst blocks.
_WORST = 10
#: An axis value beyond its calibrated range by less than this is on its end: mm or deg.
_AT_END = 1e-6
#: A backlash of fewer last digits is not taken up well by words.
_FINE_DIGITS = 2.0

_PROVES = (
    "the written text, read back from its bytes, commands what was computed (syntax, digits, modal words)",
    "the machine with its errors at those commands has tip and tool axis where the program says, at and "
    "between the waypoints",
)
_DOES_NOT_PROVE = (
    "that the calibration still describes the machine: measure a ball or a circle to see that",
    "what the control does between blocks (blending, following error) and what the process does to the part",
)

#: What the proof of a list of points says nothing of.
_BETWEEN = "the path between the rows: the list does not say how the machine goes from one to the next"


def last_digits(path: JointPath) -> tuple[float, float]:
    """The coarsest last digits of the corrected program: mm and deg."""
    words, dialect = path.coordinates, path.program.dialect
    if isinstance(dialect, RobotDialect):
        scale = max((frame.unit_mm for frame in path.program.toolpath.frames), default=1.0)
        turn = dialect.turn_unit_rad * 10.0**-dialect.turn_decimals
        return scale * 10.0**-dialect.decimals, float(np.degrees(turn))
    units = {frame.unit_mm for frame in path.program.toolpath.frames} or {1.0}
    in_words = path.listed is None
    linear, rotary = [], []
    for unit, step, places in zip(words.units, words.steps, path.places.tolist(), strict=True):
        if unit == "deg":
            rotary.append(10.0 ** -(max(places, 1) if in_words else places))
        elif in_words:
            linear += [10.0 ** -fewest_decimals(step, u, dialect.inch_decimals) * u for u in units]
        else:
            linear.append(10.0**-places)
    led = path.directions.led[path.judged]
    if led.any():
        rotary = [] if led.all() else rotary
        rotary.append(float(np.degrees(10.0**-path.directions.decimals)))
    return max(linear, default=0.0), max(rotary, default=0.0)


def report_of(
    run: JointRun, path: JointPath, plan: JointPlan, proof: JointProof, findings: tuple[Finding, ...],
    tolerance: tuple[float, float],
) -> dict[str, Any]:  # fmt: skip
    program = path.program
    kept = _kept(path, plan)
    return {
        "schema": "olp-joints-1",
        "program": {
            "name": Path(run.program.name).name if run.program.name else "",
            "sha256": hashlib.sha256(program.data).hexdigest(),
            "lines": program.lines,
            "dialect": program.dialect.name,
            "moves": len(path),
        },
        **run.heads(),
        "tolerance_um": tolerance[0],
        "tolerance_urad": tolerance[1],
        "deviation": {
            "before": _summary(proof.before, proof.judged),
            "after": _summary(proof.after, proof.judged),
            "allowed_um": proof.allowed_mm * UM_PER_MM,
            "allowed_urad": proof.allowed_rad / RAD_PER_URAD,
            "holds": proof.holds,
        },
        "orientation": {
            "uncorrectable_urad": float(np.max(proof.left_rad[proof.judged], initial=0.0)) / RAD_PER_URAD,
            "near_singular": int(plan.limited.sum()),
        },
        "largest_correction": _largest(path, plan),
        "moves": {
            **kinds_of(path),
            "with_tip_control": int(path.tip.sum()),
            "uncorrected": len(kept),
            "parts": len(plan.move),
        },
        "worst": _worst(path, proof),
        "verdict": {"ok": proof.holds},
        "findings": [one.as_dict() for one in findings],
        "proves": list(_PROVES),
        "does_not_prove": [*_DOES_NOT_PROVE, *([] if path.feed.any() else [_BETWEEN])],
    }


def kinds_of(path: JointPath) -> dict[str, int]:
    """Straight moves that cut, and others. An arm turns its tool along straight moves, too."""
    if isinstance(path, ArmPath):
        return {"feed": int(path.feed.sum()), "rapid": int((path.judged & ~path.feed).sum())}
    kind = path.program.toolpath.kind
    return {"feed": int(np.isin(kind, _FEED).sum()), "rapid": int((kind == Kind.RAPID).sum())}


def filed(report: dict[str, Any], name: str, date: datetime.date | None) -> bytes:
    """The report of a correction in the form that `name` ends in."""
    from olp.core.version import __version__
    from olp.reports.document import in_form
    from olp.reports.document_joints import correction
    from olp.reports.report import to_json

    if Path(name).suffix.lower() == ".json":
        return to_json(report)
    return in_form(correction(report, __version__, date), name)


def _summary(deviation: Deviation, judged: Mask) -> dict[str, float | None]:
    """The largest and the rms deviation of the moves that cut."""
    samples = int(deviation.samples[judged].sum())

    def largest(values: Array) -> float | None:
        return float(np.max(values[judged])) if judged.any() else None

    def rms(squares: Array) -> float | None:
        return float(np.sqrt(squares[judged].sum() / samples)) if samples else None

    values = {
        "position_max_um": largest(deviation.distance_mm * UM_PER_MM),
        "position_rms_um": rms(deviation.square_mm2 * UM_PER_MM**2),
        "orientation_max_urad": largest(deviation.angle_rad / RAD_PER_URAD),
        "orientation_rms_urad": rms(deviation.square_rad2 / RAD_PER_URAD**2),
    }
    return values


def _largest(path: JointPath, plan: JointPlan) -> dict[str, float]:
    """By axis the largest change of its coordinates, um or urad."""
    with np.errstate(invalid="ignore"):
        change = np.abs(plan.command - path.at(plan.move, plan.share))
    largest = np.nanmax(np.append(change, np.zeros((1, change.shape[1])), axis=0), axis=0)
    words = path.coordinates
    return {
        f"{name}_urad" if unit == "deg" else f"{name}_um": float(
            np.radians(value) / RAD_PER_URAD if unit == "deg" else value * UM_PER_MM
        )
        for name, unit, value in zip(words.names, words.units, largest.tolist(), strict=True)
    }


def _worst(path: JointPath, proof: JointProof) -> list[dict[str, Any]]:
    over = np.maximum(
        proof.after.distance_mm / proof.allowed_mm,
        proof.over_rad / proof.allowed_rad,
    )
    over, line = np.where(proof.judged, over, -np.inf), path.program.original_lines(path.line)
    rows = [row for row in np.argsort(-over, kind="stable")[:_WORST].tolist() if np.isfinite(over[row])]
    return [
        {
            "line": int(line[row]),
            "position_um": float(proof.after.distance_mm[row]) * UM_PER_MM,
            "orientation_urad": float(proof.after.angle_rad[row]) / RAD_PER_URAD,
            "uncorrected_um": float(proof.before.distance_mm[row]) * UM_PER_MM,
            "uncorrected_urad": float(proof.before.angle_rad[row]) / RAD_PER_URAD,
        }
        for row in rows
    ]


def _kept(path: JointPath, plan: JointPlan) -> Index:
    """The moves that are left uncorrected."""
    solid = np.isfinite(plan.command).all(axis=1)
    targets = path.program.targets
    gaps = () if targets is None else targets.gaps
    return np.setdiff1d(np.arange(len(path)), np.append(plan.move[solid], np.array(gaps, np.int64)))


def findings_of(
    path: JointPath, plan: JointPlan, proof: JointProof, run: JointRun, tolerance: tuple[float, float]
) -> tuple[Finding, ...]:
    """What a person should know of a correction with its tolerances in um and urad."""
    found, line = [], path.program.original_lines(path.line)
    if proof.over.any():
        what = "the corrected path leaves its tolerance at these lines" + _coarse_digits(path, plan, proof)
        found.append(finding("OLP101", what, line[proof.over].tolist()))
    after = proof.after
    unknown = (after.unknown_mm > tolerance[0] * MM_PER_UM) | (
        after.unknown_rad > tolerance[1] * RAD_PER_URAD
    )
    unknown &= proof.judged
    if unknown.any():
        what = (
            f"in {int(unknown.sum())} moves the side of an axis' backlash is unknown; up to "
            f"{after.unknown_mm[unknown].max() * UM_PER_MM:.1f} um and "
            f"{after.unknown_rad[unknown].max() / RAD_PER_URAD:.1f} urad of the deviation come from that; "
            "move each axis by more than its backlash before"
        )
        found.append(finding("OLP103", what, line[unknown].tolist()))
    holes = path.holes.strokes & proof.judged & (proof.after.distance_mm > proof.allowed_mm)
    if holes.any():
        most_um = float(proof.after.distance_mm[holes].max()) * UM_PER_MM
        what = f"{int(holes.sum())} holes are off by up to {most_um:.2f} um along the stroke"
        found.append(finding("OLP105", what, line[holes].tolist()))
    kept = _kept(path, plan)
    if len(kept):
        found.append(finding("OLP102", f"{len(kept)} moves are left uncorrected", line[kept].tolist()))
    if plan.limited.any():
        what = "near a singular posture: the position is met, and a rest of the orientation is left"
        found.append(finding("OLP106", what, line[plan.move[plan.limited]].tolist()))
    arcs = np.flatnonzero(path.curves.mask & plan.straight)
    if len(arcs):
        what = f"{len(arcs)} arcs are written as straight moves within the tolerance"
        found.append(finding("OLP111", what, line[arcs].tolist()))
    found += remark_findings(path.program.in_original())
    if not proof.judged.any():
        found.append(finding("OLP107", "no feed move was corrected at a known position"))
    if run.calibration is not None:
        found += _outside(path, plan, run)
    return (*found, *payload_findings(run))


def payload_findings(run: JointRun) -> list[Finding]:
    """What speaks against the calibration of a run: the payload that it is for."""
    if run.calibration is None or run.machine.real_time is not None:
        return []
    return _held(run.calibration)


def _coarse_digits(path: JointPath, plan: JointPlan, proof: JointProof) -> str:
    """Words on rotary axes whose last digit is coarse beside their backlash, and a digit that is not: empty
    where that does not explain what is over. A step by one digit takes up a part of such a backlash only, or
    turns the axis round inside of a move."""
    words, width = path.coordinates, np.abs(path.motion.width)
    if words.poses or isinstance(path, ArmPath) or path.directions.led.any():
        return ""
    digit = 10.0 ** -path.places.astype(float)
    coarse = words.rotary & (width > 0.0) & (width < _FINE_DIGITS * digit)
    if not coarse.any():
        return ""
    most_mm, most_rad = largest_steps(path, plan, np.tile(np.where(coarse, width, 0.0), (len(plan.move), 1)))
    over_mm, over_rad = proof.after.distance_mm[proof.over].max(), proof.over_rad[proof.over].max()
    if over_mm > proof.allowed_mm + most_mm or over_rad > proof.allowed_rad + most_rad:
        return ""
    urad = np.radians(np.stack((digit, width))) / RAD_PER_URAD
    shown = " and ".join(
        f"{words.names[axis]} (digits of {digit[axis]:g} deg, {urad[0, axis]:.1f} urad; backlash "
        f"{urad[1, axis]:.1f} urad)"
        for axis in np.flatnonzero(coarse).tolist()
    )
    finest = min(10.0 ** np.floor(np.log10(width[coarse].min())), digit[coarse].min() / 10.0)
    fine = np.format_float_positional(finest, trim="-")
    return (
        f"; the last digit is too coarse for the backlash of {shown}; state least_increment_deg = {fine} if "
        "the control reads such words, or give larger tolerances"
    )


def _held(calibration: JointCalibration) -> list[Finding]:
    """Another payload than that of the readings, where nothing says what it bends."""
    own, job = calibration.payload, calibration.errors.payload
    if calibration.errors.yields or own == job:
        return []
    there, here = (f"{one.kg:g} kg" if one.kg else "none" for one in (own, job))
    if own.kg == job.kg:
        there, here = (f"{one.kg:g} kg with its centre at {list(one.centre_mm)} mm" for one in (own, job))
    what = (
        f"the payload of the job is {here}, that of the calibration {there}; the calibration has no "
        "[elasticity], so what the difference bends is not corrected"
    )
    return [finding("OLP422", what)]


def outside_box(path: JointPath, plan: JointPlan, run: JointRun) -> list[tuple[int, str]]:
    """Lines whose commands leave the calibrated values of an axis, each with a sentence."""
    # what only goes past an end brings the tool nowhere
    ends = ~(plan.stands & (plan.share == 1.0))
    return out_of_box(plan.move, np.where(ends[:, None], plan.axes, np.nan), path, run)


def out_of_box(move: Index, axes: Array, path: JointPath, run: JointRun) -> list[tuple[int, str]]:
    """Lines of moves (r,) whose axis values (r, axes) leave the calibrated ones, each with a sentence; none
    without a calibration."""
    structure, found = path.motion.structure, []
    for column, name in enumerate(structure.order if run.calibration is not None else ()):
        assert run.calibration is not None
        low, high = run.calibration.box[name]
        if name in structure.endless and high - low > TURN_DEG - _AT_END:
            continue
        value = axes[:, column]
        with np.errstate(invalid="ignore"):
            out = np.flatnonzero((value < low - _AT_END) | (value > high + _AT_END))
        unit = structure.units[column]
        found += [
            (
                int(path.line[move[row]]),
                f"the command {name} = {value[row]:.6g} {unit} is outside the calibrated {low:g} to {high:g}",
            )
            for row in out.tolist()
        ]
    return sorted(found)


def _outside(path: JointPath, plan: JointPlan, run: JointRun) -> list[Finding]:
    out = outside_box(path, plan, run)
    if not out:
        return []
    lines = path.program.original_lines([line for line, _ in out]).tolist()
    return [finding("OLP403", f"{out[0][1]}; its error is that at the nearest end", lines)]
