"""The report of corrected results ("olp-results-1")."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any, overload

import numpy as np

from olp.core.arrays import Array
from olp.core.spool import Spool
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.findings.catalogue import Finding
from olp.results.forward import Forward
from olp.results.reported import BAND, Reported
from olp.workflows.doubt import accepted_of
from olp.workflows.session import Loaded

#: Why corrected results are right.
WHY = (
    "a measuring machine reports where its scales say that the tip is; the tip was there plus the error of "
    "the machine at that axis position and with that stylus",
    "so the error (actual - commanded) was added to every point; nothing was inverted, and no nominal value, "
    "tolerance or name was changed",
)
#: What corrected results do not prove.
DOES_NOT_PROVE = (
    "that the calibration still describes the machine: measure an artefact of known size, correct its "
    "results, and compare",
    "anything about the probing system (lobing, wear, wrong tip radius), which is not an error of the axes",
)


def report_of(
    reported: Reported,
    result: Forward,
    loaded: Loaded,
    name: str,
    text: Spool,
    rounding_mm: float,
    findings: Sequence[Finding],
) -> dict[str, Any]:
    """The report ("olp-results-1")."""
    size_um = _size_um(result.added_mm)
    return {
        "schema": "olp-results-1",
        "results": {
            "name": name,
            "sha256": hashlib.sha256(reported.data).hexdigest(),
            "dialect": reported.dialect,
            "points": len(reported),
            "frames": [frame for frame in reported.frames if frame is not None],
        },
        **loaded.heads(),
        "correction": {
            "max_um": float(size_um.max(initial=0.0)),
            "rms_um": float(np.sqrt(np.mean(size_um * size_um))),
            "max_by_axis_um": [float(np.abs(column).max()) * UM_PER_MM for column in result.added_mm.T],
            "rounding_um": rounding_mm * UM_PER_MM,
        },
        "sources": _sources(result, loaded.model),
        "carried": [
            {"line": item.line, "name": item.name, "reason": item.reason} for item in reported.unchanged
        ],
        "points": Points(reported, result),
        "corrected": {"sha256": text.sha256()},
        "accepted": accepted_of(findings),
        "findings": [f.as_dict() for f in findings],
        "why": list(WHY),
        "does_not_prove": list(DOES_NOT_PROVE),
    }  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Points(Sequence[dict[str, Any]]):
    """The points of a report, each as plain data only when it is asked for."""

    reported: Reported
    result: Forward

    def __len__(self) -> int:
        return len(self.reported)

    @overload
    def __getitem__(self, index: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, index: slice) -> list[dict[str, Any]]: ...
    def __getitem__(self, index: int | slice) -> dict[str, Any] | list[dict[str, Any]]:
        if not isinstance(index, slice):
            k = range(len(self))[index]
            return self[k : k + 1][0]
        result = self.result
        return [
            {"line": line, "name": label, "axis_mm": axis, "added_um": row, "size_um": away}
            for line, label, axis, row, away in zip(
                self.reported.line[index].tolist(), self.reported.names[index],
                result.axis_mm[index].tolist(), (result.added_mm[index] * UM_PER_MM).tolist(),
                _size_um(result.added_mm[index]).tolist(), strict=True,
            )
        ]  # fmt: skip

    def tolist(self) -> list[dict[str, Any]]:
        """All of them."""
        return self[:]

    def largest(self, count: int) -> list[dict[str, Any]]:
        """Those to which most was added, the largest first."""
        order = np.argsort(-_size_um(self.result.added_mm), kind="stable")[:count]
        return [self[k] for k in order.tolist()]


def _size_um(rows_mm: Array) -> Array:
    """(n,) the size of vectors (n, 3)."""
    square = np.zeros(len(rows_mm))
    for j in range(3):
        column = rows_mm[:, j] * UM_PER_MM
        column *= column
        square += column
    return np.asarray(np.sqrt(square, out=square), float)


def _sources(result: Forward, model: ErrorModel) -> list[dict[str, Any]]:
    """The name of each source of error, and the largest and the rms of its part, the largest first."""
    largest_um: dict[str, float] = {}

    def squares(a: int, b: int) -> dict[str, float]:
        """Sums over the points a..b of the squares of parts, in um; in pairs, as numpy sums a column."""
        if b - a > BAND:
            half = a + (b - a) // 16 * 8
            first, second = squares(a, half), squares(half, b)
            return {name: first.get(name, 0.0) + second.get(name, 0.0) for name in first | second}
        sums = {}
        tool = result.tool_vector_mm
        play = None if result.play is None else result.play[a:b]
        for name, part in model.contributions(
            result.axis_mm[a:b], tool if tool.ndim == 1 else tool[a:b], play
        ):
            size_um = _size_um(part)
            largest_um[name] = max(largest_um.get(name, 0.0), float(size_um.max(initial=0.0)))
            sums[name] = float((size_um * size_um).sum())
        return sums

    count = len(result.axis_mm)
    rows = [
        {"name": name, "max_um": largest_um[name], "rms_um": float(np.sqrt(total / count))}
        for name, total in squares(0, count).items()
    ]
    return sorted(rows, key=lambda row: -row["max_um"])
