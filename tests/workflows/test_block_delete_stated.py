"""The switch of block delete as the job file states it: unrolled programs are those of this position."""

from __future__ import annotations

from pathlib import Path

import pytest
from judge import machines
from judge.machines import Recipe

import olp
from olp.core.errors import ProgramError, UsageError
from olp.core.machine import Setup
from olp.files.config import load_setup

#: A part at each place; the second one is left out for short stock, and so is the move of the second row.
PARTS = """O10
G21 G90 G17 G54
G0 X0. Y0. Z50.
M98 P20
/G52 X40. Y0. Z0.
 /M98 P20
/2 G52 X0. Y0. Z0.
G0 X-10.
M30
O20
/1 M98 P30
G1 X5. Y5. F500.
M99
O30
G1 Z1. F100.
M99
"""
ON = ["G1 X5. Y5. F500.", "G0 X-10."]
OFF = [
    "G1 Z1. F100.", "G1 X5. Y5. F500.", "G52 X40. Y0. Z0.", "G1 Z1. F100.", "G1 X5. Y5. F500.",
    "G52 X0. Y0. Z0.", "G0 X-10.",
]  # fmt: skip


def stated(folder: Path, switch: str, control: str = "fanuc") -> Setup:
    recipe = Recipe(controller=control, travel=((-500.0, 500.0),) * 3)
    job = folder / "job.toml"
    job.write_text(f'schema = "olp-job-1"\nstart_mm = {{ X = 0.0, Y = 0.0, Z = 50.0 }}\n{switch}\n')
    return load_setup(machines.zero_machine(folder, recipe), job)


@pytest.mark.parametrize(("switch", "blocks"), [("on", ON), ("off", OFF)])
def test_an_unrolled_program_is_that_of_the_stated_switch(
    switch: str, blocks: list[str], tmp_path: Path
) -> None:
    setup = stated(tmp_path, f'block_delete = "{switch}"')
    flat = [line for line in olp.flatten(PARTS.encode(), setup).decode().splitlines() if line]
    assert flat[3:-1] == blocks
    result = olp.correct(PARTS.encode(), setup, flatten=True)
    assert result.report["deviation"]["holds"]
    # lines are those of the file
    with pytest.raises(ProgramError) as caught:
        olp.correct(PARTS.replace("G0 X-10.", "G12 X-10.").encode(), setup, flatten=True)
    assert caught.value.line == 8


def test_without_it_both_positions_have_to_give_one_program(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match="state block_delete in the job file") as caught:
        olp.correct(PARTS.encode(), stated(tmp_path, ""), flatten=True)
    assert caught.value.code == "OLP525"


def test_sinumerik_takes_it_and_other_languages_say_that_they_do_not(tmp_path: Path) -> None:
    text = b"G71 G90 G17 G0 X0 Y0 Z50\n/R1=5\n/8 IF R1==5\nG1 X=R1 F100\n/8 ENDIF\nM30\n"
    setup = stated(tmp_path, 'dialect = "sinumerik"\nblock_delete = "off"', "sinumerik")
    assert b"\nG1 X=5 F100\n" in olp.flatten(text, setup)
    setup = stated(tmp_path, 'dialect = "heidenhain"\nblock_delete = "on"', "heidenhain")
    with pytest.raises(UsageError, match="block_delete of the job file is not read for"):
        olp.flatten(b"0 BEGIN PGM A MM\n1 L X+0 Y+0 Z+50 R0 FMAX\n2 END PGM A MM\n", setup)
