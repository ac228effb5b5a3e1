"""G10 L10 to L13, and L1 of LinuxCNC, beside the tools of the machine file."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

TOOLS = (
    f"{TRUE_ZERO}[tools.1]\nZ_mm = 80.25\nradius_mm = 4.0\nwear_mm = -0.03\n[tools.2]\nZ_mm = 50.0\n"
    "[job_defaults]\ntool = 1\n"
)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machine(tmp_path_factory.mktemp("m"), controller="fanuc", tables=TOOLS)


@pytest.mark.parametrize(
    ("block", "code", "why"),
    [
        ("L10 P1 R80.25", "", ""),
        ("G20 L10 P1 R3.1594", "", ""),  # inches, as they are rounded
        ("L12 P1 R4.", "", ""),
        ("L12 P1 R8.", "", ""),  # a diameter
        ("L13 P1 R-.03", "", ""),
        ("L11 P1 R0.", "", ""),
        ("L10 P1 R80.252", "OLP526", r"writes a length of tool 1 .* give Z_mm in \[tools\.1\]"),
        ("L12 P1 R5.", "OLP526", "give radius_mm"),
        ("L13 P1 R.03", "OLP526", "give wear_mm"),
        ("L11 P1 R.02", "OLP526", "or leave L11 out"),
        ("L12 P2 R4.", "OLP526", "give radius_mm"),  # the file states none
        ("G91 L10 P1 R80.25", "OLP526", "in G90"),
        ("L10 P7 R1.", "OLP521", r"give \[tools\.7\]"),
        ("L10 P1", "OLP526", "writes tables of the control"),
    ],
)
def test_what_the_file_says_may_be_written_and_nothing_else(
    path: Path, block: str, code: str, why: str
) -> None:
    text = f"G21 G90 G54\nG0 X1. Y2. Z3.\nG10 {block}\nM2\n".encode()
    if not code:
        assert read(text, load_setup(path), DIALECTS["fanuc"])
        return
    with pytest.raises(ProgramError, match=why) as caught:
        read(text, load_setup(path), DIALECTS["fanuc"])
    assert (caught.value.code, caught.value.line) == (code, 3)


@pytest.mark.parametrize(
    ("block", "why"),
    [
        ("L1 P1 X0 Z80.25 R3.97", ""),  # with the wear, which is in the table there
        ("G91 L1 P1 Z80.25", ""),
        ("G20 L1 P1 Z3.1594 R.1563", ""),
        ("L1 P1 Z80.2 X.5 R4", r"give X_mm = 0\.5, Z_mm = 80\.2, radius_mm = 4\.03 in \[tools\.1\] as the"),
        ("L1 P2 Z50 R4", "give radius_mm = 4 in"),
        ("L1 P7 Z0", r"writes lengths or the radius of tool 7, which is not defined; give \[tools\.7\]"),
        ("L1 P1", "writes tables of the control"),
        ("L10 P1 R80.25", "writes tables of the control"),
    ],
)
def test_an_entry_of_linuxcnc(path: Path, block: str, why: str) -> None:
    text = f"G21 G90 G54\nG0 X1. Y2. Z3.\nG10 {block}\nM2\n".encode()
    if not why:
        assert read(text, load_setup(path), DIALECTS["linuxcnc"])
        return
    with pytest.raises(ProgramError, match=why):
        read(text, load_setup(path), DIALECTS["linuxcnc"])
