"""How well the poses of a program are known, from the covariance of the calibration, for reports and
pages."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from olp.calibration.joints.unknowns import Model
from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.uncertainty import YEAR
from olp.files.kinematics.covariance import load_joint_covariance
from olp.files.toml_text import read_toml
from olp.proof.joints import Deviation, JointProof
from olp.workflows.joints.loaded import JointRun

if TYPE_CHECKING:
    from olp.uncertainty.poses import PoseSpread

#: Waypoints of a program at which poses are looked at, at most; they are spread evenly.
_MOST = 5000
#: Lines in the report.
_LINES = 10
_NOT_INCLUDED = (
    "one shift and one turn of all poses, which the work offset takes up: how well that is set is not in it",
    "curves, cyclic errors and play: the covariance of the calibration is that of its lines and zeros",
    "what the control does between blocks, forces, and the process",
)


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What a calibration states of its uncertainty on the day of the run: the model with the covariance, its
    file, and by how much standard uncertainties have grown."""

    model: Model
    source: str
    growth: float

    def spread(self, run: JointRun, path: JointPath, axes: Array, tool: Index) -> PoseSpread:
        """That of poses at axis values (n, axes) with tools (n,) of the motion."""
        from olp.uncertainty.poses import pose_spread

        tools = np.array([machine.tool_mm for machine in path.motion.machines])
        return pose_spread(self.model, axes, tools[tool], run.errors.payload)


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
    return Known(model, values["covariance"]["file"], growth)


def uncertainty_of(
    run: JointRun, path: JointPath, proof: JointProof, date: datetime.date | None
) -> dict[str, Any] | None:
    """The part of a report on the uncertainty of poses at the waypoints that are judged; None where none is
    stated. Raises as `known_of`."""
    known = known_of(run, date)
    rows = np.flatnonzero(proof.judged & np.isfinite(path.end).all(axis=1))
    if known is None or not len(rows):
        return None
    from olp.uncertainty.spread import COVERAGE, bands

    looked = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _MOST)).astype(np.int64))]
    tool = path.tool[looked]
    axes = path.motion.axes(path.end[looked], tool, path.tip[looked])
    spread = known.spread(run, path, axes, tool)
    tip, turn = bands(spread.tip) * UM_PER_MM, spread.turn_band_rad / RAD_PER_URAD
    scatter_um2 = float(np.trace(spread.tip, axis1=1, axis2=2).mean()) * UM_PER_MM**2
    line, worst = path.program.original_lines(path.line[looked]), np.argsort(-tip, kind="stable")
    listed = list(dict.fromkeys(line[worst].tolist()))[:_LINES]
    return {
        "coverage_factor": COVERAGE,
        "source": known.source,
        "growth_by_age": known.growth,
        "waypoints": len(looked),
        "band_um": _figures(tip, "um"),
        "band_urad": _figures(turn, "urad"),
        "expected": {
            f"{name}_rms_um": float(np.hypot(_rms_um(side, proof), np.sqrt(scatter_um2)))
            for name, side in (("before", proof.before), ("after", proof.after))
        },
        "lines": [
            {"line": n, "band_um": float(tip[line == n].max()), "band_urad": float(turn[line == n].max())}
            for n in listed
        ],
        "not_included": list(_NOT_INCLUDED),
    }


def _rms_um(side: Deviation, proof: JointProof) -> float:
    judged = proof.judged
    return float(np.sqrt(side.square_mm2[judged].sum() / side.samples[judged].sum())) * UM_PER_MM


def _figures(values: Array, unit: str) -> dict[str, float]:
    figures = (values.max(), np.median(values), np.sqrt(np.mean(values**2)))
    return {f"{name}_{unit}": float(v) for name, v in zip(("max", "median", "rms"), figures, strict=True)}
