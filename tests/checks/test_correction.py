"""What the findings of a correction say for each dialect."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.gate import tilted

import olp
from olp.core.errors import OlpError
from olp.program.registry import DIALECTS

#: A hole whose strokes lean too far, by dialect.
HOLES = {
    "linuxcnc": "G21 G90 G0 X0 Y0 Z9\nG81 X10 Y10 Z-90 R0 F100\nG80\nM2\n",
    "sinumerik": "G71 G90 G0 X0 Y0 Z9\nF100\nMCALL CYCLE81(5,0,1,-90)\nX10 Y10\nMCALL\nM30\n",
    "heidenhain": "0 BEGIN PGM A MM\n1 L X+0 Y+0 Z+9 R0 FMAX\n2 CYCL DEF 200 DRILLING ~\nQ200=1 ~\n"
    "Q201=-90 ~\nQ206=100 ~\nQ202=90 ~\nQ210=0 ~\nQ203=+0 ~\nQ204=9 ~\nQ211=0\n"
    "3 L X+10 Y+10 R0 FMAX M99\n4 END PGM A MM\n",
}


@pytest.mark.parametrize("name", HOLES)
def test_holes_are_written_out_by_the_option_only_where_the_dialect_has_it(tmp_path: Path, name: str) -> None:
    how = tilted()
    path = machine(
        tmp_path, how["calibration"], how.get("curves"), controller=name, increment_mm=1e-4, tables=TRUE_ZERO
    )
    messages = [f.message for f in olp.correct(HOLES[name].encode(), path).findings if f.code == "OLP105"]
    assert len(messages) == 1
    option = "write their cycles out with --expand-cycles"
    assert messages[0].endswith(option) == DIALECTS[name].expands_cycles


@pytest.mark.parametrize("name", [name for name, each in DIALECTS.items() if each.unroller is not None])
def test_a_dialect_says_whether_its_unroller_writes_cycles_out(name: str) -> None:
    dialect = DIALECTS[name]
    assert dialect.unroller is not None
    try:
        dialect.unroller(b"", dialect, expand_cycles=True)
    except OlpError as error:
        assert dialect.expands_cycles == ("leave --expand-cycles out" not in str(error))
    else:
        assert dialect.expands_cycles
