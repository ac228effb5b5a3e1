"""The state of the control that reader and unroller share: which code changes what, and offsets' sums."""

from __future__ import annotations

import math

import pytest

from olp.program import registry
from olp.program.rs274 import codes
from olp.program.rs274.offsets import Offsets
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.rs274.state import State
from olp.program.rs274.strokes import CODES

#: Controls on which a setting says to which height a cycle returns.
RETRACT_SET = ("mach3", "mach4", "okuma", "marlin", "klipper", "eding", "fagor")
PROFILES = [d for d in registry.DIALECTS.values() if isinstance(d, Profile)]
ACTS = {
    Act.PLANE: "plane",
    Act.DISTANCE: "distance",
    Act.ARC_DISTANCE: "arc_distance",
    Act.FEED: "feed_mode",
    Act.RETRACT: "retract",
}


@pytest.mark.parametrize("profile", PROFILES, ids=lambda profile: profile.name)
def test_the_state_takes_every_modal_code_of_a_profile(profile: Profile) -> None:
    for code, act in profile.codes.items():
        if act in ACTS:
            state = State(profile)
            state.take({code})
            assert getattr(state, ACTS[act]) == code


def test_no_code_is_in_two_groups_and_the_cycles_are_those_with_strokes() -> None:
    listed = [code for group in codes.GROUPS.values() for code in group]
    assert len(listed) == len(set(listed))
    assert codes.CYCLES == CODES


def test_modes_that_were_saved_come_back() -> None:
    state = State(PROFILES[0])
    before = state.in_force()
    state.take({190, 910, 990, 930, 901})
    assert not state.absolute
    assert state.retract_to_r
    assert state.inverse_time
    state.take(before | {state.retract})
    assert state.absolute
    assert state.plane == 170
    assert not state.inverse_time


def test_forgetting_takes_the_named_axes_only() -> None:
    state = State(PROFILES[0], [1.0, 2.0, 3.0])
    state.forget((2,))
    assert state.position[:2] == [1.0, 2.0]
    assert math.isnan(state.position[2])


def test_g92_and_g10_make_the_present_position_the_value_given() -> None:
    offsets = Offsets("G54", length=(0.0, 0.0, 50.0), local=[1.0, 2.0, 4.0])
    work = [100.0, 200.0, -300.0]
    for axis in range(3):
        offsets.preset({axis: 5.0}, (7.0, -8.0, 9.0), work, 0.0)
    total = offsets.total(work, 0.0)
    assert [p - t for p, t in zip((7.0, -8.0, 9.0), total, strict=True)] == [5.0, 5.0, 5.0]
    again = [offsets.work_at(axis, p, 5.0) for axis, p in enumerate((7.0, -8.0, 9.0))]
    assert again == work


def test_a_turned_offset_turns_the_shift_and_not_the_length() -> None:
    offsets = Offsets("G54", shift=[1.0, 2.0, 3.0], length=(10.0, 20.0, 30.0))
    assert offsets.total((100.0, 200.0, 300.0), 90.0) == (108.0, 221.0, 333.0)
    offsets.preset({0: 7.0}, (108.0, 221.0, 333.0), (100.0, 200.0, 300.0), 90.0)
    assert offsets.shift == [-6.0, 2.0, 3.0]


def test_g92_2_leaves_the_stored_shift_and_g92_1_does_not() -> None:
    offsets = Offsets("G54", shift=[1.0, 2.0, 3.0])
    offsets.store_shift()
    for _ in range(2):
        offsets.clear_shift(save=True)
        assert offsets.shift == [0.0, 0.0, 0.0]
    offsets.restore_shift()
    assert offsets.shift == [1.0, 2.0, 3.0]
    offsets.clear_shift(save=False)
    offsets.restore_shift()
    assert offsets.shift == [0.0, 0.0, 0.0]


#: Sets of codes by their names, as the manuals have them.
NAMED = {
    "CYCLES": "G73 G74 G76 G77 G81 G82 G83 G84 G85 G86 G87 G89",
    "COMMON_CYCLES": "G73 G74 G81 G82 G83 G84 G85 G86 G89",
    "SHIFTED_BORES": "G76 G77 G87",
    "BACK_BORES": "G77 G87",
    "PROBES": "G38.2 G38.3 G38.4 G38.5",
    "SPLINES": "G5 G5.1 G5.2 G5.3",
    "LINEAR": "G0 G1 G2 G3 G33",
    "CUTTER_COMPENSATION": "G41 G41.1 G42 G42.1",
    "COMPENSATION_LEFT": "G41 G41.1",
    "COMPENSATION_BY_DIAMETER": "G41.1 G42.1",
    "PATH_MODES": "G61 G61.1 G64",
    "UNITS": "G20 G21",
    "HOMES": "G28 G30",
    "SHIFTS": "G52 G92 G92.1 G92.2 G92.3",
    "AXIS_VALUES": "G10 G43.1 G50.1 G51 G51.1 G52 G68 G68.2 G92",
    "TRANSFORMS": "G50 G50.1 G51 G51.1 G68 G69",
    "TABLE_LENGTHS": "G43 G44 G49",
    "LENGTHS": "G43 G43.1 G43.2 G44 G49",
    "WORK_OFFSETS": "G54 G54.1 G55 G56 G57 G58 G59 G59.1 G59.2 G59.3",
    "FURTHER_OFFSETS": " ".join(f"G{code}" for code in (*range(110, 130), 154)),
}
ALONE = {
    "COMPENSATION_OFF": "G40", "INCH": "G20", "METRIC": "G21", "ABSOLUTE": "G90", "INCREMENTAL": "G91",
    "ROTATION": "G68", "SCALING": "G51", "MIRROR": "G51.1",
    "INVERSE_TIME": "G93", "RETRACT_TO_INITIAL": "G98", "RETRACT_TO_R": "G99", "END_OF_CYCLES": "G80",
    "DWELL": "G4", "MACRO": "G65", "WRITE_OFFSET": "G10", "LOCAL_OFFSET": "G52", "PRESET": "G92",
    "MACHINE": "G53", "LENGTH_FROM_WORDS": "G43.1",
}  # fmt: skip
IN_GROUPS = {
    "plane": "G17 G18 G19",
    "distance": "G91 G90",
    "arc_distance": "G90.1 G91.1",
    "retract": "G98 G99",
    "feed_mode": "G94 G95 G93",
}


def tenths(names: str) -> list[int]:
    return [round(10 * float(name[1:])) for name in names.split()]


def test_codes_are_ten_times_their_numbers() -> None:
    for name, listed in NAMED.items():
        assert sorted(getattr(codes, name)) == sorted(tenths(listed)), name
    for name, one in ALONE.items():
        assert [getattr(codes, name)] == tenths(one), name
    # of two codes of a group in a block the unroller takes the last one of these
    assert {group: list(listed) for group, listed in codes.GROUPS.items()} == {
        group: tenths(listed) for group, listed in IN_GROUPS.items()
    }
    assert codes.PLANE_OF == {170: 0, 180: 1, 190: 2}


def test_what_is_in_force_at_the_start() -> None:
    """G17 G90 G91.1 G94, no motion, mm until the program says otherwise, and no axis known."""
    for profile in PROFILES:
        state = State(profile)
        assert (state.plane, state.distance, state.arc_distance, state.feed_mode) == (170, 900, 911, 940)
        # a setting of the control where it is -1
        assert state.retract in (980, 990) or profile.name in RETRACT_SET
        assert (state.motion, state.unit, state.unit_mm) == (None, None, 1.0)
        assert state.retract_to_r == (profile.name in ("linuxcnc", "grbl"))
        assert len(state.position) == 3
        assert all(math.isnan(p) for p in state.position)
        assert (state.series.count, state.series.initial, state.series.held) == (0, None, {})
        assert not state.series.broken


def test_units_of_a_program() -> None:
    state = State(PROFILES[0])
    state.unit = 200
    assert state.unit_mm == 25.4
    state.unit = 210
    assert state.unit_mm == 1.0


def test_forgetting_takes_all_axes_where_none_is_named() -> None:
    state = State(PROFILES[0], [1.0, 2.0, 3.0])
    state.forget()
    assert all(math.isnan(p) for p in state.position)


def test_a_series_inherits_r_depth_peck_and_dwell() -> None:
    series = State(PROFILES[0]).series
    series.begin(7.0)
    series.hold({"X": 1.0, "Y": 2.0, "Z": -3.0, "R": 4.0, "Q": 5.0, "P": 6.0, "L": 7.0, "F": 8.0}, "Z")
    assert series.held == {"Z": -3.0, "R": 4.0, "Q": 5.0, "P": 6.0}
    series.hold({"R": 1.0, "Y": 9.0}, "Z")
    assert series.held == {"Z": -3.0, "R": 1.0, "Q": 5.0, "P": 6.0}
    series.broken = True
    series.begin(None)
    assert (series.count, series.initial, series.held, series.broken) == (2, None, {}, False)
    series.hold({"X": 1.0, "Y": 2.0, "Z": -3.0}, "X")
    assert series.held == {"X": 1.0}


def test_codes_of_a_block_come_into_force_and_others_change_nothing() -> None:
    state = State(PROFILES[0])
    before = state.in_force()
    assert len(before) == 5
    state.take({10, 200, 540, 610})
    assert state.in_force() == before
    assert (state.motion, state.unit) == (None, None)
    state.take({900, 910})
    assert state.absolute


def test_offsets_of_a_fresh_program_are_zero_and_of_their_own() -> None:
    a, b = Offsets("G54"), Offsets("G54")
    a.shift[0] = a.saved[1] = a.local[2] = 5.0
    a.written["G55"] = [1.0, 2.0, 3.0]
    assert b.shift == b.saved == b.local == [0.0, 0.0, 0.0]
    assert b.written == {}
    assert (b.length, b.total([1.0, 2.0, 3.0], 0.0)) == ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))


def test_an_axis_position_is_the_sum_of_its_offsets() -> None:
    offsets = Offsets("G54", shift=[1.0, 2.0, 3.0], local=[10.0, 20.0, 30.0], length=(0.5, 0.25, 0.125))
    assert offsets.total([100.0, 200.0, 300.0], 0.0) == (111.5, 222.25, 333.125)
    # G10 L20 and G92 make an axis position the program position 7
    assert [offsets.work_at(i, 50.0, 7.0) for i in range(3)] == [31.5, 20.75, 9.875]
    offsets.preset({1: 7.0}, [50.0] * 3, [100.0, 200.0, 300.0], 0.0)
    assert offsets.shift == [1.0, 50.0 - 200.0 - 0.25 - 20.0 - 7.0, 3.0]
