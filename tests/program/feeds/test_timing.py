"""Feeds, dwells, rests and path modes: by hand, by law, and by LinuxCNC's interpreter."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from hypothesis import given
from hypothesis import strategies as st
from judge import linuxcnc, machines, programs
from workflows.test_correct_by_interpreter import NEAR_MM, samples, spacious

import olp
from olp.core.errors import ProgramError, UsageError
from olp.files.config import load_setup
from olp.program.feeds.moves import lengths_mm
from olp.program.feeds.stated import programmed
from olp.program.feeds.timing import BLEND_MM, PathControl, Timing, path_modes, timing
from olp.program.program import Program
from olp.program.registry import DIALECTS, Options, read
from olp.program.rs274.state import PathMode

START = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
TOOLS = "".join(f"[tools.{n}]\nZ_mm = 50.0\n" for n in (1, 2))


@cache
def folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="olp-timing-"))


@cache
def setup_of(controller: str, keys: str) -> olp.Setup:
    place = folder() / f"{controller}-{len(keys)}"
    path = machine(place, controller=controller, keys=keys, tables=TRUE_ZERO + TOOLS, job=START)
    return load_setup(path, path.with_name("job.toml"))


def reading(text: str, controller: str = "linuxcnc", keys: str = "", **options: bool) -> Program:
    setup = setup_of(controller, keys)
    return read(text.encode(), setup, DIALECTS[controller], Options(**options))


def timed(text: str, controller: str = "linuxcnc", keys: str = "", **options: bool) -> Timing:
    return timing(reading(text, controller, keys, **options), **options)


CALCULATOR = 'decimal_point = "calculator"'
INCH = 25.4 / 60
#: text, control, feeds in mm/s
FEEDS: dict[str, tuple[str, str, list[float]]] = {
    "in its own block": ("G1 X1 F60\nX2\nF120\nX3", "linuxcnc", [1, 1, 2]),
    "rapids have none": ("G0 X1\nG1 X2 F60\nG0 X3\nG1 X4", "linuxcnc", [np.inf, 1, np.inf, 1]),
    "inches": ("G20\nG1 X1 F60", "linuxcnc", [60 * INCH]),
    "F comes before G20 in one block": ("G20 G1 X1 F60\nX2 F60", "linuxcnc", [1, 60 * INCH]),
    "and after it elsewhere": ("G20 G1 X1 F60", "grbl", [60 * INCH]),
    "a change of unit keeps the speed": ("G20\nF60\nG21\nG1 X1\nF60 X2", "linuxcnc", [60 * INCH, 1]),
    "inverse time": ("G93\nG1 X100 F2\nX70 F1", "linuxcnc", [200 / 60, 0.5]),
    "inverse time in inches": ("G20 G93\nG1 X1 F2", "linuxcnc", [25.4 * 2 / 60]),
    "inverse time with the least feed": ("G93\nG1 X1 F0.05\nX9 F0.05", "linuxcnc", [0.1 / 60, 0.4 / 60]),
    "inverse time without it": ("G93\nG1 X1 F0.06", "grbl", [0.06 / 60]),
    "inverse time of an arc": ("G93\nG2 X10 I5 F3", "linuxcnc", [5 * np.pi * 3 / 60]),
    "inverse time of a helix": ("G93\nG3 I5 Z3 F60", "linuxcnc", [np.hypot(10 * np.pi, 3)]),
    "rapids in inverse time": ("G93\nG0 X1\nG1 X2 F60\nG0 X0", "linuxcnc", [np.inf, 1, np.inf]),
    "back from inverse time": ("G1 X1 F60\nG93 X2 F5\nG94 X3 F120", "linuxcnc", [1, 5 / 60, 2]),
    "by turns": ("S1200\nG95 G1 X1 F0.5\nS600\nX2", "linuxcnc", [10, 5]),
    "by turns in inches": ("G20\nS60\nG95\nG1 X1 F0.1", "linuxcnc", [2.54]),
    "S in the block": ("G95 G1 X1 F1 S60\nS120 X2", "haas.", [1, 2]),
    "whole millimetres without a point": ("G1 X1. F600", "fanuc", [10]),
    "a point everywhere": ("G1 X1. F600.", "haas", [10]),
    "as on a calculator": ("G20\nG1 X1 F60", "haas.", [60 * INCH]),
    "restated feed mode of others": ("G94 G1 X1. F60.\nG94\nX2.", "fanuc", [1, 1]),
    "cycles": ("G0 Z5\nF60\nG81 X5 Y5 Z-2 R1\nG80", "linuxcnc", [np.inf] * 3 + [1, np.inf]),
    "a probe": ("G38.2 X9 F120", "linuxcnc", [2, np.nan]),
    "after the end": ("G1 X1 F60\nM2\nF120\nG95", "linuxcnc", [1]),
    "lower case and blanks": ("g1 x1 f 6 0\nx2", "linuxcnc", [1, 1]),
    "decimals": ("G1 X1 F60.5", "linuxcnc", [60.5 / 60]),
    "the least feed in inches": ("G20 G93\nG1 X1 F0.001", "linuxcnc", [0.1 * INCH]),
    "the least feed in one of two units": (
        "G93\nG1 X1 F0.001\nG20 X2 F0.001\nG21 X1 F0.001", "linuxcnc", [0.1 / 60, 0.1 * INCH, 0.1 / 60]
    ),
    "inverse time without a point": ("G93 G1 X1. F2", "haas", [2 / 60]),
    "G97 after G96": ("G96 S100\nG97 S600\nG95 G1 X1. F.5", "fanuc", [5]),
    "G97 alone": ("G97 S600\nG95 G1 X1. F.5", "fanuc", [5]),
    "one that nothing uses": ("F0\nF60\nG1 X1\nF0", "linuxcnc", [1]),
    "one that nothing uses on a Haas": ("F0\nF60.\nG1 X1.\nF5", "haas", [1]),
    "rapids alone": ("G0 X1\nG0 X2", "linuxcnc", [np.inf, np.inf]),
    "a mode that is stated again": ("G94\nG1 X1 F60\nG94\nX2", "grbl", [1, 1]),
    "G93 once more": ("G93\nG1 X100 F2\nG93\nX70 F1", "linuxcnc", [200 / 60, 0.5]),
    "a unit before a rapid": ("G1 X1 F60\nG20\nG0 X2\nG1 X3", "linuxcnc", [1, np.inf, 1]),
    "a block of no length": ("G93\nG1 X9 F6\nX9 F6", "linuxcnc", [0.9, np.nan]),
}  # fmt: skip


@pytest.mark.parametrize("name", FEEDS)
def test_feeds_by_hand(name: str) -> None:
    text, control, want = FEEDS[name]
    keys = CALCULATOR if control.endswith(".") else ""
    got = timed(text, control.rstrip("."), keys).feed_mm_s
    np.testing.assert_allclose(got, want, rtol=1e-12)


#: text, control, line that is refused, words of the refusal
REFUSED = {
    "no F at all": ("G0 X1\nG1 X2", "linuxcnc", 2, "no feed"),
    "F too late": ("G1 X2\nF60\nX3", "linuxcnc", 1, "no feed"),
    "zero": ("G1 X2 F0", "linuxcnc", 1, "not above zero"),
    "negative": ("G1 X2 F-3", "grbl", 1, "not above zero"),
    "G93 needs one in each block": ("G93 G1 X2 F1\nX3", "linuxcnc", 2, "in its own block"),
    "G93 does not take an older one": ("F3\nG93\nG1 X2", "linuxcnc", 3, "in its own block"),
    "G94 after G93": ("F60\nG1 X1\nG93 X2 F1\nG94\nX3", "linuxcnc", 5, "no feed"),
    "G94 after G93 on others": ("F60\nG1 X1\nG93 X2 F1\nG94\nX3", "grbl", 5, "no feed"),
    "G94 once more": ("G1 X1 F60\nG94\nX2", "linuxcnc", 3, "no feed"),
    "G95 after G94": ("S100\nG1 X1 F60\nG95\nX2", "linuxcnc", 4, "no feed"),
    "G95 without S": ("G95\nG1 X1 F60", "linuxcnc", 2, "no S word"),
    "G95 with S0": ("G95 S0\nG1 X1 F60", "linuxcnc", 2, "no S word"),
    "G95 with G96": ("G95 G96 S100\nG1 X1. F60.", "fanuc", 2, "G96"),
    "a thread": ("F60 S9 M3\nG33 X9 K1", "linuxcnc", 2, "in time with the spindle"),
    "a probe without F": ("G38.2 X9", "linuxcnc", 1, "no feed"),
    "no point on a Haas": ("G1 X1. F60", "haas", 1, "decimal point"),
    "no point in inches": ("G20\nG1 X1. F60", "fanuc", 2, "decimal point"),
    "a dwell without a time": ("G4", "grbl", 1, "no P word"),
    "a negative dwell": ("G4 X-1.", "fanuc", 1, "negative"),
    "a dwell with two times": ("G4 X1. P100", "fanuc", 1, "two times"),
    "a later dwell without a time": ("G4 P1\nG4", "grbl", 2, "no P word"),
    "a later negative dwell": ("G4 X1.\nG4 X-1.", "fanuc", 2, "negative"),
    "a later dwell with two times": ("G4 X1.\nG4 X1. P100", "fanuc", 2, "two times"),
    "a later G96": ("G97 S600\nG95 G1 X1. F.5\nG96 S100\nX2.", "fanuc", 4, "G96"),
    "a later zero": ("F60\nG1 X1\nF0\nX2", "linuxcnc", 3, "the feed F0 is not above zero"),
    "a later F without a point": ("G1 X1. F60.\nX2. F5", "haas", 2, r"F5 has no decimal point"),
    "no point by turns": ("S60\nG95\nG1 X1. F5", "fanuc", 3, r"F5 has no decimal point"),
    "later without F": ("G1 X1 F60\nG94\nG0 X2\nG1 X3", "linuxcnc", 4, "no F word comes after the feed mode"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_when_timed_and_not_when_read(name: str) -> None:
    text, control, line, words = REFUSED[name]
    program = reading(text, control)
    with pytest.raises(ProgramError, match=words) as caught:
        timing(program)
    assert (caught.value.line, caught.value.code) == (line, "OLP551")


def test_words_are_needed() -> None:
    bare = read(b"G1 X1 F60\n", setup_of("linuxcnc", ""), DIALECTS["linuxcnc"], words=False)
    with pytest.raises(UsageError, match="words"):
        timing(bare)


#: text, control, seconds of rest at the places before, between and after the moves, None for no rest
RESTS: dict[str, tuple[str, str, list[float | None]]] = {
    "seconds": ("G4 P1.5", "linuxcnc", [None, 1.5, None]),
    "seconds of grbl": ("G4 P2", "grbl", [None, 2, None]),
    "milliseconds": ("G4 P1500", "fanuc", [None, 1.5, None]),
    "milliseconds of haas": ("G04 P250", "haas", [None, 0.25, None]),
    "seconds with a point": ("G4 P2.", "haas", [None, 2, None]),
    "seconds in X": ("G4 X1.5", "fanuc", [None, 1.5, None]),
    "seconds in U": ("G4 U0.5", "haas", [None, 0.5, None]),
    "increments in X": ("G4 X1500", "fanuc", [None, 1.5, None]),
    "X of a calculator": ("G4 X2", "fanuc.", [None, 2, None]),
    "P of a calculator": ("G4 P2000", "fanuc.", [None, 2, None]),
    "exact stop": ("G4", "fanuc", [None, 0, None]),
    "two of them": ("G4 P1\nG4 P2", "linuxcnc", [None, 3, None]),
    "before the motion of its block": ("G4 P1 Y5", "linuxcnc", [None, 1, None, None]),
    "stop": ("M0", "linuxcnc", [None, 0, None]),
    "a stop after the motion": ("Y5 M0", "linuxcnc", [None, None, 0, None]),
    "spindle": ("M3", "linuxcnc", [None, 0, None]),
    "spindle before the motion": ("Y5 M3", "linuxcnc", [None, 0, None, None]),
    "M5 before the motion": ("Y5 M5", "linuxcnc", [None, 0, None, None]),
    "M5 after the motion": ("Y5 M5", "fanuc", [None, None, 0, None]),
    "speed": ("S500", "linuxcnc", [None, 0, None]),
    "coolant": ("M8", "grbl", [None, 0, None]),
    "outputs along with the motion": ("M62 P1\nM63 P1", "linuxcnc", [None, None, None]),
    "outputs at once": ("M64 P1", "linuxcnc", [None, 0, None]),
    "exact stop of one block": ("G9 Y5.", "fanuc", [None, None, 0, None]),
    "a tool alone": ("T1", "linuxcnc", [None, None, None]),
    "a tool change": ("T1 M6", "linuxcnc", [None, 0, None, None]),
    "a rapid of an ISO control": ("G0 Y5.\nG1", "fanuc", [None, 0, 0, None]),
    "a rapid": ("G0 Y5\nG1", "linuxcnc", [None, None, None, None]),
    "dwell of a cycle": ("G82 X10 Y0 Z-2 R0 P0.5\nG80 G1", "linuxcnc", [None, None, 0.5, None, None]),
    "dwell of a cycle in ms": ("G82 X10. Y0. Z-2. R0. P500\nG80", "haas", [None, None, 0.5, 0, None]),
    "inherited dwell": (
        "G82 X10 Y0 Z-2 R0 P0.5\nX11\nG80 G1", "linuxcnc",
        [None, None, 0.5, None, None, 0.5, None, None],
    ),
    "a pause": ("Y5 M1", "linuxcnc", [None, None, 0, None]),
    "a pallet": ("Y5 M60", "linuxcnc", [None, None, None, 0, None]),
    "M9 after the motion": ("Y5 M9", "haas", [None, None, 0, None]),
    "M9 before the motion": ("Y5 M9", "linuxcnc", [None, 0, None, None]),
    "M8 before the motion": ("Y5. M8", "haas", [None, 0, None, None]),
    "milliseconds of X": ("G4 X500", "haas", [None, 0.5, None]),
    "seconds with decimals": ("G4 P0.25", "linuxcnc", [None, 0.25, None]),
    "one behind the other": ("G4 X1.\nG4 P500", "fanuc", [None, 1.5, None]),
    "with other words": ("G4 P1.5 F9", "linuxcnc", [None, 1.5, None]),
    "in several places": ("G4 P1\nY5\nG4 P2", "linuxcnc", [None, 1, 2, None]),
    "a speed before the motion": ("Y5 S500", "linuxcnc", [None, 0, None, None]),
    "G9 in every block": ("G9 Y5.\nG9 Y6.", "haas", [None, None, 0, 0, None]),
    "G9 of others": ("G61 Y5\nG64", "linuxcnc", [None] * 4),
    "spindle of a cycle": ("M3 G86 X10 Y0 Z-2 R0 P1\nG80 G1", "linuxcnc", [None, 0, 1, 0, None]),
}  # fmt: skip


@pytest.mark.parametrize("name", RESTS)
def test_rests_by_hand(name: str) -> None:
    text, control, want = RESTS[name]
    keys = CALCULATOR if control.endswith(".") else ""
    got = timed(f"G1 X10. F60.\n{text}\nX20.\n", control.rstrip("."), keys)
    shown = [s if r else None for r, s in zip(got.rest.tolist(), got.dwell_s.tolist(), strict=True)]
    assert shown == want
    assert not got.dwell_s[~got.rest].any()


@pytest.mark.parametrize(
    ("text", "length"),
    [
        ("G1 X3 Y4 Z12", 13.0), ("G2 X10 I5", 5 * np.pi), ("G2 X10 I5 Z3", math.hypot(5 * np.pi, 3)),
        ("G18 G2 X10 I5 Y3", math.hypot(5 * np.pi, 3)), ("G19 G3 Y10 J5 X3", math.hypot(5 * np.pi, 3)),
        ("G18 G3 X10 I5", 5 * np.pi), ("G3 I5 Z7 P2", math.hypot(20 * np.pi, 7)),
        # the radius is 5 mm at the start and 5.02 mm at the end: the mean counts
        ("G2 X10.02 I5", 5.01 * np.pi), ("G19 G3 Y10.02 J5", 5.01 * np.pi),
    ],
)  # fmt: skip
def test_lengths_of_moves(text: str, length: float) -> None:
    assert lengths_mm(reading(f"{text} F60").toolpath) == pytest.approx([length], rel=1e-12)
    # also behind other moves
    later = lengths_mm(reading(f"F60\nG1 X1\nG0 X0\n{text}\nG1 G91 Z5").toolpath)
    assert later == pytest.approx([1.0, 1.0, length, 5.0], rel=1e-12)


def test_a_helix_is_as_high_as_its_ends_are_apart() -> None:
    for text, rise in (
        ("G1 Z2\nG2 X10 I5 Z5", 3),
        ("G18 G1 Y-2\nG2 X10 I5 Y1", 3),
        ("G19 G1 X9\nG3 Y10 J5 X5", 4),
    ):
        lengths = lengths_mm(reading(f"F60\n{text}").toolpath)
        assert lengths[1] == pytest.approx(math.hypot(5 * np.pi, rise), rel=1e-12)


def test_columns_of_time_are_not_changed() -> None:
    for program in (reading("G1 X1 F60"), statements("GOTO/1,2,3", FEDRAT)):
        times = timing(program)
        for column in (times.feed_mm_s, times.control, times.blend_mm, times.rest, times.dwell_s):
            assert not column.flags.writeable
        # the program keeps its own
        assert timing(program).feed_mm_s.tolist() == times.feed_mm_s.tolist()


# -- programs of statements ----------------------------------------------------------------------------

FEDRAT = "UNITS/MM\nFEDRAT/60,MMPM\n"


def statements(text: str, head: str = "UNITS/MM\n", dialect: str = "apt") -> Program:
    controller = "dmis" if dialect == "dmis" else "linuxcnc"
    zero = TRUE_ZERO + TRUE_ZERO.replace("G54", "MCS")
    setup = load_setup(machine(folder() / dialect, controller=controller, tables=zero + TOOLS))
    return read((head + text + "\n").encode(), setup, DIALECTS[dialect])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("GOTO/1,0,0", 2), ("RAPID\nGOTO/1,0,0\nGOTO/2,0,0", 4), ("FEDRAT/0\nGOTO/1,0,0", 3),
        ("FEDRAT/1,MMPR\nGOTO/1,0,0", 3),
        ("RAPID\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1\nGOTO/0,10,0", 5),
        ("RAPID\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,-1\nGOTO/0,10,0", 5),
        ("CYCLE/DRILL,DEPTH,1,CLEAR,2\nGOTO/1,0,0\nCYCLE/OFF\nGOTO/1,0,0", 5),
    ],
)  # fmt: skip
def test_statements_that_cut_have_a_feed(text: str, line: int) -> None:
    with pytest.raises(ProgramError, match="a feed move has no feed that is a speed") as caught:
        timing(statements(text))
    assert (caught.value.line, caught.value.code) == (line, "OLP551")


def test_what_the_control_does_by_itself_needs_no_feed() -> None:
    text = "RAPID\nGOTO/1,0,0\nLOADTL/1\nRAPID\nGOTO/1,0,0\nCYCLE/DRILL,DEPTH,1,CLEAR,2\nGOTO/1,0,0\nSTOP\n"
    times = timing(statements(text), blend_mm=0.3)
    np.testing.assert_equal(times.feed_mm_s, [np.inf, np.nan, np.inf, np.inf, np.nan, np.inf])
    assert times.control.tolist() == [PathControl.BLEND] * 6
    assert times.blend_mm.tolist() == [0.3] * 6
    assert np.flatnonzero(times.rest).tolist() == [6]


def test_touches_of_a_measuring_machine_end_at_rest() -> None:
    text = "GOTO/1,2,3\nMEAS/POINT,F(P),2\nPTMEAS/CART,1,2,4\nPTMEAS/CART,1,2,5\nENDMES\nGOTO/1,2,3"
    times = timing(statements(text, dialect="dmis"))
    assert times.rest.tolist() == [False, False, True, True, False]
    assert np.isnan(times.feed_mm_s[1:3]).all()


def test_statements_take_the_path_mode_of_the_machine() -> None:
    parsed = statements("GOTO/1,0,0\nGOTO/2,0,0", FEDRAT)
    stops = replace(parsed, path_modes=(PathMode(0, "G61.1"),))
    assert timing(stops).control.tolist() == [PathControl.EXACT_STOP] * 2
    assert timing(stops).blend_mm.tolist() == [0.0, 0.0]
    assert [(m.line, m.control, m.stated_mm) for m in path_modes(stops)] == [
        (0, PathControl.EXACT_STOP, None)
    ]
    for blends in (parsed, replace(parsed, path_modes=(PathMode(0, "G64"),))):
        assert timing(blends).control.tolist() == [PathControl.BLEND] * 2
        assert path_modes(blends) == ()


def test_path_modes_are_in_the_order_of_lines() -> None:
    program = reading("G61 G1 X1. F60.\nG62\nX2.\nG64\nG61\n", "fanuc")
    stop, blend = PathControl.EXACT_STOP, PathControl.BLEND
    assert [(m.line, m.control) for m in path_modes(program)] == [
        (1, stop),
        (2, blend),
        (4, blend),
        (5, stop),
    ]
    stated = path_modes(reading("G64 P0.05 G1 X1 F60\nG64\nG61\nG61.1\n"))
    assert [(m.line, m.control, m.stated_mm) for m in stated] == [
        (1, blend, 0.05), (2, blend, None), (3, PathControl.EXACT_PATH, None), (4, stop, None)
    ]  # fmt: skip


def test_feeds_need_words() -> None:
    bare = read(b"G1 X1 F60\n", setup_of("linuxcnc", ""), DIALECTS["linuxcnc"], words=False)
    with pytest.raises(UsageError, match="without its words; feeds need them"):
        programmed(bare)
    assert programmed(reading("G1 X1 F60\n/F120\nX2\n"), block_delete=True).tolist() == [1.0, 1.0]
    assert programmed(reading("G1 X1 F60\n/F120\nX2\n")).tolist() == [1.0, 2.0]


def test_a_probe_ends_at_rest() -> None:
    assert timed("G1 X1 F60\nG38.2 X9\nG1 X10").rest.tolist() == [False, False, True, False, False]


B, P, S = PathControl
#: text, control, path control and tolerance of each move
MODES: dict[str, tuple[str, str, list[tuple[PathControl, float]]]] = {
    "none stated": ("X1", "linuxcnc", [(B, BLEND_MM)]),
    "a tolerance": ("G64 P0.05\nX1", "linuxcnc", [(B, 0.05)]),
    "in its block": ("X1\nG64 P0.05 X2\nX3", "linuxcnc", [(B, BLEND_MM), (B, 0.05), (B, 0.05)]),
    "in inches": ("G20 G64 P0.001\nX1", "linuxcnc", [(B, 0.0254)]),
    "none": ("G64 P0.05\nG64\nX1", "linuxcnc", [(B, BLEND_MM)]),
    "nought": ("G64 P0\nX1", "linuxcnc", [(B, BLEND_MM)]),
    "exact path": ("G61\nX1", "linuxcnc", [(P, 0.0)]),
    "exact path of grbl": ("G61\nX1", "grbl", [(P, 0.0)]),
    "exact stop": ("G61.1\nX1\nG64 P1 X2", "linuxcnc", [(S, 0.0), (B, 1.0)]),
    "exact stop of ISO": ("G61\nX1.\nG64 X2.", "fanuc", [(S, 0.0), (B, BLEND_MM)]),
    "tapping mode": ("G61\nX1.\nG63 X2.\nX3.", "fanuc", [(S, 0.0), (B, BLEND_MM), (B, BLEND_MM)]),
    "corner override first": ("G62\nX1.\nG61 X2.", "fanuc", [(B, BLEND_MM), (S, 0.0)]),
    "G62 of others": ("G61\nX1\nX2", "linuxcnc", [(P, 0.0), (P, 0.0)]),
    "less than nought": ("G64 P-1\nX1", "linuxcnc", [(B, BLEND_MM)]),
    "exact stop of a Haas": ("G61 X1.\nX2.", "haas", [(S, 0.0), (S, 0.0)]),
    "corner override": ("G61\nX1.\nG62 X2.", "fanuc", [(S, 0.0), (B, BLEND_MM)]),
}


@pytest.mark.parametrize("name", MODES)
def test_path_modes_by_hand(name: str) -> None:
    text, control, want = MODES[name]
    got = timed(f"G1 F60.\n{text}\n", control)
    assert got.control.tolist() == [int(c) for c, _ in want]
    np.testing.assert_allclose(got.blend_mm, [t for _, t in want], rtol=1e-12)


def test_the_tolerance_of_bare_g64_is_the_callers() -> None:
    assert timing(reading("G1 X1 F60\n"), blend_mm=0.2).blend_mm.tolist() == [0.2]


@pytest.mark.parametrize("blend", [0.0, -1.0, math.nan])
def test_a_tolerance_of_nothing_is_refused(blend: float) -> None:
    with pytest.raises(UsageError, match="above zero"):
        timing(reading("G1 X1 F60\n"), blend_mm=blend)


def test_block_delete_takes_its_words_away() -> None:
    text = "G1 X1 F60\n / F120\n/G4 P3\nX2 (a/b)\n"
    on, off = timed(text), timed(text, block_delete=True)
    assert on.feed_mm_s.tolist() == [1, 2]
    assert off.feed_mm_s.tolist() == [1, 1]
    assert [on.dwell_s.sum(), off.dwell_s.sum()] == [3, 0]


# -- LinuxCNC ------------------------------------------------------------------------------------------


def compare(nominal: bytes, place: Path) -> int:
    """Feeds as LinuxCNC reads them, moves matched by line and end; the number of them."""
    job = place.with_name("job.toml")
    program = read(nominal, load_setup(place, job if job.exists() else None), DIALECTS["linuxcnc"])
    times, path = timing(program), program.toolpath
    moves = linuxcnc.interpret(nominal, place, find_known=False)
    cutting = np.isin(moves.kind, (linuxcnc.FEED, linuxcnc.ARC, linuxcnc.PROBE))
    theirs: dict[int, list[tuple[np.ndarray, float]]] = {}
    for line, position, feed in zip(
        moves.line[cutting].tolist(), moves.axis[cutting], moves.feed[cutting].tolist(), strict=True
    ):
        theirs.setdefault(line, []).append((position, feed))
    length, count = lengths_mm(path), 0
    for i in np.flatnonzero(np.isfinite(times.feed_mm_s)).tolist():
        near = [
            feed for position, feed in theirs.get(int(path.line[i]), [])
            if np.nanmax(np.abs(position - path.end_mm[i]), initial=0.0) <= NEAR_MM
        ]  # fmt: skip
        if not near:
            assert length[i] <= NEAR_MM, int(path.line[i])
            continue
        count += 1
        want = min(near, key=lambda f: abs(f - 60.0 * times.feed_mm_s[i]))
        # LinuxCNC takes the radius at one end of an arc for its length, not the mean of both
        bar = 1e-3 if i in path.arcs.move else 1e-9
        assert abs(60.0 * times.feed_mm_s[i] - want) <= bar * want, (int(path.line[i]), want)
    pauses = moves.seconds[moves.kind == linuxcnc.DWELL]
    np.testing.assert_allclose(times.dwell_s.sum(), pauses.sum(), rtol=1e-12)
    return count


def spread(text: bytes, rng: np.random.Generator, draw: Callable[[np.random.Generator], str]) -> bytes:
    """The program with lines drawn at random behind its first F word."""
    eol = "\r\n" if b"\r\n" in text else "\n"
    lines = text.decode().split(eol)
    first = next(i for i, line in enumerate(lines) if "F" in line.upper() and "(" not in line)
    for i in range(len(lines) - 1, first, -1):
        if rng.random() < 0.3:
            lines.insert(i, draw(rng).replace("\n", eol))
    return eol.join(lines).encode()


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(30))
def test_feeds_are_linuxcncs(tmp_path: Path, seed: int) -> None:
    def feed(rng: np.random.Generator) -> str:
        return ("G94\n" if rng.random() < 0.3 else "") + f"F{rng.uniform(1, 900):.2f}"

    path = machines.random_machine(tmp_path, seed)
    text = programs.random_program(seed, blocks=20, inch=bool(seed % 2))
    assert compare(spread(text, np.random.default_rng(seed), feed), path) > 10


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(12))
def test_inverse_times_are_linuxcncs(tmp_path: Path, seed: int) -> None:
    """Every motion block in G93 or in G94, in turns, with an F word of its own and units that change."""
    rng = np.random.default_rng(seed)
    rows, position = ["G21 G90 G94 G17 G54", "G0 X0 Y0 Z0", "F100"], np.zeros(3)
    for _ in range(60):
        inch = rng.random() < 0.4
        unit = 25.4 if inch else 1.0
        if rng.random() < 0.3:
            rows.append(str(rng.choice(["G93", "G94"])))
        to = rng.uniform(-50, 50, 3)
        x, y, z = (to / unit).tolist()
        word = f"F{50 ** rng.uniform(-2, 1):.4f}"
        move = f"G1 X{x:.4f} Y{y:.4f} Z{z:.4f}"
        if rng.random() < 0.4:
            i, j = ((to - position)[:2] / 2 / unit).tolist()
            move = f"G{rng.integers(2, 4)} X{x:.4f} Y{y:.4f} Z{z:.4f} I{i:.4f} J{j:.4f}"
            move = move.replace("-0.0000", "0.0000")
        rows.append(f"{'G20' if inch else 'G21'} {move} {word}")
        position = np.round(to / unit, 4) * unit
    assert compare(("\n".join(rows) + "\nM2\n").encode(), machines.random_machine(tmp_path, seed)) == 60


@pytest.mark.oracle
@pytest.mark.parametrize("back", ["G98", "G99"])
@pytest.mark.parametrize("code", ["G73", "G74", "G81", "G82", "G83", "G84", "G85", "G86", "G89"])
def test_feeds_and_dwells_of_cycles_are_linuxcncs(tmp_path: Path, code: str, back: str) -> None:
    dwell = "" if code in ("G73", "G81", "G83", "G85") else "P0.25"
    peck = "Q2" if code in ("G73", "G83") else ""
    turn = "M4" if code == "G74" else "M3"
    text = f"G21 G90 G54\nS500 {turn}\nF123\nG0 X1 Y1 Z9\n{back} {code} X5 Z-3 R2 {peck} {dwell} F77\nX9\n"
    # LinuxCNC takes no repeats with G74
    repeats = "" if code == "G74" else "L3"
    text += f"G91 Y2 {repeats} F50\nG80 G90\nG4 P0.5\nG1 X0\nM2\n"
    assert compare(text.encode(), machines.random_machine(tmp_path, 1)) >= 6


@pytest.mark.oracle
def test_feeds_of_samples_are_linuxcncs(tmp_path: Path) -> None:
    path = spacious(tmp_path, (0.0, 0.0, 0.0))
    compared = feeds = 0
    refused = []
    for sample in samples():
        try:
            flat = olp.flatten(sample, path)
            linuxcnc.interpret(flat, path, find_known=False)
        except (ProgramError, linuxcnc.InterpreterError):
            continue
        try:
            feeds += compare(flat, path)
        except ProgramError as refusal:
            refused.append((sample.name, str(refusal)))
            continue
        compared += 1
    assert compared >= 30, refused
    assert feeds >= 1000


#: LinuxCNC's interpreter lets these pass: its task or its motion stops there, or the spindle sets the pace
LATE = {"no F at all", "F too late", "a probe without F", "a thread"}


@pytest.mark.oracle
@pytest.mark.parametrize("name", [n for n, case in REFUSED.items() if case[1] == "linuxcnc"])
def test_linuxcnc_refuses_too(name: str) -> None:
    assert linuxcnc.accepts((REFUSED[name][0] + "\nM2\n").encode()) == (name in LATE)


# -- laws ----------------------------------------------------------------------------------------------

numbers = st.floats(-90, 90).map(lambda v: round(v, 3))
points = st.lists(st.tuples(numbers, numbers, numbers), min_size=2, max_size=8)


@pytest.mark.slow
@given(points, st.floats(0.01, 100).map(lambda v: round(v, 3)))
def test_inverse_time_is_the_time_of_each_block(
    waypoints: list[tuple[float, float, float]], f: float
) -> None:
    rows = [f"G1 X{x:.3f} Y{y:.3f} Z{z:.3f} F{f:.3f}" for x, y, z in waypoints]
    program = reading("G93\n" + "\n".join(rows))
    length, feed = lengths_mm(program.toolpath), timing(program).feed_mm_s
    assert np.isnan(feed[length == 0]).all()
    stated = length[length > 0] * f / 60.0
    # a block that would be slower takes the least feed of LinuxCNC
    np.testing.assert_allclose(feed[length > 0], np.maximum(stated, 0.1 / 60.0), rtol=1e-12)


@pytest.mark.slow
@given(points, st.floats(0.01, 100).map(lambda v: round(v, 3)))
def test_inches_and_millimetres_mean_the_same(waypoints: list[tuple[float, float, float]], f: float) -> None:
    rows = "\n".join(f"G1 X{x:.3f} Y{y:.3f} Z{z:.3f}" for x, y, z in waypoints)
    metric = "\n".join(f"G1 X{x * 25.4:.7f} Y{y * 25.4:.7f} Z{z * 25.4:.7f}" for x, y, z in waypoints)
    a = timed(f"G20\nG64 P0.001\nF{f:.3f}\n{rows}")
    b = timed(f"G21\nG64 P0.0254\nF{f * 25.4:.7f}\n{metric}")
    np.testing.assert_allclose(a.feed_mm_s, b.feed_mm_s, rtol=1e-9)
    np.testing.assert_allclose(a.blend_mm, b.blend_mm, rtol=1e-12)
