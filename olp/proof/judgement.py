"""The table of judgements: what every report, the gate and the page say of a proved program.

It is computed once, from a proof. A row is a nominal move: how it counts, how far the tip is off with the
nominal and with the corrected program, what is allowed, and the verdict. Lines, operations, tools and the
program are groups of rows. Nothing else decides whether a program is within tolerance.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Index, Mask
from olp.core.units import UM_PER_MM
from olp.findings.catalogue import Finding
from olp.findings.rule import Severity
from olp.proof.proof import Counts, Proof

Single = npt.NDArray[np.float32]

#: A probability from here on is enough: two standard deviations on both sides.
ENOUGH = 0.95
#: What the reasons of rows are called.
REASONS = {
    Counts.FEED: "feed", Counts.POINT: "point", Counts.HOLE: "hole", Counts.RAPID: "rapid",
    Counts.UNCORRECTED: "uncorrected", Counts.UNKNOWN: "unknown position",
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Judgements:
    """(n,) per nominal move: `line`, `tool` (-1: none), `operation` (from 0: of one tool and work offset) and
    `counts`. In mm: `uncorrected` and `corrected` are the deviations that count, or where the move only is
    shown its deviation at the end; `at_end` is the corrected deviation at the end of the move. NaN where a
    position is unknown. `allowed_mm` is numerical tolerance plus rounding."""

    line: Index
    tool: Index
    operation: Index
    counts: npt.NDArray[np.uint8]
    uncorrected: Single
    corrected: Single
    at_end: Single
    tolerance_mm: float
    allowed_mm: float

    @staticmethod
    def of(proof: Proof) -> Judgements:
        path = proof.nominal
        numbers = np.array([-1 if f.tool is None else f.tool for f in path.frames] or [-1])
        offsets = [f.work_offset for f in path.frames] or [""]
        keys = list(zip(numbers.tolist(), offsets, strict=True))
        key = np.array([keys.index(k) for k in keys])[path.frame] if len(path.frames) else path.frame
        operation = np.cumsum(np.diff(key, prepend=key[:1]) != 0) if len(key) else key
        judged = proof.judged
        shown = (proof.counts == Counts.RAPID) | (proof.counts == Counts.UNCORRECTED)
        sides = [
            np.where(judged, size, np.where(shown, part.waypoint, np.nan)).astype(np.float32)
            for part, size in ((proof.before, proof.before_mm), (proof.after, proof.after_mm))
        ]
        return Judgements(
            path.line.astype(np.int64), numbers[path.frame], operation.astype(np.int64), proof.counts,
            sides[0], sides[1], proof.after.waypoint, proof.tolerance_mm, proof.allowed_mm,
        )  # fmt: skip

    @property
    def judged(self) -> Mask:
        """(n,) moves that count."""
        return np.asarray(self.counts <= Counts.HOLE, bool)

    @property
    def over(self) -> Mask:
        """(n,) moves that count and are above what is allowed."""
        return np.asarray(self.judged & (np.nan_to_num(self.corrected) > self.allowed_mm), bool)

    def largest_mm(self, which: Mask | None = None) -> float:
        """The largest deviation of the corrected program that counts, of all moves or of some."""
        rows = self.judged if which is None else self.judged & which
        return float(np.nan_to_num(self.corrected[rows]).max(initial=0.0))

    def by_line(self) -> dict[str, npt.NDArray[Any]]:
        """Of each line that moves: `line`, `uncorrected_um` and `corrected_um`, the largest of what counts on
        it, else of what is shown, and `state`: 0 within, 1 above, 2 shown and not judged."""
        lines, row = np.unique(self.line, return_inverse=True)
        result: dict[str, npt.NDArray[Any]] = {"line": lines}
        counted = np.zeros(len(lines), bool)
        counted[row[self.judged]] = True
        rows = self.judged | ~counted[row]
        for name, values in (("uncorrected_um", self.uncorrected), ("corrected_um", self.corrected)):
            largest = np.full(len(lines), np.nan, np.float32)
            np.fmax.at(largest, row[rows], values[rows] * np.float32(UM_PER_MM))
            result[name] = largest
        state = np.where(counted, 0, 2).astype(np.uint8)
        state[row[self.over]] = 1
        return result | {"state": state}

    def groups(self, of: Index) -> list[dict[str, Any]]:
        """Largest deviations and verdict of the moves of each value of `of` (n,), in order of appearance."""
        values, first = np.unique(of, return_index=True)
        rows = []
        for value in values[np.argsort(first)].tolist():
            mine = (of == value) & self.judged
            if not mine.any():
                continue
            worst = int(np.flatnonzero(mine)[np.nan_to_num(self.corrected[mine]).argmax()])
            rows.append({
                "first_line": int(self.line[mine].min()),
                "last_line": int(self.line[mine].max()),
                "tool": int(self.tool[worst]) if self.tool[worst] >= 0 else None,
                "uncorrected_um": float(np.nan_to_num(self.uncorrected[mine]).max()) * UM_PER_MM,
                "corrected_um": float(np.nan_to_num(self.corrected[mine]).max()) * UM_PER_MM,
                "worst_line": int(self.line[worst]),
                "holds": not bool(self.over[mine].any()),
            })  # fmt: skip
        return rows

    def report(self) -> dict[str, Any]:
        """The table by groups, as plain data."""
        shown = {
            REASONS[kind]: float(np.nan_to_num(self.corrected[self.counts == kind]).max(initial=0.0))
            * UM_PER_MM
            for kind in (Counts.RAPID, Counts.UNCORRECTED)
            if (self.counts == kind).any()
        }
        return {
            "moves": {REASONS[kind]: int((self.counts == kind).sum()) for kind in Counts},
            "shown_um": shown,
            "operations": self.groups(self.operation),
            "tools": self.groups(self.tool),
        }


def verdict(
    table: Judgements, part_tolerance_um: float | None, uncertainty: dict[str, Any] | None,
    findings: Iterable[Finding],
) -> dict[str, Any]:  # fmt: skip
    """The verdict on a proved program, in values and in sentences. `numerical`: does the written program do
    what the model asks. `part`: is the part good as far as that is known, None without a part tolerance.
    `ok` is False where either fails, or another finding is an error."""
    numerical = _numerical(table)
    part = None if part_tolerance_um is None else _part(table, part_tolerance_um, uncertainty)
    errors = sorted({f.code for f in findings if f.severity >= Severity.ERROR} - _OWN)
    sentences = [_numerical_sentence(numerical)]
    if part is not None:
        sentences.append(_part_sentence(part))
    if errors:
        sentences.append(f"Not to be run as it is: {', '.join(errors)}.")
    ok = numerical["holds"] and (part is None or part["holds"]) and not errors
    return {"ok": bool(ok), "numerical": numerical, "part": part, "errors": errors, "sentences": sentences}


def measured(largest_um: float | None, tolerance_um: float | None) -> dict[str, Any]:
    """The verdict on measured runs: `ok` is None where no part tolerance is stated. `largest_um` is the
    largest distance of a point of a cutting move from the path, None where no point counts."""
    result = {"largest_um": largest_um, "tolerance_um": tolerance_um}
    if largest_um is None:
        ok = None if tolerance_um is None else False
        words = "Not verified: no measured point of a cutting move counts."
    elif tolerance_um is None:
        ok = None
        words = (
            f"The measured path is at most {_um(largest_um)} um from the nominal one; no part tolerance is "
            "stated."
        )
    else:
        ok = largest_um <= tolerance_um
        words = (
            f"{'Within the' if ok else 'ABOVE the'} part tolerance of {tolerance_um:g} um: the measured path "
            f"is at most {_um(largest_um)} um from the nominal one."
        )
    return {"ok": ok, "measured": result, "sentences": [words]}


def with_measured(predicted: dict[str, Any], runs: dict[str, Any]) -> dict[str, Any]:
    """One verdict of a prediction and of what was measured: the measured runs decide, unless the prediction
    fails already."""
    ok = runs["ok"] if predicted["ok"] else False
    return predicted | runs | {"ok": ok, "sentences": [*predicted["sentences"], *runs["sentences"]]}


#: Findings that say what the verdict says already.
_OWN = {"OLP101", "OLP108"}


def _numerical(table: Judgements) -> dict[str, Any]:
    largest = table.largest_mm()
    values = np.where(table.judged, np.nan_to_num(table.corrected), -1.0)
    worst = int(values.argmax()) if len(values) and table.judged.any() else None
    return {
        "largest_um": largest * UM_PER_MM,
        "tolerance_um": table.tolerance_mm * UM_PER_MM,
        "rounding_um": (table.allowed_mm - table.tolerance_mm) * UM_PER_MM,
        "allowed_um": table.allowed_mm * UM_PER_MM,
        "line": None if worst is None else int(table.line[worst]),
        "holds": largest <= table.allowed_mm,
    }


def _part(table: Judgements, tolerance_um: float, uncertainty: dict[str, Any] | None) -> dict[str, Any]:
    largest_um = table.largest_mm() * UM_PER_MM
    probability = None if uncertainty is None else float(uncertainty["within"]["after"]["program"])
    return {
        "tolerance_um": tolerance_um,
        "largest_um": largest_um,
        "probability": probability,
        "probable": None if probability is None else probability >= ENOUGH,
        "holds": largest_um <= tolerance_um,
    }


def _um(value: float) -> str:
    return "<0.01" if 0.0 < value < 0.005 else f"{value:.2f}"


def _numerical_sentence(numerical: dict[str, Any]) -> str:
    word = "Within tolerance" if numerical["holds"] else "ABOVE TOLERANCE"
    return (
        f"{word}: the corrected path is at most {_um(numerical['largest_um'])} um from the nominal one; "
        f"{_um(numerical['allowed_um'])} um are allowed (numerical tolerance "
        f"{numerical['tolerance_um']:g} um, rounding {_um(numerical['rounding_um'])} um)."
    )


def _part_sentence(part: dict[str, Any]) -> str:
    tolerance = f"part tolerance of {part['tolerance_um']:g} um"
    if not part["holds"]:
        return f"ABOVE the {tolerance}: the corrected path alone is {_um(part['largest_um'])} um off."
    if part["probability"] is None:
        return f"Within the {tolerance} by the calibration, which states no uncertainty."
    chance = f"{100.0 * part['probability']:.1f} %"
    if part["probable"]:
        return f"Within the {tolerance} with a probability of {chance}."
    return f"In doubt for the {tolerance}: within it with a probability of {chance} only."
