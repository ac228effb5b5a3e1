"""Doubts about the size of the error: what is not looked at has to be small."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from olp.checks import doubt_size
from olp.workflows.session import Session

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"


@pytest.mark.parametrize("job", ("bridge-cmm", "nasty"))
def test_no_error_in_the_box_is_above_its_bound(job: str) -> None:
    """Also where it waves between the places at which it is computed."""
    model = Session.start(PROGRAMS / job / "machine.toml").loaded("hold").model
    rng = np.random.default_rng(7)
    low, high = model.box_mm.T
    place = low + (high - low) * rng.random((4000, 3))
    tools = rng.uniform(-150.0, 150.0, (3, 3))
    error = np.stack([model.error(place, tool) for tool in tools])
    largest = float(np.linalg.norm(error, axis=2).max())
    assert 0.0 < largest <= doubt_size._most_mm(model, tools) < 4.0 * largest


def test_with_backlash_all_waypoints_are_looked_at() -> None:
    model = Session.start(PROGRAMS / "haas-mill" / "machine.toml").loaded("hold").model
    assert doubt_size._most_mm(model, np.zeros((1, 3))) == np.inf
