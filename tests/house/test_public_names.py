"""What `olp` shows, and what showing it costs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import olp
from olp.program import registry

ROOT = Path(__file__).resolve().parents[2]
RUN = "from olp.cli import main\ntry: main({!r})\nexcept SystemExit as end: assert end.code == 0, end.code"
LARGE = ("scipy", "trimesh", "meshcat", "ruckig", "matplotlib")
PUBLIC = {
    *("correct", "verify", "simulate", "retime", "check", "compare", "inspect", "error_at", "flatten"),
    *("Correction", "Verification", "Simulation", "Retiming", "Check", "Comparison", "Finding", "load_setup"),
    *("KnownErrors", "load_kinematics"),
    *("view", "Review", "add_layers", "Layers", "fit_calibration", "FittedCalibration"),
    *("diagnose_calibration", "CalibrationDiagnosis", "plan_measurements", "MeasurementPlan"),
    *("plan_next", "probe_artefact", "ProbedArtefact"),
    *("compare_methods", "ComparedMethods", "fit_joint_calibration", "FittedJoints"),
    *("diagnose_joint_calibration", "DiagnosedJoints", "refine_joint_calibration", "RefinedJoints"),
    *("refine_calibration", "RefinedCalibration", "batch", "Batch"),
    *("import_table", "export_table", "compare_tables", "TableImport", "TableExport"),
    *("evaluate_lines", "fit_ballbar", "fit_diagonals", "fit_postures", "go_return"),
    *("fit_thermal", "ThermalFitting", "correct_results", "ResultCorrection"),
    *("correct_poses", "CorrectedPoses", "correct_joints", "JointCorrection", "verify_joints"),
    *("check_joints", "JointCheck", "compare_joints", "plan_poses", "PlannedPoses"),
    *("view_joints", "retime_joints", "JointRetiming"),
    *("JointVerification", "simulate_joints", "JointSimulation"),
    *("OlpError", "InputError", "ConfigError", "ProgramError", "Refused", "CannotCompute"),
}


def loaded_by(code: str, *names: str) -> set[str]:
    """Which of `names` a fresh interpreter holds after running `code`."""
    ask = f"import sys\n{code}\nprint(*sorted({set(names)!r} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.splitlines()[-1].split())


def test_the_visible_names_are_the_promised_ones() -> None:
    assert set(olp.__all__) == PUBLIC
    assert set(dir(olp)) == PUBLIC | {"__version__"}


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_every_name_is_there_and_documented(name: str) -> None:
    value = getattr(olp, name)
    assert value.__name__ == name
    assert value.__doc__


def test_the_type_checker_sees_the_same_names() -> None:
    source = (ROOT / "olp" / "__init__.py").read_text("utf-8")
    assert all(f" import {name} as {name}\n" in source for name in PUBLIC)


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="no attribute 'calibrate'"):
        _ = olp.calibrate


@pytest.mark.parametrize(("code", "free_of"), [
    ("import olp", ("numpy", "pydantic", "click", "rich", *LARGE)),
    ("import olp; olp.OlpError", ("numpy", "pydantic", "click", "rich", *LARGE)),
    ("import olp.cli", ("numpy", "pydantic", "rich", *LARGE)),
    (RUN.format(["--help"]), ("numpy", "pydantic", "rich", *LARGE)),
    ("import olp; olp.correct", LARGE),
])  # fmt: skip
def test_imports_stay_light(code: str, free_of: tuple[str, ...]) -> None:
    assert loaded_by(code, *free_of) == set()


def test_the_probe_sees_what_is_loaded() -> None:
    assert loaded_by("import numpy", "numpy", "scipy") == {"numpy"}


@pytest.mark.slow
def test_a_correction_needs_no_large_library(tmp_path: Path) -> None:
    words = ["correct", "-j", "programs/bridge-cmm/job.toml", "-o", str(tmp_path / "out.ngc"), "--force"]
    assert loaded_by(RUN.format(words), *LARGE) == set()
    assert (tmp_path / "out.ngc").stat().st_size > 0


#: modules and packages that the correction of a plain program for LinuxCNC does without
NEEDLESS = (
    "numpy.ma", "rich", "statistics", "asyncio", "pydantic", "importlib.metadata",
    "olp.calibration", "olp.clearance", "olp.comparison", "olp.results", "olp.review", "olp.trajectory",
    "olp.uncertainty", "olp.compensation.statement_writer", "olp.compensation.verbatim_writer",
    "olp.workflows.confidence", "olp.files.archive", "olp.files.control_tables", "olp.files.described",
    "olp.files.json_schema", "olp.files.measurements", "olp.program.apt.reader",
    "olp.program.described", "olp.program.dmis.reader", "olp.program.foreign",
    "olp.program.pointlist.reader", "olp.program.statement_rows", "olp.program.verbatim",
    "olp.program.rs274.flatten.run", "olp.program.rs274.flatten.unroll", "olp.reports.document",
    "olp.reports.plots",
    "fractions", "decimal", "traceback", "random", "shutil", "tempfile",
    "olp.compensation.programmed", "olp.compensation.tool_path_text", "olp.core.quantities",
    "olp.errormodel.grid_errors", "olp.files.real_time", "olp.program.contours.tool_path",
    "olp.program.sinumerik",
)  # fmt: skip
#: modules of `olp` that it imports, at most
MOST_MODULES = 234
#: prints what compiles a pattern while it is imported
WATCHED = """import re, sys
compiled = re.compile
def watched(*args, **words):
    caller = sys._getframe(1)
    if caller.f_code.co_name == "<module>" and caller.f_globals["__name__"].startswith("olp."):
        print(f"COMPILES {caller.f_globals['__name__']}")
    return compiled(*args, **words)
re.compile = watched
"""


@pytest.mark.slow
def test_a_plain_correction_loads_what_it_needs(tmp_path: Path) -> None:
    words = ["correct", "-j", "programs/gantry-plate/job.toml", "-o", str(tmp_path / "out.ngc")]
    ask = f"{WATCHED}{RUN.format(words)}\nprint(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True, cwd=ROOT)
    assert "COMPILES" not in done.stdout
    loaded = done.stdout.splitlines()[-1].split()
    assert "olp.proof.proof" in loaded
    needless = tuple(f"{name}." for name in (*NEEDLESS, *LARGE))
    assert [name for name in loaded if f"{name}.".startswith(needless)] == []
    assert sum(name.startswith("olp.") for name in loaded) <= MOST_MODULES
    dialects = {known.module for known in registry._KNOWN.values()}
    assert dialects & set(loaded) == {"olp.program.rs274.profiles.linuxcnc"}


@pytest.mark.slow
def test_a_run_seldom_looks_for_unreachable_objects(tmp_path: Path) -> None:
    words = ["olp", "correct", "-j", "programs/gantry-plate/job.toml", "-o", str(tmp_path / "out.ngc")]
    ask = (
        f"import gc, sys\nfrom olp.__main__ import run\nsys.argv = {words!r}\n"
        "count = lambda: sum(generation['collections'] for generation in gc.get_stats())\n"
        "before = count()\ntry: run()\nexcept SystemExit as end: assert end.code == 0\n"
        "print(count() - before, gc.get_freeze_count())"
    )
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True, cwd=ROOT)
    collections, left_alone = map(int, done.stdout.splitlines()[-1].split())
    # with Python's own threshold there are some hundred
    assert collections <= 4
    # those that the end of the interpreter does not look through
    assert left_alone > 10_000
