"""Logs of the whole of LinuxCNC, and simulated runs, compared with their nominal path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import controller, linuxcnc, machines, programs
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import densify, tool_vectors
from workflows.test_correct_in_linuxcnc import RANGE, distances_mm

import olp
from olp.files.point_profile import load_profile
from olp.workflows.compare import compare

pytestmark = [pytest.mark.oracle, pytest.mark.slow]
#: um; sampling, and the chords of arcs
SLACK_UM = 0.15


def test_a_log_of_the_control_is_a_measurement(tmp_path: Path) -> None:
    """Nominal, uncorrected run, corrected run: figures are those of the judge's own model and distances."""
    controller.require()
    machine = machines.random_machine(tmp_path / "machine", 21, Recipe(chain="FXYZ"))
    features = ["lines", "arcs", "helix", "planes"]
    nominal = programs.random_program(21, features=features, range_mm=RANGE, blocks=6, inch=False)
    nominal = nominal.replace(b"G94", b"G61 G94", 1)
    (tmp_path / "nominal.ngc").write_bytes(nominal)
    corrected = olp.correct(nominal, machine).data
    runs, logs = [], []
    for name, text in (("uncorrected", nominal), ("corrected", corrected)):
        runs.append(controller.run(text, machine, tmp_path / name))
        logs.append(tmp_path / name / "samples")
    sampler = load_profile("linuxcnc-sampler")

    bare = compare(tmp_path / "nominal.ngc", logs[:1], machine, profile=sampler)
    assert bare.report["after"]["across_um"]["max"] < SLACK_UM, "the control stays on its path with G61"
    assert "OLP601" not in [f.code for f in bare.findings]

    both = compare(
        tmp_path / "nominal.ngc", logs[1:], machine, before=logs[:1], profile=sampler, add_errors=True
    )
    assert not {"OLP601", "OLP602"} & {f.code for f in both.findings}
    model = JudgeModel(machine.parent)
    moves = linuxcnc.interpret(nominal, machine.parent)
    dense = densify(moves, 0.02).points
    tool_vector = tool_vectors(moves, model)[np.isin(moves.kind, (linuxcnc.FEED, linuxcnc.ARC))]
    for group, run in (("before", runs[0]), ("after", runs[1])):
        axis_mm = run.axis[run.cutting]
        real = axis_mm + model.error_mm(axis_mm, np.tile(tool_vector[0], (len(axis_mm), 1)))
        judged = distances_mm(real, dense).max() * 1e3
        assert both.report[group]["across_um"]["max"] == pytest.approx(judged, abs=SLACK_UM)
    assert both.report["before"]["across_um"]["max"] > 20
    assert both.report["after"]["across_um"]["max"] < 2


def test_simulated_runs_give_the_same_figures(tmp_path: Path) -> None:
    machine = machines.random_machine(tmp_path / "machine", 22, Recipe(chain="YFXZ"))
    nominal = programs.random_program(22, features=["lines", "arcs"], range_mm=RANGE, blocks=8, inch=False)
    (tmp_path / "nominal.ngc").write_bytes(nominal)
    result = olp.correct(nominal, machine)
    for name, text in (("uncorrected.csv", nominal), ("corrected.csv", result.data)):
        (tmp_path / name).write_bytes(olp.simulate(text, machine, step_mm=0.1).to_csv())
    comparison = compare(
        tmp_path / "nominal.ngc", [tmp_path / "corrected.csv"], machine, before=[tmp_path / "uncorrected.csv"]
    )
    deviation = result.report["deviation"]
    for group in ("before", "after"):
        stated = deviation[group]["between"]["max_um"]
        assert comparison.report[group]["across_um"]["max"] <= stated + SLACK_UM
        assert comparison.report[group]["across_um"]["max"] > 0.5 * stated
