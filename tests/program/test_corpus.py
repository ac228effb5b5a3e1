"""Real programs from the survey: judged where LinuxCNC reads them, and under profiles of other controls."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import allowed_um, judged
from judge import linuxcnc, machines
from judge.machines import Recipe

import olp
from olp.core.errors import OlpError

pytestmark = pytest.mark.corpus

PROFILE_OF = {"gcode_cncjs": "grbl", "gcode_fanuc": "fanuc", "gcode_fanuc_haas_nist": "haas"}
FAMILY = ("linuxcnc", "grbl", "fanuc", "haas")


def programs(corpus: Path, folder: str) -> list[Path]:
    return sorted(path for path in (corpus / folder).iterdir() if path.is_file())


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Path]]:
    """A big smooth machine for each control, with tools 1 to 30, and a job that says where the axes start."""
    by_dialect = {}
    for folder, controller in PROFILE_OF.items():
        recipe = Recipe(
            controller=controller,
            travel=((-3000.0, 3000.0),) * 3,
            tools={n: {"Z_mm": 100.0 + n, "radius_mm": 3.0} for n in range(1, 31)},
            work_offsets={
                f"G{n}": {"X_mm": 5.0 * (n - 54), "Y_mm": 2.0, "Z_mm": -200.0, "set_by": "true"}
                for n in range(54, 60)
            },
        )
        machine = machines.random_machine(tmp_path_factory.mktemp(folder), 5, recipe)
        if folder == "gcode_fanuc":
            # these were written for calculator input: `X0Y50` is beside `X50.Y0`
            text = machine.read_text()
            machine.write_text(text.replace('decimal_point = "increment"', 'decimal_point = "calculator"'))
        job = machine.with_name("job.toml")
        start = "start_mm = { X = 0.0, Y = 0.0, Z = 100.0 }\n"
        job.write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{start}')
        by_dialect[folder] = (machine, job)
    return by_dialect


def everything(corpus: Path) -> list[Path]:
    return sorted(path for path in corpus.glob("*/*") if path.is_file() and path.stat().st_size < 100_000)


@pytest.mark.slow
@pytest.mark.parametrize("controller", FAMILY)
def test_no_text_of_any_dialect_crashes(corpus: Path, tmp_path: Path, controller: str) -> None:
    """Robot languages and part descriptions under a G-code profile are refused, or stay unchanged."""
    setup = olp.load_setup(machines.shift_machine(tmp_path, recipe=Recipe(controller=controller)))
    for path in everything(corpus)[FAMILY.index(controller) :: len(FAMILY)]:
        try:
            olp.correct(path, setup)
        except OlpError as refusal:
            assert isinstance(refusal, OlpError)
            assert str(refusal)


@pytest.mark.oracle
def test_the_judge_agrees_where_it_reads(corpus: Path, setups: dict[str, tuple[Path, Path]]) -> None:
    wrong, compared = [], 0
    for folder, (machine, job) in setups.items():
        for path in programs(corpus, folder):
            nominal = path.read_bytes()
            if folder == "gcode_cncjs":
                nominal = b"G17 G21 G90 G94 G0\n" + nominal
            if len(nominal) > 1_000_000 or b"G28" in nominal or b"O0" in nominal:
                continue
            try:
                result = olp.correct(nominal, machine, job, expand_cycles=True)
            except OlpError:
                continue
            moves = result.report["moves"]
            assert moves["corrected"] + moves["approximated"] + moves["passed"] == moves["total"]
            interpreter = {"start_mm": (0.0, 0.0, 100.0), "find_known": False}
            if not linuxcnc.accepts(nominal, machine.parent, start_mm=(0.0, 0.0, 100.0)):
                continue
            uncorrected = tuple(
                line for f in result.findings if f.code in ("OLP102", "OLP306") for line in f.lines
            )
            errors = judged(
                nominal, result.data, machine.parent, skip_lines=uncorrected, interpreter=interpreter
            )
            compared += 1
            bar = allowed_um(nominal) + 0.02
            if errors.max_um > bar or errors.vertex_max_um > bar:
                wrong.append((path.name, errors.max_um, errors.vertex_max_um, errors.worst_line))
    assert not wrong
    assert compared >= 4
