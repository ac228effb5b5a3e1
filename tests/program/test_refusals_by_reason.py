"""Every refusal of a real program earns its place: each has a reason that a person accepts.

`python tests/cases/refusals_by_reason.py CORPUS` prints the table.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from cases.refusals_by_reason import outcomes, table

pytestmark = [pytest.mark.corpus, pytest.mark.slow]

#: Programs that the control stops at, too: code, line and reason.
NOT_LEGAL = {
    "cncjs__examples_gcode_Circle_Diamond_Square_Calibration.gcode": (
        "OLP530", 624, "the radius is 29.0 mm at the start of the arc and 27.6 mm at its end",
    ),
    "cncjs__examples_gcode_full-circle-without-xyz.gcode": ("OLP516", 11, "G2 is in force, without a centre"),
}  # fmt: skip
#: Programs that a control carries out, and that no correction can be right for.
ACCEPTED = {
    "MaestroFusion360__cnc_programs_TEST_G91.NC": (
        "OLP524", 34, "distances from where a tool change ends, which no block states",
    ),
}  # fmt: skip
#: What speaks against a program of the Sinumerik folder, most of which are subprograms, cycles of machine
#: builders and tests of editors: the code, and what the message says.
SINUMERIK = {
    "OLP542": "is not in this file nor beside it|needs OF behind|not in its direction|so it may be rounded",
    "OLP541": "has no value that the program sets|whose value only the control knows",
    "OLP512": "tilts the plane|variable of the control|G43|G10|kinematics|inside the control",
    "OLP510": "is not understood",
    "OLP543": "endless loop",
    "OLP540": "is not an expression",
}
#: Programs of that folder which a user would run here.
READ = ("121philip__Approach_A_CAM_TEST.MPF", "PDubovikov__SinumerikLanguage_test_case_test.mpf")
#: Share of the plain programs that is read, at least.
LEAST = 0.95


def test_each_refusal_is_one_that_a_person_accepts(corpus: Path) -> None:
    every = outcomes(corpus)
    shown = table(every)
    assert not [each.name for each in every if not each.kept]
    theirs = [each for each in every if each.family == "Sinumerik" and each.code]
    assert not [e for e in theirs if not re.search(SINUMERIK.get(e.code, "none"), e.why)], shown
    assert not {each.name for each in theirs}.intersection(READ), shown
    every = [each for each in every if each.family != "Sinumerik"]
    refused = {each.name: (each.code, each.line) for each in every if each.code}
    assert refused == {name: row[:2] for name, row in (NOT_LEGAL | ACCEPTED).items()}, shown
    for family in ("RS-274", "APT"):
        legal = [each for each in every if each.family == family and each.name not in NOT_LEGAL]
        assert sum(not each.code for each in legal) >= LEAST * len(legal), shown
