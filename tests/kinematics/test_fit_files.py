"""`olp calibrate fit` of a machine of any joints: from a plan to a calibration that is used, and refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from calibration.joints.simulated import NESTS, TOOL, as_csv, campaign, read, true_machine
from click.testing import CliRunner
from kinematics.cases import GOLDEN, need_golden

import olp
from olp.calibration.joints.readings import Points, SixD
from olp.cli import main
from olp.core.rigid_fit import Rigid, fit_points

MEASURED = ["measured_X_mm", "measured_Y_mm", "measured_Z_mm"]
NAMED = "\n".join(f"{k + 1} = {nest.tolist()}" for k, nest in enumerate(NESTS))
POINTS = f'[[points]]\nfile = "t.csv"\nsigma_um = 20.0\ntool_mm = {list(TOOL)}\n[points.nests_mm]\n{NAMED}\n'


def run(*words: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(main, [str(word) for word in words])
    return result.exit_code, result.output


def machine_in(folder: Path, name: str, calibration: str = "") -> Path:
    """The machine file of a golden case, with this calibration or none."""
    need_golden()
    text = (GOLDEN / name / "machine.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("calibration")]
    if calibration:
        lines.insert(1, f'calibration = "{calibration}"')
    (folder / "machine.toml").write_text("\n".join(lines))
    return folder / "machine.toml"


def arm(folder: Path, tables: str = POINTS) -> tuple[Path, np.ndarray, np.ndarray]:
    """A plan of points on a true arm, its postures, and where its tip really is there."""
    model, theta, values = true_machine("arm_6r_kr6", count=40)
    values = np.round(values, 3)
    pose = model.machine(theta).actual(values)
    points = read("points", pose, values)
    assert isinstance(points, Points)
    order = [f"{joint.name}_{joint.unit}" for joint in model.structure.joints.values()]
    nests = ["nest", *(points.names[k] for k in points.which)]
    text = as_csv(order, values, MEASURED, points.measured_mm, nests)
    plan = campaign(folder, "measurements.toml", model.structure.name, {"t.csv": text}, tables)
    return plan, values, pose.at(np.array(TOOL))


@pytest.mark.slow
def test_a_plan_becomes_a_calibration_that_predicts_the_machine(tmp_path: Path) -> None:
    plan, values, true = arm(tmp_path)
    machine = machine_in(tmp_path, "arm_6r_kr6", "calibration.toml")
    target = tmp_path / "calibration.toml"
    page = tmp_path / "report.html"
    call = ("calibrate", "fit", tmp_path, "-m", machine, "-o", target, "--json", "--report", page)
    code, said = run(*call)
    assert code == 0, said
    report = json.loads(said[said.index("{") : said.rindex("}") + 1])
    assert (report["unknowns_kept"], report["unknowns_determined"]) == (24, 24)
    assert report["held_out"][1]["rms_um"] < 60.0 < 1000.0 < report["held_out"][0]["rms_um"]
    assert "J1.zero_urad" in report["not_needed"]
    shown = page.read_text("utf-8")
    before, after = report["held_out"]
    assert f"was off by {before['mean_um']:.2f} um before and {after['mean_um']:.2f} um after (mean)" in shown
    assert "held by what is usual" not in shown and all(
        f">{row['name']}<" in shown for row in report["unknowns"]
    )
    assert shown.count("<svg") == 2 and "held-out reading, ordered by its distance before" in shown
    found = olp.load_kinematics(machine).actual(values).at(np.array(TOOL) - (0.0, 0.0, 150.0))
    stated = report["uncertainty_in_best_frame"]["tip_largest_um"]
    assert np.linalg.norm(fit_points(found, true)(found) - true, axis=1).max() < 3e-3 * stated
    code, text = run("inspect", machine)
    assert (code, "location um" in text) == (0, True)
    assert run("calibrate", "fit", plan, "-m", machine, "-o", target, "-q")[0] == 2  # it is there
    same = olp.fit_joint_calibration(plan, machine).files(target)
    assert same[target] == target.read_bytes()


@pytest.mark.slow
def test_what_the_model_does_not_explain_is_in_the_expected_deviation(tmp_path: Path) -> None:
    """Joints with waves that are no unknowns: at postures that had no part in the fit the tip is off by what
    is stated, and not by the uncertainty of the unknowns alone."""
    plan, _, _ = arm(tmp_path, POINTS)
    text = (tmp_path / "t.csv").read_text().splitlines()
    rows = [line.split(",") for line in text[1:]]
    for row in rows:
        turn = [np.radians(float(value)) for value in row[:6]]
        for axis in range(3):
            row[6 + axis] = f"{float(row[6 + axis]) + 0.15 * np.sin(7.0 * turn[axis] + turn[4 - axis]):.6f}"
    (tmp_path / "t.csv").write_text("\n".join([text[0], *map(",".join, rows)]) + "\n")
    fitted = olp.fit_joint_calibration(plan, machine_in(tmp_path, "arm_6r_kr6"))
    stated, unseen = fitted.report["uncertainty_in_best_frame"], fitted.report["held_out"][1]
    assert 0.6 < unseen["rms_um"] / stated["tip_with_misfit_um"] < 1.5
    assert stated["tip_with_misfit_um"] > 1.3 * stated["tip_mean_um"]


@pytest.mark.slow
def test_every_kind_of_table_is_read(tmp_path: Path) -> None:
    """One machine read by six instruments: readings without noise leave no residual."""
    model, theta, values = true_machine("xyzac_trunnion", count=24)
    pose = model.machine(theta).actual(values)
    nominal = model.machine(0.0 * theta).nominal(values)
    order = [f"{joint.name}_{joint.unit}" for joint in model.structure.joints.values()]
    six = read("poses", pose, values, noise=0.0)
    assert isinstance(six, SixD)
    angles = np.array([Rigid(turn, np.zeros(3)).angles_deg for turn in six.measured_turn])
    tip, centre = pose.at(np.array(TOOL)), np.array((500.0, 200.0, -300.0))
    far = np.linalg.norm(tip - centre, axis=1)[:, None]
    away = 1e3 * (tip - nominal.at(np.array(TOOL)))
    same = f"sigma_um = 20.0\ntool_mm = {list(TOOL)}\n"
    files = {
        "s.csv": as_csv(order, values, [*MEASURED, *(f"measured_{c}_deg" for c in "ABC")],
                        np.concatenate((six.measured_mm, angles), axis=1)),
        "l.csv": as_csv(order, values, ["length_mm"], far),
    }  # fmt: skip
    tables = f'[[poses]]\nfile = "s.csv"\nsigma_urad = 50.0\n{same}'
    tables += f'[[lengths]]\nfile = "l.csv"\n{same}[lengths.centres_mm]\n1 = {centre.tolist()}\n'
    plan = campaign(tmp_path, "plan.toml", model.structure.name, files, tables)
    fitted = olp.fit_joint_calibration(plan, machine_in(tmp_path, "xyzac_trunnion"))
    assert [row["name"] for row in fitted.report["readings"]] == ["poses", "lengths"]
    assert all(row["largest_um"] < 5.0 for row in fitted.report["readings"])
    assert np.abs(away).max() > 100.0


@pytest.mark.slow
def test_a_ball_is_read_either_way(tmp_path: Path) -> None:
    """One posture of the linear axes and turns about the ball: where the ball was found is minus the tip."""
    model, theta, values = true_machine("xyzac_trunnion", count=24)
    order = [f"{joint.name}_{joint.unit}" for joint in model.structure.joints.values()]
    away = 1e3 * (
        model.machine(theta).actual(values).position - model.machine(0.0 * theta).nominal(values).position
    )
    found = []
    for reads, sign in (("tip", 1.0), ("ball", -1.0)):
        files = {"b.csv": as_csv(order, values, ["dX_um", "dY_um", "dZ_um"], sign * away)}
        table = f'[[ball]]\nfile = "b.csv"\nreads = "{reads}"\naxes = "workpiece"\n'
        table += "sigma_um = 1e4\ntool_mm = [0, 0, 0]\n"
        plan = campaign(tmp_path, f"{reads}.toml", model.structure.name, files, table)
        found.append(olp.fit_joint_calibration(plan, machine_in(tmp_path, "xyzac_trunnion")).fit.theta)
    assert found[0] == pytest.approx(found[1], rel=1e-6, abs=1e-12)


WRONG = [
    (POINTS.replace("t.csv", "u.csv"), "u.csv"),
    (POINTS.replace("\n3 = ", "\n4 = "), "names 3; expected names of nests_mm"),
    (POINTS.replace("sigma_um = 20.0\n", ""), "sigma_um"),
    (POINTS.split("[points.nests_mm]")[0], "expected their vectors in nests_mm"),
    ("", "names no readings"),
    ('elasticity = ["J2"]\n' + POINTS, "elasticity needs weights"),
    ('elasticity = ["J9"]\n' + POINTS, "expected a rotary axis"),
    ('active_during_measurement = ["EXX"]\n' + POINTS, "expected []"),
    (POINTS + '[[masses]]\non = "J9"\nkg = 2.0\ncentre_mm = [0, 0, 0]\n', "is no axis"),
]


@pytest.mark.parametrize(("tables", "words"), WRONG)
def test_wrong_plans_are_refused(tables: str, words: str, tmp_path: Path) -> None:
    arm(tmp_path, tables)
    machine = machine_in(tmp_path, "arm_6r_kr6")
    code, said = run("calibrate", "fit", tmp_path, "-m", machine, "-o", tmp_path / "c.toml")
    assert (code, words in said) == (3, True), said
    assert not (tmp_path / "c.toml").exists()


def test_wrong_rows_are_refused_with_their_line(tmp_path: Path) -> None:
    plan, _, _ = arm(tmp_path)
    machine = machine_in(tmp_path, "arm_6r_kr6")
    text = (tmp_path / "t.csv").read_text()
    for old, new, words in (
        ("J3_deg", "J3_mm", "expected one of J1_deg"),
        ("measured_Z_mm", "measured_Z", "measured_Z"),
        (text.splitlines()[3], "a" + text.splitlines()[3], "line 4"),
    ):
        (tmp_path / "t.csv").write_text(text.replace(old, new, 1))
        code, said = run("calibrate", "fit", plan, "-m", machine)
        assert (code, words in said) == (3, True), said
    (tmp_path / "t.csv").write_text(text.splitlines()[0] + "\n")
    assert "holds no rows" in run("calibrate", "fit", plan, "-m", machine)[1]


@pytest.mark.slow
def test_options_of_linear_axes_are_refused(tmp_path: Path) -> None:
    plan, _, _ = arm(tmp_path)
    machine = machine_in(tmp_path, "arm_6r_kr6")
    for words in (("--map",), ("--datum", "0", "0", "0"), (plan,)):
        assert run("calibrate", "fit", plan, "-m", machine, *words)[0] == 2
    assert run("calibrate", "fit", plan, "-m", machine, "-q", "--report", tmp_path / "r.json")[0] == 0
    assert json.loads((tmp_path / "r.json").read_text())["schema"] == "olp-joint-fit-1"
