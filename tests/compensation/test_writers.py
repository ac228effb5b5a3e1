"""The base of all writers: a text that is written in many chunks is the text that is written in one."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp
from olp.compensation.writer import Writer

CALIBRATION = (
    '[[curves]]\nfile = "x.csv"\n[[curves]]\nfile = "y.csv"\n[squareness]\nC0Y_urad = 200.0\n'
    "[backlash]\nX_um = 6.0\nY_um = 4.0\n"
)
CURVES = {
    "x.csv": "X_mm,EXX_um,EYX_um,EZX_um\n-1000,-80,30,10\n0,10,0,-10\n60,25,-10,5\n2000,90,20,0\n",
    "y.csv": "Y_mm,EYY_um,EXY_um\n-1000,-40,20\n20,5,-8\n2000,70,15\n",
}
FRAMES = TRUE_ZERO + '[work_offsets.MCS]\nset_by = "true"\n[tools.1]\nZ_mm = 0.0\n'
LINES = "".join(f"G1 X{k * 7 % 50}.5 Y{k * 3 % 40}.25\nX{k}. Z-{k % 3}.\n" for k in range(1, 12))
POINTS = [(k * 37 % 300 + 0.5, k * 53 % 200 + 0.25, k % 5 * 1.0) for k in range(24)]
TEXTS = {
    "modal.ngc": f"G21 G90 G54 F600\nG0 X0. Y0. Z5.\n{LINES}G91\n{LINES}G90 G20\n{LINES}M2\n",
    "arcs.ngc": "G21 G90 G54 F600\nG0 X0. Y0. Z5.\nG2 X80. Y80. I40. J40.\nG3 X0. Y0. R60.\n"
    "G2 X0. Y0. I50. J0. F900 M5\nG1 X5.\nG3 X5. Y0. I-20. J0. Z-3.\nG1 X30. Y9.\nM2\n",
    "cycles.ngc": "G21 G90 G54 F100\nG0 X0. Y0. Z20.\nG99 G81 X10. Y10. Z-5. R2.\nX30.\nY40. Z-6.\nG80\n"
    "G0 X0.\nG91 G81 X12. Y3. Z-4. R-3. L4\nG80\nG90 G1 X90. Y50. Z3.\nM2\n",
    "captures.ngc": "G21 G90 G54 F100\nG0 X100. Y50. Z20.\nG1 X150.\nG92 X0. Y0.\nG1 X50. Y60.\n"
    "G1 X5. Y5. Z2.\nG92.1\nG1 X7. Y7.\nM2\n",
    "points.apt": "PARTNO A\nUNITS/MM\nLOADTL/1\nFEDRAT/600,MMPM\n"
    + "".join(f"GOTO/{x},{y},{z}\n" for x, y, z in POINTS)
    + "GODLTA/100,0,0\nGODLTA/0,90,0\nGOTO/0,0,0\nFINI\n",
    "arcs.apt": "PARTNO A\nUNITS/MM\nLOADTL/1\nFEDRAT/600,MMPM\nGOTO/40,0,0\n"
    "CIRCLE/0,0,0,0,0,1,40\nGOTO/0,40,0\nGOTO/-90,40,0\nCIRCLE/-90,90,0,0,0,1,50\nGOTO/-40,90,0\nFINI\n",
    "points.dmi": "DMISMN/'A',05.2\nUNITS/MM,ANGDEC\n"
    + "".join(f"GOTO/{x},{y},{z}\n" for x, y, z in POINTS)
    + "ENDFIL\n",
    "plain.csv": "X_mm,Y_mm,Z_mm\n" + "".join(f"{x},{y},{z}\n" for x, y, z in POINTS),
    "padded.csv": "X_mm  Y_mm  Z_mm\n" + "".join(f"{x:9.2f}  {y:9.2f}  {z:+9.2f}\n" for x, y, z in POINTS),
}


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.slow
def test_the_size_of_chunks_changes_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    described = machine(tmp_path, CALIBRATION, CURVES, tables=FRAMES)
    program = tmp_path / name
    program.write_text(TEXTS[name])
    whole = olp.correct(program, described, tolerance_um=1.0)
    assert whole.report["moves"]["changed_words"] > 5
    for chunk in (1, 2, 5):
        monkeypatch.setattr(Writer, "chunk", chunk)
        parts = olp.correct(program, described, tolerance_um=1.0)
        assert parts.data == whole.data, chunk
        assert parts.report["moves"] == whole.report["moves"], chunk
