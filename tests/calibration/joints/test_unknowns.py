"""Which unknowns of a machine of any joints are kept, and how many each kind of reading shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration.joints.simulated import SIGMA, TOOL, read, true_machine

from olp.calibration.joints.adjustment import fit_joints
from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.readings import FREE, Ball, Planes, Reading
from olp.calibration.joints.unknowns import Model, model_of
from olp.core.arrays import Array
from olp.core.rigid_fit import rotation_of
from olp.kinematics.chain import Kinematics
from olp.kinematics.poses import Poses

#: By golden case: 4 for each rotary joint, 2 for each linear one, and what legs show.
KEPT = {
    "arm_6r_kr6": 24, "arm_7r_on_track": 30, "gantry_nutating": 14, "gantry_wrist": 14, "hexapod": 36,
    "linear_delta": 24, "linuxcnc_puma560": 24, "polar_rppr": 12, "scara": 14, "tripod": 9,
    "xyzac_trunnion": 14, "xyzbc_head_table": 14,
}  # fmt: skip
#: These take their time.
PLATFORMS = ("hexapod", "linear_delta")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in PLATFORMS else ()) for name in KEPT]
)
def test_as_many_unknowns_are_kept_as_the_structure_shows(name: str) -> None:
    assert len(true_machine(name)[0].unknowns) == KEPT[name]


def test_a_trunnion_keeps_the_names_of_iso_230() -> None:
    names = [unknown.name for unknown in true_machine("xyzac_trunnion")[0].unknowns]
    assert names[:3] == ["Y.C_urad", "Z.B_urad", "Z.A_urad"]
    assert names[3:8] == ["A.Y_um", "A.Z_um", "A.B_urad", "A.C_urad", "A.zero_urad"]
    assert names[8:11] == ["C.X_um", "C.Y_um", "C.B_urad"]


def test_what_is_dropped_changes_no_pose_beside_a_frame() -> None:
    """A machine with errors of all unknowns, also of those that are dropped, is fitted without them."""
    model, _, values = true_machine("arm_6r_kr6", count=50)
    everything = replace(model, unknowns=(*model.unknowns, *model.dropped), dropped=())
    assert len(everything.unknowns) == 36
    theta = 1e-3 * np.random.default_rng(3).normal(0.0, everything.prior)
    pose = everything.machine(theta).actual(values)
    fit = fit_joints(model, [read("poses", pose, values, noise=0.0)])
    (source,) = fit.sources
    assert source.off_mm.max() < 1e-5


def spread(seed: int = 0) -> tuple[Model, Poses, Array]:
    model, theta, values = true_machine("arm_6r_kr6", seed, 60)
    return model, model.machine(0.0 * theta).actual(values), values


@pytest.mark.parametrize(("kind", "nests", "rank"), [("points", 1, 21), ("points", 3, 24), ("poses", 1, 24)])
def test_ranks_of_an_arm(kind: str, nests: int, rank: int) -> None:
    model, pose, values = spread()
    assert fit_joints(model, [read(kind, pose, values, names=nests)]).determined == rank


def at_places(name: str, places: Array, size: float = 0.0) -> tuple[Model, Array, Reading]:
    """A machine tool whose nominal tip is on balls, its unknowns, and what a probe of true errors reads."""
    model, theta, values = true_machine(name, size=size)
    which = np.arange(len(values)) % len(places)
    machine = Kinematics(model.structure, tool_mm=TOOL)
    slides = [k for k, joint in enumerate(model.structure.joints.values()) if joint.kind == "linear"]
    for _ in range(3):
        miss = places[which] - machine.nominal(values).position
        slopes = machine.jacobian(values)[:, :3, slides]
        values[:, slides] += np.linalg.solve(slopes, miss[..., None])[..., 0]
    away = model.machine(theta).actual(values).at(np.array(TOOL)) - places[which]
    names = tuple(str(k) for k in range(len(places)))
    rows = np.arange(len(values))
    return model, theta, Ball("ball.csv", values, rows, TOOL, SIGMA, names, which, measured_mm=away)


BALLS = np.array(((50.0, 30.0, -100.0), (-80.0, 120.0, -60.0)))
#: Machines, balls, and how many of 14 unknowns they show (KINEMATICS 8).
ON_BALLS = [
    ("xyzac_trunnion", 1, 11), ("gantry_wrist", 1, 11),
    ("xyzbc_head_table", 1, 10), ("xyzbc_head_table", 2, 11),
]  # fmt: skip


@pytest.mark.parametrize(("name", "balls", "rank"), ON_BALLS)
def test_ranks_on_balls(name: str, balls: int, rank: int) -> None:
    model, _, reading = at_places(name, BALLS[:balls])
    assert fit_joints(model, [reading]).determined == rank
    # a probe of unknown length hides three more
    assert fit_joints(model, [replace(reading, tool_sigma=FREE)]).determined == rank - 3


@pytest.mark.slow
def test_a_machine_that_stands_askew_turns_what_a_ball_reads() -> None:
    """No structure shows the turn of its base beside a frame, so no unknown of the machine stands for it. A
    deviation of 10 mm is read 10 um aside where the base leans by 1 mrad."""
    model, _, reading = at_places("xyzac_trunnion", BALLS, 20.0)
    assert isinstance(reading, Ball) and 5.0 < np.abs(reading.measured_mm).max() < 60.0
    askew = reading.measured_mm @ rotation_of(np.array((8e-4, -5e-4, 6e-4))).T
    fit = fit_joints(model, [replace(reading, measured_mm=askew, sigma=1.5e-3)])
    assert fit.chi_square / fit.freedom < 0.05
    assert not fit.left_out


@pytest.mark.parametrize("name", ["xyzac_trunnion", "gantry_wrist"])
def test_readings_along_the_machine_are_those_along_the_workpiece(name: str) -> None:
    model, theta, reading = at_places(name, BALLS[:1], 1.0)
    assert isinstance(reading, Ball)
    straight = fit_joints(model, [reading]).theta
    nominal = model.machine(0.0 * theta).nominal(reading.values).rotation
    if name == "gantry_wrist":
        # nothing turns on the side of the workpiece
        again = fit_joints(model, [replace(reading, in_machine=True)]).theta
        assert again == pytest.approx(straight, abs=1e-9)
        return
    # the tool of this machine does not turn: its axes are those of the machine
    along = (np.swapaxes(nominal, -1, -2) @ reading.measured_mm[..., None])[..., 0]
    turned = replace(reading, measured_mm=along, in_machine=True)
    assert fit_joints(model, [turned]).theta == pytest.approx(straight, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("planes", "rank"), [(1, 18), (3, 20)])
def test_ranks_of_an_arm_on_planes(planes: int, rank: int) -> None:
    """21 of a tip, less three motions along a level plane; three planes leave the scale to be known."""
    model, _, values = spread()
    machine = Kinematics(model.structure, tool_mm=TOOL)
    random = np.random.default_rng(1)
    values = np.repeat(values, 3, axis=0) + random.uniform(-20.0, 20.0, (180, 6))
    which = np.arange(len(values)) % planes
    normals = np.eye(3)[::-1][which % 3]
    heights = np.array((500.0, 200.0, 300.0))[which]
    for _ in range(30):
        miss = heights - np.sum(machine.nominal(values).position * normals, axis=1)
        slopes = np.einsum("ni,nik->nk", normals, machine.jacobian(values)[:, :3])
        step = slopes * (miss / np.maximum(np.sum(slopes**2, axis=1), 1.0))[:, None]
        values = values + np.clip(np.degrees(step), -10.0, 10.0)
    met = np.abs(heights - np.sum(machine.nominal(values).position * normals, axis=1)) < 1e-9
    rows = np.arange(int(met.sum()))
    names = tuple(str(k) for k in range(planes))
    reading = Planes("p.csv", values[met], rows, TOOL, SIGMA, names, which[met])
    assert met.sum() > 120
    assert fit_joints(model, [reading]).determined == rank


def test_priors_of_a_machine_tool_are_smaller() -> None:
    arm, mill = (true_machine(name)[0].structure for name in ("arm_6r_kr6", "xyzac_trunnion"))
    assert Priors.of(arm).shift_mm > Priors.of(mill).shift_mm


def test_yield_is_an_unknown_where_it_is_asked_for() -> None:
    model, _, values = true_machine("arm_6r_kr6")
    asked = model_of(model.structure, values, Priors.of(model.structure), yielding=["J2"])
    assert asked.unknowns[-1].name == "J2.own_urad_Nm"
    assert len(asked.unknowns) == 25
