"""Squareness from every source has the sign convention of the error model, which the golden files fix; a
source reports what it does not determine."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import simulated

from olp.calibration.iso230 import ballbar, diagonals, squareness
from olp.calibration.iso230.conventions import AXES_OF, CONVENTIONS, LEAN, angle_words, from_iso, to_iso
from olp.calibration.observations.circles import PLANES, Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.lines import Line
from olp.calibration.observations.references import Square
from olp.calibration.observations.squareness import SquarenessReading
from olp.compensation.invert import invert
from olp.core.errors import ConfigError, UsageError
from olp.core.machine import SQUARENESS
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.reversal import plays

#: rad per urad.
URAD = 1e-6
BOX = np.array([[0.0, 1000.0], [0.0, 800.0], [-600.0, 0.0]])
TOOL = (0.0, 0.0, -120.0)


def model(angles: dict[str, float], scales: tuple[float, float, float] = (0, 0, 0), **options: object):  # type: ignore[no-untyped-def]
    """FXYZ with squareness in urad and linear scale errors in um/m."""
    curves = tuple(
        Curve(a, BOX[j], {f"E{a}{a}": scales[j] * URAD * (BOX[j] - 0.0)}, interpolation="linear")
        for j, a in enumerate("XYZ")
    )
    square = {name: value * URAD for name, value in angles.items()}
    return build(Calibration("m", BOX, curves=curves, squareness=square, **options), "FXYZ")


def straightness(machine, component: str, place: tuple[float, float, float], leg: float = 0.0) -> Line:  # type: ignore[no-untyped-def]
    """A line read from a reference that leans by `leg` toward + of the direction."""
    j, i = "XYZ".index(component[2]), "XYZ".index(component[1])
    x = np.linspace(*BOX[j], 11)
    axis = np.tile(np.array(place, float), (11, 1))
    axis[:, j] = x
    value = machine.error(axis, np.array(TOOL))[:, i] - leg * x
    columns = [np.tile(c, 2) for c in (x, value)]
    return Line(
        component, *columns, np.repeat([1, 2], 11), np.ones(22, int), place, TOOL, square="granite",
        source=component,
    )  # fmt: skip


ANGLES = {"C0Y": 20.1, "B0Z": -7.5, "A0Z": 12.0}


@pytest.mark.parametrize("component", SQUARENESS)
@pytest.mark.parametrize("tilt", [0.0, 33.0])
def test_straightness_pair(component: str, tilt: float) -> None:
    """Whatever the tilt of the square and its error, whichever line comes first."""
    machine = model(ANGLES)
    a, b = ("XYZ"[i] for i in AXES_OF[component])
    error = 15.0
    place = (400.0, 300.0, -200.0)
    # a square of more than 90 degrees: its later leg leans away from + of the earlier axis
    first = straightness(machine, f"E{b}{a}", place, tilt * URAD)
    second = straightness(machine, f"E{a}{b}", place, -(tilt + error) * URAD)
    for pair in ((first, second), (second, first)):
        result = squareness.from_straightness_pair(*pair, Square("granite", error * URAD, 5e-6))
        assert result.component == component
        assert result.value_rad / URAD == pytest.approx(ANGLES[component], abs=1e-6)
        assert result.sigma_rad == pytest.approx(5e-6, rel=1e-6)
        assert result.line_mm == place
        assert result.span_mm == tuple(tuple(BOX[i]) for i in AXES_OF[component])
    assert list(squareness.pairs_of([first, second])) == [(first, second)]


def test_turned_square_gives_its_own_error() -> None:
    machine, place = model(ANGLES), (400.0, 300.0, -200.0)
    readings = []
    for error in (40.0, -40.0):
        # turned about its later leg, 90 degrees + e opens to the other side
        pair = straightness(machine, "EZX", place), straightness(machine, "EXZ", place, -error * URAD)
        readings.append(squareness.from_straightness_pair(*pair, Square("granite", 0.0, 1e-6)))
    result, square = squareness.from_turned_square(*readings)
    assert result.value_rad / URAD == pytest.approx(-7.5, abs=1e-6)
    assert square.error_rad / URAD == pytest.approx(40.0, abs=1e-6)


def test_pairs_that_are_none_are_refused() -> None:
    machine = model(ANGLES)
    here, there = (400.0, 300.0, -200.0), (400.0, 350.0, -200.0)
    with pytest.raises(ConfigError, match="50 mm apart in Y"):
        squareness.from_straightness_pair(
            straightness(machine, "EZX", here), straightness(machine, "EXZ", there), Square("granite")
        )
    table = dataclasses.replace(straightness(machine, "EXZ", here), reference="table")
    with pytest.raises(ConfigError, match="fixed on the table"):
        squareness.from_straightness_pair(straightness(machine, "EZX", here), table, Square("granite"))
    with pytest.raises(ConfigError, match="no pair"):
        squareness.from_straightness_pair(
            straightness(machine, "EZX", here), straightness(machine, "EYZ", here), Square("granite")
        )


def test_indicator() -> None:
    """The tool comes 3 um too far in +X; an indicator on it that points to +X is pushed in by 3 um."""
    assert squareness.indicator_sense("+X", "tool") == "actual-minus-commanded"
    assert squareness.indicator_sense("-X", "tool") == "commanded-minus-actual"
    assert squareness.indicator_sense("+Z", "workpiece") == "commanded-minus-actual"
    assert squareness.indicator_sense("-Z", "workpiece") == "actual-minus-commanded"
    with pytest.raises(UsageError, match="expected a sign and an axis"):
        squareness.indicator_sense("X", "tool")


#: Lengths of a printed frame and the skew that Klipper's documentation takes from them.
PRINTED = {
    "C0Y": ((140.4, 142.8, 99.8), -0.0169507368306),
    "B0Z": ((141.6, 141.4, 99.8), 0.001413446673736683),
    "A0Z": ((142.4, 140.5, 99.5), 0.013433643668787586),
}


def test_printed_frame_and_klipper_numbers() -> None:
    """Klipper's documented example, and the exact inverse of its shear at (100, 200, 50)."""
    values = {}
    for name, (lengths, skew) in PRINTED.items():
        reading = squareness.from_frame(name, *lengths, line_mm=(0, 0, 0), span_mm=((0, 100), (0, 100)))
        assert from_iso(name, reading.value_rad, "acute") == pytest.approx(skew, abs=1e-12)
        values[name] = reading.value_rad
    box = np.array([[-500.0, 500.0]] * 3)
    machine = build(Calibration("printer", box, squareness=values), "FXYZ")
    command = invert(machine, np.array([[100.0, 200.0, 50.0]]), np.zeros(3))
    assert command[0] == pytest.approx([103.30808952450865, 199.32831781656063, 50.0], abs=1e-9)


def test_conventions() -> None:
    """Symmetric shear 1e-4 at (400, 300) moves by -30 and -40 um: after a turn, twice as much on one axis."""
    whole = to_iso("C0Y", 1e-4, "symmetric-shear")
    machine = model({"C0Y": whole / URAD})
    corner = machine.error(np.array([[400.0, 300.0, 0.0]]), np.zeros(3))[0]
    turned = corner + np.cross([0.0, 0.0, -1e-4], [400.0, 300.0, 0.0])
    assert turned[:2] == pytest.approx([-0.03, -0.04], abs=1e-12)
    for name, convention in itertools.product(SQUARENESS, CONVENTIONS):
        assert from_iso(name, to_iso(name, 3.0, convention), convention) == pytest.approx(3.0)
    assert [to_iso(n, 1.0, "acute") for n in SQUARENESS] == [-1.0, 1.0, -1.0]
    assert [to_iso(n, 1.0, "obtuse") for n in SQUARENESS] == [1.0, -1.0, 1.0]
    assert [to_iso(n, 1.0, "larger-than-90") for n in SQUARENESS] == [1.0, -1.0, 1.0]
    assert to_iso("B0Z", 1.0, "right-handed") == 1.0
    with pytest.raises(UsageError, match="expected one of iso"):
        to_iso("C0Y", 1.0, "mine")


@pytest.mark.parametrize("component", SQUARENESS)
def test_words_of_an_angle_are_true(component: str) -> None:
    """The angle between the axes as the error model makes them."""
    machine = model({component: 100.0})
    i, j = AXES_OF[component]
    origin = machine.error(np.zeros((1, 3)), np.zeros(3))[0]
    ends = []
    for k in (i, j):
        point = np.zeros(3)
        point[k] = 500.0 if k < 2 else -500.0
        ends.append((point + machine.error(point[None], np.zeros(3))[0] - origin) * (1 if k < 2 else -1))
    angle = math.acos(ends[0] @ ends[1] / np.linalg.norm(ends[0]) / np.linalg.norm(ends[1]))
    sign, value = angle_words(component, 100 * URAD).split("deg ")[1].split()[:2]
    assert (angle - math.pi / 2) / URAD == pytest.approx(float(sign + value), abs=0.05)


# -- diagonals -------------------------------------------------------------------------------------------


def diagonal(  # type: ignore[no-untyped-def]
    machine, start, end, noise: float = 0.0, laser: float = 0.0, seed: int = 0
) -> Diagonal:
    share = np.linspace(0.0, 1.0, 11)
    start, end = np.array(start, float), np.array(end, float)
    axis = start + share[:, None] * (end - start)
    unit = (end - start) / np.linalg.norm(end - start)
    distance = share * np.linalg.norm(end - start)
    value = machine.error(axis, np.array(TOOL)) @ unit + laser * distance
    value = np.tile(value, 2) + np.random.default_rng(seed).normal(0, 1, 22) * noise
    return Diagonal(
        tuple(start), tuple(end), np.tile(distance, 2), value, np.repeat([1, 2], 11), np.ones(22, int), TOOL,
        sigma=max(noise, 1e-5),
    )  # fmt: skip


LOW = BOX[:, 0]
HIGH = BOX[:, 1]


def body(machine, **options: float) -> list[Diagonal]:  # type: ignore[no-untyped-def]
    diagonals_ = []
    for k, signs in enumerate(((1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1))):
        s = np.array(signs)
        start, end = np.where(s > 0, LOW, HIGH), np.where(s > 0, HIGH, LOW)
        diagonals_.append(diagonal(machine, start, end, seed=k, **options))
    return diagonals_


def faces(machine) -> list[Diagonal]:  # type: ignore[no-untyped-def]
    diagonals_ = []
    for i, j in AXES_OF.values():
        for sign in (1, -1):
            start, end = BOX.mean(axis=1), BOX.mean(axis=1)
            start[i], end[i] = BOX[i] if sign > 0 else BOX[i][::-1]
            start[j], end[j] = BOX[j]
            diagonals_.append(diagonal(machine, start, end))
    return diagonals_


def test_body_diagonals_give_squareness_but_no_scales() -> None:
    """Rank 4 of 6: all three squareness errors, and one combination of the scales."""
    machine = model(ANGLES, (30.0, -20.0, 10.0))
    result = diagonals.fit(body(machine))
    assert result.determined == set(SQUARENESS)
    for reading in result.readings():
        assert reading.value_rad / URAD == pytest.approx(ANGLES[reading.component], abs=0.02)
        assert reading.line_mm == pytest.approx((500.0, 400.0, -300.0))
    [finding] = result.findings
    assert finding.code == "OLP856"
    assert "SX, SY, SZ not determined" in finding.message
    assert [d.name for d in result.diagonals] == ["PPP", "NPP", "PNP", "NNP"]
    # what is reported to change no reading does not
    for change in result.free:
        other = model({}, tuple(change.get(name, 0.0) for name in diagonals.SCALES))
        assert [abs(d.elongation()[0]) < 1e-11 for d in body(other)] == [True] * 4


def test_three_body_diagonals_mix_scales_and_squareness() -> None:
    machine = model(ANGLES, (30.0, -20.0, 10.0))
    result = diagonals.fit(body(machine)[:3])
    assert result.determined == frozenset()
    known = {"SX": (30e-6, 1e-8), "SY": (-20e-6, 1e-8), "SZ": (10e-6, 1e-8)}
    with_scales = diagonals.fit(body(machine)[:3], known)
    assert with_scales.determined == set(diagonals.UNKNOWNS)
    assert with_scales.value[3:] / URAD == pytest.approx(list(ANGLES.values()), abs=0.1)


def test_face_diagonals_with_body_diagonals_give_everything() -> None:
    machine = model(ANGLES, (30.0, -20.0, 10.0))
    result = diagonals.fit(body(machine) + faces(machine))
    assert result.determined == set(diagonals.UNKNOWNS)
    assert result.value / URAD == pytest.approx([30, -20, 10, 20.1, -7.5, 12.0], abs=0.05)
    assert list(result.findings) == []


def test_laser_scale_error_is_not_squareness() -> None:
    machine = model(ANGLES)
    result = diagonals.fit(body(machine, laser=2e-6))
    assert result.value[3:] / URAD == pytest.approx(list(ANGLES.values()), abs=0.02)


def test_a_wrong_sign_of_one_diagonal_is_noticed() -> None:
    machine = model(ANGLES, (30.0, -20.0, 10.0))
    taken = body(machine) + faces(machine)
    bad = taken[4]
    taken[4] = Diagonal(
        bad.start_mm, bad.end_mm, bad.distance_mm, -bad.value, bad.run, bad.direction, bad.tool_mm, bad.sigma
    )
    assert "OLP857" in {f.code for f in diagonals.fit(taken).findings}


def test_diagonal_uncertainty_covers() -> None:
    machine = model(ANGLES)
    z = []
    for k in range(25):
        taken = [
            diagonal(machine, d.start_mm, d.end_mm, noise=1e-3, seed=100 * k + i)
            for i, d in enumerate(body(machine))
        ]
        result = diagonals.fit(taken)
        z += [(r.value_rad / URAD - ANGLES[r.component]) / (r.sigma_rad / URAD) for r in result.readings()]
    assert 0.75 < np.std(z) < 1.3


def test_wrong_diagonals_are_refused() -> None:
    machine = model(ANGLES)
    with pytest.raises(ConfigError, match="only P moves"):
        diagonal(machine, (0, 0, 0), (100, 0, 0))
    with pytest.raises(ConfigError, match="expected one of SX"):
        diagonals.fit(body(machine), {"EXX": (0.0, 1e-6)})


def test_the_uncertainty_of_a_diagonal_of_a_real_machine_is_honest() -> None:
    """Its curves make neighbouring deviations alike; taken as independent they gave half of what it is."""
    off = []
    for seed in range(8):
        machine = simulated.machine(seed, "smooth", "FXYZ")
        machine.half = {}
        tool = np.array(simulated.TOOL)
        middle, half = machine.box.mean(axis=1), 0.48 * np.ptp(machine.box, axis=1)
        truth = [_slope(machine, k, k) for k in range(3)]
        pairs = AXES_OF.items()
        truth += [LEAN[n] * (_slope(machine, i, j) + _slope(machine, j, i)) for n, (i, j) in pairs]
        for corner in ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)):
            start, end = middle - half * corner, middle + half * corner
            distance = np.tile(np.linspace(0.0, np.linalg.norm(end - start), 15), 3)
            unit = (end - start) / distance.max()
            value = machine.error(start + distance[:, None] * unit, tool) @ unit
            run, ones = np.repeat([1, 2, 3], 15), np.ones(45, int)
            taken = Diagonal(tuple(start), tuple(end), distance, value, run, ones, tuple(tool), 2e-4)
            slope, sigma = taken.elongation()
            off.append((slope - float(diagonals.row_of(taken.unit) @ truth)) / sigma)
    assert 0.85 < np.mean(np.abs(off) < 2.0) <= 1.0 and np.median(np.abs(off)) > 0.3


def _slope(machine: simulated.Machine, along: int, across: int) -> float:
    """The mean slope of an error along an axis, through the middle of the box."""
    q = np.linspace(*machine.box[along], 41)
    position = np.tile(machine.box.mean(axis=1), (41, 1))
    position[:, along] = q
    return float(np.polyfit(q, machine.error(position, np.array(simulated.TOOL))[:, across], 1)[0])


# -- ball-bar --------------------------------------------------------------------------------------------


def circles(
    plane: str, directions: tuple[int, ...], seed: int = 0, noise: float = 0.0, servo: float = 0.0
) -> Circles:
    """A machine with squareness, scale mismatch and backlash, whose axes lag; laps run in."""
    machine = model(ANGLES, (30.0, -20.0, 10.0), backlash_mm=(8e-3, 5e-3, 3e-3))
    first, second, _ = PLANES[plane]
    centre, radius, n = BOX.mean(axis=1), 150.0, 720
    random = np.random.default_rng(seed)
    parts = []
    for run, d in enumerate(directions, 1):
        t = d * 2.0 * np.pi * (np.arange(n * 5 // 4) + 0.5) / n
        axis = np.tile(centre, (len(t), 1))
        axis[:, first] += radius * np.cos(t)
        axis[:, second] += radius * np.sin(t)
        moved = axis + machine.error(axis, np.array(TOOL), plays(machine, axis))
        arm = moved[:, [first, second]] - centre[[first, second]]
        # the bar hangs 7 um beside the centre; lags differ by `servo` along the path
        arm += [5e-3, -5e-3]
        value = np.hypot(*arm.T) - radius + d * servo * np.sin(2 * t)
        value += random.normal(0, 1, len(t)) * noise
        rows = slice(n // 4, None)
        parts.append((t[rows], value[rows], np.full(n, run), np.full(n, d)))
    t, value, run_of, direction = (np.concatenate(c) for c in zip(*parts, strict=True))
    return Circles(plane, radius, tuple(centre), t, value, run_of, direction, TOOL, 50.0, 2e-4, "c.csv")


@pytest.mark.parametrize("plane", PLANES)
def test_both_directions_separate_squareness_and_servo_mismatch(plane: str) -> None:
    result = ballbar.fit(circles(plane, (1, -1), noise=2e-4, servo=3e-3))
    first, second, name = PLANES[plane]
    reading = result.reading()
    assert reading is not None
    assert reading.component == name
    assert reading.value_rad / URAD == pytest.approx(ANGLES[name], abs=0.6)
    assert result.value[5] == pytest.approx(3e-3, abs=5e-5)
    scales, backlash = (30.0, -20.0, 10.0), (8e-3, 5e-3, 3e-3)
    assert result.value[3] * 2 / 150.0 / URAD == pytest.approx(scales[first] - scales[second], abs=0.6)
    assert result.value[6:] == pytest.approx([backlash[first], backlash[second]], abs=2e-4)
    assert list(result.findings) == []
    low = min(first, second)
    half = 150 * math.sqrt(5 / 6)
    assert reading.span_mm[0] == pytest.approx((BOX[low].mean() - half, BOX[low].mean() + half))
    assert result.figures["H"] > 5e-3


def test_the_figures_of_iso_230_4_by_hand() -> None:
    """Paths of 3 + 2 cos 2t and 1 + cos 2t um, the bar 4 um beside the centre.

    Counter-clockwise 1 to 5, clockwise 0 to 2, both 0 to 5; they are at most 3 apart, and 2 in the mean."""
    t = np.radians(np.arange(0.0, 360.0, 0.5))
    angle, side = np.tile(t, 2), np.repeat([1, -1], len(t))
    value = np.where(side > 0, 3.0 + 2.0 * np.cos(2 * angle), 1.0 + np.cos(2 * angle)) + 4.0 * np.cos(angle)
    made = Circles("XY", 150.0, (0, 0, 0), angle, value * 1e-3, np.ones(len(angle), int), side)
    wanted = {
        "G_ccw": 4.0, "F_max_ccw": 5.0, "F_min_ccw": 1.0, "G_cw": 2.0, "F_max_cw": 2.0, "F_min_cw": 0.0,
        "G_b": 5.0, "H": 3.0, "D": 2.0,
    }  # fmt: skip
    got = ballbar.fit(made).figures
    assert {name: number * 1e3 for name, number in got.items()} == pytest.approx(wanted, abs=1e-3)
    one = dataclasses.replace(
        made, angle_rad=t, value=made.value[: len(t)], run=made.run[: len(t)], direction=side[: len(t)]
    )
    assert set(ballbar.fit(one).figures) == {"G_ccw", "F_max_ccw", "F_min_ccw"}


def test_a_circle_shows_the_mean_lines_over_its_span() -> None:
    """Straightness of the third order: the reading is the lean of the mean lines over its span."""
    random = np.random.default_rng(3)
    size = random.normal(0, 1e-9, 2)
    radius, t = 150.0, np.radians(np.arange(0.5, 360.0))
    x, y = radius * np.cos(t), radius * np.sin(t)
    value = (size[0] * y**3 * x + size[1] * x**3 * y) / radius
    t, value = np.tile(t, 2), np.tile(value, 2)
    direction = np.repeat([1, -1], 360)
    reading = ballbar.fit(Circles("XY", radius, (0, 0, 0), t, value, np.ones(720, int), direction)).reading()
    assert reading is not None
    (low, high), _ = reading.span_mm
    q = np.linspace(low, high, 4001)
    slopes = [float(q @ (s * q**3) / (q @ q)) for s in size]
    assert reading.value_rad == pytest.approx(-sum(slopes), rel=2e-3)


def test_one_direction_gives_no_squareness_and_reports_it() -> None:
    result = ballbar.fit(circles("XY", (1, 1), noise=2e-4, servo=3e-3))
    assert result.reading() is None
    assert {"square", "servo"} & result.determined == set()
    assert {"scale", "backlash_1", "backlash_2", "radius"} <= result.determined
    assert result.value[6:] == pytest.approx([8e-3, 5e-3], abs=3e-4)
    [finding] = result.findings
    assert finding.code == "OLP856" and "one direction only" in finding.message
    assert ballbar.readings_of([result]) == ()
    assert "square" in result.as_dict()["not_determined"]


def test_a_quarter_circle_is_uncertain_or_undetermined() -> None:
    whole = circles("XY", (1, -1), noise=2e-4)
    rows = np.abs(np.angle(np.exp(1j * (whole.angle_rad - np.pi / 4)))) < np.pi / 5
    part = Circles(
        "XY", 150.0, whole.centre_mm, whole.angle_rad[rows], whole.value[rows], whole.run[rows],
        whole.direction[rows], TOOL,
    )  # fmt: skip
    a, b = ballbar.fit(whole).reading(), ballbar.fit(part).reading()
    assert a is not None
    assert b is None or b.sigma_rad > 10 * a.sigma_rad


@settings(max_examples=15)
@given(st.integers(0, 2**31), st.permutations(range(4)))
def test_circle_fit_is_linear_and_orderless(seed: int, order: list[int]) -> None:
    random = np.random.default_rng(seed)
    t = random.uniform(0, 2 * np.pi, 200)
    direction = random.choice([-1, 1], 200)
    one, other = random.normal(0, 1e-3, (2, 200))

    def values(value: np.ndarray, rows: np.ndarray) -> np.ndarray:
        made = Circles("ZX", 100.0, (0, 0, 0), t[rows], value[rows], np.ones(200, int), direction[rows])
        return ballbar.fit(made).value

    straight, mixed = np.arange(200), random.permutation(200)
    total = values(one, straight) + values(other, straight)
    assert values(one + other, mixed) == pytest.approx(total, abs=1e-12)


def test_toml_is_a_plan() -> None:
    import tomllib

    reading = SquarenessReading("B0Z", -7.5e-6, (1.0, 2.0, 3.0), ((0.0, 10.0), (-5.0, 5.0)), TOOL, 1e-6)
    [table] = tomllib.loads(squareness.readings_toml([reading]))["squareness"]
    assert table == {
        "component": "B0Z", "value_urad": -7.5, "sigma_urad": 1.0, "line_mm": {"X": 1.0, "Y": 2.0, "Z": 3.0},
        "span_mm": {"X": [0.0, 10.0], "Z": [-5.0, 5.0]}, "tool_mm": [0.0, 0.0, -120.0],
    }  # fmt: skip
