"""Programs re-timed as a user would, and judged: random ones, those shipped, and LinuxCNC's samples."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from cases.fast import left_to_a_campaign
from fuzz import retime as retime_fuzz
from judge import linuxcnc
from workflows.test_correct_by_interpreter import samples, spacious
from workflows.test_programs_folder import FOLDER, JOBS

import olp
from olp.core.errors import ProgramError

#: Programs whose motion takes long to plan and judge.
LONG = (
    "gantry-plate/plate.ngc", "haas-mill/manifold.nc", "nasty/cycles.ngc", "nasty/g91-steps.ngc",
    "table-router/drill.ngc", "table-router/front.ngc", "table-router/outline.ngc",
)  # fmt: skip


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> olp.Setup:
    return retime_fuzz.setup(tmp_path_factory.mktemp("fuzz"))


def faults(seeds: Iterable[int], base: olp.Setup) -> dict[int, tuple[str, ...]]:
    wrong_by_seed = {seed: retime_fuzz.outcome(seed, base).wrong for seed in seeds}
    return {seed: wrong for seed, wrong in wrong_by_seed.items() if wrong}


@pytest.mark.slow
def test_random_programs_keep_every_limit(base: olp.Setup) -> None:
    # three whose optimum once ran out of digits
    assert faults([*range(3), 13, 323, 331], base) == {}


@pytest.mark.campaign
def test_random_programs_keep_every_limit_at_length(base: olp.Setup) -> None:
    """More of them: tests/fuzz/fuzz_retime.py."""
    assert faults([*range(3, 8), *range(100, 125)], base) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(JOBS, LONG))
def test_shipped_programs_and_their_corrections_keep_every_limit(name: str) -> None:
    path = FOLDER / name
    machine, job = path.with_name("machine.toml"), path.with_name(JOBS[name])
    setup = olp.load_setup(machine, job)
    try:
        text = olp.correct(path, machine, job).data
    except ProgramError as refusal:
        assert refusal.line is not None
        text = path.read_bytes()
    # the correction has all moves of its program
    assert retime_fuzz.judged(text, setup).wrong == ()


@pytest.mark.oracle
@pytest.mark.slow
def test_samples_of_linuxcnc_keep_every_limit(tmp_path: Path) -> None:
    """Unrolled, and those that LinuxCNC itself interprets then; a refusal names its line."""
    path = spacious(tmp_path, (0.0, 0.0, 0.0))
    setup = olp.load_setup(path, path.with_name("job.toml"))
    done, wrong = 0, {}
    for sample in samples()[::4]:
        try:
            flat = olp.flatten(sample, path)
            linuxcnc.interpret(flat, path, find_known=False)
            verdict = retime_fuzz.judged(flat, setup)
        except linuxcnc.InterpreterError:
            continue
        except ProgramError as refusal:
            assert refusal.line is not None or refusal.code == "OLP501", sample.name
            continue
        done += bool(verdict.verdicts)
        if verdict.wrong:
            wrong[sample.name] = verdict.wrong
    assert wrong == {}
    assert done >= 3
