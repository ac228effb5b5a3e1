"""Slips in the inputs: each is told before anything is written, and sane inputs raise no doubt."""

from __future__ import annotations

import csv
import datetime
import itertools
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from cases.fast import some_fast, some_of_a_campaign
from cases.joint_jobs import JOINT_JOBS
from click.testing import CliRunner
from judge.machines import CHAINS, Recipe, random_machine, zero_machine

import olp
from olp.calibration.diagnosis.refinement import with_run
from olp.cli import main
from olp.core.errors import Doubtful, UsageError
from olp.errormodel.quality import Fitted, Quality
from olp.files.calibration.reader import load_calibration
from olp.files.starter import starter_machine, write_starter
from olp.findings.catalogue import DOUBTS, RULES
from olp.findings.rule import Severity
from olp.workflows.doubt import acceptable

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
TEXT = b"G21 G90 G54\nG43 H1\nG0 X0. Y0. Z50.\nG1 X300. Y200. Z10. F600\nG1 X-100. Y10.\nM2\n"
BARE = b"G21 G90 G54\nG0 X0 Y0 Z50\nG1 X300 Y200 Z10 F600\nM2\n"
DAY = "2026-06-01"
TOOLS = {1: {"Z_mm": 120.0, "radius_mm": 5.0}}
RECIPE = Recipe(tools=TOOLS, cyclic=True, backlash_um={"X": 6.0}, peak_um=(90.0, 110.0), off_datum=True)
CONTROL = Recipe(tools=TOOLS, controller="fanuc", off_datum=True)
THERMAL = "[thermal]\nX_scale_um_m_K = 11.5\nworkpiece_um_m_K = 23.0\n"
JOB = 'schema = "olp-job-1"\npayload_kg = 0.0\n[temperatures_degC]\nX_scale = 21.0\nworkpiece = 21.5\n'
Edit = Callable[[Path], object]


def written(folder: Path, recipe: Recipe = RECIPE) -> Path:
    """A sane machine with everything that a slip needs, and its job."""
    random_machine(folder, 7, recipe)
    calibration = folder / "calibration.toml"
    text = calibration.read_text().replace("[0.0, 0.0, -60.0]", "[0.0, 0.0, -120.0]")
    calibration.write_text(text + THERMAL)
    (folder / "job.toml").write_text(JOB)
    return folder


def swap(file: str, pattern: str, new: str | Callable[[re.Match[str]], str], count: int = 1) -> Edit:
    def edit(folder: Path) -> None:
        path = folder / file
        text, found = re.subn(pattern, new, path.read_text(), count=count)
        assert found
        path.write_text(text)

    return edit


def number(file: str, key: str, factor: float, count: int = 1) -> Edit:
    """The number of a key times a factor."""
    return swap(file, rf"({key} = )(-?[0-9.e-]+)", lambda m: f"{m[1]}{float(m[2]) * factor!r}", count)


def vector(file: str, key: str, factor: float, count: int = 1) -> Edit:
    """Every number of the list or table of a key times a factor."""

    def scaled(match: re.Match[str]) -> str:
        numbers = re.sub(r"-?[0-9]+\.[0-9]*", lambda m: repr(float(m[0]) * factor), match[2])
        return match[1] + numbers

    return swap(file, rf"({key} = )(.*)", scaled, count)


def cells(change: Callable[[str, int, float], float], files: str = "xyz") -> Edit:
    """Every number of the curves as `change(column, row, value)`."""

    def edit(folder: Path) -> None:
        for name in files:
            path = folder / f"{name}.csv"
            head, *rows = csv.reader(path.read_text().splitlines())
            lines = [
                ",".join(repr(change(c, k, float(v))) for c, v in zip(head, row, strict=True))
                for k, row in enumerate(rows)
            ]
            path.write_text("\n".join([",".join(head), *lines]) + "\n")

    return edit


def errors(factor: float, files: str = "xyz", kinds: str = "XYZABC") -> Edit:
    return cells(lambda c, _, v: v * factor if c[0] == "E" and c[1] in kinds else v, files)


def one_value(column: str, factor: float, plus: float = 0.0) -> Edit:
    return cells(lambda c, k, v: v * factor + plus if c == column and k == 17 else v, column[2].lower())


def column(name: str, factor: float) -> Edit:
    return cells(lambda c, _, v: v * factor if c == name else v, name[2].lower())


def rows(change: Callable[[list[str]], list[str]]) -> Edit:
    """The lines of the curve of X."""

    def edit(folder: Path) -> None:
        path = folder / "x.csv"
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")

    return edit


def mapped(factor: float, of_positions: float = 1.0) -> Edit:
    """A residual map of some um, its deviations and its positions times a factor."""

    def edit(folder: Path) -> None:
        lines = ["X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um"]
        for x, y, z in itertools.product((0.0, 400.0, 800.0), (0.0, 300.0, 600.0), (-400.0, -200.0, 0.0)):
            place = ",".join(repr(q * of_positions) for q in (x, y, z))
            lines.append(f"{place},{(5.0 + x / 100.0) * factor},{(3.0 + y / 100.0) * factor},{4.0 * factor}")
        (folder / "map.csv").write_text("\n".join(lines) + "\n")
        table = '[[maps]]\nfile = "map.csv"\nkind = "residual"\ntool_mm = [0.0, 0.0, -120.0]\n'
        append(C, table)(folder)

    return edit


def loaded(factor: float) -> Edit:
    """A sag of 0.3 um per kg, times a factor, and a workpiece."""

    def edit(folder: Path) -> None:
        lines = [f"{x},{-sag * factor}" for x, sag in ((0.0, 0.1), (400.0, 0.3), (800.0, 0.1))]
        (folder / "load.csv").write_text("\n".join(["X_mm,EZX_um_kg", *lines]) + "\n")
        append(C, '[[compliance]]\nfile = "load.csv"\n')(folder)
        swap(J, "payload_kg = 0.0", "payload_kg = 30.0")(folder)

    return edit


def also(*edits: Edit) -> Edit:
    def edit(folder: Path) -> None:
        for each in edits:
            each(folder)

    return edit


def append(file: str, text: str) -> Edit:
    return lambda folder: (folder / file).write_text((folder / file).read_text() + text)


def zeros(folder: Path) -> None:
    errors(0.0)(folder)
    for key in ("C0Y_urad", "B0Z_urad", "A0Z_urad", "X_um", "amplitude_um", "_um_m_K"):
        number("calibration.toml", key, 0.0, 0)(folder)


def other_machine(folder: Path) -> None:
    """The calibration of a larger machine, renamed so that it loads."""
    travel = ((0.0, 2000.0), (0.0, 1200.0), (-600.0, 0.0))
    random_machine(folder / "other", 3, Recipe(travel=travel))
    for name in ("calibration.toml", "x.csv", "y.csv", "z.csv"):
        (folder / name).write_bytes((folder / "other" / name).read_bytes())
    swap("calibration.toml", '"other"', f'"{folder.name}"')(folder)


def skeleton(folder: Path) -> None:
    travel = {"X": (0.0, 800.0), "Y": (0.0, 600.0), "Z": (-400.0, 0.0)}
    for path in write_starter(folder, starter_machine("mill", "FXYZ", travel), force=True):
        assert path.exists()


def quality(reduced: float, freedom: float) -> Edit:
    figures = f"chi_square = {reduced * freedom}\ndegrees_of_freedom = {freedom}\n"
    good = "[quality]\nchi_square = 1000.0\ndegrees_of_freedom = 1000.0\n"
    return append("calibration.toml", f'{good}[[quality.sources]]\nsource = "points.csv"\n{figures}')


M, C, J = "machine.toml", "calibration.toml", "job.toml"
INCH = 25.4
#: By name: the code that tells the slip, and the slip.
SLIPS: dict[str, tuple[str, Edit]] = {
    "squareness C0Y in nrad": ("OLP446", number(C, "C0Y_urad", 1000.0)),
    "squareness B0Z in nrad": ("OLP446", number(C, "B0Z_urad", 1000.0)),
    "squareness A0Z in nrad": ("OLP445", number(C, "A0Z_urad", 1000.0)),
    "squareness of 90 degrees in urad": ("OLP446", swap(C, "C0Y_urad = .*", "C0Y_urad = 1570796.3")),
    "all errors in nm": ("OLP409", errors(1000.0)),
    "all errors 25.4 times": ("OLP409", errors(INCH)),
    "all errors in mm": ("OLP451", also(
        errors(1e-3), number(C, "(?:C0Y|B0Z|A0Z|X)_u(?:rad|m)", 1e-3, 0), number(C, "amplitude_um", 1e-3, 0),
        number(C, "_um_m_K", 0.0, 0), swap(C, r"\[thermal\]\n.*\n.*\n", ""))),
    "errors of X in mm": ("OLP450", also(errors(1e-3, "x", "XYZ"))),
    "errors of Y in mm": ("OLP450", also(errors(1e-3, "y", "XYZ"))),
    "errors of Z in mm": ("OLP450", also(errors(1e-3, "z", "XYZ"))),
    "angles of X in mrad": ("OLP450", errors(1e-3, "x", "ABC")),
    "angles in nrad": ("OLP446", errors(1000.0, kinds="ABC")),
    "positions in nm of X": ("OLP409", errors(1000.0, "x", "XYZ")),
    "zeros": ("OLP440", zeros),
    "untouched skeleton": ("OLP440", skeleton),
    "date of the skeleton": ("OLP442", swap(C, "measured = .*", "measured = 2000-01-01")),
    "expired": ("OLP401", swap(C, "valid_until = .*", "valid_until = 2026-05-31")),
    "year of the measurement": ("OLP460", swap(C, "measured = .*", "measured = 2027-01-15")),
    "failed fit": ("OLP443", quality(25.0, 400.0)),
    "box in inches": ("OLP452", vector(C, "box_mm", 1 / INCH)),
    "box in metres": ("OLP452", vector(C, "box_mm", 1e-3)),
    "box of X in inches": ("OLP452", swap(C, r"\[0\.0, 800\.0\]", "[0.0, 31.496]")),
    "travel in inches": ("OLP452", vector(M, "travel_mm", 1 / INCH, 0)),
    "travel in metres": ("OLP452", vector(M, "travel_mm", 1e-3, 0)),
    "travel 25.4 times": ("OLP452", vector(M, "travel_mm", INCH, 0)),
    "travel of Z without its sign": ("OLP452", swap(M, r"\[-400\.0, 0\.0\]", "[0.0, 400.0]")),
    "calibration of another machine": ("OLP452", other_machine),
    "positions of a curve in um": ("OLP453", cells(lambda c, _, v: v * 1000.0 if c == "X_mm" else v, "x")),
    "datum in um": ("OLP453", vector(C, "datum_mm", 1000.0)),
    "datum 25.4 times": ("OLP453", vector(C, "datum_mm", INCH)),
    "line of a curve in um": ("OLP453", vector(C, "line_mm", 1000.0)),
    "line of a curve 25.4 times": ("OLP453", vector(C, "line_mm", INCH)),
    "tool in inches": ("OLP454", swap(M, "Z_mm = 120.0", "Z_mm = 4.724")),
    "tool in metres": ("OLP454", swap(M, "Z_mm = 120.0", "Z_mm = 0.12")),
    "tool 25.4 times": ("OLP454", swap(M, "Z_mm = 120.0", "Z_mm = 3048.0")),
    "tool in um": ("OLP454", swap(M, "Z_mm = 120.0", "Z_mm = 120000.0")),
    "tool of another spindle": ("OLP454", swap(M, "Z_mm = 120.0", "Z_mm = 1200.0")),
    "tool of the calibration in um": ("OLP455", vector(C, "tool_mm", 1000.0, 0)),
    "work offset in um": ("OLP456", number(M, "X_mm", 1000.0)),
    "work offset 25.4 times": ("OLP456", number(M, "X_mm", INCH)),
    "start in um": ("OLP456", swap(J, "payload_kg", "start_mm = { X = 100000.0 }\npayload_kg")),
    "scale in degF": ("OLP457", swap(J, "X_scale = 21.0", "X_scale = 68.0")),
    "scale in K": ("OLP457", swap(J, "X_scale = 21.0", "X_scale = 293.15")),
    "workpiece in degF": ("OLP457", swap(J, "workpiece = 21.5", "workpiece = 70.7")),
    "calibration in degF": ("OLP457", swap(C, "temperature_degC = 20.0", "temperature_degC = 68.0")),
    "calibration in K": ("OLP457", swap(C, "temperature_degC = 20.0", "temperature_degC = 293.15")),
    "expansion in mm/m/K": ("OLP458", number(C, "X_scale_um_m_K", 1e-3)),
    "expansion in nm/m/K": ("OLP458", number(C, "X_scale_um_m_K", 1000.0)),
    "expansion of the workpiece in nm/m/K": ("OLP458", number(C, "workpiece_um_m_K", 1000.0)),
    "payload in g": ("OLP459", swap(J, "payload_kg = 0.0", "payload_kg = 30000.0")),
    "payload of the calibration in g": ("OLP459", swap(C, "datum_mm", "payload_kg = 30000.0\ndatum_mm")),
    "backlash in nm": ("OLP447", number(C, "X_um", 1000.0)),
    "amplitude in nm": ("OLP448", number(C, "amplitude_um", 1000.0)),
    "period in um": ("OLP448", number(C, "period_mm", 1000.0)),
    "period in m": ("OLP448", number(C, "period_mm", 1e-3)),
    "a digit too many": ("OLP449", one_value("EXX_um", 1.0, 4000.0)),
    "a point left out": ("OLP449", one_value("EYY_um", 1.0, 1500.0)),
    "an angle without its point": ("OLP449", one_value("ECX_urad", 1.0, 2500.0)),
    "a small spike": ("OLP449", one_value("EXZ_um", 1.0, 60.0)),
    "one column in mm": ("OLP450", column("EYX_um", 1e-3)),
    "one column in nm": ("OLP409", column("EZY_um", 1000.0)),
    "one angle in mrad": ("OLP450", column("EAX_urad", 1e-3)),
    "errors of one axis 25.4 times": ("OLP445", errors(INCH, "x", "XYZ")),
    "angles in mrad": ("OLP450", errors(1e-3, kinds="ABC")),
    "angles in degrees": ("OLP450", errors(57.3e-6, kinds="ABC")),
    "every squareness in mrad": ("OLP450", number(C, "(?:C0Y|B0Z|A0Z)_urad", 1e-3, 0)),
    "laser not set to zero": ("OLP464", cells(lambda c, _, v: v + 500.0 if c == "EXX_um" else v, "x")),
    "autocollimator not set to zero": (
        "OLP464", cells(lambda c, _, v: v + 2e3 if c == "EAX_urad" else v, "x")),
    "map in mm": ("OLP451", mapped(1e-3)),
    "map in nm": ("OLP409", mapped(1000.0)),
    "load in nm per kg": ("OLP409", loaded(1000.0)),
    "positions of a curve 25.4 times": ("OLP453", cells(lambda c, _, v: v * INCH if c == "X_mm" else v, "x")),
    "phase in degrees": ("OLP448", swap(C, "phase_rad = 0.3", "phase_rad = 17.2")),
    "expansion in m/m/K": ("OLP458", number(C, "X_scale_um_m_K", 1e-6)),
    "tool vector with another sign than its length": ("OLP454", swap(
        M, "Z_mm = 120.0", "Z_mm = 120.0\ngauge_to_tip_mm = [0.0, 0.0, 120.0]")),
    "tool vector in inches": ("OLP454", swap(
        M, "Z_mm = 120.0", "Z_mm = 120.0\ngauge_to_tip_mm = [0.0, 0.0, -4.724]")),
    "tool of the calibration with another sign": ("OLP454", swap(
        C, r"\[0\.0, 0\.0, -120\.0\]", "[0.0, 0.0, 120.0]", 0)),
    "tool of the calibration in inches": ("OLP454", vector(C, "tool_mm", 1 / INCH, 0)),
    "work offset of another machine": ("OLP456", swap(M, "X_mm = 250.0", "X_mm = 2500.0")),
    "least increment in um": ("OLP465", number(M, "least_increment_mm", 1000.0, 0)),
    "speed in mm/min": ("OLP465", number(M, "velocity_mm_s", 60.0, 0)),
    "speed in m/s": ("OLP465", number(M, "velocity_mm_s", 1e-3, 0)),
}  # fmt: skip
#: Slips by which a file cannot be read, or not be that of this machine: refused as input, and by what words.
REFUSED: dict[str, tuple[str, Edit]] = {
    "half of a curve": ("x.csv|curve of axis X runs from", rows(lambda lines: lines[: len(lines) // 2])),
    "a row twice": ("is repeated", rows(lambda lines: [*lines[:10], lines[9], *lines[10:]])),
    "rows interchanged": ("comes after", rows(lambda lines: [*lines[:9], lines[10], lines[9], *lines[11:]])),
    "no number": (
        "is not finite", cells(lambda c, k, v: float("nan") if (c, k) == ("EXX_um", 9) else v, "x")),
    "decimal commas": ("columns are separated by", swap("x.csv", r"[.,]", lambda m: ";," [m[0] == "."], 0)),
    "curve of another axis": (
        "in two curves", lambda folder: (folder / "x.csv").write_bytes((folder / "y.csv").read_bytes())),
    "positions of a curve in m": ("runs from", cells(lambda c, _, v: v * 1e-3 if c == "X_mm" else v, "x")),
    "positions of a map in inches": ("runs from", mapped(1.0, 1 / INCH)),
    "box in um": ("runs from", vector(C, "box_mm", 1000.0)),
    "travel left out": ("travel_mm is missing", swap(M, "travel_mm = .*\n", "")),
    "another machine": (
        "is not the name in the machine file", swap(C, 'machine = ".*"', 'machine = "mill-7"')),
    "another sign": ("sign = ", swap(C, "actual-minus-commanded", "commanded-minus-actual")),
    "numbers of other tools": ("is not defined", swap(M, r"\[tools.1\]", "[tools.11]")),
    "valid before it was measured": (
        "is before measured", swap(C, "valid_until = .*", "valid_until = 2025-01-01")),
    "work offset in inches": ("outside the calibrated box", number(M, "X_mm", 1 / INCH)),
    "touch-off value for a length": ("touch-off value", swap(M, "Z_mm = 120.0", "Z_mm = -120.0")),
}  # fmt: skip
#: Slips on a control where a decimal point decides.
POINTS = {"no decimal point": ("OLP461", BARE)}


def run(verb: str, folder: Path, *args: object, program: bytes = TEXT) -> tuple[int, str]:
    (folder / "part.nc").write_bytes(program)
    outputs = {
        "correct": ["-o", folder / "out.nc"],
        "simulate": ["-o", folder / "out.csv"],
        "view": ["-o", folder / "out.html", "--no-time"],
        "retime": ["-o", folder / "out.csv"],
    }
    texts = [folder / "part.nc"] * (1 + (verb == "verify"))
    call = [verb, *texts, "-m", folder / M, "-j", folder / J, "--date", DAY, *outputs.get(verb, []), *args]
    result = CliRunner().invoke(main, [str(part) for part in call])
    return result.exit_code, result.output


def told(output: str) -> set[str]:
    return set(re.findall(r"error: (OLP[0-9]{3})", output))


@pytest.mark.slow
def test_without_a_slip_all_verbs_go_on(tmp_path: Path) -> None:
    folder = written(tmp_path / "sane")
    for verb in ("correct", "simulate", "view", "check"):
        code, output = run(verb, folder, "--force" if verb != "check" else "-q")
        assert code == 0, (verb, output)


@pytest.mark.parametrize("name", some_fast(SLIPS, 8))
def test_a_slip_is_told_before_a_program_is_written(name: str, tmp_path: Path) -> None:
    code, slip = SLIPS[name]
    folder = written(tmp_path / "slip")
    slip(folder)
    status, output = run("correct", folder)
    assert status == 3, output
    assert not (folder / "out.nc").exists()
    codes = told(output)
    assert code in codes, output
    assert all(f"--accept {each}" in output for each in codes)
    # accepted: whatever else stops it is no doubt
    _, output = run("correct", folder, "--accept", ",".join(codes), "--fail-on", "never")
    assert not told(output) & codes, output


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_cannot_be_right_is_refused(name: str, tmp_path: Path) -> None:
    words, slip = REFUSED[name]
    folder = written(tmp_path / "slip")
    slip(folder)
    status, output = run("correct", folder)
    assert (status, (folder / "out.nc").exists()) == (3, False), output
    assert re.search(words, output), output


@pytest.mark.parametrize("edit", [mapped(1.0), loaded(1.0), swap("x.csv", "^", "\ufeff")])
def test_the_same_without_a_slip_raises_no_doubt(edit: Edit, tmp_path: Path) -> None:
    folder = written(tmp_path / "sane")
    edit(folder)
    status, output = run("correct", folder)
    assert status == 0, output
    assert not re.search("OLP4[0-9]+  (warning|error)", output), output


def test_points_left_out_of_all_numbers_are_told(tmp_path: Path) -> None:
    folder = written(tmp_path / "points", CONTROL)
    swap(M, 'decimal_point = "increment"\n', "")(folder)
    assert run("correct", folder, program=BARE)[0] == 3
    assert told(run("correct", folder, program=BARE)[1]) == {"OLP461"}
    mixed = BARE.replace(b"X300 ", b"X300. ")
    result = olp.correct(mixed, folder / M)
    assert [f.severity for f in result.findings if f.code == "OLP302"] == [Severity.WARNING]
    for stated in ("increment", "calculator"):
        swap(M, "(?:decimal_point = .*\n)?controller", f'decimal_point = "{stated}"\ncontroller')(folder)
        codes = {f.code for f in olp.correct(BARE, folder / M, outside_box="hold").findings}
        assert not codes & {"OLP302", "OLP461"}


@pytest.mark.parametrize("verb", ["correct", "verify", "simulate", "view", "retime", "check"])
@pytest.mark.parametrize(
    "name", some_fast(["squareness C0Y in nrad", "zeros", "tool in metres", "expired"], 2)
)
def test_every_verb_tells_it(verb: str, name: str, tmp_path: Path) -> None:
    folder = written(tmp_path / "slip")
    SLIPS[name][1](folder)
    status, output = run(verb, folder)
    assert status == (1 if verb == "check" else 3), output
    assert not list(folder.glob("out*"))
    code = SLIPS[name][0]
    assert re.search(rf"{code}", output)


@pytest.mark.slow
def test_what_was_accepted_is_in_stamp_and_report_and_holds_for_the_corrected_program(tmp_path: Path) -> None:
    folder = written(tmp_path / "slip")
    swap(C, "C0Y_urad = .*", "C0Y_urad = 9000.0")(folder)
    machine, job = folder / M, folder / J
    with pytest.raises(Doubtful) as caught:
        olp.correct(TEXT, machine, job)
    assert caught.value.codes == ("OLP409",)
    assert caught.value.exit_code == 3
    done = olp.correct(TEXT, machine, job, accept=["olp409", "OLP457"])
    assert done.report["accepted"] == ["OLP409"]
    assert re.search(rb"olp-corrected [0-9a-f]{12} olp \S+ accepted OLP409\)", done.data)
    accepted = [f for f in done.findings if f.code == "OLP409"]
    assert [f.severity for f in accepted] == [Severity.WARNING]
    assert accepted[0].as_dict()["accepted"] is True
    assert olp.verify(TEXT, done.data, machine, job).report["accepted"] == ["OLP409"]
    for checked in (olp.check(done.data, machine, job), olp.check(done.data, machine, job, nominal=TEXT)):
        assert checked.report["accepted"] == ["OLP409"]
    assert olp.retime(done.data, machine, job).report["accepted"] == ["OLP409"]
    assert any(f.accepted for f in olp.simulate(done.data, machine, job).findings)
    assert olp.view(TEXT, machine, job, corrected=done.data).scene.report["accepted"] == ["OLP409"]
    for call in (olp.simulate, olp.retime, olp.view):
        with pytest.raises(Doubtful):
            call(TEXT, machine, job)
    assert "OLP409" in {f.code for f in olp.check(TEXT, machine, job).findings if not f.accepted}


def test_only_doubts_can_be_accepted(tmp_path: Path) -> None:
    folder = written(tmp_path / "sane")
    for code in ("OLP101", "OLP999"):
        assert run("correct", folder, "--accept", code)[0] == 2
        with pytest.raises(UsageError):
            olp.correct(TEXT, folder / M, accept=[code])
    assert acceptable(["OLP409"]) == {"OLP409"}
    assert {"OLP302", "OLP401", "OLP406", "OLP409"} < DOUBTS


def test_a_machine_file_states_another_limit(tmp_path: Path) -> None:
    folder = written(tmp_path / "limit")
    swap(M, r"\[axes\.X\]", "[check]\nlargest_correction_um = 20.0\n[axes.X]")(folder)
    with pytest.raises(Doubtful, match="OLP409"):
        olp.correct(TEXT, folder / M)


def test_today_is_a_day(tmp_path: Path) -> None:
    folder = written(tmp_path / "today")
    swap(C, "valid_until = .*", f"valid_until = {datetime.date.today()}")(folder)
    code, output = run("correct", folder, "--date", "today")
    assert code == 0, output
    assert run("correct", folder, "--force", "--date", "tomorrow")[0] == 2


@pytest.mark.parametrize(("reduced", "freedom", "fails"), [
    (25.0, 400.0, True), (5.0, 100.0, True), (3.9, 1e5, False), (1.1, 1e5, False), (12.0, 2.0, False),
])  # fmt: skip
def test_a_fit_fails_by_probability_and_size(
    reduced: float, freedom: float, fails: bool, tmp_path: Path
) -> None:
    folder = written(tmp_path / "fit")
    quality(reduced, freedom)(folder)
    codes = {f.code for f in olp.check(TEXT, folder / M, select=["OLP44"]).findings}
    assert ("OLP443" in codes) == fails
    assert "OLP444" not in codes


@pytest.mark.slow
def test_a_fit_states_its_quality(tmp_path: Path) -> None:
    folder = PROGRAMS / "gantry-lines"
    fitted = olp.fit_calibration(folder, folder / M)
    for path, data in fitted.files(tmp_path / C).items():
        path.write_bytes(data)
    read, made = load_calibration(tmp_path / C).quality, fitted.calibration.quality
    assert read is not None and made is not None
    assert read.total.chi_square == pytest.approx(fitted.fit.chi_square, abs=1e-3)
    assert read.total.freedom == pytest.approx(fitted.fit.freedom, abs=1e-3)
    assert {fitted.source for fitted in read.sources} >= {"laser-x.txt", "eax.csv"}
    assert sum(fitted.chi_square for fitted in read.sources) == pytest.approx(read.total.chi_square, rel=0.01)
    assert sum(fitted.freedom for fitted in read.sources) == pytest.approx(read.total.freedom, rel=0.01)
    assert read.failed() == ()


@pytest.mark.parametrize("factor", some_of_a_campaign((25.4, -1.0), 2))
@pytest.mark.slow
def test_a_fit_with_a_line_in_another_unit_or_sign_is_refused(factor: float, tmp_path: Path) -> None:
    folder = tmp_path / "lines"
    shutil.copytree(PROGRAMS / "gantry-lines", folder)
    head, *rows = (folder / "eyz-left.csv").read_text().splitlines()
    scaled = [row.rsplit(",", 1) for row in rows]
    lines = [f"{before},{float(value) * factor!r}" for before, value in scaled]
    (folder / "eyz-left.csv").write_text("\n".join([head, *lines]) + "\n")
    for path, content in olp.fit_calibration(folder, folder / M).files(folder / C).items():
        path.write_bytes(content)
    with pytest.raises(Doubtful, match=r"OLP443.*eyz"):
        olp.correct(b"G21 G90\nG53 G0 Z-100\nM2\n", folder / M)


def test_a_run_joins_the_quality_of_what_it_refines() -> None:
    run = Fitted("run.csv", 30.0, 20.0)
    alone = with_run(None, run)
    assert alone.total.reduced == 1.5 and alone.sources == (run,)
    both = with_run(Quality(Fitted("all readings", 100.0, 100.0), (Fitted("a.csv", 100.0, 100.0),)), run)
    assert (both.total.chi_square, both.total.freedom) == (130.0, 120.0)
    assert [fitted.source for fitted in both.sources] == ["a.csv", "run.csv"]


def test_a_machine_without_errors_is_a_warning(tmp_path: Path) -> None:
    done = olp.correct(TEXT, zero_machine(tmp_path / "none", Recipe(tools=TOOLS)))
    assert [f.code for f in done.findings if f.code in DOUBTS and f.severity > Severity.INFO] == ["OLP441"]
    assert done.data == TEXT


def doubts_of(findings: tuple[olp.Finding, ...]) -> list[str]:
    return [f"{f.code} {f.message}" for f in findings if f.code in DOUBTS and f.severity > Severity.INFO]


JOBS = sorted(path for path in PROGRAMS.glob("*/job*.toml") if path.parent.name not in JOINT_JOBS)


@pytest.mark.parametrize("job", JOBS, ids=lambda p: p.parent.name + p.stem)
def test_shipped_jobs_raise_no_doubt(job: Path) -> None:
    program = olp.load_setup(None, job).job.program
    assert program is not None
    date = datetime.date(2026, 11, 21)
    assert doubts_of(olp.check(program, None, job, select=sorted(DOUBTS), date=date).findings) == []


@pytest.mark.parametrize("seed", some_fast(range(100), 12, 3))
def test_random_machines_raise_no_doubt(seed: int, tmp_path: Path) -> None:
    recipe = Recipe(
        chain=CHAINS[seed % 24], off_datum=seed % 2 == 1, cyclic=seed % 3 == 0,
        backlash_um={"Z": 5.0} if seed % 4 == 0 else {}, directed="XY" if seed % 5 == 0 else "",
    )  # fmt: skip
    machine = random_machine(tmp_path / "m", seed, recipe)
    text = b"G21 G90 G54\nG43 H%d\nG0 X0 Y0 Z0\nG1 X300 Y200 F600\nG1 X-200 Y10 Z60\nM2\n" % (1 + seed % 2)
    doubts = olp.simulate(text, machine, step_mm=500.0, date=datetime.date(2026, 6, 1)).findings
    assert doubts_of(doubts) == []


def test_a_hobby_router_out_of_square_raises_no_doubt(tmp_path: Path) -> None:
    folder = tmp_path / "router"
    travel = ((0.0, 900.0), (0.0, 900.0), (-100.0, 0.0))
    offsets = {"G54": {"X_mm": 100.0, "Y_mm": 100.0, "Z_mm": -90.0, "set_by": "true"}}
    recipe = Recipe(travel=travel, tools=TOOLS, work_offsets=offsets, backlash_um={"X": 120.0})
    random_machine(folder, 1, recipe)
    swap(C, "C0Y_urad = .*", "C0Y_urad = 667.0")(folder)
    text = b"G21 G90\nG0 X0 Y0 Z80\nG1 X790 Y790 Z10 F600\nM2\n"
    assert doubts_of(olp.simulate(text, folder / M, step_mm=100.0).findings) == []


def test_every_doubt_has_its_rule() -> None:
    new = {code for code, rule in RULES.items() if rule.topic == "doubt"}
    assert new <= DOUBTS
    assert all(RULES[code].doubt for code in DOUBTS)
