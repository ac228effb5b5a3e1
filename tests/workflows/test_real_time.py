"""A machine whose control corrects in real time: nothing is left there, and nothing is corrected twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import machines
from judge.machines import Recipe

import olp
from olp.core.errors import AlreadyCorrected, ConfigError, ProgramError
from olp.files.starter import machine_toml
from olp.workflows.session import Session

PROGRAM = b"G21 G90 G94 G54 G43 H1\nG0 X0 Y0 Z0\nG0 X5 Y5 Z5\nG1 X50 Y40 Z-3 F500\nG1 X10 Y0\nM2\n"


pytestmark = pytest.mark.slow


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    return machines.random_machine(tmp_path / "m", 4, Recipe(backlash_um={"X": 6.0}))


def state(machine: Path, digest: str) -> None:
    machine.write_text(f'real_time = "{digest}"\n{machine.read_text()}')


def digest_of(machine: Path) -> str:
    return Session.start(machine).loaded("hold").digest


def test_nothing_is_left_on_a_machine_that_corrects_itself(machine: Path, tmp_path: Path) -> None:
    place = (700.0, 100.0, -50.0)
    before, digest = olp.error_at(machine, place)["error_um"], digest_of(machine)
    exported = olp.export_table(machine, "c", tmp_path / "model.c")
    assert exported.report["real_time"] == digest[:12]
    state(machine, digest[:12])
    assert np.abs(before).max() > 1.0
    assert not olp.error_at(machine, place)["error_um"].any()
    assert digest_of(machine) == digest
    # and the code for it is written as before
    assert olp.export_table(machine, "c", tmp_path / "model.c").files == exported.files


def test_a_program_is_corrected_by_one_of_the_two(machine: Path) -> None:
    corrected, digest = olp.correct(PROGRAM, machine).data, digest_of(machine)
    state(machine, digest)
    with pytest.raises(AlreadyCorrected, match="both would apply the model twice") as error:
        olp.check(corrected, machine)
    assert error.value.line == 1
    for verb in (olp.correct, olp.simulate):
        with pytest.raises(AlreadyCorrected):
            verb(corrected, machine)
    # for this machine the program stays as it is, and says so
    left = olp.correct(PROGRAM, machine)
    stamp, rest = left.data.split(b"\n", 1)
    assert stamp.startswith(f"(olp-real-time {digest[:12]} olp ".encode()) and rest == PROGRAM
    assert olp.correct(left.data, machine).data == left.data
    assert olp.check(left.data, machine).report["verdict"]["ok"]
    # and the machine does not take it once its control does not correct
    machine.write_text(machine.read_text().split("\n", 1)[1])
    for verb in (olp.correct, olp.check, olp.simulate):
        with pytest.raises(ProgramError, match="needs a control that corrects by this calibration") as other:
            verb(left.data, machine)
        assert other.value.line == 1


@pytest.mark.parametrize("other", ["0" * 12, "abc"])
def test_a_control_with_another_calibration_is_refused(machine: Path, other: str) -> None:
    state(machine, other)
    with pytest.raises(ConfigError, match="expected the same; export it again"):
        olp.simulate(PROGRAM, machine)


def test_the_file_of_the_machine_keeps_it(machine: Path) -> None:
    state(machine, digest_of(machine)[:12])
    assert f'real_time = "{digest_of(machine)[:12]}"' in machine_toml(olp.load_setup(machine).machine)
