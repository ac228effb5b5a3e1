"""`olp` pre-distorts programs of Cartesian machines with the machine's calibrated error model.

    import olp
    result = olp.correct("part.nc", "machine.toml")
    Path("part.corrected.nc").write_bytes(result.data)

Names are loaded when they are first used, so that `import olp` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from olp.api import Correction as Correction
    from olp.api import Simulation as Simulation
    from olp.api import Verification as Verification
    from olp.api import correct as correct
    from olp.api import error_at as error_at
    from olp.api import flatten as flatten
    from olp.api import inspect as inspect
    from olp.api import simulate as simulate
    from olp.api import verify as verify
    from olp.calibrating import FittedCalibration as FittedCalibration
    from olp.calibrating import fit_calibration as fit_calibration
    from olp.comparing import Comparison as Comparison
    from olp.comparing import compare as compare
    from olp.diagnosing import CalibrationDiagnosis as CalibrationDiagnosis
    from olp.diagnosing import diagnose_calibration as diagnose_calibration
    from olp.exceptions import CannotCompute as CannotCompute
    from olp.exceptions import ConfigError as ConfigError
    from olp.exceptions import InputError as InputError
    from olp.exceptions import OlpError as OlpError
    from olp.exceptions import ProgramError as ProgramError
    from olp.exchanging import TableExport as TableExport
    from olp.exchanging import TableImport as TableImport
    from olp.exchanging import compare_tables as compare_tables
    from olp.exchanging import export_table as export_table
    from olp.exchanging import import_table as import_table
    from olp.files.config import load_setup as load_setup
    from olp.findings import Finding as Finding
    from olp.gate import Check as Check
    from olp.gate import check as check
    from olp.metrology import evaluate_lines as evaluate_lines
    from olp.metrology import fit_ballbar as fit_ballbar
    from olp.metrology import fit_diagonals as fit_diagonals
    from olp.metrology import fit_postures as fit_postures
    from olp.metrology import go_return as go_return
    from olp.planning import MeasurementPlan as MeasurementPlan
    from olp.planning import plan_measurements as plan_measurements
    from olp.refining import RefinedCalibration as RefinedCalibration
    from olp.refining import refine_calibration as refine_calibration
    from olp.result_correction import ResultCorrection as ResultCorrection
    from olp.result_correction import correct_results as correct_results
    from olp.retiming import Retiming as Retiming
    from olp.retiming import retime as retime
    from olp.review.job import Review as Review
    from olp.review.job import view as view
    from olp.review.notebook import add_layers as add_layers
    from olp.thermal_fitting import ThermalFitting as ThermalFitting
    from olp.thermal_fitting import fit_thermal as fit_thermal

_HOME = {
    "Check": "olp.gate",
    "Correction": "olp.api",
    "check": "olp.gate",
    "Simulation": "olp.api",
    "Verification": "olp.api",
    "compare": "olp.comparing",
    "Comparison": "olp.comparing",
    "FittedCalibration": "olp.calibrating",
    "fit_calibration": "olp.calibrating",
    "CalibrationDiagnosis": "olp.diagnosing",
    "diagnose_calibration": "olp.diagnosing",
    "RefinedCalibration": "olp.refining",
    "refine_calibration": "olp.refining",
    "MeasurementPlan": "olp.planning",
    "plan_measurements": "olp.planning",
    "correct": "olp.api",
    "compare_tables": "olp.exchanging",
    "export_table": "olp.exchanging",
    "import_table": "olp.exchanging",
    "TableExport": "olp.exchanging",
    "TableImport": "olp.exchanging",
    "error_at": "olp.api",
    "flatten": "olp.api",
    "inspect": "olp.api",
    "retime": "olp.retiming",
    "Review": "olp.review.job",
    "view": "olp.review.job",
    "add_layers": "olp.review.notebook",
    "Retiming": "olp.retiming",
    "ResultCorrection": "olp.result_correction",
    "correct_results": "olp.result_correction",
    "simulate": "olp.api",
    "verify": "olp.api",
    "fit_thermal": "olp.thermal_fitting",
    "ThermalFitting": "olp.thermal_fitting",
    "CannotCompute": "olp.exceptions",
    "ConfigError": "olp.exceptions",
    "InputError": "olp.exceptions",
    "OlpError": "olp.exceptions",
    "ProgramError": "olp.exceptions",
    "Finding": "olp.findings",
    "load_setup": "olp.files.config",
    "evaluate_lines": "olp.metrology",
    "fit_ballbar": "olp.metrology",
    "fit_diagonals": "olp.metrology",
    "fit_postures": "olp.metrology",
    "go_return": "olp.metrology",
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
