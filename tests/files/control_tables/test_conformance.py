"""What every format of compensation tables must do. Every registered format is judged."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import olp
from olp.cli import main
from olp.core.errors import InputError, UsageError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration, Curve
from olp.files import control_tables
from olp.files.control_tables.base import Exported, Format, Given, Imported, Sense
from olp.files.control_tables.registry import FORMATS, MODULES
from olp.files.machine_settings.registry import FORMATS as SETTINGS
from olp.program.registry import DIALECTS

PACKAGE = Path(olp.__file__).parent
TRAVEL = np.array([[-100.0, 200.0]] * 3)
ROWS = np.array([-100.0, 0.0, 100.0, 200.0])
SENSES: tuple[Sense, ...] = ("error", "correction")
every_format = pytest.mark.parametrize("form", FORMATS.values(), ids=FORMATS)


def everything(scale: float = 1.0) -> Calibration:
    """All components, two of them in both directions, squareness, and a backlash."""
    curves = []
    for k, name in enumerate(COMPONENTS, 1):
        values = scale * k * np.array([0.0, 1e-3, -1e-3, 2e-3]) * (1.0 if name[1] in AXES else 1e-2)
        sides = ({}, {name: values}, {name: values + scale * 1e-3})
        columns = sides if name in ("EYY", "EZZ") else ({name: values}, {}, {})
        curves.append(Curve(name[2], ROWS, *columns, interpolation="linear"))
    square = {name: scale * 1e-5 * k for k, name in enumerate(SQUARENESS, 1)}
    backlash = (scale * 0.004, 0.0, 0.0)
    return Calibration("g", TRAVEL, curves=tuple(curves), squareness=square, backlash_mm=backlash)


def given_for(form: Format, sense: Sense | None = None) -> Given:
    return Given(machine="g", travel_mm=TRAVEL, sense=sense or (None if form.sense else "correction"))


def written(form: Format, calibration: Calibration, given: Given | None = None) -> Exported:
    return form.write(calibration, Path(f"folder/g{form.ending}"), given or given_for(form))


def reread(form: Format, exported: Exported, given: Given | None = None) -> Imported:
    return form.read(next(iter(exported.files)), given or given_for(form), exported.files.__getitem__)


def numbers(calibration: Calibration) -> Iterator[tuple[str, float]]:
    for curve in calibration.curves:
        for side in (curve.columns, curve.forward, curve.backward):
            yield from ((name, float(v)) for name, values in side.items() for v in values)
    yield from calibration.squareness.items()


def test_every_module_with_a_format_is_registered_once() -> None:
    folder = Path(control_tables.__path__[0])
    stated = {p.stem for p in folder.glob("*.py") if "\nFORMAT = " in p.read_text("utf-8")}
    assert stated == set(MODULES)
    assert len(FORMATS) == len(MODULES)
    assert all(form.key == key for key, form in FORMATS.items())


@every_format
def test_its_description_is_whole(form: Format) -> None:
    assert form.ending.startswith(".")
    assert all(len(text) > 2 for text in (form.key, form.title, form.status, form.holds))
    assert form.sense in (None, *SENSES)


@every_format
def test_the_command_line_lists_it(form: Format) -> None:
    text = CliRunner().invoke(main, ["calibrate", "formats"]).output
    assert f"{form.key} ({form.ending})  {form.title}\n  holds: {form.holds}\n" in text
    listed = json.loads(CliRunner().invoke(main, ["calibrate", "formats", "--json"]).output)
    assert listed[form.key]["sense"] == form.sense


@every_format
def test_once_read_its_bytes_come_back(form: Format) -> None:
    read = reread(form, written(form, everything())).calibration
    first = written(form, read)
    second = reread(form, first).calibration
    assert written(form, second).files == first.files
    assert sorted(numbers(second)) == sorted(numbers(read))
    assert any(value for _, value in numbers(read))


@every_format
def test_its_sign_convention_is_its_own_or_stated(form: Format) -> None:
    exported, nothing = written(form, everything()), Given(machine="g", travel_mm=TRAVEL)
    if form.sense is not None:
        assert written(form, everything(), given_for(form, form.sense)).files == exported.files
        return
    for call in (lambda: written(form, everything(), nothing), lambda: reread(form, exported, nothing)):
        with pytest.raises(UsageError, match="--sense"):
            call()
    one, other = (sorted(numbers(reread(form, exported, given_for(form, s)).calibration)) for s in SENSES)
    assert sorted((name, 0.0 - value) for name, value in one) == other


@every_format
def test_what_it_cannot_hold_is_a_finding(form: Format) -> None:
    exported = written(form, everything())
    omitted = {*COMPONENTS, *SQUARENESS} - exported.corrects
    messages = " ".join(f.message for f in exported.findings if f.code == "OLP871")
    assert omitted == {name for name in (*COMPONENTS, *SQUARENESS) if name in messages}
    backlash = [
        f for f in exported.findings if f.code in ("OLP871", "OLP875") and "backlash of X" in f.message
    ]
    assert len(backlash) == 1
    assert {name for name, value in numbers(reread(form, exported).calibration) if value} <= {
        *COMPONENTS, *SQUARENESS
    } - omitted  # fmt: skip


@every_format
def test_a_calibration_of_zeros_gives_a_table_of_zeros(form: Format) -> None:
    read = reread(form, written(form, everything(0.0))).calibration
    assert list(numbers(read)) and not any(value for _, value in numbers(read))
    assert read.backlash_mm == (0.0, 0.0, 0.0)
    moved = form.control(read, "FXYZ").offset(TRAVEL.T.copy(), np.zeros(3), np.ones((2, 3)))
    assert not moved.any()


@every_format
def test_its_control_subtracts_the_error(form: Format) -> None:
    read = reread(form, written(form, everything())).calibration
    position_mm, still = np.array([[100.0, 100.0, 100.0]]), np.zeros((1, 3))
    moved, opposite = (
        form.control(c, "FXYZ").offset(position_mm, np.zeros(3), still)
        for c in (read, reread(form, written(form, everything(-1.0))).calibration)
    )
    assert np.abs(moved).max() > 1e-4
    assert np.allclose(moved, -opposite, atol=1e-5)


@every_format
@pytest.mark.parametrize("data", [b"", b"\x00\xff", b"no table\n"])
def test_what_is_no_table_is_refused(form: Format, data: bytes) -> None:
    with pytest.raises((InputError, UsageError)):
        form.read(Path(f"folder/g{form.ending}"), given_for(form), lambda path: data)


@pytest.mark.slow
def test_no_other_module_names_a_format() -> None:
    """Names that are dialects or formats of settings too are not checked."""
    names = set(FORMATS) - set(DIALECTS) - set(SETTINGS)
    for path in PACKAGE.rglob("*.py"):
        if path.parent.name == "control_tables":
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            assert not (isinstance(node, ast.Constant) and node.value in names), (path, node.lineno)
