"""How well the poses of a program are known, from the covariance of the calibration, for reports and
pages."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from olp.calibration.joints.unknowns import Model
from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.uncertainty import YEAR
from olp.files.kinematics.covariance import load_joint_covariance
from olp.files.toml_text import read_toml
from olp.proof.joint_places import Places
from olp.proof.joint_sides import Sides
from olp.proof.joints import Deviation, JointProof
from olp.proof.judgement import ENOUGH
from olp.workflows.joints.loaded import JointRun

if TYPE_CHECKING:
    from olp.uncertainty.poses import PoseSpread

#: Waypoints of a program at which poses are looked at, at most; they are spread evenly.
_MOST = 5000
#: Lines in the report.
_LINES = 10
NOT_INCLUDED = (
    "one shift and one turn of all poses, which the work offset takes up: how well that is set is not in it",
    "curves, cyclic errors and play beyond what readings of the calibration showed of them at other postures",
    "what the control does between blocks, forces, and the process",
)


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What a calibration states of its uncertainty on the day of the run: the model with the covariance, its
    file, and by how much standard uncertainties have grown. `misfit_mm` is the standard deviation of each
    coordinate by what its numbers do not explain."""

    model: Model
    source: str
    growth: float
    misfit_mm: float

    def spread(self, run: JointRun, path: JointPath, axes: Array, tool: Index) -> PoseSpread:
        """That of poses at axis values (n, axes) with tools (n,) of the motion."""
        from olp.uncertainty.poses import pose_spread

        tools = np.array([machine.tool_mm for machine in path.motion.machines])
        return pose_spread(self.model, axes, tools[tool], run.errors.payload, self.misfit_mm)

    def bands_um_urad(self, run: JointRun, path: JointPath, moves: Index) -> tuple[Index, Array, Array]:
        """(n,) lines of moves, at most so many as are looked at, and the bands of tip and tool at their
        ends."""
        from olp.uncertainty.spread import bands

        looked, tool, axes = ends_of(path, moves)
        spread = self.spread(run, path, axes, tool)
        line = path.program.original_lines(path.line[looked])
        return line, bands(spread.tip) * UM_PER_MM, spread.turn_band_rad / RAD_PER_URAD


def known_of(run: JointRun, date: datetime.date | None) -> Known | None:
    """None where the calibration states no covariance. Raises InputError and ConfigError."""
    file, calibration, structure = run.machine.calibration, run.calibration, run.machine.structure
    if file is None or calibration is None:
        return None
    values: dict[str, Any] = read_toml(run.sources.read(file), str(file))[0]
    known = load_joint_covariance(file, values, structure, run.sources.read)
    if known is None:
        return None
    days = 0 if date is None else max((date - calibration.measured).days, 0)
    growth = 1.0 + calibration.growth_per_year * days / YEAR
    model = Model(
        structure, known.unknowns, calibration.errors.masses, calibration.datum_mm, base=calibration.errors,
        known=known.covariance * growth**2,
    )  # fmt: skip
    return Known(model, values["covariance"]["file"], growth, calibration.misfit_mm)


def uncertainty_of(
    run: JointRun, paths: tuple[JointPath, JointPath], proof: JointProof, date: datetime.date | None,
    part_tolerance_um: float | None = None,
) -> dict[str, Any] | None:  # fmt: skip
    """The part of a report on the uncertainty of poses at the waypoints that are judged; None where none is
    stated. `paths` are the nominal and the corrected one. With a part tolerance it has probabilities of being
    within that. Raises as `known_of`."""
    path = paths[0]
    known = known_of(run, date)
    rows = np.flatnonzero(proof.judged & np.isfinite(path.end).all(axis=1))
    if known is None or not len(rows):
        return None
    from olp.uncertainty.spread import COVERAGE, bands

    looked, tool, axes = ends_of(path, rows)
    spread = known.spread(run, path, axes, tool)
    tip, turn = bands(spread.tip) * UM_PER_MM, spread.turn_band_rad / RAD_PER_URAD
    scatter_um2 = float(np.trace(spread.tip, axis1=1, axis2=2).mean()) * UM_PER_MM**2
    line, worst = path.program.original_lines(path.line[looked]), np.argsort(-tip, kind="stable")
    listed = list(dict.fromkeys(line[worst].tolist()))[:_LINES]
    rows_of = (looked, proof.groups[looked])
    return {
        "coverage_factor": COVERAGE,
        "source": known.source,
        "growth_by_age": known.growth,
        "misfit_um": known.misfit_mm * UM_PER_MM,
        "waypoints": len(looked),
        "band_um": figures(tip, "um"),
        "band_urad": figures(turn, "urad"),
        "expected": {
            f"{name}_rms_um": float(np.hypot(_rms_um(side, proof), np.sqrt(scatter_um2)))
            for name, side in (("before", proof.before), ("after", proof.after))
        },
        "within": None if part_tolerance_um is None else _within(
            spread, [_off_mm(path, one, looked, rows) for one, rows in zip(paths, rows_of, strict=True)],
            part_tolerance_um, line,
        ),
        "lines": [
            {"line": n, "band_um": float(tip[line == n].max()), "band_urad": float(turn[line == n].max())}
            for n in listed
        ],
        "not_included": list(NOT_INCLUDED),
    }  # fmt: skip


def _within(
    spread: PoseSpread, off_mm: Sequence[Array], part_tolerance_um: float, line: Index
) -> dict[str, Any]:
    """Probabilities of being within a part tolerance before and after the correction, and the lines with
    waypoints that are not within it with enough of it."""
    from olp.uncertainty.poses import chances_of
    from olp.uncertainty.spread import SEED

    before, after = (chances_of(spread, off, part_tolerance_um * MM_PER_UM) for off in off_mm)
    return {
        "tolerance_um": part_tolerance_um,
        "before": before.report(),
        "after": after.report(),
        "draws": after.draws,
        "seed": SEED,
        "lines": np.unique(line[after.each < ENOUGH]).tolist(),
    }


def _off_mm(nominal: JointPath, path: JointPath, move: Index, rows: Index) -> Array:
    """(r, 3) mm by which the tip is off at the ends of nominal moves, which those of `path` in `rows` come
    to."""
    whole = np.ones(len(move))
    places = Places(move, rows, whole, whole, *Sides.of(path).at(rows, whole))
    return np.asarray(places.poses(path)[1].position - places.targets(nominal).position)


def ends_of(path: JointPath, moves: Index) -> tuple[Index, Index, Array]:
    """Moves at whose ends is looked, evenly spread ones of many, their tools, and the axis values (n, axes)
    there. Raises NotInvertible."""
    looked = moves[np.unique(np.linspace(0, len(moves) - 1, min(len(moves), _MOST)).astype(np.int64))]
    tool = path.tool[looked]
    return looked, tool, path.motion.axes(path.end[looked], tool, path.tip[looked])


def _rms_um(side: Deviation, proof: JointProof) -> float:
    judged = proof.judged
    return float(np.sqrt(side.square_mm2[judged].sum() / side.samples[judged].sum())) * UM_PER_MM


def figures(values: Array, unit: str) -> dict[str, float]:
    """The largest, the median and the rms of values (n,)."""
    figures = (values.max(), np.median(values), np.sqrt(np.mean(values**2)))
    return {f"{name}_{unit}": float(v) for name, v in zip(("max", "median", "rms"), figures, strict=True)}
