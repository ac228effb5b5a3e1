"""The time that a control of a kind takes for a program, and what a log of its run tells of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from olp.core.errors import CannotCompute, UsageError
from olp.core.toolpath import Toolpath
from olp.core.units import AXES
from olp.files.points import Points
from olp.trajectory.controls.base import AxisSpeeds, Control, move_seconds
from olp.trajectory.controls.learning import Learned, learned
from olp.trajectory.controls.moves import Moves, moves
from olp.trajectory.controls.said import Said
from olp.trajectory.route import AxisLimits
from olp.trajectory.variants import Case

#: lines that a report lists
_LINES = 10
#: how far a log may be from its program: so many mm, and a share of the way of each axis, for corners
_SLACK_MM = 0.5
_SLACK = 0.02


def control_time(
    control: Control, case: Case, limits: AxisLimits, stated: Mapping[str, float], log: Points | None,
    *, bare: bool,
) -> dict[str, Any]:  # fmt: skip
    """The part of the report on a control: its time by stretch, its longest lines, and with a `log` what was
    learned of it. `bare`: neither call nor machine file state a path tolerance, so the control's own counts.

    Raises UsageError for settings that it does not have, and for a log that is none of a whole run;
    CannotCompute for a log of a program with several stretches.
    """
    values = control.values(stated)
    speeds = AxisSpeeds(limits.velocity, limits.acceleration, limits.jerk)
    said = None if control.said is None else control.said(case.program)
    parts = _parts(control, case, values, said, bare=bare)
    fitted = None
    if log is not None:
        fitted = _fitted(control, case, parts, speeds, values, log)
        speeds, values = fitted.limits, fitted.values
    times = [move_seconds(control, part, speeds, values) for part in parts]
    by_stretch = [float(time.sum()) + part.dwell_s for time, part in zip(times, parts, strict=True)]
    report: dict[str, Any] = {
        "name": control.key,
        "title": control.title,
        "source": control.source,
        "duration_s": sum(by_stretch),
        "stretches_s": by_stretch,
        "settings": [
            {
                "name": name,
                "value": values[name],
                "unit": one.unit,
                "text": one.text,
                "stated": name in stated,
            }
            for name, one in control.parameters.items()
        ],
        "longest_lines": _longest(parts, times),
        "beside": [] if said is None else [{"line": line, "word": word} for line, word in said.beside],
    }
    if fitted is not None and log is not None:
        report["log"] = {
            "file": log.file,
            "duration_s": fitted.seconds,
            "velocity_mm_s": fitted.limits.velocity.tolist(),
            "acceleration_mm_s2": fitted.limits.acceleration.tolist(),
            "jerk_mm_s3": [
                value if shown else None
                for value, shown in zip(fitted.limits.jerk.tolist(), fitted.shown.tolist(), strict=True)
            ],
            "axes": [name for name, moved in zip("XYZ", fitted.moved, strict=True) if moved],
        }
    return report


def _parts(
    control: Control, case: Case, values: Mapping[str, float], said: Said | None, *, bare: bool
) -> tuple[Moves, ...]:
    program = case.program
    with program.errors():
        return moves(
            program, blend_mm=control.bare_mm if bare and control.bare_mm is not None else case.blend_mm,
            block_delete=case.block_delete, times=case.setup.machine.times, override=case.override,
            chord_mm=values[control.chord_mm] if control.chord_mm else None, said=said,
        )  # fmt: skip


def _fitted(
    control: Control,
    case: Case,
    parts: tuple[Moves, ...],
    speeds: AxisSpeeds,
    values: Mapping[str, float],
    log: Points,
) -> Learned:
    if len(parts) != 1:
        raise CannotCompute(
            f"the program has {len(parts)} stretches, between which the control moves by itself, so a log of "
            "its run does not show its planner alone; log a program without tool changes, G28 and similar"
        )
    if log.time_s is None:
        raise CannotCompute("the log has no column of times; expected one in s", file=log.file)
    _refuse_other_run(case.program.toolpath, log)
    try:
        return learned(control, parts, speeds, values, log.time_s, log.points_mm)
    except UsageError as error:
        raise error.in_file(log.file) from None


def _refuse_other_run(path: Toolpath, log: Points) -> None:
    """Raise CannotCompute where the log goes over other distances than the program, or ends elsewhere. The
    zero of the log may be any."""
    points = np.vstack((path.start_mm, path.end_mm))
    for axis, name in enumerate(AXES):
        way = points[np.isfinite(points[:, axis]), axis]
        if not way.size:
            continue
        span, own = float(np.ptp(way)), float(np.ptp(log.points_mm[:, axis]))
        ends = [
            abs((log.points_mm[-1, axis] - of(log.points_mm[:, axis])) - (way[-1] - of(way)))
            for of in (min, max)
        ]
        slack = _SLACK_MM + _SLACK * span
        longer = np.isfinite(path.start_mm[axis]) and own > span + slack
        if own < span - slack or longer or min(ends) > slack:
            raise CannotCompute(
                f"the log goes over {own:g} mm of {name} and the program over {span:g}, or they end at other "
                "places; expected a whole run of this program, with positions in mm",
                file=log.file,
            )


def _longest(parts: tuple[Moves, ...], times: list[Any]) -> list[dict[str, Any]]:
    if not parts:
        return []
    lines, where = np.unique(np.concatenate([part.line for part in parts]), return_inverse=True)
    total = np.bincount(where, weights=np.concatenate(times))
    order = np.argsort(-total, kind="stable")[:_LINES]
    return [{"line": int(lines[i]), "seconds": float(total[i])} for i in order.tolist()]
