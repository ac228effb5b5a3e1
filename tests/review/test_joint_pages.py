"""Pages of machines with rotary joints: they show what the proof says, where an own forward has it."""

from __future__ import annotations

import re
import shutil
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.fast import left_to_a_campaign
from cases.joint_jobs import JOINT_JOBS
from cli.test_cli import run
from judge import browser
from judge.five_axis import Judge
from judge.unpacker import Page
from scipy.spatial.transform import Rotation

import olp
from olp.core.errors import ConfigError, ProgramError
from olp.proof.proof import Counts
from olp.review.job import Review
from olp.review.scene import Scene
from olp.workflows.joints.retime import JointRetiming

FOLDER = Path(__file__).resolve().parents[2] / "programs"


@pytest.fixture(scope="module")
def reviews() -> dict[str, Review]:
    return {
        name: olp.view_joints(file, file.with_name("machine.toml"), file.with_name("job.toml"))
        for name, file in ((name, FOLDER / name / program) for name, program in JOINT_JOBS.items())
    }


@pytest.fixture(scope="module")
def chromium() -> Any:
    browser.require()
    with browser.driver() as play, browser.launched(play, *browser.SOFTWARE_GL) as launched:
        yield launched


@pytest.mark.slow
@pytest.mark.parametrize("name", JOINT_JOBS)
def test_the_page_says_what_the_report_says(name: str, reviews: dict[str, Review]) -> None:
    scene = reviews[name].scene
    stated, table = scene.report["deviation"], scene.table
    assert table.largest_mm() * 1e3 == pytest.approx(stated["after"]["position_max_um"], rel=1e-6)
    judged = table.judged[scene.samples.move]
    assert judged.any() and not (table.counts[~table.judged] == Counts.FEED).any()
    for layer, side in (("corrected", "after"), ("uncorrected", "before")):
        off = np.linalg.norm(getattr(scene.samples, layer)[judged], axis=1) * 1e3
        most = stated[side]["position_max_um"]
        # the corrected program is seen where the proof looked; between those places the uncorrected one too
        assert off.max() == pytest.approx(most, rel=1e-5 if layer == "corrected" else 0.01)
        turn = scene.turn_urad[layer][judged].max()
        assert turn == pytest.approx(stated[side]["orientation_max_urad"], rel=0.02)
    page = Page(reviews[name].html())
    assert page.manifest["verdict"]["ok"] is True
    assert page.manifest["verdict"]["questions"][0]["sentence"].startswith("The corrected path is within")
    assert {metric["name"] for metric in page.manifest["metrics"]} >= {"magnitude", "turn"}
    assert [f["code"] for f in page.manifest["findings"]] == [f["code"] for f in scene.report["findings"]]


def moved(scene: Scene, point: np.ndarray) -> np.ndarray:
    """(n, 3) a point of the last body at all samples: what the nodes do, innermost first."""
    place = np.tile(point, (len(scene.samples), 1))
    for node in reversed(scene.nodes):
        value = (scene.axes[:, node.axis] - scene.drawn_at[node.axis])[:, None] * node.direction
        before = place
        if node.kind == "linear":
            place = place + value
        else:
            place = Rotation.from_rotvec(np.radians(value)).apply(place - node.point_mm) + node.point_mm
        # what notebooks are told
        shift, turn = node.placed(scene.axes[:, node.axis] - scene.drawn_at[node.axis])
        np.testing.assert_allclose(Rotation.from_quat(turn).apply(before) + shift, place, atol=1e-9)
    return place


@pytest.mark.slow
@pytest.mark.parametrize("name", JOINT_JOBS)
def test_the_nodes_bring_the_tool_to_the_tip(name: str, reviews: dict[str, Review]) -> None:
    scene = reviews[name].scene
    (tool,) = [body for body in scene.bodies if body.role == "tool"]
    assert tool.path == scene.nodes[-1].path
    first = moved(scene, tool.vertices.mean(axis=0)) - scene.position_mm
    # the tip is on the axis of the tool, at one end
    ends = tool.vertices[np.linalg.norm(tool.vertices - tool.vertices.mean(axis=0), axis=1).argsort()[:2]]
    centres = [moved(scene, end) for end in ends]
    away = min(float(np.linalg.norm(centre - scene.position_mm, axis=1).max()) for centre in centres)
    assert away < 1e-6
    length = np.linalg.norm(first, axis=1)
    assert np.ptp(length) < 1e-6 and length[0] > 1.0


@pytest.mark.slow
def test_tips_and_errors_are_those_of_the_judge(tmp_path: Path) -> None:
    """On the trunnion mill without its measured curve, which the judge does not model."""
    shutil.copytree(FOLDER / "trunnion-mill", tmp_path / "job")
    calibration = tmp_path / "job" / "calibration.toml"
    text = calibration.read_text("utf-8")
    calibration.write_text(re.sub(r"(?ms)^\[\[curves\].*?(?=^\[)", "", text), "utf-8")
    machine = tmp_path / "job" / "machine.toml"
    scene = olp.view_joints(FOLDER / "trunnion-mill" / "dome.nc", machine).scene
    judge, tip = Judge(machine), scene.position_mm + np.array(scene.frame.origin_mm)
    assert scene.frame.label == "G54, as programmed"
    nominal, actual = (judge.forward(scene.axes, errors) for errors in (False, True))
    np.testing.assert_allclose(tip, nominal[0], atol=1e-8)
    np.testing.assert_allclose(scene.samples.uncorrected, actual[0] - nominal[0], atol=2e-6)
    turn = np.linalg.norm(np.cross(nominal[1], actual[1]), axis=1) * 1e6
    np.testing.assert_allclose(scene.turn_urad["uncorrected"], turn, atol=1e-3)


def charts_are_those_of(page: Page, motion: JointRetiming, machine: Path) -> None:
    """The axes of the charts go as the planned motion, in mm and deg, and reach what it reaches."""
    shown, stated = page.manifest["motion"], tomllib.loads(machine.read_text("utf-8"))["axes"]
    assert [axis["name"] for axis in shown["axes"]] == list(motion.structure.order)
    time = np.array(page.array(shown["time"]))
    at = motion.at(0, np.clip(time, 0.0, motion.duration_s))
    for column, axis in enumerate(shown["axes"]):
        unit = motion.structure.units[column]
        assert axis["unit"] == unit
        for key, power in (("velocity", "s"), ("acceleration", "s2"), ("jerk", "s3")):
            limit = stated[axis["name"]][f"{key}_{unit}_{power}"]
            assert axis[f"{key}_limit"] == limit
            assert np.abs(page.array(axis[key])).max() <= limit * (1.0 + 1e-3)
        most = np.abs(motion.at(0, np.arange(0.0, motion.duration_s, 1e-2))[1][:, column]).max()
        assert np.abs(page.array(axis["velocity"])).max() >= most * (1.0 - 1e-3) - 1e-3
        np.testing.assert_allclose(page.array(axis["position"]), at[0][:, column], atol=2e-2 + 1e-4 * most)
    line = np.array(page.array(shown["line"]))
    assert (np.diff(line) >= 0).all() and np.array(page.array(shown["speed"])).max() > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(JOINT_JOBS, ("trunnion-mill",)))
def test_times_are_those_of_the_planned_motion(name: str, reviews: dict[str, Review]) -> None:
    """Where the motion is at the times of the samples, the tip is beside them."""
    file = FOLDER / name / JOINT_JOBS[name]
    machine, scene = file.with_name("machine.toml"), reviews[name].scene
    corrected = olp.correct_joints(file, machine, file.with_name("job.toml")).data
    motion = olp.retime_joints(corrected, machine, file.with_name("job.toml"))
    assert scene.planned and scene.duration_s == pytest.approx(motion.duration_s, abs=1e-6)
    assert (np.diff(scene.time_s) >= 0.0).all() and Page(reviews[name].html()).manifest[
        "time_source"
    ] == "retimed"
    (stretch,) = motion.stretches
    axes = motion.at(0, np.clip(scene.time_s, 0.0, stretch.trajectory.duration_s))[0]
    kinematics = olp.load_kinematics(machine)
    tip = kinematics.nominal(axes).position - scene.frame.origin_mm
    away = np.linalg.norm(tip - scene.position_mm, axis=1)
    # corrections, rounded corners; along rapids the tip does not go evenly
    cuts = scene.table.judged[scene.samples.move]
    assert np.median(away[cuts]) < 0.6 and away[cuts].max() < 1.5
    assert away[scene.samples.joined].max() < 0.05 * np.ptp(scene.position_mm, axis=0).max() + 1.5
    charts_are_those_of(Page(reviews[name].html()), motion, machine)
    feed = olp.view_joints(file, machine, file.with_name("job.toml"), time=False).scene
    assert feed.motion is None and not feed.planned and feed.duration_s != scene.duration_s


@pytest.mark.slow
def test_a_program_that_is_off_is_shown_as_such() -> None:
    file = FOLDER / "trunnion-mill" / "dome.nc"
    machine = file.with_name("machine.toml")
    right = olp.correct_joints(file, machine)
    wrong = right.data.replace(b"X12.021 F700", b"X12.071 F700")
    assert wrong != right.data
    review = olp.view_joints(file, machine, corrected=wrong)
    assert Page(review.html()).manifest["verdict"]["ok"] is False
    assert review.scene.table.over.any()
    with pytest.raises(ProgramError, match="fewer than"):
        olp.view_joints(file, machine, corrected=right.data[:200] + b"M30\n")


@pytest.mark.slow
def test_meshes_of_the_job_lie_on_the_workpiece(tmp_path: Path) -> None:
    (tmp_path / "block.obj").write_text("v 0 0 0\nv 20 0 0\nv 0 30 0\nf 1 2 3\n")
    mesh = '\n[[meshes]]\nfile = "block.obj"\nrole = "workpiece"\nframe = "{}"\n'
    for name, frame, low in (("trunnion-mill", "G54", 0.0), ("arm-payload", "machine", 0.0)):
        file = FOLDER / name / JOINT_JOBS[name]
        text = file.with_name("job.toml").read_text("utf-8").partition("[[meshes]]")[0]
        text = text.replace("machine.toml", str(file.with_name("machine.toml"))).replace(file.name, str(file))
        job = tmp_path / f"{name}.toml"
        job.write_text(text + mesh.format(frame), "utf-8")
        scene = olp.view_joints(file, file.with_name("machine.toml"), job, time=False).scene
        (block,) = [body for body in scene.bodies if body.role == "workpiece"]
        np.testing.assert_allclose(block.vertices.min(axis=0), low, atol=1e-9)
        other = olp.view_joints(file, file.with_name("machine.toml"), time=False).scene
        assert other.digest != scene.digest
    job.write_text(text + mesh.format("G54"), "utf-8")
    with pytest.raises(ConfigError, match='expected frame = "machine"'):
        olp.view_joints(file, file.with_name("machine.toml"), job, time=False)


@pytest.mark.slow
def test_the_verbs_write_it(tmp_path: Path) -> None:
    job = str(FOLDER / "gantry-wrist" / "job.toml")
    out, page, again = (str(tmp_path / name) for name in ("out.mpf", "a.html", "b.html"))
    done = run("correct", "-j", job, "-o", out, "--review", page, "-q")
    assert done.exit_code == 0, done.stderr
    done = run("view", "-j", job, "--corrected", out, "-o", again)
    assert done.exit_code == 0 and "points" in done.stderr, done.stderr
    one, other = (Page(Path(name).read_bytes()).manifest for name in (page, again))
    assert one["statistics"] == other["statistics"] and one["digest"] == other["digest"]
    done = run("view", "-j", job, "--measured", "x.csv", "-o", again, "--force")
    assert done.exit_code == 3 and "x.csv: no such file" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["trunnion-mill", "hexapod"])
def test_the_machine_moves_in_the_browser(
    name: str, reviews: dict[str, Review], chromium: Any, tmp_path: Path
) -> None:
    file = tmp_path / "page.html"
    reviews[name].write(file)
    scene = reviews[name].scene
    path = ["olp", *scene.nodes[-1].path]
    place = f"olp.app.scene.viewer.scene_tree.find({path}).object"
    (tool,) = [body for body in scene.bodies if body.role == "tool"]
    with browser.opened(chromium, file) as page:
        # axes in mm and in deg have lanes of their own, and so has each of more than three
        page.select_option("#motion", "velocity")
        lanes = page.evaluate("olp.app.plots.movement.lanes.map(l => [l.title, l.series.length, l.unit])")
        if name == "trunnion-mill":
            assert lanes == [["X, Y, Z in mm/s", 3, "mm/s"], ["A, C in °/s", 2, "°/s"]]
        else:
            assert lanes == [[f"L{k}", 1, "mm/s"] for k in range(1, 7)]
        origin = np.array(Page(reviews[name].html()).manifest["origin_mm"])
        zero = page.evaluate("olp.app.scene.viewer.scene_tree.find(['olp']).object.matrixWorld.elements")
        for share in (0.0, 0.31, 0.77):
            page.evaluate(f"olp.set_time({share} * olp.app.end)")
            page.wait_for_timeout(200)
            columns = page.evaluate(f"({place}.updateWorldMatrix(true), {place}.matrixWorld.elements)")
            world = np.linalg.inv(np.array(zero).reshape(4, 4).T) @ np.array(columns).reshape(4, 4).T
            ends = tool.vertices[
                np.linalg.norm(tool.vertices - tool.vertices.mean(axis=0), axis=1).argsort()[:2]
            ]
            seen = [(world @ np.append(end - origin, 1.0))[:3] + origin for end in ends]
            at = np.array([np.interp(share * scene.time_s[-1], scene.time_s, c) for c in scene.position_mm.T])
            assert min(np.linalg.norm(one - at) for one in seen) < 0.3


def test_measured_runs_are_shown_where_they_were_measured(tmp_path: Path) -> None:
    """Tips of a run, 8 um off along Z from half of it on; positions by an own forward."""
    machine = FOLDER / "trunnion-mill" / "machine.toml"
    text = b"G21 G90 G17 G94 G54 G49\nG0 X0. Y0. Z150. A0. C0.\nG1 X9. A-9. C20. F900\nX-9. C40.\nM30\n"
    ends = np.array([[0, 0, 10, 0, 0], [9, 0, 10, -9, 20], [-9, 0, 10, -9, 40]], float)
    axes = np.vstack([a + np.linspace(0.0, 1.0, 21)[:, None] * (b - a) for a, b in pairwise(ends)])
    tips = Judge(machine).forward(axes, False)[0]
    off = np.where(np.arange(len(tips)) < 21, 0.0, 0.008)
    rows = "".join(f"{x:.6f},{y:.6f},{z:.6f}\n" for x, y, z in tips + off[:, None] * [0.0, 0.0, 1.0])
    (tmp_path / "run.csv").write_text("# frame=workpiece\nx_mm,y_mm,z_mm\n" + rows)
    page = olp.view_joints(text, machine, measured=[tmp_path / "run.csv"], part_tolerance_um=5.0, time=False)
    verdict = page.scene.report["verdict"]
    assert {one["name"]: one["ok"] for one in verdict["questions"]} == {
        "program": True,
        "part": True,
        "measured": False,
    }
    assert verdict["ok"] is False
    (shown,) = page.scene.measured
    origin = np.array(page.scene.frame.origin_mm)
    assert shown.base_mm + shown.delta_mm + origin == pytest.approx(tips + off[:, None] * [0, 0, 1], abs=2e-6)
    assert np.linalg.norm(shown.delta_mm, axis=1).max() == pytest.approx(0.008, abs=2e-4)
    # the sample next to a point is near it
    beside = page.scene.position_mm[shown.index]
    assert np.linalg.norm(beside - shown.base_mm, axis=1).max() < 1.5
    stated = page.scene.table.measured.by_line()
    assert stated["line"].tolist() == [3, 4] and stated["measured_um"][1] == pytest.approx(8.0, abs=0.2)
