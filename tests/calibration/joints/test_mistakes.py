"""Each mistake of readings of any joints is offered with the readings put right, and found with its size."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from calibration.joints.simulated import SIGMA, read, true_machine

from olp.calibration.joints.adjustment import fit_joints
from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.findings import fit_or_refuse, joint_findings
from olp.calibration.joints.mistakes import mistakes
from olp.calibration.joints.readings import Ball, Reading, SixD
from olp.calibration.joints.tools import other_tools
from olp.calibration.joints.unknowns import Model, model_of
from olp.calibration.joints.ways import by_way, ways_of
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.geometry import rotation_matrix


@cache
def small() -> tuple[Model, Array]:
    """A trunnion without errors, and postures."""
    model, _, values = true_machine("xyzac_trunnion", count=40)
    return replace(model, unknowns=(), known=None), values


def ball(model: Model, values: Array) -> Ball:
    """Readings of a ball that stands where the tip is at first, scattered by errors of 0.1 mm."""
    same = read("points", model.machine(np.zeros(0)).actual(values), values, names=1)
    off = np.random.default_rng(1).normal(0.0, 0.1, (len(values), 3))
    return Ball(
        same.source, values, same.row, same.tool_mm, 1.5e-3, ("1",), np.zeros(len(values), int),
        measured_mm=off,
    )  # fmt: skip


def scaled(factors: list[float]) -> Callable[[Reading], Reading]:
    return lambda one: replace(one, values=one.values * factors)


def swapped(field: str, columns: list[int]) -> Callable[[Any], Reading]:
    return lambda one: replace(one, **{field: getattr(one, field)[:, columns]})


DEG = float(np.degrees(1.0))
PLANTED: dict[str, tuple[str, Callable[[Any], Reading], str]] = {
    "columns of turns": ("points", swapped("values", [1, 0, 2, 3, 4]), "are in each other's columns"),
    "columns of slides": ("points", swapped("values", [0, 1, 4, 3, 2]), "are in each other's columns"),
    "all in radians": ("points", scaled([1 / DEG, 1 / DEG, 1, 1, 1]), "are in radians"),
    "turned to degrees twice": ("points", scaled([DEG, DEG, 1, 1, 1]), "57.3 times too large"),
    "one turned twice": ("points", scaled([DEG, 1, 1, 1, 1]), "is 57.3 times too large"),
    "all slides in inches": ("points", scaled([1, 1, *([1 / 25.4] * 3)]), "are in inches"),
    "columns of a ball": ("ball", swapped("measured_mm", [0, 2, 1]), "dY and dZ are in each other's columns"),
    "a sign of a ball": (
        "ball",
        lambda one: replace(one, measured_mm=one.measured_mm * (1.0, -1.0, 1.0)),
        "dY is of the other sign",
    ),
}


@pytest.mark.parametrize("what", PLANTED)
def test_readings_put_right_are_offered(what: str) -> None:
    kind, change, words = PLANTED[what]
    model, values = small()
    order = [*"ACXYZ"]
    columns = [model.structure.order.index(name) for name in order]
    back = np.argsort(columns)
    right = ball(model, values) if kind == "ball" else read(
        kind, model.machine(np.zeros(0)).actual(values), values
    )  # fmt: skip
    # factors and columns are those of A, C, X, Y, Z
    wrong = change(replace(right, values=right.values[:, columns]))
    wrong = replace(wrong, values=wrong.values[:, back])

    def same(mended: Reading) -> bool:
        return np.allclose(mended.values, right.values, rtol=1e-12) and np.allclose(
            getattr(mended, "measured_mm", 0.0), getattr(right, "measured_mm", 0.0), rtol=1e-12
        )

    told = [said for said, (mended,), _ in mistakes(model.structure, [wrong]) if same(mended)]
    assert any(words in said for said in told), told


def test_angles_of_a_target_in_radians_are_offered() -> None:
    model, values = small()
    right = read("poses", model.machine(np.zeros(0)).actual(values), values)
    assert isinstance(right, SixD)
    angles = np.random.default_rng(2).uniform(-80.0, 80.0, (len(values), 3))
    true, wrong = (
        np.stack([rotation_matrix((a, b, c)) for a, b, c in rows.tolist()])
        for rows in (angles, np.radians(angles))
    )
    found = {
        words: mended
        for words, (mended,), _ in mistakes(model.structure, [replace(right, measured_turn=wrong)])
    }
    mended = found["poses.csv: angles of the target are in radians"]
    assert isinstance(mended, SixD)
    assert np.allclose(mended.measured_turn, true, atol=1e-12)
    # angles beyond 3.15 degrees are none
    assert not any(
        "angles" in words for words, *_ in mistakes(model.structure, [replace(right, measured_turn=true)])
    )


def test_values_that_stop_short_are_found_with_their_size() -> None:
    """All axes come 0.03 deg or 0.05 mm short; the first posture, which nothing comes before, does not."""
    model, values = small()
    reading = read("points", model.machine(np.zeros(0)).actual(values), values)
    short = np.where([model.structure.joints[n].kind == "rotary" for n in model.structure.order], 0.03, 0.05)
    wrong = replace(reading, values=values - short * ways_of(values))
    ((words, (mended,), _),) = by_way(fit_joints(model, [wrong]), [wrong])
    assert np.abs(mended.values - values[1:]).max() < 0.02
    assert all(f"{name} by 0.0" in words for name in model.structure.order)
    # right values say nothing
    assert [*by_way(fit_joints(model, [reading]), [reading])] == []


def test_ways_are_kept_while_an_axis_stands() -> None:
    values = np.array(((0.0, 5.0), (1.0, 5.0), (1.0, 4.0), (0.5, 4.0)))
    assert ways_of(values).tolist() == [[0.0, 0.0], [1.0, 0.0], [1.0, -1.0], [-1.0, -1.0]]


def test_another_tool_is_found_with_its_vector() -> None:
    """In both files that state it."""
    model, values = small()
    right = read("points", model.machine(np.zeros(0)).actual(values), values)
    x, y, z = right.tool_mm
    wrong = [replace(right, tool_mm=(x, y, z - 10.0)), replace(right, tool_mm=(x, y, z - 10.0))]
    ((words, mended, _),) = other_tools(model, wrong, settles=True)
    assert all(np.allclose(one.tool_mm, right.tool_mm, atol=5.0 * SIGMA) for one in mended)
    assert "and not [30.0, -20.0, 90.0]; measure it" in words


def told(model: Model, readings: list[Reading]) -> Iterator[str]:
    for one in joint_findings(fit_joints(model, readings), readings):
        yield from [one.message] if one.code == "OLP810" else []


@pytest.mark.slow
def test_readings_of_a_ball_in_mm_are_told_though_they_fit_too_well() -> None:
    model, values = small()
    reading = replace(ball(model, 0.0 * values[:20]), sigma=0.1)
    (words,) = told(model, [replace(reading, measured_mm=1e-3 * reading.measured_mm)])
    assert "readings are in mm, not um" in words
    assert [*told(model, [reading])] == []


@pytest.mark.slow
def test_values_with_which_no_leg_closes_are_told() -> None:
    """A tripod whose legs are in inches: the model is that of the middle of its travel then."""
    model, _, values = true_machine("tripod", count=30)
    right = read("points", model.machine(np.zeros(len(model.unknowns))).actual(values), values)
    wrong = replace(right, values=values / 25.4)
    found = model_of(model.structure, wrong.values, Priors.of(model.structure))
    assert [one.name for one in found.unknowns] == [one.name for one in model.unknowns]
    with pytest.raises(ConfigError, match="are in inches"):
        fit_or_refuse(replace(found, unknowns=(), known=None), [wrong])
