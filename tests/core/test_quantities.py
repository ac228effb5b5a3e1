"""Numbers with a unit: exact factors, one dimension a key, and a sentence for anything else."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.quantities import EXAMPLES, pattern, quantity, unit_named
from olp.core.units import unit_of_key

#: A text, the unit of the key, and the number; those without pi are the nearest doubles of exact values.
STATED = [
    ("0.002 in", "um", 50.8),
    ('0.002"', "um", 50.8),
    ("2 thou", "um", 50.8),
    ("20 uin", "um", 0.508),
    ("50um", "mm", 0.05),
    ("50 \u00b5m", "mm", 0.05),
    ("50 \u03bcm", "mm", 0.05),
    ("  -2.5e-1  mm ", "um", -250.0),
    ("6 ft", "mm", 1828.8),
    ("1 m", "mm", 1000.0),
    ("2 arcsec", "urad", 2 * math.pi / 180 / 3600 * 1e6),
    ("0.5 arcmin", "rad", 0.5 * math.pi / 180 / 60),
    ("0.001 deg", "urad", math.pi / 180 * 1e3),
    ("1\u00b0", "rad", math.pi / 180),
    ("100 urad", "deg", 1e-4 * 180 / math.pi),
    ("0.1 mrad", "urad", 100.0),
    ("1.414 mm/m", "urad", 1414.0),
    ("0.4 mm/600 mm", "urad", 2000 / 3),
    ("0.4mm / 600mm", "urad", 2000 / 3),
    ("0.001 in/ft", "urad", 1000 / 12),
    ("30 um/m", "urad", 30.0),
    ("400 in/min", "mm/s", 400 * 25.4 / 60),
    ("400 ipm", "mm/s", 400 * 25.4 / 60),
    ("30 m/min", "mm/s", 500.0),
    ("0.2 g", "mm/s2", 1961.33),
    ("2 m/s^2", "mm/s2", 2000.0),
    ("2 m/s\u00b2", "mm/s2", 2000.0),
    ("20 m/s3", "mm/s3", 20000.0),
]


@pytest.mark.parametrize(("text", "unit", "number"), STATED)
def test_a_quantity_is_a_number_of_the_unit(text: str, unit: str, number: float) -> None:
    assert quantity(text, unit) == pytest.approx(number, rel=1e-15)


@given(st.decimals(-10000, 10000, places=4), st.sampled_from(["in", "mm", "um", "thou", "ft"]))
def test_lengths_are_the_nearest_double_of_the_exact_value(number: object, unit: str) -> None:
    exact = Fraction(str(number)) * unit_named(unit).size * 1000
    assert quantity(f"{number} {unit}", "um") == float(exact)


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        ("2", "mm", "leave out the quotes, or add a unit"),
        ("500", "mm/s", "leave out the quotes"),
        ("1e3", "um", "leave out the quotes"),
        ("", "um", "give a number and its unit"),
        ("wide", "um", "expected a number in um"),
        ("2,5 mm", "mm", "decimal point instead of the comma"),
        ("2 arcsec", "mm", '"arcsec" is an angle; expected a unit of length'),
        ("2 mm", "urad", '"mm" is a length; expected a unit of angle, such as "2 arcsec"'),
        ("2 mm/s", "mm", "is a velocity"),
        ("2 mm/s2", "mm/s", "is an acceleration"),
        ("2 cubit", "mm", '"cubit" is not a unit of length; expected one of m, dm, cm, mm'),
        ("2 mm/0 mm", "urad", "is not a unit of angle"),
        ("2 mm 5", "mm", "is not a unit of length"),
        ("1e999 mm", "mm", "expected a smaller number"),
        ("1/8 in", "mm", "is not a unit of length"),
    ],
)
def test_any_other_text_has_a_sentence(text: str, unit: str, message: str) -> None:
    with pytest.raises(ValueError, match="expected") as error:
        quantity(text, unit)
    assert message in str(error.value)


@pytest.mark.slow
@given(st.text(max_size=30), st.sampled_from(["mm", "urad", "mm/s"]))
def test_no_text_raises_anything_else(text: str, unit: str) -> None:
    try:
        number = quantity(text, unit)
    except ValueError as error:
        assert "expected" in str(error)
    else:
        assert math.isfinite(number)


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("travel_mm", "mm"), ("C0Y_urad", "urad"), ("sigma_X_um", "um"), ("phase_rad", "rad"),
        ("velocity_mm_s", "mm/s"), ("acceleration_mm_s2", "mm/s2"), ("jerk_mm_s3", "mm/s3"),
        ("C_deg", "deg"), ("X_scale_um_m_K", None), ("compliance_um_per_m_s2", None), ("payload_kg", None),
        ("name", None), ("temperature_degC", None),
    ],
)  # fmt: skip
def test_keys_end_in_their_unit(key: str, unit: str | None) -> None:
    assert unit_of_key(key) == unit


def test_every_example_in_a_message_can_be_read() -> None:
    units = {"length": "mm", "angle": "urad", "velocity": "mm/s", "acceleration": "mm/s2", "jerk": "mm/s3"}
    for dimension, text in EXAMPLES.items():
        for example in re.findall(r'"([^"]*)"', text):
            assert math.isfinite(quantity(example, units[dimension]))


@pytest.mark.parametrize(("text", "unit", "number"), STATED)
def test_the_pattern_of_the_schemas_takes_what_is_read(text: str, unit: str, number: float) -> None:
    assert re.search(pattern(unit), text)


@pytest.mark.parametrize("text", ["2", "z", "2,5 mm", "", "1.5"])
def test_the_pattern_of_the_schemas_takes_no_bare_number(text: str) -> None:
    assert not re.search(pattern("mm"), text)
