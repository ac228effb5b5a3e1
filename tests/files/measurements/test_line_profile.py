"""Text of any instrument through a profile, and dynamic recordings: the same readings whatever the layout."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from olp.cli import main
from olp.core.errors import ConfigError, InputError
from olp.files.measurements.line_profile import LineProfile, load_line_profile, parse_line, read_line
from olp.files.measurements.line_runs import turns
from olp.files.measurements.readings import parse_readings
from olp.files.measurements.renishaw import RecordingTable, line_of_recording, parse_rtx
from olp.files.problems import validate

HEAD = {"schema": "olp-line-profile-1", "unit": "um", "sense": "actual-minus-commanded"}
COLUMNS = {"target": "Soll", "value": "Abw"}


def profile(**keys: object) -> LineProfile:
    return validate(LineProfile, HEAD | {"columns": COLUMNS} | keys, {}, "p.toml")


def rows(readings: object) -> list[tuple[float, int, int, float]]:
    return list(
        zip(readings.target_mm.tolist(), readings.run.tolist(), readings.direction.tolist(),
            np.round(readings.value * 1e3, 9).tolist(), strict=True)
    )  # fmt: skip


RUNS = [(0.0, 1, 1, 0.5), (1000.0, 1, 1, 1.5), (2000.5, 1, 1, -2.0),
        (2000.5, 1, -1, -3.0), (1000.0, 1, -1, 1.0), (0.0, 1, -1, 0.0)]  # fmt: skip


def test_a_german_export_with_thousands_and_turns() -> None:
    text = (
        "Laser XY\nMessung 3\nSoll;Abw\n0;0,5\n1.000,0;1,5\n2.000,5;-2\n"
        "2.000,5;-3\n1.000,0;1\n0,0;0\nEnde der Messung\nx;y\n"
    )
    layout = profile(delimiter="semicolon", decimal="comma", thousands="point", header_lines=2, end="Ende")
    readings = parse_line(text.encode("utf-8-sig"), "a.txt", layout)
    assert rows(readings) == RUNS
    assert readings.line.tolist() == [4, 5, 6, 7, 8, 9]
    assert readings.angular is False and readings.sense_known


def test_the_same_with_columns_for_run_and_direction_and_axis() -> None:
    text = "X,0,1,vor,.5\nY,9,1,vor,9\nX,1000,1,vor,1.5\nX,2000.5,1,vor,-2\n"
    text += "X,2000.5,1,rück,-3\nX,1000,1,rück,1\nX,0,1,rück,0\n"
    columns = {"axis": 1, "target": 2, "run": 3, "direction": 4, "value": 5}
    words = {"forward": ["VOR"], "backward": ["rück"]}
    layout = profile(header=False, axis="X", runs="column", columns=columns, **words)
    assert rows(parse_line(text.encode(), "a.txt", layout)) == RUNS


def test_the_same_with_one_column_per_run_and_with_blank_lines() -> None:
    wide = profile(delimiter="tab", directions=[1, -1], columns={"target": "Soll", "value": ["hin", "her"]})
    text = "Soll\thin\ther\n0\t0.5\t0\n1000\t1.5\t1\n2000.5\t-2\t-3\n"
    assert rows(parse_line(text.encode(), "a.txt", wide)) == RUNS
    blocks = profile(delimiter="space", runs="blank-line")
    text = "Soll Abw\n0 .5\n1000 1.5\n2000.5 -2\n\n\n2000.5 -3\n1000 1\n0 0\n"
    assert rows(parse_line(text.encode(), "a.txt", blocks)) == RUNS


def test_positions_and_signs_and_units_make_the_same_errors() -> None:
    positions = "\n".join(f"{q!r},{q + v * 1e-3!r}" for q, _, _, v in RUNS)
    layout = profile(header=False, unit="mm", holds="position", columns={"target": 1, "value": 2})
    assert rows(parse_line(positions.encode(), "a.txt", layout)) == RUNS
    other = "\n".join(f"{q / 25.4!r},{-v * 1e3!r}" for q, _, _, v in RUNS)
    layout = profile(
        header=False, unit="nm", sense="commanded-minus-actual", position_unit="inch",
        columns={"target": 1, "value": 2},
    )  # fmt: skip
    readings = parse_line(other.encode(), "a.txt", layout)
    assert np.allclose(readings.value, [v * 1e-3 for *_, v in RUNS], atol=1e-12)


@given(st.lists(st.integers(2, 6), min_size=1, max_size=6))
def test_runs_up_and_down_are_separated(lengths: list[int]) -> None:
    sequence, expected = [], []
    for number, n in enumerate(lengths):
        targets = list(range(n))
        sequence += targets if number % 2 == 0 else targets[::-1]
        expected += [number] * n
    # a shorter run would begin at another position than the end of the run before
    if len(set(lengths)) == 1:
        assert turns(np.array(sequence, float)).tolist() == expected


@pytest.mark.parametrize(
    ("text", "keys", "parts"),
    [
        ("Soll,Abw\n0,1\n5,x\n7,\n", {}, ["line 3: column 2", "line 4: column 2: is empty"]),
        ("Soll;Abw\n0;1,5\n2;2\n", {"delimiter": "semicolon"}, ['column 2: "1,5" does not fit decimal']),
        ("Soll,Abw\n0,1.000.0\n1,2\n", {}, ["does not fit"]),
        ("Soll,Abw,D\n0,1,up\n1,2,down\n", {"columns": COLUMNS | {"direction": "D"}}, ['direction "up"']),
        ("Soll,Abw,R\n0,1,0\n1,2,1.5\n", {"columns": COLUMNS | {"run": "R"}}, ["line 2: run", "line 3: run"]),
        ("Soll,Abw\n0,1\n", {}, ["expected at least 2"]),
        ("Soll,Abw\n0,1\n5,1\n3,1\n", {"runs": "one"}, ["line 2: the targets of the run"]),
        ("Sol,Abw\n0,1\n1,1\n", {}, ["did you mean Sol?"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_stated_with_its_line(text: str, keys: dict[str, object], parts: list[str]) -> None:
    with pytest.raises(InputError) as error:
        parse_line(text.encode(), "a.txt", profile(**keys))
    for part in parts:
        assert part in str(error.value)
    assert str(error.value).startswith("a.txt")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"sense": "up"}, "not a sign convention"),
        ({"component": "EAX"}, "is an angle"),
        ({"component": "EQX"}, "not an ISO 230-1 name"),
        ({"decimal": "comma"}, "commas are both between columns and in numbers"),
        ({"decimal": "comma", "delimiter": "tab", "thousands": "comma"}, "are the same"),
        ({"unit": "arcsec", "holds": "position"}, "with a unit of angle; expected holds"),
        ({"columns": {"target": 1, "value": [2, 3]}}, "expected directions"),
        ({"runs": "column"}, "lacks run"),
        ({"unit": "ft"}, "unit"),
        ({"coulmns": {}}, "did you mean columns"),
    ],
)
def test_a_profile_that_says_two_things_is_refused(keys: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        profile(**keys)


def rtx(samples: np.ndarray, **keys: object) -> bytes:
    values = {"Owner": "CARTO-Dynamic", "File Type": "rtx", "Velocity": 0, "Sample no": len(samples),
              "Actual sample rate": 50000, "Date": "10/02/2025 12:58:22", "Machine": ""} | keys  # fmt: skip
    head = "".join(f"{key}: {value}\r\n" for key, value in values.items())
    body = struct.pack(f"<{len(samples)}d", *samples)
    return b"HEADER::\r\n" + head.encode() + b"Data:\r\n" + body + b"EOF::\r\n"


def test_a_recording_holds_its_samples_whatever_their_bytes_are() -> None:
    samples = np.array([0.0, *np.frombuffer(b"EOF::\r\nADATA:\r\n\x01", "<f8")[:1], 1.5, -2.0])
    recording = parse_rtx(rtx(samples), "a.rtx")
    assert recording.samples.tolist() == samples.tolist()
    assert recording.period_s == 2e-5 and recording.keys["Date"] == "10/02/2025 12:58:22"


def test_a_sweep_at_constant_feed_shows_its_cyclic_error() -> None:
    moving = np.linspace(0.0, 100.0, 4001)
    position = moving + 2e-3 * np.sin(2 * np.pi * moving / 10.0)
    samples = np.concatenate([np.zeros(500), position, np.full(500, position[-1])])
    layout = RecordingTable(motion="sweep", start_mm=300.0, end_mm=400.0)
    readings = line_of_recording(parse_rtx(rtx(samples), "a.rtx"), layout, "mm", "position")
    assert set(readings.direction.tolist()) == {1}
    fit = np.c_[np.sin(2 * np.pi * readings.target_mm / 10.0), np.cos(2 * np.pi * readings.target_mm / 10.0)]
    amplitude = np.hypot(*np.linalg.lstsq(fit, readings.value, rcond=None)[0])
    assert abs(amplitude - 2e-3) < 2e-5


def test_triggered_samples_are_at_the_positions_of_the_profile(tmp_path: Path) -> None:
    (tmp_path / "a.rtx").write_bytes(rtx(np.array([1.0, 2.0, 3.0, 4.0])))
    (tmp_path / "p.toml").write_text(
        'schema = "olp-line-profile-1"\nunit = "um"\nsense = "commanded-minus-actual"\ncomponent = "EXX"\n'
        '[recording]\nmotion = "triggered"\nstart_mm = 10.0\nstep_mm = -0.5\nevery = 2\n'
    )
    readings = read_line(tmp_path / "a.rtx", load_line_profile(tmp_path / "p.toml"))
    assert rows(readings) == [(9.75, 1, -1, -1.5), (8.75, 1, -1, -3.5)]
    assert readings.component == "EXX"
    with pytest.raises(InputError, match="dynamic recording"):
        read_line(tmp_path / "a.rtx")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda b: b[:-20] + b"EOF::\r\n", "multiple of 8"),
        (lambda b: b[:-7], "does not end"),
        (lambda b: b[:40], "Data"),
        (lambda b: b.replace(b"Sample no: 3", b"Sample no: 4"), "its header says .*copy it again"),
        (lambda b: b.replace(b"50000", b"fast"), "expected a number"),
        (lambda b: b.replace(b"Actual sample rate: 50000\r\n", b""), "sample rate"),
        (lambda b: b"X" + b, "HEADER::"),
    ],
)
def test_a_broken_recording_is_refused(change: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_rtx(change(rtx(np.arange(3.0))), "a.rtx")


def test_instruments_without_a_grammar_are_named_and_refused(tmp_path: Path) -> None:
    (tmp_path / "x.wyl").write_bytes(b"whatever")
    with pytest.raises(InputError, match=r"Wyler level .* profile"):
        read_line(tmp_path / "x.wyl")


def test_the_command_shows_what_is_understood(tmp_path: Path) -> None:
    native = b"# component = EXX\ntarget_mm,run,direction,value_um\n0,1,1,1.25\n10,1,1,-2\n"
    (tmp_path / "a.csv").write_bytes(native)
    shown = CliRunner().invoke(main, ["calibrate", "read", str(tmp_path / "a.csv")])
    assert shown.exit_code == 0, shown.output
    assert "1.250" in shown.stdout and "component EXX" in shown.stderr
    as_json = CliRunner().invoke(main, ["calibrate", "read", str(tmp_path / "a.csv"), "--json"])
    got = [row["value_um"] for row in json.loads(as_json.stdout)["readings"]]
    assert got == [1.25, -2.0] == (parse_readings(native, "a").value * 1e3).tolist()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_the_encoding_of_an_instrument_changes_no_reading(encoding: str) -> None:
    text = "Prüfer: Müller\nSoll [mm];Abweichung [µm]\n0,0;1,5\n100,0;-2,5\n"
    columns = {"target": "Soll [mm]", "value": "Abweichung [µm]"}
    layout = profile(delimiter="semicolon", decimal="comma", header_lines=1, columns=columns)
    readings = parse_line(text.encode(encoding), "x.txt", layout)
    assert readings.target_mm.tolist() == [0.0, 100.0]
    assert np.allclose(readings.value, [0.0015, -0.0025])
