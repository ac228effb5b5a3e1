"""From calibration to table and back through files and the command line, and what each table leaves."""

from __future__ import annotations

import datetime
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import machines
from judge.machines import CHAINS, Recipe
from judge.model import JudgeModel

import olp
from olp.calibration.control_tables.controls import AxisTables, Shear, Volumetric
from olp.calibration.control_tables.residuals import in_box
from olp.calibration.control_tables.rows import as_straightness, component_rows, zeroed
from olp.cli import main
from olp.core.errors import UsageError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic
from olp.files.calibration.reader import load_calibration
from olp.files.control_code.registry import CODE
from olp.files.control_tables.registry import FORMATS
from olp.files.kinematics.tables import TABLES
from olp.files.write import write_files

PROGRAMS = Path(__file__).parents[2] / "programs"
BOX = np.array([[0.0, 800.0], [0.0, 600.0], [-400.0, 0.0]])


def random_points(seed: int, n: int = 200) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return BOX[:, 0] + rng.random((n, 3)) * (BOX[:, 1] - BOX[:, 0]), rng.normal(0.0, 100.0, (n, 3))


# -- what tables are made of ------------------------------------------------------------------------------


@pytest.mark.parametrize("chain", some_of_a_campaign(CHAINS, 4))
@pytest.mark.slow
def test_lines_through_zero_make_the_same_errors(chain: str, tmp_path: Path) -> None:
    """The judge measures off the datum and on tables; moved to 0 the model is the same to first order."""
    carried = chain.split("F")[0]
    recipe = Recipe(chain=chain, off_datum=True, on_table=carried[:1], peak_um=(50.0, 60.0))
    machine = machines.random_machine(tmp_path / "machine", CHAINS.index(chain), recipe)
    judge = JudgeModel(machine.parent)
    calibration = load_calibration(machine.parent / "calibration.toml")
    points, tools = random_points(3)
    expected = judge.error_mm(points, tools)
    for reference in ("functional-point", "table"):
        moved = zeroed(calibration, chain, reference)
        assert all(c.line_mm == (0, 0, 0) and c.tool_mm == (0, 0, 0) for c in moved.curves)
        error = build(moved, chain).error(points, tools)
        assert np.abs(error - expected).max() < 2e-4


def test_squareness_as_slopes_is_the_same_error() -> None:
    curve = Curve("Y", [0.0, 300.0, 600.0], {"EXY": [0.0, 0.01, 0.0], "EYY": [0, 0, 0.02]})
    calibration = Calibration(
        "g", BOX, curves=(curve,), datum_mm=(10.0, 200.0, -50.0),
        squareness={"C0Y": 3e-5, "B0Z": -2e-5, "A0Z": 1e-5},
    )  # fmt: skip
    points, tools = random_points(1)
    straight = replace(calibration, curves=(replace(curve, interpolation="linear"),))
    for case, allowed_mm in ((straight, 2e-8), (calibration, 5e-5)):
        error = build(as_straightness(case), "FXYZ").error(points, tools)
        assert np.abs(error - build(case, "FXYZ").error(points, tools)).max() <= allowed_mm


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from([None, 30, 256]), st.booleans())
def test_rows_follow_the_curve_as_far_as_they_say(seed: int, most: int | None, even: bool) -> None:
    rng = np.random.default_rng(seed)
    inner = np.arange(60.0, 780.0, 60.0)
    position = np.round(np.r_[0.0, inner + rng.uniform(-25.0, 25.0, len(inner)), 800.0], 3)
    curve = Curve("X", position, {"EXX": rng.normal(0, 0.01, len(position))})
    calibration = Calibration("g", BOX, curves=(curve,), backlash_mm=(0.004, 0.0, 0.0))
    rows = component_rows(calibration, "EXX", most=most, even=even)
    assert rows is not None and (most is None or len(rows.position_mm) <= most)
    if even:
        assert np.ptp(np.diff(rows.position_mm)) < 1e-9
    q = np.linspace(0.0, 800.0, 4001)
    position_mm = np.column_stack([q, 0 * q, 0 * q])
    for side, values in ((1.0, rows.forward), (-1.0, rows.backward)):
        direction = side * np.ones(position_mm.shape)
        model = build(calibration, "FXYZ").error(position_mm, np.zeros(3), direction)[:, 0]
        assert np.abs(np.interp(q, rows.position_mm, values) - model).max() <= 1.05 * rows.miss + 1e-6
    if most is None and not even:
        assert rows.miss <= 5e-5


# -- controls ---------------------------------------------------------------------------------------------


def test_a_control_that_holds_everything_leaves_nothing() -> None:
    """Positioning alone, squareness alone, and all of a chain: their own control takes them out."""
    points, tools = random_points(2)
    direction = np.random.default_rng(0).choice([-1.0, 1.0], points.shape)
    curve = Curve("X", [0.0, 400.0, 800.0], {"EXX": [0, 0.05, -0.02]}, interpolation="linear")
    lost = Calibration("g", BOX, curves=(curve,), backlash_mm=(0.01, 0.006, 0.0))
    square = Calibration("g", BOX, squareness={"C0Y": 2e-4, "B0Z": -1e-4, "A0Z": 3e-4})
    turn = Curve("Y", [0.0, 600.0], {"EAY": [0, 1e-5], "ECY": [2e-5, 0]}, interpolation="linear")
    whole = Calibration("g", BOX, curves=(curve, turn), squareness={"C0Y": 2e-5})
    cases = (
        (lost, AxisTables(lost)), (square, Shear(square)),
        (whole, Volumetric(build(whole, "FXYZ", outside="hold"))),
    )  # fmt: skip
    for calibration, control in cases:
        model = build(calibration, "FXYZ", outside="hold")
        command = points + control.offset(points, tools, direction)
        residual = command + model.error(command, tools, direction) - points
        before = np.abs(model.error(points, tools, direction)).max()
        assert np.abs(residual).max() < 1e-3 * before


def test_cyclic_errors_are_followed_where_rows_allow() -> None:
    """Of 2 um at a pitch of 10 mm, 16 rows a period leave 2 %; 256 rows follow 100 mm, and not 800."""
    term = Cyclic("EXX", 10.0, 0.002, 0.4)
    for length, followed in ((100.0, True), (800.0, False)):
        box = np.array([[0.0, length], [0.0, 9.0], [0.0, 9.0]])
        rows = component_rows(Calibration("g", box, cyclic=(term,)), "EXX", most=256)
        assert rows is not None and rows.cyclic == followed
        q = np.linspace(0.0, length, 5001)
        true = 0.002 * np.sin(2 * np.pi * q / 10.0 + 0.4)
        residual = np.abs(np.interp(q, rows.position_mm, rows.forward) - true).max()
        assert residual < 5e-5 if followed else residual > 1.9e-3


def test_points_of_the_hypercube_fill_every_cell() -> None:
    places = in_box(BOX, np.zeros((1, 3)), 50, 7)
    cells = np.floor((places.points_mm - BOX[:, 0]) / (BOX[:, 1] - BOX[:, 0]) * 50)
    assert (np.sort(cells, axis=0) == np.arange(50)[:, None]).all()
    assert (places.points_mm == in_box(BOX, np.zeros((1, 3)), 50, 7).points_mm).all()


# -- files and commands -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_figures_of_an_example_and_their_order() -> None:
    machine = PROGRAMS / "gantry-plate" / "machine.toml"
    report = olp.compare_tables(machine, program=PROGRAMS / "gantry-plate" / "plate.ngc")
    box, path = report["box"]["left"], report["program"]["left"]
    assert set(box) == {"as it is", "olp correct", "real time", *FORMATS} == set(path)
    assert box["olp correct"]["max_um"] < 1.0 and path["olp correct"]["max_um"] < 1.87
    # the only residual of a volumetric table is a backlash of 6 um
    assert box["isg"]["rms_um"] == pytest.approx(3.0, abs=0.02)
    # the model itself in the control leaves the dead band of the backlash
    assert box["real time"]["max_um"] < 1e-3 and path["real time"]["max_um"] < 0.11
    order = ["real time", "olp correct", "isg", "siemens-cec", "linuxcnc", "klipper", "as it is"]
    framed = [box[name]["rms_in_frame_um"] for name in order]
    assert framed == sorted(framed)


@pytest.mark.slow
@pytest.mark.parametrize("reference", ["functional-point", "table"])
@pytest.mark.parametrize("chain", ["FXYZ", "YFXZ", "ZXFY", "YXFZ", "XYZF"])
@pytest.mark.parametrize("key", ["isg", "etalon"])
def test_a_volumetric_table_leaves_next_to_nothing(
    key: str, chain: str, reference: str, tmp_path: Path
) -> None:
    """On every kind of chain, measured off the datum and on tables: written, read back, taken off."""
    recipe = Recipe(chain=chain, off_datum=True, on_table=chain.split("F")[0][:1], peak_um=(50.0, 60.0))
    machine = machines.random_machine(tmp_path / "m", 11, recipe)
    exported = olp.export_table(machine, key, tmp_path / "t.csv", reference=reference)
    residuals = exported.report["box"]["left"]
    assert residuals["as it is"]["rms_um"] > 10.0
    assert residuals[key]["max_um"] < 0.25


@pytest.mark.parametrize("key", FORMATS)
def test_through_files_and_back(key: str, tmp_path: Path) -> None:
    """Export, import, export: the second table is the first one, byte for byte."""
    machine = machines.random_machine(tmp_path / "m", 3, Recipe(backlash_um={"Y": 4.0}, off_datum=True))
    stated = {} if FORMATS[key].sense else {"sense": "correction"}
    first = olp.export_table(machine, key, tmp_path / f"a{FORMATS[key].ending}", **stated)
    write_files(first.files)
    table = next(iter(first.files))
    read = olp.import_table(
        table, key, tmp_path / "c.toml", machine, measured=datetime.date(2026, 1, 2), **stated
    )
    write_files(read.files)
    second = olp.export_table(
        None, key, tmp_path / "b" / table.name, calibration=tmp_path / "c.toml", **stated
    )
    for path, data in first.files.items():
        if "verify" in path.name or key == "klipper":
            continue
        lines = [d.decode().splitlines() for d in (data, second.files[tmp_path / "b" / path.name])]
        kept = [[line for line in text if not line.startswith(("//", ";"))] for text in lines]
        assert kept[0] == kept[1], path.name


def test_the_table_marks_what_the_control_corrects(tmp_path: Path) -> None:
    """With the line in the machine file `olp correct` leaves to the control what its table does."""
    recipe = Recipe(angular=False)
    machine = machines.random_machine(tmp_path / "m", 4, recipe)
    exported = olp.export_table(machine, "siemens-cec", tmp_path / "t.mpf", sense="error")
    names = exported.report["compensated_by_controller"]
    assert {"EXX", "EYX", "C0Y"} <= set(names)
    text = machine.read_text().replace("compensated_by_controller = []\n", "")
    machine.write_text(f"compensated_by_controller = {json.dumps(names)}\n{text}")
    error = olp.error_at(machine, (300.0, 200.0, -100.0), (0.0, 0.0, -100.0))
    assert np.abs(error["error_um"]).max() < 1e-6
    again = olp.export_table(machine, "siemens-cec", tmp_path / "u.mpf", sense="error")
    assert "OLP876" in [f.code for f in again.findings]


@pytest.mark.slow
def test_commands(tmp_path: Path) -> None:
    machine = str(PROGRAMS / "gantry-plate" / "machine.toml")
    run = CliRunner()
    listed = run.invoke(main, ["calibrate", "formats", "--json"])
    assert set(json.loads(listed.stdout)) == {*FORMATS, *TABLES, *CODE}
    target = str(tmp_path / "t.csv")
    done = run.invoke(main, ["calibrate", "export", "-m", machine, "--format", "isg", "-o", target])
    assert done.exit_code == 0, done.output
    assert "compensated_by_controller = [" in done.stdout and "olp correct" in done.stdout
    assert "OLP871" in done.stderr
    twice = run.invoke(main, ["calibrate", "export", "-m", machine, "--format", "isg", "-o", target])
    assert twice.exit_code == 2 and "--force" in twice.stderr
    back = ["calibrate", "import", target, "--format", "isg", "-m", machine, "-o", str(tmp_path / "c.toml")]
    assert "--measured" in run.invoke(main, back).stderr
    read = run.invoke(main, [*back, "--measured", "2026-05-01"])
    assert read.exit_code == 0, read.output
    assert load_calibration(tmp_path / "c.toml").machine == "gantry-1600"
    failed = run.invoke(
        main, ["calibrate", "export", "-m", machine, "--format", "klipper", "--fail-on", "warning", "-o",
               str(tmp_path / "k.cfg")]
    )  # fmt: skip
    assert failed.exit_code == 1 and (tmp_path / "k.cfg").exists()
    compared = run.invoke(main, ["calibrate", "export", "-m", machine, "--compare", "--json"])
    assert json.loads(compared.stdout)["schema"] == "olp-tables-1"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--format", "isg"], "-o"),
        (["--compare", "--format", "isg"], "either --format"),
        (["--format", "siemens-cec", "-o", "x.mpf"], "--sense"),
        (["--format", "linuxcnc", "-o", "x.comp"], "INI file"),
        (["--compare", "-c", "c.toml"], "either a machine file"),
        (["--compare", "--chain", "FXYZ"], "--chain goes with -c"),
        (["--format", "isg", "-o", "x.csv", "--axis-name", "W=1"], "--axis-name"),
    ],
)
def test_a_call_that_cannot_be_meant_is_refused(
    options: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = str(PROGRAMS / "gantry-plate" / "machine.toml")
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["calibrate", "export", "-m", machine, *options])
    assert done.exit_code == 2, done.output
    assert message in done.stderr


@pytest.mark.slow
def test_a_program_that_correct_refuses_is_said() -> None:
    """A program that was corrected once is refused; the tables' figures are given all the same."""
    machine = PROGRAMS / "gantry-plate" / "machine.toml"
    text = b"G21 G90 G54 G0 X100 Y100 Z50\nG1 X200 F500\nM2\n"
    assert olp.compare_tables(machine, program=text)["program"]["refused"] is None
    corrected = olp.correct(text, machine).data
    report = olp.compare_tables(machine, program=corrected)["program"]
    assert "stamp" in report["refused"] and report["left"]["olp correct"]["rms_um"] is None
    assert report["left"]["isg"]["rms_um"] > 0.0


def test_a_program_needs_its_machine() -> None:
    calibration = PROGRAMS / "gantry-plate" / "calibration.toml"
    with pytest.raises(UsageError, match="-m"):
        olp.compare_tables(None, calibration=calibration, program=b"G1 X1\n")
