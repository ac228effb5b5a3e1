"""An artefact that the machine touches with its own probe: programs, their logs, what `fit` makes of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from judge import linuxcnc, simulated, touching
from judge.dmis import read_points

from olp.calibration.observations.artefact import Artefact
from olp.calibration.observations.lines import Line
from olp.cli import main
from olp.core.errors import CannotCompute, ConfigError, UsageError
from olp.core.rigid_fit import rotation_of
from olp.files.config import load_setup
from olp.files.measurements.reader import load_measurements
from olp.program.registry import find, read
from olp.workflows.calibrate_fit import fit_calibration
from olp.workflows.calibrate_probe import ProbedArtefact, probe_artefact

GANTRY = Path(__file__).resolve().parents[2] / "programs" / "gantry-lines" / "machine.toml"
BOX = ((0.0, 1600.0), (0.0, 1000.0), (-450.0, 0.0))
TOOL = np.array((0.0, 0.0, -150.0))
#: the effective radius of the tip: 10 um less than half of 6 mm
RADIUS = 2.990

HEAD = """schema = "olp-artefact-1"
name = "artefact"
tool_mm = [0.0, 0.0, -150.0]
tip_diameter_mm = 6.0
sigma_touch_um = 0.5
"""
PLATE = """
[[features]]
name = "A"
kind = "sphere"
place_mm = [0.0, 0.0, 0.0]
diameter_mm = 25.0
count = 3
step_mm = [130.0, 0.0, 0.0]
[[features]]
name = "B"
kind = "sphere"
place_mm = [0.0, 150.0, 0.0]
diameter_mm = 25.0
sigma_um = 0.2
[[features]]
name = "H"
kind = "hole"
place_mm = [130.0, 150.0, -12.0]
diameter_mm = 30.0
depth_mm = 4.0
count = 2
step_mm = [130.0, 0.0, 0.0]
sigma_um = 0.2
"""
POSES = """
[[poses]]
origin_mm = [300.0, 200.0, -480.0]
[[poses]]
origin_mm = [900.0, 300.0, -480.0]
turn_deg = [0.0, 0.0, 90.0]
[[poses]]
origin_mm = [1100.0, 600.0, -480.0]
turn_deg = [0.0, 0.0, 180.0]
"""
POSE = "\n[[poses]]\norigin_mm = [300.0, 200.0, -480.0]\n"
BAR = """
[[features]]
name = "B"
kind = "sphere"
place_mm = [0.0, 0.0, 0.0]
diameter_mm = 25.0
count = 2
step_mm = [300.0, 0.0, 0.0]
sigma_um = 0.2
"""
BLOCK = """
[[features]]
name = "low"
kind = "face"
place_mm = [0.0, 0.0, 0.0]
direction = [-1.0, 0.0, 0.0]
sigma_um = 0.1
[[features]]
name = "high"
kind = "face"
place_mm = [300.0, 0.0, 0.0]
direction = [1.0, 0.0, 0.0]
sigma_um = 0.1
"""
EDGE = """
[[features]]
name = "E"
kind = "face"
place_mm = [0.0, 0.0, 0.0]
direction = [0.0, -1.0, 0.0]
count = 9
step_mm = [100.0, 0.0, 0.0]
"""
EDGE_POSES = POSE + POSE.replace("-480.0]", "-480.0]\nturn_deg = [180.0, 0.0, 0.0]\nturned_over = true")


class Bench:
    """A machine with errors, and an artefact that lies on it a little otherwise than stated."""

    def __init__(self, folder: Path, text: str, size: float = 0.3, controller: str = "linuxcnc") -> None:
        self.folder = folder
        self.artefact = folder / "artefact.toml"
        self.artefact.write_text(text, "utf-8")
        self.machine = folder / "machine.toml"
        stated = GANTRY.read_text("utf-8").replace('"linuxcnc"', f'"{controller}"')
        self.machine.write_text(re.sub(r"(?m)^calibration = .*\n", "", stated), "utf-8")
        self.errors = simulated.machine(3, "smooth", "FXYZ", BOX, size=size)
        self.probed = probe_artefact(self.artefact, self.machine)
        rng = np.random.default_rng(5)
        features = self.probed.probing.features
        self.balls = np.array([f.place_mm for f in features], float)
        drawn = np.array([f.kind == "sphere" and not f.sigma_mm for f in features])
        self.balls[drawn] += rng.normal(0.0, 0.05, (int(drawn.sum()), 3))
        self.frames: list[tuple[np.ndarray, np.ndarray]] = []
        for pose in self.probed.probing.poses:
            turn = rotation_of(0.002 * rng.normal(size=3)) @ pose.frame.rotation
            self.frames.append((turn, pose.frame.shift_mm + rng.normal(0.0, 0.5, 3)))

    def error(self, axis_mm: np.ndarray, way: np.ndarray) -> np.ndarray:
        return np.asarray(self.errors.error(axis_mm, TOOL, np.sign(np.round(way, 9))))

    def surfaces(self, pose: int, form: Callable[[float], float]) -> list[touching.Surface]:
        turn, shift = self.frames[pose]
        found = []
        for feature, ball in zip(self.probed.probing.features, self.balls, strict=True):
            out = turn @ np.array(feature.direction)
            place = turn @ ball + shift + form(ball[0]) * out
            size = feature.diameter_mm
            found.append({
                "sphere": lambda n, p=place, d=size: touching.sphere(n, p, d, RADIUS),
                "hole": lambda n, p=place, d=size, o=out: touching.hole(n, p, d, o, RADIUS),
                "face": lambda n, p=place, o=out: touching.face(n, p, o, RADIUS),
            }[feature.kind](feature.name))  # fmt: skip
        return found

    def logs(self, sigma_um: float = 0.0, form: Callable[[float], float] = lambda x: 0.0) -> list[Path]:
        """The programs run, and their logs."""
        written = self.probed.files(self.folder)
        logs = []
        for k, data in enumerate(written.values()):
            touched = touching.touch(
                data.decode(), self.surfaces(k, form), TOOL.tolist(), self.error, sigma_um * 1e-3, k
            )
            logs.append(self.folder / f"touches-{k + 1}.csv")
            logs[-1].write_text(touching.log(touched), "utf-8")
        return logs

    def read(self, logs: Sequence[Path]) -> ProbedArtefact:
        return probe_artefact(self.artefact, self.machine, logs=logs)

    def source(self, probed: ProbedArtefact) -> Path:
        folder = self.folder / "source"
        folder.mkdir()
        for name, data in probed.files(folder).items():
            name.write_bytes(data)
        return folder


def test_centres_are_where_the_machine_stands_on_them(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + PLATE + POSES)
    probed = bench.read(bench.logs())
    touched = probed.touched
    assert touched is not None and len(touched.place_mm) == 18
    axis = touched.place_mm - TOOL
    truth = np.array(
        [bench.frames[p][0] @ bench.balls[f] + bench.frames[p][1]
         for p, f in zip(touched.pose, touched.feature, strict=True)]
    )  # fmt: skip
    off = axis + bench.errors.error(axis, TOOL) + TOOL - truth
    # heights are read from above alone: backlash, and the scale over the height of the touch, by kind
    for kind in ("sphere", "hole"):
        own = [bench.probed.probing.features[f].kind == kind for f in touched.feature]
        off[own, 2] -= off[own, 2].mean()
    assert np.abs(off).max() < 0.5e-3
    # backlash makes balls look smaller along its axis; the scale of the machine over a ball is left
    half = [-bench.errors.half[f"E{a}{a}"] for a in "XY"]
    assert touched.radius_mm == pytest.approx(np.array([RADIUS, RADIUS]) - half, abs=5e-4)
    assert np.abs(touched.residual_mm).max() < 2e-3


def test_centres_scatter_as_stated(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + "sphere_touches = 9\n" + PLATE + POSES, size=0.0)
    clean = bench.read(bench.logs()).touched
    noisy = bench.read(bench.logs(0.5)).touched
    assert clean is not None and noisy is not None
    off = noisy.place_mm - clean.place_mm
    chi_square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(noisy.covariance_mm2), off).mean() / 3.0
    assert 0.6 < chi_square < 1.5


@pytest.mark.slow
def test_a_plate_touched_in_three_poses_is_a_source_of_fit(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + PLATE + POSES)
    source = bench.source(bench.read(bench.logs(0.5)))
    (plate,) = load_measurements([source]).of(Artefact)
    assert plate.covariance_mm2 is not None and len(plate.axis_mm) == 18
    fitted = fit_calibration([source], machine=bench.machine)
    (row,) = fitted.report["sets_of_points"]
    assert row["residual_um"] < 1.0 and 0.01 < row["chi_square_per_coordinate"] < 1.5


@pytest.mark.slow
def test_a_ball_bar_shows_the_scale_of_an_axis(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BAR + POSE)
    source = bench.source(bench.read(bench.logs()))
    fitted = fit_calibration([source], machine=bench.machine)
    (row,) = fitted.report["sets_of_points"]
    assert row["points"] == 2 and row["residual_um"] < 0.5


def test_a_block_shows_the_positioning_between_its_faces(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BLOCK + POSE)
    (line,) = load_measurements([bench.source(bench.read(bench.logs()))]).of(Line)
    assert (line.component, line.direction.tolist()) == ("EXX", [1, -1])
    axis = np.tile([0.0, *line.line_mm[1:]], (2, 1))
    axis[:, 0] = line.target_mm
    wanted = bench.error(axis, np.outer(line.direction, [1.0, 0.0, 0.0]))[:, 0]
    # both faces err by the travel of the probe, in opposite senses
    assert np.diff(line.value)[0] == pytest.approx(np.diff(wanted)[0] + 2.0 * (3.0 - RADIUS), abs=2e-3)


def test_a_straightedge_and_its_form_come_apart_by_turning_it_over(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + EDGE + EDGE_POSES)
    form = lambda x: 0.02 * np.sin(x / 130.0)  # noqa: E731
    source = bench.source(bench.read(bench.logs(0.0, form)))
    direct, turned = load_measurements([source]).of(Line)
    assert (direct.component, direct.turned, turned.turned) == ("EYX", False, True)

    def bent(values: np.ndarray) -> np.ndarray:
        q = direct.target_mm
        return np.asarray(values - np.polyval(np.polyfit(q, values, 1), q))

    axis = np.tile([0.0, *direct.line_mm[1:]], (9, 1))
    axis[:, 0] = direct.target_mm
    truth = bent(bench.error(axis, np.zeros((9, 3)))[:, 1])
    assert bent(0.5 * (direct.value + turned.value)) == pytest.approx(truth, abs=1.5e-3)
    assert np.abs(bent(0.5 * (direct.value - turned.value))).max() > 0.01


# -- programs --------------------------------------------------------------------------------------------


def test_linuxcnc_runs_the_program_as_planned(tmp_path: Path) -> None:
    linuxcnc.require()
    bench = Bench(tmp_path, HEAD + PLATE + POSES)
    for k, data in enumerate(bench.probed.files(tmp_path).values()):
        run = linuxcnc.interpret(data)
        planned = touching.moves(data.decode())
        probes = run.axis[run.kind == linuxcnc.PROBE]
        assert probes == pytest.approx(np.array([end for _, _, end in planned]), abs=1e-9), k
        assert run.length[run.kind == linuxcnc.PROBE].any() == np.False_
        # the tip goes sideways above everything only
        sideways = np.abs(np.diff(run.axis[:, :2], axis=0)).max(axis=1) > 0.0
        rapid = (run.kind[1:] == linuxcnc.RAPID) & (run.kind[:-1] != linuxcnc.PROBE)
        assert (run.axis[1:][sideways & rapid][:, 2] >= run.axis[:, 2].max() - 1e-9).all()


@pytest.mark.parametrize("controller", ["grbl", "linuxcnc"])
def test_the_program_reads_back_as_its_touches(controller: str, tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + PLATE + POSE, controller=controller)
    (data,) = bench.probed.files(tmp_path).values()
    offset = {"grbl": "G59", "linuxcnc": "G59.3"}[controller]
    first = data.decode().splitlines()[0]
    assert first == f"(Sets work offset {offset} to zero and ends G92: what they held is lost.)"
    dialect = find(controller)
    assert dialect is not None
    path = read(data, load_setup(bench.machine), dialect).toolpath
    ends = [end for _, _, end in touching.moves(data.decode())]
    known = path.end_mm[np.isfinite(path.end_mm).all(axis=1)]
    assert all(np.abs(known - end).max(axis=1).min() < 1e-9 for end in ends)


def test_the_console_of_grbl_is_read(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BAR + POSE)
    (first,) = bench.logs()
    rows = [row.split(",")[1:] for row in first.read_text("utf-8").splitlines()[1:]]
    console = tmp_path / "console.txt"
    console.write_text("".join(f"ok\n[PRB:{','.join(row)}:1]\n" for row in rows), "utf-8")
    by_name, by_order = bench.read([first]).touched, bench.read([console]).touched
    assert by_name is not None and by_order is not None
    assert by_name.place_mm.tolist() == by_order.place_mm.tolist()
    console.write_text(console.read_text("utf-8").replace(":1]", ":0]", 1), "utf-8")
    with pytest.raises(ConfigError, match="line 2: the probe did not answer"):
        bench.read([console])


def test_dmis_states_the_same_touches_and_its_results_are_read(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BAR + POSE)
    (log,) = bench.logs()
    other = Bench(tmp_path, HEAD + BAR + POSE, controller="dmis")
    ((name, data),) = other.probed.files(tmp_path).items()
    assert name.suffix == ".dmi"
    points = read_points(data)
    # GOTO counts for the centre of the tip, PTMEAS for the surface
    contact = other.probed.touches[0].contact_mm + TOOL
    assert all(np.linalg.norm(points - one, axis=1).min() == pytest.approx(3.0, abs=1e-3) for one in contact)
    rows = [row.split(",") for row in log.read_text("utf-8").splitlines()[1:]]
    normals = {m[1]: np.array([float(v) for v in m[2].split(",")[3:]])
               for m in re.finditer(r"F\((\w[^)]*)\)=FEAT/POINT,CART,([^\n]*)", data.decode())}  # fmt: skip
    results = ["UNITS/MM,ANGDEC"]
    for label, *place in rows:
        surface = np.array([float(v) for v in place]) + TOOL - 3.0 * normals[label]
        numbers = ",".join(f"{v:.6f}" for v in (*surface, *normals[label]))
        results.append(f"FA({label})=FEAT/POINT,CART,{numbers}")
    output = tmp_path / "results.dmo"
    output.write_text("\n".join(results) + "\n", "utf-8")
    by_list, by_dmis = bench.read([log]).touched, other.read([output]).touched
    assert by_list is not None and by_dmis is not None
    assert by_list.place_mm == pytest.approx(by_dmis.place_mm, abs=2e-6)


# -- refusals --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("old", "new", "words"), [
    ("origin_mm = [300.0, 200.0,", "origin_mm = [5.0, 200.0,", "P1_A-1_3: X would have to go to -15.5"),
    ("-480.0]", "-180.0]", "Z would have to go to 5.500"),
    ("step_mm = [130.0, 0.0, 0.0]", "step_mm = [30.0, 0.0, 0.0]", "P1_A-1_1: A-2 is in the way"),
    ("-480.0]", "-480.0]\nturn_deg = [90.0, 0.0, 0.0]", "the hole does not open upwards"),
    ("tip_diameter_mm = 6.0", "tip_diameter_mm = 21.0", "leaves no room for the tip"),
    ("approach_mm = 5.0", "approach_mm = 13.0", "goes beyond the middle of a sphere"),
    ('name = "B"', 'name = "B (1)"', "expected a letter, then letters"),
    ("depth_mm = 4.0", "", r"features\[2\] depth_mm is missing"),
    ('name = "B"', 'name = "A-2"', 'feature "A-2" is stated twice'),
])  # fmt: skip
def test_what_cannot_be_touched_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    text = HEAD + "approach_mm = 5.0\n" + PLATE + POSE
    with pytest.raises(ConfigError, match=words):
        Bench(tmp_path, text.replace(old, new, 1) if old != "-480.0]" else text.replace(old, new))


@pytest.mark.parametrize(("old", "new", "words"), [
    ("P1_B-1_2,", "P1_B-2_1,", 'touch 2 is "P1_B-2_1"; expected "P1_B-1_2"'),
    ("P1_B-2_5,", "# ", "P1_B-2_5 is missing"),
])  # fmt: skip
def test_the_log_of_another_program_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BAR + POSE)
    (log,) = bench.logs()
    log.write_text(log.read_text("utf-8").replace(old, new), "utf-8")
    with pytest.raises(ConfigError, match=words):
        bench.read([log])


@pytest.mark.parametrize(("place", "words"), [
    ("310.500,200.000,-330.000", "at the end of its way: nothing was touched"),
    ("312.000,200.100,-330.000", "0.1 mm beside its way"),
    ("320.500,200.000,-330.000", "touched where it began"),
])  # fmt: skip
def test_a_touch_that_is_none_is_refused(place: str, words: str, tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BAR + POSE)
    (log,) = bench.logs()
    rows = log.read_text("utf-8").splitlines()
    rows[1] = f"P1_B-1_1,{place}"
    log.write_text("\n".join(rows) + "\n", "utf-8")
    with pytest.raises(ConfigError, match=f"line 2: P1_B-1_1 .*{words}"):
        bench.read([log])


def test_a_ball_of_another_size_is_told(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + PLATE + POSE)
    logs = bench.logs()
    text = bench.artefact.read_text("utf-8").replace('name = "B"', 'name = "B"')
    bench.artefact.write_text(
        text.replace("diameter_mm = 25.0\nsigma", "diameter_mm = 25.06\nsigma"), "utf-8"
    )
    (finding,) = bench.read(logs).findings
    assert finding.code == "OLP861" and "most at P1_B_" in finding.message


def test_faces_that_are_on_no_line_and_controls_without_a_probe(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BLOCK.replace("[300.0, 0.0", "[300.0, 90.0") + POSE)
    probed = bench.read(bench.logs())
    with pytest.raises(CannotCompute, match="not on a line along an axis"):
        probed.files(tmp_path)
    other = Bench(tmp_path, HEAD + BAR + POSE, controller="heidenhain")
    with pytest.raises(CannotCompute, match="no programs of touches are written for"):
        other.probed.files(tmp_path)
    with pytest.raises(UsageError, match="2 logs of touches; expected 1"):
        bench.read([tmp_path / "a", tmp_path / "b"])


def test_the_command_writes_and_reads(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HEAD + BAR + POSE)
    out = tmp_path / "out"
    out.mkdir()
    words = ["calibrate", "probe", str(bench.artefact), "-m", str(bench.machine), "-o", str(out)]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0 and "wrote 1 files" in done.stderr
    assert [path.name for path in out.iterdir()] == ["probe-1.ngc"]
    (log,) = bench.logs()
    done = CliRunner().invoke(main, [*words, "--touches", str(log), "--date", "2026-11-27"])
    assert done.exit_code == 0 and "Effective radius" in done.stdout
    assert "measured = 2026-11-27" in (out / "measurements.toml").read_text("utf-8")
