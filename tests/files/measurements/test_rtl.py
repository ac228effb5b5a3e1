"""Measured lines as Renishaw stores them: what they state is taken, what they do not is asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.cli import main
from olp.core.errors import ConfigError, InputError
from olp.files.config import load_calibration
from olp.files.measurements.line_profile import load_line_profile, read_line
from olp.files.measurements.rtl import parse_rtl

MACHINE = """schema = "olp-machine-1"
name = "gantry"
chain = "FXYZ"
controller = "linuxcnc"
"""
AXIS = "[axes.{}]\ntravel_mm = [0.0, 500.0]\nleast_increment_mm = 0.001\n"


def stored(
    targets: list[float], runs: list[list[tuple[int, float]]], kind: str = "rtl", axis: str = "X"
) -> str:
    """A file whose runs are rows (number of the target, deviation), five targets a line."""
    cells = [f"{target:.6f}  " for target in targets]
    listed = "\r\n".join("".join(cells[k : k + 5]) for k in range(0, len(cells), 5))
    rows = [f"{n}   {k}      {value:.3f}" for n, run in enumerate(runs, 1) for k, value in run]
    lines = [
        "HEADER::", f"File type  : {kind}", "Owner      : Linear", "Version no : V20.02.02", "",
        "TARGET DATA::", "Filetype  : ISO", f"Target-count: {len(targets)}", "Targets :", listed,
        "Flags: 0 0 2 0", "", "USER-TEXT::", "Machine: gantry", "Serial No: 1", "Date:2025-02-10 12:58:22",
        "By:me", f"Axis:{axis}", "Location:", "TITLE:", "", "RUNS::", f"Run-count:{len(runs)}", "",
        "DEVIATIONS::", "Run Target Data:", *rows, "", "ENVIRONMENT::", "Air temp   : 20.1", "EOF::",
    ]  # fmt: skip
    return "\r\n".join(lines) + "\r\n"


RUNS = [[(1, 0.258), (2, 0.79), (3, 1.013)], [(3, 3.796), (2, 3.213), (1, 1.317)]]
TEXT = stored([0.0, 50.0, 100.0], RUNS)


def test_what_the_file_states_is_taken() -> None:
    readings = parse_rtl(TEXT.encode(), "x.rtl")
    assert readings.target_mm.tolist() == [0.0, 50.0, 100.0, 100.0, 50.0, 0.0]
    assert np.allclose(readings.value * 1e3, [0.258, 0.79, 1.013, 3.796, 3.213, 1.317])
    assert readings.direction.tolist() == [1, 1, 1, -1, -1, -1]
    assert readings.run.tolist() == [1, 1, 1, 1, 1, 1]
    assert readings.line[0] == TEXT.splitlines().index("1   1      0.258") + 1
    assert (readings.component, readings.angular, readings.sense_known) == ("EXX", False, False)
    assert {key: value for key, (value, _) in readings.keys.items()} == {
        "machine": '"gantry"', "measured": "2025-02-10",
    }  # fmt: skip


@settings(max_examples=30)
@given(
    st.lists(st.integers(-9000, 9000), min_size=2, max_size=12, unique=True).map(sorted),
    st.lists(st.booleans(), min_size=1, max_size=6), st.randoms(use_true_random=False),
)  # fmt: skip
def test_every_reading_comes_back_at_its_target(targets: list[int], ways: list[bool], rng: object) -> None:
    numbers = list(range(1, len(targets) + 1))
    runs = [
        [(k, round(rng.uniform(-99.0, 99.0), 3)) for k in (numbers if up else numbers[::-1])]  # type: ignore[attr-defined]
        for up in ways
    ]
    readings = parse_rtl(stored([float(q) for q in targets], runs).encode(), "x.rtl")
    flat = [(targets[k - 1], up, value) for run, up in zip(runs, ways, strict=True) for k, value in run]
    assert readings.target_mm.tolist() == [float(q) for q, _, _ in flat]
    assert (readings.direction > 0).tolist() == [up for _, up, _ in flat]
    assert np.allclose(readings.value * 1e3, [value for _, _, value in flat])


def without(text: str) -> Callable[[str], str]:
    return lambda whole: whole.replace(text, "", 1)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (without("1   2      0.790\r\n"), "line 27: run 1 has 2 rows; expected each of the 3 targets once"),
        (lambda t: t.replace("Run-count:2", "Run-count:4"), "2 runs, and states Run-count: 4"),
        (lambda t: t.replace("Target-count: 3", "Target-count: 5"), "holds 3 targets, and states"),
        (without("Target-count: 3\r\n"), "states no number of targets"),
        (lambda t: t.replace("100.000000", "1OO"), 'line 10: target "1OO"'),
        (lambda t: t.replace("0.790", "0,790"), 'line 28: "1   2      0,790"'),
        (lambda t: t.replace("1   2", "1   7"), "line 28: target 7; expected a number from 1 to 3"),
        (lambda t: t.replace("Run Target Data:", "Flags:"), "holds no deviations"),
        (lambda t: t.replace("1   2 ", "1   9 ").replace("TARGET", "OTHER"), "no section"),
        (lambda t: t.replace(": rtl", ": rta"), 'type "rta", and does not state the unit'),
    ],
)
def test_a_damaged_file_is_refused(change: Callable[[str], str], words: str) -> None:
    with pytest.raises((ConfigError, InputError)) as caught:
        parse_rtl(change(TEXT).encode(), "x.rtl")
    assert words in str(caught.value)


def test_a_profile_states_the_unit_and_the_sign(tmp_path: Path) -> None:
    (tmp_path / "x.rta").write_text(TEXT.replace(": rtl", ": rta"))
    (tmp_path / "p.toml").write_text(
        'schema = "olp-line-profile-1"\nunit = "arcsec"\nsense = "commanded-minus-actual"\n'
        'component = "EBX"\n'
    )
    readings = read_line(tmp_path / "x.rta", load_line_profile(tmp_path / "p.toml"))
    assert readings.value[0] == pytest.approx(-0.258 * np.pi / 648_000.0)
    assert (readings.component, readings.angular, readings.sense_known) == ("EBX", True, True)


#: six targets, with 2 um of backlash and 1.6 um more at the far end
WAYS = [
    [(k, 0.3 * k + 0.05 * (k % 2)) for k in range(1, 7)],
    [(k, 0.3 * k + 2.0 + 0.05 * (k % 3)) for k in range(6, 0, -1)],
]


@pytest.mark.slow
def test_a_plan_names_the_file_and_states_the_rest(tmp_path: Path) -> None:
    text = stored([25.0 * k for k in range(6)], [way for _ in range(3) for way in WAYS])
    (tmp_path / "x.rtl").write_text(text)
    (tmp_path / "machine.toml").write_text(MACHINE + "".join(AXIS.format(axis) for axis in "XYZ"))
    (tmp_path / "measurements.toml").write_text(
        'schema = "olp-measurements-1"\nmachine = "gantry"\nmeasured = 2025-02-10\ntemperature_degC = 20.0\n'
        '[[lines]]\nfile = "x.rtl"\nline_mm = { Y = 0.0, Z = 0.0 }\ntool_mm = [0.0, 0.0, 0.0]\n'
        'sense = "actual-minus-commanded"\nsigma_um = 0.3\n'
    )
    out = tmp_path / "out.toml"
    machine = str(tmp_path / "machine.toml")
    call = ["calibrate", "fit", str(tmp_path), "-m", machine, "-o", str(out)]
    done = CliRunner().invoke(main, call)
    assert done.exit_code == 0, done.output
    calibration = load_calibration(out)
    assert 1.5e-3 < calibration.backlash_mm[0] < 3.0e-3
    (curve,) = [curve for curve in calibration.curves if curve.axis == "X"]
    assert np.ptp(curve.columns["EXX"]) == pytest.approx(1.62e-3, abs=0.3e-3)
