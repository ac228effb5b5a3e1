"""From programs to routes: waypoints, chords, tolerances, rests; by hand and by law."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast
from hypothesis import given
from hypothesis import strategies as st
from program.feeds.test_timing import reading, setup_of
from program.test_corpus import PROFILE_OF, programs
from program.test_corpus import setups as setups  # a fixture
from workflows.test_programs_folder import FOLDER, JOBS

import olp
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import BLEND_MM
from olp.files.config import load_setup
from olp.program.registry import DIALECTS
from olp.program.rs274.reader import read
from olp.trajectory.from_program import CHORD_SHARE, EXACT_MM, axis_limits, routes
from olp.trajectory.route import Route

INNER = 1.0 - CHORD_SHARE


def driven(text: str, controller: str = "linuxcnc", **options: float) -> tuple[Route, ...]:
    result = routes(reading(text, controller), **options)
    for route in result:
        sound(route)
    return result


def one(text: str, controller: str = "linuxcnc", **options: float) -> Route:
    (route,) = driven(text, controller, **options)
    return route


def sound(route: Route) -> None:
    """What every route keeps to."""
    n = len(route)
    assert n >= 2
    assert route.point_mm.shape == (n, 3)
    assert [len(c) for c in (route.feed_mm_s, route.line, route.tolerance_mm, route.dwell_s)] == [
        n - 1, n - 1, n, n,
    ]  # fmt: skip
    assert np.isfinite(route.point_mm).all()
    assert (lengths(route) > 0).all()
    assert (route.feed_mm_s > 0).all()
    assert (route.tolerance_mm >= 0).all()
    assert route.tolerance_mm[0] == route.tolerance_mm[-1] == 0
    assert (route.dwell_s >= 0).all()
    assert not route.tolerance_mm[route.dwell_s > 0].any()
    assert (np.diff(route.line) >= 0).all()


def lengths(route: Route) -> np.ndarray:
    return np.asarray(np.linalg.norm(np.diff(route.point_mm, axis=0), axis=1))


def seconds(route: Route) -> float:
    """Time at full feed, rapids and corners for nothing."""
    return float((lengths(route) / route.feed_mm_s).sum() + route.dwell_s.sum())


def test_lines_rapids_and_their_lines() -> None:
    route = one("G64 P0.05\nG0 X10\nG1 Y20 F60\n\nX0 F120\nG0 Y0")
    assert route.point_mm.tolist() == [[0, 0, 0], [10, 0, 0], [10, 20, 0], [0, 20, 0], [0, 0, 0]]
    assert route.feed_mm_s.tolist() == [math.inf, 1, 2, math.inf]
    assert route.line.tolist() == [2, 3, 5, 6]
    assert route.tolerance_mm.tolist() == [0, 0.05, 0.05, 0.05, 0]
    assert route.dwell_s.tolist() == [0] * 5


#: text after `G1 F60` at X0 Y0, control, tolerances of its waypoints
TOLERANCES: dict[str, tuple[str, str, list[float]]] = {
    "bare": ("X10\nY10", "linuxcnc", [0, BLEND_MM, 0]),
    "the smaller one": ("G64 P0.1\nX10\nG64 P0.02 Y10\nG64 P0.3 X0", "linuxcnc", [0, 0.02, 0.02, 0]),
    "exact path rests in corners": ("G61\nX10\nY10", "linuxcnc", [0, 0, 0]),
    "exact path passes smooth joints": ("G61\nX10\nX20 Y0.005\nX30", "linuxcnc", [0, EXACT_MM, EXACT_MM, 0]),
    "and rests in shallow corners": ("G61\nX10\nX20 Y0.02\nX30", "linuxcnc", [0, 0, 0, 0]),
    "exact path turns back": ("G61\nX10\nX0", "linuxcnc", [0, 0, 0]),
    "exact stop rests": ("G61.1\nX10\nX20", "linuxcnc", [0, 0, 0]),
    "exact stop of ISO rests": ("G61\nX10.\nX20.", "fanuc", [0, 0, 0]),
    "into exact path": ("G64 P0.1\nX10\nG61 Y10", "linuxcnc", [0, 0, 0]),
    "out of exact path": ("G61\nX10\nG64 P0.1 Y10", "linuxcnc", [0, 0, 0]),
    "out of exact path, smooth": ("G61\nX10\nG64 P0.1 X20", "linuxcnc", [0, EXACT_MM, 0]),
    "a finer blend than smooth": ("G61\nX10\nG64 P0.0001 X20", "linuxcnc", [0, 0.0001, 0]),
    "rapids blend": ("G64 P0.1\nX10\nG0 Y10\nX0", "linuxcnc", [0, 0.1, 0.1, 0]),
    "rapids of ISO do not": ("X10.\nY10.\nG0 X0.\nG1 Y0.\nX5.", "haas", [0, BLEND_MM, 0, 0, BLEND_MM, 0]),
    "a stop": ("X10\nM0\nX20\nX30", "linuxcnc", [0, 0, BLEND_MM, 0]),
    "an end": ("X10\nM8\nX20\nM2", "linuxcnc", [0, 0, 0]),
    "steps of no length": ("X10\nX10\nX10 Y10\nY10", "linuxcnc", [0, BLEND_MM, 0]),
    "a stop on a step of no length": ("X10\nG61.1 X10\nG64\nM0\nX10\nX20", "linuxcnc", [0, 0, 0]),
}  # fmt: skip


@pytest.mark.parametrize("name", TOLERANCES)
def test_tolerances_by_hand(name: str) -> None:
    text, control, want = TOLERANCES[name]
    np.testing.assert_allclose(one(f"G1 F60.\n{text}\n", control).tolerance_mm, want, rtol=1e-12)


def test_the_callers_tolerance() -> None:
    assert one("G1 X1 F60\nY1", blend_mm=0.3).tolerance_mm.tolist() == [0, 0.3, 0]


# -- arcs ----------------------------------------------------------------------------------------------


def test_a_circle_by_hand() -> None:
    """Radius 10 and a sagitta of 1 um: a chord turns by 2 acos(1 - 0.0001), 223 chords make the circle."""
    route = one("G64 P0.01\nF60 G3 I10\nG1 X-5")
    assert len(route) == 223 + 2
    np.testing.assert_allclose(np.hypot(*(route.point_mm[:-1, :2] - (10, 0)).T), 10, rtol=1e-12)
    np.testing.assert_allclose(route.tolerance_mm[1:-1], INNER * 0.01)
    np.testing.assert_allclose(route.point_mm[223], 0, atol=1e-12)
    assert route.point_mm[1, 1] < 0
    assert set(route.line.tolist()) == {2, 3}
    assert seconds(route) == pytest.approx(20 * math.pi + 5, rel=1e-4)


@pytest.mark.parametrize("mode", ["G61", "G61.1"])
def test_exact_modes_do_not_stop_inside_arcs(mode: str) -> None:
    route = one(f"{mode}\nG2 X20 I10 F600\nX40 I10")
    rests = np.flatnonzero(route.tolerance_mm == 0)
    count = (len(route) - 1) // 2
    assert rests.tolist() == [0, count, 2 * count]
    assert (route.tolerance_mm[1:count] == INNER * EXACT_MM).all()
    chord = lengths(route)
    assert (10 - np.sqrt(100 - chord**2 / 4)).max() <= CHORD_SHARE * EXACT_MM * (1 + 1e-9)


JOINTS = {
    "line to arc": ("X10\nG3 Y20 J10", True),
    "line to helix": ("X10\nG3 Y20 J10 Z5", False),
    "arc to line": ("G3 Y20 J10\nG1 X-10", True),
    "arc to arc": ("G3 Y20 J10\nG2 Y40 J10", True),
    "arc to arc, turned back": ("G3 Y20 J10\nG3 Y0 J-10", True),
    "a corner into an arc": ("X10\nG3 X30 I10", False),
    "in G18": ("G18\nX10\nG2 Z20 K10", True),
    "in G19": ("G19\nY10\nG2 Z20 K10", False),
}


@pytest.mark.parametrize("name", JOINTS)
def test_exact_path_passes_tangential_joints_of_arcs(name: str) -> None:
    text, smooth = JOINTS[name]
    lines = text.split("\n")
    first = next(i for i, line in enumerate(lines) if line[0] in "XY" or "J" in line) + 2
    route = one(f"G61 G1 F60\n{text}")
    joint = int(np.flatnonzero(route.line == first)[-1]) + 1
    assert (route.tolerance_mm[joint] > 0) == smooth


@pytest.mark.parametrize("plane", [17, 18, 19])
def test_helices_in_all_planes(plane: int) -> None:
    first, second, third = {17: "XYZ", 18: "ZXY", 19: "YZX"}[plane]
    a, b, c = ("XYZ".index(letter) for letter in (first, second, third))
    centre = "IJK"[a]
    route = one(f"G64 P0.02 G{plane}\nF60 G3 {first}20 {centre}10 {third}7 P3")
    away = route.point_mm - np.eye(3)[a] * 10
    np.testing.assert_allclose(np.hypot(away[:, a], away[:, b]), 10, rtol=1e-12)
    np.testing.assert_allclose(np.diff(route.point_mm[:, c]), 7 / (len(route) - 1), rtol=1e-9)
    turn = np.unwrap(np.arctan2(away[:, b], away[:, a]))
    assert turn[-1] - turn[0] == pytest.approx(5 * math.pi)


size = st.floats(0.01, 400).map(lambda v: round(v, 3))


@pytest.mark.slow
@given(size, st.floats(0.05, 6.2), st.floats(1e-4, 1).map(lambda v: round(v, 5)), st.booleans())
def test_chords_stay_within_their_share(r: float, sweep: float, tolerance: float, ccw: bool) -> None:
    x, y = r * math.cos(sweep), (1 if ccw else -1) * r * math.sin(sweep)
    code = "G3" if ccw else "G2"
    text = f"G64 P{tolerance:.5f}\nG0 X{r:.7f}\nF60 {code} X{x:.7f} Y{y:.7f} I{-r:.7f}\nM2"
    try:
        route = one(text)
    except ProgramError:
        return
    arc = route.point_mm[1:]
    middle = 0.5 * (arc[1:] + arc[:-1])
    assert np.abs(np.linalg.norm(arc, axis=1) - r).max() <= 1e-6
    assert (r - np.linalg.norm(middle, axis=1)).max() <= CHORD_SHARE * tolerance + 1e-6
    # and no more of them than that takes
    largest = min(math.pi / 8, 2 * math.acos(max(1 - CHORD_SHARE * tolerance / r, 0)))
    assert len(arc) - 1 <= math.ceil((sweep + 1e-5 / r) / largest + 1e-6)


def test_a_tolerance_of_nothing_makes_no_endless_chords() -> None:
    assert len(one("G64 P0.000000000001\nF60 G3 I1000")) < 200_000


# -- rests and stretches -------------------------------------------------------------------------------


def test_dwells_are_where_they_stand() -> None:
    route = one("G4 P1\nG1 X10 F60\nG4 P0.5\nX10\nG4 P0.25\nX20\nX30\nM2\n")
    assert route.dwell_s.tolist() == [1, 0.75, 0, 0]
    assert route.tolerance_mm.tolist() == [0, 0, BLEND_MM, 0]
    assert one("G1 X10 F60\nG4 P0.5\nM2").dwell_s.tolist() == [0, 0.5]


def test_routes_part_where_the_position_is_lost() -> None:
    text = (
        "T1 M6\nG4 P1\nG0 X1 Y1 Z9\nG1 X10 F60\nT2 M6\nG4 P2\nG0 X5\nY5\nG4 P3\nZ5\nX6\nG38.2 Z0\nG4 P4\n"
        "G0 Z9\nX9\nG28 Z9\nG4 P5\nX1\nM2\n"
    )
    parts = driven(text)
    assert [r.line.tolist() for r in parts] == [[4], [11, 12], [15]]
    assert [r.dwell_s.tolist() for r in parts] == [[1, 0], [5, 0, 0], [4, 5]]
    assert parts[0].feed_mm_s.tolist() == [1]


def test_a_probe_is_not_driven_beyond_its_start_and_an_unknown_start_is_no_step() -> None:
    route = one("G1 X1 F60\nX9\nG38.2 X20\nM2")
    assert route.point_mm[:, 0].tolist() == [0, 1, 9, 20]
    bare = setup_of("linuxcnc", "")
    unknown = Setup(bare.machine)
    program = read(b"F60\nG0 X1\nY1\nZ1\nG1 X2\nM2\n", unknown, DIALECTS["linuxcnc"])
    (driven_route,) = routes(program)
    assert driven_route.point_mm.tolist() == [[1, 1, 1], [2, 1, 1]]


def test_nothing_driven_is_no_route() -> None:
    assert driven("M3 S100\nG4 P1\nM2\n") == ()
    assert driven("") == ()
    assert driven("G0 X0 Y0\nM2\n") == ()


def test_strokes_of_cycles() -> None:
    route = one("F60 G98\nG0 Z5\nG82 X5 Z-2 R1 P0.5\nX9\nG80\nM2\n")
    z = [0, 5, 5, 1, -2, 5, 5, 1, -2, 5]
    assert route.point_mm[:, 2].tolist() == z
    assert [math.isinf(f) for f in route.feed_mm_s] == [level != -2 for level in z[1:]]
    assert route.dwell_s.tolist() == [0.5 if level == -2 else 0 for level in z]
    assert route.line.tolist() == [2] + [3] * 4 + [4] * 4


def test_limits_are_the_machines() -> None:
    limits = axis_limits(setup_of("linuxcnc", "").machine)
    assert limits.velocity.tolist() == [500] * 3
    assert limits.acceleration.tolist() == [2000] * 3
    assert limits.jerk.tolist() == [20000] * 3


# -- laws ----------------------------------------------------------------------------------------------

steps = st.integers(-400, 400)
corners = st.lists(st.tuples(steps, steps, steps), min_size=2, max_size=8)
modes = st.sampled_from(["G61", "G61.1", "G64", "G64 P0.02", "G93"])


def text_of(points: list[tuple[float, ...]], mode: str, scale: float = 1.0, parts: int = 1) -> str:
    """A polyline, each block in so many collinear parts of the same time in all."""
    rows, here = [mode], (0.0, 0.0, 0.0)
    for to in points:
        for i in range(1, parts + 1):
            x, y, z = ((a + (b - a) * i / parts) * scale for a, b in zip(here, to, strict=True))
            feed = 8 * parts if "G93" in mode else 240 * scale
            rows.append(f"G1 X{x:.9f} Y{y:.9f} Z{z:.9f} F{feed:.9f}")
        here = (float(to[0]), float(to[1]), float(to[2]))
    return "\n".join(rows) + "\nM2\n"


@pytest.mark.slow
@given(corners, modes)
def test_collinear_parts_take_no_more_time(points: list[tuple[float, ...]], mode: str) -> None:
    whole, split = driven(text_of(points, mode)), driven(text_of(points, mode, parts=4))
    assert len(whole) == len(split)
    for a, b in zip(whole, split, strict=True):
        assert seconds(b) == pytest.approx(seconds(a), rel=1e-7)
        ends = b.tolerance_mm[::4]
        if mode not in ("G61.1", "G93"):
            assert ends == pytest.approx(a.tolerance_mm)
            assert (b.tolerance_mm > 0).sum() - (a.tolerance_mm > 0).sum() == 3 * (len(a) - 1)


@pytest.mark.slow
@given(corners, st.sampled_from(["G61", "G61.1", "G64", "G93"]))
def test_inches_drive_the_same_route(points: list[tuple[float, ...]], mode: str) -> None:
    metric, inch = driven(text_of(points, "G21 " + mode)), driven(text_of(points, "G20 " + mode, 1 / 25.4))
    for a, b in zip(metric, inch, strict=True):
        np.testing.assert_allclose(a.point_mm, b.point_mm, atol=1e-6)
        np.testing.assert_allclose(a.feed_mm_s, b.feed_mm_s, rtol=1e-6)
        np.testing.assert_array_equal(a.tolerance_mm, b.tolerance_mm)


@pytest.mark.slow
@given(corners)
def test_incremental_drives_the_same_route(points: list[tuple[float, ...]]) -> None:
    rows, here = ["G91 F60"], (0, 0, 0)
    for to in points:
        x, y, z = (b - a for a, b in zip(here, to, strict=True))
        rows.append(f"G1 X{x} Y{y} Z{z}")
        here = (int(to[0]), int(to[1]), int(to[2]))
    plain = "\n".join(["F60", *(f"G1 X{x} Y{y} Z{z}" for x, y, z in points)])
    for a, b in itertools.zip_longest(driven("\n".join(rows)), driven(plain)):
        np.testing.assert_array_equal(a.point_mm, b.point_mm)
        np.testing.assert_array_equal(a.tolerance_mm, b.tolerance_mm)


# -- the programs that the project ships ---------------------------------------------------------------


@pytest.mark.parametrize("name", some_fast(JOBS, 3))
def test_shipped_programs_and_their_corrections_give_routes(name: str) -> None:
    path = FOLDER / name
    machine, job = path.with_name("machine.toml"), path.with_name(JOBS[name])
    setup = load_setup(machine, job)
    profile = DIALECTS[setup.machine.controller]
    nominal = routes(read(path.read_bytes(), setup, profile))
    assert nominal
    for route in nominal:
        sound(route)
    try:
        data = olp.correct(path, machine, job).data
    except ProgramError:
        return
    corrected = routes(read(data, setup, profile))
    assert len(corrected) == len(nominal)
    for a, b in zip(nominal, corrected, strict=True):
        sound(b)
        # taking up backlash costs time
        assert seconds(b) == pytest.approx(seconds(a), rel=1e-2, abs=0.05)
        assert b.dwell_s.sum() == pytest.approx(a.dwell_s.sum())
        np.testing.assert_allclose(b.point_mm.max(axis=0), a.point_mm.max(axis=0), atol=0.2)
        np.testing.assert_allclose(b.point_mm.min(axis=0), a.point_mm.min(axis=0), atol=0.2)


@pytest.mark.corpus
@pytest.mark.parametrize("folder", PROFILE_OF)
def test_real_programs_give_routes(corpus: Path, setups: dict[str, tuple[Path, Path]], folder: str) -> None:
    setup = load_setup(*setups[folder])
    done = 0
    for path in programs(corpus, folder):
        try:
            program = read(path.read_bytes(), setup, DIALECTS[PROFILE_OF[folder]])
        except ProgramError:
            continue
        for route in routes(program):
            sound(route)
        done += 1
    assert done >= 8
