"""A calibration that is written and read back is the same, to the last bit."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.units import AXES, in_unit, in_unit_text, shifted
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.files.tables import read_curves
from olp.files.write import write_files

numbers = st.floats(-1.0, 1.0, allow_nan=False).map(lambda v: v + 0.0)
#: Numbers of at most 15 digits, as a person writes them.
written = st.integers(-(10**9), 10**9).map(lambda n: n * 1e-6)


@st.composite
def curves(draw: st.DrawFn, axis: str) -> tuple[Curve, ...]:
    n = draw(st.integers(2, 5))
    position = sorted(draw(st.lists(st.floats(0.0, 100.0), min_size=n, max_size=n, unique=True)))
    position = [-0.1, *position, 100.1]
    names = draw(st.sets(st.sampled_from([c for c in COMPONENTS if c[2] == axis]), max_size=4))
    groups = [sorted(names)[:1], sorted(names)[1:]]

    def values(group: list[str]) -> dict[str, list[float]]:
        return {name: draw(st.lists(numbers, min_size=n + 2, max_size=n + 2)) for name in group}

    made = []
    for group in groups:
        if group:
            both = draw(st.booleans())
            made.append(
                Curve(
                    axis,
                    np.array(position),
                    {} if both else values(group),
                    values(group) if both else {},
                    values(group) if both else {},
                    draw(st.tuples(numbers, numbers, numbers)),
                    draw(st.tuples(numbers, numbers, numbers)),
                    draw(st.sampled_from(["functional-point", "table"])),
                    draw(st.sampled_from(["linear", "pchip"])),
                )
            )
    return tuple(made)


@st.composite
def calibrations(draw: st.DrawFn) -> Calibration:
    drawn = tuple(curve for axis in AXES for curve in draw(curves(axis)))
    play = {c.axis for c in drawn if c.forward}
    x, y, z = (0.0 if axis in play else shifted(draw(written), -3) for axis in AXES)
    cyclic = tuple(
        Cyclic(name, draw(st.floats(0.1, 50.0)), shifted(draw(written), -3 if name[1] in AXES else -6), 0.3)
        for name in draw(st.lists(st.sampled_from(COMPONENTS), max_size=2, unique=True))
    )
    return Calibration(
        machine=draw(st.text(min_size=1, max_size=9)),
        box_mm=np.array([[0.0, 100.0]] * 3),
        model=draw(st.sampled_from(["rigid-body", "huddersfield"])),
        datum_mm=draw(st.tuples(numbers, numbers, numbers)),
        curves=drawn,
        squareness={name: shifted(draw(written), -6) for name in SQUARENESS},
        backlash_mm=(x, y, z),
        cyclic=cyclic,
        thermal=draw(st.sampled_from([None, Thermal((1.15e-5, 0.0, 1e-6), workpiece_per_K=1.1e-5)])),
        measured=datetime.date(2026, 5, 14),
        valid_until=draw(st.sampled_from([None, datetime.date(2027, 5, 14)])),
        active_during_measurement=frozenset(draw(st.sets(st.sampled_from(["EXX", "C0Y"])))),
    )


def parts(calibration: Calibration) -> object:
    """All that a calibration holds, as plain values, without the own entry of a line."""
    listed = []
    for curve in calibration.curves:
        line = [
            v for a, v in zip(AXES, curve.line_mm or calibration.datum_mm, strict=True) if a != curve.axis
        ]
        columns = [
            {name: values.tolist() for name, values in getattr(curve, part).items()}
            for part in ("columns", "forward", "backward")
        ]
        listed.append((curve.axis, curve.position_mm.tolist(), columns, line, curve.tool_mm, curve.reference,
                      curve.interpolation))  # fmt: skip
    names = ("machine", "model", "datum_mm", "backlash_mm", "cyclic", "thermal", "temperature_degC",
             "measured", "valid_until", "active_during_measurement")  # fmt: skip
    rest = {name: getattr(calibration, name) for name in names}
    return listed, calibration.box_mm.tolist(), dict(calibration.squareness), rest


@pytest.mark.slow
@settings(max_examples=60)
@given(calibration=calibrations())
def test_a_written_calibration_reads_back_exactly(
    calibration: Calibration, tmp_path_factory: pytest.TempPathFactory
) -> None:
    target = tmp_path_factory.mktemp("written") / "calibration.toml"
    write_files(calibration_files(calibration, target, notes=["made by a test", "two\nlines"]))
    assert parts(load_calibration(target)) == parts(calibration)


@given(st.floats(-1e300, 1e300), st.sampled_from([-3, -6, 0]))
def test_the_text_of_a_number_is_exact_in_any_unit(value: float, power: int) -> None:
    assert shifted(in_unit_text(value, power), power) == value


@given(written, st.sampled_from([-3, -6]))
def test_a_number_that_a_person_wrote_comes_back(number: float, power: int) -> None:
    value = shifted(number, power)
    assert shifted(in_unit(value, power), power) == value


def test_short_numbers_stay_short() -> None:
    assert [in_unit_text(v, -3) for v in (0.0123, 1e-4, -0.0, 2.0)] == ["12.3", "0.1", "0", "2000"]


def calibration(**options: object) -> Calibration:
    curve = Curve("X", np.array([0.0, 100.0]), {"EXX": [0.0, 0.01], "ECX": [0.0, 1e-5]})
    given = {"machine": "m", "box_mm": np.array([[0.0, 100.0]] * 3), "curves": (curve,)}
    return Calibration(**(given | {"measured": datetime.date(2026, 5, 14)} | options))


def test_uncertainties_are_beside_their_columns(tmp_path: Path) -> None:
    target = tmp_path / "gantry.toml"
    files = calibration_files(calibration(), target, sigma={"ECX": np.array([1e-6, 2.5e-6])})
    assert [path.name for path in files] == ["gantry.toml", "gantry-x.csv"]
    write_files(files)
    assert files[tmp_path / "gantry-x.csv"] == (
        b"X_mm,EXX_um,ECX_urad,sigma_ECX_urad\n0,0,0,1\n100,10,10,2.5\n"
    )
    assert read_curves(tmp_path / "gantry-x.csv").sigma["ECX"].tolist() == [1e-6, 2.5e-6]


@pytest.mark.parametrize(
    ("options", "sigma", "message"),
    [
        ({"measured": None}, {}, "date of measuring"),
        ({}, {"EYY": np.zeros(2)}, "EYY fits no curve"),
        ({}, {"EXX": np.zeros(3)}, "each of 2 positions"),
        ({}, {"EXX": np.array([0.0, -1.0])}, "0 or above"),
    ],
)
def test_what_cannot_be_written_is_refused(
    options: dict[str, object], sigma: dict[str, np.ndarray], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        calibration_files(calibration(**options), Path("c.toml"), sigma=sigma)
