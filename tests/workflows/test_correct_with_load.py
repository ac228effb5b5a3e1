"""Bar: a payload on a simulated gantry beam, and random machines with map and load judged by LinuxCNC."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, allowed_um, judged, machine, points
from judge import machines, programs
from judge.beam import under_the_load
from judge.machines import Recipe

import olp

LENGTH, RAM = 3000.0, 1000.0
#: second moments in mm4 of beams that sag by some 60 um under 60 kg
SECTION = {"simple": 2.6e7, "fixed": 0.65e7}
TIP = (80.0, 150.0, -RAM)


class GantryBeam:
    """A carriage runs along Y on a beam of 3 m that rests on both ends (Y = -500 to 2500); the ram below it,
    out to the tip, is rigid. Where the tip really is, from the beam's deflection and slope by finite
    differences."""

    def __init__(self, support: str) -> None:
        self.support = support
        self.stiffness = 210e3 * SECTION[support]

    def added_mm(self, y_mm: float, mass_kg: float, z_mm: float) -> np.ndarray:
        deflection, slope = under_the_load(self.support, LENGTH, y_mm + 500.0, mass_kg, self.stiffness)
        # the carriage sits on the elastic line, which goes down by `slope` per mm of Y: a turn about X
        angle = -np.arctan(slope)
        arm = np.array([TIP[0], TIP[1], TIP[2] + z_mm])
        turned = [
            arm[0],
            np.cos(angle) * arm[1] - np.sin(angle) * arm[2],
            np.sin(angle) * arm[1] + np.cos(angle) * arm[2],
        ]
        return np.array(turned) - arm - [0.0, 0.0, deflection]


def measured(beam: GantryBeam, seed: int) -> str:
    """Sensitivities from a load of 40 kg at 13 places, read with 0.5 um and 1 urad, in the carriage."""
    rng = np.random.default_rng(seed)
    rows = ["Y_mm,EZY_um_kg,EAY_urad_kg"]
    for y in np.linspace(-400.0, 2400.0, 13):
        deflection, slope = under_the_load(beam.support, LENGTH, y + 500.0, 40.0, beam.stiffness)
        sag = -1e3 * deflection + rng.normal(0.0, 0.5)
        turn = -1e6 * slope + rng.normal(0.0, 1.0)
        rows.append(f"{y:.1f},{sag / 40.0:.5f},{turn / 40.0:.5f}")
    return "\n".join(rows) + "\n"


BOX = {"[[-1000.0, 2000.0], [-1000.0, 2000.0]": "[[-1000.0, 2000.0], [-400.0, 2400.0]"}
MEASURED = '[[compliance]]\nfile = "load.csv"\n'
BEAM = (
    '[[compliance_beam]]\naxis = "Y"\nsupport = "{}"\nspan_mm = [-500.0, 2500.0]\nyoungs_modulus_GPa = '
    "210.0\n"
    "second_moment_mm4 = {}\n"
)
TOOL = f"[tools.1]\nZ_mm = {RAM}\ngauge_to_tip_mm = [{TIP[0]}, {TIP[1]}, {TIP[2]}]\n"
TOOL += "[job_defaults]\ntool = 1\n"


@pytest.mark.parametrize("support", ["simple", "fixed"])
@pytest.mark.parametrize("known", ["measured", "beam"])
@pytest.mark.slow
def test_the_deflection_that_a_payload_adds_is_removed(tmp_path: Path, support: str, known: str) -> None:
    beam = GantryBeam(support)
    table = MEASURED if known == "measured" else BEAM.format(support, SECTION[support])
    path = machine(
        tmp_path, table, {"load.csv": measured(beam, 1)}, tables=TRUE_ZERO + TOOL, increment_mm=0.0001
    )
    calibration = path.with_name("calibration.toml")
    for old, new in BOX.items():
        calibration.write_text(calibration.read_text().replace(old, new))
    places = [(y, z) for y in np.linspace(-350.0, 2350.0, 10).tolist() for z in (-300.0, 0.0)]
    blocks = [f"G0 X0 Y{y} Z{z}" for y, z in places]
    body = [[f"(OLP PAYLOAD {mass} kg)", *blocks] for mass in (0, 30, 60)]
    source = "\n".join(["G21 G90 G54 G64 P0.001 Q0", "G0 X0 Y0 Z0", *itertools.chain(*body), "M2", ""])
    # the axis moves less than its beam was measured
    result = olp.correct(source.encode(), path, accept=["OLP452"])
    command = points(result.data)[1:]
    nominal = points(source.encode())[1:]
    masses = np.repeat([0.0, 30.0, 60.0], len(places))
    before, after = (
        np.array([c + beam.added_mm(c[1], m, c[2]) for c, m in zip(commands, masses, strict=True)]) - nominal
        for commands in (nominal, command)
    )
    np.testing.assert_array_equal(after[: len(places)], 0.0)
    for mass in (30.0, 60.0):
        rows = masses == mass
        added = np.sqrt((before[rows] ** 2).sum(axis=1).mean())
        residual = np.sqrt((after[rows] ** 2).sum(axis=1).mean())
        share = 1.0 - residual / added
        print(f"{support} {known} {mass:g} kg: {1e3 * added:.1f} -> {1e3 * residual:.2f} um, {share:.1%}")
        assert added > 0.015
        assert residual <= 0.05 * added
        assert np.linalg.norm(after[rows], axis=1).max() <= 0.05 * np.linalg.norm(before[rows], axis=1).max()
    virtual = olp.simulate(result.data, path, step_mm=1e4).points_mm
    assert np.abs(virtual[-1] - nominal[-1]).max() < 1e-4


def with_map_and_load(folder: Path, seed: int) -> Path:
    rng = np.random.default_rng(seed)
    path = machines.random_machine(folder, seed, Recipe(chain=str(rng.choice(machines.CHAINS))))
    machines.add_map_and_load(path, rng)
    return path


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(8))
def test_map_and_load_judged_by_the_control_and_an_independent_model(tmp_path: Path, seed: int) -> None:
    path = with_map_and_load(tmp_path, seed)
    features = ["lines", "short", "rapid", "arcs", "helix", "frames", "tools"][: 4 + seed % 4]
    nominal = programs.random_program(seed, features=features, blocks=6)
    result = olp.correct(nominal, path, tmp_path / "job.toml")
    verdict = judged(nominal, result.data, tmp_path)
    assert verdict.after.judged > 0
    assert verdict.max_um <= allowed_um(nominal) + 0.02, f"line {verdict.worst_line}"
    assert verdict.before.max_um > 20.0
    assert verdict.after.rms_um < 0.1 * verdict.before.rms_um
