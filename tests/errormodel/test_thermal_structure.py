"""The indirect thermal model: laws of its parts, its files, and a warm machine on days
that are not in its logs."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, points
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from judge import drift

import olp
from olp.calibration.thermal.drift import DriftLog, findings, identify
from olp.cli import main
from olp.core.errors import CannotCompute, ConfigError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Thermal
from olp.errormodel.distortion import lagged, shapes
from olp.errormodel.sources.structure import Distortion, Sensor, Structure, ThermalStructure
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.structure import load_structure, parse_drift_log, structure_text
from olp.files.calibration.writer import calibration_files
from olp.files.write import write_files

BOX = np.array([[0.0, 2000.0], [-500.0, 500.0], [-600.0, 0.0]])
SENSORS = (Sensor("beam", 20.0, (15.0, 30.0), 600.0), Sensor("column", 21.0, (15.0, 30.0)))
STRUCTURE = Structure(
    SENSORS,
    (
        Distortion("EXX", "beam", (0.0, 2000.0), 1e-3, 1e-5, 0.0),
        Distortion("EZX", "beam", (0.0, 2000.0), 0.0, 0.0, 5e-3, (0.0, 0.0, 0.0), (0.0, 0.0, -100.0)),
        Distortion("EBX", "column", (0.0, 2000.0), 2e-6),
    ),
)


# -- parts -----------------------------------------------------------------------------------------------


@given(st.floats(1.0, 1e5), st.lists(st.floats(1.0, 600.0), min_size=2, max_size=30), st.floats(-2.0, 2.0))
def test_a_lag_is_exact_for_steps_and_ramps(lag: float, steps: list[float], rate: float) -> None:
    time = np.cumsum([0.0, *steps])
    np.testing.assert_allclose(lagged(time, np.full(len(time), 21.5), lag), 21.5)
    # theta = rate (t - lag + lag exp(-t / lag)) is the answer to a ramp from rest
    ramp = lagged(time, rate * time, lag)
    np.testing.assert_allclose(ramp, rate * (time - lag * -np.expm1(-time / lag)), atol=1e-6 * time[-1])
    np.testing.assert_allclose(lagged(time, rate * time, -lag), 2.0 * rate * time - ramp, atol=1e-12)


def test_a_distortion_worked_by_hand() -> None:
    """24 and 26 degC: EXX = 4 (1 um + 10 um/m q'), EZX = 4 * 5 um in the middle, EBX = 5 * 2 urad."""
    model = build(Calibration("m", BOX, structure=STRUCTURE.at({"beam": 24.0, "column": 26.0})), "FXYZ")
    points = np.array([[0.0, 0, 0], [1000.0, 0, 0], [1500.0, 0, 0]])
    tool = np.array([0.0, 0.0, -100.0])
    expected = np.array([[4 - 40, 0, 0], [4, 0, 20], [4 + 20, 0, 20 * 0.75]]) * 1e-3
    expected[:, 0] += 10e-6 * -100.0
    np.testing.assert_allclose(model.error(points, tool), expected, atol=1e-15)
    np.testing.assert_allclose(model.rotation(points), [[0, 1e-5, 0]] * 3)
    assert {name for name, _ in model.contributions(points, tool)} == {
        "thermal EXX", "thermal EZX", "thermal EBX",
    }  # fmt: skip
    np.testing.assert_array_equal(
        model.error(points, np.append(tool, 30.0)), model.error(points, tool)
    )  # no matter what it carries
    half = build(Calibration("m", BOX, structure=STRUCTURE.at({"beam": 22.0, "column": 23.5})), "FXYZ")
    np.testing.assert_allclose(2.0 * half.error(points, tool), expected, atol=1e-15)
    nothing = build(Calibration("m", BOX, structure=STRUCTURE), "FXYZ")
    np.testing.assert_array_equal(nothing.error(points, tool), 0.0)


def test_the_chord_bound_holds() -> None:
    model = build(Calibration("m", BOX, structure=STRUCTURE.at({"beam": 29.0, "column": 16.0})), "XFYZ")
    rng = np.random.default_rng(1)
    start, end = rng.uniform(BOX[:, 0], BOX[:, 1], (2, 100, 3))
    share, tool = np.linspace(0, 1, 65)[None, :, None], np.array([20.0, 0.0, -200.0])
    error = model.error((start[:, None] + share * (end - start)[:, None]).reshape(-1, 3), tool)
    error = error.reshape(100, 65, 3)
    away = np.linalg.norm(error - error[:, :1] - share * (error[:, -1:] - error[:, :1]), axis=2).max(axis=1)
    assert np.all(away <= model.chord_bound(end - start, tool) * (1 + 1e-9) + 1e-14)


def test_temperatures_that_were_not_identified_are_refused_or_held() -> None:
    warm = Calibration("m", BOX, structure=STRUCTURE.at({"beam": 31.0, "column": 20.0}))
    refused = r"beam: the structure is at 31\.00 degC; expected 15\.00 to 30\.00 degC"
    with pytest.raises(ConfigError, match=refused):
        build(warm, "FXYZ")
    points, tool = np.array([[500.0, 0, 0]]), np.zeros(3)
    edge = build(Calibration("m", BOX, structure=STRUCTURE.at({"beam": 30.0, "column": 20.0})), "FXYZ")
    np.testing.assert_array_equal(
        build(warm, "FXYZ", outside="hold").error(points, tool), edge.error(points, tool)
    )
    with pytest.raises(ConfigError, match="no temperature of sensor column"):
        STRUCTURE.at({"beam": 20.0})
    with pytest.raises(ConfigError, match="spindle is not a sensor"):
        STRUCTURE.at({"beam": 20.0, "column": 20.0, "spindle": 20.0})


def test_growth_of_a_scale_is_not_counted_twice() -> None:
    with pytest.raises(ConfigError, match="expands the scale again"):
        Calibration("m", BOX, structure=STRUCTURE, thermal=Thermal(scale_per_K=(1e-5, 0.0, 0.0)))
    with pytest.raises(ConfigError, match="EXX is known from 0 to 2000 mm"):
        Calibration("m", np.array([[0.0, 2100.0], *BOX[1:]]), structure=STRUCTURE)


def test_a_log_leads_to_the_temperatures_at_its_end_or_at_a_time() -> None:
    time = np.arange(0.0, 7200.0, 60.0)
    sensors = {"beam": np.where(time < 3600.0, 20.0, 25.0), "column": 20.0 + time / 3600.0}
    end = STRUCTURE.settled(time, sensors, None).temperatures_degC
    assert end["column"] == pytest.approx(20.0 + 7140.0 / 3600.0)
    assert end["beam"] == pytest.approx(25.0 - 5.0 * np.exp(-(7140.0 - 3600.0) / 600.0), abs=0.02)
    assert STRUCTURE.settled(time, sensors, 3000.0).temperatures_degC["beam"] == 20.0
    with pytest.raises(ConfigError, match="not in the log"):
        STRUCTURE.settled(time, sensors, 9e4)


# -- identification ---------------------------------------------------------------------------------------


def exact_log(
    structure: Structure, seed: int, places=(0.0, 500.0, 1500.0, 2000.0), noise: float = 0.0
) -> DriftLog:
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 6 * 3600.0, 120.0)
    sensors = {
        s.name: 20.0
        + 3.0 * np.sin(time / rng.uniform(2000, 6000))
        + 2.0 * np.sin(time / rng.uniform(700, 1500))
        for s in structure.sensors
    }
    readings = {}
    for component, place in itertools.product(("EXX", "EZX", "EBX"), places):
        value = rng.normal() * 0.01 + np.zeros(len(time))
        for d in structure.distortions:
            if d.component == component:
                s = next(s for s in structure.sensors if s.name == d.sensor)
                rise = lagged(time, sensors[s.name], s.lag_s) - s.reference_degC
                value += rise * (shapes(d.span_mm, np.array([place]))[0] @ [d.offset, d.growth, d.bow])
        readings[component, place] = value + rng.normal(0.0, noise, len(time))
    return DriftLog(time, sensors, readings, name=f"log {seed}")


@pytest.mark.slow
def test_a_model_of_the_same_form_is_found_again() -> None:
    logs = [exact_log(STRUCTURE, seed) for seed in (1, 2)]
    fit = identify(logs, BOX, {"beam": 20.0, "column": 21.0})
    lags = {s.name: s.lag_s for s in fit.structure.sensors}
    assert lags["beam"] == pytest.approx(600.0, rel=0.02)
    assert abs(lags["column"]) < 30.0
    assert fit.removed > 0.99
    assert fit.held_out == "log 2"
    distortions = {(d.component, d.sensor): d for d in fit.structure.distortions}
    assert distortions["EXX", "beam"].growth == pytest.approx(1e-5, rel=0.02)
    assert distortions["EZX", "beam"].bow == pytest.approx(5e-3, rel=0.02)
    assert distortions["EBX", "column"].offset == pytest.approx(2e-6, rel=0.02)
    assert abs(distortions["EXX", "column"].growth) < 3e-7
    assert findings(fit) == ()


@pytest.mark.slow
def test_the_stated_uncertainty_is_that_of_repeated_fits() -> None:
    offset = Distortion("EXX", "beam", (0.0, 2000.0), 1e-3)
    steady = Structure((Sensor("beam", 20.0, (0.0, 40.0)),), (offset,))
    errors, sigma = [], []
    for seed in range(16):
        log = exact_log(steady, seed, noise=1e-3)
        own = {key: value for key, value in log.readings.items() if key[0] == "EXX"}
        fit = identify([DriftLog(log.time_s, log.sensors_degC, own)], BOX, 20.0)
        errors.append(fit.structure.distortions[0].offset - 1e-3)
        sigma.append(fit.sigma[0][0])
    z = np.array(errors) / np.array(sigma)
    assert 0.6 < np.sqrt(np.mean(z * z)) < 1.6


@pytest.mark.slow
def test_a_log_of_every_second_is_thinned_and_tells_the_same() -> None:
    log = exact_log(STRUCTURE, 1)
    log = DriftLog(log.time_s, log.sensors_degC, {k: v for k, v in log.readings.items() if k[0] == "EXX"})
    dense = np.arange(log.time_s[0], log.time_s[-1], 2.0)
    fine = DriftLog(
        dense,
        {name: np.interp(dense, log.time_s, v) for name, v in log.sensors_degC.items()},
        {key: np.interp(dense, log.time_s, v) for key, v in log.readings.items()},
    )
    one, two = (identify([given], BOX, {"beam": 20.0, "column": 21.0}) for given in (log, fine))
    assert two.components[0].readings < one.components[0].readings * 30
    for a, b in zip(one.structure.distortions, two.structure.distortions, strict=True):
        assert (b.offset, b.growth, b.bow) == pytest.approx((a.offset, a.growth, a.bow), rel=0.03, abs=2e-4)


@pytest.mark.slow
def test_what_the_logs_do_not_tell_is_refused_or_said() -> None:
    log = exact_log(STRUCTURE, 1)
    twins = {"beam": log.sensors_degC["beam"], "column": log.sensors_degC["beam"] + 0.3}
    with pytest.raises(CannotCompute, match="change together"):
        identify([DriftLog(log.time_s, twins, log.readings)], BOX, 20.0)
    still = {**log.sensors_degC, "column": np.full(len(log.time_s), 20.0)}
    with pytest.raises(CannotCompute, match="column does not change"):
        identify([DriftLog(log.time_s, still, log.readings)], BOX, 20.0)
    assert identify([DriftLog(log.time_s, still, log.readings)], BOX, 20.0, sensors=["beam"]).condition == 1.0
    with pytest.raises(ConfigError, match="spindle is not a sensor"):
        identify([log], BOX, 20.0, sensors=["spindle"])
    few = {k: v for k, v in log.readings.items() if k in {("EXX", 0.0), ("EXX", 500.0), ("EZX", 500.0)}}
    fit = identify([DriftLog(log.time_s, log.sensors_degC, few)], BOX, 20.0)
    assert {f.code for f in findings(fit)} == {"OLP881", "OLP882"}
    assert fit.structure.distortions[0].bow == 0.0
    deaf = {k: np.random.default_rng(3).normal(0, 0.01, len(v)) for k, v in log.readings.items()}
    fit = identify([DriftLog(log.time_s, log.sensors_degC, deaf)], BOX, 20.0)
    assert "OLP883" in {f.code for f in findings(fit)}


# -- files -----------------------------------------------------------------------------------------------


def test_a_structure_is_written_and_read_back_the_same(tmp_path: Path) -> None:
    (tmp_path / "t.toml").write_bytes(structure_text(STRUCTURE, "m", ["a note"]))
    again = load_structure(tmp_path / "t.toml", "m")
    assert (again.sensors, again.distortions) == (STRUCTURE.sensors, STRUCTURE.distortions)
    with pytest.raises(ConfigError, match=r'line 3: machine = "m" is not the name'):
        load_structure(tmp_path / "t.toml", "other")
    (tmp_path / "t.toml").write_text(
        (tmp_path / "t.toml").read_text().replace("offset_urad_K", "offset_um_K", 1)
    )
    with pytest.raises(ConfigError, match="wrong unit for EBX"):
        load_structure(tmp_path / "t.toml", "m")
    import datetime

    whole = Calibration("m", BOX, structure=STRUCTURE, measured=datetime.date(2026, 5, 14))
    write_files(calibration_files(whole, tmp_path / "c.toml"))
    read = load_calibration(tmp_path / "c.toml").structure
    assert read is not None
    assert (read.sensors, read.distortions) == (STRUCTURE.sensors, STRUCTURE.distortions)


LOG = (
    "# tool_mm = [0, 0, -120]\n# line_mm = "
    "{ X = 0, Y = 5.0, Z = 1 }\nt_s,beam_degC,EXX@500_um,EBX@-10.5_urad\n"
    "0,20.1,1.5,2\n60,20.2,,3\n"
)


def test_a_log_is_read() -> None:
    log = parse_drift_log(LOG.encode(), "log.csv")
    assert log.time_s.tolist() == [0.0, 60.0]
    assert log.sensors_degC["beam"].tolist() == [20.1, 20.2]
    np.testing.assert_array_equal(log.readings["EXX", 500.0], [1.5e-3, np.nan])
    np.testing.assert_array_equal(log.readings["EBX", -10.5], [2e-6, 3e-6])
    assert (log.tool_mm, log.line_mm) == ((0.0, 0.0, -120.0), (0.0, 5.0, 1.0))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("t_s", "time", 'line 3: column 1 is "time"; expected t_s'),
        ("beam_degC", "beam", "line 3: column 2"),
        ("EXX@500_um", "EXX@500_urad", "its unit, um here"),
        ("EXX@500_um", "EWX@500_um", "ISO 230-1 name"),
        ("60,20.2", "0,20.2", "line 5: t_s = 0 comes after 0"),
        ("20.2", "", 'line 5: beam_degC = "" is not a number'),
        ("20.1,1.5", "20.1,1,5", "line 4: 5 values under 4 columns"),
        ("[0, 0, -120]", "[0, 0]", "line 1: tool_mm = [0, 0]"),
        ("X = 0, Y", "Y", "line 2: line_mm = { Y = 5.0, Z = 1 }; expected three lengths"),
        ("60,20.2,,3\n", "", "expected at least 2"),
    ],
)
def test_a_log_that_is_wrong_is_refused_with_its_line(old: str, new: str, words: str) -> None:
    assert old in LOG
    with pytest.raises(ConfigError, match=re.escape(words)):
        parse_drift_log(LOG.replace(old, new, 1).encode(), "log.csv")


# -- a warm machine ---------------------------------------------------------------------------------------

PLACES = np.array([0.0, 500.0, 1000.0, 1500.0, 2000.0])


def written_log(path: Path, seed: int, hours: float, swing: float, power: float, *, readings: bool = True):
    """A day of the judge's machine as its log, drift counted from its first reading, one position a
    minute."""
    day = drift.day(seed, hours, swing, power)
    sensors = drift.sensed(day, seed)
    errors = drift.errors(day.bodies, PLACES)
    rng = np.random.default_rng(seed)
    names = [f"{c}@{x:g}_{'um' if c[1] in 'XYZ' else 'urad'}" for c in errors for x in PLACES]
    header = ["t_s", *(f"{n}_degC" for n in sensors), *(names if readings else [])]
    lines = [",".join(header)]
    for i, t in enumerate(day.time_s):
        row = [f"{t:g}", *(f"{v[i]:.3f}" for v in sensors.values())]
        for c, v in errors.items() if readings else ():
            scale, noise = (1e3, 0.5) if c[1] in "XYZ" else (1e6, 1.0)
            for k in range(len(PLACES)):
                value = scale * (v[i, k] - v[0, k]) + rng.normal(0.0, noise)
                row.append(f"{value:.3f}" if i % len(PLACES) == k else "")
        lines.append(",".join(row))
    path.write_text("\n".join(lines) + "\n")
    return day


def reference() -> list[str]:
    """What the sensors say at 20 degC all through, as read when the machine was calibrated."""
    offset = np.random.default_rng(99).normal(0.0, 0.1, 4)
    return [f"--reference-degC={n}={20.0 + o:.2f}" for n, o in zip(drift.BODIES, offset, strict=True)]


@pytest.mark.slow
def test_the_drift_of_days_that_were_not_seen_is_removed(tmp_path: Path) -> None:
    """Two days of logs, from the command line to corrected programs on six other days, at the tip of a
    tool."""
    tool = (60.0, 0.0, -300.0)
    tables = f"{TRUE_ZERO}[tools.1]\nZ_mm = 300.0\ngauge_to_tip_mm = [{tool[0]}, {tool[1]}, {tool[2]}]\n"
    path = machine(tmp_path, "", tables=tables + "[job_defaults]\ntool = 1\n", increment_mm=0.0001)
    calibration = path.with_name("calibration.toml")
    calibration.write_text(calibration.read_text().replace("[[-1000.0, 2000.0]", "[[0.0, 2000.0]"))
    for seed, day in ((1, (10, 1.5, 6.0)), (2, (8, 2.5, 3.0))):
        written_log(tmp_path / f"day{seed}.csv", seed, *day)
    words = ["calibrate", "thermal", str(tmp_path / "day1.csv"), str(tmp_path / "day2.csv"), "-m", str(path)]
    done = CliRunner().invoke(main, [*words, "-o", str(tmp_path / "thermal.toml"), *reference()])
    assert done.exit_code == 0, done.output
    assert "removed where it was not fitted" in done.output
    calibration.write_text(calibration.read_text() + '\n[thermal]\nstructure = "thermal.toml"\n')
    blocks = "".join(f"G0 X{x:g} Y0 Z0\n" for x in np.linspace(0, 2000, 9))
    source = f"G21 G90 G54 G64 P0.001 Q0\n{blocks}M2\n"
    nominal = points(source.encode())
    before, after = [], []
    for seed in range(11, 17):
        today = written_log(tmp_path / "today.csv", seed, 7, 2.0, 5.0, readings=False)
        time_s = np.random.default_rng(seed).uniform(3600.0, today.time_s[-1])
        job = path.with_name("job.toml")
        job.write_text(
            'schema = "olp-job-1"\n[temperatures_degC]\n'
            f'sensor_log = "today.csv"\nsensor_log_at_s = {time_s:.0f}\n'
        )
        result = olp.correct(source.encode(), path, job, outside_box="hold")
        bodies = np.array([[np.interp(time_s, today.time_s, b) for b in today.bodies.T]])
        for commands, deviations in ((nominal, before), (points(result.data), after)):
            error = {c: v[0] for c, v in drift.errors(bodies, commands[:, 0]).items()}
            tip = np.zeros_like(commands)
            tip[:, 0] = error["EXX"] + error["EBX"] * (commands[:, 2] + tool[2])
            tip[:, 2] = error["EZX"] - error["EBX"] * tool[0]
            deviations.append(commands + tip - nominal)
    drifted, residual = (np.sqrt((np.concatenate(v) ** 2).sum(axis=1).mean()) for v in (before, after))
    removed = 1 - residual / drifted
    print(f"drift {1e3 * drifted:.1f} um rms, residual {1e3 * residual:.2f} um, removed {removed:.1%}")
    assert drifted > 0.01
    assert residual <= 0.15 * drifted


def test_a_job_without_temperatures_is_told_so_and_one_out_of_range_is_refused(tmp_path: Path) -> None:
    path = machine(tmp_path, '[thermal]\nstructure = "t.toml"\n', tables=TRUE_ZERO, job="")
    calibration = path.with_name("calibration.toml")
    calibration.write_text(calibration.read_text().replace("[[-1000.0, 2000.0]", "[[0.0, 2000.0]"))
    (tmp_path / "t.toml").write_bytes(structure_text(STRUCTURE, "m"))
    job, source = path.with_name("job.toml"), b"G21 G90 G54 G64 P0.001 Q0\nG0 X0 Y0 Z0\nG1 X1500 F600\nM2\n"
    assert [f.code for f in olp.correct(source, path, job).findings] == ["OLP423"]

    def stated(beam: float) -> Path:
        text = f"[temperatures_degC.sensors]\nbeam = {beam}\ncolumn = 21.0\n"
        job.write_text(f'schema = "olp-job-1"\n{text}')
        return job

    result = olp.correct(source, path, stated(24.0))
    assert result.findings == ()
    # EXX = 4 (1 + 10 * 0.5) um = 24 um, EZX = 20 um * 0.75
    np.testing.assert_allclose(points(result.data)[-1], [1499.976, 0.0, -0.015], atol=1e-9)
    with pytest.raises(ConfigError, match="the structure is at 31"):
        olp.correct(source, path, stated(31.0))
    held = olp.correct(source, path, stated(31.0), outside_box="hold")
    assert [f.code for f in held.findings] == ["OLP424"]
    job.write_text('schema = "olp-job-1"\n[temperatures_degC.sensors]\nbeam = 20.0\n')
    with pytest.raises(ConfigError, match="no temperature of sensor column"):
        olp.correct(source, path, job)
    both = "sensor_log = 'x.csv'\n[temperatures_degC.sensors]\nbeam = 20.0\n"
    job.write_text(f'schema = "olp-job-1"\n[temperatures_degC]\n{both}')
    with pytest.raises(ConfigError, match="expected one of the two"):
        olp.correct(source, path, job)


def test_inspect_shows_the_structure_in_its_units() -> None:
    """EXX: 1 um/K, 0.01 um/(mm K) is 10 um/(m K). EZX: a bow of 5 um/K. EBX: 2 urad/K."""
    shown = ThermalStructure().inspect(STRUCTURE, None)  # type: ignore[arg-type]
    assert shown["sensors"] == [
        {"name": "beam", "reference_degC": 20.0, "lowest_degC": 15.0, "highest_degC": 30.0, "lag_s": 600.0},
        {"name": "column", "reference_degC": 21.0, "lowest_degC": 15.0, "highest_degC": 30.0, "lag_s": 0.0},
    ]
    names = ("EXX by beam", "EZX by beam", "EBX by column")
    assert [row["name"] for row in shown["distortions"]] == list(names)
    exx, ezx, ebx = ({k: v for k, v in row.items() if k != "name"} for row in shown["distortions"])
    assert exx == pytest.approx({"offset_um_K": 1.0, "growth_um_m_K": 10.0, "bow_um_K": 0.0})
    assert ezx == pytest.approx({"offset_um_K": 0.0, "growth_um_m_K": 0.0, "bow_um_K": 5.0})
    assert ebx == pytest.approx({"offset_urad_K": 2.0, "growth_urad_m_K": 0.0, "bow_urad_K": 0.0})
    assert ThermalStructure().inspect(None, None) == {}  # type: ignore[arg-type]
