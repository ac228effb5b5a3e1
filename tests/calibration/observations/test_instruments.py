"""Other instruments in the one adjustment: points in the machine's frame, artefacts, a polar station,
diagonals and ball-bars."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from cases.calibration import FRESH, TOOLS, case, cloud, line_of, residual_of
from cases.fast import some_fast, some_of_a_campaign
from judge import simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.curves import calibration_of
from olp.calibration.estimator.findings import findings_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.summary import summary
from olp.calibration.observations.artefact import Artefact
from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.points import Points, polar_points
from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.files.measurements.reader import files_of_measurements, load_measurements

#: mm per um.
UM = 1e-3
#: Shift of the axes as a whole, mm.
SHIFT = np.array([0.4, -0.7, 0.2])
#: Turn of the axes as a whole, rad.
TURN = np.array([150e-6, -90e-6, 210e-6])


def messages_of(fitted: Fit, code: str) -> list[str]:
    return [f.message for f in findings_of(fitted, [(0.0, 0.0, -120.0)], None) if f.code == code]


def in_the_frame(machine: simulated.Machine, seed: int, n: int, sigma_um: float) -> Points:
    """Where the tip is in the machine's frame, whose axes as a whole are shifted and turned about zero."""
    axis, tool, _ = simulated.points(machine, seed, n, 0.0)
    noise = np.random.default_rng(seed).normal(0.0, sigma_um * UM, axis.shape)
    place = axis + tool + machine.error(axis, tool) + SHIFT + np.cross(TURN, axis + tool) + noise
    return Points(axis, tool, place, sigma_um * UM, source="tcp.csv", known_frame=True)


# -- TCP points in the frame of the machine --------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chain", "with_lines"), some_fast([("YFXZ", True), ("FXYZ", False), ("ZXFY", False)], 3)
)
def test_points_in_the_frame_of_the_machine_show_all_of_the_error(chain: str, with_lines: bool) -> None:
    """Also the rigid part of it, which the written calibration holds, wherever its datum is."""
    machine, measurements = case(2, "smooth", chain)
    lines = measurements if with_lines else Measurements("m")
    points = in_the_frame(machine, 2, 120, 5.0)
    fitted = fit(lines.also((points,)), chain, datum_mm=(1000.0, 500.0, -200.0))
    position = np.random.default_rng(2).uniform(fitted.box_mm[:, 0], fitted.box_mm[:, 1], (300, 3))
    model = build(calibration_of(fitted), chain)
    for tool in (*TOOLS, *FRESH):
        true = machine.error(position, np.array(tool)) + SHIFT + np.cross(TURN, position + np.array(tool))
        assert simulated.rms_um(true) > 500.0
        rest = true - fitted.error(position, tool)
        assert simulated.rms_um(rest) < 11.0
        assert 0.5 < np.sqrt(np.mean((rest / fitted.sigma(position, tool)) ** 2)) < 1.6
        assert np.abs(model.error(position, np.array(tool)) - fitted.error(position, tool)).max() < 0.6 * UM
    row = summary(fitted, calibration_of(fitted), [])["frame"]
    assert np.linalg.norm(row["shift_um"]) > 400.0


@pytest.mark.slow
def test_an_unknown_frame_beside_a_known_one_keeps_its_own() -> None:
    machine = simulated.machine(1, "smooth", "FXYZ")
    known, other = in_the_frame(machine, 1, 100, 5.0), cloud(machine, 1, 100, 5.0)
    both = fit(Measurements("m", (known, other)), "FXYZ")
    position = np.random.default_rng(2).uniform(both.box_mm[:, 0], both.box_mm[:, 1], (200, 3))
    true = machine.error(position, np.array(FRESH[0])) + SHIFT + np.cross(TURN, position + np.array(FRESH[0]))
    assert simulated.rms_um(true - both.error(position, FRESH[0])) < 6.0
    assert not messages_of(both, "OLP808")


def test_points_far_from_the_frame_are_refused() -> None:
    points = in_the_frame(simulated.machine(1, "smooth", "FXYZ"), 1, 20, 5.0)
    measured = points.measured_mm.copy()
    measured[7, 1] += 25.0
    with pytest.raises(ConfigError, match="row 8"):
        dataclasses.replace(points, measured_mm=measured)


# -- a ball plate, a space grid --------------------------------------------------------------------------


@pytest.mark.slow
def test_a_plate_that_nobody_calibrated_is_calibrated_with_the_machine() -> None:
    """Its balls are up to 1 mm from where they are drawn. In twelve poses, with a laser line for the scale,
    it tells nearly as much as one with a certificate."""
    machine = simulated.machine(3, "smooth", "FXYZ")
    rng = np.random.default_rng(5)
    drawn = np.array([(x, y, 0.0) for x in np.linspace(0, 800, 6) for y in np.linspace(0, 800, 6)])
    true = drawn + rng.uniform(-0.6, 0.6, drawn.shape)
    stops, balls, poses = [], [], []
    vector = np.array(simulated.OFFSETS[0])
    for k in range(12):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        inner = np.array([[420.0, 2580.0], [420.0, 1580.0], [-580.0, -420.0]])
        place = (true - true.mean(axis=0)) @ turn.T + rng.uniform(inner[:, 0], inner[:, 1])
        use = np.flatnonzero(((place > machine.box[:, 0]) & (place < machine.box[:, 1])).all(axis=1))
        stop = place[use] - vector
        for _ in range(6):
            stop = place[use] - vector - machine.error(stop, vector)
        stops.append(stop + rng.normal(0.0, 0.5 * UM, stop.shape))
        balls.append(use)
        poses.append(np.full(len(use), k))
    lines = [line_of(taken) for taken in simulated.all_lines(machine, 3) if taken.component == "EXX"]

    def fitted_with(places: np.ndarray, sigma_mm: float) -> Fit:
        plate = Artefact(
            np.concatenate(stops), vector, np.concatenate(balls), np.concatenate(poses), places,
            np.full(len(places), sigma_mm), 0.5 * UM, "plate.csv",
        )  # fmt: skip
        return fit(Measurements("m", (*lines, plate)), "FXYZ")

    own, known = fitted_with(drawn, 0.0), fitted_with(true, 0.2 * UM)
    results = [residual_of(machine, one, simulated.OFFSETS[0], 400) for one in (own, known)]
    assert results[0].before_framed > 40.0
    assert results[0].after_framed < 1.5 * results[1].after_framed + 1.0
    assert not messages_of(own, "OLP808")


@pytest.mark.slow
def test_a_ball_plate_in_any_pose_is_a_set_of_points() -> None:
    """The machine probes the balls of a plate in six poses: the axes stop where the tip, with the machine's
    errors, is at the ball. Commanded is where they stop, measured is the certificate."""
    machine = simulated.machine(3, "smooth", "FXYZ")
    rng = np.random.default_rng(3)
    balls = np.array([(x, y, 0.0) for x in np.linspace(0, 800, 6) for y in np.linspace(0, 800, 6)])
    sets = []
    for k in range(24):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        vector = np.array(simulated.OFFSETS[k % 3])
        inner = np.array([[420.0, 2580.0], [420.0, 1580.0], [-580.0, -420.0]])
        place = (balls - balls.mean(axis=0)) @ turn.T + rng.uniform(inner[:, 0], inner[:, 1])
        place = place[((place > machine.box[:, 0]) & (place < machine.box[:, 1])).all(axis=1)]
        own = (place - place[0]) @ turn
        stop = place - vector
        for _ in range(6):
            stop = place - vector - machine.error(stop, vector)
        own = own + rng.normal(0.0, 0.5 * UM, own.shape)
        sets.append(Points(stop, vector, own, 0.5 * UM, source=f"pose-{k}.csv"))
    fitted = fit(Measurements("m", tuple(sets)), "FXYZ")
    result = residual_of(machine, fitted, FRESH[0], 400)
    assert result.before_framed > 40.0
    assert result.after_framed < 4.0
    assert not messages_of(fitted, "OLP808")


# -- one polar station -----------------------------------------------------------------------------------


def polar_readings(
    machine: simulated.Machine, seed: int, n: int, sigma_mm: float, sigma_rad: float
) -> tuple[np.ndarray, ...]:
    """A tracker 3 m in front of the machine: axis positions, tools, distance, azimuth, elevation."""
    axis, tool, distance, azimuth, elevation = simulated.polar(machine, seed, n, (1500.0, -3000.0, -300.0))
    rng = np.random.default_rng([seed, 3])
    return (
        axis, tool, distance + rng.normal(0.0, sigma_mm, n), azimuth + rng.normal(0.0, sigma_rad, n),
        elevation + rng.normal(0.0, sigma_rad, n),
    )  # fmt: skip


@pytest.mark.slow
def test_a_polar_station_weighs_distance_and_angles_as_they_are() -> None:
    """0.5 um along the ray and 10 urad across it: far better than as points of the mean uncertainty, with
    the stated band."""
    weighed, alike, z = [], [], []
    for seed in range(4):
        machine = simulated.machine(seed, "smooth", "FXYZ")
        taken = polar_readings(machine, seed, 250, 0.5 * UM, 10e-6)
        points = polar_points(*taken, sigma_mm=np.array(0.5 * UM), sigma_rad=10e-6, source="polar.csv")
        plain = dataclasses.replace(points, covariance_mm2=None)
        for cloud_, residuals in ((points, weighed), (plain, alike)):
            fitted = fit(Measurements("m", (cloud_,)), "FXYZ")
            result = residual_of(machine, fitted, FRESH[1], 400)
            residuals.append(result.after_framed)
            if cloud_ is points:
                z.append(result.z)
                assert not messages_of(fitted, "OLP808")
                assert fitted.chi_square / fitted.freedom == pytest.approx(1.0, abs=0.2)
    assert np.median(weighed) < 0.9 * np.median(alike)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5


@pytest.mark.slow
def test_a_polar_slip_is_named_and_alike_weights_are_points() -> None:
    machine = simulated.machine(0, "smooth", "FXYZ")
    axis, tool, distance, azimuth, elevation = polar_readings(machine, 0, 150, 5.0 * UM, 2e-6)
    slipped = distance.copy()
    slipped[30] += 0.2
    points = polar_points(axis, tool, slipped, azimuth, elevation, sigma_mm=np.array(5 * UM), sigma_rad=2e-6)
    fitted = fit(Measurements("m", (points,)), "FXYZ")
    assert [o.row for o in fitted.outliers] == [31]
    plain = cloud(machine, 0, 60, 5.0)
    same = dataclasses.replace(plain, covariance_mm2=np.tile(np.eye(3) * plain.sigma**2, (60, 1, 1)))
    first, second = (fit(Measurements("m", (p,)), "FXYZ") for p in (plain, same))
    axis = machine.box.mean(axis=1)[None] + np.array([[300.0, 200.0, 100.0]])
    # what cells hide counts along the axes of each covariance
    assert first.error(axis, FRESH[0]) == pytest.approx(second.error(axis, FRESH[0]), abs=1e-4)


# -- diagonals and ball-bars -----------------------------------------------------------------------------

TOOL_MM = (0.0, 0.0, -120.0)
CENTRE = (1500.0, 1000.0, -500.0)


def diagonals_of(machine: simulated.Machine, seed: int, count: int = 4) -> tuple[Diagonal, ...]:
    """The body diagonals, then those of the faces."""
    (x0, x1), (y0, y1), (z0, z1) = machine.box
    ends = [
        ((x0, y0, z0), (x1, y1, z1)), ((x1, y0, z0), (x0, y1, z1)), ((x0, y1, z0), (x1, y0, z1)),
        ((x1, y1, z0), (x0, y0, z1)),
        ((x0, y0, -500.0), (x1, y1, -500.0)), ((x0, y1, -500.0), (x1, y0, -500.0)),
    ]  # fmt: skip
    return tuple(
        Diagonal(a, b, *simulated.diagonal(machine, seed, a, b, TOOL_MM), TOOL_MM, source=f"diagonal-{k}.csv")
        for k, (a, b) in enumerate(ends[:count])
    )


def circles_of(machine: simulated.Machine, seed: int, *, both: bool = True) -> tuple[Circles, ...]:
    return tuple(
        Circles(
            plane, 400.0, CENTRE, *simulated.circles(machine, seed, plane, CENTRE, 400.0, TOOL_MM, both=both),
            TOOL_MM, sigma=0.2 * UM, source=f"circle-{plane}.csv",
        )
        for plane in ("XY", "YZ", "ZX")
    )  # fmt: skip


def no_square(measurements: Measurements) -> Measurements:
    lines = tuple(dataclasses.replace(line, square=None) for line in measurements.lines)
    return dataclasses.replace(measurements.with_lines(lines), squares=())


@pytest.mark.slow
@pytest.mark.parametrize("chain", some_of_a_campaign(("FXYZ", "YFXZ", "XYZF"), 3))
def test_a_ball_bar_or_diagonals_do_what_a_square_does(chain: str) -> None:
    """Lines whose straightness was read without a square; zero, centre, radius, servo mismatch and backlash
    are unknowns of the instruments."""
    machine, measurements = case(0, "smooth", chain)
    bare = no_square(measurements)
    square = residual_of(machine, fit(measurements, chain), TOOLS[0], 400).after_framed
    alone = fit(bare, chain)
    (message,) = messages_of(alone, "OLP806")
    assert message.startswith("C0Y, B0Z, A0Z are taken as zero: ")
    for more in (circles_of(machine, 0), diagonals_of(machine, 0)):
        fitted = fit(bare.also(more), chain)
        assert not messages_of(fitted, "OLP806") and not messages_of(fitted, "OLP808")
        result = residual_of(machine, fitted, TOOLS[0], 400)
        assert result.after_framed < max(4.0, 1.5 * square)
        for name in ("C0Y", "B0Z", "A0Z"):
            row = fitted.squareness(name)
            sigma = float(np.sqrt(row @ fitted.covariance @ row))
            assert sigma < 6e-6
            assert abs(row @ fitted.theta - machine.square[name]) < 4.0 * sigma + 1e-6


@pytest.mark.slow
def test_squareness_is_not_observable_with_a_ball_bar_in_one_direction() -> None:
    machine, measurements = case(0, "smooth", "FXYZ")
    bare = no_square(measurements)
    one_way = fit(bare.also(circles_of(machine, 0, both=False)), "FXYZ")
    (message,) = messages_of(one_way, "OLP806")
    assert message.startswith("C0Y, B0Z, A0Z are taken as zero: ")


@pytest.mark.slow
def test_a_diagonal_with_the_wrong_sign_does_not_fit() -> None:
    machine, measurements = case(0, "smooth", "FXYZ")
    first, *rest = diagonals_of(machine, 0)
    wrong = dataclasses.replace(first, value=-first.value)
    fitted = fit(measurements.also((wrong, *rest)), "FXYZ")
    assert messages_of(fitted, "OLP808")


@pytest.mark.slow
def test_no_uncertainty_is_refused() -> None:
    machine, measurements = case(0, "smooth", "FXYZ")
    first = circles_of(machine, 0)[0]
    with pytest.raises(ConfigError, match="sigma_um"):
        fit(measurements.also((dataclasses.replace(first, sigma=0.0),)), "FXYZ")
    d = diagonals_of(machine, 0, 1)[0]
    once = Diagonal(d.start_mm, d.end_mm, d.distance_mm[:42], d.value[:42], d.run[:42], d.direction[:42])
    with pytest.raises(ConfigError, match="no repeated readings"):
        fit(measurements.also((once,)), "FXYZ")


# -- files -----------------------------------------------------------------------------------------------

PLAN = 'schema = "olp-measurements-1"\nmachine = "m"\nmeasured = 2026-05-14\ntemperature_degC = 20.0\n'
PLACES = [(x, y, z) for x in (0, 500) for y in (0, 300) for z in (-100, 0)]


def test_tables_of_points_and_polar_stations(tmp_path: Path) -> None:
    rows = "".join(f"{x},{y},{z},{x}.01,{y},{z - 90}\n" for x, y, z in PLACES)
    (tmp_path / "t.csv").write_text("X_mm,Y_mm,Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm\n" + rows)
    rows = "".join(f"{x},{y},{z},{2000 + x},{x / 100},{y / 100}\n" for x, y, z in PLACES)
    (tmp_path / "p.csv").write_text("X_mm,Y_mm,Z_mm,distance_mm,azimuth_deg,elevation_deg\n" + rows)
    tables = (
        '[[points]]\nfile = "t.csv"\nsigma_um = 8.0\ntool_mm = [0, 0, -90]\nframe = "known"\n'
        '[[polar]]\nfile = "p.csv"\nsigma_distance_um = 0.5\nsigma_um_m = 0.5\nsigma_angle_urad = 10.0\n'
        "tool_mm = [0, 0, -90]\n"
    )
    plan = tmp_path / "measurements.toml"
    plan.write_text(PLAN + tables)
    known, polar = load_measurements([plan]).of(Points)
    assert known.known_frame and not polar.known_frame
    assert np.linalg.norm(polar.measured_mm[-1]) == pytest.approx(2500.0)
    assert polar.covariance_mm2 is not None
    ray = polar.measured_mm[-1] / 2500.0
    assert np.sqrt(ray @ polar.covariance_mm2[-1] @ ray) == pytest.approx(0.5e-3 + 0.5e-6 * 2500.0)
    assert np.trace(polar.covariance_mm2[0]) == pytest.approx(2 * 0.02**2 + 0.0015**2)
    (tmp_path / "p.csv").write_text("X_mm,Y_mm,Z_mm,distance_mm,azimuth_deg,elevation_deg\n1,2,3,0,4,5\n")
    with pytest.raises(ConfigError, match="line 2: distance_mm = 0"):
        load_measurements([plan])


def test_tables_of_diagonals_and_ball_bars(tmp_path: Path) -> None:
    """The files that `calibrate diagonals` and `calibrate ballbar` read."""
    (tmp_path / "d.csv").write_text(
        "# start_mm = [0, 0, -1000]\n# end_mm = [3000, 2000, 0]\n# tool_mm = [0, 0, -90]\n"
        "# sense = commanded-minus-actual\n# sigma_um = 0.5\n"
        "target_mm,run,direction,value_um\n0,1,1,0\n3000,1,1,5\n"
    )
    rows = "".join(f"{5 * k},1,1,{k / 10}\n" for k in range(72))
    (tmp_path / "c.csv").write_text(
        "# plane = XY\n# radius_mm = 150\n# centre_mm = [1500, 1000, -500]\n# tool_mm = [0, 0, -90]\n"
        "# sigma_um = 0.2\nangle_deg,run,direction,deviation_um\n" + rows
    )
    plan = tmp_path / "measurements.toml"
    plan.write_text(PLAN + '[[diagonals]]\nfile = "d.csv"\n[[ballbars]]\nfile = "c.csv"\n')
    measurements = load_measurements([plan])
    assert measurements.of(Diagonal)[0].value[1] == -0.005
    assert measurements.of(Circles)[0].value[10] == pytest.approx(0.001)
    names = {Path(name).name for name in files_of_measurements([plan])}
    assert names == {"measurements.toml", "d.csv", "c.csv"}
    (tmp_path / "d.csv").write_text("target_mm,run,direction,value_um\n0,1,1,0\n")
    with pytest.raises(ConfigError, match=r"d\.csv.*start_mm"):
        load_measurements([plan])


CENTRES = "pose,ball,X_mm,Y_mm,Z_mm\n" + "".join(
    f"{pose},{name},{x + 50 * pose},{y},-200\n"
    for pose in (1, 2)
    for name, x, y in (("A1", 0, 0), ("A2", 200, 0), ("B1", 0, 200))
)
BALLS = "ball,X_mm,Y_mm,Z_mm,sigma_um\nA1,0,0,0,0.5\nA2,200,0,0,0.5\nB1,0,200,0,0\n"


def plate_plan(folder: Path, centres: str = CENTRES, balls: str = BALLS) -> Measurements:
    (folder / "centres.csv").write_text(centres, "utf-8")
    (folder / "balls.csv").write_text(balls, "utf-8")
    (folder / "measurements.toml").write_text(
        'schema = "olp-measurements-1"\nmachine = "m"\nmeasured = 2026-05-14\ntemperature_degC = 20.0\n'
        '[[artefacts]]\nfile = "centres.csv"\ncertificate = "balls.csv"\nsigma_um = 1.0\n'
        "tool_mm = [0.0, 0.0, -120.0]\n",
        "utf-8",
    )
    return load_measurements([folder], "FXYZ")


def test_centres_of_balls_are_read_from_a_plan(tmp_path: Path) -> None:
    (plate,) = plate_plan(tmp_path).of(Artefact)
    assert plate.ball.tolist() == [0, 1, 2, 0, 1, 2] and plate.pose.tolist() == [1, 1, 1, 2, 2, 2]
    assert plate.sigma_ball_mm.tolist() == [0.5 * UM, 0.5 * UM, 0.0]
    names = {Path(name).name for name in files_of_measurements([tmp_path])}
    assert names == {"measurements.toml", "centres.csv", "balls.csv"}


@pytest.mark.parametrize(
    ("centres", "balls", "words"),
    [
        (CENTRES.replace("2,B1", "2,C1"), BALLS, 'ball "C1" is not in balls.csv'),
        (CENTRES, BALLS + "A1,0,0,0,0\n", 'ball "A1" is listed twice'),
        (CENTRES.replace("2,B1", "2,A1").replace("2,A2", "2,A1"), BALLS, "pose 2 has one ball"),
        (CENTRES[: CENTRES.index("2,A1")], BALLS, "one pose only and balls whose places are not known"),
    ],
)
def test_a_wrong_plate_is_refused(centres: str, balls: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=words):
        plate_plan(tmp_path, centres, balls)
