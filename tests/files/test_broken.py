"""Every fault of a file gives one sentence that names the key or line and what was expected; exit code 3.

A case is a good set of files with one text replaced in one file.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.errors import ConfigError, InputError
from olp.files.config import load_calibration, load_job, load_machine, load_setup
from olp.files.meshes import read_mesh
from olp.files.problems import MOST_PROBLEMS
from olp.files.tables import parse_curves
from olp.files.toml_text import read_toml

GOOD = Path(__file__).parents[1] / "broken" / "good"

# (old text, new text, words of the sentence in their order); the line is that of the new text.
MACHINE = {
    "schema of another version": (
        '"olp-machine-1"',
        '"olp-machine-9"',
        ['schema = "olp-machine-9"; expected the format, "olp-machine-1"'],
    ),
    "name empty": ('name = "gantry-2"', 'name = ""', ["name", "text that is not empty"]),
    "name a number": ('name = "gantry-2"', "name = 2", ["name = 2", "expected text in quotes"]),
    "chain of three letters": ('"FXYZ"', '"XYZ"', ["chain", '"XYZ"', "24 orders of F, X, Y, Z"]),
    "chain a list": ('"FXYZ"', '["F", "X"]', ["chain", "24 orders"]),
    "controller not built": (
        '"linuxcnc"',
        '"fidia"',
        ["controller", "fidia", "linuxcnc, fanuc, grbl, haas"],
    ),
    "controller in capitals": ('"linuxcnc"', '"GRBL"', ["controller", '"GRBL"', "did you mean grbl?"]),
    "key misspelt": (
        "compensated_by_controller =",
        "compensated_by_control =",
        ["did you mean compensated_by_con"],
    ),
    "no ISO name": ('["EXX", "C0Y"]', '["EXX", "EXQ"]', ["compensated_by_controller", '"EXQ"', "ISO 230-1"]),
    "backlash as ISO name": (
        '["EXX", "C0Y"]',
        '"backlash"',
        ["compensated_by_controller", "expected a list of ISO"],
    ),
    "travel reversed": (
        "[0.0, 2000.0]",
        "[2000.0, 0.0]",
        ["axes.X.travel_mm", "[2000, 0] mm", "min below max"],
    ),
    "travel of one number": (
        "[0.0, 2000.0]",
        "[0.0]",
        ["axes.X.travel_mm", "one more value", "[min, max] in mm"],
    ),
    "travel of three numbers": (
        "[0.0, 2000.0]",
        "[0, 1, 2]",
        ["axes.X.travel_mm", "2 values", "[min, max] in mm"],
    ),
    "travel no list": ("[0.0, 2000.0]", "2000.0", ["axes.X.travel_mm = 2000.0", "list", "[min, max] in mm"]),
    "velocity negative": (
        "= 500.0",
        "= -500.0",
        ["axes.X.velocity_mm_s = -500.0", "a number above 0", "mm/s"],
    ),
    "velocity in quotes": ("= 500.0", '= "500"', ["axes.X.velocity_mm_s", "expected a number", "mm/s"]),
    "velocity infinite": ("= 500.0", "= inf", ["axes.X.velocity_mm_s = inf", "finite", "mm/s"]),
    "compliance below zero": (
        "jerk_mm_s3 = 20000.0",
        "jerk_mm_s3 = 20000.0\ncompliance_um_per_m_s2 = -2.0",
        ["axes.X.compliance_um_per_m_s2 = -2.0", "um per m/s2", "[X, Y, Z]"],
    ),
    "compliance of two numbers": (
        "jerk_mm_s3 = 20000.0",
        "jerk_mm_s3 = 20000.0\ncompliance_um_per_m_s2 = [1, 2]",
        ["axes.X.compliance_um_per_m_s2 = [1, 2]", "[X, Y, Z]"],
    ),
    "path mode of no kind": (
        'mode = "blend"',
        'mode = "exact"',
        ['path.mode = "exact"', '"blend"', '"exact-stop"'],
    ),
    "blend of nothing": ("blend_mm = 0.005", "blend_mm = 0", ["path.blend_mm = 0", "above 0", "mm"]),
    "blend in um": ("blend_mm = 0.005", "blend_um = 5", ["path.blend_um", "blend_mm"]),
    "increment zero": (
        "least_increment_mm = 0.0005",
        "least_increment_mm = 0",
        ["axes.Z.least_inc", "above 0", "mm"],
    ),
    "jerk in other units": (
        "jerk_mm_s3 = 20000.0",
        "jerk_m_s3 = 20.0",
        ["jerk_m_s3", "did you mean jerk_mm_s3?"],
    ),
    "unit left out": ("Y_mm = 50.0", "Y = 50.0", ['work_offsets."G59.1".Y', "did you mean Y_mm?"]),
    "offset not quoted": (
        '[work_offsets."G59.1"]',
        "[work_offsets.G59.1]",
        ['expected quotes: [work_offsets."G59.1"]'],
    ),
    "offset no code": (
        "[work_offsets.G54]",
        "[work_offsets.G45]",
        ["work_offsets.G45", "not a work offset", "G54 to G59"],
    ),
    "offset lower case": ("[work_offsets.G54]", "[work_offsets.g54]", ["work_offsets.g54", "expected G54"]),
    "set_by unknown": (
        'C_deg = 1.5\nset_by = "true"',
        'C_deg = 1.5\nset_by = "probe"',
        ["set_by", '"touch" or "true"'],
    ),
    "set_by a boolean": ('C_deg = 1.5\nset_by = "true"', "C_deg = 1.5\nset_by = true", ["set_by", "one of"]),
    "touch contradicts": (
        "C_deg = 1.5",
        "touch_tool = 1\nC_deg = 1.5",
        ["touch_tool contradicts", 'set_by = "touch"'],
    ),
    "touched at no axis": (
        "Y = 5.0 }",
        "A = 5.0 }",
        ["work_offsets.G54.touched_at_mm.A", "expected one of X, Y, Z"],
    ),
    "touch tool a fraction": ("touch_tool = 2", "touch_tool = 2.5", ["G54.touch_tool", "an integer"]),
    "touch tool undefined": (
        "touch_tool = 2",
        "touch_tool = 3",
        ["G54.touch_tool = 3 is not defined", "[tools.N]"],
    ),
    "tool name": ("[tools.1]", "[tools.T1]", ["tools.T1", "an integer as name"]),
    "tool length text": ("Z_mm = 120.0", 'Z_mm = "120"', ["tools.1.Z_mm", "expected a number", "mm"]),
    "tool radius negative": (
        "radius_mm = 5.0",
        "radius_mm = -5.0",
        ["tools.1.radius_mm", "0 or above", "mm"],
    ),
    "lever of two numbers": (
        "[0.0, 0.0, -121.0]",
        "[0.0, -121.0]",
        ["tools.1.gauge_to_tip_mm", "[X, Y, Z] in mm"],
    ),
    "tool touch at two axes": (
        ", Z = -400.0 }",
        " }",
        ["tools.2.touched_at_mm is incomplete", "Z = .. } in mm"],
    ),
    "tool touch not said": ('set_by = "touch"\n', "", ["tools.2.touched_at_mm", 'expected set_by = "touch"']),
    "start tool undefined": (
        "tool = 1\n",
        "tool = 9\n",
        ["job_defaults.tool = 9 is not defined", "[tools.N]"],
    ),
    "length_active a number": (
        "length_active = true",
        "length_active = 1",
        ["length_active = 1", "true or false"],
    ),
    "decimal comma": (
        "velocity_mm_s = 400.0",
        "velocity_mm_s = 400,0",
        ["not TOML", "decimal point instead of"],
    ),
    "quote not closed": ('"gantry-2"', '"gantry-2', ["not TOML", "close the quotes"]),
    "text not quoted": ('"gantry-2"', "gantry", ["not TOML", "text needs quotes"]),
    "key twice": ("jerk_mm_s3 = 20000.0", "velocity_mm_s = 1.0", ["not TOML", "overwrite"]),
    "calibration a number": ('= "calibration.toml"', "= 1", ["calibration = 1", "text in quotes", "path"]),
}
CALIBRATION = {
    "schema of a job": (
        '"olp-calibration-1"',
        '"olp-job-1"',
        ["this is a job file (olp-job-1)", "expected a calibration (olp-calibration-1)"],
    ),
    "another machine": ('"gantry-2"', '"gantry-3"', ["machine", "gantry-3", 'expected "gantry-2"']),
    "sign of corrections": (
        "actual-minus",
        "nominal-minus",
        ["sign", "multiply", "by -1", '"actual-minus-commanded"'],
    ),
    "date in quotes": ("2026-05-14", '"2026-05-14"', ["measured", "a date without quotes"]),
    "date with a time": ("2026-05-14", "2026-05-14T12:00:00", ["measured", "a date without"]),
    "expires before measured": (
        "2027-05-14",
        "2025-05-14",
        ["valid_until", "before measured = 2026-05-14", "later"],
    ),
    "no such date": ("2027-05-14", "2027-02-30", ["not TOML"]),
    "temperature text": ("= 21.0", '= "21"', ["temperature_degC", "expected a number", "degC"]),
    "model unknown": ('"rigid-body"', '"elastic"', ["model", '"rigid-body" or "huddersfield"']),
    "datum of two numbers": (
        "[10.0, 0.0, -5.0]",
        "[10.0, 0.0]",
        ["datum_mm", "one more value", "[X, Y, Z] in mm"],
    ),
    "datum with text": (
        "[10.0, 0.0, -5.0]",
        '[10.0, "0", 1]',
        ["datum_mm[1]", "a number", "[X, Y, Z] in mm"],
    ),
    "box of two axes": (", [-600, 0]]", "]", ["box_mm", "one more value", "of X, Y, Z in mm"]),
    "box reversed": ("[-600, 0]]", "[0, -600]]", ["box_mm[2]", "min below max"]),
    "box beyond the curve": (
        "[[0, 2000]",
        "[[-1, 2000]",
        ["curve of axis X", "expected all of the box", "-1 to 2000 mm"],
    ),
    "active and compensated": ('["EZZ"]', '["EXX"]', ["EXX", "compensated_by_controller", "in one of them"]),
    "curve file missing": ('"y.csv"', '"w.csv"', ['curves[1].file = "w.csv"', "no such file"]),
    "line of no axis": ("{ Y = 400.0 }", "{ U = 400.0 }", ["curves[0].line_mm.U", "X, Y, Z"]),
    "reference unknown": ('"table"', '"bed"', ["curves[1].reference", '"functional-point" or "table"']),
    "interpolation unknown": ('"linear"', '"cubic"', ["curves[0].interpolation", '"linear" or "pchip"']),
    "squareness unknown": ("C0Y_urad", "C0X_urad", ["squareness.C0X_urad", "did you mean C0Y_urad?"]),
    "squareness in degrees": ("C0Y_urad", "C0Y_deg", ["squareness.C0Y_deg", "C0Y_urad"]),
    "backlash in mm": ("Y_um = 4.0", "Y_mm = 0.004", ["backlash.Y_mm", "Y_um"]),
    "backlash and direction": (
        "Y_um = 4.0",
        "X_um = 4.0",
        ["axis X has a backlash", "direction column", "one of the two"],
    ),
    "component unknown": ('"EXX"', '"EXW"', ["cyclic[0].component", '"EXW"', '"EXX"']),
    "period zero": ("period_mm = 10.0", "period_mm = 0.0", ["cyclic[0].period_mm", "above 0", "mm"]),
    "amplitude in the wrong unit": (
        "amplitude_urad = 2.0",
        "amplitude_um = 2.0",
        ["cyclic[1]", "EAY", "in urad"],
    ),
    "amplitude missing": ("amplitude_um = 1.5\n", "", ["cyclic[0]", "EXX", "amplitude_um, in um"]),
    "thermal misspelt": (
        "X_scale_um_m_K",
        "X_scale_um_K",
        ["thermal.X_scale_um_K", "did you mean X_scale_um_m_K?"],
    ),
    "map without kind": (
        "[squareness]",
        '[[maps]]\nfile = "m.csv"\n[squareness]',
        ["maps[0].kind is missing", '"residual"', '"total"'],
    ),
    "map file missing": (
        "[squareness]",
        '[[maps]]\nfile = "m.csv"\nkind = "residual"\n[squareness]',
        ['maps[0].file = "m.csv"', "no such file"],
    ),
    "compliance file missing": (
        "[squareness]",
        '[[compliance]]\nfile = "m.csv"\n[squareness]',
        ['compliance[0].file = "m.csv"', "no such file"],
    ),
    "beam with two sections": (
        "[squareness]",
        '[[compliance_beam]]\naxis = "X"\nsupport = "simple"\nspan_mm = [0, 2000]\nyoungs_modulus_GPa = 210\n'
        "second_moment_mm4 = 1e8\nsection_mm = [100, 200, 8]\n[squareness]",
        ["section_mm", "exactly one of the two"],
    ),
    "beam along its load": (
        "[squareness]",
        '[[compliance_beam]]\naxis = "Z"\nsupport = "simple"\nspan_mm = [0, 2000]\nyoungs_modulus_GPa = 210\n'
        "second_moment_mm4 = 1e8\n[squareness]",
        ["direction", "across it"],
    ),
    "beam shorter than the box": (
        "[squareness]",
        '[[compliance_beam]]\naxis = "X"\nsupport = "simple"\nspan_mm = [0, 20]\nyoungs_modulus_GPa = 210\n'
        "second_moment_mm4 = 1e8\n[squareness]",
        ["beam of axis X spans 0 to 20 mm", "all of the box"],
    ),
}
JOB = {
    "payload negative": ("= 12.5", "= -1.0", ["payload_kg = -1.0", "0 or above", "kg"]),
    "temperature of no sensor": (
        "X_scale = 21.4",
        "X_scal = 21.4",
        ["temperatures_degC.X_scal", "did you mean X_scale?"],
    ),
    "start of no axis": ("{ X = 0.0,", "{ A = 0.0,", ["start_mm.A", "expected one of X, Y, Z"]),
    "start a list": ("{ X = 0.0, Z = -10.0 }", "[0, 0, 0]", ["start_mm", "a table", "in mm"]),
    "role unknown": ('"fixture"', '"vice"', ["meshes[0].role", '"workpiece", "fixture" or "machine"']),
    "frame undefined": (
        'frame = "G54"',
        'frame = "G55"',
        ["meshes[0].frame", '"G55"', "[work_offsets.NAME]"],
    ),
    "mesh missing": ("fixture.stl", "vice.stl", ["meshes[0].file", "vice.stl", "relative to the job file"]),
    "touch tool undefined": ("touch_tool = 7", "touch_tool = 8", ["G54.touch_tool = 8 is not defined"]),
    "table of tools written as value": ("[[meshes]]", "[meshes]", ["meshes", "[[ ]]"]),
    "machine file missing": ('"machine.toml"', '"mill.toml"', ["mill.toml: no such file"]),
}
X_CSV = {
    "wrong axis letter": ("EBX_urad", "EBY_urad", ["column 4", "error of axis Y", "X_mm"]),
    "wrong unit": ("EBX_urad", "EBX_deg", ["column 4", "the unit deg", "expected EBX_urad"]),
    "lower case": ("EBX_urad", "ebx_urad", ["column 4", "expected EBX_urad"]),
    "misspelt": ("EBX_urad", "EB_urad", ["column 4", "did you mean"]),
    "repeated": ("EBX_urad", "EXX_um", ["column 4 repeats", "each column once"]),
    "position in inches": ("X_mm", "X_in", ["column 1", "X_in", "X_mm, Y_mm or Z_mm"]),
    "header missing": (
        "X_mm,direction,EXX_um,EBX_urad,sigma_EXX_um\n",
        "",
        ["header is missing", "X_mm, Y_mm or Z_mm"],
    ),
    "direction not 1": ("1000,-1,", "1000,-2,", ["direction = -2", "+1 or -1"]),
    "not a number": ("1000,+1,6.0", "1000,+1,six", ['EXX_um = "six"', "a number in um"]),
    "digits grouped": ("1000,+1,6.0", "1_000,+1,6.0", ["X_mm", "mm"]),
    "NaN": ("1000,+1,6.0", "1000,+1,nan", ["EXX_um = nan is not finite", "in um"]),
    "empty cell": ("1000,+1,6.0", "1000,+1,", ["EXX_um is empty", "in um"]),
    "decimal comma in quotes": (
        "1000,+1,6.0",
        '1000,+1,"6,5"',
        ["EXX_um = 6,5", "decimal comma", "decimal point"],
    ),
    "decimal comma": ("1000,+1,6.0", "1000,+1,6,0", ["6 values under 5 columns", "decimal comma"]),
    "ragged": ("1000,+1,6.0,2.0,0.5", "1000,+1,6.0", ["3 values under 5 columns", "one value per column"]),
    "sigma negative": ("1000,+1,6.0,2.0,0.5", "1000,+1,6.0,2.0,-0.5", ["sigma_EXX_um", "0 or above"]),
    "unsorted": ("1000,+1,6.0", "-1,+1,6.0", ["X_mm = -1 comes after 0 in direction +1", "ascending"]),
    "duplicate": ("1000,-1,8.0", "0,-1,8.0", ["X_mm = 0 is repeated in direction -1", "each position once"]),
}
# Faults that no single line holds.
X_CSV_WHOLE = {
    "directions differ": ("1000,-1,", "999,-1,", ["X_mm = 999", "direction -1 only", "same positions"]),
    "one direction only": (
        "0,-1,2.0,1.0,0.5\n1000,-1,8.0,2.0,0.5\n2000,-1,14.0,3.0,0.5\n",
        "",
        ["0 positions", "at least 2"],
    ),
}

Case = tuple[str, str, list[str]]


def break_one(folder: Path, name: str, old: str, new: str) -> int:
    """Copy the good set, replace a text once; the line where the new text ends."""
    shutil.copytree(GOOD, folder, dirs_exist_ok=True)
    text = (folder / name).read_text()
    assert old in text
    start = text.index(old)
    (folder / name).write_text(text[:start] + new + text[start + len(old) :])
    return text[:start].count("\n") + new.rstrip("\n").count("\n") + 1


def load_all(folder: Path) -> None:
    setup = load_setup(job_path=folder / "job.toml")
    assert setup.machine.calibration is not None
    load_calibration(setup.machine.calibration, setup.machine, setup.job.temperatures_degC)


def the_problem(folder: Path, load: Callable[[Path], object] = load_all) -> str:
    with pytest.raises(InputError) as caught:
        load(folder)
    error = caught.value
    assert error.exit_code == 3
    if isinstance(error, ConfigError):
        assert len(error.problems) == 1, str(error)
    assert "\n" not in str(error)
    return str(error)


def assert_in_order(words: list[str], sentence: str) -> None:
    start = 0
    for word in words:
        assert word in sentence[start:], f"{word!r} not in {sentence!r}"
        start = sentence.index(word, start) + len(word)


#: Cases whose sentence names a table, another key, or no line at all.
ELSEWHERE = {
    "tool touch not said",
    "amplitude in the wrong unit",
    "amplitude missing",
    "map without kind",
    "map file missing",
    "compliance file missing",
    "beam with two sections",
    "beam along its load",
    "beam shorter than the box",
    "box beyond the curve",
    "backlash and direction",
    "touch contradicts",
    "machine file missing",
    "header missing",
}
CASES = [
    pytest.param(name, case, title not in ELSEWHERE, id=f"{name}: {title}")
    for name, cases in (
        ("machine.toml", MACHINE), ("calibration.toml", CALIBRATION), ("job.toml", JOB), ("x.csv", X_CSV)
    )
    for title, case in cases.items()
]  # fmt: skip


def test_the_good_set_is_good() -> None:
    load_all(GOOD)


@pytest.mark.parametrize(("name", "case", "at_the_text"), CASES)
def test_a_fault_gives_one_sentence(name: str, case: Case, at_the_text: bool, tmp_path: Path) -> None:
    old, new, words = case
    line = break_one(tmp_path, name, old, new)
    sentence = the_problem(tmp_path)
    if at_the_text:
        assert sentence.startswith(f"{tmp_path / name}: line {line}: ")
    assert_in_order(words, sentence)


@pytest.mark.parametrize("title", X_CSV_WHOLE)
def test_a_fault_of_a_whole_table_names_the_file(title: str, tmp_path: Path) -> None:
    old, new, words = X_CSV_WHOLE[title]
    break_one(tmp_path, "x.csv", old, new)
    sentence = the_problem(tmp_path)
    assert sentence.startswith(f"{tmp_path / 'x.csv'}: ")
    assert_in_order(words, sentence)


@pytest.mark.parametrize(
    "key", ["schema", "name", "chain", "controller", "axes.X.travel_mm", "axes.Z.least_increment_mm"]
)
def test_a_missing_key_is_named_with_what_was_expected(key: str, tmp_path: Path) -> None:
    table, _, name = key.rpartition(".")
    lines = (GOOD / "machine.toml").read_text().splitlines()
    start = lines.index(f"[{table}]") if table else 0
    del lines[next(n for n in range(start, len(lines)) if lines[n].startswith(f"{name} ="))]
    (tmp_path / "machine.toml").write_text("\n".join(lines))
    sentence = the_problem(tmp_path / "machine.toml", load_machine)
    assert_in_order([f"{key} is missing; expected "], sentence)


def test_all_problems_come_in_one_report_in_the_order_of_lines(tmp_path: Path) -> None:
    text = (GOOD / "machine.toml").read_text()
    for old, new in (
        ('"FXYZ"', '"F"'),
        ("= 500.0", "= 0"),
        ("radius_mm", "radius"),
        ("[axes.Z]", "[axes.W]"),
    ):
        text = text.replace(old, new)
    (tmp_path / "machine.toml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_machine(tmp_path / "machine.toml")
    named = [
        ("axes.Z is missing", 0),
        ("chain", 3),
        ("axes.X.velocity_mm_s", 11),
        ("axes.W", 22),
        ("radius", 41),
    ]
    assert len(caught.value.problems) == len(named)
    for problem, (key, line) in zip(caught.value.problems, named, strict=True):
        assert problem.startswith(f"line {line}: {key}" if line else key) or key in problem
    assert str(caught.value).count(str(tmp_path / "machine.toml")) == len(named)


def test_problems_of_all_curve_files_come_in_one_report(tmp_path: Path) -> None:
    break_one(tmp_path, "calibration.toml", '"gantry-2"', '"other"')
    (tmp_path / "x.csv").write_text("X_mm,EXX_mm\n0,0\n")
    (tmp_path / "y.csv").write_text("Y_mm,EYY_um\n0,a\n1,b\n")
    with pytest.raises(ConfigError) as caught:
        load_all(tmp_path)
    starts = ["calibration.toml: line 2", "x.csv: line 1", "y.csv: line 2", "y.csv: line 3"]
    assert len(caught.value.problems) == len(starts)
    for problem, start in zip(caught.value.problems, starts, strict=True):
        assert problem.startswith(str(tmp_path / start))


def test_what_the_calibration_itself_refuses_names_its_file(tmp_path: Path) -> None:
    break_one(tmp_path, "calibration.toml", '"y.csv"', '"x.csv"')
    with pytest.raises(ConfigError) as caught:
        load_all(tmp_path)
    assert len(caught.value.problems) == 2
    for line, name in zip(str(caught.value).split("\n"), ("EBX", "EXX"), strict=True):
        assert line.startswith(f"{tmp_path / 'calibration.toml'}: {name} is in two curves")


def test_a_report_of_very_many_problems_ends(tmp_path: Path) -> None:
    rows = "".join(f"{position},a\n" for position in range(10 * MOST_PROBLEMS))
    with pytest.raises(ConfigError) as caught:
        parse_curves(f"X_mm,EXX_um\n{rows}".encode(), "x.csv")
    assert len(caught.value.problems) == MOST_PROBLEMS + 1
    assert f"{9 * MOST_PROBLEMS} more problems" in caught.value.problems[-1]


def test_paper_model_needs_its_chain(tmp_path: Path) -> None:
    break_one(tmp_path, "calibration.toml", '"rigid-body"', '"huddersfield"')
    text = (tmp_path / "machine.toml").read_text().replace('"FXYZ"', '"YFXZ"')
    (tmp_path / "machine.toml").write_text(text)
    assert_in_order(["line 7", "huddersfield", "YFXZ", 'expected chain = "FXYZ"'], the_problem(tmp_path))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", ["holds no header", "X_mm, EXX_um"]),
        (b"# nothing\n", ["holds no header"]),
        (b"X_mm\n1\n2\n", ["line 1", "no error column", "EXX_um", "EAX_urad"]),
        (b"X_mm,EXX_um\n", ["0 positions", "at least 2"]),
        (b"X_mm,EXX_um\n1,2\n", ["1 positions", "at least 2"]),
        (b"X_mm;EXX_um\n1,0;2\n", ["line 1", "semicolons", "commas"]),
        (b"X_mm\tEXX_um\n1\t2\n", ["line 1", "tabs", "commas"]),
        (b"X_mm,EXX_um,direction\n1,2,1\n", ["line 1", "column 3", "direction as column 2"]),
        (b"X_mm,sigma_EXX_mm,EXX_um\n1,2,1\n", ["line 1", "column 2", "sigma_EXX_mm", "the unit mm"]),
        (b"X_mm,EXX_um\n1,2\n2,\xb5\n", ["line 3", "0xb5", "UTF-8"]),
    ],
)
def test_a_table_that_is_none_is_refused(data: bytes, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_curves(data, "x.csv")
    assert len(caught.value.problems) == 1
    assert_in_order(["x.csv", *words], str(caught.value))


@pytest.mark.parametrize("load", [load_machine, load_job, load_calibration])
def test_a_file_that_is_missing_or_binary_is_refused(load: Callable[[Path], object], tmp_path: Path) -> None:
    assert "no such file" in the_problem(tmp_path / "none.toml", load)
    assert "is a folder; expected a file" in the_problem(tmp_path, load)
    (tmp_path / "image.toml").write_bytes(b"a = 1\n\x89PNG\xff")
    assert_in_order(["image.toml", "line 2", "0x89", "UTF-8"], the_problem(tmp_path / "image.toml", load))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("= 500.0", "= " + "9" * 5000),
        ("= 500.0", "= " + "9" * 400),
        ("= 500.0", "= 1e999"),
        ("= 500.0", "= " + "[" * 100_000),
        ('"gantry-2"', "[" * 9 + "]" * 9),
        ("= 500.0", r'= "a\nb"'),
        ("[tools.1]", r'[tools."a\nb"]'),
        ("radius_mm", r'"a\nb"'),
    ],
)
def test_values_beyond_reason_give_one_sentence(old: str, new: str, tmp_path: Path) -> None:
    break_one(tmp_path, "machine.toml", old, new)
    assert str(tmp_path) in the_problem(tmp_path)


def test_a_cell_beyond_reason_gives_one_sentence() -> None:
    with pytest.raises(ConfigError, match="comma-separated"):
        parse_curves(b"X_mm,EXX_um\n0," + b"1" * 200_000, "x.csv")


toml_like = st.text(alphabet="[]{}=.,\"'#\n XYZ_mtoluse0123-", max_size=60)


@given(noise=toml_like, at=st.integers(0, 900))
def test_noise_in_a_file_is_refused_with_our_error_or_loads(
    noise: str, at: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "noise.toml"
    text = (GOOD / "machine.toml").read_text()
    path.write_text(text[:at] + noise + text[at:])
    try:
        assert load_machine(path).axes.keys() == {"X", "Y", "Z"}
    except ConfigError as error:
        assert all(problem.strip() for problem in error.problems)


@given(data=st.binary(max_size=40) | toml_like.map(str.encode))
def test_any_bytes_as_table_are_refused_with_our_error_or_load(data: bytes) -> None:
    try:
        table = parse_curves(b"X_mm,EXX_um\n0,1\n5,2\n" + data, "x.csv")
    except ConfigError as error:
        assert error.exit_code == 3
    else:
        assert len(table.position_mm) == len(table.columns["EXX"]) >= 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a = " + "[" * 50_000, "brackets nested too deeply"),
        ("a = " + "1" * 50_000, "thousands of digits"),
        ("b = 1\n" + "a." * 50_000 + "a = 1\n", "line 2: a key has more than 16 parts"),
        ("[" + "a." * 50_000 + "a]\n", "line 1: a key has more than 16 parts"),
        ("b = 1\na = { " + '"x" . ' * 50_000 + "a = 1 }\n", "line 2: a key has more than 16 parts"),
    ],
)
def test_deep_and_huge_values_of_toml_are_refused_at_once(text: str, expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        read_toml(text.encode(), "a.toml")


def test_dots_in_texts_are_no_keys() -> None:
    text = 'a = "' + "a." * 99 + '"\nb.c.d = [' + "1.5, " * 99 + "]\n"
    assert read_toml(text.encode(), "a.toml")[0]["a"] == "a." * 99


def test_a_damaged_mesh_is_one_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    """The library of meshes logs tracebacks of its own."""
    data = b"solid a\nfacet normal 0 0 x\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n" * 9
    with pytest.raises(InputError):
        read_mesh("a.stl", lambda _: data)
    assert "Traceback" not in capfd.readouterr().err
