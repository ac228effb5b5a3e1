"""The report for people never breaks on what is absent, and the one for programs is plain JSON."""

from __future__ import annotations

import copy
import datetime
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.files.config import load_calibration, load_setup
from olp.findings.catalogue import RULES, Finding
from olp.reports.outline import outline
from olp.reports.report import WIDTH, number, printable, shortened, to_json, to_text

REPORT: dict[str, Any] = {
    "schema": "olp-report-1",
    "program": {"name": "part.nc", "sha256": "ab" * 32, "lines": 120, "dialect": "haas", "moves": 100},
    "machine": {"name": "Fräse 1", "chain": "XYFZ", "controller": "haas"},
    "calibration": {
        "measured": "2026-04-22",
        "valid_until": "2027-04-22",
        "model": "rigid-body",
        "temperature_degC": 20.0,
        "sha256": "cd" * 32,
    },
    "tolerance_um": 1.0,
    "verdict": {
        "ok": True,
        "sentences": [
            "Within tolerance: the corrected path is at most 0.87 um from the nominal one; 1.09 um are "
            "allowed (numerical tolerance 1 um, rounding 0.09 um)."
        ],
    },
    "digits": {"mm": 4},
    "moves": {
        "total": 100,
        "corrected": 97,
        "approximated": 1,
        "passed": 2,
        "split": 3,
        "inserted_blocks": 4,
        "inserted_words": 17,
        "changed_words": 150,
    },
    "deviation": {
        "before": {
            "waypoints": {"max_um": 31.25, "rms_um": 12.5},
            "between": {"max_um": 31.0, "rms_um": 12.0},
        },
        "after": {"waypoints": {"max_um": 0.061, "rms_um": 0.03}, "between": {"max_um": 0.87, "rms_um": 0.2}},
        "path_max_um": 0.87,
        "allowed_um": 1.087,
        "holds": True,
    },
    "budget_um": {
        "model_and_chords": 0.85,
        "rounding": 0.06,
        "lost_motion_unknown": 0.0,
    },
    "orientation": {"max_urad": 22.5, "rms_urad": 11.0},
    "largest_correction_um": 30.0,
    "sources": [
        {"name": "EXX", "max_um": 18.0, "rms_um": 7.0},
        {"name": "C0Y", "max_um": 4.0, "rms_um": 2.0},
    ],
    "worst": [{"line": 17, "text": "N170 G1 X100. (\x1b[31mred\t)", "before_um": 31.0, "after_um": 0.87}],
    "findings": [
        Finding("OLP303", "G54 is taken as touched off.", 9, (9,)).as_dict(),
        Finding("OLP102", "2 moves are left uncorrected.", 4, (4, 5), 2).as_dict(),
    ],
    "proves": ["The inversion, " + "and so on " * 30],
    "does_not_prove": ["The calibration."],
}


def test_the_text_states_the_numbers_of_the_proof() -> None:
    text = to_text(REPORT)
    numbers = ("31.25", "0.87", "22.5", "97 corrected", "2 left uncorrected")
    for words in (*numbers, "Within tolerance", "EXX", "Fräse 1"):
        assert words in text
    assert text.index("OLP102") < text.index("OLP303"), "a warning comes before an information"
    assert "lines 4, 5 (2 in all)" in text
    assert "ab" * 32 not in text


def test_the_verdict_is_that_of_the_proof() -> None:
    report = REPORT | {"verdict": {"ok": False, "sentences": ["ABOVE TOLERANCE: by far."]}}
    assert "ABOVE TOLERANCE: by far." in to_text(report)
    assert "Within tolerance" not in to_text(report)


def test_a_line_of_the_program_cannot_act_on_the_terminal() -> None:
    assert all(c.isprintable() or c == "\n" for c in to_text(REPORT))


@pytest.mark.slow
@given(data=st.data())
def test_absent_parts_are_left_out(data: st.DataObject) -> None:
    report = copy.deepcopy(REPORT)
    for key in data.draw(st.sets(st.sampled_from(sorted(REPORT)))):
        del report[key]
    for part in [part for part in report.values() if isinstance(part, dict)]:
        for key in data.draw(st.sets(st.sampled_from(sorted(part)))):
            del part[key]
    text = to_text(report)
    assert max(map(len, text.split("\n"))) <= WIDTH
    assert "None" not in text
    assert ("EXX" in text) == ("sources" in report)
    assert "\n\n\n" not in text


def test_an_empty_report_is_an_empty_line() -> None:
    assert to_text({}) == "\n"


def test_json_reads_back_and_is_the_same_whatever_the_order_of_keys() -> None:
    assert json.loads(to_json(REPORT)) == json.loads(json.dumps(REPORT))
    assert to_json(dict(reversed(REPORT.items()))) == to_json(REPORT)


def test_json_knows_arrays_dates_and_what_is_not_finite() -> None:
    values = {
        "a": np.array([1.0, np.nan]),
        "b": np.float64(2.5),
        "c": datetime.date(2026, 4, 22),
        "d": float("inf"),
        "e": np.int64(3),
        "f": frozenset("zy"),
    }
    assert json.loads(to_json(values)) == {
        "a": [1.0, None], "b": 2.5, "c": "2026-04-22", "d": None, "e": 3, "f": ["y", "z"],
    }  # fmt: skip


@given(value=st.floats(allow_nan=False, allow_infinity=False), digits=st.integers(0, 6))
def test_a_number_that_is_not_zero_never_looks_like_zero(value: float, digits: int) -> None:
    text = number(value, digits)
    looks_zero = not any(c in "123456789" for c in text)
    assert looks_zero == (value == 0.0)


@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), "text"])
def test_what_is_no_number_is_a_dash(value: object) -> None:
    assert number(value) == "-"


@given(text=st.text(), width=st.integers(3, 60))
def test_program_text_stays_in_its_column(text: str, width: int) -> None:
    shown = shortened(printable(text), width)
    assert len(shown) <= width
    assert shown.isprintable()


SCALARS = st.none() | st.booleans() | st.floats() | st.text(max_size=5) | st.integers()
TREES = st.recursive(
    SCALARS | st.lists(SCALARS, max_size=3),
    lambda inner: (
        st.dictionaries(st.text(max_size=5), inner, max_size=4)
        | st.lists(st.dictionaries(st.text(max_size=4), SCALARS, max_size=3), max_size=3)
    ),
    max_leaves=12,
)


@pytest.mark.slow
@given(values=st.dictionaries(st.text(max_size=5).filter(lambda key: key != "findings"), TREES, max_size=4))
def test_any_summary_has_an_outline(values: dict[str, Any]) -> None:
    assert all(c.isprintable() or c == "\n" for c in outline(values))


def test_an_outline_shows_every_value_and_the_findings() -> None:
    values = {
        "name": "part.nc",
        "moves": {"rapid": 12, "feed": 345},
        "axes": {"X": {"min_mm": -1.25, "max_mm": 100.0}, "Y": {"min_mm": 0.0, "max_mm": 2e-7}},
        "support": [{"name": "G5.1", "count": 2}, {"name": "G81", "note": "corrected per hole"}],
        "findings": [Finding("OLP301", "Millimetres were assumed.").as_dict()],
    }
    text = outline(values)
    for words in ("part.nc", "345", "-1.25", "2.0e-07", "G5.1", "corrected per hole", RULES["OLP301"].title):
        assert words in text


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "magic"), [("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_curves_are_drawn_the_same_every_time(kind: Any, magic: bytes) -> None:
    pytest.importorskip("matplotlib")
    from cli.test_cli import MACHINE

    from olp.reports.plots.base import calibration_curves

    machine = load_setup(MACHINE).machine
    assert machine.calibration is not None
    calibration = load_calibration(machine.calibration, machine)
    first = calibration_curves(calibration, kind)
    assert first.startswith(magic)
    assert first == calibration_curves(calibration, kind)
    if kind == "svg":
        assert all(name in first for name in (b"EXX", b"ECZ", b"axis Y"))
