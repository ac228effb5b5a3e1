"""What the forms of PLANE make of the coordinates, by hand and by another library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from olp.program.heidenhain.planes import Plane, plane_of
from olp.program.heidenhain.statements import of_lines


def plane(text: str, before: Plane | None = None) -> Plane:
    return plane_of(of_lines([text.encode()], 1), None if before is None else before.turn)


def test_the_normal_is_that_of_the_manual() -> None:
    turn = plane("PLANE SPATIAL SPA+45 SPB+0 SPC+90 STAY").turn
    assert np.array(turn)[:, 2] == pytest.approx([0.5**0.5, 0.0, 0.5**0.5])


@pytest.mark.parametrize("seed", range(3))
def test_forms_of_one_plane_are_one(seed: int) -> None:
    angles = np.random.default_rng(seed).uniform(-80, 80, 3)
    spatial = Rotation.from_euler("xyz", angles, degrees=True)
    matrix, turned = spatial.as_matrix(), spatial.as_euler("ZXZ", degrees=True)
    x, y, z = matrix.T
    points = [k * 7.0 for k in (x, 3 * x, x + y - 2 * x)]
    texts = [
        "SPATIAL " + " ".join(f"SP{k}{v:+.12f}" for k, v in zip("ABC", angles, strict=True)),
        "EULER " + " ".join(f"EUL{k}{v:+.12f}" for k, v in zip(("PR", "NU", "ROT"), turned, strict=True)),
        "VECTOR " + " ".join(f"{k}{v:+.12f}" for k, v in zip(("BX", "BY", "BZ"), 3 * x, strict=True))
        + " " + " ".join(f"{k}{v:+.12f}" for k, v in zip(("NX", "NY", "NZ"), 2 * z, strict=True)),
        "POINTS " + " ".join(f"P{n}{k}{v:+.12f}" for n, p in enumerate(points, 1)
                             for k, v in zip("XYZ", p, strict=True)),
    ]  # fmt: skip
    for text in texts:
        found = plane(f"PLANE {text} TURN MB MAX FMAX SEQ- TABLE ROT")
        assert np.array(found.turn) == pytest.approx(matrix, abs=1e-10)
        assert found.branch == -1 and found.turns


def test_relativ_turns_about_the_axes_of_the_plane() -> None:
    first = plane("PLANE SPATIAL SPA+30 SPB+0 SPC+20 STAY")
    found = plane("PLANE RELATIV SPB+10 STAY", first)
    wanted = np.array(first.turn) @ Rotation.from_euler("y", 10, degrees=True).as_matrix()
    assert np.array(found.turn) == pytest.approx(wanted)


def test_angles_of_zero_turn_nothing() -> None:
    assert plane("PLANE SPATIAL SPA+0 SPB0 SPC-0 STAY").turn is None
    assert plane("PLANE RESET TURN FMAX").ends
