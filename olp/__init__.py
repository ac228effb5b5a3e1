"""`olp` pre-distorts programs of Cartesian machines with the machine's calibrated error model.

    import olp
    result = olp.correct("part.nc", "machine.toml")
    Path("part.corrected.nc").write_bytes(result.data)

Names are loaded when they are first used, so that `import olp` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from olp.core.version import __version__ as __version__

if TYPE_CHECKING:
    from olp.core.errors import CannotCompute as CannotCompute
    from olp.core.errors import ConfigError as ConfigError
    from olp.core.errors import InputError as InputError
    from olp.core.errors import OlpError as OlpError
    from olp.core.errors import ProgramError as ProgramError
    from olp.core.errors import Refused as Refused
    from olp.errormodel.known import KnownErrors as KnownErrors
    from olp.files.config import load_setup as load_setup
    from olp.files.kinematics.load import load_kinematics as load_kinematics
    from olp.findings.catalogue import Finding as Finding
    from olp.kinematics.correction import CorrectedPoses as CorrectedPoses
    from olp.kinematics.correction import correct_poses as correct_poses
    from olp.review.job import Review as Review
    from olp.review.job import view as view
    from olp.review.joints import view_joints as view_joints
    from olp.review.notebook.layers import Layers as Layers
    from olp.review.notebook.layers import add_layers as add_layers
    from olp.workflows.batch import Batch as Batch
    from olp.workflows.batch import batch as batch
    from olp.workflows.calibrate_ballbar import fit_ballbar as fit_ballbar
    from olp.workflows.calibrate_compare_methods import ComparedMethods as ComparedMethods
    from olp.workflows.calibrate_compare_methods import compare_methods as compare_methods
    from olp.workflows.calibrate_diagonals import fit_diagonals as fit_diagonals
    from olp.workflows.calibrate_doctor import CalibrationDiagnosis as CalibrationDiagnosis
    from olp.workflows.calibrate_doctor import diagnose_calibration as diagnose_calibration
    from olp.workflows.calibrate_evaluate import evaluate_lines as evaluate_lines
    from olp.workflows.calibrate_export import TableExport as TableExport
    from olp.workflows.calibrate_export import compare_tables as compare_tables
    from olp.workflows.calibrate_export import export_table as export_table
    from olp.workflows.calibrate_fit import FittedCalibration as FittedCalibration
    from olp.workflows.calibrate_fit import fit_calibration as fit_calibration
    from olp.workflows.calibrate_go_return import go_return as go_return
    from olp.workflows.calibrate_import import TableImport as TableImport
    from olp.workflows.calibrate_import import import_table as import_table
    from olp.workflows.calibrate_joints import FittedJoints as FittedJoints
    from olp.workflows.calibrate_joints import fit_joint_calibration as fit_joint_calibration
    from olp.workflows.calibrate_next import plan_next as plan_next
    from olp.workflows.calibrate_plan import MeasurementPlan as MeasurementPlan
    from olp.workflows.calibrate_plan import plan_measurements as plan_measurements
    from olp.workflows.calibrate_plan_joints import PlannedPoses as PlannedPoses
    from olp.workflows.calibrate_plan_joints import plan_poses as plan_poses
    from olp.workflows.calibrate_postures import fit_postures as fit_postures
    from olp.workflows.calibrate_probe import ProbedArtefact as ProbedArtefact
    from olp.workflows.calibrate_probe import probe_artefact as probe_artefact
    from olp.workflows.calibrate_refine import RefinedCalibration as RefinedCalibration
    from olp.workflows.calibrate_refine import refine_calibration as refine_calibration
    from olp.workflows.calibrate_thermal import ThermalFitting as ThermalFitting
    from olp.workflows.calibrate_thermal import fit_thermal as fit_thermal
    from olp.workflows.check import Check as Check
    from olp.workflows.check import check as check
    from olp.workflows.compare import Comparison as Comparison
    from olp.workflows.compare import compare as compare
    from olp.workflows.correct import Correction as Correction
    from olp.workflows.correct import correct as correct
    from olp.workflows.flatten import flatten as flatten
    from olp.workflows.inspect import error_at as error_at
    from olp.workflows.inspect import inspect as inspect
    from olp.workflows.joints.check import JointCheck as JointCheck
    from olp.workflows.joints.check import check_joints as check_joints
    from olp.workflows.joints.compare import compare_joints as compare_joints
    from olp.workflows.joints.correct import JointCorrection as JointCorrection
    from olp.workflows.joints.correct import correct_joints as correct_joints
    from olp.workflows.joints.doctor import DiagnosedJoints as DiagnosedJoints
    from olp.workflows.joints.doctor import diagnose_joint_calibration as diagnose_joint_calibration
    from olp.workflows.joints.refine import RefinedJoints as RefinedJoints
    from olp.workflows.joints.refine import refine_joint_calibration as refine_joint_calibration
    from olp.workflows.joints.retime import JointRetiming as JointRetiming
    from olp.workflows.joints.retime import retime_joints as retime_joints
    from olp.workflows.joints.simulate import JointSimulation as JointSimulation
    from olp.workflows.joints.simulate import simulate_joints as simulate_joints
    from olp.workflows.joints.verify import JointVerification as JointVerification
    from olp.workflows.joints.verify import verify_joints as verify_joints
    from olp.workflows.results import ResultCorrection as ResultCorrection
    from olp.workflows.results import correct_results as correct_results
    from olp.workflows.retime import Retiming as Retiming
    from olp.workflows.retime import retime as retime
    from olp.workflows.simulate import Simulation as Simulation
    from olp.workflows.simulate import simulate as simulate
    from olp.workflows.verify import Verification as Verification
    from olp.workflows.verify import verify as verify

_HOME = {
    "Check": "olp.workflows.check",
    "Correction": "olp.workflows.correct",
    "check": "olp.workflows.check",
    "Batch": "olp.workflows.batch",
    "batch": "olp.workflows.batch",
    "Simulation": "olp.workflows.simulate",
    "Verification": "olp.workflows.verify",
    "compare": "olp.workflows.compare",
    "Comparison": "olp.workflows.compare",
    "FittedCalibration": "olp.workflows.calibrate_fit",
    "fit_calibration": "olp.workflows.calibrate_fit",
    "FittedJoints": "olp.workflows.calibrate_joints",
    "fit_joint_calibration": "olp.workflows.calibrate_joints",
    "DiagnosedJoints": "olp.workflows.joints.doctor",
    "diagnose_joint_calibration": "olp.workflows.joints.doctor",
    "RefinedJoints": "olp.workflows.joints.refine",
    "refine_joint_calibration": "olp.workflows.joints.refine",
    "CalibrationDiagnosis": "olp.workflows.calibrate_doctor",
    "compare_methods": "olp.workflows.calibrate_compare_methods",
    "ComparedMethods": "olp.workflows.calibrate_compare_methods",
    "diagnose_calibration": "olp.workflows.calibrate_doctor",
    "RefinedCalibration": "olp.workflows.calibrate_refine",
    "refine_calibration": "olp.workflows.calibrate_refine",
    "MeasurementPlan": "olp.workflows.calibrate_plan",
    "plan_measurements": "olp.workflows.calibrate_plan",
    "PlannedPoses": "olp.workflows.calibrate_plan_joints",
    "plan_poses": "olp.workflows.calibrate_plan_joints",
    "plan_next": "olp.workflows.calibrate_next",
    "ProbedArtefact": "olp.workflows.calibrate_probe",
    "probe_artefact": "olp.workflows.calibrate_probe",
    "correct": "olp.workflows.correct",
    "compare_tables": "olp.workflows.calibrate_export",
    "export_table": "olp.workflows.calibrate_export",
    "import_table": "olp.workflows.calibrate_import",
    "TableExport": "olp.workflows.calibrate_export",
    "TableImport": "olp.workflows.calibrate_import",
    "error_at": "olp.workflows.inspect",
    "flatten": "olp.workflows.flatten",
    "inspect": "olp.workflows.inspect",
    "retime": "olp.workflows.retime",
    "Review": "olp.review.job",
    "view": "olp.review.job",
    "Layers": "olp.review.notebook.layers",
    "add_layers": "olp.review.notebook.layers",
    "Retiming": "olp.workflows.retime",
    "ResultCorrection": "olp.workflows.results",
    "correct_results": "olp.workflows.results",
    "simulate": "olp.workflows.simulate",
    "CorrectedPoses": "olp.kinematics.correction",
    "correct_poses": "olp.kinematics.correction",
    "view_joints": "olp.review.joints",
    "JointCheck": "olp.workflows.joints.check",
    "check_joints": "olp.workflows.joints.check",
    "compare_joints": "olp.workflows.joints.compare",
    "JointCorrection": "olp.workflows.joints.correct",
    "correct_joints": "olp.workflows.joints.correct",
    "JointRetiming": "olp.workflows.joints.retime",
    "retime_joints": "olp.workflows.joints.retime",
    "JointSimulation": "olp.workflows.joints.simulate",
    "simulate_joints": "olp.workflows.joints.simulate",
    "JointVerification": "olp.workflows.joints.verify",
    "verify_joints": "olp.workflows.joints.verify",
    "verify": "olp.workflows.verify",
    "fit_thermal": "olp.workflows.calibrate_thermal",
    "ThermalFitting": "olp.workflows.calibrate_thermal",
    "CannotCompute": "olp.core.errors",
    "ConfigError": "olp.core.errors",
    "InputError": "olp.core.errors",
    "OlpError": "olp.core.errors",
    "ProgramError": "olp.core.errors",
    "Refused": "olp.core.errors",
    "Finding": "olp.findings.catalogue",
    "KnownErrors": "olp.errormodel.known",
    "load_setup": "olp.files.config",
    "load_kinematics": "olp.files.kinematics.load",
    "evaluate_lines": "olp.workflows.calibrate_evaluate",
    "fit_ballbar": "olp.workflows.calibrate_ballbar",
    "fit_diagonals": "olp.workflows.calibrate_diagonals",
    "fit_postures": "olp.workflows.calibrate_postures",
    "go_return": "olp.workflows.calibrate_go_return",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'olp' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
