"""The results of Python calls as arrays, as files and in notebooks."""

from __future__ import annotations

import math
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli.test_cli import PROGRAMS, run

import olp
from olp.core.arrays import read_only
from olp.core.errors import ConfigError, UsageError
from olp.reports.notebook import fragment
from olp.workflows.shown import Filed, Judged, Shown

CMM = PROGRAMS / "bridge-cmm"
MACHINE = CMM / "machine.toml"
NASTY = PROGRAMS / "nasty"


@pytest.fixture(scope="module")
def corrected() -> olp.Correction:
    return olp.correct(NASTY / "helix-turns.ngc", NASTY / "machine.toml")


# -- error_at ------------------------------------------------------------------------------------


def test_many_positions_give_what_each_gives_alone() -> None:
    box = np.array([(100.0, 800.0), (100.0, 1100.0), (-500.0, -100.0)])
    points = np.random.default_rng(1).uniform(*box.T, (20, 3))
    many = olp.error_at(MACHINE, points, tool=1)
    assert many["error_um"].shape == many["rotation_urad"].shape == (20, 3)
    for k, point in enumerate(points):
        one = olp.error_at(MACHINE, tuple(point), tool=1)
        assert one["error_um"].shape == (3,)
        np.testing.assert_allclose(many["error_um"][k], one["error_um"], rtol=0, atol=1e-9)
        np.testing.assert_allclose(many["rotation_urad"][k], one["rotation_urad"], rtol=0, atol=1e-9)
    parts = sum(source["error_um"] for source in many["sources"])
    assert np.abs(parts - many["error_um"]).max() < 0.01, "sources add up to first order"


def test_lists_arrays_and_tuples_are_the_same() -> None:
    tool = olp.error_at(MACHINE, [450, 600, -300], tool=1)["tool_mm"]
    given = [
        olp.error_at(MACHINE, [450, 600, -300], 1),
        olp.error_at(MACHINE, np.array([450.0, 600.0, -300.0]), np.int64(1)),
        olp.error_at(MACHINE, (450.0, 600.0, -300.0), np.array(tool)),
    ]
    assert len({tuple(result["error_um"]) for result in given}) == 1


def test_no_position_is_an_answer_too() -> None:
    assert olp.error_at(MACHINE, np.zeros((0, 3)))["error_um"].shape == (0, 3)


def test_outside_the_box_the_row_is_named_or_the_face_holds() -> None:
    points = [[450.0, 600.0, -300.0], [450.0, 5000.0, -300.0]]
    with pytest.raises(
        ConfigError, match=r"Y = 5000 mm in row 1 is outside the calibrated box, 10 to 1190 mm"
    ):
        olp.error_at(MACHINE, points)
    held = olp.error_at(MACHINE, points, outside_box="hold")["error_um"]
    np.testing.assert_allclose(held[1], olp.error_at(MACHINE, [450.0, 1190.0, -300.0])["error_um"])


@pytest.mark.parametrize(("position", "says"), [
    ([1.0, 2.0], r"shape \(2,\); expected \(3,\)"), (np.zeros((3, 4)), r"shape \(3, 4\)"),
    (np.zeros((1, 2, 3)), "expected"), ([1.0, np.nan, 2.0], "not finite"), ("X1 Y2", "no numbers"),
    (5.0, r"shape \(\)"),
])  # fmt: skip
def test_what_is_no_position_is_refused(position: Any, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        olp.error_at(MACHINE, position)
    with pytest.raises(UsageError, match="tool has 2 values"):
        olp.error_at(MACHINE, [450.0, 600.0, -300.0], (1.0, 2.0))


def test_the_verb_says_the_same() -> None:
    values = olp.error_at(MACHINE, [450.0, 600.0, -300.0], 1)["error_um"]
    text = run("inspect", MACHINE, "--at", "450", "600", "-300", "--tool", "1", "--json").stdout
    stated = re.search(r'"error_um": \[\s*([-\d.e]+),\s*([-\d.e]+),\s*([-\d.e]+)\s*\],\s*"payload', text)
    assert stated is not None
    np.testing.assert_allclose([float(v) for v in stated.groups()], values)


# -- columns -------------------------------------------------------------------------------------


def test_a_correction_has_its_judgements_as_columns(corrected: olp.Correction) -> None:
    n = len(corrected.table.line)
    assert (
        corrected.line.shape == corrected.tool.shape == corrected.judged.shape == corrected.over.shape == (n,)
    )
    assert corrected.uncorrected_um.shape == corrected.corrected_um.shape == (n,)
    assert corrected.position_mm.shape == (n, 3)
    largest = np.nanmax(corrected.corrected_um[corrected.judged])
    assert largest == pytest.approx(corrected.report["deviation"]["path_max_um"], rel=1e-6)
    assert np.nanmax(corrected.uncorrected_um[corrected.judged]) > 2 * largest
    by_line = corrected.table.by_line()
    for line, largest in zip(by_line["line"], by_line["corrected_um"], strict=True):
        rows = (corrected.line == line) & corrected.judged
        if rows.any():
            assert np.nanmax(corrected.corrected_um[rows]) == pytest.approx(largest)


def test_a_verification_has_the_same_columns(corrected: olp.Correction) -> None:
    again = olp.verify(NASTY / "helix-turns.ngc", corrected.data, NASTY / "machine.toml")
    for name in ("line", "judged", "uncorrected_um", "corrected_um", "position_mm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(corrected, name))


def test_columns_refuse_to_be_changed(corrected: olp.Correction) -> None:
    names = [name for name, value in vars(Judged).items() if isinstance(value, property)]
    assert len(names) >= 6
    for name in [*names, "position_mm"]:
        with pytest.raises(ValueError, match="read-only"):
            getattr(corrected, name)[:1] = 0
    own = np.arange(3.0)
    assert not read_only(own).flags.writeable and own.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        olp.error_at(MACHINE, [450.0, 600.0, -300.0])["error_um"][0] = 1.0


@pytest.mark.slow
def test_a_comparison_has_the_columns_of_its_table(tmp_path: Path) -> None:
    program, machine = CMM / "housing.ngc", MACHINE
    measured = olp.simulate(program, machine, step_mm=20.0).write(tmp_path / "run.csv")
    done = olp.compare(program, [measured, measured], machine)
    rows = [line.split(",") for line in b"".join(done.to_csv()).decode().splitlines()]
    columns = dict(zip(rows[0], zip(*rows[1:], strict=True), strict=True))
    n = len(rows) - 1
    assert done.run.tolist() == [0] * (n // 2) + [1] * (n // 2)
    for own, name in (("line", "line"), ("counted", "counted"), ("deviation_um", "size_um"),
                      ("along_um", "along_um"), ("normal_um", "normal_um"),
                      ("binormal_um", "binormal_um")):  # fmt: skip
        values = getattr(done, own)
        np.testing.assert_allclose(values, np.array(columns[name], float), atol=1e-4)
        assert not values.flags.writeable
    assert done.measured_mm.shape == done.nominal_mm.shape == (n, 3)
    away = np.linalg.norm(done.measured_mm - done.nominal_mm, axis=1)[done.counted] * 1e3
    assert (away <= done.deviation_um[done.counted] + 1e-6).all()


# -- files ---------------------------------------------------------------------------------------


def test_write_writes_the_bytes_and_overwrites_with_force_only(
    corrected: olp.Correction, tmp_path: Path
) -> None:
    target = tmp_path / "out.ngc"
    assert corrected.write(target) == target
    assert target.read_bytes() == corrected.data
    target.write_bytes(b"mine")
    with pytest.raises(UsageError, match="exists already"):
        corrected.write(target)
    assert target.read_bytes() == b"mine"
    corrected.write(str(target), force=True)
    assert target.read_bytes() == corrected.data
    assert [path.name for path in tmp_path.iterdir()] == ["out.ngc"]


@pytest.mark.parametrize("name", ["helix-turns.ngc", "machine.toml", "calibration.toml", "x.csv"])
def test_write_never_overwrites_what_was_read(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "nasty"
    shutil.copytree(NASTY, folder)
    result = olp.correct(folder / "helix-turns.ngc", folder / "machine.toml")
    before = (folder / name).read_bytes()
    with pytest.raises(UsageError, match="is an input of this call"):
        result.write(folder / name, force=True)
    assert (folder / name).read_bytes() == before


@pytest.mark.slow
def test_a_fitted_calibration_spares_its_measurements(tmp_path: Path) -> None:
    folder = tmp_path / "lines"
    shutil.copytree(PROGRAMS / "gantry-lines", folder, ignore=shutil.ignore_patterns("calibration*"))
    fitted = olp.fit_calibration(folder, folder / "machine.toml")
    names = [path.name for path in fitted.write(folder / "calibration.toml")]
    assert "calibration.toml" in names and len(names) > 3
    assert olp.error_at(folder / "machine.toml", [800.0, 500.0, -100.0])["error_um"].shape == (3,)
    assert issubclass(olp.CalibrationDiagnosis, Filed) and issubclass(olp.RefinedCalibration, Filed)
    victim = next(Path(name) for name in fitted.inputs if name.endswith("exy.csv"))
    with pytest.raises(UsageError, match="is an input of this call"):
        fitted.write(victim, force=True)


# -- notebooks -----------------------------------------------------------------------------------


class Text(HTMLParser):
    """The text of a piece of HTML, and its elements."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.text, self.elements = "", list[str]()
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def shown(result: Shown) -> Text:
    text = Text(result._repr_html_())
    assert text.elements == ["pre"]
    assert text.text == result.to_text().rstrip("\n")
    return text


@pytest.mark.slow
def test_notebooks_show_what_the_terminal_shows(corrected: olp.Correction, tmp_path: Path) -> None:
    program, machine = NASTY / "helix-turns.ngc", NASTY / "machine.toml"
    printed = run("correct", program, "-m", machine, "-o", tmp_path / "out.ngc").stdout
    assert shown(corrected).text in printed
    assert (
        shown(olp.verify(program, corrected.data, machine)).text
        in run("verify", program, tmp_path / "out.ngc", "-m", machine).stdout
    )
    assert shown(olp.check(program, machine)).text in run("check", program, "-m", machine).stdout
    assert "points" in shown(olp.simulate(program, machine)).text


@pytest.mark.slow
def test_every_result_has_a_report_for_notebooks(tmp_path: Path) -> None:
    lines = PROGRAMS / "gantry-lines"
    fitted = olp.fit_calibration(lines, lines / "machine.toml")
    assert shown(fitted).text in run("calibrate", "fit", lines, "-m", lines / "machine.toml").stdout
    calibration = fitted.write(tmp_path / "calibration.toml")[0]
    diagnosis = olp.diagnose_calibration(calibration, lines / "tracker.csv", lines / "machine.toml")
    plan = olp.plan_measurements(lines / "machine.toml")
    program, machine = PROGRAMS / "nasty/modal.ngc", PROGRAMS / "nasty/machine.toml"
    timed = olp.retime(program, machine)
    measured = olp.simulate(program, machine).write(tmp_path / "run.csv")
    compared = olp.compare(program, [measured], machine)
    refined = olp.refine_calibration(
        calibration, lines / "tracker.csv", lines / "machine.toml", frame_known=False
    )
    for result in (diagnosis, refined, plan, timed, compared):
        assert len(shown(result).text) > 200


def test_characters_of_a_report_are_data() -> None:
    text = '<script>alert(1)</script> & "x"\n\x1b[31mred\x07'
    html = fragment(text, True)
    assert html.count("<") == 2 and "\x1b" not in html and "\x07" not in html
    assert Text(html).text == '<script>alert(1)</script> & "x"\n [31mred '
    assert len({fragment("x", ok) for ok in (True, False, None)}) == 3


def test_every_public_result_is_shown() -> None:
    results = ("Correction", "Verification", "Check", "Comparison", "Retiming", "Simulation",
               "ResultCorrection", "FittedCalibration", "CalibrationDiagnosis", "RefinedCalibration",
               "MeasurementPlan", "ThermalFitting")  # fmt: skip
    assert all(issubclass(getattr(olp, name), Shown) for name in results)


def test_an_input_is_spared_from_another_folder_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Notebooks change their folder; what was read keeps its place."""
    shutil.copytree(PROGRAMS / "table-router", tmp_path / "router")
    (tmp_path / "router" / "below").mkdir()
    monkeypatch.chdir(tmp_path / "router")
    result = olp.correct("outline.ngc", "machine.toml")
    monkeypatch.chdir("below")
    for name in ("machine.toml", "outline.ngc", "calibration.toml"):
        with pytest.raises(UsageError, match="is an input of this call and is never overwritten"):
            result.write(f"../{name}", force=True)


def test_a_simulation_has_read_only_columns(tmp_path: Path) -> None:
    router = PROGRAMS / "table-router"
    for text in ((router / "outline.ngc").read_bytes(), b"M30\n"):
        result = olp.simulate(text, router / "machine.toml")
        assert result.line.dtype == np.int64
        assert len(result.line) == len(result.points_mm)
        assert not (result.line.flags.writeable or result.points_mm.flags.writeable)
    assert not olp.correct(router / "outline.ngc", router / "machine.toml").groups.flags.writeable


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "5"])
@pytest.mark.parametrize("name", ["tolerance_um", "part_tolerance_um", "peck_clearance_mm"])
def test_a_tolerance_that_is_none_is_refused_before_the_work(name: str, value: float | str) -> None:
    with pytest.raises(UsageError, match=rf"{name} = .*: expected a finite number above zero"):
        olp.correct(CMM / "housing.ngc", MACHINE, **{name: value})  # type: ignore[arg-type]


def test_a_step_that_is_none_is_refused_before_the_work() -> None:
    with pytest.raises(UsageError, match="step_mm = 0: expected a finite number above zero"):
        olp.simulate(CMM / "housing.ngc", MACHINE, step_mm=0)
