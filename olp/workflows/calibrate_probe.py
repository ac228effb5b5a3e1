"""`calibrate probe`: programs that touch an artefact with the machine's own probe, and what was touched."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.design.probing import Probing, aim, touches_of
from olp.calibration.observations.touched import Touched, fit_touches
from olp.core.errors import CannotCompute, UsageError
from olp.core.machine import Machine, Setup
from olp.core.units import AXES, UM_PER_MM
from olp.core.values import dataclass
from olp.files.measurements.artefact_file import load_artefact
from olp.files.measurements.touch_logs import read_touches
from olp.files.measurements.touched_files import touched_files, touched_rows
from olp.findings.catalogue import Finding
from olp.program.dialect import Dialect
from olp.program.touches import Touches
from olp.workflows.session import PathLike, Session
from olp.workflows.shown import Filed

#: Touches scatter by more than this many times what is stated: the artefact or the probe is not as stated.
_SCATTER = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class ProbedArtefact(Filed):
    """An artefact that the machine touches: programs, or what their logs showed. `touches` are those of each
    pose. `report` ("olp-probe-1") holds the figures. `files(folder)` are one program per pose, or
    measurements.toml with its CSV files."""

    setup: Setup
    probing: Probing
    touches: tuple[Touches, ...]
    touched: Touched | None
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    inputs: tuple[str, ...] = ()

    def files(self, folder: PathLike, date: datetime.date | None = None) -> dict[Path, bytes]:
        """Bytes by path. Raises CannotCompute for a control whose programs cannot be written."""
        if self.touched is None:
            named = _programs(self.setup, self.probing, self.touches)
        else:
            named = touched_files(self.setup.machine, self.probing, self.touched, date)
        return {Path(folder) / name: data for name, data in named}


def probe_artefact(
    artefact: PathLike, machine: PathLike | Setup, *, logs: Sequence[PathLike] = ()
) -> ProbedArtefact:
    """Programs that touch an artefact (olp-artefact-1), one for each pose; or, with `logs`, one for each pose
    in their order, what they touched.

    Raises InputError, UsageError, ConfigError and CannotCompute: also where the machine does not reach a
    touch, or a log is not that of its program.
    """
    session = Session.start(machine)
    setup = session.setup
    probing = load_artefact(artefact)
    travel = {axis: setup.machine.axes[axis].travel_mm for axis in AXES}
    runs = tuple(touches_of(probing, k, travel) for k in range(len(probing.poses)))
    rounded = [_rounded(run, setup.machine) for run in runs]
    report: dict[str, Any] = {
        "schema": "olp-probe-1",
        "artefact": probing.name,
        "machine": setup.machine.name,
        "poses": len(runs),
        "touches": sum(len(run.labels) for run in runs),
    }
    inputs = (*session.sources.files, str(artefact), *map(str, logs))
    if not logs:
        report["programs"] = [
            {"pose": k, "touches": len(run.labels), **_extent(run)} for k, run in enumerate(runs, start=1)
        ]
        return ProbedArtefact(setup, probing, runs, None, report, (), inputs)
    if len(logs) != len(runs):
        raise UsageError(f"{len(logs)} logs of touches; expected {len(runs)}, one for each pose in order")
    tool = np.array(probing.tool_mm)
    tips = [read_touches(log, run) + tool for log, run in zip(logs, rounded, strict=True)]
    aimed = [aim(probing, k) for k in range(len(runs))]
    touched = fit_touches(probing, aimed, tips)
    report |= _figures(probing, touched)
    findings = tuple(_findings(probing, touched, runs))
    return ProbedArtefact(setup, probing, runs, touched, report, findings, inputs)


def _figures(probing: Probing, touched: Touched) -> dict[str, Any]:
    residual = float(np.sqrt(np.mean(touched.residual_mm**2))) * UM_PER_MM
    return {
        "residual_um": residual,
        "sigma_touch_um": touched.sigma_mm * UM_PER_MM,
        "touches_beyond_unknowns": touched.free,
        "effective_radius": [
            {"axis": axis, "radius_mm": float(radius), "sigma_um": float(sigma) * UM_PER_MM}
            for axis, radius, sigma in zip("XY", touched.radius_mm, touched.sigma_radius_mm, strict=True)
        ],
        "touched": touched_rows(probing, touched),
    }


def _findings(probing: Probing, touched: Touched, runs: Sequence[Touches]) -> Iterator[Finding]:
    """Touches that do not agree with each other."""
    if touched.sigma_mm <= _SCATTER * probing.sigma_mm:
        return
    labels = [label for run in runs for label in run.labels]
    worst = int(np.abs(touched.residual_mm).argmax())
    yield Finding(
        "OLP861",
        f"touches of {probing.name} scatter by {touched.sigma_mm * UM_PER_MM:.3g} um, stated "
        f"{probing.sigma_mm * UM_PER_MM:g} um; most at {labels[worst]}: "
        f"{touched.residual_mm[worst] * UM_PER_MM:.3g} um",
    )


def _extent(run: Touches) -> dict[str, list[float]]:
    """The axis positions between which a program moves."""
    places, _ = run.moves()
    return {f"{a}_mm": [float(places[:, k].min()), float(places[:, k].max())] for k, a in enumerate(AXES)}


def _digits(machine: Machine) -> int:
    return max(0, math.ceil(-math.log10(min(machine.least_increment_mm)) - 1e-9))


def _rounded(run: Touches, machine: Machine) -> Touches:
    """The touches as their program states them."""
    digits = _digits(machine)
    return replace(run, start_mm=np.round(run.start_mm, digits), end_mm=np.round(run.end_mm, digits))


def _programs(setup: Setup, probing: Probing, runs: Sequence[Touches]) -> Iterator[tuple[str, bytes]]:
    control = Session(setup).control()
    if control.toucher is None:
        raise CannotCompute(
            f"no programs of touches are written for {control.title}; name a control that has them in the "
            "machine file: LinuxCNC, Grbl or DMIS"
        )
    for number, run in enumerate(runs, start=1):
        yield f"probe-{number}.{control.folder_endings[0]}", _program(setup, control, probing, run, number)


def _program(setup: Setup, control: Dialect, probing: Probing, run: Touches, number: int) -> bytes:
    extent = ", ".join(f"{key[0]} {low:g}..{high:g}" for key, (low, high) in _extent(run).items())
    notes = [
        f"{setup.machine.name}: {probing.name}, pose {number}, {len(run.labels)} touches",
        f"Axis positions {extent}. Above Z {run.clear_mm:g} nothing may be in the way.",
        f"Tip {2.0 * probing.radius_mm:g} mm at {probing.tool_mm[0]:g} {probing.tool_mm[1]:g} "
        f"{probing.tool_mm[2]:g} from the gauge point.",
    ]
    assert control.toucher is not None
    return control.toucher(control, run, _digits(setup.machine), notes, f"touches-{number}.csv")


__all__ = ["ProbedArtefact", "probe_artefact"]
