"""A calibration refined by a measured run: from files to the new calibration, its covariance and findings."""

from __future__ import annotations

import dataclasses
import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.design.known import Known, judged_rows, lengths_of
from olp.calibration.diagnosis.refinement import Refinement, refine
from olp.calibration.estimator.covariance import sigmas_at
from olp.calibration.observations.points import Points
from olp.comparison.nominal import nominal_of
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.machine import Machine, Setup, Vector
from olp.core.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.reversal import plays
from olp.errormodel.uncertainty import YEAR, Uncertainty, fingerprint
from olp.files.calibration.covariance import load_known
from olp.files.calibration.writer import calibration_files
from olp.files.measurements.checkpoints import load_checkpoints
from olp.files.measurements.reader import files_of_measurements
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.workflows import compare, refusals
from olp.workflows.calibrate_plan import judged_of, reflectors_of
from olp.workflows.flatten import UnrollOptions
from olp.workflows.session import PathLike, Session
from olp.workflows.shown import Filed

#: A run with a reduced chi-square above this does not agree with the covariance.
MISFIT = 1.5
#: A run agrees too well where chance gives so small a chi-square with less than this probability.
UNLIKELY = 1e-6
#: Most points of a path; more are thinned evenly, as they add no information.
MOST_POINTS = 3000
#: Most rows of points that a finding names.
_LISTED = 10
#: Years ahead that a report looks at most.
MOST_YEARS = 100.0
#: Steps of a path below this, in mm, have no tangent.
_MOVES = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class RefinedCalibration(Filed):
    """A calibration updated within its covariance by a measured run, and its new covariance.

    `refinement` holds figures in mm and rad, `report` the same as a mapping ("olp-refinement-1").
    `inputs` are the files that were read, which `write` never overwrites.
    """

    calibration: Calibration
    uncertainty: Uncertainty
    refinement: Refinement
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    inputs: tuple[str, ...] = ()

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The bytes of the new calibration file `target`, its curves and its covariance beside it."""
        notes = [f"{finding.code}: {finding.message}" for finding in self.findings]
        return calibration_files(
            self.calibration,
            Path(target),
            sigma=sigmas_at(self.calibration, self.uncertainty),
            covariance=self.uncertainty,
            notes=notes,
        )


def refine_calibration(
    calibration: PathLike,
    measured: PathLike | Points,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    program: PathLike | None = None,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    frame_known: bool = False,
    sigma_um: float | None = None,
    tool_mm: Vector | None = None,
    date: datetime.date | None = None,
    growth_per_year: float | None = None,
    uncertainty_um: float = 5.0,
) -> RefinedCalibration:
    """Update a calibration by a measured run, within its covariance.

    `measured` are points: commanded axis positions and measured positions of the reflector (a file as for
    `diagnose_calibration`, or Points). With `program`, the nominal program, they are tip positions along a
    run of its correction, paired as in `compare`; only deviations across the path are used. `sigma_um` is the
    standard uncertainty of a coordinate, `date` the day of the run. `flatten`, `expand_cycles` and
    `peck_clearance_mm` are those of `correct`, for the program.

    What is known fades until `date`: standard uncertainties grow by `growth_per_year` (default: that of the
    calibration). The report states when those of the new calibration will exceed `uncertainty_um`. Raises
    InputError, ConfigError where the calibration states no uncertainty, and CannotCompute.
    """
    session = Session.start(machine, job)
    described = dataclasses.replace(session.setup.machine, calibration=str(calibration))
    old, known = load_known(calibration, described, session.sources.read)
    growth = known.growth_per_year if growth_per_year is None else growth_per_year
    if growth_per_year and (date is None or old.measured is None):
        raise ConfigError("growth_per_year needs the day of the run; give it (--date)", file=str(calibration))
    if date is not None and old.measured is not None and date < old.measured:
        raise ConfigError(
            f"was measured on {old.measured}, after the day of the run, {date}; expected a run of that day "
            "or later. To use older readings too, fit all of them together (olp calibrate fit)",
            file=str(calibration),
        )
    days = None if date is None or old.measured is None else (date - old.measured).days
    known = dataclasses.replace(known, growth_per_year=growth).aged(days)
    skip = frozenset(described.compensated_by_controller - old.active_during_measurement)
    along: Array | None = None
    play: Array | None = None
    if program is not None:
        if sigma_um is None or isinstance(measured, Points):
            raise ConfigError("points along a program state no uncertainty; give sigma_um (--sigma-um)")
        run = session.of(dataclasses.replace(session.setup, machine=described))
        nominal = session.sources.source(program)
        unrolling = UnrollOptions(
            flatten=flatten, expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm
        )
        points, along, play = _along(old, skip, run, nominal, measured, sigma_um * MM_PER_UM, unrolling)
    elif isinstance(measured, Points):
        points = measured
    else:
        points, in_machine = load_checkpoints(measured, sigma_um=sigma_um, tool_mm=tool_mm)
        frame_known = frame_known or in_machine
    done = refine(
        old, described.chain, known, points, frame_known=frame_known, skip=skip, play=play, along=along
    )
    new = done.calibration if date is None else dataclasses.replace(done.calibration, measured=date)
    uncertainty = done.uncertainty
    if date is not None:
        uncertainty = dataclasses.replace(uncertainty, fingerprint=fingerprint(new))
    read = () if isinstance(measured, Points) else files_of_measurements([measured])
    inputs = (*session.sources.files, *read)
    report = _report(new, done, len(points.axis_mm)) | {
        "growth_by_age": known.growth(days),
        **_ageing(new, uncertainty, described, skip, uncertainty_um * MM_PER_UM),
    }
    return RefinedCalibration(new, uncertainty, done, report, tuple(_findings(done)), inputs)


def _ageing(
    calibration: Calibration, uncertainty: Uncertainty, machine: Machine, skip: frozenset[str], wanted: float
) -> dict[str, Any]:
    """What the new calibration knows of the error in its box (rms length in the best-fit frame), and the day
    from which that will be more than wanted."""
    tools = judged_of(machine, reflectors_of(machine)[:1])
    known = Known.of_calibration(calibration, machine.chain, uncertainty, skip)
    length = lengths_of(judged_rows(known, calibration.box_mm, tools), np.eye(known.size))
    rms = float(np.sqrt(np.mean(length**2)))
    again = None
    if calibration.measured is not None and (rms >= wanted or uncertainty.growth_per_year > 0.0):
        years = max(wanted / rms - 1.0, 0.0) / uncertainty.growth_per_year if rms < wanted else 0.0
        again = calibration.measured + datetime.timedelta(days=min(years, MOST_YEARS) * YEAR)
    return {
        "uncertainty_um": rms * UM_PER_MM,
        "wanted_um": wanted * UM_PER_MM,
        "measure_again": None if again is None else again.isoformat(),
    }


def _along(
    calibration: Calibration,
    skip: frozenset[str],
    session: Session,
    program: Source,
    measured: PathLike,
    sigma: float,
    unrolling: UnrollOptions,
) -> tuple[Points, Array, Array | None]:
    """Points of a corrected run with their commands, tangents of the path and play of axes."""
    chain = session.setup.machine.chain
    model = build(calibration, chain, outside="hold", skip_components=skip)
    setup, dialect = session.reading(program)
    with program.errors():
        program, parsed = refusals.read(session.sources, program, setup, dialect, None, unrolling)
    comparison = compare.run(session.sources, session, program, [measured], compare.CompareOptions())
    path, run = comparison.path, comparison.runs[0]
    assert path is not None
    toolpath = parsed.toolpath
    axes = nominal_of(toolpath, model, "axes")
    if len(axes.path) != len(path):
        raise CannotCompute("the path has moves whose axis positions are not known; give start_mm in the job")
    use = np.flatnonzero(run.counted)
    if len(use) < 4:
        raise CannotCompute(f"{len(use)} points lie on cutting moves of the program; expected at least 4")
    use = use[:: max(1, -(-len(use) // MOST_POINTS))]
    segment = run.pairing.segment[use]
    share = (run.pairing.s_mm[use] - path.s_mm[segment]) / np.diff(path.s_mm)[segment]
    begin, end = axes.path.vertex_mm[segment], axes.path.vertex_mm[segment + 1]
    target = begin + share[:, None] * (end - begin)
    tool = toolpath.tool_mm()
    tool = np.broadcast_to(tool if tool.ndim == 1 else tool[axes.move[segment]], target.shape)
    states = plays(model, axes.path.vertex_mm)
    play = None if states is None else states[segment + 1]
    command = target - model.error(target, tool, play)
    measured_mm = command + tool + model.error(command, tool, play)
    measured_mm = measured_mm + run.points_mm[use] - run.pairing.foot_mm[use]
    step = end - begin
    length = np.linalg.norm(step, axis=1)
    tangent = np.where(length[:, None] > _MOVES, step / np.maximum(length, _MOVES)[:, None], 0.0)
    points = Points(command, tool, measured_mm, sigma, source=str(measured), row=use + 1)
    return points, tangent, play


def _report(calibration: Calibration, done: Refinement, points: int) -> dict[str, Any]:
    rows = []
    for (kind, name), (size, deviations) in done.changes.items():
        angle = kind == "squareness" or (len(name) == 3 and name[1] in "ABC")
        rows.append(
            {
                "name": name if kind == "mean" else f"{kind} {name}",
                "changed_um": None if angle else size * UM_PER_MM,
                "changed_urad": size / RAD_PER_URAD if angle else None,
                "old_standard_deviations": deviations,
            }
        )
    return {
        "schema": "olp-refinement-1",
        "machine": calibration.machine,
        "points": points,
        "left_out": len(done.outliers),
        "rms_before_um": done.before_mm * UM_PER_MM,
        "rms_expected_um": done.expected_mm * UM_PER_MM,
        "rms_after_um": done.after_mm * UM_PER_MM,
        "rms_of_noise_um": done.noise_mm * UM_PER_MM,
        "chi_square_per_freedom": done.chi_square / done.freedom,
        "changes": rows,
    }


def _findings(done: Refinement) -> Iterator[Finding]:
    from scipy.stats import chi2

    ratio = done.chi_square / done.freedom
    if chi2.cdf(done.chi_square, done.freedom) < UNLIKELY:
        yield Finding("OLP840", f"reduced chi-square is {ratio:.2g} with {done.freedom:.0f} readings")
    if ratio > MISFIT:
        yield Finding(
            "OLP839",
            f"reduced chi-square is {ratio:.1f}: {done.before_mm * UM_PER_MM:.1f} um rms measured, "
            f"{done.expected_mm * UM_PER_MM:.1f} um expected",
        )
    if done.outliers:
        rows = ", ".join(f"row {row} ({off:.0f})" for row, off in done.outliers[:_LISTED])
        yield Finding("OLP835", f"standard deviations off, left out: {rows}", count=len(done.outliers))


__all__ = ["RefinedCalibration", "refine_calibration"]
