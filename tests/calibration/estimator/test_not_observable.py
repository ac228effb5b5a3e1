"""What a fit reports as not observable is so by the ranks of the judge, for all chains; and readings with a
forgotten unknown of an instrument do not fit."""

from __future__ import annotations

import dataclasses
from itertools import permutations

import numpy as np
import pytest
from calibration.observations.test_instruments import (
    CENTRE,
    TOOL_MM,
    circles_of,
    diagonals_of,
    messages_of,
    no_square,
)
from cases.calibration import case, cloud, two_pods
from cases.fast import left_to_a_campaign, some_of_a_campaign
from judge import nullspace, simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.summary import (
    scale_unobservable,
    scales_open,
    squareness_unobservable,
    unobservable,
)
from olp.calibration.observations.measurements import Measurements

ORDERS = ["".join(order) for order in permutations("XYZ")]
CHAINS = [order[:k] + "F" + order[k:] for k in range(4) for order in ORDERS]
#: Every order of the axes, and with another position of the workpiece in a campaign.
EACH = left_to_a_campaign(
    (CHAINS[k] for k in (0, 7, 14, 21, 4, 11, 18, 1, 8, 15, 22, 5)),
    [CHAINS[k] for k in (18, 1, 8, 15, 22, 5)],
)
TOOLS_OF = {
    "one offset": [(30.0, 20.0, 9.0)],
    "collinear": [(0.0, 0.0, -80.0), (0.0, 0.0, -400.0), (0.0, 0.0, -250.0)],
    "three": list(simulated.OFFSETS),
}


def test_these_are_all_chains() -> None:
    assert len(set(CHAINS)) == 24
    assert {chain.values[0].replace("F", "") for chain in EACH if not chain.marks} == set(ORDERS)


def angles(names: set[str]) -> set[str]:
    return {name for name in names if name[1] in "ABC" and name[0] == "E"}


@pytest.mark.slow
@pytest.mark.parametrize("chain", EACH)
@pytest.mark.parametrize("offsets", TOOLS_OF)
def test_angles_that_offsets_of_the_reflector_hide(chain: str, offsets: str) -> None:
    machine = simulated.machine(1, "smooth", chain)
    points = cloud(machine, 1, 200, 5.0, TOOLS_OF[offsets])
    axis, tool = points.axis_mm, points.tool_mm
    table, names = nullspace.columns(chain, lambda m: m.error(axis, tool).ravel())
    changes = nullspace.open_changes(table, nullspace.frame(axis + tool))
    hidden = nullspace.open_names(changes, names)
    assert len(changes) == 4 * len(angles(hidden))
    assert len(changes) in {"one offset": (16,), "collinear": (4, 8), "three": (0,)}[offsets]
    fitted = fit(Measurements("m", (points,)), chain)
    reported = set(unobservable(fitted))
    assert reported == angles(hidden)
    words = {"one offset": "one offset", "collinear": "on one line", "three": ""}[offsets]
    assert all(words in message for message in messages_of(fitted, "OLP801"))


def open_scales(changes: np.ndarray, names: list[str]) -> np.ndarray:
    """Open changes of the scales of X, Y, Z, each with a largest part of 1."""
    spans = [high - low for low, high in simulated.BOX]
    first = np.stack(
        [changes[:, names.index(n)] / s for n, s in zip(("EXX", "EYY", "EZZ"), spans, strict=True)]
    )
    axes, size, _ = np.linalg.svd(first * 3000.0 / np.abs(changes).max())
    rows = axes[:, : int((size > 1e-7).sum())].T
    return np.stack([row / row[np.argmax(np.abs(row))] for row in rows])


def directions(machine: simulated.Machine, axis: np.ndarray, tool: np.ndarray) -> np.ndarray:
    """Azimuths and elevations from both pods, upright."""
    angles_of_pods = []
    for pod in np.array(simulated.PODS):
        x, y, z = (axis + tool + machine.error(axis, tool) - pod).T
        angles_of_pods += [np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]
    return 1e6 * np.concatenate(angles_of_pods)


def of_poses(tip: np.ndarray) -> np.ndarray:
    """What shifts and turns of each pod do to its angles, by differences."""
    columns = []
    for k, pod in enumerate(np.array(simulated.PODS)):
        for unknown in range(6):
            sides = []
            for sign in (1.0, -1.0):
                ray = tip - pod
                if unknown < 3:
                    ray = ray - sign * 0.1 * np.eye(3)[unknown]
                else:
                    ray = ray + sign * np.cross(1e-5 * np.eye(3)[unknown - 3], ray)
                x, y, z = ray.T
                sides.append(np.concatenate([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]))
            column = np.zeros((2, 2 * len(tip)))
            column[k] = sides[0] - sides[1]
            columns.append(column.ravel() * 1e6)
    return np.stack(columns, axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("chain", EACH)
def test_angles_alone_leave_the_scale_open(chain: str) -> None:
    """Beside what one offset hides there is one open change more without a distance, and it stretches all
    three axes alike."""
    machine = simulated.machine(1, "smooth", chain)
    pods = two_pods(machine, 1, 400, [(0.0, 0.0, 0.0)])
    axis, tool = pods.axis_mm, pods.tool_mm
    table, names = nullspace.columns(chain, lambda m: directions(m, axis, tool))
    changes = nullspace.open_changes(table, of_poses(axis + tool))
    (stretch,) = open_scales(changes, names)
    assert stretch == pytest.approx([1.0, 1.0, 1.0], abs=1e-3)
    assert len(changes) == 17
    free = fit(Measurements("m", (dataclasses.replace(pods, baselines=()),)), chain)
    known = fit(Measurements("m", (pods,)), chain)
    assert scale_unobservable(free) is not None and scale_unobservable(known) is None
    (change,) = scales_open(free)[0]
    assert change == pytest.approx([1.0, 1.0, 1.0], abs=0.15)
    assert len(messages_of(free, "OLP809")) == 1 and not messages_of(known, "OLP809")


@pytest.mark.slow
@pytest.mark.parametrize("chain", EACH)
def test_four_diagonals_leave_the_differences_of_scales_open(chain: str) -> None:
    """Of three scales and three values of squareness four diagonals determine four: the squareness, and one
    combination of scales."""
    machine = simulated.machine(1, "smooth", chain)
    lines = diagonals_of(machine, 1)

    def reading(m: simulated.Machine) -> np.ndarray:
        parts = []
        for d in lines:
            axis = np.array(d.start_mm) + d.distance_mm[:, None] * d.unit
            parts.append(m.error(axis, np.array(TOOL_MM)) @ d.unit)
        return np.concatenate(parts)

    table, names = nullspace.columns(chain, reading)
    first = [names.index(name) for name in ("EXX", "EYY", "EZZ", *nullspace.SQUARE)]
    zeros = np.kron(np.eye(4), np.ones((len(lines[0].value), 1)))
    changes = nullspace.open_changes(table[:, first], zeros)
    assert len(changes) == 2
    assert np.abs(changes[:, 3:]).max() < 1e-6 * np.abs(changes).max()
    fitted = fit(Measurements("m", lines), chain)
    assert not squareness_unobservable(fitted)
    reported, (seen,) = scales_open(fitted)
    assert len(reported) == 2
    # what is not observable is at right angles to the combination that is
    rows = changes[:, :3] / [high - low for low, high in simulated.BOX]
    expected = np.linalg.svd(rows)[2][2]
    assert abs(seen @ expected) / np.linalg.norm(seen) > 0.97
    (message,) = messages_of(fitted, "OLP809")
    assert "only one combination is observable" in message


@pytest.mark.slow
@pytest.mark.parametrize("chain", EACH)
def test_a_ball_bar_in_one_direction_does_not_determine_squareness(chain: str) -> None:
    machine, measurements = case(2, "smooth", chain)
    bare = no_square(measurements)
    for both, closed in ((False, 0), (True, 3)):
        runs = circles_of(machine, 2, both=both)
        seen = 0
        for circle, square in zip(runs, ("C0Y", "A0Z", "B0Z"), strict=True):
            i, j = ("XYZ".index(letter) for letter in circle.plane)
            outward = np.zeros((len(circle.angle_rad), 3))
            outward[:, i], outward[:, j] = np.cos(circle.angle_rad), np.sin(circle.angle_rad)
            axis = np.array(CENTRE) + circle.radius_mm * outward
            one = nullspace.blank(chain)
            one.square[square] = 1e-6
            column = (one.error(axis, np.array(TOOL_MM)) * outward).sum(axis=1)
            own = [np.ones(len(axis)), outward[:, i], outward[:, j]]
            own.append(circle.direction * np.sin(2.0 * circle.angle_rad))
            seen += 1 - len(nullspace.open_changes(column[:, None], np.stack(own, axis=1)))
        assert seen == closed
        fitted = fit(bare.also(runs), chain)
        assert len(squareness_unobservable(fitted)) == 3 - closed


# -- forgotten nuisances ---------------------------------------------------------------------------------


def forgotten(kind: str, seed: int) -> tuple[Measurements, Measurements]:
    """Readings with something forgotten, and the same with it stated."""
    machine, lines = case(seed, "smooth", "FXYZ")
    if kind == "a tracker that was moved":
        first = cloud(machine, seed, 60, 5.0)
        # each point is read twice, the second time with the tracker 30 um aside
        joined = dataclasses.replace(
            first,
            axis_mm=np.tile(first.axis_mm, (2, 1)),
            tool_mm=np.tile(first.tool_mm, (2, 1)),
            measured_mm=np.concatenate([first.measured_mm, first.measured_mm + np.array([0.03, 0.0, 0.0])]),
            row=np.arange(120),
        )
        halves = [
            dataclasses.replace(
                first, axis_mm=joined.axis_mm[part], tool_mm=joined.tool_mm[part],
                measured_mm=joined.measured_mm[part], row=joined.row[part],
            )
            for part in (slice(0, 60), slice(60, 120))
        ]  # fmt: skip
        return Measurements("m", (joined,)), Measurements("m", tuple(halves))
    if kind == "the error of a square":
        tilted = [
            dataclasses.replace(line, value=line.value + 60e-6 * line.target_mm)
            if line.component == "EXY"
            else line
            for line in lines.lines
        ]
        all_in = lines.with_lines(tilted).also((cloud(machine, seed, 120, 5.0),))
        honest = [
            dataclasses.replace(square, sigma_rad=100e-6) if square.name == "SXY" else square
            for square in lines.squares
        ]
        return all_in, dataclasses.replace(all_in, squares=tuple(honest))
    (circle, *rest) = circles_of(machine, seed)
    # its readings are 30 % too large
    wrong = dataclasses.replace(circle, value=1.3 * circle.value)
    return (
        lines.also((wrong, *rest)),
        lines.also((circle, *rest)),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["a tracker that was moved", "the error of a square", "the scale of a ball-bar"]
)
@pytest.mark.parametrize("seed", some_of_a_campaign(range(2), 2))
def test_what_was_forgotten_does_not_fit(kind: str, seed: int) -> None:
    bad, good = forgotten(kind, seed)
    assert messages_of(fit(bad, "FXYZ"), "OLP808") or messages_of(fit(bad, "FXYZ"), "OLP802")
    assert not messages_of(fit(good, "FXYZ"), "OLP808")
