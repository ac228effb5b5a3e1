"""Eding and Fagor mills, as posts write for them: where a program goes that LinuxCNC has in its own words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped

import olp
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Toolpath
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

KEYS = 'arc_centres = "incremental"\ntool_change_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n'
TOOLS = "[tools.1]\nZ_mm = 30.0\n[tools.12]\nZ_mm = 50.0\n"
FAGOR = """%00000
N0 G71
N10 T12.12 (END MILL T1.3)
N20 M6
N30 G0 G90 G43 Z100 F1000 S100 M3
N40 X0 Y0
N50 G55
N60 G1 Z-1
N70 X-1.17 Y15
N80 G2 X-2.11 Y16.33 I0 J1
N90 G91 G3 X4 Y0 R2.5
N100 G90 G0 G44 Z100
N110 T1.1 M6
N120 G43 X5
N130 Z3
N140 M30
"""
EDING = """(Estlcam)
G21
G90
MSG "tool: #12 G0 X5"
T12 M06
G00 G43 Z5.0000
N5 msg "(a) #1=2"
G00 X-4.8259 Y2.9573
G01 Z0.0000 F800 S30000
G03 X-5.6483 Y0.3640 Z-0.5000 I4.8259 J-2.9573
G59.1
G92 X0 Y-217
G00 Y0
G98 G81 X1 Y2 Z-3 R1
X5
G80
G28
M30
"""
#: The same in the words of LinuxCNC.
SAME = {
    "fagor": FAGOR.replace("%00000", "")
    .replace("G71", "G21")
    .replace("T12.12", "T12")
    .replace("T1.1 ", "T1 ")
    .replace("G44", "G49"),
    "eding": "\n".join("" if "msg" in line.lower() else line for line in EDING.split("\n")),
}
TEXTS = {"fagor": FAGOR, "eding": EDING}


def setup_of(folder: Path, control: str) -> Setup:
    offsets = "".join(f'[work_offsets."{g}"]\nX_mm = 7.0\nset_by = "true"\n' for g in ("G55", "G59.1"))
    path = machine(folder, controller=control, keys=KEYS, tables=TRUE_ZERO + offsets + TOOLS)
    return load_setup(path)


def toolpath(folder: Path, text: str, control: str) -> Toolpath:
    return read(text.encode(), setup_of(folder, control), DIALECTS[control]).toolpath


@pytest.mark.parametrize("control", TEXTS)
def test_a_program_goes_where_linuxcnc_goes_with_the_same(tmp_path: Path, control: str) -> None:
    mine = toolpath(tmp_path / "a", TEXTS[control], control)
    theirs = toolpath(tmp_path / "b", SAME[control], "linuxcnc")
    np.testing.assert_allclose(mine.end_mm, theirs.end_mm, atol=1e-9)
    np.testing.assert_allclose(mine.arcs.centre_mm, theirs.arcs.centre_mm, atol=1e-9)
    assert mine.line.tolist() == theirs.line.tolist()
    assert len(mine) > 9


REFUSED = {
    ("fagor", "T2"): ("T2 has no offset, and which length that is is not known", 3),
    ("fagor", "(T1.2)\nT1.2"): ("T1 has the offset 2 of another tool", 4),
    ("fagor", "G54\nG59 X0 Y0"): ("G59 with axes writes a work offset; state it", 4),
    ("fagor", "G1 X1\nG54 (X1)\nZ1 G 54"): ("G54 with axes writes a work offset; state it", 5),
    ("fagor", "G53 X1"): ("G53 is a work offset on some of these controls", 3),
    ("fagor", "G81 G99 X1 Y0 Z2 I-4"): ("G81 has words of its own on this control; post the moves", 3),
    ("fagor", "G20"): ("G20 is not known to the fagor profile", 3),
    ("fagor", "G49"): ("G49 is not known to the fagor profile", 3),
    ("fagor", "G41 X1"): ("G41 makes corners of contours in a way that is not known", 3),
    ("fagor", "G4 K50"): ("G4 counts by K in a unit that is not known", 3),
    ("eding", "G42 D1 X1"): ("G42 makes corners of contours in a way that is not known", 3),
    ("eding", 'MSG "a" X1'): ("", 3),
    ("eding", "G92.1"): ("G92.1 is not known to the eding profile", 3),
    ("eding", "#1 = 5"): ("`#1 = 5` uses parameters, expressions or flow control", 3),
    ("eding", "G81 X1 Y1 Z-1 R1"): ("whether this cycle returns to its initial level or to R", 3),
}


@pytest.mark.parametrize(("control", "block"), REFUSED)
def test_what_the_posts_do_not_write_is_refused(tmp_path: Path, control: str, block: str) -> None:
    unit = "G71" if control == "fagor" else "G21"
    with pytest.raises(ProgramError) as caught:
        toolpath(tmp_path, f"{unit} G90\nG0 X0 Y0 Z50\n{block}\nM30\n", control)
    message, line = REFUSED[control, block]
    assert (caught.value.line, caught.value.message[: len(message)]) == (line, message)


def test_the_offset_of_a_tool_stays_as_it_is_written(tmp_path: Path) -> None:
    path = machine(
        tmp_path, "[squareness]\nC0Y_urad = 1000.0\n", controller="fagor", keys=KEYS, tables=TRUE_ZERO + TOOLS
    )
    text = "G71 G90\nT12.12 M6\nG0 G43 X0 Y50 Z60\nG1 X10 F100\nM30\n"
    written = unstamped(olp.correct(text.encode(), path).data).decode()
    assert written.splitlines()[:2] == text.splitlines()[:2]
    assert written != text
