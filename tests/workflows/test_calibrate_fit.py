"""`olp calibrate fit` from files: plans, files that describe themselves, refusals, the shipped example."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from judge import simulated
from judge.model import JudgeModel

import olp
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points
from olp.cli import main
from olp.core.errors import CannotCompute, ConfigError
from olp.files.measurements.reader import files_of_measurements, load_measurements

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
PLAN = """schema = "olp-measurements-1"
machine = "m"
measured = 2026-05-14
temperature_degC = 20.0
[defaults]
sense = "actual-minus-commanded"
tool_mm = [0.0, 0.0, -120.0]
line_mm = { X = 1500.0, Y = 700.0, Z = -600.0 }
"""
LENGTHS = "target_mm,run,direction,value_um\n0,1,1,0\n100,1,1,2.5\n0,2,1,0.5\n100,2,1,3.5\n"
ANGLES = LENGTHS.replace("um", "urad")


def planned(folder: Path, text: str, **files: str) -> Path:
    for name, data in files.items():
        (folder / f"{name}.csv").write_text(data)
    plan = folder / "measurements.toml"
    plan.write_text(PLAN + text)
    return plan


def line(file: str, component: str, more: str = "") -> str:
    return f'[[lines]]\nfile = "{file}.csv"\ncomponent = "{component}"\n{more}\n'


# -- a laser file and a ball-bar -------------------------------------------------------------------------


def circle_at_one_height(folder: Path, sigma: str = "# sigma_um = 0.3\n") -> Path:
    """A mill with positioning of X and a circle in XY at one Z: Y leans by 40 urad to -X."""
    wave = np.random.default_rng(4)
    rows = [f"{x},{run},{side},{0.03 * x + wave.normal(0.0, 0.3):.3f}"
            for run in (1, 2) for side in (1, -1) for x in range(-700, 1, 70)[::side]]  # fmt: skip
    turns = [(angle, side) for side in (1, -1) for angle in range(0, 360, 5)[::side]]
    places = {
        angle: (150.0 * np.cos(np.radians(angle)), 150.0 * np.sin(np.radians(angle))) for angle, _ in turns
    }
    radial = {a: (0.03 * x - 0.04 * y) * np.cos(np.radians(a)) for a, (x, y) in places.items()}
    circle = [f"{a},1,{side},{radial[a] + wave.normal(0.0, 0.2):.3f}" for a, side in turns]
    places_of = "# centre_mm = [-350.0, -200.0, -300.0]\n# tool_mm = [0, 0, -120]\n"
    head = f"# plane = XY\n# radius_mm = 150.0\n{places_of}"
    laser = line("exx", "EXX", "line_mm = { Y = -200.0, Z = -300.0 }")
    return planned(
        folder, f'{laser}[[ballbars]]\nfile = "circle.csv"\n',
        exx="\n".join(("target_mm,run,direction,value_um", *rows)),
        circle=head + sigma + "\n".join(("angle_deg,run,direction,deviation_um", *circle)),
    )  # fmt: skip


def mill_of(folder: Path) -> Path:
    travel = ["--travel", "X", "-700", "0", "--travel", "Y", "-400", "0", "--travel", "Z", "-500", "0"]
    result = CliRunner().invoke(
        main, ["init", str(folder / "m"), "--controller", "fanuc", "--chain", "XYFZ", *travel]
    )
    assert result.exit_code == 0, result.output
    return folder / "m" / "machine.toml"


@pytest.mark.slow
def test_a_laser_file_and_one_circle_make_a_calibration_that_corrects(tmp_path: Path) -> None:
    machine = mill_of(tmp_path)
    fitted = olp.fit_calibration(circle_at_one_height(tmp_path), machine)
    assert fitted.calibration.box_mm[2].tolist() == [-500.0, 0.0], "a circle at one Z tells nothing along Z"
    middle = next(row["mid_box_value_urad"] for row in fitted.report["squareness"] if row["name"] == "C0Y")
    assert middle == pytest.approx(40.0, abs=4.0)
    fitted.write(machine.parent / "calibration.toml", force=True)
    done = olp.correct(machine.parent / "first.nc", machine)
    codes = {finding.code for finding in done.findings}
    assert done.report["deviation"]["path_max_um"] < 1.0
    assert "OLP466" not in codes, "zeros of a fit are what it did not observe"


def test_a_circle_without_uncertainty_says_how_to_state_it(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"circle\.csv: circle XY: .* add a comment such as # sigma_um = 0\.2"
    ):
        olp.fit_calibration(circle_at_one_height(tmp_path, ""), mill_of(tmp_path))


def test_a_profile_that_is_missing_is_named_and_not_the_readings(tmp_path: Path) -> None:
    plan = planned(tmp_path, 'profile = "laser.toml"\n' + line("exx", "EXX"), exx=LENGTHS)
    with pytest.raises(ConfigError, match=r"lines\[0\]: .*laser\.toml: no such file") as caught:
        load_measurements([plan])
    assert "exx.csv" not in str(caught.value)
    assert str(tmp_path / "laser.toml") in files_of_measurements([plan])


# -- plans -----------------------------------------------------------------------------------------------


def test_a_plan_says_how_each_line_was_taken(tmp_path: Path) -> None:
    text = line("exx", "EXX", "sigma_scale_um_m = 0.5\nline_mm = { Y = 100.0 }") + line("eax", "EAX")
    plan = planned(tmp_path, text, exx=LENGTHS, eax=ANGLES)
    measurements = load_measurements([tmp_path])
    assert (measurements.machine, str(measurements.measured)) == ("m", "2026-05-14")
    assert measurements.temperature_degC == 20.0
    first, second = measurements.lines
    assert first.line_mm == (1500.0, 100.0, -600.0)
    assert first.tool_mm == (0.0, 0.0, -120.0)
    assert first.sigma_scale == 5e-7
    assert first.value == pytest.approx([0.0, 0.0025, 0.0005, 0.0035])
    assert second.value == pytest.approx([0.0, 2.5e-6, 0.5e-6, 3.5e-6])
    assert first.row.tolist() == [2, 3, 4, 5]
    names = {Path(name).name for name in files_of_measurements([tmp_path])}
    assert names == {"measurements.toml", "exx.csv", "eax.csv"}
    assert load_measurements([plan]).lines[0].value == pytest.approx(first.value)


@pytest.mark.parametrize(
    ("sense", "factor"),
    [
        ("actual-minus-commanded", 1),
        ("commanded-minus-actual", -1),
        ("table-motion actual-minus-commanded", -1),
        ("table-motion commanded-minus-actual", 1),
    ],
)
def test_every_sense_becomes_that_of_the_contract(tmp_path: Path, sense: str, factor: int) -> None:
    planned(tmp_path, line("exx", "EXX", f'sense = "{sense}"'), exx=LENGTHS)
    (line_read,) = load_measurements([tmp_path], "XFYZ").lines
    assert line_read.value == pytest.approx(factor * np.array([0.0, 2.5, 0.5, 3.5]) * 1e-3)


@pytest.mark.slow
def test_a_folder_without_a_plan_says_which_files_it_left_out(tmp_path: Path) -> None:
    head = (
        '# component = "EXX"\n# machine = "m"\n# measured = 2026-05-14\n# temperature_degC = 20.0\n'
        '# sense = "actual-minus-commanded"\n# line_mm = { Y = 0.0, Z = 0.0 }\n# tool_mm = [0, 0, 0]\n'
    )
    rows = [f"{10 * k - 300},{run},1,{0.1 * k + 0.01 * run}" for run in (1, 2) for k in range(11)]
    (tmp_path / "exx.csv").write_text("\n".join((head + "target_mm,run,direction,value_um", *rows)))
    (tmp_path / "laser-y.txt").write_text("0 1\n100 2\n")
    (tmp_path / "photo.jpg").write_bytes(b"\xff\xd8")
    machine = mill_of(tmp_path).with_name("mill.toml")
    text = machine.with_name("machine.toml").read_text()
    machine.write_text(re.sub(r'name = "[^"]*"', 'name = "m"', text, count=1))
    target = tmp_path / "calibration.toml"
    # the second time its own files lie there, too
    for _ in range(2):
        call = ["calibrate", "fit", str(tmp_path), "-m", str(machine), "-o", str(target), "--force"]
        done = CliRunner().invoke(main, [*call, "--fail-on", "error"])
        assert done.exit_code == 0, done.output
        assert f"not read: {tmp_path / 'laser-y.txt'}" in target.read_text().replace("\n# ", " ")
    assert "photo" not in target.read_text()


def test_files_that_describe_themselves(tmp_path: Path) -> None:
    head = (
        "# machine = m\n# measured = 2026-05-14\n# temperature_degC = 20.5\n# any other comment\n"
        '# component = "EYX"\n# line_mm = { Y = 1.0, Z = 2.0 }\n# tool_mm = [0, 0, -50]\n'
        "# sense = actual-minus-commanded\n# square = S\n# square_sigma_urad = 5\n# period_mm = [10.0]\n"
    )
    (tmp_path / "a.csv").write_text(head + LENGTHS)
    measurements = load_measurements([tmp_path])
    (one,) = measurements.lines
    assert (one.component, one.line_mm, one.tool_mm) == ("EYX", (0.0, 1.0, 2.0), (0.0, 0.0, -50.0))
    assert measurements.squares[0].sigma_rad == pytest.approx(5e-6)
    assert measurements.periods_mm == ((10.0,), (), ())
    assert one.row[0] == 13


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (line("exx", "EXX", 'sense = "laser"'), "line 12: lines[0].sense"),
        (line("ecz", "ECZ", 'instrument = "level"'), "vertical Z, which a level cannot measure"),
        (line("ecx", "ECX", 'instrument = "level"'), "vertical Z, which a level cannot measure"),
        (line("no", "EXX"), "no such file"),
        (line("ecz", "EXX"), "holds angles, but EXX is read in lengths"),
        (line("exx", "EXX", 'square = "S"'), "square is for straightness only"),
        (line("exx", "EYX", 'square = "S"'), 'square "S" is not defined'),
        (line("exx", "EXX", "sigma_urad = 1.0"), "expected sigma_um"),
        (line("exx", "EXX", 'sense = "table-motion actual-minus-commanded"'), "moves the tool, not a table"),
        (line("exx", "EXX", 'reference = "table"'), "moves the tool, not a table"),
        (line("exx", "EXX", "tool = [0, 0, 0]"), "did you mean tool_mm"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_sentence(tmp_path: Path, text: str, words: str) -> None:
    planned(tmp_path, text, exx=LENGTHS, ecz=ANGLES, ecx=ANGLES)
    with pytest.raises(ConfigError) as caught:
        load_measurements([tmp_path], "FXYZ")
    assert words in str(caught.value)


def test_nothing_is_assumed_and_all_problems_come_at_once(tmp_path: Path) -> None:
    bare = PLAN.partition("[defaults]")[0]
    (tmp_path / "exx.csv").write_text(LENGTHS)
    (tmp_path / "eyx.csv").write_text(LENGTHS.replace("100,2,1,3.5", "100,2,0,x"))
    (tmp_path / "measurements.toml").write_text(bare + line("exx", "EXX") + line("eyx", "EYX"))
    with pytest.raises(ConfigError) as caught:
        load_measurements([tmp_path])
    text = str(caught.value)
    for words in ("sense is missing", "line_mm.Y, line_mm.Z is missing", "tool_mm is missing"):
        assert words in text
    assert "eyx.csv: line 5: direction = 0" in text
    assert 'line 5: value_um = "x"' in text


def test_plan_and_file_must_agree(tmp_path: Path) -> None:
    header = "# tool_mm = [0, 0, -80]\n"
    planned(tmp_path, line("exx", "EXX", "tool_mm = [0, 0, -90]"), exx=header + LENGTHS)
    with pytest.raises(ConfigError, match=r"exx.csv: line 1: tool_mm = .*but the plan says"):
        load_measurements([tmp_path])
    planned(tmp_path, line("exx", "EXX"), exx=header + LENGTHS)
    assert load_measurements([tmp_path]).lines[0].tool_mm == (0.0, 0.0, -80.0)


POINTS = "X_mm,Y_mm,Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm\n" + "".join(
    f"{x},{y},{z},{y + 7},{x - 3},{1 - z}\n" for x in (0, 500) for y in (0, 300) for z in (-100, 0)
)


def test_points_of_a_tracker(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("# a comment\n" + POINTS)
    planned(tmp_path, '[[points]]\nfile = "t.csv"\nsigma_um = 8.0\ntool_mm = [0, 0, -90]\n')
    (points,) = load_measurements([tmp_path]).of(Points)
    assert points.axis_mm.shape == points.measured_mm.shape == (8, 3)
    assert points.tool_mm[3].tolist() == [0.0, 0.0, -90.0]
    assert points.sigma == 0.008
    assert points.row.tolist() == list(range(3, 11))


def test_lengths_from_a_station(tmp_path: Path) -> None:
    rows = [f"{x},{y},{z},{1000 + x},{x / 10},0,-90\n" for x in (0, 500) for y in (0, 300) for z in (-100, 0)]
    head = "X_mm,Y_mm,Z_mm,length_mm,tool_X_mm,tool_Y_mm,tool_Z_mm\n"
    (tmp_path / "s.csv").write_text(head + "".join(rows))
    planned(tmp_path, '[[stations]]\nfile = "s.csv"\nsigma_um = 0.2\nsigma_um_m = 0.3\n')
    (lengths,) = load_measurements([tmp_path]).of(Lengths)
    assert lengths.length_mm[-1] == 1500.0
    assert lengths.sigma_mm[-1] == pytest.approx(0.2e-3 + 0.3e-6 * 1500.0)
    assert lengths.tool_mm[-1].tolist() == [50.0, 0.0, -90.0]


def test_directions_from_pods(tmp_path: Path) -> None:
    head = "X_mm,Y_mm,Z_mm,azimuth_1_deg,elevation_1_deg,azimuth_2_deg,elevation_2_deg\n"
    places = [(x, y, z) for x in (0, 500) for y in (0, 300) for z in (-100, 0)]
    rows = [f"{x},{y},{z},{10 + x / 100},1,{-20 + y / 100},2\n" for x, y, z in places]
    (tmp_path / "p.csv").write_text(head + "".join(rows))
    pods = '[[pods]]\nfile = "p.csv"\nsigma_urad = 10.0\n[[pods.baselines]]\nbetween = [1, {}]\n'
    pods += "length_mm = 4000.0\n"
    planned(tmp_path, pods.format(2) + "sigma_um = 10.0\n")
    (pods_read,) = load_measurements([tmp_path]).of(Pods)
    assert np.degrees(pods_read.azimuth_rad[-1]) == pytest.approx([15.0, -17.0])
    assert np.degrees(pods_read.elevation_rad[-1]) == pytest.approx([1.0, 2.0])
    assert pods_read.baselines == ((0, 1, 4000.0, 0.01),)
    planned(tmp_path, pods.format(3) + "sigma_um = 10.0\n")
    with pytest.raises(ConfigError, match="two of the pods 1 to 2"):
        load_measurements([tmp_path])


THEODOLITES = "X_mm,Y_mm,Z_mm,azimuth_1_deg,elevation_1_deg\n"
PLACES = np.array([(x, y, z) for x in (0, 700, 1500) for y in (0, 600, 900) for z in (-400, 0)], float)


def theodolite(folder: Path, keys: str, azimuth: float = 1.0, zenith: bool = False) -> None:
    """A plan of one theodolite, 900, 700 and 80 mm from zero, which counts as stated."""
    x, y, z = (PLACES - (-900.0, -700.0, 200.0)).T
    around = azimuth * np.degrees(np.arctan2(y, x))
    up = np.degrees(np.arctan2(z, np.hypot(x, y)))
    up = 90.0 - up if zenith else up
    rows = [
        f"{p[0]},{p[1]},{p[2]},{a!r},{b!r}\n"
        for p, a, b in zip(PLACES.tolist(), around.tolist(), up.tolist(), strict=True)
    ]
    (folder / "p.csv").write_text(THEODOLITES + "".join(rows))
    planned(folder, f'[[pods]]\nfile = "p.csv"\npods = 1\nsigma_urad = 10.0\n{keys}')


@pytest.mark.parametrize(
    ("keys", "azimuth", "zenith"),
    [
        ("", 1.0, False),
        ('azimuth = "clockwise"\n', -1.0, False),
        ('vertical = "zenith"\n', 1.0, True),
        ('azimuth = "clockwise"\nvertical = "zenith"\n', -1.0, True),
    ],
)
def test_theodolites_count_as_the_plan_states(
    tmp_path: Path, keys: str, azimuth: float, zenith: bool
) -> None:
    theodolite(tmp_path, "")
    (plain,) = load_measurements([tmp_path]).of(Pods)
    theodolite(tmp_path, keys, azimuth, zenith)
    (other,) = load_measurements([tmp_path]).of(Pods)
    assert np.allclose(other.azimuth_rad, plain.azimuth_rad, atol=1e-12)
    assert np.allclose(other.elevation_rad, plain.elevation_rad, atol=1e-12)
    assert np.allclose(other.start().poses[0].place_mm, (-900.0, -700.0, 80.0), atol=1e-3)


@pytest.mark.parametrize(
    ("azimuth", "zenith", "words"),
    [
        (-1.0, False, "azimuths counted the other way round;"),
        (1.0, True, "vertical angles counted from the other zero;"),
        (-1.0, True, "other way round and vertical angles counted from the other zero;"),
    ],
)
def test_another_convention_of_theodolites_is_asked_for(
    tmp_path: Path, azimuth: float, zenith: bool, words: str
) -> None:
    theodolite(tmp_path, "", azimuth, zenith)
    (pods,) = load_measurements([tmp_path]).of(Pods)
    with pytest.raises(CannotCompute) as caught:
        pods.start()
    assert words in str(caught.value) and "state azimuth" in str(caught.value)


def test_points_in_other_units_and_with_decimal_commas_are_the_same(tmp_path: Path) -> None:
    theodolite(tmp_path, "")
    (plain,) = load_measurements([tmp_path]).of(Pods)
    rows = [line.split(",") for line in (tmp_path / "p.csv").read_text().splitlines()[1:]]
    factors = (1 / 25.4, 1e-3, 1.0, 1 / 0.9, np.pi / 180.0)
    head = "X_inch;Y_m;Z_mm;azimuth_1_gon;elevation_1_rad\n"
    cells = [[repr(float(cell) * factor) for cell, factor in zip(row, factors, strict=True)] for row in rows]
    text = head + "".join(";".join(row) + "\n" for row in cells)
    for written in (text, text.replace(".", ",")):
        (tmp_path / "p.csv").write_text(written)
        (other,) = load_measurements([tmp_path]).of(Pods)
        assert np.allclose(other.axis_mm, plain.axis_mm, rtol=0, atol=1e-9)
        assert np.allclose(other.azimuth_rad, plain.azimuth_rad, rtol=0, atol=1e-12)
        assert np.allclose(other.elevation_rad, plain.elevation_rad, rtol=0, atol=1e-12)
    for wrong, words in (
        (text.replace(".", ",", 1), "with commas and with points"),
        (text.replace("Y_m", "X_mm"), 'repeats "X_mm"'),
    ):
        (tmp_path / "p.csv").write_text(wrong)
        with pytest.raises(ConfigError, match=words):
            load_measurements([tmp_path])


def test_files_of_a_folder_say_once_what_they_lack(tmp_path: Path) -> None:
    line = "target_mm,run,direction,value_um\n0,1,1,0\n9,1,1,0\n"
    for name in ("exx.csv", "eyy.csv"):
        (tmp_path / name).write_text(line)
    points = "X_inch,Y_inch,Z_inch,measured_X_mm,measured_Y_mm,measured_Z_mm\n0,0,0,0,0,0\n"
    (tmp_path / "tracker.csv").write_text(points)
    (tmp_path / "odd.csv").write_text("Point,Soll,Ist\n1,2,3\n")
    with pytest.raises(ConfigError) as caught:
        load_measurements([tmp_path])
    together, odd, tracker = caught.value.problems
    assert "exx.csv, eyy.csv: states no component" in together and "--propose" in together
    assert "its columns are Point, Soll, Ist; expected target_mm" in odd
    assert "readings of a table [[points]]" in tracker and "--propose" in tracker


def test_a_polar_station_counts_as_the_plan_states(tmp_path: Path) -> None:
    head = "X_mm,Y_mm,Z_mm,distance_mm,azimuth_deg,elevation_deg\n"
    rows = "".join(f"{x},{y},0,{900 + x},{x / 50},{60 + y / 50}\n" for x in (0, 500, 900) for y in (0, 300))
    (tmp_path / "s.csv").write_text(head + rows)
    keys = '[[polar]]\nfile = "s.csv"\nsigma_distance_um = 10.0\nsigma_angle_urad = 10.0\n'
    planned(tmp_path, keys)
    plain = load_measurements([tmp_path]).of(Points)[0].measured_mm
    planned(tmp_path, keys + 'azimuth = "clockwise"\nvertical = "zenith"\n')
    other = load_measurements([tmp_path]).of(Points)[0].measured_mm
    x, y, z = plain.T
    flat = np.hypot(x, y)
    assert np.allclose(other, np.column_stack([x * z / flat, -y * z / flat, flat]))


@pytest.mark.parametrize(
    ("change", "more", "words"),
    [
        (("measured_X_mm", "seen_X_mm"), "", 'column 4 is "seen_X_mm"'),
        (("500,0,0,", "500,0,"), "", "line 7: 5 values under 6 columns"),
        (("500,0,0,", "500,0,x,"), "", 'line 7: Z_mm = "x"'),
        (("", ""), "sigma_um = 0.0\n", "sigma_um"),
    ],
)
def test_points_that_are_wrong(tmp_path: Path, change: tuple[str, str], more: str, words: str) -> None:
    (tmp_path / "t.csv").write_text(POINTS.replace(*change) if change[0] else POINTS)
    planned(tmp_path, '[[points]]\nfile = "t.csv"\n' + (more or "sigma_um = 8.0\n"))
    with pytest.raises(ConfigError) as caught:
        load_measurements([tmp_path])
    assert words in str(caught.value)


# -- the example, through the command line ---------------------------------------------------------------


def run(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    return done.exit_code, done.output


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("example") / "gantry-lines"
    shutil.copytree(PROGRAMS / "gantry-lines", folder, ignore=shutil.ignore_patterns("calibration*"))
    code, output = run(
        "calibrate", "fit", folder, "-m", folder / "machine.toml", "-o", folder / "calibration.toml"
    )
    assert code == 0, output
    (folder / "told.txt").write_text(output)
    return folder


@pytest.mark.slow
def test_the_table_says_what_was_found(example: Path) -> None:
    shown = (example / "told.txt").read_text()
    for words in ("EXX", "Squareness", "Backlash um", "ezx.csv: row 42", "wrote"):
        assert words in shown


@pytest.mark.slow
def test_the_example_finds_the_errors_that_were_simulated(example: Path) -> None:
    """The independent judge reads both calibrations; the frame of the machine cannot be measured."""
    true, fitted = JudgeModel(PROGRAMS / "gantry-plate"), JudgeModel(example)
    position_mm = np.random.default_rng(3).uniform(fitted.box[:, 0], fitted.box[:, 1], (800, 3))
    for tool in ((0.0, 0.0, -120.0), (80.0, -40.0, -200.0)):
        before = true.error_mm(position_mm, tool)
        rest = before - fitted.error_mm(position_mm, tool)
        assert simulated.rms_um(simulated.off_frame(position_mm, before)) > 20.0
        assert simulated.rms_um(simulated.off_frame(position_mm, rest)) < 3.0


@pytest.mark.slow
def test_squareness_is_stated_where_a_square_is_put(example: Path) -> None:
    """At the datum as it is written, and in the middle of the box; where the pair of lines crossed it is what
    the square showed there."""
    fitted = olp.fit_calibration(example, example / "machine.toml")
    pairs = {pair.reading.component: pair.reading for pair in olp.evaluate_lines([example]).pairs}
    for name, reading in pairs.items():
        row = fitted.fit.squareness_at(name, np.array(reading.line_mm), np.array(reading.tool_mm))
        assert row @ fitted.fit.theta == pytest.approx(reading.value_rad, abs=2e-6)
    rows = {row["name"]: row for row in fitted.report["squareness"]}
    assert rows["C0Y"]["value_urad"] > rows["C0Y"]["mid_box_value_urad"] + 20.0
    assert {name: row["in_the_middle"] for name, row in rows.items()} == {
        "C0Y": "Y leans to -X", "B0Z": "Z leans to -X", "A0Z": "Z to Y: side not certain",
    }  # fmt: skip


def test_the_calibration_corrects_a_program(example: Path) -> None:
    program = PROGRAMS / "gantry-plate" / "plate.ngc"
    result = olp.correct(program, example / "machine.toml")
    assert result.report["deviation"]["holds"]
    assert result.data != program.read_bytes()


@pytest.mark.slow
def test_the_python_way_gives_the_same(example: Path) -> None:
    fitted = olp.fit_calibration(example, example / "machine.toml")
    assert fitted.files(example / "calibration.toml") == {
        path: path.read_bytes() for path in sorted(example.glob("calibration*"), reverse=True)
    }
    assert fitted.findings[0].code == "OLP802"


@pytest.mark.slow
def test_json_and_fail_on(example: Path) -> None:
    code, output = run("calibrate", "fit", example, "--json", "--fail-on", "warning")
    report = json.loads(output[output.index("{") :])
    assert code == 1
    assert report["schema"] == "olp-fit-1"
    assert report["left_out"] == 1
    assert {row["name"] for row in report["angular_errors"]} == {f"E{d}{a}" for d in "ABC" for a in "XYZ"}
    assert report["findings"][0]["lines"] == [42]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("nowhere",), 3, "no such file"),
        (("-",), 2, "several files"),
        (("{0}", "-o", "{0}/exx-no/c.toml"), 2, "no folder"),
        (("{0}", "-o", "{0}/calibration.toml"), 2, "exists already"),
        (("{0}", "-m", "{1}/haas-mill/machine.toml"), 3, "chain"),
        (("{0}", "-o", "{0}/eax.csv", "--force"), 2, "input"),
    ],
)
def test_wrong_calls(example: Path, arguments: tuple[str, ...], code: int, words: str) -> None:
    exit_code, output = run("calibrate", "fit", *(a.format(example, PROGRAMS) for a in arguments))
    assert (exit_code, words in output) == (code, True), output
