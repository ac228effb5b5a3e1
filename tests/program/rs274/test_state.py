"""The state of the control that reader and unroller share: which code changes what, and offsets' sums."""

from __future__ import annotations

import math

import pytest

from olp.program import registry
from olp.program.rs274 import codes
from olp.program.rs274.cycles import CODES
from olp.program.rs274.offsets import Offsets
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.rs274.state import State

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
    for axis, position in enumerate((7.0, -8.0, 9.0)):
        offsets.preset(axis, position, work, 5.0)
    total = offsets.total(work)
    assert [p - t for p, t in zip((7.0, -8.0, 9.0), total, strict=True)] == [5.0, 5.0, 5.0]
    again = [offsets.work_at(axis, p, 5.0) for axis, p in enumerate((7.0, -8.0, 9.0))]
    assert again == work


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
