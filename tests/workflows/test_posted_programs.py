"""Programs of posts and slicers, end to end: corrected on a machine with errors, unchanged without."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.fast import some_fast
from cases.posted import CONTROLS, FOLDER, UNROLLED, recipe
from judge import machines

import olp
from olp.core.machine import Setup
from olp.files.config import load_setup

#: Files that feed right behind G28.
PRIMED = frozenset({"prusaslicer-mk3s.gcode"})
#: Controls whose programs name their dialect in the job.
NAMED = frozenset({"siemens-iso"})
#: Where the axes are at the start of programs that store that place.
START = "start_mm = { X = 0.0, Y = 0.0, Z = 50.0 }\n"


def with_start(machine: Path, control: str) -> Setup:
    job = machine.with_name("job.toml")
    # the ending of these files is that of another language of the control
    named = f'dialect = "{control}"\n' if control in NAMED else ""
    job.write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{named}{START}')
    return load_setup(machine, job)


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, bool], Setup]:
    made = {}
    for control in set(CONTROLS.values()):
        folder = tmp_path_factory.mktemp(control)
        made[control, False] = with_start(
            machines.random_machine(folder / "bent", 5, recipe(control)), control
        )
        made[control, True] = with_start(machines.zero_machine(folder / "zero", recipe(control)), control)
    return made


def test_each_file_has_its_control() -> None:
    assert {path.name for path in FOLDER.iterdir()} == set(CONTROLS)


@pytest.mark.slow
@pytest.mark.parametrize("name", some_fast(CONTROLS, 3))
def test_a_posted_program_is_corrected(name: str, setups: dict[tuple[str, bool], Setup]) -> None:
    bent = setups[CONTROLS[name], False]
    result = olp.correct(FOLDER / name, bent, flatten=name in UNROLLED)
    assert result.report["moves"]["refused"] == 0
    assert result.report["moves"]["corrected"] > 0
    if name in PRIMED:
        # no move states where the line that primes the nozzle begins
        assert "OLP306" in {finding.code for finding in result.findings}
        return
    # the digit of an inch program is 2.5 um
    assert result.report["deviation"]["path_max_um"] < (3.0 if "inch" in name else 1.5)


@pytest.mark.parametrize("name", some_fast(sorted(set(CONTROLS) - UNROLLED), 3))
def test_without_errors_nothing_changes(name: str, setups: dict[tuple[str, bool], Setup]) -> None:
    text = (FOLDER / name).read_bytes()
    assert olp.correct(text, setups[CONTROLS[name], True]).data == text
