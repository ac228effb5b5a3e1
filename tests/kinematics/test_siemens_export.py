"""Vectors of a Sinumerik control from a calibration: read back they are the axes as they lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.joint_machines import machine_file
from cli.test_cli import run

import olp
from olp.calibration.control_tables.residuals import UNCOMPENSATED
from olp.core.errors import ConfigError
from olp.files.kinematics.control_kinematics import as_it_lies
from olp.files.kinematics.load import load_joint_setup
from olp.files.kinematics.siemens_vectors import TABLES
from olp.files.kinematics.trafo import machine_of_trafo
from olp.kinematics.chain import Kinematics

FOLDER = Path(__file__).resolve().parents[2] / "programs"
CHAINS = {"P": "C A Y F X Z", "T": "F X Y Z C A", "M": "C F X Y Z B"}


@pytest.mark.slow
@pytest.mark.parametrize("key", [table.key for table in TABLES])
@pytest.mark.parametrize("kind", CHAINS)
def test_what_is_read_back_is_where_the_axes_lie(kind: str, key: str, tmp_path: Path) -> None:
    machine = machine_file(tmp_path, CHAINS[kind], control="sinumerik")
    setup = load_joint_setup(machine, None, by_itself=True)
    lies = as_it_lies(setup.kinematics.structure, setup.kinematics.errors)
    table = next(table for table in TABLES if table.key == key)
    text = table.enter(setup.kinematics.structure, setup.kinematics.errors).data
    assert (f'$TC_CARR23[1]="{kind}"' if key == "siemens-carr" else "$MC_TRAFO_TYPE_1=").encode() in text
    file = tmp_path / "vectors.ini"
    file.write_bytes(text)
    again = tmp_path / "again" / "machine.toml"
    again.parent.mkdir()
    again.write_bytes(machine_of_trafo(file, "again").data)
    other = olp.load_kinematics(again).structure
    turning = [name for name in lies.order if name not in "XYZ"]
    names = dict(zip(turning, turning, strict=True))
    if key == "siemens-trafo5":
        # a transformation does not name its axes: they are told by what they turn about
        names = {name: max(other.order, key=lambda o: _alike(lies, other, name, o)) for name in turning}
    values = np.random.default_rng(3).uniform(-40.0, 40.0, (50, len(lies.order)))
    theirs = np.zeros_like(values)
    for column, name in enumerate(lies.order):
        theirs[:, other.order.index(names.get(name, name))] = values[:, column]
    tool = (0.0, 0.0, -90.0)
    mine, read = (
        Kinematics(lies, tool_mm=tool).nominal(values),
        Kinematics(other, tool_mm=tool).nominal(theirs),
    )
    np.testing.assert_allclose(read.position, mine.position, atol=2e-6)
    np.testing.assert_allclose(read.rotation, mine.rotation, atol=1e-8)
    # and the old lines are others
    old = Kinematics(setup.kinematics.structure, tool_mm=tool).nominal(values)
    assert np.abs(old.position - mine.position).max() > 1e-3


def _alike(one: object, other: object, name: str, theirs: str) -> float:
    mine, read = one.joints[name], other.joints[theirs]  # type: ignore[attr-defined]
    return -1.0 if read.kind != "rotary" else float(np.dot(mine.direction, read.direction))


@pytest.mark.slow
def test_the_report_says_what_is_left() -> None:
    machine = FOLDER / "trunnion-mill" / "machine.toml"
    done = olp.export_table(machine, "siemens-carr", "c.ini")
    left = done.report["box"]["left"]
    before, after = (left[name]["rms_um"] for name in (UNCOMPENSATED, "siemens-carr"))
    # a machine with nothing but errors that vectors hold is left without any
    assert 0.0 < after < 0.5 * before
    assert any("the zero of A is off by 0.002578 deg" in note for note in done.notes)
    assert any("describe the machine once more" in note for note in done.notes)


def test_other_machines_are_refused(tmp_path: Path) -> None:
    for name, why in (("arm-payload", "with one or two rotary axes"), ("hexapod", "has a platform on legs")):
        with pytest.raises(ConfigError, match=why):
            olp.export_table(FOLDER / name / "machine.toml", "siemens-carr", tmp_path / "c.ini")
    done = run("calibrate", "export", "-m", str(FOLDER / "gantry-plate" / "machine.toml"), "--format",
               "siemens-carr", "-o", str(tmp_path / "c.ini"))  # fmt: skip
    assert done.exit_code == 2 and "this machine has none" in done.stderr
