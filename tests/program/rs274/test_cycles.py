"""Canned cycles: laws of the strokes, hand-worked sequences, and LinuxCNC as the judge."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from olp.core.errors import ProgramError
from olp.program.rs274.cycles import (
    CODES,
    ISO_CYCLES,
    LCNC_CLEARANCE_MM,
    NGC_CYCLES,
    PLANES,
    CycleRules,
    Stroke,
    cycle_moves,
    hole_moves,
    levels,
)

HOLE = {"start": (0.0, 0.0, 5.0), "xy": (1.0, 2.0), "r": 1.0, "z": -2.0, "initial_z": 5.0}


def _path(strokes: tuple[Stroke, ...]) -> list[tuple[object, ...]]:
    moves = ("rapid", "feed")
    return [(s.kind, *s.point) if s.kind in moves else (s.kind, s.spindle or s.seconds) for s in strokes]


def test_drill_goes_over_the_hole_down_and_home() -> None:
    assert _path(hole_moves(810, **HOLE, retract_to_r=False)) == [
        ("rapid", 1.0, 2.0, 5.0),
        ("rapid", 1.0, 2.0, 1.0),
        ("feed", 1.0, 2.0, -2.0),
        ("rapid", 1.0, 2.0, 5.0),
    ]
    assert hole_moves(810, **HOLE, retract_to_r=True)[-1].z == 1.0


def test_start_below_r_rises_first_on_linuxcnc_only() -> None:
    hole = {**HOLE, "start": (0.0, 0.0, 0.5), "initial_z": 0.5}
    assert _path(hole_moves(810, **hole, retract_to_r=False))[0] == ("rapid", 0.0, 0.0, 1.0)
    assert _path(hole_moves(810, **hole, retract_to_r=False, rules=ISO_CYCLES))[:2] == [
        ("rapid", 1.0, 2.0, 0.5),
        ("rapid", 1.0, 2.0, 1.0),
    ]


def test_deep_hole_leaves_the_clearance_above_every_peck() -> None:
    z = [s.z for s in hole_moves(830, **HOLE, q=2.0, retract_to_r=True)]
    assert z == pytest.approx([5.0, 1.0, -1.0, 1.0, -1.0 + LCNC_CLEARANCE_MM, -2.0, 1.0])
    z = [s.z for s in hole_moves(730, **HOLE, q=2.0, retract_to_r=True, clearance=0.5)]
    assert z == pytest.approx([5.0, 1.0, -1.0, -0.5, -2.0, 1.0])


def test_pecks_are_counted_in_numbers_of_the_program() -> None:
    """6.57 - 3 is greater than 3.57 by one bit, which makes one more peck; in mm with an offset it is not."""
    hole = {"start": (1.0, 2.0, -10.0), "xy": (1.0, 2.0), "initial_z": -10.0, "q": 3.0, "retract_to_r": True}
    strokes = hole_moves(730, r=6.57, z=3.57, ground=-17.0, **hole)  # type: ignore[arg-type]
    assert [s.kind for s in strokes].count("feed") == 2
    assert strokes[-1].z == 6.57 - 17.0


def test_tapping_feeds_home_and_turns_the_spindle_twice() -> None:
    strokes = hole_moves(840, **HOLE, p=0.5, retract_to_r=False)
    assert _path(strokes)[2:] == [
        ("feed", 1.0, 2.0, -2.0),
        ("spindle", "stop"),
        ("spindle", "reverse"),
        ("dwell", 0.5),
        ("feed", 1.0, 2.0, 5.0),
        ("spindle", "stop"),
        ("spindle", "restore"),
    ]
    fanuc = _path(hole_moves(840, **HOLE, retract_to_r=False, rules=ISO_CYCLES))
    assert fanuc[-1] == ("rapid", 1.0, 2.0, 5.0)
    assert ("feed", 1.0, 2.0, 1.0) in fanuc


def test_levels_count_from_the_initial_level_in_g91() -> None:
    assert levels(2.0, -3.0, absolute=True, initial_z=7.0) == (2.0, -3.0)
    assert levels(-2.0, -3.0, absolute=False, initial_z=7.0) == (5.0, 2.0)


@pytest.mark.parametrize(
    ("code", "change", "message"),
    [
        (870, {}, "G87"),
        (880, {}, "G88"),
        (760, {}, "G76"),
        (830, {}, "peck Q"),
        (830, {"q": 0.0}, "peck Q"),
        (730, {"q": 1e-9}, "pecks"),
        (820, {}, "dwell P"),
        (860, {}, "dwell P"),
        (890, {"p": -1.0}, "negative dwell"),
        (810, {"r": -3.0}, "below the bottom"),
        (810, {"z": float("nan")}, "finite"),
        (810, {"plane": 20}, "G17"),
        (840, {"plane": 18}, "wrong axes"),
    ],
)
def test_refusals_name_the_word(code: int, change: dict[str, float], message: str) -> None:
    with pytest.raises(ProgramError, match=re.escape(message)):
        hole_moves(code, **{**HOLE, **change}, retract_to_r=True)  # type: ignore[arg-type]


def test_no_repeats_is_refused() -> None:
    with pytest.raises(ProgramError, match="L1"):
        cycle_moves(810, **HOLE, repeats=0, retract_to_r=True)


_level = st.integers(-3000, 3000).map(lambda n: n / 100)


@given(
    code=st.sampled_from(sorted(CODES)),
    plane=st.sampled_from(sorted(PLANES)),
    rules=st.sampled_from([NGC_CYCLES, ISO_CYCLES]),
    retract_to_r=st.booleans(),
    start=st.tuples(_level, _level, _level),
    xy=st.tuples(_level, _level),
    r=_level,
    depth=st.integers(0, 2000).map(lambda n: n / 100),
    initial_z=_level,
)
def test_every_hole_is_fed_at_its_place_and_left_at_its_level(
    code: int, plane: int, rules: CycleRules, retract_to_r: bool, start: tuple[float, float, float],
    xy: tuple[float, float], r: float, depth: float, initial_z: float,
) -> None:  # fmt: skip
    z = r - depth
    assume(plane == 17 or rules is ISO_CYCLES or code not in (740, 840))
    strokes = hole_moves(
        code, start=start, xy=xy, r=r, z=z, q=0.7, p=0.1, retract_to_r=retract_to_r,
        initial_z=initial_z, plane=plane, rules=rules,  # type: ignore[arg-type]
    )  # fmt: skip
    first, second, tool = PLANES[plane]
    end = strokes[-1].point
    assert (end[first], end[second]) == xy
    assert end[tool] == (r if retract_to_r else max(r, initial_z))
    fed = [s.point for s in strokes if s.kind == "feed"]
    assert min(p[tool] for p in fed) == z
    assert all((p[first], p[second]) == xy for p in fed)
    # A rapid never goes deeper than what was cut before it, and the tool never moves sideways below R.
    reached, before = max(r, start[tool]), start
    for stroke in strokes:
        point = stroke.point
        if stroke.kind == "feed":
            reached = min(reached, point[tool])
        elif stroke.kind == "rapid" and (point[first], point[second]) == (before[first], before[second]):
            assert point[tool] >= min(reached, r)
        before = point


# --- LinuxCNC as the judge ----------------------------------------------------------------------------------

RS274 = shutil.which("rs274")
_CALL = re.compile(
    r"N\S*\s+(STRAIGHT_TRAVERSE|STRAIGHT_FEED|DWELL|STOP_SPINDLE_TURNING|START_SPINDLE\w+)\(([^)]*)\)"
)


def _judge(tmp_path: Path, program: str) -> list[tuple[object, ...]]:
    """Canonical calls after the preparing lines; G0 and G1 of no length are dropped as they move nothing."""
    path = tmp_path / "cycle.ngc"
    path.write_text(program)
    command = [RS274 or "rs274", "-g", str(path)]
    # rs274 keeps a tool map in the home folder, which two of them must not share.
    home = {"HOME": str(tmp_path)}
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, cwd=tmp_path, env=home, check=False
    )
    assert done.returncode == 0, done.stderr
    calls: list[tuple[object, ...]] = []
    for name, args in _CALL.findall(done.stdout):
        if name.startswith("STRAIGHT"):
            kind = "rapid" if name.endswith("TRAVERSE") else "feed"
            calls.append((kind, *(round(float(a), 4) for a in args.split(",")[:3])))
        elif name == "DWELL":
            calls.append(("dwell", float(args)))
        else:
            calls.append(("spindle", {"STOP": "stop"}.get(name[:4], name.rsplit("_", 1)[-1])))
    return calls


def _ours(strokes: tuple[Stroke, ...]) -> list[tuple[object, ...]]:
    names = {"stop": "stop", "reverse": "COUNTERCLOCKWISE", "restore": "CLOCKWISE"}
    calls: list[tuple[object, ...]] = []
    for s in strokes:
        if s.kind in ("rapid", "feed"):
            calls.append((s.kind, *(round(v, 4) + 0.0 for v in s.point)))
        else:
            calls.append((s.kind, names[s.spindle] if s.spindle else s.seconds))
    return calls


def _without_standstill(calls: list[tuple[object, ...]]) -> list[tuple[object, ...]]:
    moving: list[tuple[object, ...]] = []
    position: tuple[object, ...] = ()
    for call in calls:
        if call[0] in ("rapid", "feed"):
            if call[1:] == position:
                continue
            position = call[1:]
        moving.append(call)
    return moving


@pytest.mark.oracle
@pytest.mark.skipif(RS274 is None, reason="needs LinuxCNC (rs274)")
@pytest.mark.parametrize("seed", range(30))
def test_linuxcnc_makes_the_same_strokes(tmp_path: Path, seed: int) -> None:
    """A series of contiguous cycles: absolute and incremental, G98 and G99, three planes, both units."""
    rng = random.Random(seed)
    plane = rng.choice([17, 18, 19])
    inch = rng.random() < 0.3
    first, second, tool = PLANES[plane]
    start = tuple(round(rng.uniform(-9, 9), 2) for _ in range(3))
    lines = [
        f"{'G20' if inch else 'G21'} G90 G94 F100 S100 G{plane}",
        "G0 X{} Y{} Z{}".format(*start),
        "M3",
    ]
    expected: list[tuple[object, ...]] = [("rapid", *start), ("spindle", "CLOCKWISE")]
    position = start
    absolute = True
    for _ in range(rng.randint(1, 5)):
        code = rng.choice(sorted(CODES - {740} if plane == 17 else CODES - {740, 840}))
        absolute = rng.random() < 0.5
        retract_to_r = rng.random() < 0.5
        repeats = rng.choice([1, 1, 2, 3])
        word_xy = (round(rng.uniform(-9, 9), 2), round(rng.uniform(-9, 9), 2))
        if absolute:
            r_word = round(rng.uniform(-9, 9), 2)
            z_word = round(r_word - rng.uniform(0, 9), 2)
            xy, step = word_xy, (0.0, 0.0)
        else:
            r_word, z_word = round(rng.uniform(-9, 9), 2), round(rng.uniform(-9, 0), 2)
            xy, step = (position[first] + word_xy[0], position[second] + word_xy[1]), word_xy
        q, p = round(rng.uniform(0.3, 5), 2), round(rng.uniform(0, 2), 1)
        words = dict(zip((first, second, tool), (*word_xy, z_word), strict=True))
        lines.append(
            f"G{90 if absolute else 91} G{99 if retract_to_r else 98} G{code // 10} "
            + " ".join(f"{'XYZ'[axis]}{value}" for axis, value in words.items())
            + f" R{r_word} L{repeats}"
            + (f" Q{q}" if code in (730, 830) else "")
            + (f" P{p}" if code in (820, 840, 860, 890) else "")
        )
        r, z = levels(r_word, z_word, absolute=absolute, initial_z=start[tool])
        strokes = cycle_moves(
            code, start=position, xy=xy, step=step, repeats=repeats, r=r, z=z, q=q, p=p,
            retract_to_r=retract_to_r, initial_z=start[tool], plane=plane, clearance=0.010 if inch else 0.254,
        )  # fmt: skip
        expected += _ours(strokes)
        position = strokes[-1].point
    judged = _judge(tmp_path, "\n".join([*lines, "M2"]) + "\n")
    # M2 stops the spindle.
    got = _without_standstill(judged[:-1])
    want = _without_standstill(expected)
    assert len(got) == len(want)
    for call, wanted in zip(got, want, strict=True):
        assert call[0] == wanted[0]
        if call[0] == "spindle":
            assert call == wanted
        else:
            assert call[1:] == pytest.approx(wanted[1:], abs=1.01e-4)
