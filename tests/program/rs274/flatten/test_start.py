"""Positions before the first move, from the job: against LinuxCNC's interpreter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.unrolling import flatten, refused
from judge import linuxcnc, machines
from judge.machines import Recipe

from olp.core.machine import Setup
from olp.files.config import load_setup

OFFSETS = {
    "G54": {"X_mm": 1.0, "Y_mm": -2.0, "Z_mm": -50.0, "set_by": "true"},
    "G55": {"X_mm": 30.0, "Z_mm": 5.0, "set_by": "true"},
    "G56": {"C_deg": 30.0, "set_by": "true"},
}
START = (11.0, 22.0, 33.0)
KNOWN = (
    "G21 G90 G54\nG0 X#<_x> Y[#<_y>+1] Z[#<_z>+2]\n",
    "G20\nG0 Z[#<_z>+1]\nX[#<_x>+1]\n",
    "G55 G21\nG0 X[#5420+1]\nY#5421\nZ[#<_z>-1]\n",
    "G21 G55\nG0 Z[#<_z>]\nG54 X1\nY[#<_y>*2]\n",
    "G21 G91\nG0 X1\nG90 Y[#<_y>*2]\n",
    "G21 G49\nG4 P1\nG0 X[#<_z>]\n",
    "G21 G98 G81 X1 Y2 Z-1 R1\nX3\nG80\n",
)
UNKNOWN = (
    "G21 G91\nG0 X1\nG55 G90\nG0 Y#<_x>\n", "G21 G90\nG5 X20 Y30 I1 P1 J1 Q1\nG55\nG0 Z#<_x>\n",
    "G21\nT1 M6\nG0 Z#<_x>\n", "G21\nG43 H1\nG0 Y#<_x>\n", "G21\nG92 Y0\nG0 Y#<_x>\n",
    "G21\nG52 X4\nG0 Y#<_x>\n", "G21\nG10 L2 P1 X5\nG0 Y#<_x>\n", "G21\nG53 G0 X5\nY#<_x>\n",
    "G21 G56\nG0 Y#<_x>\n", "G21\n@5 ^90\nG55\nZ#<_x>\n", "G21 G90\nG41\nG0 Y#<_x>\n",
    "G21\n/G0 X5\nG55\nG0 Y#<_x>\n", "G21 G91 G81 X1 Y1 Z-1 R1\nG80\nG55\nG0 Y#<_x>\n",
)  # fmt: skip


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Setup]:
    machine = machines.zero_machine(tmp_path_factory.mktemp("m"), Recipe(work_offsets=OFFSETS))
    job = machine.with_name("job.toml")
    place = ", ".join(f"{axis} = {value}" for axis, value in zip("XYZ", START, strict=True))
    job.write_text(f'schema = "olp-job-1"\nmachine = "{machine.name}"\nstart_mm = {{ {place} }}\n')
    return machine, load_setup(machine, job)


@pytest.mark.oracle
@pytest.mark.parametrize("text", KNOWN)
def test_the_interpreter_is_at_the_same_place(text: str, setup: tuple[Path, Setup]) -> None:
    machine, stated = setup
    source = f"{text}M2\n".encode()
    plain = bytes(flatten(source, profile="linuxcnc", setup=stated, expand_cycles=True))
    theirs, own = (
        linuxcnc.interpret(each, machine, find_known=False, start_mm=START).axis for each in (source, plain)
    )
    np.testing.assert_allclose(own, theirs, atol=1e-6)


@pytest.mark.parametrize("text", UNKNOWN)
def test_it_is_not_known_where_something_may_have_moved_it(text: str, setup: tuple[Path, Setup]) -> None:
    code, message, _ = refused(f"{text}M2\n", setup=setup[1], block_delete=None)
    assert (code, message[:31]) == ("OLP524", "the position of X is needed her")


def test_it_is_that_of_linuxcnc_alone(setup: tuple[Path, Setup]) -> None:
    assert refused("O1\nG21\nG0 Y#5001\nM30\n", "fanuc", setup=setup[1])[0] == "OLP524"
