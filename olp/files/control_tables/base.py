"""What the formats of compensation tables share: their inputs, and their results."""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from olp.calibration.control_tables.controls import Control
from olp.calibration.control_tables.rows import Rows
from olp.core.arrays import Array
from olp.core.errors import ConfigError, UsageError
from olp.core.machine import SQUARENESS, ZERO, Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration, Curve, Reference
from olp.errormodel.sources.registry import SOURCES
from olp.files.problems import Problem, config_error
from olp.findings.catalogue import Finding
from olp.program.text.rows import Form

#: The sign convention of a table. "error": a value is actual minus commanded, and the control subtracts it.
#: "correction": the control adds the value.
Sense = Literal["error", "correction"]
Load = Callable[[Path], bytes]

#: In mm: rows nearer than this are refused, because a slope between them means nothing.
LEAST_STEP_MM = 1e-6

#: Fields of a calibration that tables hold or do not need. The others depend on more than the axes.
_IN_TABLES = frozenset(
    {
        "machine", "box_mm", "model", "datum_mm", "curves", "squareness", "backlash_mm", "cyclic",
        "temperature_degC", "measured", "valid_until", "active_during_measurement", "repeatability_mm",
        "payload_kg", "quality", "more",
    }
)  # fmt: skip

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True, slots=True)
class Given:
    """What a caller states beside a file.

    `machine` is the name of the machine, `travel_mm` its travels (3, 2) or None. `sense` is the sign
    convention, None where the caller does not state it. `axis` is the axis of a file that does not name it.
    `kind` is LinuxCNC's COMP_FILE_TYPE. `names` are the control's names of axes. `reference` is the point of
    errors of axes that carry the workpiece. `most` limits the rows of a table.
    """

    machine: str = "machine"
    chain: str = "FXYZ"
    travel_mm: Array | None = None
    measured: datetime.date | None = None
    sense: Sense | None = None
    axis: str | None = None
    kind: int | None = None
    names: Mapping[str, str] = field(default_factory=dict)
    reference: Reference | None = None
    most: int | None = None


@dataclass(frozen=True, slots=True)
class Imported:
    """The calibration in a table, and what you should know about it."""

    calibration: Calibration
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Exported:
    """The bytes of a table by file, the table itself first. `corrects` are the ISO names of the errors that
    the control corrects when the table is active."""

    files: Mapping[Path, bytes]
    corrects: frozenset[str]
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Format:
    """One format. `sense` is its sign convention, None where the caller has to state it. `status` is the
    source of the layout, `holds` what it can hold."""

    key: str
    title: str
    ending: str
    sense: Sense | None
    status: str
    holds: str
    read: Callable[[Path, Given, Load], Imported]
    write: Callable[[Calibration, Path, Given], Exported]
    control: Callable[[Calibration, str], Control]


def sense_of(given: Given, own: Sense | None, key: str) -> Sense:
    """The sign convention of a table: the caller's, else the format's. Raises UsageError where both are
    unknown."""
    sense = given.sense or own
    if sense is None:
        raise UsageError(
            f"no public source states the sign convention of {key} tables; state it with --sense error "
            "(values are actual minus commanded, and the control subtracts them) or --sense correction (the "
            "control adds them). Run the verification program before any part"
        )
    return sense


def sign(sense: Sense) -> float:
    """The factor between values of the table and errors, in both directions."""
    return 1.0 if sense == "error" else -1.0


def signed(values: Array, factor: float) -> Array:
    """Values times +1 or -1, without a negative zero."""
    return np.asarray(values * factor + 0.0, float)


def text_of(data: bytes) -> str:
    """The text of a table. Bytes beyond ASCII are in comments only, and each becomes one character."""
    return data.decode("latin-1").removeprefix("\xef\xbb\xbf")


def lines(data: bytes, remark: str | None = None) -> Iterator[tuple[int, str]]:
    """Every line of a table with its number, without blanks around it and without comments after `remark`."""
    form = Form(None, remark=remark)
    return ((line, text.strip()) for line, text in form.lines(text_of(data)))


def number(cell: str) -> float | None:
    """The finite number in a cell, None for anything else."""
    return float(cell) if _NUMBER.fullmatch(cell) and np.isfinite(float(cell)) else None


def shown(value: float) -> str:
    """The shortest decimal that reads back as the same double."""
    return repr(value + 0.0)


def refuse(problems: Iterable[Problem], file: Path) -> None:
    """Raise ConfigError where there are problems."""
    listed = list(problems)
    if listed:
        raise config_error(listed, str(file))


def order_problems(rows: Sequence[tuple[int, float]], what: str) -> Iterator[Problem]:
    """The problems of rows (line, position) that do not ascend by a nanometre or more, or are fewer than
    two."""
    for (_, before), (line, position) in pairwise(rows):
        if not position - before >= LEAST_STEP_MM:
            yield line, f"{what} {position:g} comes after {before:g}; expected ascending positions, each once"
    if len(rows) < 2:
        yield (rows[0][0] if rows else None), f"{len(rows)} rows; expected at least 2"


def linear_curve(
    name: str,
    position_mm: Array,
    forward: Array,
    backward: Array | None,
    reference: Reference = "functional-point",
) -> Curve:
    """A curve of one component as controls use it: straight lines between the rows."""
    one = {} if backward is not None else {name: forward}
    both = ({name: forward}, {name: backward}) if backward is not None else ({}, {})
    return Curve(name[2], position_mm, one, both[0], both[1], ZERO, ZERO, reference, "linear")


def calibration_of(
    given: Given,
    curves: Sequence[Curve],
    file: Path,
    squareness: Mapping[str, float] | None = None,
    backlash_mm: Vector = ZERO,
) -> Calibration:
    """A calibration from tables. Its box is the range that all tables cover, within the travel.

    Raises ConfigError where neither a table nor the machine states the range of an axis.
    """
    box = np.empty((3, 2))
    unknown = []
    for j, axis in enumerate(AXES):
        own = [curve for curve in curves if curve.axis == axis]
        low = [float(curve.position_mm[0]) for curve in own]
        high = [float(curve.position_mm[-1]) for curve in own]
        if given.travel_mm is not None:
            low.append(float(given.travel_mm[j, 0]))
            high.append(float(given.travel_mm[j, 1]))
        if not low:
            unknown.append(axis)
            continue
        box[j] = max(low), min(high)
        if box[j, 0] >= box[j, 1]:
            raise ConfigError(
                f"the tables of axis {axis} have no positions in common with each other or with its travel; "
                "check that the machine file (-m) is of this machine",
                file=str(file),
            )
    if unknown:
        raise ConfigError(
            f"no table states the range of {', '.join(unknown)}; name the machine file with -m",
            file=str(file),
        )
    square = {name: (squareness or {}).get(name, 0.0) for name in SQUARENESS}
    return Calibration(
        machine=given.machine, box_mm=box, curves=tuple(_grouped(curves)), squareness=square,
        backlash_mm=backlash_mm, measured=given.measured,
    )  # fmt: skip


def _grouped(curves: Sequence[Curve]) -> Iterator[Curve]:
    """One curve for the components of an axis at the same positions. Those with both directions are
    separate."""
    groups: dict[tuple[object, ...], list[Curve]] = {}
    for curve in curves:
        key = (curve.axis, bool(curve.forward), curve.reference, curve.position_mm.tobytes())
        groups.setdefault(key, []).append(curve)
    for group in groups.values():
        sides = [
            {name: values for curve in group for name, values in getattr(curve, part).items()}
            for part in ("columns", "forward", "backward")
        ]
        yield replace(group[0], columns=sides[0], forward=sides[1], backward=sides[2])


def not_held(
    calibration: Calibration, held: Iterable[str], written: Iterable[Rows] = ()
) -> Iterator[Finding]:
    """A finding where a calibration has errors that are not among `held`, cyclic errors that the rows do not
    follow, or anything that no table holds."""
    square = {name for name, value in calibration.squareness.items() if value}
    names = {name for curve in calibration.curves for name in curve.names if _any(curve, name)} | square
    omitted = sorted(names - set(held))
    parts = [f"the format cannot hold {', '.join(omitted)}"] if omitted else []
    followed = {rows.name for rows in written if rows.cyclic and rows.name[1] in AXES}
    cyclic = sorted({c.component for c in calibration.cyclic if c.amplitude} - followed)
    if cyclic:
        parts.append(f"the rows do not follow cyclic errors of {', '.join(cyclic)}")
    keys = {source.field: source.key for source in SOURCES if source.field}
    others = [
        keys.get(f.name, f.name)
        for f in fields(calibration)
        if f.name not in _IN_TABLES and _states(calibration, f.name)
    ]
    others += [key for key, _ in calibration.more]
    if others:
        parts.append(f"no table holds {', '.join(others)} of the calibration")
    if parts:
        yield Finding("OLP871", "; ".join(parts) + ": they stay uncorrected", count=len(omitted) or 1)


def _states(calibration: Calibration, name: str) -> bool:
    value = getattr(calibration, name)
    return value is not None and value != ()


def _any(curve: Curve, name: str) -> bool:
    half = curve.half_difference(name)
    return bool(np.any(curve.mean(name))) or (half is not None and bool(np.any(half)))


def coarse(rows: Iterable[Rows], good_mm: float, good_rad: float) -> Iterator[Finding]:
    """A finding where straight lines between rows miss a curve."""
    missed = [r for r in rows if r.miss > 1.001 * (good_rad if r.name[1] in "ABC" else good_mm)]
    if missed:
        worst = "; ".join(
            f"{r.name} by {r.miss * 1e6:.2f} urad"
            if r.name[1] in "ABC"
            else f"{r.name} by {r.miss * 1e3:.2f} um"
            for r in missed
        )
        sentence = f"straight lines between the rows miss the curves: {worst}"
        yield Finding("OLP873", sentence, count=len(missed))


def backlash_in_table(calibration: Calibration, axes: Iterable[str]) -> Iterator[Finding]:
    """A finding where a table compensates a constant backlash."""
    compensated = [axis for axis in axes if calibration.backlash_mm[AXES.index(axis)]]
    if compensated:
        keys = ", ".join(f"{axis}_um" for axis in compensated)
        yield Finding(
            "OLP875",
            f"the table compensates the backlash of {', '.join(compensated)}: leave {keys} out of [backlash] "
            "in the calibration that corrects programs while it is active",
            count=len(compensated),
        )


def backlash_left_out(calibration: Calibration) -> Iterator[Finding]:
    """A finding where a format without directions leaves backlash uncorrected."""
    axes = {a for a in AXES if calibration.backlash_mm[AXES.index(a)]}
    axes |= {curve.axis for curve in calibration.curves if curve.forward}
    if axes:
        yield Finding(
            "OLP871",
            f"the format has no directions: the table holds the mean of both, and the backlash of "
            f"{', '.join(sorted(axes))} stays uncorrected",
            count=len(axes),
        )
