"""The conformance suite of control settings: each registered format is recognised, read, and a machine."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

import pytest
from cases.control_settings import (
    GRBL,
    GRBLHAL,
    HEIDENHAIN,
    KLIPPER,
    LINUXCNC,
    MARLIN,
    SAMPLES,
    SINUMERIK,
    Sample,
)

from olp.core.errors import InputError
from olp.core.machine import Machine
from olp.files.config import load_machine
from olp.files.machine_settings.base import Settings
from olp.files.machine_settings.registry import FORMATS, MODULES, read_settings, recognised
from olp.files.starter import machine_toml, starter_machine

EACH = pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)


def settings(folder: Path, text: str, name: str = "settings.txt") -> Settings:
    (folder / name).write_text(text, "utf-8")
    return read_settings(folder / name)


def machine_of(read: Settings, sample: Sample) -> Machine:
    travel = {axis: stated.travel_mm for axis, stated in read.axes.items() if stated.travel_mm}
    return starter_machine("mill", "YFXZ", travel, sample.controller, settings=read)


def test_every_format_has_a_sample_and_a_source() -> None:
    assert {sample.key for sample in SAMPLES} == set(FORMATS) == set(MODULES)
    assert all(form.source and form.title for form in FORMATS.values())


@EACH
def test_a_sample_is_recognised_by_its_contents_alone(sample: Sample) -> None:
    assert [form.key for form in recognised(sample.text)] == [sample.key]
    assert [form.key for form in recognised(sample.text.replace("\n", "\r\n"))] == [sample.key]


@EACH
def test_what_a_sample_states(sample: Sample, tmp_path: Path) -> None:
    read = settings(tmp_path, sample.text)
    axes = [read.axes[axis] for axis in "XYZ"]
    assert read.controller == sample.controller
    assert {axis: one.travel_mm for axis, one in read.axes.items()} == sample.travel_mm
    assert [axis.velocity_mm_s for axis in axes] == pytest.approx(sample.velocity_mm_s)
    assert [axis.acceleration_mm_s2 for axis in axes] == pytest.approx(sample.acceleration_mm_s2)
    assert [axis.jerk_mm_s3 for axis in axes] == list(sample.jerk_mm_s3)
    assert {axis.least_increment_mm for axis in axes} == {sample.least_increment_mm}
    assert read.compensated == sample.compensated
    assert {name: offset.offset_mm for name, offset in read.work_offsets.items()} == sample.offsets
    for note in sample.notes:
        assert note in " ".join(read.notes)


@EACH
def test_notes_are_sentences(sample: Sample, tmp_path: Path) -> None:
    for note in settings(tmp_path, sample.text).notes:
        assert re.match(r"[A-Z\[$]", note), note
        assert note.endswith("."), note
        assert len(note.split()) <= 60


@EACH
def test_the_machine_file_loads_as_the_machine_that_was_read(sample: Sample, tmp_path: Path) -> None:
    read = settings(tmp_path, sample.text)
    machine = machine_of(read, sample)
    text = machine_toml(machine, read.notes)
    (tmp_path / "machine.toml").write_text(text)
    loaded = load_machine(tmp_path / "machine.toml")
    assert loaded.axes == machine.axes
    assert loaded.compensated_by_controller == machine.compensated_by_controller
    assert loaded.missing_limits == machine.missing_limits
    commented = " ".join(line.removeprefix("# ") for line in text.splitlines())
    assert all(note in commented for note in read.notes)


@EACH
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_file_that_a_terminal_of_windows_saved(sample: Sample, encoding: str, tmp_path: Path) -> None:
    if sample.key == "linuxcnc" and encoding == "utf-16":
        pytest.skip("LinuxCNC itself reads no such file")
    (tmp_path / "a.txt").write_bytes(sample.text.replace("\n", "\r\n").encode(encoding))
    assert read_settings(tmp_path / "a.txt").axes == settings(tmp_path, sample.text).axes


@pytest.mark.parametrize(
    ("text", "number", "wrong"),
    [
        (LINUXCNC, "MAX_LIMIT = 400", "MAX_LIMIT = ten"),
        (GRBL, "$130=750.000", "$130=?"),
        (KLIPPER, "position_max: 235", "position_max: far"),
        (SINUMERIK, "[AX1]=1500.6", '[AX1]="x"'),
        (HEIDENHAIN, "MP910.0: +510", "MP910.0: far"),
    ],
)
def test_a_number_that_is_none_is_named_with_its_place(
    text: str, number: str, wrong: str, tmp_path: Path
) -> None:
    assert number in text
    with pytest.raises(InputError, match="is not a number") as error:
        settings(tmp_path, text.replace(number, wrong))
    assert str(tmp_path / "settings.txt") in str(error.value)
    assert re.search(r"settings\.txt:\d+: |\[AXIS_X\]", str(error.value))
    assert " line " not in str(error.value), "the line is said once"


@pytest.mark.parametrize(
    "text", ["", "G21 G90\nG1 X10 F100\n", "schema = 'olp-machine-1'\n", "$0=10\n$1=25\n"]
)
def test_any_other_file_is_refused_with_what_is_known(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no settings of a control") as error:
        settings(tmp_path, text)
    assert all(form.title in str(error.value) for form in FORMATS.values())


@pytest.mark.parametrize("sample", SAMPLES[1:], ids=lambda sample: sample.name)
def test_a_number_without_end_is_no_number(sample: Sample, tmp_path: Path) -> None:
    """Each number in turn becomes one that no double holds: read as none, or refused with its place."""
    for match in re.finditer(r"(?<=[=: ])[-+]?\d+\.?\d*(?=\s)", sample.text):
        text = sample.text[: match.start()] + "1e999" + sample.text[match.end() :]
        with contextlib.suppress(InputError):
            stated = settings(tmp_path, text).axes
            assert "inf" not in repr(stated)


def test_two_formats_in_one_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"may be the answer of Grbl or grblHAL to .* or the answer of Marlin"
    ):
        settings(tmp_path, GRBL + MARLIN)


# -- facts of one format ------------------------------------------------------------------------------------


def travel(folder: Path, text: str) -> dict[str, tuple[float, float] | None]:
    return {axis: one.travel_mm for axis, one in settings(folder, text).axes.items()}


@pytest.mark.parametrize(
    ("old", "new", "x", "y"),
    [
        # the build option Z of $I: an axis that homes to its lower end runs upwards
        ("ok\n", "[OPT:VZ,15,128]\nok\n", (0.0, 750.0), (0.0, 730.0)),
        ("$23=3", "$23=1", (-750.0, 0.0), (-730.0, 0.0)),
        ("$22=1", "$22=9", (0.0, 750.0), (0.0, 730.0)),
    ],
)
def test_grbl_counts_from_where_it_sets_its_origin(
    old: str, new: str, x: tuple[float, float], y: tuple[float, float], tmp_path: Path
) -> None:
    found = travel(tmp_path, GRBL.replace(old, new))
    assert (found["X"], found["Y"], found["Z"]) == (x, y, (-80.0, 0.0))


def test_grbl_without_homing_has_no_fixed_zero(tmp_path: Path) -> None:
    assert "Homing is off" in " ".join(settings(tmp_path, GRBL.replace("$22=1", "$22=0")).notes)


def test_grbl_reports_its_offsets_in_inches_and_its_travel_not(tmp_path: Path) -> None:
    read = settings(tmp_path, GRBL.replace("$13=0", "$13=1").replace("-700.000,", "-10.000,"))
    assert read.work_offsets["G54"].offset_mm == pytest.approx((-254.0, -650.0 * 25.4, -60.5 * 25.4))
    assert read.axes["X"].travel_mm == (-750.0, 0.0)


@pytest.mark.parametrize("comment", ["; old bed: $130=180", "# $130=180", "(was $130=180)"])
def test_a_setting_in_a_comment_is_none(comment: str, tmp_path: Path) -> None:
    assert travel(tmp_path, f"{GRBL}{comment}\n")["X"] == (-750.0, 0.0)


def test_a_decimal_comma_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'\$131 = "730,5" is not a number'):
        settings(tmp_path, GRBL.replace("$131=730.000", "$131=730,5"))


def test_names_behind_the_values_of_grblhal_change_nothing(tmp_path: Path) -> None:
    bare = re.sub(r" \(.*?\)", "", GRBLHAL)
    assert settings(tmp_path, bare) == settings(tmp_path, GRBLHAL)


def test_klipper_reads_the_files_that_it_includes(tmp_path: Path) -> None:
    head, _, stepper = KLIPPER.partition("[stepper_y]\nposition_max: 240\n")
    (tmp_path / "steppers").mkdir()
    (tmp_path / "steppers" / "y.cfg").write_text("[stepper_y]\nposition_max: 241\n")
    for pattern in ("steppers/*.cfg", f"{tmp_path}/steppers/?.cfg", "steppers/y.cfg"):
        text = f"[include {pattern}]\n[include gone.cfg]\n{head}{stepper}"
        read = settings(tmp_path, text, "printer.cfg")
        assert read.axes["Y"].travel_mm == (0.0, 241.0)
    assert "gone.cfg does not exist" in " ".join(read.notes)


def test_a_delta_printer_is_no_machine_of_linear_axes(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='kinematics is "delta"'):
        settings(tmp_path, KLIPPER.replace("corexy", "delta"))


def test_marlin_in_inches(tmp_path: Path) -> None:
    read = settings(tmp_path, MARLIN.replace("G21", "G20"))
    assert read.axes["X"].velocity_mm_s == pytest.approx(500.0 * 25.4)
    # M211 states its ends in mm, whatever the unit
    assert read.axes["Y"].travel_mm == (-4.0, 225.0)


def test_marlin_without_m211_states_no_travel(tmp_path: Path) -> None:
    read = settings(tmp_path, MARLIN.partition("Send: M211")[0])
    assert read.axes["X"].travel_mm is None
    assert "no travel of X, Y, Z: state it with --travel" in " ".join(read.notes)


def test_a_sinumerik_in_inches(tmp_path: Path) -> None:
    read = settings(tmp_path, SINUMERIK.replace("IS_METRIC=1", "IS_METRIC=0"))
    x = read.axes["X"]
    assert x.travel_mm == pytest.approx((-0.6 * 25.4, 1500.6 * 25.4))
    assert x.velocity_mm_s == pytest.approx(500.0 * 25.4)
    # inch/s2, where the metric system has m/s2
    assert x.acceleration_mm_s2 == pytest.approx(3.0 * 25.4)


def test_axes_without_names_are_assumed_and_noted(tmp_path: Path) -> None:
    bare = "".join(line for line in SINUMERIK.splitlines(True) if "NAME_TAB" not in line)
    read = settings(tmp_path, bare)
    assert read.axes["Y"].travel_mm == (-500.0, 0.5)
    assert "AX1 as X, AX2 as Y, AX3 as Z is assumed" in " ".join(read.notes)
    read = settings(tmp_path, HEIDENHAIN.replace("MP100.0: -----AZYX\n", ""))
    assert "index 0, 1, 2 as X, Y, Z is assumed" in " ".join(read.notes)


def test_a_limit_that_is_switched_off_is_none(tmp_path: Path) -> None:
    text = SINUMERIK.replace("POS_LIMIT_PLUS[AX1]=1500.6", "POS_LIMIT_PLUS[AX1]=1.e8")
    assert travel(tmp_path, text)["X"] is None


def test_axis_names_may_stand_in_the_index(tmp_path: Path) -> None:
    text = SINUMERIK.replace("AX1]", "X1]").replace("AX2]", "Z]").replace("AX3]", "Y1]")
    assert travel(tmp_path, text) == travel(tmp_path, SINUMERIK)


def test_a_table_of_letters_gives_the_index_of_an_axis(tmp_path: Path) -> None:
    text = HEIDENHAIN.replace("-----AZYX", "-----XYZA")
    assert travel(tmp_path, text)["Z"] == (-5.0, 405.0)
