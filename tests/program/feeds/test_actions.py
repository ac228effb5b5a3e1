"""What a program asks of the control beside motion: counted by hand, in all languages."""

from __future__ import annotations

import numpy as np
import pytest
from cases.pages import PROGRAMS
from program.feeds.test_timing import reading

from olp.core.machine import ControlTimes
from olp.files.config import load_setup
from olp.program.feeds.actions import actions
from olp.program.registry import DIALECTS, Options, read

TIMES = ControlTimes(tool_change_s=6.0, spindle_start_s=2.0, m_codes_s={8: 0.5})
#: text, control, line and name of each action
CASES: dict[str, tuple[str, str, list[tuple[int, str]]]] = {
    "a change ends the turn of the spindle": (
        "M3 S900\nG0 X1\nT2 M6\nM3\nG0 X2",
        "linuxcnc",
        [(1, "spindle start"), (3, "tool change"), (4, "spindle start")],
    ),
    "a new speed is a start, the same one is none": (
        "S900 M3\nG0 X1\nS900\nM3\nS1200\nM4\nM5\nS500\nG0 X2",
        "linuxcnc",
        [(1, "spindle start"), (5, "spindle start"), (6, "spindle start"), (7, "M5")],
    ),
    "other codes keep their names, ends have none": (
        "M8\nG0 X1\n(M7)\nM9\nM2\nM8",
        "linuxcnc",
        [(1, "M8"), (4, "M9")],
    ),
    "M6 of Sinumerik": (
        'N10 T1 M6\nS900 M3 D1\nG0 X1 ; M6\nMSG("M6")\nT2\nM06\nM3 M8\nG0 X2',
        "sinumerik",
        [(1, "tool change"), (2, "spindle start"), (6, "tool change"), (7, "spindle start"), (7, "M8")],
    ),
    "M6 of Sinumerik under block delete": ("/T1 M6\nG0 X1", "sinumerik", []),
    "blocks under block delete": ("/M8\nG0 X1", "fanuc", []),
}


@pytest.mark.parametrize("case", CASES)
def test_words_ask_for_actions(case: str) -> None:
    text, control, wanted = CASES[case]
    deleted = text.startswith("/")
    asked = actions(reading(text, control, block_delete=deleted), block_delete=deleted)
    assert asked is not None
    assert list(zip(asked.line.tolist(), asked.name, strict=True)) == wanted


def test_conversational_programs_and_apt_ask_too() -> None:
    plate = PROGRAMS / "gantry-plate" / "machine.toml"
    text = (
        b"BEGIN PGM A MM\nTOOL CALL 1 Z S800 ; M7\nL X+1 FMAX M13\nTOOL CALL S900\nL X+2 FMAX M91\n"
        b'L X+3 F100 M8\nTOOL CALL "M4 S7" Z S800\nL X+4 FMAX M5\nEND PGM A MM\n'
    )
    setup = load_setup(plate)
    named = text.replace(b'"M4 S7"', b"3")
    asked = actions(read(named, setup, DIALECTS["heidenhain"], Options()))
    assert asked is not None
    assert list(zip(asked.line.tolist(), asked.name, strict=True)) == [
        (2, "tool change"), (3, "spindle start"), (3, "M13"), (4, "spindle start"), (6, "M8"),
        (7, "tool change"), (8, "M5"),
    ]  # fmt: skip
    apt = (
        b"UNITS/MM\nLOADTL/1\nSPINDL/RPM,900,CLW\nFEDRAT/MMPM,100\nGOTO/1,2,3\nSPINDL/900,CCLW\n"
        b"SPINDL/OFF\nFINI\n"
    )
    asked = actions(read(apt, setup, DIALECTS["apt"], Options()))
    assert asked is not None
    assert list(zip(asked.line.tolist(), asked.name, strict=True)) == [
        (2, "tool change"), (3, "spindle start"), (6, "spindle start"),
    ]  # fmt: skip


def test_times_wait_before_the_motion_of_a_line_or_after_it() -> None:
    asked = actions(reading("M3 S900 G0 X1\nM8 X2\nM9 X3\nX4"))
    assert asked is not None
    times = ControlTimes(spindle_start_s=2.0, m_codes_s={8: 0.5, 9: 0.25})
    np.testing.assert_array_equal(asked.waits(np.array([1, 2, 3, 4]), times), [2.0, 0.5, 0.25, 0.0, 0.0])
    late = actions(reading("G0 X1 M0\nX4"))
    assert late is not None
    np.testing.assert_array_equal(late.waits(np.array([1, 2]), ControlTimes(m_codes_s={0: 9.0})), [0, 9, 0])
    assert asked.rows(TIMES) == [
        {"what": "spindle start", "count": 1, "seconds": 2.0}, {"what": "M8", "count": 1, "seconds": 0.5},
        {"what": "M9", "count": 1, "seconds": None},
    ]  # fmt: skip
