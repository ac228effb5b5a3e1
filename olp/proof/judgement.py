"""The table of judgements: what every report, the gate and the page say of a proved program.

It is computed once, from a proof. A row is a nominal move: how it counts, how far the tip is off with the
nominal and with the corrected program, what is allowed, and the verdict. Lines, operations, tools and the
program are groups of rows. Nothing else decides whether a program is within tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, Numbers, distinct, is_in
from olp.core.toolpath import Toolpath
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding
from olp.findings.rule import Severity
from olp.program.text.columns import Columns, found, marked, spans
from olp.proof.measured import ABOVE, SHOWN, WITHIN, Measured
from olp.proof.proof import Counts, Proof

Single = npt.NDArray[np.float32]

#: A probability from here on is enough: two standard deviations on both sides.
ENOUGH = 0.95
#: Moves that are looked at for each line that is wanted, and so many times more where they are on few lines.
_FEW = 16
#: What the reasons of rows are called.
REASONS = {
    Counts.FEED: "feed", Counts.POINT: "point", Counts.HOLE: "hole", Counts.RAPID: "rapid",
    Counts.LEFT: "left uncorrected", Counts.UNCORRECTED: "uncorrected rapid",
    Counts.UNKNOWN: "unknown position",
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Judgements:
    """(n,) per nominal move: `line`, `tool` (-1: none), `operation` (from 0: of one tool and work offset) and
    `counts`. In mm: `uncorrected` and `corrected` are the deviations that count, or where the move only is
    shown its deviation at the end. NaN where a position is unknown. `allowed_mm` is numerical tolerance plus
    rounding. `measured` is the layer of runs on the machine, None where there are none. `side` has by layer
    how much of the deviation an unknown side of the backlash may be; without a layer it is nothing."""

    line: Numbers
    tool: Index
    operation: Index
    counts: npt.NDArray[np.uint8]
    uncorrected: Single
    corrected: Single
    tolerance_mm: float
    allowed_mm: float
    measured: Measured | None = None
    side: Mapping[str, Single] = field(default_factory=dict)

    @staticmethod
    def of(proof: Proof) -> Judgements:
        path = proof.nominal
        tool, operation = groups_of(path)
        parts = (("uncorrected", proof.before), ("corrected", proof.after))
        return Judgements(
            path.line, tool, operation, proof.counts, proof.before_mm, proof.after_mm,
            proof.tolerance_mm, proof.allowed_mm, None,
            {name: one.side for name, one in parts if _any_counts(one.side, proof.counts)},
        )  # fmt: skip

    def with_measured(self, runs: Measured) -> Judgements:
        """The same table with the layer of measured runs."""
        return replace(self, measured=runs)

    @property
    def judged(self) -> Mask:
        """(n,) moves that count."""
        return np.asarray(self.counts <= Counts.LEFT)

    @property
    def over(self) -> Mask:
        """(n,) moves that count and are above what is allowed."""

        def of(some: slice) -> Mask:
            judged = self.counts[some] <= Counts.LEFT
            return np.asarray(judged & (np.nan_to_num(self.corrected[some]) > self.allowed_mm))

        return marked(len(self.counts), of)

    def largest_mm(self, which: Mask | None = None) -> float:
        """The largest deviation of the corrected program that counts, of all moves or of some."""
        rows = self._judged_rows() if which is None else [np.flatnonzero(self.judged & which)]
        return max((float(np.nan_to_num(self.corrected[r]).max(initial=0.0)) for r in rows), default=0.0)

    def worst(self) -> int | None:
        """The first of the moves with the largest deviation that counts, None where none does."""
        worst, largest = None, -1.0
        for rows in self._judged_rows():
            size = np.nan_to_num(self.corrected[rows])
            top = int(size.argmax())
            if size[top] > largest:
                worst, largest = int(rows[top]), float(size[top])
        return worst

    def worst_lines(self, count: int) -> Numbers:
        """So many lines, or some more, with moves that count: those that are farthest off when corrected are
        among them. All where there are fewer."""
        judged, some = sum(map(len, self._judged_rows())), _FEW * count
        while some < judged:
            top = np.zeros(0, np.float32)
            for rows in self._judged_rows():
                top = np.append(top, -np.nan_to_num(self.corrected[rows]))
                top = np.partition(top, some)[: some + 1] if len(top) > some else top
            least = top.max()
            lines = distinct(np.concatenate([
                self.line[rows[-np.nan_to_num(self.corrected[rows]) <= least]] for rows in self._judged_rows()
            ]))  # fmt: skip
            if len(lines) >= count:
                return lines
            some *= _FEW
        return distinct(self.line[self.judged])

    def on_lines(self, lines: Numbers) -> Judgements:
        """The rows of these lines alone, without measured runs."""
        rows = found(len(self.line), lambda some: is_in(self.line[some], lines))
        return Judgements(
            self.line[rows], self.tool[rows], self.operation[rows], self.counts[rows],
            self.uncorrected[rows], self.corrected[rows], self.tolerance_mm, self.allowed_mm,
        )  # fmt: skip

    def by_line(self) -> dict[str, npt.NDArray[Any]]:
        """Of each line that moves: `line`, and of each layer the largest deviation of what counts on it, else
        of what is shown, and its state: 0 within, 1 above, 2 shown and not judged. `uncorrected_um` and
        `corrected_um` are judged by what is allowed, `measured_um` (NaN: not measured) by the part tolerance.
        `state` is that of the line: of the corrected program, and above where the measured one is. Of
        layers in `side`, `uncorrected_side_um` and `corrected_side_um` are the part of the deviation."""
        lines, row = np.unique(self.line, return_inverse=True)
        result: dict[str, npt.NDArray[Any]] = {"line": lines}
        counted = np.zeros(len(lines), bool)
        counted[row[self.judged]] = True
        rows = self.judged | ~counted[row]
        for name, values in (("uncorrected", self.uncorrected), ("corrected", self.corrected)):
            largest = np.full(len(lines), np.nan)
            np.fmax.at(largest, row[rows], values[rows].astype(float) * UM_PER_MM)
            result[f"{name}_um"] = largest
            if name in self.side:
                top = self.judged & (values.astype(float) * UM_PER_MM == largest[row])
                part = result[f"{name}_side_um"] = np.zeros(len(lines))
                np.fmax.at(part, row[top], self.side[name][top].astype(float) * UM_PER_MM)
            over = self.judged & (np.nan_to_num(values) > self.allowed_mm)
            state = np.where(counted, WITHIN, SHOWN).astype(np.uint8)
            state[row[over]] = ABOVE
            result[f"{name}_state"] = state
        result["state"] = result["corrected_state"].copy()
        return result | _measured_columns(self.measured, lines, result["state"])

    def groups(self, of: Index) -> list[dict[str, Any]]:
        """Largest deviations and verdict of the moves that count of each value of `of` (n,), in order of
        appearance."""
        values = distinct(np.concatenate([of[:0], *(distinct(of[rows]) for rows in self._judged_rows())]))
        count = len(values)
        begin, worst = np.full(count, len(of)), np.full(count, len(of))
        first, last = np.full(count, np.iinfo(np.int64).max), np.zeros(count, np.int64)
        largest, uncorrected, over = np.zeros(count, np.float32), np.zeros(count), np.zeros(count, bool)
        for rows in self._judged_rows():
            # a group is a few runs of rows
            runs = np.flatnonzero(np.diff(of[rows], prepend=-2))
            group, line = np.searchsorted(values, of[rows[runs]]), self.line[rows]
            size = np.nan_to_num(self.corrected[rows])
            np.minimum.at(begin, group, rows[runs])
            np.maximum.at(largest, group, np.maximum.reduceat(size, runs))
            np.minimum.at(first, group, np.minimum.reduceat(line, runs))
            np.maximum.at(last, group, np.maximum.reduceat(line, runs))
            np.fmax.at(uncorrected, group, np.fmax.reduceat(self.uncorrected[rows], runs))
        for rows in self._judged_rows():
            runs = np.flatnonzero(np.diff(of[rows], prepend=-2))
            group = np.searchsorted(values, of[rows[runs]]).repeat(np.diff(runs, append=len(rows)))
            size = np.nan_to_num(self.corrected[rows])
            # the first of each group with the largest deviation
            top = size == largest[group]
            np.minimum.at(worst, group[top], rows[top])
            over[group[size > self.allowed_mm]] = True
        order = np.argsort(begin)
        tool, line, corrected = (column[worst[order]] for column in (self.tool, self.line, self.corrected))
        columns = {
            "first_line": first[order].tolist(),
            "last_line": last[order].tolist(),
            "tool": [number if number >= 0 else None for number in tool.tolist()],
            "uncorrected_um": (uncorrected[order] * UM_PER_MM).tolist(),
            "corrected_um": [size * UM_PER_MM for size in np.nan_to_num(corrected).tolist()],
            "worst_line": line.tolist(),
            "holds": (~over[order]).tolist(),
        }
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def _judged_rows(self) -> Iterator[Index]:
        """The rows of moves that count, in blocks."""
        for some in spans(len(self.counts)):
            rows = np.flatnonzero(self.counts[some] <= Counts.LEFT)
            if rows.size:
                yield some.start + rows

    def report(self) -> dict[str, Any]:
        """The table by groups, as plain data."""
        moves, shown = np.zeros(len(Counts), np.int64), dict.fromkeys((Counts.RAPID, Counts.UNCORRECTED), 0.0)
        for some in spans(len(self.counts)):
            moves += np.bincount(self.counts[some], minlength=len(Counts))
            for kind, largest in shown.items():
                size = np.nan_to_num(self.corrected[some][self.counts[some] == kind])
                shown[kind] = float(size.max(initial=largest))
        return {
            "moves": {REASONS[kind]: int(moves[kind]) for kind in Counts},
            "shown_um": {
                REASONS[kind]: largest * UM_PER_MM for kind, largest in shown.items() if moves[kind]
            },
            "operations": self.groups(self.operation),
            "tools": self.groups(self.tool),
        } | ({} if self.measured is None else {"measured": self.measured.report()})


def groups_of(path: Toolpath) -> tuple[Index, Index]:
    """(n,) the tool of each move (-1: none), and its operation, from 0: of one tool and work offset."""
    numbers = np.array([-1 if f.tool is None else f.tool for f in path.frames] or [-1])
    offsets = [f.work_offset for f in path.frames] or [""]
    keys = list(zip(numbers.tolist(), offsets, strict=True))
    # frames of the same key have the number of the first of them
    first = {key: k for k, key in reversed(list(enumerate(keys)))}
    key_of = np.array([first[key] for key in keys] or [0])
    columns, before, count = Columns(), -1, -1
    for some in spans(len(path.frame)):
        number = key_of[path.frame[some]]
        operation = count + np.cumsum(np.diff(number, prepend=before) != 0)
        columns.put("tool", numbers[path.frame[some]], np.int64)
        columns.put("operation", operation, np.int64)
        before, count = int(number[-1]), int(operation[-1])
    return columns.take("tool", np.int64), columns.take("operation", np.int64)


def _any_counts(side: Single, counts: npt.NDArray[np.uint8]) -> bool:
    """Whether any of what an unknown side may be is of a move that counts."""
    return any(side[some][counts[some] <= Counts.LEFT].any() for some in spans(len(counts)))


def _measured_columns(
    runs: Measured | None, lines: Numbers, state: npt.NDArray[np.uint8]
) -> dict[str, npt.NDArray[Any]]:
    """`measured_um` and `measured_state` of all runs; `state` is set where a line is above when measured."""
    if runs is None:
        return {}
    table = runs.by_line()
    row = np.searchsorted(lines, table["line"])
    size: Array = np.full(len(lines), np.nan)
    size[row] = table["measured_um"]
    own = np.full(len(lines), SHOWN, np.uint8)
    own[row] = table["state"]
    state[own == ABOVE] = ABOVE
    return {"measured_um": size, "measured_state": own}


def verdict(
    table: Judgements, part_tolerance_um: float | None, uncertainty: dict[str, Any] | None,
    findings: Iterable[Finding], place: Callable[[int], str] = str,
) -> dict[str, Any]:  # fmt: skip
    """The verdict on a proved program, in values and in sentences. `numerical`: does the written program do
    what the model asks. `part`: is the part good as far as that is known, None without a part tolerance.
    `ok` is False where either fails, or another finding is an error. It is None where nothing could be
    judged, a feed move could not, or the part is good with a probability that is too low. `place` puts a line
    into words. `questions` are the questions that were asked, each with its answer `ok` and `sentence`."""
    numerical = _numerical(table)
    part = None
    if part_tolerance_um is not None:
        within = None if uncertainty is None else uncertainty["within"]
        probability = None if within is None else float(within["after"]["program"])
        part = part_of(table.largest_mm() * UM_PER_MM, part_tolerance_um, probability)
    errors = sorted({f.code for f in findings if f.severity >= Severity.ERROR} - _OWN)
    known = None if numerical["unknown"] else True
    sentence = _numerical_sentence(numerical, place)
    questions = [question("program", every((numerical["holds"], known)), sentence)]
    sentences = [sentence]
    if numerical["unknown"]:
        sentences.append(f"{numerical['unknown']} feed moves to unknown positions are not judged.")
    if part is not None:
        sentences.append(part_sentence(part))
        questions.append(question("part", part_answer(part), sentences[-1]))
    if errors:
        sentences.append(f"Not to be run as it is: {', '.join(errors)}.")
    ok = every((*(one["ok"] for one in questions), not errors))
    return {
        "ok": ok, "numerical": numerical, "part": part, "errors": errors, "sentences": sentences,
        "questions": questions,
    }  # fmt: skip


def measured(runs: Sequence[tuple[str, float | None]], tolerance_um: float | None) -> dict[str, Any]:
    """The verdict on measured runs, by name and largest deviation in um, None where no point of the run
    counts: such a run is not verified. `ok` is None where no part tolerance is stated."""
    known = [size for _, size in runs if size is not None]
    missing = [name for name, size in runs if size is None]
    largest_um = max(known, default=None)
    result = {"largest_um": largest_um, "tolerance_um": tolerance_um, "not_verified": missing}
    holds = largest_um is not None and tolerance_um is not None and largest_um <= tolerance_um
    sentences = []
    if largest_um is not None:
        off = f"he measured path is at most {_um(largest_um)} um from the nominal one"
        part = f"{'Within' if holds else 'ABOVE'} the part tolerance of {tolerance_um or 0.0:g} um"
        stated = tolerance_um is not None
        sentences.append(f"{part}: t{off}." if stated else f"T{off}; no part tolerance is stated.")
    if missing or not runs:
        names = f" of {', '.join(missing)}" if missing else ""
        sentences.append(f"Not verified: no measured point{names} counts.")
    ok = None if tolerance_um is None else holds and not missing
    questions = [question("measured", ok, " ".join(sentences))]
    return {"ok": ok, "measured": result, "sentences": sentences, "questions": questions}


def with_measured(predicted: dict[str, Any], runs: dict[str, Any]) -> dict[str, Any]:
    """One verdict of a prediction and of what was measured: it fails where either does, and is open where
    either is."""
    both = {key: [*predicted[key], *runs[key]] for key in ("sentences", "questions")}
    return predicted | runs | both | {"ok": every((predicted["ok"], runs["ok"]))}


#: The questions that a verdict answers.
QUESTIONS = {
    "program": "Does the written program do what the model asks?",
    "part": "Is the part good, as far as the calibration knows?",
    "measured": "Is the measured path good?",
}


def question(name: str, ok: bool | None, sentence: str) -> dict[str, Any]:
    """A question of a verdict with its answer."""
    return {"name": name, "question": QUESTIONS[name], "ok": ok, "sentence": sentence}


def every(answers: Iterable[bool | None]) -> bool | None:
    """False where one of the answers is, else None where one is open."""
    known = list(answers)
    return False if False in known else None if None in known else True


#: Findings that say what the verdict says already.
_OWN = {"OLP101", "OLP108"}


def _numerical(table: Judgements) -> dict[str, Any]:
    worst = table.worst()
    return {
        "largest_um": None if worst is None else table.largest_mm() * UM_PER_MM,
        "tolerance_um": table.tolerance_mm * UM_PER_MM,
        "rounding_um": (table.allowed_mm - table.tolerance_mm) * UM_PER_MM,
        "allowed_um": table.allowed_mm * UM_PER_MM,
        "line": None if worst is None else int(table.line[worst]),
        "left": bool(worst is not None and table.counts[worst] == Counts.LEFT),
        "unknown": int((table.counts == Counts.UNKNOWN).sum()),
        "holds": None if worst is None else not bool(table.over.any()),
    }


def part_of(largest_um: float, tolerance_um: float, probability: float | None) -> dict[str, Any]:
    """What is known of a part: the largest deviation that is predicted beside its tolerance, and the
    probability of being within that, None where the calibration states no uncertainty."""
    return {
        "tolerance_um": tolerance_um,
        "largest_um": largest_um,
        "probability": probability,
        "probable": None if probability is None else probability >= ENOUGH,
        "holds": largest_um <= tolerance_um,
    }


def part_answer(part: Mapping[str, Any]) -> bool | None:
    """Whether the part is good: open where that is not probable enough."""
    return every((part["holds"], part["probability"] is None or part["probable"] or None))


def _um(value: float) -> str:
    return "<0.01" if 0.0 < value < 0.005 else f"{value:.2f}"


def _numerical_sentence(numerical: dict[str, Any], place: Callable[[int], str]) -> str:
    if numerical["holds"] is None:
        return "Not judged: the program has no feed move, hole or point at a known position."
    word = "Within tolerance" if numerical["holds"] else "ABOVE TOLERANCE"
    largest, allowed = _um(numerical["largest_um"]), _um(numerical["allowed_um"])
    left = f", where line {place(numerical['line'])} is left uncorrected" if numerical["left"] else ""
    return (
        f"{word}: the corrected path is at most {largest} um from the nominal one{left}; {allowed} um are "
        f"allowed (numerical tolerance {numerical['tolerance_um']:g} um, rounding "
        f"{_um(numerical['rounding_um'])} um)."
    )


def part_sentence(part: Mapping[str, Any]) -> str:
    """The verdict on a part, in words."""
    tolerance = f"part tolerance of {part['tolerance_um']:g} um"
    if not part["holds"]:
        return f"ABOVE the {tolerance}: the corrected path alone is {_um(part['largest_um'])} um off."
    if part["probability"] is None:
        return f"Within the {tolerance} by the calibration, which states no uncertainty."
    chance = f"{100.0 * part['probability']:.1f} %"
    if part["probable"]:
        return f"Within the {tolerance} with a probability of {chance}."
    return f"In doubt for the {tolerance}: within it with a probability of {chance} only."
