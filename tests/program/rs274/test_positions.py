"""Programs that go from position to position, byte by byte."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from olp.core.errors import CannotCompute
from olp.program.registry import DIALECTS
from olp.program.rs274.positions import positions_program
from olp.program.rs274.profiles.base import Profile

PLACES = np.array([[10.0, -20.0, 30.5], [10.0, -20.0, 30.5004], [-0.0004, 1.25, -3.0]])
PROGRAM = b"""\
(a [note] of ?m)
(%s)
(more)
G21 G90 G94 G80 G40 G49
G53 G0 Z30.500
G53 G0 X10.000 Y-20.000 Z30.500
G4 P%s
G4 P%s
G53 G0 X0.000 Y1.250 Z-3.000
M30
"""


@pytest.mark.parametrize(
    ("control", "dwells"),
    [
        ("linuxcnc", (b"0.250", b"2.000")),
        ("grbl", (b"0.250", b"2.000")),
        ("fanuc", (b"250", b"2000")),
        ("haas", (b"250", b"2000")),
    ],
)
def test_positions_are_written_with_dwells_and_notes(control: str, dwells: tuple[bytes, bytes]) -> None:
    """A position that is the same to the last digit is not gone to again; notes are at most 68 wide."""
    profile = DIALECTS[control]
    assert isinstance(profile, Profile)
    notes = ["a (note) of \u00b5m", "w" * 68 + " more"]
    text = positions_program(profile, PLACES, [0.25, 2.0, 0.0], 3, notes)
    assert text == PROGRAM % (b"w" * 68, *dwells)


def test_digits_are_those_asked_for() -> None:
    profile = DIALECTS["linuxcnc"]
    assert isinstance(profile, Profile)
    text = positions_program(profile, PLACES, [0.0, 0.0, 0.0], 4, [])
    assert text.splitlines()[1:4] == [
        b"G53 G0 Z30.5000",
        b"G53 G0 X10.0000 Y-20.0000 Z30.5000",
        b"G53 G0 X10.0000 Y-20.0000 Z30.5004",
    ]


def test_a_control_without_g53_has_no_such_program() -> None:
    profile = DIALECTS["linuxcnc"]
    assert isinstance(profile, Profile)
    without = dataclasses.replace(profile, codes={c: a for c, a in profile.codes.items() if c != 530})
    with pytest.raises(CannotCompute) as caught:
        positions_program(without, PLACES, [0.0] * 3, 3, [])
    assert str(caught.value) == f"{profile.title} has no G53; take the points from the CSV file"
